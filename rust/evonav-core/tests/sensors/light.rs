//! The light on surfaces against light that is computed at single points.

use std::f64::consts::PI;

use evonav_core::{
    assets::{
        Catalogue, UnknownAssets,
        part::{Part, Primitive},
    },
    geometry::{Aabb, IDENTITY, Vec2, Vec3, add, sub, yaw_rotation},
    house::House,
    sensors::{
        camera::{Camera, View},
        raster::{FrameBuffer, Light, Style, Want, render_lit},
    },
    world::{
        mesh::{SceneMesh, Triangle},
        scene::{BodyKind, Scene},
    },
};
use proptest::{collection::vec, prelude::*, test_runner::Config};

use crate::common::scenes::{dot, scene_of};

const HOUSE: &str = include_str!("../data/house_39_objects.json");
/// Width of a cell of the map of what stands on the floor.
const CELL_M: f64 = 0.05;

fn house() -> House {
    House::from_json("house", HOUSE).expect("a valid house")
}

fn is_inside(polygon_m: &[Vec2], [x, z]: Vec2) -> bool {
    let next = polygon_m.iter().cycle().skip(1);
    let crossings = polygon_m.iter().zip(next).filter(|([ax, az], [bx, bz])| {
        (*az > z) != (*bz > z) && x < ax + (z - az) / (bz - az) * (bx - ax)
    });
    crossings.count() % 2 == 1
}

/// The rooms that are open towards the room at a point, that room among them.
fn rooms_around(house: &House, point_m: Vec2) -> Vec<usize> {
    let holds = |room: usize| is_inside(&house.rooms[room].polygon_m, point_m);
    let mut known: Vec<usize> = (0..house.rooms.len()).filter(|&room| holds(room)).collect();
    known.truncate(1);
    let borders: Vec<(usize, Vec2)> = house
        .walls
        .iter()
        .filter(|wall| wall.is_empty)
        .filter_map(|wall| {
            let room = house.rooms.iter().position(|room| room.id == wall.room_id)?;
            Some((room, [0, 1].map(|axis| 0.5 * (wall.from_m[axis] + wall.to_m[axis]))))
        })
        .collect();
    let mut next = 0;
    while next < known.len() {
        let here = borders.iter().filter(|(room, _)| *room == known[next]);
        let beyond = here.flat_map(|(_, a)| {
            borders.iter().filter(move |(_, b)| (0..2).all(|axis| (a[axis] - b[axis]).abs() < 0.05))
        });
        for (room, _) in beyond.copied().collect::<Vec<_>>() {
            if !known.contains(&room) {
                known.push(room);
            }
        }
        next += 1;
    }
    known
}

/// What lamps, windows and the surroundings give to a point, by channel.
fn sources(house: &House, scene: &Scene, rooms: &[usize], point_m: Vec3, normal: Vec3) -> Vec3 {
    let is_here = |place_m: Vec2| {
        rooms_around(house, place_m).first().is_some_and(|room| rooms.contains(room))
    };
    let mut light = [0.50, 0.49, 0.48].map(|channel| channel * (0.9 + 0.1 * normal[1]));
    for lamp in house.lamps() {
        let [x, _, z] = lamp.position_m;
        if is_here([x, z]) {
            let way_m = sub(lamp.position_m, point_m);
            let cosine = dot(way_m, normal) / dot(way_m, way_m).sqrt();
            let facing = (0.25 + 0.75 * cosine).max(0.0);
            let share = 1.06 * facing / (1.0 + dot(way_m, way_m) / 6.5);
            light = std::array::from_fn(|i| light[i] + share * f64::from(lamp.power[i]));
        }
    }
    for body in scene.bodies.iter().filter(|body| body.kind == BodyKind::Window) {
        let ([x, y, z], [width, height, depth]) = (body.aabb.centre_m(), body.aabb.size_m());
        let out = if width < depth { [1.0, 0.0] } else { [0.0, 1.0] };
        for side in [1.0, -1.0] {
            if !is_here([x + 0.2 * side * out[0], z + 0.2 * side * out[1]]) {
                continue;
            }
            let area_m2 = width.max(depth) * height;
            let way_m = sub([x, y, z], point_m);
            let (squared_m2, length_m) = (dot(way_m, way_m), dot(way_m, way_m).sqrt());
            let ahead = -side * (way_m[0] * out[0] + way_m[2] * out[1]) / length_m;
            let facing = (0.15 + 0.85 * dot(way_m, normal) / length_m).max(0.0);
            let share = 1.3 * area_m2 * facing * ahead.max(0.0) / (PI * squared_m2 + area_m2);
            light = std::array::from_fn(|i| light[i] + share * [0.95, 1.0, 1.08][i]);
        }
    }
    light
}

