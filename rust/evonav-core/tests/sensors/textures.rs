//! Textures of materials, how they are looked up, and how they lie on parts.

use evonav_core::{
    assets::{
        material::{Layout, Material, MaterialKind},
        part::{Part, Primitive},
    },
    geometry::{IDENTITY, Vec3, add, rotate, yaw_rotation},
    sensors::{
        camera::Camera,
        raster::{FrameBuffer, Style, Want, render},
    },
    textures::{Level, NEUTRAL, Texel, Texture, channels_of, texture_of},
    world::{mesh::SceneMesh, skin::Skin},
};
use proptest::prelude::*;

use crate::scenes::scene_of;

fn textures() -> impl Iterator<Item = (MaterialKind, &'static Texture)> {
    let variants = |&kind: &MaterialKind| {
        (0..kind.num_variants()).map(move |v| Material { kind, variant: v as u8 })
    };
    let materials = MaterialKind::ALL.iter().flat_map(variants);
    materials.filter_map(|material| Some((material.kind, texture_of(material)?)))
}

fn texels(level: &Level) -> impl Iterator<Item = Texel> + '_ {
    let size = level.size();
    (0..size * size).map(move |i| level.texel(i % size, i / size))
}

#[test]
fn textures_keep_the_colour_of_their_surface_on_average() {
    for (kind, texture) in textures().filter(|(kind, _)| !kind.is_picture()) {
        let level = &texture.levels()[0];
        let count = (level.size() * level.size()) as f32;
        for i in 0..3 {
            let mean = texels(level).map(|texel| texel[i]).sum::<f32>() / count;
            assert!((mean / NEUTRAL - 1.0).abs() < 0.02, "{kind:?} channel {i}: {mean}");
        }
    }
}

#[test]
fn smaller_copies_are_averages() {
    for (kind, texture) in textures() {
        for pair in texture.levels().windows(2) {
            let [fine, coarse] = pair else { unreachable!() };
            assert_eq!(fine.size(), 2 * coarse.size());
            for (x, y) in (0..coarse.size()).flat_map(|y| (0..coarse.size()).map(move |x| (x, y))) {
                let four = [[0, 0], [1, 0], [0, 1], [1, 1]]
                    .map(|[dx, dy]| fine.texel(2 * x + dx, 2 * y + dy));
                for i in 0..4 {
                    let mean = four.iter().map(|texel| texel[i]).sum::<f32>() / 4.0;
                    assert!((coarse.texel(x, y)[i] - mean).abs() <= 1.01, "{kind:?}");
                }
            }
        }
        assert_eq!(texture.levels().last().map(Level::size), Some(1));
    }
}

/// Mean difference between a column (or row) and the one before it.
fn step(level: &Level, at: usize, is_row: bool) -> f32 {
    let size = level.size();
    let texel = |i: usize, j: usize| if is_row { level.texel(j, i) } else { level.texel(i, j) };
    let difference = |j| (texel(at, j)[1] - texel((at + size - 1) % size, j)[1]).abs();
    (0..size).map(difference).sum::<f32>() / size as f32
}

#[test]
fn repeated_textures_have_no_seam() {
    let repeated = |kind: MaterialKind| matches!(kind.layout(), Layout::Repeated(_));
    for (kind, texture) in textures().filter(|&(kind, _)| repeated(kind)) {
        let level = &texture.levels()[0];
        for is_row in [false, true] {
            let inside = (1..level.size()).map(|i| step(level, i, is_row)).fold(0.0, f32::max);
            let seam = step(level, 0, is_row);
            assert!(seam <= 1.1 * inside + 0.5, "{kind:?} rows {is_row}: {seam} {inside}");
        }
    }
}

/// The mixture of the four texels around a place, written down plainly.
fn sample_naive(level: &Level, u: f64, v: f64) -> [f64; 4] {
    let size = level.size() as f64;
    let [x, y] = [u, v].map(|t| t * size - 0.5);
    let wrapped = |t: f64| t.rem_euclid(size) as usize;
    let mut sum = [0.0; 4];
    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let texel = level.texel(wrapped(x.floor() + dx), wrapped(y.floor() + dy));
        let near = |t: f64, d: f64| 1.0 - (t - t.floor() - d).abs();
        for i in 0..4 {
            sum[i] += near(x, dx) * near(y, dy) * f64::from(texel[i]);
        }
    }
    sum
}

