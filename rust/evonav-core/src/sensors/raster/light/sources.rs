//! Sources of light: lamps and windows of connected rooms, and the sun.

use crate::{
    geometry::{Vec2, Vec3, polygon_contains},
    house::{House, Lamp},
    world::scene::{BodyKind, Scene},
};

/// Light of a sky that fills half of all directions.
const SKY: [f32; 3] = [0.95, 1.0, 1.08];
/// Share of lamplight and skylight in a room without either.
const AMBIENT: [f32; 3] = [0.50, 0.49, 0.48];

/// Factor of the light of lamps, and squared distance at which half of it is left.
const LAMP: f64 = 1.06;
const HALVED_M2: f64 = 6.5;

/// A window as a small bright surface.
#[derive(Debug)]
struct Pane {
    centre_m: Vec3,
    normal: Vec2,
    area_m2: f64,
}

/// Rooms that are connected by open borders, and their light.
#[derive(Debug, Default)]
struct Space {
    polygons_m: Vec<Vec<Vec2>>,
    lamps: Vec<Lamp>,
    panes: Vec<Pane>,
}

/// The light of all rooms.
#[derive(Debug)]
pub(in crate::sensors::raster) struct Sources {
    spaces: Vec<Space>,
}

impl Sources {
    pub fn of(house: &House, scene: &Scene) -> Self {
        let space_of_room = spaces(house);
        let num = space_of_room.iter().max().map_or(0, |last| last + 1);
        let mut all: Vec<Space> = (0..num).map(|_| Space::default()).collect();
        for (room, &space) in house.rooms.iter().zip(&space_of_room) {
            all[space].polygons_m.push(room.polygon_m.clone());
        }
        let mut sources = Self { spaces: all };
        for lamp in house.lamps() {
            let [x, _, z] = lamp.position_m;
            if let Some(space) = sources.space_at([x, z]) {
                sources.spaces[space].lamps.push(lamp);
            }
        }
        for body in scene.bodies.iter().filter(|body| body.kind == BodyKind::Window) {
            let (centre_m, [x, y, z]) = (body.aabb.centre_m(), body.aabb.size_m());
            let (normal, width_m) = if x < z { ([1.0, 0.0], z) } else { ([0.0, 1.0], x) };
            for side in [0.2, -0.2] {
                let inside = [centre_m[0] + side * normal[0], centre_m[2] + side * normal[1]];
                if let Some(space) = sources.space_at(inside) {
                    let normal = normal.map(|n: f64| n * side.signum());
                    sources.spaces[space].panes.push(Pane {
                        centre_m,
                        normal,
                        area_m2: width_m * y,
                    });
                }
            }
        }
        sources
    }

    /// Return the number of spaces.
    pub fn num_spaces(&self) -> usize {
        self.spaces.len()
    }

    /// Return the space that contains a point of the floor.
    pub fn space_at(&self, point_m: Vec2) -> Option<usize> {
        self.spaces.iter().position(|space| {
            space.polygons_m.iter().any(|polygon_m| polygon_contains(polygon_m, point_m))
        })
    }

    /// Return the direction towards the sun: into the house's largest window, from the side.
    pub fn sun_direction(&self) -> Vec3 {
        let panes = self.spaces.iter().flat_map(|space| &space.panes);
        let largest = panes.max_by(|a, b| a.area_m2.total_cmp(&b.area_m2));
        let [x, z] = largest.map_or([0.6, 0.8], |pane| pane.normal.map(|n| -n));
        // A rational turn by 28 degrees, and 42 degrees above the horizon.
        let [x, z] = [0.882 * x - 0.471 * z, 0.471 * x + 0.882 * z];
        [0.743 * x, 0.669, 0.743 * z]
    }

    /// Return the light that falls on a point of a space from all but the sun.
    pub fn on(&self, space: Option<usize>, point_m: Vec3, normal: Vec3) -> [f32; 3] {
        let up = normal[1] as f32;
        let ambient = AMBIENT.map(|channel| channel * (0.9 + 0.1 * up));
        let Some(space) = space.map(|index| &self.spaces[index]) else { return ambient };
        let mut light = ambient;
        for lamp in &space.lamps {
            let (cosine, squared_m2) = towards(point_m, normal, lamp.position_m);
            let facing = (0.25 + 0.75 * cosine).max(0.0);
            let share = (LAMP * facing / (1.0 + squared_m2 / HALVED_M2)) as f32;
            light = std::array::from_fn(|i| light[i] + share * lamp.power[i]);
        }
        for pane in &space.panes {
            let (cosine, squared_m2) = towards(point_m, normal, pane.centre_m);
            let out = [point_m[0] - pane.centre_m[0], point_m[2] - pane.centre_m[2]];
            let ahead_m = (out[0] * pane.normal[0] + out[1] * pane.normal[1]).max(0.0);
            let aside = ahead_m / squared_m2.sqrt().max(1e-6);
            let facing = (0.15 + 0.85 * cosine).max(0.0);
            let share =
                pane.area_m2 * facing * aside / (std::f64::consts::PI * squared_m2 + pane.area_m2);
            light = std::array::from_fn(|i| light[i] + 1.3 * share as f32 * SKY[i]);
        }
        light
    }
}

/// Return the cosine between a normal and the direction of a source, and its squared distance.
fn towards(point_m: Vec3, normal: Vec3, source_m: Vec3) -> (f64, f64) {
    let way_m: Vec3 = std::array::from_fn(|i| source_m[i] - point_m[i]);
    let squared_m2 = way_m.iter().map(|d| d * d).sum::<f64>();
    let along_m: f64 = (0..3).map(|i| way_m[i] * normal[i]).sum();
    (along_m / squared_m2.sqrt().max(1e-6), squared_m2)
}

/// Return the space of each room: rooms that share an open border are one.
fn spaces(house: &House) -> Vec<usize> {
    let mut of_room: Vec<usize> = (0..house.rooms.len()).collect();
    let open: Vec<_> = house.walls.iter().filter(|wall| wall.is_empty).collect();
    let room_of = |id: &str| house.rooms.iter().position(|room| room.id == id);
    let middle = |a: Vec2, b: Vec2| [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
    for (index, wall) in open.iter().enumerate() {
        let here = middle(wall.from_m, wall.to_m);
        for other in &open[..index] {
            let there = middle(other.from_m, other.to_m);
            let is_same = (0..2).all(|axis| (here[axis] - there[axis]).abs() < 0.05);
            let (Some(a), Some(b)) = (room_of(&wall.room_id), room_of(&other.room_id)) else {
                continue;
            };
            let (low, high) = (of_room[a].min(of_room[b]), of_room[a].max(of_room[b]));
            if is_same {
                of_room.iter_mut().filter(|space| **space == high).for_each(|space| *space = low);
            }
        }
    }
    of_room
}