/// What lies over the floor, by cells.
struct Floor {
    corner_m: Vec2,
    size: [usize; 2],
    /// Openness of the floor and, by walls alone, of higher places.
    openness: [Vec<f64>; 2],
}

impl Floor {
    fn of(scene: &Scene, triangles: &[Triangle]) -> Self {
        let corners = triangles.iter().flat_map(|triangle| triangle.vertices_m);
        let bounds = corners.fold(Aabb::EMPTY, |all, corner_m| {
            all.union(Aabb { min_m: corner_m, max_m: corner_m })
        });
        let (centre_m, size_m) = (bounds.centre_m(), bounds.size_m());
        let size = [0, 2].map(|axis| (size_m[axis] / CELL_M + 8.0) as usize);
        let corner_m = [0, 1].map(|i| centre_m[2 * i] - 0.5 * CELL_M * size[i] as f64);
        let nothing_m = size_m[1].max(1.0) + 1.0;
        let openness = [false, true].map(|is_wall| {
            let counts = |triangle: &&Triangle| match scene.bodies[triangle.body as usize].kind {
                BodyKind::Floor | BodyKind::Ceiling => false,
                kind => !is_wall || kind == BodyKind::Wall,
            };
            let solids: Vec<&Triangle> = triangles.iter().filter(counts).collect();
            let cells = (0..size[1]).flat_map(|row| (0..size[0]).map(move |column| [column, row]));
            let lowest_m: Vec<f64> = cells
                .map(|cell| {
                    let place = [0, 1].map(|i| corner_m[i] + CELL_M * (cell[i] as f64 + 0.5));
                    let heights = solids.iter().filter_map(|solid| height_m(solid, place));
                    heights.fold(nothing_m, f64::min).max(0.0)
                })
                .collect();
            let near: Vec<f64> = lowest_m.iter().map(|c| 1.0 / (1.0 + 14.0 * c)).collect();
            let wide: Vec<f64> = lowest_m.iter().map(|c| 1.0 / (1.0 + 3.0 * c * c)).collect();
            let near = mean_around(&mean_around(&near, size, 1), size, 1);
            let wide = mean_around(&mean_around(&wide, size, 4), size, 4);
            near.iter()
                .zip(wide)
                .map(|(near, wide)| (1.0 - 0.5 * near) * (1.0 - 0.65 * wide))
                .collect()
        });
        Self { corner_m, size, openness }
    }

    fn open(&self, point_m: Vec2, height: f64) -> f64 {
        let place = [0, 1].map(|i| (point_m[i] - self.corner_m[i]) / CELL_M - 0.5);
        let weight = |cell: usize, at: f64| (1.0 - (at - cell as f64).abs()).max(0.0);
        let mut open = 0.0;
        for (index, _) in self.openness[0].iter().enumerate() {
            let (column, row) = (index % self.size[0], index / self.size[0]);
            let share = weight(column, place[0]) * weight(row, place[1]);
            let [low, high] = [0, 1].map(|level| self.openness[level][index]);
            open += share * (low + height * (high - low));
        }
        open
    }
}

/// The height at which a triangle that is seen from below covers a place.
fn height_m(triangle: &Triangle, place: Vec2) -> Option<f64> {
    let [a, b, c] = triangle.vertices_m.map(|v| [v[0], v[2]]);
    let area =
        |p: Vec2, q: Vec2, r: Vec2| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    let whole = area(a, b, c);
    let shares = [area(place, b, c), area(a, place, c), area(a, b, place)].map(|part| part / whole);
    // Seen from above, corners of such a triangle run the other way round than from below.
    let is_under = whole > 1e-9 && shares.iter().all(|share| *share >= 0.0);
    is_under.then(|| (0..3).map(|i| shares[i] * triangle.vertices_m[i][1]).sum())
}

fn mean_around(cells: &[f64], [width, height]: [usize; 2], reach: i64) -> Vec<f64> {
    let at = |column: i64, row: i64| {
        let (column, row) = (column.clamp(0, width as i64 - 1), row.clamp(0, height as i64 - 1));
        cells[row as usize * width + column as usize]
    };
    let mean = |index: usize| {
        let (column, row) = ((index % width) as i64, (index / width) as i64);
        let around = (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |j| (i, j)));
        let sum: f64 = around.map(|(i, j)| at(column + i, row + j)).sum();
        sum / ((2 * reach + 1) * (2 * reach + 1)) as f64
    };
    (0..cells.len()).map(mean).collect()
}

/// A box that stands or hangs in the house's first room.
fn part(room: &Aabb) -> impl Strategy<Value = Part> + use<> {
    let (low, high) = (room.min_m, room.max_m);
    let half_m = [0.1..0.5_f64, 0.1..0.4_f64, 0.1..0.5_f64];
    let place = [low[0]..high[0], 0.2..2.0_f64, low[2]..high[2]];
    (half_m, place, 0.0..6.3_f64).prop_map(|(half_m, centre_m, yaw_rad)| Part {
        primitive: Primitive::Cuboid { half_m },
        centre_m,
        rotation: yaw_rotation(yaw_rad),
        colour: [200, 60, 40],
        material: Default::default(),
    })
}

