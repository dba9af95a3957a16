//! Make houses.

use crate::{
    Error,
    assets::{Catalogue, UnknownAssets},
    geometry::Vec2,
    house::House,
    house_generation::{
        acceptance::{GRID_M, Walkable, problems},
        appearance::{HouseLook, sample_look},
        document::{Agent, Draft},
        doors::{Openings, sample_openings},
        hanging::{sample_hung, sample_windows},
        interior::{FreeFloor, Piece, Stock, furnish},
        objects::{HouseObject, Kind, listed},
        parameters::{HouseParameters, RoomSpec},
        small_objects,
        structure::Structure,
    },
    rng::Stream,
    world::{
        inspection::FindingKind,
        layout::{Layout, rounding::round_to, settled},
        scene::Scene,
    },
};

/// Largest number of times that objects with problems are taken out of a house, before it is
/// furnished again.
const MAX_REMOVALS: usize = 4;
/// Height from which an object that is to lie is dropped, and its least and largest tilt
/// (`small_objects._set_drop_heights` of the package `procthor`).
const DROP_M: f64 = 3.0;
const DROP_TILT_DEG: [f64; 2] = [3.0, 5.0];

/// Makes houses from seeds.
#[derive(Debug)]
pub struct HouseMaker {
    parameters: HouseParameters,
    stock: Stock,
}

/// One attempt at a house: the streams of its draws.
struct Attempt<'a> {
    maker: &'a HouseMaker,
    seed: u64,
    /// Numbers of the house, the floor plan and the furnishing.
    place: [i64; 3],
}

impl HouseMaker {
    /// Create a maker.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the parameter.
    pub fn new(parameters: HouseParameters) -> Result<Self, Error> {
        let catalogue = Catalogue::bundled();
        parameters.check(catalogue)?;
        let stock = Stock::of(catalogue, parameters.split);
        Ok(Self { parameters, stock })
    }

    /// Make the house of a seed and a number: the same one on every call.
    ///
    /// Every room can be entered, every open door can be passed, no object is in a wall or in
    /// another one, and none hangs in the air. Floor plans and furniture that do not satisfy this
    /// are drawn again, from streams of their own.
    ///
    /// # Errors
    /// [`Error::Simulation`] if no house passes the checks; then the parameters ask for rooms
    /// that hardly fit.
    pub fn make(&self, seed: u64, index: u64) -> Result<House, Error> {
        let specs = &self.parameters.room_specs;
        let weights: Vec<f64> = specs.iter().map(|spec| spec.weight).collect();
        let number = index as i64;
        let mut stream = stream_of(seed, "spec", &[number]);
        let spec = &specs[stream.choose_weighted(&weights).unwrap_or(0)];
        for floor_plan in 0..self.parameters.max_structures as i64 {
            let place = [number, floor_plan, 0];
            let attempt = Attempt { maker: self, seed, place };
            if let Some(house) = attempt.house(spec)? {
                return Ok(house);
            }
        }
        Err(Error::Simulation {
            message: format!(
                "house {index} of seed {seed}: none of {} floor plans of the room spec {:?} could be \
                 furnished so that every room can be entered: larger cells or fewer rooms may help",
                self.parameters.max_structures, spec.id
            ),
        })
    }
}

fn stream_of(seed: u64, label: &str, place: &[i64]) -> Stream {
    Stream::new(seed, &["house", label]).at(place)
}

