//! Colours of the default style against a picture that is computed pixel by pixel: the response to
//! light, dark corners and smooth edges.

use evonav_core::{
    assets::{
        material::{Material, MaterialKind},
        part::{Part, Primitive},
    },
    geometry::IDENTITY,
    sensors::{
        camera::{CLIP_M, Camera, View},
        raster::{FrameBuffer, Style, Want, render},
    },
    world::mesh::{SceneMesh, Triangle},
};
use proptest::{collection::vec, prelude::*, test_runner::Config};

use super::tracer::{cuboid_ahead, first_met, look_through, scene_of};

/// A face: its body and its normal in steps of 0.0001. `None`: nothing is there.
type Face = Option<(u32, [i32; 3])>;

/// A picture by `[column, row]`.
struct Picture<'a> {
    size_px: [i64; 2],
    focal_px: f64,
    depth_m: &'a [f32],
    faces: Vec<Face>,
    /// Colours before edges are smooth.
    colours: Vec<[f64; 3]>,
}

impl Picture<'_> {
    fn index(&self, [column, row]: [i64; 2]) -> Option<usize> {
        let is_in = (0..self.size_px[0]).contains(&column) && (0..self.size_px[1]).contains(&row);
        is_in.then_some((row * self.size_px[0] + column) as usize)
    }

    fn nearness(&self, place: [i64; 2]) -> f64 {
        let depth_m = f64::from(self.depth_m[self.index(place).expect("a place in the picture")]);
        1.0 / depth_m.min(CLIP_M[1])
    }

    /// The share of light that a corner leaves: planes are straight in nearness, corners bend.
    fn open(&self, [column, row]: [i64; 2]) -> f64 {
        const REACH: i64 = 2;
        let centre = self.nearness([column, row]);
        let [width, height] = self.size_px;
        // Beyond the left and right border the outermost plane goes on.
        let along = |column: i64| {
            let inside = column.clamp(0, width - 1);
            let inner = if column < 0 { 1.min(width - 1) } else { (width - 2).max(0) };
            let edge = self.nearness([inside, row]);
            edge + (column - inside).abs() as f64 * (edge - self.nearness([inner, row]))
        };
        let level = along(column - REACH) + along(column + REACH);
        let is_whole = row >= REACH && row + REACH < height;
        let upright = match is_whole {
            true => self.nearness([column, row - REACH]) + self.nearness([column, row + REACH]),
            false => 2.0 * centre,
        };
        let shade = |sum: f64| {
            let bend = 0.5 * (0.5 * sum - centre) / centre * self.focal_px / REACH as f64;
            0.08 * (bend / 0.7).clamp(0.0, 1.0) * (1.8 - bend).clamp(0.0, 1.0)
        };
        1.0 - shade(level).max(shade(upright))
    }

    /// The changes of a pixel at its border in the direction `across`, if the face there is another
    /// one: lines run from the middle of a border's run, on the border, to half a pixel aside where
    /// a neighbour's face comes around its end.
    fn changes(&self, pixel: [i64; 2], across: [i64; 2], along: [i64; 2]) -> Vec<[f64; 3]> {
        let at = |steps: i64, side: i64| -> Option<usize> {
            self.index([0, 1].map(|k| pixel[k] + steps * along[k] + side * across[k]))
        };
        let face = |steps: i64, side: i64| at(steps, side).map(|index| self.faces[index]);
        let differs = |steps: i64| face(steps, 0) != face(steps, 1);
        let (Some(own), Some(other)) = (at(0, 0), at(0, 1)) else { return Vec::new() };
        if !differs(0) {
            return Vec::new();
        }
        // Each end: its place, and whether the pixel's own side goes around it or the other one.
        let ends = [-1, 1].map(|sign: i64| {
            let steps = sign * (1..).find(|steps| !differs(sign * steps)).expect("an end");
            let beyond = face(steps, 0);
            let goes = |side| i32::from(beyond == face(steps - sign, side));
            let place = if sign < 0 { steps + 1 } else { steps };
            (place as f64, goes(0) - goes(1))
        });
        let middle = match ends.map(|(_, side)| side) {
            [0, _] => ends[0].0,
            [_, 0] => ends[1].0,
            _ => 0.5 * (ends[0].0 + ends[1].0),
        };
        let change = |(tip, side): (f64, i32)| {
            const NUM_SAMPLES: i32 = 64;
            let samples = (0..NUM_SAMPLES).map(|k| (f64::from(k) + 0.5) / f64::from(NUM_SAMPLES));
            let height = |x: f64| 0.5 * ((x - middle) / (tip - middle)).max(0.0);
            let share = samples.map(height).sum::<f64>() / f64::from(NUM_SAMPLES);
            let [own, other] = [own, other].map(|index| self.colours[index]);
            // The other face comes in where it goes around the end.
            (side < 0 && share > 0.0).then(|| std::array::from_fn(|i| share * (other[i] - own[i])))
        };
        ends.into_iter().filter_map(change).collect()
    }

    /// A pixel's colour with smooth edges, and the number of its changes.
    fn smooth(&self, pixel: [i64; 2]) -> ([f64; 3], usize) {
        const LEVEL: [i64; 2] = [1, 0];
        const UPRIGHT: [i64; 2] = [0, 1];
        let sides = [([0, 1], LEVEL), ([0, -1], LEVEL), ([1, 0], UPRIGHT), ([-1, 0], UPRIGHT)];
        let changes: Vec<_> = sides
            .into_iter()
            .flat_map(|(across, along)| self.changes(pixel, across, along))
            .collect();
        let own = self.colours[self.index(pixel).expect("a pixel in the picture")];
        let sum = |i: usize| own[i] + changes.iter().map(|change| change[i]).sum::<f64>();
        (std::array::from_fn(|i| sum(i).clamp(0.0, 255.0)), changes.len())
    }
}

