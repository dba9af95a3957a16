//! Textures of materials, how they are looked up, and how they lie on parts.

use std::array::from_fn;

use evonav_core::{
    assets::{
        material::{Layout, Material, MaterialKind},
        part::{Part, Primitive},
    },
    geometry::{IDENTITY, Vec3, add, rotate, yaw_rotation},
    sensors::{
        camera::{Camera, View},
        raster::{FrameBuffer, Style, Want, render},
    },
    textures::{Level, MOST_PLACES, NEUTRAL, Sums, Texel, Texture, texture_of},
    world::{mesh::SceneMesh, skin::Skin},
};
use evonav_simd::Kernel;
use proptest::{prelude::*, test_runner::Config};

use super::tracer::look_through;
use crate::common::scenes::scene_of;

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

/// Patterns are drawn in rows, which compilers turn into SIMD; images depend on every byte.
#[test]
fn textures_are_the_same_on_every_processor() {
    let variants = |&kind: &MaterialKind| {
        (0..kind.num_variants().min(2)).map(move |v| Material { kind, variant: v as u8 })
    };
    let drawn = MaterialKind::ALL.iter().flat_map(variants).filter_map(texture_of);
    let digest = drawn.fold(0x811c_9dc5, |digest, texture| {
        let hash = |h: u32, byte: u8| (h ^ u32::from(byte)).wrapping_mul(0x0100_0193);
        format!("{texture:?}").bytes().fold(digest, hash)
    });
    assert_eq!(digest, 0x62b9_55c3);
}

#[test]
fn textures_keep_the_colour_of_their_surface_on_average() {
    for (kind, texture) in textures().filter(|(kind, _)| !kind.is_picture()) {
        let level = texture.finest();
        let count = (level.size() * level.size()) as f32;
        for i in 0..3 {
            let mean = texels(level).map(|texel| texel[i]).sum::<f32>() / count;
            assert!((mean / NEUTRAL - 1.0).abs() < 0.02, "{kind:?} channel {i}: {mean}");
        }
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
        let level = texture.finest();
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

/// A blurred copy at the texel nearest to a place, written down plainly: a binomial mixture of
/// means over squares of `1 << halvings` texels.
fn blurred_naive(level: &Level, u: f64, v: f64, halvings: u32, num_weights: i32) -> [f64; 4] {
    let (side, size) = (1_i64 << halvings, level.size() as i64);
    let at = |t: f64| (t * (size / side) as f64).floor() as i64;
    let choose = |k: i32| (0..k).map(|i| f64::from(num_weights - 1 - i) / f64::from(i + 1));
    let weight = |k: i32| choose(k).product::<f64>() / 2.0_f64.powi(num_weights - 1);
    let mut sum = [0.0; 4];
    for (i, j) in (0..num_weights).flat_map(|i| (0..num_weights).map(move |j| (i, j))) {
        let [x, y] = [(u, i), (v, j)].map(|(t, k)| side * (at(t) + i64::from(k - num_weights / 2)));
        for (dx, dy) in (0..side).flat_map(|dx| (0..side).map(move |dy| (dx, dy))) {
            let wrapped = |t: i64| t.rem_euclid(size) as usize;
            let texel = level.texel(wrapped(x + dx), wrapped(y + dy));
            for channel in 0..4 {
                let share = weight(i) * weight(j) / (side * side) as f64;
                sum[channel] += share * f64::from(texel[channel]);
            }
        }
    }
    sum
}

/// Looks places up.
struct Look<'a> {
    texture: &'a Texture,
    u: &'a [f32],
    v: &'a [f32],
    width2: f32,
}

impl Kernel for Look<'_> {
    type Output = Sums;

    #[inline(always)]
    fn compute(self) -> Sums {
        let mut sums = [[0; MOST_PLACES]; 3];
        self.texture.sample(self.texture.level(self.width2), self.u, self.v, &mut sums);
        sums
    }
}

/// Look one place up, as the third of a block of others.
fn sample(texture: &Texture, u: f32, v: f32, width2: f32) -> [f32; 3] {
    let (mut all_u, mut all_v) = ([0.3; 8], [0.7; 8]);
    (all_u[2], all_v[2]) = (u, v);
    let sums = evonav_simd::compute(Look { texture, u: &all_u, v: &all_v, width2 });
    sums.map(|channel| f32::from(channel[2]) / 256.0)
}