impl Attempt<'_> {
    /// Return the stream of one step of this attempt.
    fn stream(&self, label: &str) -> Stream {
        stream_of(self.seed, label, &self.place)
    }

    /// Draw a floor plan and furnish it until a house passes; `None` if none does.
    fn house(mut self, spec: &RoomSpec) -> Result<Option<House>, Error> {
        let parameters = &self.maker.parameters;
        let structure = Structure::sample(parameters, spec, &mut self.stream("structure"));
        let Some(structure) = structure else { return Ok(None) };
        let openings = sample_openings(parameters, &structure, spec, &mut self.stream("doors"));
        let Some(openings) = openings else { return Ok(None) };
        let look =
            sample_look(&parameters.appearance, structure.rooms.len(), &mut self.stream("look"));
        for furnishing in 0..parameters.max_furnishings as i64 {
            self.place[2] = furnishing;
            let house = self.furnished(&structure, &openings, &look)?;
            if house.is_some() {
                return Ok(house);
            }
        }
        Ok(None)
    }

    /// Furnish a floor plan; `None` if the result does not pass.
    fn furnished(
        &self,
        structure: &Structure,
        openings: &Openings,
        look: &HouseLook,
    ) -> Result<Option<House>, Error> {
        let HouseMaker { parameters, stock } = self.maker;
        let catalogue = Catalogue::bundled();
        let (furniture, floors) = self.furniture(structure, openings);
        let windows = sample_windows(
            parameters,
            structure,
            openings,
            &furniture,
            &mut self.stream("windows"),
        );
        let hung = sample_hung(
            parameters,
            stock,
            structure,
            openings,
            &windows,
            &furniture,
            &mut self.stream("hung objects"),
        );
        let mut stream = self.stream("states");
        let mut objects = listed(parameters, structure, &furniture, hung, &mut stream);
        let origin = (self.seed, self.place[0] as u64);
        let draft = Draft { structure, openings, look, windows: &windows, origin };
        self.lay_down(&draft, &mut objects)?;
        let mut stream = self.stream("small objects");
        objects.extend(small_objects::sample(parameters, stock, structure, &objects, &mut stream));

        let (house, scene) = built(&draft, &waiting(&objects), None)?;
        let walkable = Walkable::of(&scene)?;
        let is_passed = openings.doors.iter().all(|door| walkable.passes(structure, door));
        let start = if is_passed { self.start(structure, &floors, &walkable)? } else { None };
        let Some(start) = start else { return Ok(None) };
        for (index, object) in objects.iter_mut().enumerate() {
            if object.parent.is_some() && object.kind == Kind::Furniture {
                // Members of groups come down from the top of the box that they are put on.
                object.position_m = scene.bodies[scene.first_object + index].oriented.centre_m;
            }
        }
        let mut layout = Layout::new(&house, catalogue, UnknownAssets::Error, scene)?;
        let rules = &parameters.small_objects;
        small_objects::place(rules, structure, &mut objects, &mut layout, &mut stream);
        self.without_problems(&draft, objects, start)
    }

    /// Furnish each room.
    fn furniture(
        &self,
        structure: &Structure,
        openings: &Openings,
    ) -> (Vec<Vec<Piece>>, Vec<FreeFloor>) {
        let HouseMaker { parameters, stock } = self.maker;
        let counts = &parameters.floor_objects.max_per_room;
        let weights: Vec<f64> = counts.iter().map(|(_, weight)| *weight).collect();
        let mut stream = stream_of(self.seed, "number of floor objects", &self.place[..1]);
        let num_tries = stream.choose_weighted(&weights).map_or(0, |choice| counts[choice].0);
        let furnished = structure.rooms.iter().enumerate().map(|(index, room)| {
            let [house, floor_plan, furnishing] = self.place;
            let place = [house, floor_plan, furnishing, index as i64];
            let mut stream = stream_of(self.seed, "floor objects", &place);
            let mut floor = FreeFloor::new(room.polygon_m(), &openings.passages);
            let room_type = &room.room_type;
            let pieces = furnish(parameters, stock, room_type, num_tries, &mut floor, &mut stream);
            (pieces, floor)
        });
        furnished.unzip()
    }

    /// Let the objects fall that lie on the floor instead of standing.
    fn lay_down(&self, draft: &Draft<'_>, objects: &mut [HouseObject]) -> Result<(), Error> {
        let mut stream = self.stream("lying objects");
        let lying = &self.maker.parameters.floor_objects.lying;
        let mut is_any = false;
        for object in objects.iter_mut().filter(|object| object.kind == Kind::Furniture) {
            let probability = lying.get(&object.asset.category).copied().unwrap_or(0.0);
            if probability > 0.0 && stream.uniform() < probability {
                let [low, high] = DROP_TILT_DEG;
                object.position_m[1] = DROP_M;
                object.rotation_deg = [low + (high - low) * stream.uniform(), 0.0, 0.0];
                object.rotation_deg[1] = 360.0 * stream.uniform();
                is_any = true;
            }
        }
        if !is_any {
            return Ok(());
        }
        let (house, scene) = built(draft, objects, None)?;
        let delta = settled(&house, Catalogue::bundled(), UnknownAssets::Error, &scene)?;
        for step in delta.moves {
            if let Some(object) = objects.iter_mut().find(|object| object.id == step.id) {
                object.position_m = step.position_m;
                object.rotation_deg = step.rotation_deg;
            }
        }
        Ok(())
    }

    /// Choose the start: the place nearest to the middle of the largest free rectangle of a random
    /// room, from which every room can be entered (`agent.generate_starting_pose`).
    fn start(
        &self,
        structure: &Structure,
        floors: &[FreeFloor],
        walkable: &Walkable,
    ) -> Result<Option<Agent>, Error> {
        let mut stream = self.stream("start");
        let mut rooms: Vec<usize> = (0..floors.len()).collect();
        stream.shuffle(&mut rooms);
        let yaw_deg = 90.0 * stream.below(4) as f64;
        let on_grid = |point_m: Vec2| point_m.map(|value| round_to(value, GRID_M));
        let middles = rooms.iter().filter_map(|&room| floors[room].largest());
        let mut points = middles.map(|rectangle| on_grid(rectangle.centre_m()));
        let Some(point_m) = points.find(|&point_m| walkable.is_free(point_m)) else {
            return Ok(None);
        };
        let least = self.maker.parameters.min_places_per_room;
        let reaches_all = walkable.reaches_all(structure, point_m, least)?;
        Ok(reaches_all.then_some(Agent { point_m, yaw_deg }))
    }

    /// Take out objects that have a problem, of two that touch the smaller one; `None` if problems
    /// are left.
    fn without_problems(
        &self,
        draft: &Draft<'_>,
        mut objects: Vec<HouseObject>,
        start: Agent,
    ) -> Result<Option<House>, Error> {
        let (bare_house, bare_scene) = built(draft, &[], Some(start))?;
        for _ in 0..MAX_REMOVALS {
            let (house, scene) = built(draft, &objects, Some(start))?;
            let found = problems((&bare_house, &bare_scene), (&house, &scene));
            if found.is_empty() {
                return Ok(Some(house));
            }
            let mut is_out = vec![false; objects.len()];
            for problem in found {
                let ids = match problem.kind {
                    FindingKind::Penetration => vec![problem.id, problem.other_id],
                    _ => vec![problem.id],
                };
                let involved =
                    ids.iter().filter_map(|id| objects.iter().position(|object| object.id == *id));
                let volume_m3 =
                    |&index: &usize| objects[index].asset.size_m.iter().product::<f64>();
                if let Some(index) = involved.min_by(|a, b| volume_m3(a).total_cmp(&volume_m3(b))) {
                    is_out[index] = true;
                }
            }
            objects = without(objects, is_out);
        }
        Ok(None)
    }
}

