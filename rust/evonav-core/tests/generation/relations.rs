//! What is said of a target's surroundings, against the stage house itself: distances as the widest
//! slab between the plans of two shapes, over directions, instead of polygons.

use std::f64::consts::PI;

use super::tasks::{houses, try_generate};
use evonav_core::{
    assets::{
        Catalogue, UnknownAssets,
        part::{Part, Primitive},
        shapes::shape_of,
    },
    generation::{
        Generation, Parameters,
        record::{Anchor, Determiner, Relations},
    },
    geometry::{Vec3, add, euler_rotation_deg, rotate},
    house::House,
};

/// Difference between the shapes' outlines and the points taken of them.
const SLACK_M: f64 = 0.02;

struct Thing {
    category: String,
    room: Option<usize>,
    parent: Option<usize>,
    /// On its surface, world frame.
    points_m: Vec<Vec3>,
}

impl Thing {
    fn bottom_m(&self) -> f64 {
        self.points_m.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min)
    }

    fn top_m(&self) -> f64 {
        self.points_m.iter().map(|p| p[1]).fold(f64::NEG_INFINITY, f64::max)
    }
}

fn points_on(part: &Part, position_m: Vec3, rotation_deg: Vec3) -> Vec<Vec3> {
    let part = part.placed(position_m, &euler_rotation_deg(rotation_deg));
    let mut local: Vec<Vec3> = Vec::new();
    match part.primitive {
        Primitive::Cuboid { half_m: [x, y, z] } => {
            for (a, b, c) in [(1, 1, 1), (1, 1, -1), (1, -1, 1), (1, -1, -1)] {
                let corner = [f64::from(a) * x, f64::from(b) * y, f64::from(c) * z];
                local.extend([corner, corner.map(|v| -v)]);
            }
        }
        Primitive::Frustum { bottom_m, top_m, half_height_m, sides } => {
            local.extend(Primitive::ring_m(bottom_m, -half_height_m, sides));
            local.extend(Primitive::ring_m(top_m, half_height_m, sides));
        }
        Primitive::Pad { .. } => unreachable!("only trim has pads"),
        Primitive::Ellipsoid { half_m: [x, y, z] } => {
            for i in 0..32 {
                for j in 0..=16 {
                    let (a, b) = (f64::from(i) * PI / 16.0, f64::from(j) * PI / 16.0);
                    local.push([x * a.cos() * b.sin(), y * b.cos(), z * a.sin() * b.sin()]);
                }
            }
        }
    }
    local.iter().map(|&p| add(rotate(&part.rotation, p), part.centre_m)).collect()
}

fn things(house: &House) -> Vec<Thing> {
    let thing = |object: &evonav_core::house::Object| {
        let asset = Catalogue::bundled().asset_of(house, object, UnknownAssets::Error).unwrap();
        let parts = shape_of(&asset);
        let points = |part| points_on(part, object.position_m, object.rotation_deg);
        Thing {
            category: asset.category.clone(),
            room: object.room,
            parent: object.parent,
            points_m: parts.iter().flat_map(points).collect(),
        }
    };
    house.objects.iter().map(thing).collect()
}

/// Distance in plan of the convex hulls: the widest slab that separates them.
fn gap_naive_m(a: &[Vec3], b: &[Vec3]) -> f64 {
    let along = |points: &[Vec3], k: i32| {
        let (sin, cos) = (f64::from(k) * PI / 360.0).sin_cos();
        points
            .iter()
            .map(|p| p[0] * cos + p[2] * sin)
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)])
    };
    (0..720).map(|k| along(b, k)[0] - along(a, k)[1]).fold(0.0, f64::max)
}

/// Things of the anchor's category in the room of `target`, within `reach_m` of it.
fn near<'a>(all: &'a [Thing], target: usize, anchor: &Anchor, reach_m: f64) -> Vec<&'a Thing> {
    all.iter()
        .enumerate()
        .filter(|(i, thing)| {
            *i != target
                && thing.category == anchor.category
                && thing.room == all[target].room
                && gap_naive_m(&all[target].points_m, &thing.points_m) <= reach_m
        })
        .map(|(_, thing)| thing)
        .collect()
}

