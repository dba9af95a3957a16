//! Sunlight: a map of what the sun sees first, and lookups in it.
//!
//! The map is drawn tile by tile, when a tile is first looked at: most views see a room or two.

use std::{ops::Range, sync::OnceLock};

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
    world::mesh::{Face, PartMesh, SceneMesh, dot},
};

/// Width of a cell of the map, unless the house is large.
const CELL_M: f64 = 0.016;
const MAX_SIDE_PX: f64 = 1200.0;
/// Distance by which a surface must be behind what the sun sees to be in its shadow.
const BIAS_M: f32 = 0.012;
/// Cells along the side of a tile, whole blocks of them.
const SIDE: usize = 64;
/// Rows and columns of a tile as it is kept, with a row before and after it and a block on each
/// side: lookups need the neighbours of a cell.
const ROWS: usize = SIDE + 2;
const COLUMNS: usize = SIDE + 2 * LANES;

/// Number of parts after whose drawing the next ones are checked: they may all be hidden.
const LOOKED_AT: usize = 4;
/// Cosine between a face's normal and the sun below which its nearness may be rounded by more than
/// [`ROUNDING_M`].
const STEEP: f64 = 2e-3;
const ROUNDING_M: f32 = 1e-3;

/// Nearness of the first far side of a solid, row by row.
type Tile = Box<[f32]>;

/// Parallel light from one direction, and the depth at which it ends.
#[derive(Debug)]
pub(in crate::sensors::raster) struct Sun {
    /// Direction towards the sun.
    pub towards: [f32; 3],
    /// Cells `[across, down]` and nearness of a world point: `map . [x, y, z, 1]`.
    map: [[f32; 4]; 3],
    size: [i32; 2],
    view: View,
    /// Nearest first.
    casters: Vec<Caster>,
    tiles_across: usize,
    tiles: Vec<OnceLock<Tile>>,
}

/// A part that casts a shadow.
#[derive(Debug)]
struct Caster {
    part: u32,
    /// Bound of the nearness of what is drawn of it.
    nearest: f32,
    /// The cells `[across, down]` that it may cover.
    cells: [Range<u32>; 2],
}

