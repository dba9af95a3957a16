//! Sunlight: a map of what the sun sees first, and lookups in it.

use crate::{
    assets::material::MaterialKind,
    geometry::{Aabb, Vec3},
    sensors::{
        camera::{Camera, View},
        raster::{
            canvas::{Canvas, LANES},
            lens::{Lens, Scratch},
        },
    },
    world::mesh::{SceneMesh, dot},
};

/// Width of a cell of the map, unless the house is large.
const CELL_M: f64 = 0.016;
const MAX_SIDE_PX: f64 = 1200.0;
/// Distance by which a surface must be behind what the sun sees to be in its shadow.
const BIAS_M: f32 = 0.012;

/// Parallel light from one direction, and the depth at which it ends.
#[derive(Debug, Clone)]
pub(in crate::sensors::raster) struct Sun {
    /// Direction towards the sun.
    pub towards: [f32; 3],
    /// Cells `[across, down]` and nearness of a world point: `map . [x, y, z, 1]`.
    map: [[f32; 4]; 3],
    size: [i32; 2],
    /// Nearness of the first far side of a solid; rows are padded to whole blocks.
    nearness: Vec<[f32; LANES]>,
}

impl Sun {
    /// Draw the map.
    ///
    /// The far sides of solids are drawn rather than the near ones: then a lit surface never
    /// shadows itself, and ceilings, which have a lower side only, hold the light off. Panes let
    /// it through.
    pub fn build(towards: Vec3, mesh: &SceneMesh, bounds: &Aabb) -> Self {
        let view = view_from(towards, bounds);
        let lens = Lens::new(&view);
        let (width_px, height_px) = (view.camera.width_px, view.camera.height_px);
        let (mut canvas, mut scratch) = (Canvas::default(), Scratch::default());
        canvas.clear(width_px, height_px, 0.0);
        for part in &mesh.parts {
            lens.transform(&mesh.vertices_m[part.vertices.clone()], &mut scratch);
            let first = part.faces.start;
            if part.is_pane || mesh.skins[first].material.kind == MaterialKind::Outdoors {
                continue;
            }
            for face in &mesh.faces[part.faces.clone()] {
                let Some((plane, _)) = lens.nearness_plane(&face.reversed()) else { continue };
                let corners = mesh.corners_of(face).iter().rev();
                scratch.polygon_px.clear();
                scratch.polygon_px.extend(corners.map(|&i| scratch.projected_px[i as usize]));
                canvas.fill(&scratch.polygon_px, plane, 1);
            }
        }
        Self {
            towards: towards.map(|x| x as f32),
            map: lens.map_rows(),
            size: [width_px as i32, height_px as i32],
            nearness: canvas.nearness,
        }
    }

    /// Return the cells `[across, down]` and the nearness of points.
    #[inline(always)]
    fn cells(&self, points_m: &[[f32; LANES]; 3]) -> [[f32; LANES]; 3] {
        let [x, y, z] = points_m;
        let mut cells = [[0.0; LANES]; 3];
        for (cells, [a, b, c, d]) in cells.iter_mut().zip(self.map) {
            for lane in 0..LANES {
                cells[lane] = a * x[lane] + b * y[lane] + c * z[lane] + d;
            }
        }
        cells
    }

    /// Return whether the sun reaches each point, by the nearest cell alone.
    #[inline(always)]
    pub fn meets(&self, points_m: &[[f32; LANES]; 3]) -> [bool; LANES] {
        let [width, height] = self.size;
        let [u, v, own] = self.cells(points_m);
        let nearness = self.nearness.as_flattened();
        std::array::from_fn(|lane| {
            let column = u[lane].clamp(0.0, (width - 1) as f32) as usize;
            let row = v[lane].clamp(0.0, (height - 1) as f32) as usize;
            own[lane] + BIAS_M >= nearness[row * self.stride() + column]
        })
    }

    /// Return the number of cells in a padded row.
    #[inline(always)]
    fn stride(&self) -> usize {
        (self.size[0] as usize).next_multiple_of(LANES)
    }

    /// Return the share of the sun, 0 to 1, that reaches each point.
    #[inline(always)]
    pub fn reaches(&self, points_m: &[[f32; LANES]; 3]) -> [f32; LANES] {
        let [u, v, own] = self.cells(points_m);
        let mut reach = [0.0; LANES];
        for lane in 0..LANES {
            reach[lane] = self.share(u[lane] - 0.5, v[lane] - 0.5, own[lane] + BIAS_M);
        }
        reach
    }

    /// Compare with the nine cells around a point; return the mean of the answers over a square of
    /// two cells around it.
    #[inline(always)]
    fn share(&self, u: f32, v: f32, own: f32) -> f32 {
        let [width, height] = self.size;
        let (u, v) = (u.clamp(1.0, (width - 3) as f32), v.clamp(1.0, (height - 3) as f32));
        // The nearest cell, and the place in it.
        let (column, row) = ((u + 0.5) as i32, (v + 0.5) as i32);
        let (right, down) = (u + 0.5 - column as f32, v + 0.5 - row as f32);
        let line = |row: i32| -> f32 {
            let at = row as usize * self.stride() + column as usize - 1;
            let cells = &self.nearness.as_flattened()[at..at + 3];
            let seen = |i: usize| f32::from(u8::from(own >= cells[i]));
            0.5 * ((1.0 - right) * seen(0) + seen(1) + right * seen(2))
        };
        0.5 * ((1.0 - down) * line(row - 1) + line(row) + down * line(row + 1))
    }
}

/// Return the orthographic view from the sun that contains the house.
fn view_from(towards: Vec3, bounds: &Aabb) -> View {
    let [x, y, z] = towards;
    let level = (x * x + z * z).sqrt().max(1e-9);
    let (yaw_rad, horizon_rad) = ((-x).atan2(-z), y.atan2(level));
    let (centre_m, size_m) = (bounds.centre_m(), bounds.size_m());
    let radius_m = 0.5 * dot(size_m, size_m).sqrt().max(1.0);
    let mut camera = Camera {
        width_px: 2,
        height_px: 2,
        vertical_fov_rad: 1.0,
        position_m: std::array::from_fn(|i| centre_m[i] + towards[i] * (radius_m + 1.0)),
        yaw_rad,
        horizon_rad,
    };
    let axes = camera.camera_from_world();
    let half_m = [0, 1].map(|axis| {
        let reach: f64 = (0..3).map(|k| 0.5 * size_m[k] * axes[axis][k].abs()).sum();
        reach + 0.1
    });
    let cell_m = (2.0 * half_m[0].max(half_m[1]) / MAX_SIDE_PX).max(CELL_M);
    let side = |half_m: f64| ((2.0 * half_m / cell_m) as usize).max(4);
    (camera.width_px, camera.height_px) = (side(half_m[0]), side(half_m[1]));
    let half_height_m = Some(0.5 * cell_m * camera.height_px as f64);
    let far_m = 2.0 * radius_m + 2.0;
    View { camera, clip_m: [0.1, far_m], roll_rad: 0.0, half_height_m }
}