/// The box around the house's first room.
fn room() -> Aabb {
    let corners = house().rooms[0].polygon_m.clone();
    let around = corners.iter().fold(Aabb::EMPTY, |all, &[x, z]| {
        all.union(Aabb { min_m: [x, 0.0, z], max_m: [x, 2.5, z] })
    });
    Aabb { min_m: add(around.min_m, [0.0073, 0.0, 0.0091]), ..around }
}

fn slab(centre_m: Vec3, half_m: Vec3) -> Part {
    Part {
        primitive: Primitive::Cuboid { half_m },
        centre_m,
        rotation: IDENTITY,
        colour: [90; 3],
        material: Default::default(),
    }
}

proptest! {
    #![proptest_config(Config { cases: 24, ..Config::default() })]

    /// A floor, a wall, a window and some boxes: light agrees with that at single points in the
    /// corners of boxes, and at the points of the floor's grid.
    #[test]
    fn light_agrees_with_that_of_single_points(parts in vec(part(&room()), 1..6)) {
        let house = house();
        let (room, size_m) = (room(), room().size_m());
        let [x, _, z] = room.centre_m();
        // No edge lies on the middle of a cell.
        let floor = slab([x, -0.05, z], [0.5 * size_m[0], 0.05, 0.5 * size_m[2]]);
        let wall = slab([x + 0.0137, 1.2, room.max_m[2] - 0.3119], [0.4871, 1.2, 0.0513]);
        let window = slab([x, 1.5, room.min_m[2] + 0.05], [0.6, 0.5, 0.03]);
        let all = [floor, wall, window].into_iter().chain(parts);
        let mut scene = scene_of(&all.map(|part| vec![part]).collect::<Vec<_>>());
        for (index, kind) in [BodyKind::Floor, BodyKind::Wall, BodyKind::Window].into_iter().enumerate() {
            scene.bodies[index].kind = kind;
        }
        let mesh = SceneMesh::build(&scene);
        let triangles: Vec<Triangle> = mesh.triangles().collect();
        prop_assert_eq!(triangles.len(), 2 * mesh.faces().len());
        let light = Light::build(&house, &scene, &mesh);
        let below = Floor::of(&scene, &triangles);
        let mut num_sunny = 0;
        for (index, face) in mesh.faces().iter().enumerate() {
            let corners = [triangles[2 * index], triangles[2 * index + 1]].map(|t| t.vertices_m);
            let middle_m = mean(&corners.as_flattened()[..3], [0.5, 0.0, 0.5]);
            let ahead = |point_m: Vec3| [0, 2].map(|k| point_m[k] + 0.12 * face.normal[k]);
            let rooms = rooms_around(&house, ahead(middle_m));
            let is_floor = face.body == 0 && face.normal[1] > 0.5;
            num_sunny += check_slope(&mesh, &light, index, face.normal, &corners[0])?;
            let points_m: Vec<Vec3> = match is_floor {
                false => corners.as_flattened().to_vec(),
                true => grid_m(&room),
            };
            for point_m in points_m {
                let smooth = sources(&house, &scene, &rooms, point_m, face.normal);
                let open = below.open(ahead(point_m), (point_m[1] / 0.7).clamp(0.0, 1.0));
                let found = light.on_face(&mesh, index, point_m).expect("a face");
                // Lamps and windows are interpolated between points of the floor.
                let slack = if is_floor { 0.02 } else { 0.004 };
                for channel in 0..3 {
                    let expected = smooth[channel] * open;
                    prop_assert!(
                        (f64::from(found[channel]) - expected).abs() < slack,
                        "{found:?} at {point_m:?} of {face:?}, not {expected}"
                    );
                }
            }
        }
        prop_assert!(num_sunny > 0, "the sun is nowhere");
    }
}

/// Where the sun shines on more than a hand's breadth, a face takes up as much of it as its slope
/// says. Return the number of such places.
fn check_slope(
    mesh: &SceneMesh,
    light: &Light,
    face: usize,
    normal: Vec3,
    corners: &[Vec3; 3],
) -> Result<usize, TestCaseError> {
    let facing = dot(normal, light.towards_sun());
    let mut num_sunny = 0;
    for (i, j) in
        (1..8).flat_map(|i| (1..8).map(move |j| (0.125 * f64::from(i), 0.125 * f64::from(j))))
    {
        let [s, t] = if i + j > 1.0 { [1.0 - i, 1.0 - j] } else { [i, j] };
        let point_m = mean(corners, [1.0 - s - t, s, t]);
        let mut around =
            (0..27).map(|k| [k % 3, k / 3 % 3, k / 9].map(|k| 0.07 * f64::from(k - 1)));
        let is_sunny = facing > 0.2
            && around.all(|aside| {
                let out_m = dot(aside, normal);
                let aside: Vec3 = std::array::from_fn(|k| aside[k] - out_m * normal[k]);
                light.sun_at(mesh, add(point_m, aside)) == 1.0
            });
        if is_sunny {
            num_sunny += 1;
            let found = light.on_face(mesh, face, point_m).expect("a face")[3];
            prop_assert!(
                (f64::from(found) - facing).abs() < 1e-3,
                "{found} at {point_m:?}, not {facing}"
            );
        }
    }
    Ok(num_sunny)
}

