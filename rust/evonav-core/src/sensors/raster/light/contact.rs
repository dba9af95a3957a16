//! Darkness near the floor where things stand on it or hang low over it.

use crate::{
    geometry::{Aabb, Vec2},
    sensors::{
        camera::{Camera, View},
        raster::{
            canvas::Canvas,
            lens::{Lens, Scratch},
        },
    },
    world::{
        mesh::SceneMesh,
        scene::{BodyKind, Scene},
    },
};

const CELL_M: f64 = 0.05;
const MAX_SIDE: f64 = 2000.0;
/// Height from which the floor is seen from below.
const BELOW_M: f64 = 0.5;

/// The openness to light of places in a house, over a grid: 1 where nothing is near.
#[derive(Debug)]
pub(in crate::sensors::raster) struct Contact {
    corner_m: Vec2,
    size: [usize; 2],
    /// Openness just above the floor and, of walls alone, at any height; row-major over
    /// `[row, column]` = (z, x).
    openness: [Vec<f32>; 2],
}

impl Contact {
    pub fn of(scene: &Scene, mesh: &SceneMesh, bounds: &Aabb) -> Self {
        let (centre_m, size_m) = (bounds.centre_m(), bounds.size_m());
        let cells = |edge_m: f64| (edge_m / CELL_M + 8.0).clamp(8.0, MAX_SIDE) as usize;
        let [width_px, height_px] = [cells(size_m[0]), cells(size_m[2])];
        let camera = Camera {
            width_px,
            height_px,
            vertical_fov_rad: 1.0,
            position_m: [centre_m[0], -BELOW_M, centre_m[2]],
            yaw_rad: 0.0,
            horizon_rad: -std::f64::consts::FRAC_PI_2,
        };
        let far_m = BELOW_M + size_m[1].max(1.0) + 1.0;
        let half_height_m = Some(0.5 * CELL_M * height_px as f64);
        let lens = Lens::new(&View { camera, clip_m: [0.1, far_m], roll_rad: 0.0, half_height_m });
        let kind = |body: u32| scene.bodies[body as usize].kind;
        let solid = |body| !matches!(kind(body), BodyKind::Floor | BodyKind::Ceiling);
        let wall = |body| kind(body) == BodyKind::Wall;
        let size = [height_px, width_px];
        let openness =
            [clearance_m(mesh, &lens, size, solid), clearance_m(mesh, &lens, size, wall)].map(
                |clearance_m| {
                    let near: Vec<f32> =
                        clearance_m.iter().map(|c| 1.0 / (1.0 + 14.0 * c)).collect();
                    let wide: Vec<f32> =
                        clearance_m.iter().map(|c| 1.0 / (1.0 + 3.0 * c * c)).collect();
                    let near = blurred(&blurred(&near, size, 1), size, 1);
                    let wide = blurred(&blurred(&wide, size, 4), size, 4);
                    let open =
                        |(near, wide): (&f32, &f32)| (1.0 - 0.5 * near) * (1.0 - 0.65 * wide);
                    near.iter().zip(&wide).map(open).collect()
                },
            );
        let corner_m = [
            centre_m[0] - 0.5 * CELL_M * width_px as f64,
            centre_m[2] - 0.5 * CELL_M * height_px as f64,
        ];
        Self { corner_m, size, openness }
    }

    /// Return the openness at `[x, z]`, interpolated; `height` is 0 on the floor, 1 where only
    /// walls are near.
    pub fn openness(&self, point_m: Vec2, height: f32) -> f32 {
        let [height_px, width] = self.size;
        let at = |axis: usize, size: usize| {
            let place = (point_m[axis] - self.corner_m[axis]) / CELL_M - 0.5;
            let place = place.clamp(0.0, (size - 2) as f64);
            let whole = place as usize;
            (whole, (place - whole as f64) as f32)
        };
        let ((column, right), (row, down)) = (at(0, width), at(1, height_px));
        let [low, high] = [0, 1].map(|level| {
            let pair = |row: usize| {
                let cells = &self.openness[level][row * width + column..][..2];
                cells[0] + right * (cells[1] - cells[0])
            };
            let (upper, lower) = (pair(row), pair(row + 1));
            upper + down * (lower - upper)
        });
        low + height * (high - low)
    }
}

/// Return the height over the floor of the lowest surface of some bodies, over the grid.
fn clearance_m(
    mesh: &SceneMesh,
    lens: &Lens,
    [height_px, width_px]: [usize; 2],
    is_counted: impl Fn(u32) -> bool,
) -> Vec<f32> {
    let (mut canvas, mut scratch) = (Canvas::default(), Scratch::default());
    canvas.clear(width_px, height_px, lens.far_nearness(), false);
    for part in mesh.parts.iter().filter(|part| is_counted(part.body)) {
        lens.transform(&mesh.vertices_m[part.vertices.clone()], &mut scratch);
        for face in &mesh.faces[part.faces.clone()] {
            let Some((plane, _)) = lens.nearness_plane(face) else { continue };
            let corners = mesh.corners_of(face).iter();
            scratch.polygon_px.clear();
            scratch.polygon_px.extend(corners.map(|&i| scratch.projected_px[i as usize]));
            canvas.fill(&scratch.polygon_px, plane);
        }
    }
    let floor = (lens.horizon_m() - BELOW_M) as f32;
    // Looking up with yaw 0, the image's rows run towards +z.
    let mut clearance_m = Vec::with_capacity(width_px * height_px);
    for row in 0..height_px {
        let cells = &canvas.row(row)[..width_px];
        clearance_m.extend(cells.iter().map(|nearness| (floor - nearness).max(0.0)));
    }
    clearance_m
}

/// Average over squares of `2 reach + 1` cells; the border is continued.
fn blurred(cells: &[f32], [height, width]: [usize; 2], reach: usize) -> Vec<f32> {
    let share = 1.0 / (2 * reach + 1) as f32;
    let mut rows = vec![0.0; cells.len()];
    for (out, row) in rows.chunks_exact_mut(width).zip(cells.chunks_exact(width)) {
        let at = |i: usize| row[i.min(width - 1)];
        let mut sum = (0..=reach).map(at).sum::<f32>() + reach as f32 * row[0];
        for (i, out) in out.iter_mut().enumerate() {
            *out = sum * share;
            sum += at(i + reach + 1) - row[i.saturating_sub(reach)];
        }
    }
    // All columns at once, row by row.
    let at = |i: usize| &rows[i.min(height - 1) * width..][..width];
    let mut sums: Vec<f32> = at(0).iter().map(|first| reach as f32 * first).collect();
    for row in 0..=reach {
        sums.iter_mut().zip(at(row)).for_each(|(sum, cell)| *sum += cell);
    }
    let mut out = vec![0.0; cells.len()];
    for (row, out) in out.chunks_exact_mut(width).enumerate() {
        let (next, last) = (at(row + reach + 1), at(row.saturating_sub(reach)));
        for (((out, sum), next), last) in out.iter_mut().zip(&mut sums).zip(next).zip(last) {
            *out = *sum * share;
            *sum += next - last;
        }
    }
    out
}
