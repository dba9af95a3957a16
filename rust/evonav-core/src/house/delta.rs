//! Changes between two stages of a house.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::House;
use crate::{Error, geometry::Vec3};

/// What an evolution changes: the paper's ΔH.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HouseDelta {
    /// Moves, applied in order. What stands on a moved object keeps its own position unless it
    /// is listed too.
    pub moves: Vec<ObjectMove>,
}

/// A new place for one object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectMove {
    /// Object that moves.
    pub id: String,
    /// New centre of its box.
    pub position_m: Vec3,
    /// New Unity Euler angles, degrees.
    pub rotation_deg: Vec3,
    /// What it stands on or in afterwards; `None` for the floor or a wall.
    pub parent: Option<String>,
}

impl HouseDelta {
    /// Reads a delta: `{"moves": [{"id", "position_m", "rotation_deg", "parent"}]}`.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] saying what is malformed, and where.
    pub fn from_json(json: &str) -> Result<Self, Error> {
        let malformed = |error: serde_json::Error| {
            Error::invalid(
                "delta",
                error,
                "{\"moves\": [{\"id\", \"position_m\", \"rotation_deg\", \"parent\"}]}",
            )
        };
        serde_json::from_str(json).map_err(malformed)
    }

    /// The delta as [`Self::from_json`] reads it.
    pub fn to_json(&self) -> String {
        // Numbers and strings alone: writing them cannot fail.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// An object of the document, taken out of the tree.
struct Loose {
    fields: Map<String, Value>,
    parent: Option<usize>,
    children: Vec<usize>,
}

impl House {
    /// This house after `delta`.
    ///
    /// The document changes only in the position, rotation and place in the tree of what moves:
    /// an object with a new parent becomes the last of its children. Since [`House::objects`]
    /// follows the document, a new parent changes indices; ids stay.
    ///
    /// # Errors
    /// [`Error::House`] if a move names an object or parent that is not there, the same object
    /// twice, would make an object stand on itself, or the result is no valid house.
    pub fn apply(&self, delta: &HouseDelta) -> Result<Self, Error> {
        let (mut loose, mut roots) = self.take_apart();
        let mut has_moved = vec![false; loose.len()];
        for step in &delta.moves {
            let fail = |field: &str, message: &str| self.error(&step.id, field, message);
            let index = self
                .object_index(&step.id)
                .ok_or_else(|| fail("id", "is no object of the house"))?;
            if std::mem::replace(&mut has_moved[index], true) {
                return Err(fail("id", "is moved twice"));
            }
            if step.position_m.iter().chain(&step.rotation_deg).any(|value| !value.is_finite()) {
                let message = format!("is {:?} turned {:?}", step.position_m, step.rotation_deg);
                return Err(fail("position", &format!("{message}, expected finite numbers")));
            }
            let parent = match &step.parent {
                None => None,
                Some(id) => {
                    let missing =
                        || fail("parent", &format!("is {id:?}, which is no object of the house"));
                    Some(self.object_index(id).ok_or_else(missing)?)
                }
            };
            if std::iter::successors(parent, |&above| loose[above].parent)
                .any(|above| above == index)
            {
                return Err(fail(
                    "parent",
                    &format!("{:?} stands on the object itself", step.parent),
                ));
            }
            let fields = &mut loose[index].fields;
            for (key, [x, y, z]) in [("position", step.position_m), ("rotation", step.rotation_deg)]
            {
                fields.insert(key.to_owned(), json!({"x": x, "y": y, "z": z}));
            }
            let before = std::mem::replace(&mut loose[index].parent, parent);
            if before != parent {
                before
                    .map_or(&mut roots, |p| &mut loose[p].children)
                    .retain(|&child| child != index);
                parent.map_or(&mut roots, |p| &mut loose[p].children).push(index);
            }
        }
        let mut document = self.document_without_objects();
        document.insert("objects".to_owned(), assemble(&mut loose, &roots));
        Self::from_document(&self.name, Value::Object(document))
    }

    /// Objects in the order of [`House::objects`], and which of them are roots.
    fn take_apart(&self) -> (Vec<Loose>, Vec<usize>) {
        let mut loose = Vec::with_capacity(self.objects.len());
        collect(self.document.get("objects"), &mut loose);
        for (entry, object) in loose.iter_mut().zip(&self.objects) {
            entry.parent = object.parent;
            entry.children.clone_from(&object.children);
        }
        let roots = (0..self.objects.len()).filter(|&i| self.objects[i].parent.is_none());
        (loose, roots.collect())
    }

    /// A copy of the document with `objects` (kept in place) set to null.
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

/// Depth first, as the view lists them; `children` keys stay, emptied.
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

/// The list of the objects at `indices`, each with what stands on it.
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