fn mean(corners: &[Vec3], weights: [f64; 3]) -> Vec3 {
    std::array::from_fn(|axis| (0..3).map(|i| weights[i] * corners[i][axis]).sum())
}

/// Some points of the grid of light on the floor.
fn grid_m(room: &Aabb) -> Vec<Vec3> {
    let cells = [0, 2].map(|axis| (room.size_m()[axis] / 0.1) as usize + 1);
    let place = |axis: usize, i: usize, num: usize| room.size_m()[axis] * i as f64 / num as f64;
    let points = (0..cells[1])
        .step_by(5)
        .flat_map(|row| (0..cells[0]).step_by(7).map(move |column| [column, row]));
    points
        .map(|[i, j]| add(room.min_m, [place(0, i, cells[0]), 0.0, place(2, j, cells[1])]))
        .collect()
}

/// In a real house, faces of what glows do not depend on their surroundings.
#[test]
fn panes_shine_by_themselves() {
    let house = house();
    let scene = Scene::build(&house, Catalogue::bundled(), UnknownAssets::Error).expect("known");
    let mesh = SceneMesh::build(&scene);
    let light = Light::build(&house, &scene, &mesh);
    let glowing = mesh.skins().iter().enumerate().filter(|(_, skin)| skin.material.kind.glows());
    let mut num_glowing = 0;
    for (index, _) in glowing {
        num_glowing += 1;
        assert_eq!(light.on_face(&mesh, index, [1.0, 1.0, 1.0]), Some([1.35, 1.35, 1.35, 0.0]));
    }
    assert!(num_glowing > 0);
    assert_eq!(light.on_face(&mesh, usize::MAX, [0.0; 3]), None);
}

/// Sunny places of a map are brighter than the same places in the light of their room alone.
#[test]
fn maps_of_any_width_show_the_sun() {
    let house = house();
    let mut scene =
        Scene::build(&house, Catalogue::bundled(), UnknownAssets::Error).expect("known");
    let is_above = |kind| matches!(kind, BodyKind::Ceiling);
    scene.bodies.iter_mut().filter(|body| is_above(body.kind)).for_each(|body| body.parts.clear());
    let mesh = SceneMesh::build(&scene);
    let light = Light::build(&house, &scene, &mesh);
    let centre_m = Aabb::of_points(mesh.triangles().flat_map(|t| t.vertices_m)).centre_m();
    for width_px in 61..=70 {
        let camera = Camera {
            width_px,
            height_px: 64,
            vertical_fov_rad: 1.0,
            position_m: [centre_m[0], 10.0, centre_m[2]],
            yaw_rad: 0.0,
            horizon_rad: std::f64::consts::FRAC_PI_2,
        };
        let view = View { camera, clip_m: [0.1, 20.0], roll_rad: 0.0, half_height_m: Some(6.0) };
        let want = Want { rgb: Some(Style::Default), instances: true };
        let mut frame = FrameBuffer::default();
        render_lit(&mesh, Some(&light), &view, want, &mut frame).expect("a valid view");
        let mut lights = [Vec::new(), Vec::new()];
        let floor = (0..frame.instances.len()).filter(|&index| {
            let body = frame.instances[index] as usize;
            body > 0 && scene.bodies[body - 1].kind == BodyKind::Floor
        });
        for index in floor {
            let [column, row] = [index % width_px, index / width_px];
            let metres =
                |px: usize, size_px: usize| (px as f64 + 0.5 - 0.5 * size_px as f64) * 6.0 / 32.0;
            let point_m =
                [centre_m[0] + metres(column, width_px), 0.0, centre_m[2] - metres(row, 64)];
            let reach = light.sun_at(&mesh, point_m);
            if reach == 0.0 || reach == 1.0 {
                lights[reach as usize].push(f64::from(frame.rgb[3 * index + 1]));
            }
        }
        let [shade, sun] = lights.map(|levels| levels.iter().sum::<f64>() / levels.len() as f64);
        assert!(sun > 1.15 * shade, "{sun} in the sun, {shade} in the shade at {width_px}");
    }
}
