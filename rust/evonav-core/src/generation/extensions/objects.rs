//! Remove and insert small objects.

use crate::{
    Error,
    assets::{Asset, Catalogue, Split},
    generation::{
        extensions::{clearance::has_clearance, transition::Transition},
        record::{EvolutionRecord, ObjectRecord},
        stage::stage_world::StageWorld,
    },
    house::{AddedObject, House, HouseDelta},
    rng::Stream,
    world::{
        layout::{
            Layout,
            surfaces::{FITTINGS, sample_surface_place},
        },
        scene::Scene,
    },
};

/// Number of objects drawn for one insertion before it is given up.
const INSERTION_TRIES: usize = 20;

impl Transition<'_> {
    /// Remove pickupable objects on which nothing stands.
    pub(crate) fn remove(
        &self,
        world: StageWorld,
        count: usize,
        record: &mut EvolutionRecord,
    ) -> Result<StageWorld, Error> {
        let (house, layout) = (&world.house, &world.layout);
        let can_go = |&index: &usize| {
            let (object, item) = (&house.objects[index], &layout.items[index]);
            self.may_change(house, object.room)
                && item.asset.is_pickupable
                && object.children.is_empty()
                && self.generator.during.is_none_or(|during| object.id != during.target_id)
                && record.changes.iter().all(|change| change.id != object.id)
                && !FITTINGS.contains(&item.asset.category.as_str())
        };
        let mut candidates: Vec<usize> = (0..layout.items.len()).filter(can_go).collect();
        self.stream("REMOVAL").shuffle(&mut candidates);
        candidates.truncate(count);
        if candidates.is_empty() {
            return Ok(world);
        }
        let records = candidates.iter().map(|&i| object_record(house, layout, i, "REMOVAL"));
        record.removals.extend(records);
        let removed = candidates.iter().map(|&index| house.objects[index].id.clone()).collect();
        let delta = HouseDelta { removed, ..HouseDelta::default() };
        self.rebuild(house.apply(&delta)?)
    }

    /// Insert new objects on furniture.
    pub(crate) fn insert(
        &self,
        mut world: StageWorld,
        count: usize,
        record: &mut EvolutionRecord,
    ) -> Result<StageWorld, Error> {
        let mut stream = self.stream("INSERTION");
        let kind = if self.generator.during.is_some() { "during" } else { "new" };
        let ids = (0..).map(|number| format!("{kind}|{}|{number}", self.stage));
        let is_new = |id: &String| world.house.object_index(id).is_none();
        let ids: Vec<String> = ids.filter(is_new).take(count).collect();
        for id in ids {
            for _ in 0..INSERTION_TRIES {
                let Some(added) = self.sample_insertion(&world, &id, &mut stream)? else {
                    continue;
                };
                let delta = HouseDelta { added: vec![added], ..HouseDelta::default() };
                let next = self.rebuild(world.house.apply(&delta)?)?;
                // The object may overhang its support a little where an agent has to pass, or be
                // under an object that hangs in the air in the file and falls in the scene.
                let [old, new] = [&world, &next].map(|world| &world.layout.scene);
                if has_clearance(old, new, &id) && self.preserves_access(&world, &next)? {
                    if let Some(index) = next.house.object_index(&id) {
                        let (house, layout) = (&next.house, &next.layout);
                        record.additions.push(object_record(house, layout, index, "INSERTION"));
                    }
                    world = next;
                    break;
                }
            }
        }
        Ok(world)
    }

    /// Draw an object to insert and its place. Category and support are drawn by how often ProcTHOR
    /// has one on the other, and by how typical the category is of the room.
    fn sample_insertion(
        &self,
        world: &StageWorld,
        id: &str,
        stream: &mut Stream,
    ) -> Result<Option<AddedObject>, Error> {
        let (house, layout) = (&world.house, &world.layout);
        let catalogue = self.generator.catalogue;
        let choices = self.insertion_choices(world);
        let weights: Vec<f64> = choices.iter().map(|&(_, _, weight)| weight).collect();
        let Some(drawn) = stream.choose_weighted(&weights) else { return Ok(None) };
        let (support, category, _) = choices[drawn];
        let split = split_of(house, catalogue);
        let fits = |asset: &&Asset| {
            asset.is_pickupable
                && (split.is_none() || asset.split.is_none() || asset.split == split)
        };
        let assets: Vec<&Asset> = catalogue
            .assets_in(category)
            .iter()
            .filter_map(|id| catalogue.get(id))
            .filter(fits)
            .collect();
        let Some(asset) = assets.get(stream.below(assets.len())) else { return Ok(None) };
        // Before it has a place its position does not matter, as long as it is on its support.
        let mut added = AddedObject {
            id: id.to_owned(),
            asset_id: asset.id.clone(),
            position_m: layout.items[support].placement.position_m,
            rotation_deg: [0.0; 3],
            parent: Some(house.objects[support].id.clone()),
        };
        let delta = HouseDelta { added: vec![added.clone()], ..HouseDelta::default() };
        let probe = house.apply(&delta)?;
        let scene = Scene::build(&probe, catalogue, self.unknown)?;
        let layout = Layout::new(&probe, catalogue, self.unknown, scene)?;
        let support = added.parent.as_ref().and_then(|parent| probe.object_index(parent));
        let (Some(index), Some(support)) = (probe.object_index(id), support) else {
            return Ok(None);
        };
        let tries = self.generator.parameters.placement_tries;
        let place =
            (0..tries).find_map(|_| sample_surface_place(&layout, index, &[support], -1.0, stream));
        Ok(place.map(|place| {
            (added.position_m, added.rotation_deg) = (place.position_m, place.rotation_deg);
            added
        }))
    }

    /// List the possible insertions: index of the support, category, weight.
    fn insertion_choices(&self, world: &StageWorld) -> Vec<(usize, &'static str, f64)> {
        let (house, layout) = (&world.house, &world.layout);
        let catalogue = Catalogue::bundled();
        let mut choices = Vec::new();
        for (support, item) in layout.items.iter().enumerate() {
            let room = house.objects[support].room;
            if !item.is_on_floor
                || item.asset.surfaces_m.is_empty()
                || !self.may_change(house, room)
            {
                continue;
            }
            let room_type = room.map_or("", |room| house.rooms[room].room_type.as_str());
            let has = |category: &str| {
                let in_room = (0..layout.items.len()).filter(|&i| house.objects[i].room == room);
                in_room.into_iter().any(|i| layout.items[i].asset.category == category)
            };
            for category in catalogue.categories() {
                let Some(rule) = catalogue.placement(category) else { continue };
                let weight = catalogue.rest_probability(category, &item.asset.category)
                    * rule.room_weight(room_type);
                let is_crowd = weight > 0.0 && !rule.multiple_per_room && has(category);
                if weight > 0.0 && !is_crowd && !FITTINGS.contains(&category) {
                    choices.push((support, category, weight));
                }
            }
        }
        choices
    }
}

/// Return the record of an object.
fn object_record(house: &House, layout: &Layout, index: usize, cause: &str) -> ObjectRecord {
    let (object, asset) = (&house.objects[index], &layout.items[index].asset);
    ObjectRecord {
        id: object.id.clone(),
        category: asset.category.clone(),
        asset_id: object.asset_id.clone(),
        position_m: object.position_m,
        rotation_deg: object.rotation_deg,
        support_id: object.parent.map(|parent| house.objects[parent].id.clone()),
        cause: cause.to_owned(),
    }
}

/// Return the split of ProcTHOR's assets with which a house is furnished; `None` if it mixes them.
fn split_of(house: &House, catalogue: &Catalogue) -> Option<Split> {
    let mut splits =
        house.objects.iter().filter_map(|object| catalogue.get(&object.asset_id)?.split);
    let first = splits.next()?;
    splits.all(|split| split == first).then_some(first)
}
