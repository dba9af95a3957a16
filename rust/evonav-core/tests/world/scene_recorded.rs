//! Scenes of bundled and recorded houses: all are built, and children rest on their parents.

use evonav_core::{
    assets::{
        Catalogue, UnknownAssets,
        part::{Part, Primitive},
    },
    geometry::{Vec2, Vec3},
    house::House,
    world::scene::Scene,
};

use crate::common::recorded::{bundled_lines, data_folder, lines};
use crate::common::solids::holds;

const UNKNOWN: UnknownAssets = UnknownAssets::CategoryDefault;

/// Every house of the data sets, if they are there.
fn recorded_houses() -> Vec<(String, String)> {
    let mut houses = Vec::new();
    let Ok(folders) = std::fs::read_dir(data_folder()) else { return houses };
    for folder in folders.flatten() {
        let Ok(files) = std::fs::read_dir(folder.path()) else { continue };
        for file in files.flatten().map(|file| file.path()) {
            let name = file.display().to_string();
            if name.ends_with(".jsonl.gz") {
                houses.extend(named(&name, lines(&file)));
            }
        }
    }
    houses.sort();
    houses
}

/// The houses of a file with a name each; a file may hold other things.
fn named(file: &str, lines: Vec<String>) -> impl Iterator<Item = (String, String)> {
    let houses = lines.into_iter().enumerate().filter(|(_, line)| line.contains("\"rooms\""));
    houses.map(move |(i, line)| (format!("{file}:{}", i + 1), line))
}

#[test]
fn every_house_builds() {
    let (file, bundled) = bundled_lines();
    let (mut num_houses, mut num_built, num_bundled) = (0, 0, bundled.len());
    for (name, json) in named(&file, bundled).chain(recorded_houses()) {
        num_houses += 1;
        let Ok(house) = House::from_json(&name, &json) else { continue };
        let scene = Scene::build(&house, Catalogue::bundled(), UNKNOWN).expect("defaults allowed");
        assert_eq!(scene.bodies.len(), scene.first_object + house.objects.len(), "{name}");
        let is_finite = |v: &Vec3| v.iter().all(|c| c.is_finite());
        for body in &scene.bodies {
            let is_sound = body.parts.is_empty() || is_finite(&body.aabb.min_m);
            assert!(is_sound && body.parts.iter().all(|p| is_finite(&p.centre_m)), "{name}");
        }
        num_built += 1;
    }
    eprintln!("{num_built} of {num_houses} houses built");
    assert!(num_bundled > 100 && num_built * 100 >= num_houses * 99, "{num_built} of {num_houses}");
}

/// Height of the highest top face of a yawed body's parts under a point, at or below `limit_m`.
fn support_m(parts: &[Part], [x, z]: Vec2, limit_m: f64) -> Option<f64> {
    let top = |part: &Part| {
        let offset = [x - part.centre_m[0], 0.0, z - part.centre_m[2]];
        let own: Vec3 =
            std::array::from_fn(|j| (0..3).map(|i| part.rotation[i][j] * offset[i]).sum());
        if part.rotation[1][1] < 0.999 {
            return None; // Lies on its side: no level top.
        }
        let (is_over, half_m) = match part.primitive {
            Primitive::Cuboid { half_m: [w, h, d] } => (own[0].abs() <= w && own[2].abs() <= d, h),
            Primitive::Frustum { top_m: [w, d], half_height_m, .. } => {
                ((own[0] / w).powi(2) + (own[2] / d).powi(2) <= 1.0, half_height_m)
            }
            Primitive::Ellipsoid { .. } | Primitive::Pad { .. } => (false, 0.0),
        };
        let height_m = part.centre_m[1] + half_m;
        (is_over && height_m <= limit_m).then_some(height_m)
    };
    parts.iter().filter_map(top).max_by(f64::total_cmp)
}

/// Children of recorded houses come to rest on a surface of their parent's shape.
#[test]
fn recorded_children_rest_on_their_parents() {
    let catalogue = Catalogue::bundled();
    let (mut num_children, mut num_resting, mut num_buried) = (0, 0, 0);
    for (name, json) in recorded_houses() {
        let Ok(house) = House::from_json(&name, &json) else { continue };
        if name.contains("procthor-generated") {
            continue; // Placed by a stand-in simulator, not by the real one.
        }
        let scene = Scene::build(&house, catalogue, UNKNOWN).expect("defaults allowed");
        let bodies = &scene.bodies[scene.first_object..];
        for (body, object) in bodies.iter().zip(&house.objects) {
            let Some(parent) = object.parent else { continue };
            let is_known = |id: &str| catalogue.get(id).is_some();
            if !is_known(&object.asset_id) || !is_known(&house.objects[parent].asset_id) {
                continue;
            }
            let parts = &bodies[parent].parts;
            let (bottom_m, centre_m, size_m) =
                (body.aabb.min_m[1], body.aabb.centre_m(), body.aabb.size_m());
            let corner = |i: f64, j: f64| {
                [centre_m[0] + 0.4 * i * size_m[0], centre_m[2] + 0.4 * j * size_m[2]]
            };
            let spots = [(0.0, 0.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
            let is_resting = spots.iter().any(|&(i, j)| {
                support_m(parts, corner(i, j), bottom_m + 0.03).is_some_and(|y| bottom_m - y < 0.03)
            });
            num_children += 1;
            num_resting += usize::from(is_resting);
            num_buried += usize::from(parts.iter().any(|part| holds(part, centre_m)));
        }
    }
    if num_children == 0 {
        eprintln!("skipped: no houses: set EVONAV_DATA to a folder that has some");
        return;
    }
    eprintln!(
        "of {num_children} children {num_resting} rest on a surface, {num_buried} are buried"
    );
    assert!(num_resting * 100 >= num_children * 97 && num_buried * 100 <= num_children * 2);
}