/// Whether everything said of support, neighbours and wall holds of `index`; parts of the room are
/// left out.
fn fits(all: &[Thing], house: &House, index: usize, said: &Relations, slack_m: f64) -> bool {
    let own = &all[index];
    let room_type = own.room.map_or("", |room| house.rooms[room].room_type.as_str());
    let support = own.parent.map(|parent| all[parent].category.as_str());
    let is_supported =
        said.support.as_ref().is_none_or(|anchor| support == Some(anchor.category.as_str()));
    let neighbours = said.neighbours.iter().all(|anchor| {
        let mut company = near(all, index, anchor, 0.5 + slack_m);
        company.retain(|other| {
            let is_level = (other.bottom_m() - own.bottom_m()).abs() <= 0.15 + slack_m;
            let is_on_floor = other.parent.is_none() && other.bottom_m() < 0.05;
            is_on_floor || own.parent.is_some() && other.parent == own.parent && is_level
        });
        company.len() >= if anchor.determiner == Determiner::Some { 2 } else { 1 }
    });
    let on_wall = said.wall_object.as_ref().is_none_or(|anchor| {
        near(all, index, anchor, if said.is_below_wall_object { 0.3 } else { 1.0 } + slack_m)
            .iter()
            .any(|other| {
                other.bottom_m() > 0.05
                    && (!said.is_below_wall_object || other.bottom_m() >= own.top_m() - slack_m)
            })
    });
    room_type == said.room_type && is_supported && neighbours && on_wall
}

#[test]
fn what_is_said_is_true_and_of_no_more_objects_than_is_recorded() {
    let (mut num_anchors, mut num_unique, mut num_ambiguous) = (0, 0, 0);
    for (house, seed) in houses().iter().flat_map(|house| (0..12).map(move |seed| (house, seed))) {
        let made = try_generate(house, seed, &Parameters::default()).unwrap();
        let Generation::Task(task) = made else { continue };
        for (stage, json) in task.stages.iter().zip(&task.houses) {
            let house = House::from_json("stage", json).unwrap();
            let all = things(&house);
            let target = house.object_index(&stage.target.id).unwrap();
            let said = &stage.relations;
            assert!(fits(&all, &house, target, said, SLACK_M), "{said:?}");
            if let (true, Some(parent)) = (said.is_in_support, all[target].parent) {
                let holds = ["Bathtub", "Box", "GarbageCan", "LaundryHamper", "Pot", "Sink"];
                let is_under_its_top = all[target].bottom_m() < all[parent].top_m();
                let name = all[parent].category.as_str();
                assert!(holds.contains(&name) || is_under_its_top, "{said:?}");
            }
            let namesakes = (0..all.len()).filter(|&i| all[i].category == all[target].category);
            assert_eq!(said.is_category_unique, namesakes.clone().count() == 1);
            let num_fitting = namesakes.filter(|&i| fits(&all, &house, i, said, SLACK_M)).count();
            // Parts of the room tell some of these apart, nothing else can.
            assert!(said.num_fitting >= 1 && said.num_fitting <= num_fitting, "{said:?}");
            if said.structure.is_none() && num_fitting == 1 {
                assert_eq!(said.num_fitting, 1);
            }
            num_unique += usize::from(said.num_fitting == 1);
            num_ambiguous += usize::from(said.num_fitting > 1);
            num_anchors += said.neighbours.len() + usize::from(said.wall_object.is_some());
            for anchor in said.neighbours.iter().chain(&said.support).chain(&said.wall_object) {
                let of_category = |thing: &&Thing| {
                    thing.category == anchor.category && thing.room == all[target].room
                };
                let count = all.iter().filter(of_category).count();
                assert_eq!(anchor.determiner == Determiner::The, count == 1, "{said:?}");
            }
        }
    }
    assert!(num_anchors > 60, "{num_anchors}");
    assert!(num_unique > 4 * num_ambiguous, "{num_unique} {num_ambiguous}");
}
