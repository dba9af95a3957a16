//! Changes between two stages of a house.

use std::collections::{BTreeSet, HashMap};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::{Error, geometry::Vec3, house::House};

/// All changes of one evolution: the paper's ΔH, and the extensions' changes.
///
/// The lists are applied in the order of the fields, each in its own order.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HouseDelta {
    /// Moves. An object that stands on a moved one keeps its own position unless it is listed too.
    #[serde(default)]
    pub moves: Vec<ObjectMove>,
    /// Ids of objects that vanish; objects that still stand on one must be listed too.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub removed: Vec<String>,
    /// New objects.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub added: Vec<AddedObject>,
    /// Doors and objects that are opened, closed, switched on or switched off.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub states: Vec<StateChange>,
}

/// The new place of one object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectMove {
    /// Id of the moved object.
    pub id: String,
    /// New centre of its box.
    pub position_m: Vec3,
    /// New Unity Euler angles, degrees.
    pub rotation_deg: Vec3,
    /// Id of the object that it stands on or in afterwards; `None` for the floor or a wall.
    pub parent: Option<String>,
}

/// An object that was not there before.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AddedObject {
    /// Id, unique in the house.
    pub id: String,
    /// Key of the asset catalogue.
    pub asset_id: String,
    /// Centre of its box.
    pub position_m: Vec3,
    /// Unity Euler angles, degrees.
    pub rotation_deg: Vec3,
    /// Id of the object that it stands on or in: an object of the house, or one added before.
    pub parent: Option<String>,
}

/// The new state of one door or object; a field that is `None` stays as it is.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StateChange {
    /// Id of the door or object.
    pub id: String,
    /// Openness: 0 closed, 1 open.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub openness: Option<f64>,
    /// `isOn` of a lamp or screen; not for doors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub is_on: Option<bool>,
}

impl HouseDelta {
    /// Read a delta: `{"moves": [{"id", "position_m", "rotation_deg", "parent"}], "added": [...],
    /// "removed": [id], "states": [...]}`. Each key may be left out.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] saying what is malformed, and where.
    pub fn from_json(json: &str) -> Result<Self, Error> {
        let malformed = |error: serde_json::Error| {
            Error::invalid("delta", error, "{\"moves\", \"added\", \"removed\", \"states\"}")
        };
        serde_json::from_str(json).map_err(malformed)
    }

    /// Write the delta as [`Self::from_json`] reads it.
    pub fn to_json(&self) -> String {
        // Numbers and strings are all that is written, which cannot fail.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Return whether the delta changes nothing.
    pub fn is_empty(&self) -> bool {
        let Self { moves, removed, added, states } = self;
        moves.is_empty() && removed.is_empty() && added.is_empty() && states.is_empty()
    }

    /// Iterate over the ids of all that changes, in the order in which it is applied.
    pub fn ids(&self) -> impl Iterator<Item = &String> {
        let Self { moves, removed, added, states } = self;
        let moved = moves.iter().map(|change| &change.id);
        let added = added.iter().map(|object| &object.id);
        moved.chain(removed).chain(added).chain(states.iter().map(|change| &change.id))
    }

    /// Return the delta without the changes of some objects and doors.
    #[must_use]
    pub fn without(&self, ids: &BTreeSet<String>) -> Self {
        let mut rest = self.clone();
        rest.moves.retain(|change| !ids.contains(&change.id));
        rest.removed.retain(|id| !ids.contains(id));
        rest.added.retain(|object| !ids.contains(&object.id));
        rest.states.retain(|change| !ids.contains(&change.id));
        rest
    }
}

/// The objects of a document, taken out of their tree so that they can be moved.
struct Tree<'a> {
    house: &'a House,
    nodes: Vec<Loose>,
    roots: Vec<usize>,
    index: HashMap<&'a str, usize>,
}

/// One object without its children.
struct Loose {
    fields: Map<String, Value>,
    parent: Option<usize>,
    children: Vec<usize>,
}

