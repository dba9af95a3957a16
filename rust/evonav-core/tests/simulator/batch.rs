//! A batch of agents against as many agents alone, each moved and drawn by the plainest code.

use std::sync::{Arc, LazyLock};

use evonav_core::{
    Error,
    assets::UnknownAssets,
    geometry::{Pose, Vec2, distance_2d_m},
    house::House,
    sensors::{
        instance_masks::MaskFilter,
        raster::{FrameBuffer, Style, Want},
    },
    simulator::{
        EmbeddedSimulator, SimulatorConfig,
        actions::{Action, Strides, canonical_yaw_rad},
        batch::{Batch, BatchConfig, Images},
        batch_slot::Slot,
        geodesic_field::GeodesicField,
    },
    world::navigation::AgentBody,
};
use proptest::{collection::vec, prelude::*};

const HOUSES: [&str; 2] =
    [include_str!("../data/house_100_objects.json"), include_str!("../data/house_39_objects.json")];
const IMAGE_PX: [usize; 2] = [24, 16];
const STRIDES: Strides = Strides { move_m: 0.25, turn_rad: std::f64::consts::FRAC_PI_6 };
const FILTER: MaskFilter = MaskFilter { min_area_px: 3, max_box_fraction: 1.0 };
const EMPTY_M: f32 = 20.0;
const GRID_M: f64 = 0.25;

fn world_of(json: &str, image_px: [usize; 2]) -> Arc<EmbeddedSimulator> {
    let config = SimulatorConfig {
        image_px,
        vertical_fov_rad: std::f64::consts::FRAC_PI_2,
        clip_m: [0.1, 20.0],
        camera_height_m: 1.575,
        agent: AgentBody { radius_m: 0.2, height_m: 1.8 },
        unknown: UnknownAssets::CategoryDefault,
        style: Style::Plain,
    };
    let house = House::from_json("house", json).expect("a valid house");
    Arc::new(EmbeddedSimulator::new(house, config).expect("a usable house"))
}

static WORLDS: LazyLock<Vec<Arc<EmbeddedSimulator>>> =
    LazyLock::new(|| HOUSES.iter().map(|json| world_of(json, IMAGE_PX)).collect());

fn batch_of(num_slots: usize, num_threads: usize) -> Batch {
    let config = BatchConfig {
        image_px: IMAGE_PX,
        empty_depth_m: EMPTY_M,
        strides: STRIDES,
        grid_m: GRID_M,
        mask_filter: FILTER,
        num_threads,
        min_shared_px: 0,
    };
    Batch::new(num_slots, config).expect("a valid batch")
}

/// Labels that repeat, with bodies that have none.
fn labels_of(world: &EmbeddedSimulator) -> Vec<u8> {
    (0..world.bodies().len()).map(|body| (body % 5) as u8).collect()
}

fn reachable_of(world: &EmbeddedSimulator) -> Vec<Vec2> {
    let [x, _, z] = world.start().position_m;
    world.navigation().reachable_positions([x, z], GRID_M).expect("a grid")
}

/// Middles of the free cells of 0.1 m, row by row.
fn free_cells_of(world: &EmbeddedSimulator) -> Vec<Vec2> {
    let (spec, cells) = world.occupancy(0.1).expect("a grid");
    let mut free_m = Vec::new();
    for row in 0..spec.rows {
        for col in 0..spec.cols {
            if cells[row * spec.cols + col] == 0 {
                let [x, z] = spec.corner_m;
                free_m.push([col as f64 * 0.1 + 0.05 + x, row as f64 * 0.1 + 0.05 + z]);
            }
        }
    }
    free_m
}

/// One agent of the twin.
struct Lone {
    world: Arc<EmbeddedSimulator>,
    pose: Pose,
    goal_m: Vec2,
}

