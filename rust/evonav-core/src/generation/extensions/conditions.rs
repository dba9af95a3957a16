//! Open and close doors and furniture; switch lamps and screens.

use crate::{
    Error,
    assets::{
        part::Part,
        shapes::{drawn_openness, shows_light},
    },
    generation::{
        extensions::{clearance::has_clearance, transition::Transition},
        record::{EvolutionRecord, StateChangeRecord},
        stage::stage_world::StageWorld,
    },
    geometry::Aabb,
    house::{HouseDelta, StateChange},
    world::scene::Scene,
};

/// Openness values from which the new one is drawn.
const LEVELS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// Smallest change of openness.
const LEAST_CHANGE: f64 = 0.125;
/// Largest distance of the bottom of an object from the top of a part on which it may stand.
const BEARING_M: f64 = 0.03;

/// A door or an object that can open.
struct Openable {
    id: String,
    category: String,
    openness: f64,
}

impl Transition<'_> {
    /// Open or close furniture and other objects, if there is room for the parts that swing out.
    pub(crate) fn open_objects(
        &self,
        world: StageWorld,
        count: usize,
        record: &mut EvolutionRecord,
    ) -> Result<StageWorld, Error> {
        let house = &world.house;
        let objects = house.objects.iter().zip(&world.layout.items);
        let openables = objects.filter(|(object, _)| {
            self.may_change(house, object.room) && !is_new(record, &object.id)
        });
        let openables = openables.filter_map(|(object, item)| {
            Some(Openable {
                id: object.id.clone(),
                category: item.asset.category.clone(),
                // Objects whose shape does not show the openness are excluded: nothing would
                // change.
                openness: drawn_openness(&item.asset)
                    .map(|drawn| object.openness.unwrap_or(drawn))?,
            })
        });
        let openables = openables.collect();
        self.open(world, openables, count, "OPENABLES", record)
    }

    /// Open or close doors with a leaf between two rooms, as long as everything stays reachable.
    pub(crate) fn open_doors(
        &self,
        world: StageWorld,
        count: usize,
        record: &mut EvolutionRecord,
    ) -> Result<StageWorld, Error> {
        let house = &world.house;
        let room_of = |id: &String| house.rooms.iter().position(|room| room.id == *id);
        let doors = house.doors.iter().filter(|door| {
            door.asset_id.starts_with("Doorway")
                && door.room_ids[0] != door.room_ids[1]
                && door.room_ids.iter().all(|id| self.may_change(house, room_of(id)))
        });
        let openables = doors.map(|door| Openable {
            id: door.id.clone(),
            category: "Doorway".to_owned(),
            openness: door.openness,
        });
        let openables = openables.collect();
        self.open(world, openables, count, "DOORS", record)
    }

    fn open(
        &self,
        mut world: StageWorld,
        mut openables: Vec<Openable>,
        count: usize,
        cause: &str,
        record: &mut EvolutionRecord,
    ) -> Result<StageWorld, Error> {
        let mut stream = self.stream(cause);
        stream.shuffle(&mut openables);
        let mut num_changed = 0;
        for one in openables {
            if num_changed == count {
                break;
            }
            let is_other = |level: &f64| (level - one.openness).abs() >= LEAST_CHANGE;
            let mut levels: Vec<f64> = LEVELS.into_iter().filter(is_other).collect();
            stream.shuffle(&mut levels);
            for level in levels {
                let change = StateChange { id: one.id.clone(), openness: Some(level), is_on: None };
                let delta = HouseDelta { states: vec![change], ..HouseDelta::default() };
                let next = self.rebuild(world.house.apply(&delta)?)?;
                let [old, new] = [&world, &next].map(|world| &world.layout.scene);
                let is_valid =
                    has_clearance(old, new, &one.id) && supports_stay(&world, old, new, &one.id);
                if is_valid && self.preserves_access(&world, &next)? {
                    record.states.push(StateChangeRecord {
                        id: one.id.clone(),
                        category: one.category.clone(),
                        field: "openness",
                        before: one.openness,
                        after: level,
                        cause: cause.to_owned(),
                    });
                    world = next;
                    num_changed += 1;
                    break;
                }
            }
        }
        Ok(world)
    }

    /// Switch lamps and screens: on if they are off, off if they are on.
    pub(crate) fn switch_objects(
        &self,
        world: StageWorld,
        count: usize,
        record: &mut EvolutionRecord,
    ) -> Result<StageWorld, Error> {
        let house = &world.house;
        let shows = |&index: &usize| {
            self.may_change(house, house.objects[index].room)
                && !is_new(record, &house.objects[index].id)
                && shows_light(&world.layout.items[index].asset)
        };
        let mut lights: Vec<usize> = (0..house.objects.len()).filter(shows).collect();
        self.stream("SWITCHES").shuffle(&mut lights);
        lights.truncate(count);
        if lights.is_empty() {
            return Ok(world);
        }
        let mut delta = HouseDelta::default();
        for index in lights {
            let object = &house.objects[index];
            let is_on = object.is_on.unwrap_or(false);
            let id = object.id.clone();
            delta.states.push(StateChange { id: id.clone(), openness: None, is_on: Some(!is_on) });
            record.states.push(StateChangeRecord {
                id,
                category: world.layout.items[index].asset.category.clone(),
                field: "isOn",
                before: f64::from(u8::from(is_on)),
                after: f64::from(u8::from(!is_on)),
                cause: "SWITCHES".to_owned(),
            });
        }
        self.rebuild(house.apply(&delta)?)
    }
}

/// Return whether the objects on a body stay where they are in `new` and do not stand on parts that
/// moved.
fn supports_stay(world: &StageWorld, old: &Scene, new: &Scene, id: &str) -> bool {
    let body = |scene: &'_ Scene, id: &str| scene.bodies.iter().position(|body| body.id == id);
    let (Some(before), Some(after)) = (body(old, id), body(new, id)) else { return false };
    let Some(index) = world.house.object_index(id) else { return true };
    let left: Vec<Aabb> = old.bodies[before]
        .parts
        .iter()
        .filter(|part| !new.bodies[after].parts.contains(part))
        .map(Part::aabb)
        .collect();
    world.house.objects[index].children.iter().all(|&child| {
        let (before, after) = (old.first_object + child, new.first_object + child);
        let Some((then, now)) = old.bodies.get(before).zip(new.bodies.get(after)) else {
            return false;
        };
        let bears = |part: &Aabb| {
            (part.max_m[1] - then.aabb.min_m[1]).abs() < BEARING_M
                && [0, 2].iter().all(|&axis| {
                    part.min_m[axis] <= then.aabb.max_m[axis]
                        && then.aabb.min_m[axis] <= part.max_m[axis]
                })
        };
        then.aabb == now.aabb && !left.iter().any(bears)
    })
}

/// Return whether an object was inserted at this transition; its state does not change then.
fn is_new(record: &EvolutionRecord, id: &str) -> bool {
    record.additions.iter().any(|object| object.id == id)
}
