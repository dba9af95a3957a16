//! Small things that vanish and appear.

use crate::{
    Error,
    assets::{Asset, Catalogue, Split},
    generation::{
        extensions::{clearance::has_room, transition::Transition},
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

/// Things drawn for one arrival before it is given up.
const ARRIVAL_TRIES: usize = 20;

impl Transition<'_> {
    /// Takes away things that can be carried and on which nothing stands.
    pub(crate) fn remove(
        &self,
        world: StageWorld,
        count: usize,
        record: &mut EvolutionRecord,
    ) -> Result<StageWorld, Error> {
        let (house, layout) = (&world.house, &world.layout);
        let can_go = |&index: &usize| {
            let (object, item) = (&house.objects[index], &layout.items[index]);
            self.is_free(house, object.room)
                && item.asset.is_pickupable
                && object.children.is_empty()
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
        self.rebuilt(house.apply(&delta)?)
    }

    /// Puts new things on furniture.
    pub(crate) fn insert(
        &self,
        mut world: StageWorld,
        count: usize,
        record: &mut EvolutionRecord,
    ) -> Result<StageWorld, Error> {
        let mut stream = self.stream("INSERTION");
        let ids = (0..).map(|number| format!("new|{}|{number}", self.stage));
        let is_new = |id: &String| world.house.object_index(id).is_none();
        let ids: Vec<String> = ids.filter(is_new).take(count).collect();
        for id in ids {
            for _ in 0..ARRIVAL_TRIES {
                let Some(added) = self.arrival(&world, &id, &mut stream)? else { continue };
                let delta = HouseDelta { added: vec![added], ..HouseDelta::default() };
                let next = self.rebuilt(world.house.apply(&delta)?)?;
                // It may overhang its support by a little, where somebody has to pass, or be under
                // something that the file has in the air and the scene lets down.
                let [old, new] = [&world, &next].map(|world| &world.layout.scene);
                if has_room(old, new, &id) && self.reaches_as_much(&world, &next)? {
                    if let Some(index) = next.house.object_index(&id) {
                        record.additions.push(object_record(
                            &next.house,
                            &next.layout,
                            index,
                            "INSERTION",
                        ));
                    }
                    world = next;
                    break;
                }
            }
        }
        Ok(world)
    }

    /// A thing that could come, and where: category and support by how often ProcTHOR has one on
    /// the other, and by how typical the category is of the room.
    fn arrival(
        &self,
        world: &StageWorld,
        id: &str,
        stream: &mut Stream,
    ) -> Result<Option<AddedObject>, Error> {
        let (house, layout) = (&world.house, &world.layout);
        let catalogue = self.generator.catalogue;
        let kinds = self.kinds(world);
        let weights: Vec<f64> = kinds.iter().map(|&(_, _, weight)| weight).collect();
        let Some(drawn) = stream.choose_weighted(&weights) else { return Ok(None) };
        let (support, category, _) = kinds[drawn];
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
        // Where it is before it has a place does not matter, as long as it is on something.
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

    /// What could stand on what: index of the support, category, weight.
    fn kinds(&self, world: &StageWorld) -> Vec<(usize, &'static str, f64)> {
        let (house, layout) = (&world.house, &world.layout);
        let catalogue = Catalogue::bundled();
        let mut kinds = Vec::new();
        for (support, item) in layout.items.iter().enumerate() {
            let room = house.objects[support].room;
            if !item.is_on_floor || item.asset.surfaces_m.is_empty() || !self.is_free(house, room) {
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
                    kinds.push((support, category, weight));
                }
            }
        }
        kinds
    }
}

/// An object as records name it.
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

/// Split of ProcTHOR's assets that a house is furnished from; `None` if it mixes them.
fn split_of(house: &House, catalogue: &Catalogue) -> Option<Split> {
    let mut splits =
        house.objects.iter().filter_map(|object| catalogue.get(&object.asset_id)?.split);
    let first = splits.next()?;
    splits.all(|split| split == first).then_some(first)
}