proptest! {
    #[test]
    fn near_lookups_agree_with_the_plain_mixture(
        u in -20.0..20.0_f32, v in -20.0..20.0_f32, width2 in 0.0..2.5_f32, kind in 0..40_usize,
    ) {
        let material = Material { kind: MaterialKind::ALL[kind], variant: 1 };
        let Some(texture) = texture_of(material) else { return Ok(()) };
        let found = sample(texture, u, v, width2);
        let expected = sample_naive(texture.finest(), f64::from(u), f64::from(v));
        for i in 0..3 {
            // Weights have 8 bits.
            prop_assert!((f64::from(found[i]) - expected[i]).abs() < 2.5, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn far_lookups_agree_with_the_plain_blur(
        texel in [-300..300_i32, -300..300_i32], copy in 0..8_u32, kind in 0..40_usize,
    ) {
        let material = Material { kind: MaterialKind::ALL[kind], variant: 1 };
        let Some(texture) = texture_of(material) else { return Ok(()) };
        let (halvings, is_wide) = (copy / 2, copy % 2 == 1);
        // The middle of a texel of the copy.
        let size = (texture.size() >> halvings) as f32;
        let [u, v] = texel.map(|t| (t as f32 + 0.5) / size);
        let found = sample(texture, u, v, 4.0 * 2.0_f32.powi(copy as i32));
        let num_weights = if is_wide { 9 } else { 5 };
        let expected =
            blurred_naive(texture.finest(), f64::from(u), f64::from(v), halvings, num_weights);
        for i in 0..3 {
            prop_assert!((f64::from(found[i]) - expected[i]).abs() < 1.1, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn lookups_are_the_same_on_every_processor_and_in_any_number(
        start in [-20.0..20.0_f32, -20.0..20.0_f32],
        step in [-0.1..0.1_f32, -0.1..0.1_f32],
        width2 in 0.0..100.0_f32,
        num in 1..=MOST_PLACES,
        kind in 0..40_usize,
    ) {
        let material = Material { kind: MaterialKind::ALL[kind], variant: 1 };
        let Some(texture) = texture_of(material) else { return Ok(()) };
        let [u, v]: [[f32; MOST_PLACES]; 2] =
            from_fn(|axis| from_fn(|i| start[axis] + i as f32 * step[axis]));
        let look = |of: std::ops::Range<usize>| {
            Look { texture, u: &u[of.clone()], v: &v[of], width2 }
        };
        let fast = evonav_simd::compute(look(0..num));
        prop_assert_eq!(fast, look(0..num).compute());
        for place in 0..num {
            let alone = look(place..place + 1).compute();
            prop_assert_eq!(alone.map(|channel| channel[0]), fast.map(|channel| channel[place]));
        }
    }

    #[test]
    fn what_is_far_away_has_the_colour_of_its_surface(
        u in -20.0..20.0_f32, v in -20.0..20.0_f32, kind in 0..26_usize,
    ) {
        let material = Material { kind: MaterialKind::ALL[kind], variant: 0 };
        let Some(texture) = texture_of(material) else { return Ok(()) };
        let found = sample(texture, u, v, 1e8);
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
            materials.map(|kind| frame_of(board(kind), yaw_rad, Style::Plain));
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

proptest! {
    #![proptest_config(Config { cases: 64, ..Config::default() })]

    /// Close up, away from edges and corners, colours are those of the texture's mixture at the
    /// point that a pixel shows.
    #[test]
    fn pictures_of_textures_agree_with_points_that_are_looked_up_one_by_one(
        kind in 0..40_usize, colour in any::<[u8; 3]>(), away_m in 0.25..0.4_f64,
        aside_m in -0.1..0.1_f64, horizon_rad in 1.0..1.5_f64,
    ) {
        let kind = MaterialKind::ALL[kind];
        let material = Material { kind, variant: 3 };
        let Some(texture) = texture_of(material) else { return Ok(()) };
        let mut part = board(kind);
        part.colour = colour;
        let mesh = SceneMesh::build(&scene_of(&[vec![part]]));
        let camera = Camera {
            width_px: 150,
            height_px: 120,
            vertical_fov_rad: 0.4,
            position_m: [aside_m, 0.1 + away_m, -0.12],
            yaw_rad: 0.3,
            horizon_rad,
        };
        let mut frame = FrameBuffer::default();
        let want = Want { rgb: Some(Style::Default), instances: true };
        render(&mesh, &camera, want, &mut frame).expect("valid");
        let top = mesh.faces().iter().position(|face| face.normal[1] > 0.5).expect("a top");
        let skin = mesh.skins()[top];
        prop_assume!(!skin.is_plain());
        let view = View::from(camera);
        let size = texture.size() as f64;
        for (column, row) in (9..111).step_by(6).flat_map(|row| (9..141).map(move |c| (c, row))) {
            let index = row * camera.width_px + column;
            let point_m = |px: [f64; 2]| {
                let (origin_m, ray) = look_through(&view, px);
                let along = (0.1 - origin_m[1]) / ray[1];
                add(origin_m, ray.map(|x| x * along))
            };
            let middle = [column as f64 + 0.5, row as f64 + 0.5];
            let [point_m, right_m, below_m] =
                [middle, [middle[0] + 1.0, middle[1]], [middle[0], middle[1] + 1.0]].map(point_m);
            let [place, right, below] = [point_m, right_m, below_m].map(|p| skin.coordinates(p));
            let texels = |other: [f32; 2]| {
                let [du, dv] = [0, 1].map(|i| f64::from(other[i] - place[i]) * size);
                (du * du + dv * dv).sqrt()
            };
            // Further surfaces are looked up in blurred copies.
            if texels(right).max(texels(below)) > 1.4 || point_m[0].abs() > 0.35 || point_m[2].abs() > 0.25 {
                continue;
            }
            let factors = sample_naive(texture.finest(), f64::from(place[0]), f64::from(place[1]));
            for i in 0..3 {
                let own = if kind.is_picture() { 128.0 } else { f64::from(colour[i]) };
                let raised = (factors[i] / 128.0 * own * (1.0 - 22.0 / 255.0)).min(255.0 - 22.0) + 22.0;
                let bright = raised / 255.0 * 0.85 * 0.88;
                let expected = 255.0 * bright * (0.80 + 0.55 * bright - 0.40 * bright * bright);
                let found = f64::from(frame.rgb[3 * index + i]);
                // A texel's channels are known to 2.5 of 128, as above; 24 bits place it.
                let slack = 1.5 + 0.012 * own;
                prop_assert!(
                    (found - expected).abs() < slack,
                    "{found} at {column}, {row}, not {expected}, {kind:?}"
                );
            }
        }
    }
}