/// Return objects without some of them and without what stands on those.
fn without(objects: Vec<HouseObject>, mut is_out: Vec<bool>) -> Vec<HouseObject> {
    let mut others: Vec<HouseObject> = Vec::with_capacity(objects.len());
    let mut new_index = vec![0; objects.len()];
    for (index, mut object) in objects.into_iter().enumerate() {
        // A parent comes before its children.
        is_out[index] |= object.parent.is_some_and(|parent| is_out[parent]);
        if !is_out[index] {
            object.parent = object.parent.map(|parent| new_index[parent]);
            new_index[index] = others.len();
            others.push(object);
        }
    }
    others
}

/// Return the objects with those that wait for a place off their receptacles.
fn waiting(objects: &[HouseObject]) -> Vec<HouseObject> {
    let mut objects = objects.to_vec();
    objects.iter_mut().filter(|it| it.kind == Kind::Small).for_each(|it| it.parent = None);
    objects
}

/// Build the house of a draft, and its scene.
fn built(
    draft: &Draft<'_>,
    objects: &[HouseObject],
    start: Option<Agent>,
) -> Result<(House, Scene), Error> {
    let (seed, index) = draft.origin;
    let document = draft.document(objects, start);
    let house = House::from_document(&format!("{seed}:{index}"), document)?;
    let scene = Scene::build(&house, Catalogue::bundled(), UnknownAssets::Error)?;
    Ok((house, scene))
}