proptest! {
    #[test]
    fn lookups_agree_with_the_plain_mixture(
        u in -20.0..20.0_f32, v in -20.0..20.0_f32, halvings in 0..5_i32, kind in 0..40_usize,
    ) {
        let material = Material { kind: MaterialKind::ALL[kind], variant: 1 };
        let Some(texture) = texture_of(material) else { return Ok(()) };
        let level = (halvings as usize).min(texture.levels().len() - 1);
        let width2 = 4.0_f32.powi(level as i32);
        let found = channels_of(texture.sample(u, v, width2));
        let expected = sample_naive(&texture.levels()[level], f64::from(u), f64::from(v));
        for i in 0..4 {
            // Weights have 8 bits.
            prop_assert!((f64::from(found[i]) - expected[i]).abs() < 2.5, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn what_is_far_away_has_the_colour_of_its_surface(
        u in -20.0..20.0_f32, v in -20.0..20.0_f32, kind in 0..26_usize,
    ) {
        let material = Material { kind: MaterialKind::ALL[kind], variant: 0 };
        let Some(texture) = texture_of(material) else { return Ok(()) };
        let found = channels_of(texture.sample(u, v, 1e8));
        prop_assert!((found[0] / NEUTRAL - 1.0).abs() < 0.02, "{kind}");
    }

    #[test]
    fn textures_move_and_turn_with_objects(
        yaw_rad in 0.0..6.3_f64, to_m in [-5.0..5.0_f64, 0.0..2.0_f64, -5.0..5.0_f64],
        at in [-0.4..0.4_f64, -0.1..0.1_f64, -0.3..0.3_f64], kind in 0..40_usize,
    ) {
        let part = board(MaterialKind::ALL[kind]);
        let turn = yaw_rotation(yaw_rad);
        let moved = part.placed(to_m, &turn);
        let [before, after] = [part, moved].map(skins);
        for (before, after) in before.iter().zip(&after) {
            let there = add(to_m, rotate(&turn, at));
            let [a, b] = [before.coordinates(at), after.coordinates(there)];
            prop_assert!((a[0] - b[0]).abs() < 1e-4 && (a[1] - b[1]).abs() < 1e-4);
        }
    }

    #[test]
    fn materials_change_neither_depth_nor_instances(
        kind in 0..40_usize, yaw_rad in 0.0..6.3_f64,
    ) {
        let materials = [MaterialKind::Smooth, MaterialKind::ALL[kind]];
        let [plain, textured] = materials.map(|kind| frame_of(board(kind), yaw_rad, Style::Default));
        prop_assert_eq!(plain.depth_m, textured.depth_m);
        prop_assert_eq!(plain.instances, textured.instances);
        let [plain, textured] =
            materials.map(|kind| frame_of(board(kind), yaw_rad, Style::Outlined));
        prop_assert_eq!(plain.rgb, textured.rgb);
    }
}

/// A board of 80 x 20 x 60 cm about the origin.
fn board(kind: MaterialKind) -> Part {
    Part {
        primitive: Primitive::Cuboid { half_m: [0.4, 0.1, 0.3] },
        centre_m: [0.0; 3],
        rotation: IDENTITY,
        colour: [150, 120, 90],
        material: Material { kind, variant: 3 },
    }
}

fn skins(part: Part) -> Vec<Skin> {
    SceneMesh::build(&scene_of(&[vec![part]])).skins().to_vec()
}

fn frame_of(part: Part, yaw_rad: f64, style: Style) -> FrameBuffer {
    let mesh = SceneMesh::build(&scene_of(&[vec![part]]));
    let camera = Camera {
        width_px: 33,
        height_px: 20,
        vertical_fov_rad: 1.2,
        position_m: [-2.0 * yaw_rad.sin(), 0.8, -2.0 * yaw_rad.cos()],
        yaw_rad,
        horizon_rad: 0.35,
    };
    let mut frame = FrameBuffer::default();
    render(&mesh, &camera, Want { rgb: Some(style), instances: true }, &mut frame).expect("valid");
    frame
}

#[test]
fn pictures_fill_the_broad_faces_upright() {
    let mut part = board(MaterialKind::Painting);
    part.primitive = Primitive::Cuboid { half_m: [0.4, 0.3, 0.01] };
    let mesh = SceneMesh::build(&scene_of(&[vec![part]]));
    for (face, skin) in mesh.faces().iter().zip(mesh.skins()) {
        assert_eq!(skin.is_plain(), face.normal[2].abs() < 0.5);
        if skin.is_plain() {
            continue;
        }
        // Seen along -z, x grows to the left.
        let right: Vec3 = [-0.4 * face.normal[2], -0.3, 0.0];
        let [upper_left, lower_right] = [right.map(|x| -x), right].map(|p| skin.coordinates(p));
        for (found, expected) in upper_left.into_iter().chain(lower_right).zip([0.0, 0.0, 1.0, 1.0])
        {
            assert!((found - expected as f32).abs() < 1e-5, "{upper_left:?} {lower_right:?}");
        }
    }
}