impl Sun {
    /// Look down on the house from the sun; nothing is drawn yet.
    pub fn new(towards: Vec3, mesh: &SceneMesh, bounds: &Aabb) -> Self {
        let view = view_from(towards, bounds);
        let map = Lens::new(&view).map_rows();
        let size = [view.camera.width_px, view.camera.height_px];
        let casts = |part: &&PartMesh| {
            let material = mesh.skins[part.faces.start].material;
            !part.is_pane && material.kind != MaterialKind::Outdoors
        };
        let parts = (0..).zip(&mesh.parts).filter(|(_, part)| casts(part));
        let mut casters: Vec<_> =
            parts.map(|(index, part)| Caster::of(index, part, mesh, towards, &map)).collect();
        casters.sort_unstable_by(|a, b| b.nearest.total_cmp(&a.nearest));
        let [tiles_across, tiles_down] = size.map(|cells| cells.div_ceil(SIDE));
        Self {
            towards: towards.map(|x| x as f32),
            map,
            size: size.map(|cells| cells as i32),
            view,
            casters,
            tiles_across,
            tiles: vec![OnceLock::new(); tiles_across * tiles_down],
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
    ///
    /// # Arguments
    /// * `mesh` - the one that casts the shadows; its looks do not matter.
    #[inline(always)]
    pub fn meets(&self, mesh: &SceneMesh, points_m: &[[f32; LANES]; 3]) -> [bool; LANES] {
        let [width, height] = self.size;
        let [u, v, own] = self.cells(points_m);
        std::array::from_fn(|lane| {
            let column = u[lane].clamp(0.0, (width - 1) as f32) as usize;
            let row = v[lane].clamp(0.0, (height - 1) as f32) as usize;
            own[lane] + BIAS_M >= self.tile(mesh, column, row)[place(column, row)]
        })
    }

    /// Return the share of the sun, 0 to 1, that reaches each point; arguments as of
    /// [`Self::meets`].
    #[inline(always)]
    pub fn reaches(&self, mesh: &SceneMesh, points_m: &[[f32; LANES]; 3]) -> [f32; LANES] {
        let [u, v, own] = self.cells(points_m);
        let mut reach = [0.0; LANES];
        for lane in 0..LANES {
            reach[lane] = self.share(mesh, u[lane] - 0.5, v[lane] - 0.5, own[lane] + BIAS_M);
        }
        reach
    }

    /// Compare with the nine cells around a point; return the mean of the answers over a square of
    /// two cells around it.
    #[inline(always)]
    fn share(&self, mesh: &SceneMesh, u: f32, v: f32, own: f32) -> f32 {
        let [width, height] = self.size;
        let (u, v) = (u.clamp(1.0, (width - 3) as f32), v.clamp(1.0, (height - 3) as f32));
        // The nearest cell, and the place in it.
        let (column, row) = ((u + 0.5) as usize, (v + 0.5) as usize);
        let (right, down) = (u + 0.5 - column as f32, v + 0.5 - row as f32);
        let first = place(column, row) - COLUMNS - 1;
        let near = &self.tile(mesh, column, row)[first..first + 2 * COLUMNS + 3];
        let line = |row: usize| -> f32 {
            let seen = |i: usize| f32::from(u8::from(own >= near[row * COLUMNS + i]));
            0.5 * ((1.0 - right) * seen(0) + seen(1) + right * seen(2))
        };
        0.5 * ((1.0 - down) * line(0) + line(1) + down * line(2))
    }

    /// Return the tile with a cell and its neighbours.
    #[inline(always)]
    fn tile(&self, mesh: &SceneMesh, column: usize, row: usize) -> &[f32] {
        let index = row / SIDE * self.tiles_across + column / SIDE;
        match self.tiles[index].get() {
            Some(tile) => tile,
            None => self.drawn(mesh, index),
        }
    }

    #[cold]
    fn drawn(&self, mesh: &SceneMesh, index: usize) -> &[f32] {
        self.tiles[index].get_or_init(|| self.draw(mesh, index))
    }

    /// Draw a tile.
    ///
    /// The far sides of solids are drawn rather than the near ones: then a lit surface never
    /// shadows itself, and ceilings, which have a lower side only, hold the light off. Panes let
    /// it through.
    fn draw(&self, mesh: &SceneMesh, index: usize) -> Tile {
        let lens = Lens::new(&self.view);
        let size @ [width, height] = self.size.map(|cells| cells as usize);
        let [left, top] = [index % self.tiles_across, index / self.tiles_across].map(|i| i * SIDE);
        let rows = top.saturating_sub(1)..(top + SIDE + 1).min(height);
        let blocks = (left / LANES).saturating_sub(1)
            ..(left / LANES + SIDE / LANES + 1).min(width.div_ceil(LANES));
        let columns = blocks.start * LANES..blocks.end * LANES;
        let (mut canvas, mut scratch) = (Canvas::default(), Scratch::default());
        canvas.clear_window(size, 0.0, rows.clone(), blocks);
        let mut least = 0.0;
        let casters = self.casters.iter().filter(|caster| caster.may_cover(&columns, &rows));
        for (number, caster) in casters.enumerate() {
            if caster.nearest < least {
                break;
            }
            let part = &mesh.parts[caster.part as usize];
            lens.transform(&mesh.vertices_m[part.vertices.clone()], &mut scratch);
            for face in &mesh.faces[part.faces.clone()] {
                let Some((plane, _)) = lens.nearness_plane(&face.reversed()) else { continue };
                let corners = mesh.corners_of(face).iter().rev();
                scratch.polygon_px.clear();
                scratch.polygon_px.extend(corners.map(|&i| scratch.projected_px[i as usize]));
                canvas.fill(&scratch.polygon_px, plane);
            }
            if number % LOOKED_AT == LOOKED_AT - 1 {
                least = least_of(&canvas.nearness);
            }
        }
        let mut tile = vec![0.0; ROWS * COLUMNS];
        let drawn = canvas.nearness.as_flattened().chunks_exact(columns.len());
        for (row, drawn) in rows.zip(drawn) {
            let first = (row + 1 - top) * COLUMNS + columns.start + LANES - left;
            tile[first..first + columns.len()].copy_from_slice(drawn);
        }
        tile.into()
    }
}

impl Caster {
    fn of(
        index: u32,
        part: &PartMesh,
        mesh: &SceneMesh,
        towards: Vec3,
        map: &[[f32; 4]; 3],
    ) -> Self {
        let [across, down, near] = map.map(|row| extent(row, &part.aabb));
        // The nearness of a face that is seen from the side is rounded by more.
        let is_steep = |face: &Face| dot(face.normal, towards).abs() < STEEP;
        let nearest = match mesh.faces[part.faces.clone()].iter().any(is_steep) {
            true => f32::INFINITY,
            false => near[1] as f32 + ROUNDING_M,
        };
        // One cell more on each side, for rounding. Conversions of numbers below 0 give 0.
        let cells = [across, down].map(|[low, high]| (low - 1.0) as u32..(high + 2.0) as u32);
        Self { part: index, nearest, cells }
    }

    fn may_cover(&self, columns: &Range<usize>, rows: &Range<usize>) -> bool {
        let meets = |own: &Range<u32>, other: &Range<usize>| {
            (own.start as usize) < other.end && other.start < own.end as usize
        };
        meets(&self.cells[0], columns) && meets(&self.cells[1], rows)
    }
}

/// Return the index in its tile of a cell.
#[inline(always)]
fn place(column: usize, row: usize) -> usize {
    (row % SIDE + 1) * COLUMNS + column % SIDE + LANES
}

/// Return the least and the greatest value of `row . [x, y, z, 1]` in a box.
fn extent(row: [f32; 4], aabb: &Aabb) -> [f64; 2] {
    let [x, y, z, offset] = row.map(f64::from);
    let middle = dot([x, y, z], aabb.centre_m()) + offset;
    let reach = 0.5 * dot([x, y, z].map(f64::abs), aabb.size_m());
    [middle - reach, middle + reach]
}

/// Return the least of some numbers of 0 or more.
fn least_of(blocks: &[[f32; LANES]]) -> f32 {
    let less = |a: f32, b: f32| if a < b { a } else { b };
    let least = blocks.iter().fold([f32::INFINITY; LANES], |least, block| {
        std::array::from_fn(|lane| less(block[lane], least[lane]))
    });
    least.into_iter().fold(f32::INFINITY, less)
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

#[cfg(test)]
mod tests {
    use crate::{
        assets::{Catalogue, UnknownAssets, material::MaterialKind},
        geometry::Aabb,
        house::House,
        sensors::raster::{
            canvas::Canvas,
            lens::{Lens, Scratch},
            light::sun::{COLUMNS, Sun, place},
        },
        world::{mesh::SceneMesh, scene::Scene},
    };

    /// Draw the whole map, part by part.
    fn map_naive(sun: &Sun, mesh: &SceneMesh) -> Canvas {
        let lens = Lens::new(&sun.view);
        let (mut canvas, mut scratch) = (Canvas::default(), Scratch::default());
        canvas.clear(sun.size[0] as usize, sun.size[1] as usize, 0.0, false);
        for part in &mesh.parts {
            lens.transform(&mesh.vertices_m[part.vertices.clone()], &mut scratch);
            let kind = mesh.skins[part.faces.start].material.kind;
            if part.is_pane || kind == MaterialKind::Outdoors {
                continue;
            }
            for face in &mesh.faces[part.faces.clone()] {
                let Some((plane, _)) = lens.nearness_plane(&face.reversed()) else { continue };
                let corners = mesh.corners_of(face).iter().rev();
                let corners: Vec<_> = corners.map(|&i| scratch.projected_px[i as usize]).collect();
                canvas.fill(&corners, plane);
            }
        }
        canvas
    }

    #[test]
    fn tiles_are_parts_of_a_map_that_is_drawn_as_a_whole() {
        let text = include_str!("../../../../tests/data/house_39_objects.json");
        let house = House::from_json("house", text).expect("a house");
        let scene =
            Scene::build(&house, Catalogue::bundled(), UnknownAssets::Error).expect("known");
        let mesh = SceneMesh::build(&scene);
        let bounds = mesh.parts.iter().fold(Aabb::EMPTY, |all, part| all.union(part.aabb));
        let level = [0.0, 0.4, 0.7, 1.0, 2.0, 4.5_f64].map(|yaw_rad| (yaw_rad, 0.669));
        // Along walls, and from high above: there is much on the floor that the sun sees.
        for (yaw_rad, height) in level.into_iter().chain([(0.3, 0.999), (0.0005, 0.2)]) {
            let flat = (1.0_f64 - height * height).sqrt();
            let sun =
                Sun::new([flat * yaw_rad.sin(), height, flat * yaw_rad.cos()], &mesh, &bounds);
            let whole = map_naive(&sun, &mesh);
            let [width, height] = sun.size.map(|cells| cells as usize);
            for row in 0..height {
                for (column, expected) in whole.row(row)[..width].iter().enumerate() {
                    let found = sun.tile(&mesh, column, row)[place(column, row)];
                    assert_eq!(found, *expected, "{column}, {row} of {width} x {height}");
                    let near = |number: usize, size: usize| number > 0 && number + 1 < size;
                    if near(column, width) && near(row, height) {
                        let beside = sun.tile(&mesh, column, row)[place(column, row) + COLUMNS + 1];
                        assert_eq!(beside, whole.row(row + 1)[column + 1]);
                        let before = sun.tile(&mesh, column, row)[place(column, row) - COLUMNS - 1];
                        assert_eq!(before, whole.row(row - 1)[column - 1]);
                    }
                }
            }
        }
    }
}