impl Lone {
    /// By the words of docs/simulator.md: angles are whole multiples of 1e-4 degrees.
    fn turned(&self, by_rad: f64) -> f64 {
        let turned_deg = (self.pose.yaw_rad + by_rad).to_degrees();
        let in_turn_deg = turned_deg - 360.0 * (turned_deg / 360.0).floor();
        let written = format!("{in_turn_deg:.4}");
        written.parse::<f64>().map_or(0.0, |deg| if deg == 360.0 { 0.0 } else { deg }).to_radians()
    }

    fn step(&mut self, action: u8) -> bool {
        match action {
            0 => {
                let [x, y, z] = self.pose.position_m;
                let to = [
                    x + STRIDES.move_m * self.pose.yaw_rad.sin(),
                    y,
                    z + STRIDES.move_m * self.pose.yaw_rad.cos(),
                ];
                if !self.world.navigation().try_move([x, z], [to[0], to[2]]) {
                    return false;
                }
                self.pose.position_m = to;
            }
            1 => self.pose.yaw_rad = self.turned(-STRIDES.turn_rad),
            2 => self.pose.yaw_rad = self.turned(STRIDES.turn_rad),
            _ => {}
        }
        true
    }

    fn distance_m(&self) -> f64 {
        let [x, _, z] = self.pose.position_m;
        self.world.navigation().distances_m(self.goal_m, &[[x, z]])[0]
    }

    /// As `evonav.evaluation.episode.motion` plans: the target, else free cells that lie nearer to it
    /// than any position of the grid if that is out of its reach, else that position.
    fn plan(&self, target_m: Vec2) -> Option<Vec<Vec2>> {
        let [x, _, z] = self.pose.position_m;
        let navigation = self.world.navigation();
        let path_to = |place_m: Vec2| navigation.shortest_path([x, z], place_m);
        let gap_m = |place_m: Vec2| distance_2d_m(place_m, target_m);
        let reachable_m = navigation.reachable_positions([x, z], GRID_M).ok()?;
        let nearest_m = navigation.nearest_reachable(target_m, &reachable_m);
        let nearest_gap_m = nearest_m.map_or(f64::INFINITY, gap_m);
        let mut tries_m = vec![target_m];
        if nearest_gap_m > 1.5 {
            let mut free_m = free_cells_of(&self.world);
            free_m.sort_by(|&a, &b| gap_m(a).total_cmp(&gap_m(b)));
            tries_m.extend(free_m.into_iter().take(16).filter(|&m| gap_m(m) < nearest_gap_m));
        }
        tries_m.into_iter().chain(nearest_m).find_map(path_to)
    }

    /// Depth, colours and labels.
    fn images(&self) -> (Vec<f32>, Vec<u8>, Vec<u8>) {
        let mut frame = FrameBuffer::default();
        let want = Want { rgb: Some(Style::Plain), instances: true };
        self.world.render(&self.world.view(&self.pose), want, &mut frame).expect("a valid view");
        let table = labels_of(&self.world);
        let area_px = |id: i32| frame.instances.iter().filter(|&&other| other == id).count();
        let label = |&id: &i32| match id {
            0 => 0,
            id if area_px(id) < FILTER.min_area_px => 0,
            id => table[id as usize - 1],
        };
        let depth_m = frame.depth_m.iter().map(|&d| if d == f32::INFINITY { EMPTY_M } else { d });
        (depth_m.collect(), frame.rgb.clone(), frame.instances.iter().map(label).collect())
    }
}

/// House, place, direction and goal of an agent.
type Setting = (usize, prop::sample::Index, u8, prop::sample::Index);