impl House {
    /// Apply a delta: return the house after it.
    ///
    /// The document changes only as the delta states. An object that is new or has a new parent
    /// becomes the last child of its parent. Since [`House::objects`] follows the document, indices
    /// change; ids stay.
    ///
    /// # Errors
    /// [`Error::House`] naming object and field: for an object or parent that does not exist, an
    /// added id that exists already, an object that is moved or removed twice, that would stand on
    /// itself, or that is removed while something still stands on it, a state outside its domain,
    /// or a result that is not a valid house.
    pub fn apply(&self, delta: &HouseDelta) -> Result<Self, Error> {
        let mut tree = Tree::of(self);
        let mut is_moved = vec![false; tree.nodes.len()];
        for step in &delta.moves {
            let index = tree.find(&step.id, &step.id, "id")?;
            if std::mem::replace(&mut is_moved[index], true) {
                return Err(self.error(&step.id, "id", "is moved twice"));
            }
            tree.move_to(index, step)?;
        }
        tree.remove(&delta.removed)?;
        delta.added.iter().try_for_each(|object| tree.add(object))?;
        let mut document = self.document_without_objects();
        for change in &delta.states {
            tree.set_state(change, &mut document)?;
        }
        let roots = std::mem::take(&mut tree.roots);
        document.insert("objects".to_owned(), assemble(&mut tree.nodes, &roots));
        Self::from_document(&self.name, Value::Object(document))
    }

    /// Return a copy of the document with `objects` (kept in place) set to null.
    fn document_without_objects(&self) -> Map<String, Value> {
        let fields = self.document.as_object().into_iter().flatten();
        fields
            .map(|(key, value)| {
                let value = if key == "objects" { Value::Null } else { value.clone() };
                (key.clone(), value)
            })
            .collect()
    }
}

impl<'a> Tree<'a> {
    /// Take the objects out of a house's document, in the order of [`House::objects`].
    fn of(house: &'a House) -> Self {
        let mut nodes = Vec::with_capacity(house.objects.len());
        collect(house.document.get("objects"), &mut nodes);
        for (node, object) in nodes.iter_mut().zip(&house.objects) {
            node.parent = object.parent;
            node.children.clone_from(&object.children);
        }
        let roots = (0..nodes.len()).filter(|&i| nodes[i].parent.is_none()).collect();
        let ids = house.objects.iter().enumerate();
        let index = ids.map(|(index, object)| (object.id.as_str(), index)).collect();
        Self { house, nodes, roots, index }
    }

    /// Return the index of the object `wanted`, named by `field` of object `id`.
    fn find(&self, wanted: &str, id: &str, field: &str) -> Result<usize, Error> {
        self.index.get(wanted).copied().ok_or_else(|| {
            let message = format!("is {wanted:?}, which is no object of the house");
            self.house.error(id, field, &message)
        })
    }

    fn place(
        &mut self,
        index: usize,
        id: &str,
        [position_m, rotation_deg]: [Vec3; 2],
    ) -> Result<(), Error> {
        if position_m.iter().chain(&rotation_deg).any(|value| !value.is_finite()) {
            let message =
                format!("is {position_m:?} turned {rotation_deg:?}, expected finite numbers");
            return Err(self.house.error(id, "position", &message));
        }
        for (key, [x, y, z]) in [("position", position_m), ("rotation", rotation_deg)] {
            self.nodes[index].fields.insert(key.to_owned(), json!({"x": x, "y": y, "z": z}));
        }
        Ok(())
    }

    fn add(&mut self, object: &'a AddedObject) -> Result<(), Error> {
        let AddedObject { id, asset_id, position_m, rotation_deg, parent } = object;
        if self.index.contains_key(id.as_str()) {
            return Err(self.house.error(id, "id", "is added, but is in the house already"));
        }
        let parent = parent.as_ref().map(|above| self.find(above, id, "parent")).transpose()?;
        let index = self.nodes.len();
        let mut fields = Map::new();
        fields.insert("id".to_owned(), json!(id));
        fields.insert("assetId".to_owned(), json!(asset_id));
        fields.insert("kinematic".to_owned(), json!(false));
        self.nodes.push(Loose { fields, parent, children: Vec::new() });
        self.place(index, id, [*position_m, *rotation_deg])?;
        self.children_of(parent).push(index);
        self.index.insert(id, index);
        Ok(())
    }

