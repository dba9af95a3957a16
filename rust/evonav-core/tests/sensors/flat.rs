//! Flat colours, with lines around silhouettes and without, against a picture computed pixel by pixel.

use evonav_core::{
    sensors::{
        camera::{CLIP_M, Camera, View},
        raster::{FrameBuffer, Style, Want, render_rows_of, render_view},
    },
    world::mesh::{SceneMesh, Triangle},
};
use proptest::{collection::vec, prelude::*, test_runner::Config};

use super::tracer::{cuboid_ahead, first_met, look_through, scene_of};
use crate::common::scenes::dot;

/// A view's nearness, which is straight on planes: what bends are measured in.
struct Bent<'a> {
    size_px: [i64; 2],
    view: &'a View,
    depth_m: &'a [f32],
}

impl Bent<'_> {
    fn nearness(&self, [column, row]: [i64; 2]) -> f64 {
        let depth_m = f64::from(self.depth_m[(row * self.size_px[0] + column) as usize]);
        match self.view.half_height_m {
            None => 1.0 / depth_m.min(self.view.clip_m[1]),
            Some(_) => -depth_m.min(self.view.clip_m[1]),
        }
    }

    /// Nearness in a row that goes on at its ends as the planes there do.
    fn along(&self, column: i64, row: i64) -> f64 {
        let last = self.size_px[0] - 1;
        let edge = self.nearness([column.clamp(0, last), row]);
        let inner = if column < 0 { 1.min(last) } else { (last - 1).max(0) };
        let beyond = (-column).max(column - last).max(0) as f64;
        edge + beyond * (edge - self.nearness([inner, row]))
    }

    /// How far the mean of four neighbours is before a pixel, relative to their distance.
    fn bend(&self, [column, row]: [i64; 2], reach: i64) -> f64 {
        let centre = self.nearness([column, row]);
        let is_whole = row >= reach && row + reach < self.size_px[1];
        let upright = match is_whole {
            true => self.nearness([column, row - reach]) + self.nearness([column, row + reach]),
            false => 2.0 * centre,
        };
        let level = self.along(column - reach, row) + self.along(column + reach, row);
        let height_px = self.size_px[1] as f64;
        let half_m = self.view.half_height_m;
        let (unit, scale_px) = match half_m {
            None => (centre, 0.5 * height_px / (0.5 * self.view.camera.vertical_fov_rad).tan()),
            Some(half_m) => (1.0, 0.5 * height_px / half_m),
        };
        (0.25 * (level + upright) - centre) / unit * scale_px / reach as f64
    }

    /// What corners and, if there are lines, silhouettes leave of the light.
    fn open(&self, pixel: [i64; 2], has_lines: bool) -> f64 {
        let corner = self.bend(pixel, 2);
        let corner = 0.38 * (corner / 0.7).clamp(0.0, 1.0) * (1.8 - corner).clamp(0.0, 1.0);
        let line = if has_lines { 0.30 * (self.bend(pixel, 1) - 1.0).clamp(0.0, 1.0) } else { 0.0 };
        (1.0 - corner) * (1.0 - line)
    }
}

/// The colour of the first surface along a look, before corners are dark.
fn colour(triangles: &[Triangle], view: &View, pixel: [i64; 2]) -> [f64; 3] {
    let Some((triangle, normal)) = first_met(triangles, view, pixel) else {
        return [204.0, 222.0, 236.0];
    };
    let (_, ray) = look_through(view, pixel.map(|at| at as f64 + 0.5));
    let facing = -dot(normal, ray) / dot(ray, ray).sqrt();
    let light = 0.80 + 0.11 * (1.0 + normal[1]) + 0.09 * dot(normal, [0.64, 0.0, 0.77]);
    triangle.colour.map(|own| {
        let lit = 22.0 + f64::from(own) * (light - 22.0 / 255.0);
        lit * (0.64 + 0.36 * facing)
    })
}

proptest! {
    #![proptest_config(Config { cases: 100, ..Config::default() })]

    #[test]
    fn flat_pictures_agree_with_pixels_that_are_lit_one_by_one(
        parts in vec(cuboid_ahead(), 1..7),
        width_px in 3..60_usize,
        height_px in 3..45_usize,
        vertical_fov_rad in 0.8..1.6_f64,
        horizon_rad in -0.3..0.3_f64,
        half_height_m in prop::option::of(0.5..2.0_f64),
        has_lines in any::<bool>(),
    ) {
        let position_m = [0.0, 0.3, 0.0];
        let camera =
            Camera { width_px, height_px, vertical_fov_rad, position_m, yaw_rad: 0.1, horizon_rad };
        let view = View { camera, clip_m: CLIP_M, roll_rad: 0.0, half_height_m };
        let mesh = SceneMesh::build(&scene_of(&parts));
        let mut frame = FrameBuffer::default();
        let want = Want { rgb: Some(Style::Plain), instances: true };
        render_view(&mesh, &view, want, &mut frame).unwrap();
        let shown = frame.instances.iter().copied().max().unwrap_or(0);
        if has_lines {
            render_rows_of(&mesh, &view, shown, &mut frame).unwrap();
        }
        let is_drawn = |row: i64| {
            let row = &frame.instances[row as usize * width_px..][..width_px];
            !has_lines || row.contains(&shown)
        };
        let triangles: Vec<Triangle> = mesh.triangles().collect();
        let size_px = [width_px, height_px].map(|side| side as i64);
        let bent = Bent { size_px, view: &view, depth_m: &frame.depth_m };
        let places = (0..size_px[1]).flat_map(|row| (0..size_px[0]).map(move |column| [column, row]));
        for (place, found) in places.zip(frame.rgb.chunks_exact(3)).filter(|(at, _)| is_drawn(at[1])) {
            let (own, open) = (colour(&triangles, &view, place), bent.open(place, has_lines));
            for i in 0..3 {
                let expected = (own[i] * open).min(255.0);
                // Colours are whole numbers; nearness has 24 bits.
                prop_assert!(
                    (f64::from(found[i]) - expected).abs() < 0.7,
                    "{found:?} at {place:?}, not {own:?} times {open}"
                );
            }
        }
    }
}