/// The same agents alone and in a batch.
fn both(settings: &[Setting], num_threads: usize) -> (Vec<Lone>, Batch) {
    let mut batch = batch_of(settings.len(), num_threads);
    let mut lone = Vec::new();
    for (index, (house, place, turns, goal)) in settings.iter().enumerate() {
        let world = Arc::clone(&WORLDS[*house]);
        let reachable_m = reachable_of(&world);
        let pose = Pose {
            position_m: world.body_position_m(*place.get(&reachable_m)),
            yaw_rad: canonical_yaw_rad(f64::from(*turns) * 0.37),
            horizon_rad: 30_f64.to_radians(),
        };
        let goal_m = *goal.get(&reachable_m);
        let slot = Slot::new(Arc::clone(&world), pose, labels_of(&world).into());
        batch.place(index, slot).expect("a slot");
        let field = GeodesicField::new(Arc::clone(&world), goal_m).expect("a free goal");
        batch.aim(index, Some(Arc::new(field))).expect("a slot");
        lone.push(Lone { world, pose, goal_m });
    }
    (lone, batch)
}

fn setting() -> impl Strategy<Value = Setting> {
    (0..2_usize, any::<prop::sample::Index>(), any::<u8>(), any::<prop::sample::Index>())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Poses, successes, distances and images are those of agents alone, to the bit.
    #[test]
    fn agents_of_a_batch_do_and_see_what_they_would_alone(
        settings in vec(setting(), 1..7),
        num_threads in 1..5_usize,
        actions in vec(vec(0..4_u8, 6), 1..8),
    ) {
        let (mut lone, mut batch) = both(&settings, num_threads);
        let pixels = settings.len() * IMAGE_PX[0] * IMAGE_PX[1];
        let (mut depth_m, mut rgb, mut labels) =
            (vec![0.0_f32; pixels], vec![0_u8; 3 * pixels], vec![9_u8; pixels]);
        for actions in actions {
            let actions = &actions[..settings.len()];
            let stepped = batch.step(actions).expect("valid actions");
            let images = Images {
                depth_m: Some(&mut depth_m), rgb: Some(&mut rgb), labels: Some(&mut labels),
            };
            batch.render(images).expect("arrays of the right size");
            for (index, agent) in lone.iter_mut().enumerate() {
                let is_success = agent.step(actions[index]);
                prop_assert_eq!(batch.slot(index).map(Slot::pose), Ok(agent.pose));
                prop_assert_eq!(stepped[index].is_success, is_success);
                prop_assert_eq!(stepped[index].distance_m.to_bits(), agent.distance_m().to_bits());
                let share = |n: usize| index * n..(index + 1) * n;
                let n = IMAGE_PX[0] * IMAGE_PX[1];
                let (one_depth_m, one_rgb, one_labels) = agent.images();
                prop_assert_eq!(&depth_m[share(n)], &one_depth_m[..]);
                prop_assert_eq!(&rgb[share(3 * n)], &one_rgb[..]);
                prop_assert_eq!(&labels[share(n)], &one_labels[..]);
            }
        }
    }

    /// Paths are the navigation's own; a target that is cut off gives way to the reachable position
    /// nearest to it, of those that could be reached the first time, or where that is far from it
    /// to a free cell.
    #[test]
    fn plans_are_those_of_agents_alone(
        settings in vec(setting(), 1..5),
        num_threads in 1..4_usize,
        targets in vec(vec(prop::option::of((-3.0..12.0, -3.0..12.0)), 4), 1..4),
    ) {
        let (lone, mut batch) = both(&settings, num_threads);
        for targets in targets {
            let targets_m: Vec<Option<Vec2>> =
                targets[..settings.len()].iter().map(|t| t.map(|(x, z)| [x, z])).collect();
            let paths_m = batch.plan(&targets_m).expect("one target an agent");
            for (index, agent) in lone.iter().enumerate() {
                let expected = targets_m[index].and_then(|target_m| agent.plan(target_m));
                prop_assert_eq!(&paths_m[index], &expected.unwrap_or_default());
            }
        }
    }

    /// Rounding is that of decimal digits, halves to even, near every border of two decimals too.
    #[test]
    fn yaws_are_rounded_as_their_digits_are(parts in 0..3_600_000_u32, nudge in -3..4_i32) {
        let border_deg = (f64::from(parts) + 0.5) / 1e4;
        let angle_deg = f64::from_bits((border_deg.to_bits() as i64 + i64::from(nudge)) as u64);
        let yaw_rad = angle_deg.to_radians();
        let digits: f64 = format!("{:.4}", yaw_rad.to_degrees().rem_euclid(360.0))
            .parse().expect("a number");
        prop_assert_eq!(canonical_yaw_rad(yaw_rad), (digits % 360.0).to_radians());
    }
}