    fn move_to(&mut self, index: usize, step: &ObjectMove) -> Result<(), Error> {
        self.place(index, &step.id, [step.position_m, step.rotation_deg])?;
        let above = step.parent.as_ref();
        let parent = above.map(|id| self.find(id, &step.id, "parent")).transpose()?;
        if std::iter::successors(parent, |&above| self.nodes[above].parent)
            .any(|above| above == index)
        {
            let message = format!("{:?} stands on the object itself", step.parent);
            return Err(self.house.error(&step.id, "parent", &message));
        }
        let before = std::mem::replace(&mut self.nodes[index].parent, parent);
        if before != parent {
            self.children_of(before).retain(|&child| child != index);
            self.children_of(parent).push(index);
        }
        Ok(())
    }

    fn remove(&mut self, ids: &[String]) -> Result<(), Error> {
        let mut is_removed = vec![false; self.nodes.len()];
        for id in ids {
            let index = self.find(id, id, "id")?;
            if std::mem::replace(&mut is_removed[index], true) {
                return Err(self.house.error(id, "id", "is removed twice"));
            }
        }
        for id in ids {
            let index = self.find(id, id, "id")?;
            if let Some(&left) = self.nodes[index].children.iter().find(|&&i| !is_removed[i]) {
                let borne = self.nodes[left].fields.get("id").and_then(Value::as_str);
                let message =
                    format!("is removed, but still bears {:?}", borne.unwrap_or_default());
                return Err(self.house.error(id, "children", &message));
            }
        }
        for id in ids {
            let index = self.find(id, id, "id")?;
            self.index.remove(id.as_str());
            let parent = self.nodes[index].parent;
            self.children_of(parent).retain(|&child| child != index);
        }
        Ok(())
    }

    fn set_state(
        &mut self,
        change: &StateChange,
        document: &mut Map<String, Value>,
    ) -> Result<(), Error> {
        let StateChange { id, openness, is_on } = change;
        let fail = |field: &str, message: &str| Err(self.house.error(id, field, message));
        if let Some(value) = openness.filter(|value| !(0.0..=1.0).contains(value)) {
            return fail("openness", &format!("is {value}, expected 0 to 1"));
        }
        let fields = match self.house.doors.iter().position(|door| door.id == *id) {
            Some(_) if is_on.is_some() => return fail("isOn", "is given for a door"),
            Some(door) => {
                let entry = document.get_mut("doors").and_then(|doors| doors.get_mut(door));
                entry.and_then(Value::as_object_mut)
            }
            None => {
                let index = self.find(id, id, "id")?;
                Some(&mut self.nodes[index].fields)
            }
        };
        if let Some(fields) = fields {
            openness.map(|value| fields.insert("openness".to_owned(), json!(value)));
            is_on.map(|value| fields.insert("isOn".to_owned(), json!(value)));
        }
        Ok(())
    }

    fn children_of(&mut self, parent: Option<usize>) -> &mut Vec<usize> {
        match parent {
            Some(parent) => &mut self.nodes[parent].children,
            None => &mut self.roots,
        }
    }
}

/// Collect the objects depth first, as the view lists them; `children` keys stay, emptied.
fn collect(list: Option<&Value>, loose: &mut Vec<Loose>) {
    for entry in list.and_then(Value::as_array).into_iter().flatten() {
        let children = entry.get("children");
        let fields = entry.as_object().into_iter().flatten().map(|(key, value)| {
            let is_list = key == "children" && value.is_array();
            (key.clone(), if is_list { Value::Array(Vec::new()) } else { value.clone() })
        });
        loose.push(Loose { fields: fields.collect(), parent: None, children: Vec::new() });
        collect(children, loose);
    }
}

/// Rebuild the list of the objects at `indices`, each with the objects that stand on it.
fn assemble(loose: &mut [Loose], indices: &[usize]) -> Value {
    let entry = |&index: &usize| {
        let mut fields = std::mem::take(&mut loose[index].fields);
        let children = std::mem::take(&mut loose[index].children);
        if !children.is_empty() || fields.get("children").is_some_and(Value::is_array) {
            fields.insert("children".to_owned(), assemble(loose, &children));
        }
        Value::Object(fields)
    };
    Value::Array(indices.iter().map(entry).collect())
}