/// The response of the camera to a surface in the even light of views without a house.
fn lit(colour: [u8; 3], open: f64) -> [f64; 3] {
    colour.map(|own| {
        let raised = 22.0 + f64::from(own) * (1.0 - 22.0 / 255.0);
        let bright = raised / 255.0 * 0.85 * 0.88 * open;
        255.0 * bright * (0.80 + 0.55 * bright - 0.40 * bright * bright)
    })
}

/// The first face along the look through a pixel.
fn face_at(triangles: &[Triangle], view: &View, pixel: [i64; 2]) -> Face {
    let (triangle, normal) = first_met(triangles, view, pixel)?;
    Some((triangle.body, normal.map(|x| (1e4 * x).round() as i32)))
}

proptest! {
    #![proptest_config(Config { cases: 100, ..Config::default() })]

    #[test]
    fn pictures_agree_with_pixels_that_are_lit_and_blended_one_by_one(
        parts in vec(cuboid_ahead(), 1..7),
        width_px in 3..60_usize,
        height_px in 3..45_usize,
        vertical_fov_rad in 0.8..1.6_f64,
        horizon_rad in -0.3..0.3_f64,
    ) {
        let position_m = [0.0, 0.3, 0.0];
        let camera =
            Camera { width_px, height_px, vertical_fov_rad, position_m, yaw_rad: 0.1, horizon_rad };
        let mesh = SceneMesh::build(&scene_of(&parts));
        let mut frame = FrameBuffer::default();
        let want = Want { rgb: Some(Style::Default), instances: true };
        render(&mesh, &camera, want, &mut frame).unwrap();
        let triangles: Vec<Triangle> = mesh.triangles().collect();
        let view = View::from(camera);
        let size_px = [width_px, height_px].map(|side| side as i64);
        let places: Vec<[i64; 2]> =
            (0..size_px[1]).flat_map(|row| (0..size_px[0]).map(move |column| [column, row])).collect();
        let faces = places.iter().map(|&place| face_at(&triangles, &view, place)).collect();
        let focal_px = 0.5 * height_px as f64 / (0.5 * vertical_fov_rad).tan();
        let mut picture =
            Picture { size_px, focal_px, depth_m: &frame.depth_m, faces, colours: Vec::new() };
        let mut colours = Vec::new();
        for (&place, face) in places.iter().zip(&picture.faces) {
            let (_, ray) = look_through(&view, place.map(|at| at as f64 + 0.5));
            colours.push(match face {
                Some((body, _)) => lit(parts[*body as usize].colour, picture.open(place)),
                // The sky and the ground are not lit.
                None if ray[1] < 0.0 => [46.0, 44.0, 42.0],
                None => [204.0, 222.0, 236.0],
            });
        }
        picture.colours = colours;
        for (&place, found) in places.iter().zip(frame.rgb.chunks_exact(3)) {
            let (expected, num_changes) = picture.smooth(place);
            // Colours and changes are whole numbers.
            let slack = 1.5 + num_changes as f64;
            for i in 0..3 {
                prop_assert!(
                    (f64::from(found[i]) - expected[i]).abs() < slack,
                    "{found:?} at {place:?}, not {expected:?}"
                );
            }
        }
    }

    #[test]
    fn glass_shows_what_is_behind_it_in_colours_alone(
        parts in vec(cuboid_ahead(), 1..6),
        half_m in [0.1..3.0_f64, 0.1..3.0_f64],
        centre_m in [-0.4..0.4_f64, -0.4..0.4_f64],
    ) {
        let pane = Part {
            primitive: Primitive::Cuboid { half_m: [half_m[0], half_m[1], 0.01] },
            centre_m: [centre_m[0], centre_m[1], 0.5],
            rotation: IDENTITY,
            colour: [90, 60, 30],
            material: Material { kind: MaterialKind::Pane, variant: 0 },
        };
        let board = Part { material: Material::default(), ..pane };
        let camera = Camera {
            width_px: 53,
            height_px: 40,
            vertical_fov_rad: 1.2,
            position_m: [0.0; 3],
            yaw_rad: 0.0,
            horizon_rad: 0.0,
        };
        // The same buffer for all: nothing is left of the picture before.
        let mut buffer = FrameBuffer::default();
        let picture = |front: Option<Part>, buffer: &mut FrameBuffer| {
            let all: Vec<Part> = parts.iter().copied().chain(front).collect();
            let want = Want { rgb: Some(Style::Default), instances: true };
            render(&SceneMesh::build(&scene_of(&all)), &camera, want, buffer).unwrap();
            let (depth_m, rgb) = buffer.take();
            (depth_m, rgb, buffer.instances.clone())
        };
        let [glazed, opaque, open] =
            [Some(pane), Some(board), None].map(|front| picture(front, &mut buffer));
        prop_assert_eq!(&glazed.0, &opaque.0, "depth");
        prop_assert_eq!(&glazed.2, &opaque.2, "instances");
        // Nor is anything left of it in a smaller picture of another style.
        let small = Camera { width_px: 20, height_px: 15, ..camera };
        let mesh = SceneMesh::build(&scene_of(&[parts[0], pane]));
        let styles = [Style::Default, Style::Plain];
        let [_, plain] = styles.map(|style| {
            let want = Want { rgb: Some(style), instances: true };
            let camera = if style == Style::Plain { small } else { camera };
            render(&mesh, &camera, want, &mut buffer).unwrap();
            buffer.take().1
        });
        let mut fresh = FrameBuffer::default();
        let want = Want { rgb: Some(Style::Plain), instances: true };
        render(&mesh, &small, want, &mut fresh).unwrap();
        prop_assert_eq!(plain, fresh.rgb);
        // Where glass fills the picture, no line around it reaches into it.
        if glazed.2.iter().any(|&body| body != parts.len() as i32 + 1) {
            return Ok(());
        }
        let pixels = glazed.1.chunks_exact(3).zip(open.1.chunks_exact(3));
        for (index, (seen, behind)) in pixels.enumerate() {
            let is_ground = open.2[index] == 0 && index / camera.width_px >= 20;
            let lawn = [116, 146, 86];
            for i in 0..3 {
                let behind = if is_ground { lawn[i] } else { u16::from(behind[i]) };
                prop_assert_eq!(u16::from(seen[i]), (14 * behind + 2 * [206, 220, 224][i]) / 16);
            }
        }
    }
}