/// An agent comes as far as its body fits, and looks where it was told.
#[test]
fn following_ends_where_the_body_does_not_fit() {
    let world = Arc::clone(&WORLDS[0]);
    let reachable_m = reachable_of(&world);
    let [a_m, b_m] = [reachable_m[0], reachable_m[reachable_m.len() / 2]];
    let mut batch = batch_of(1, 1);
    let slot = Slot::new(Arc::clone(&world), world.start(), labels_of(&world).into());
    batch.place(0, slot).expect("a slot");
    let stops = [(a_m, 1.0), (b_m, 7.0), ([1e3, 0.0], 0.0), (a_m, 2.0)];
    assert_eq!(batch.follow(0, &stops), Ok(2));
    let pose = batch.slot(0).expect("a slot").pose();
    assert_eq!(pose.position_m, world.body_position_m(b_m));
    assert_eq!(pose.yaw_rad, canonical_yaw_rad(7.0));
    assert_eq!(batch.follow(0, &[([f64::NAN, 0.0], 0.0)]), Ok(0));
    assert_eq!(batch.follow(0, &[(a_m, f64::NAN)]), Ok(0));
}

/// Nothing that a caller can pass panics, and a refused step moves nobody.
#[test]
fn what_is_wrong_is_told_and_moves_nobody() {
    let world = Arc::clone(&WORLDS[0]);
    let labels: Arc<[u8]> = labels_of(&world).into();
    let slot = || Slot::new(Arc::clone(&world), world.start(), Arc::clone(&labels));
    let mut batch = batch_of(2, 2);
    batch.place(0, slot()).expect("a slot");
    assert!(matches!(batch.step(&[0, 0]), Err(Error::Simulation { .. })));
    assert!(matches!(batch.render(Images::default()), Err(Error::Simulation { .. })));
    assert_eq!(batch.slot(0).map(Slot::pose), Ok(world.start()));
    assert!(matches!(batch.place(2, slot()), Err(Error::InvalidArgument { .. })));
    assert!(matches!(batch.aim(1, None), Err(Error::Simulation { .. })));
    let few = Slot::new(Arc::clone(&world), world.start(), Arc::from([1_u8]));
    assert!(matches!(batch.place(1, few), Err(Error::InvalidArgument { .. })));
    let large = world_of(HOUSES[0], [32, 32]);
    let other = Slot::new(large, world.start(), Arc::clone(&labels));
    assert!(matches!(batch.place(1, other), Err(Error::InvalidArgument { .. })));
    batch.place(1, slot()).expect("a slot");
    assert!(matches!(batch.step(&[2, 4]), Err(Error::InvalidArgument { .. })));
    assert!(matches!(batch.step(&[2]), Err(Error::InvalidArgument { .. })));
    assert!(matches!(batch.plan(&[None]), Err(Error::InvalidArgument { .. })));
    let mut short = [0.0_f32; 5];
    let images = Images { depth_m: Some(&mut short), ..Images::default() };
    assert!(matches!(batch.render(images), Err(Error::InvalidArgument { .. })));
    assert_eq!(batch.slot(0).map(Slot::pose), Ok(world.start()));
    assert_eq!(batch.slot(0).map(Slot::distance_m), Ok(f64::INFINITY));
    assert!(Action::of(4).is_err());
    for (num_slots, num_threads) in [(0, 1), (1, 0), (1 << 20, 1)] {
        let config = BatchConfig { num_threads, ..*batch.config() };
        assert!(matches!(Batch::new(num_slots, config), Err(Error::InvalidArgument { .. })));
    }
}
