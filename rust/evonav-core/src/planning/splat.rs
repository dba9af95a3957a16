//! A view's points spread over a block of voxels.

use crate::{
    geometry::Vec2,
    grid::GridSpec,
    planning::bev::{BevConfig, DepthView},
};

/// What a column of voxels holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Column(u8);

const EXPLORED: u8 = 1;
const OBSTACLE: u8 = 2;
const FLOOR: u8 = 4;
const BELOW: u8 = 8;

impl Column {
    /// Something between the lowest obstacle and the camera, or a hole in the floor.
    pub fn is_obstacle(self) -> bool {
        self.0 & OBSTACLE != 0 || self.0 & (FLOOR | BELOW) == BELOW
    }
}

/// A point in units of voxels: column, row and height over the block's lowest corner.
#[derive(Debug, Clone, Copy)]
struct Point {
    at: [f32; 3],
    category: i32,
}

/// Voxels around the field of view, aligned with the map; scratch memory that is kept.
#[derive(Debug, Clone, Default)]
pub struct Block {
    /// `[row, col]` of the map that voxel (0, 0) lies in; may be negative.
    first: [i64; 2],
    /// Cells along a side, and voxels over each other.
    side: usize,
    levels: usize,
    /// Points per voxel; all 0 between two calls.
    weights: Vec<f32>,
    /// Voxels that are not 0.
    touched: Vec<u32>,
    columns: Vec<Column>,
    counts: Vec<u32>,
    points: Vec<Point>,
    /// First level of floor and obstacles, and the level after the last obstacle.
    levels_of: [usize; 3],
}

impl Block {
    /// Takes a view's points, and tells what each column of voxels holds.
    pub fn fill(&mut self, view: &DepthView<'_>, spec: &GridSpec, config: &BevConfig) {
        self.place(view, spec, config);
        self.collect(view, spec, config);
        let points = std::mem::take(&mut self.points);
        points.iter().for_each(|point| self.spread(point));
        self.points = points;
        self.columns.clear();
        self.columns.resize(self.side * self.side, Column(0));
        let [floor, obstacle, above] = self.levels_of;
        for index in self.touched.drain(..) {
            let weight = std::mem::take(&mut self.weights[index as usize]);
            if weight < 0.5 {
                continue;
            }
            let level = index as usize % self.levels;
            let kind = match level {
                l if l < floor => BELOW,
                l if l < obstacle => FLOOR,
                l if l < above => OBSTACLE,
                _ => 0,
            };
            self.columns[index as usize / self.levels].0 |= EXPLORED | kind;
        }
    }

    /// Columns that hold a point, with their cells of the map.
    pub fn cells<'a>(
        &'a self,
        spec: &'a GridSpec,
    ) -> impl Iterator<Item = ([usize; 2], Column)> + 'a {
        let seen = self.columns.iter().enumerate().filter(|(_, column)| column.0 != 0);
        seen.filter_map(|(index, column)| Some((self.cell(index, spec)?, *column)))
    }

    /// Categories of the points, each once, ascending.
    pub fn categories(&self) -> Vec<usize> {
        let mut found: Vec<usize> =
            self.points.iter().filter_map(|point| usize::try_from(point.category).ok()).collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Points of a category among the obstacles of each cell.
    pub fn count_category(&mut self, category: usize, spec: &GridSpec) -> Vec<([usize; 2], u32)> {
        let points = std::mem::take(&mut self.points);
        let of_category = points.iter().filter(|p| usize::try_from(p.category) == Ok(category));
        of_category.for_each(|point| self.spread(point));
        self.points = points;
        self.counts.clear();
        self.counts.resize(self.side * self.side, 0);
        let [_, obstacle, above] = self.levels_of;
        for index in self.touched.drain(..) {
            let weight = std::mem::take(&mut self.weights[index as usize]);
            if (obstacle..above).contains(&(index as usize % self.levels)) {
                self.counts[index as usize / self.levels] += weight.round() as u32;
            }
        }
        let counted = self.counts.iter().enumerate().filter(|(_, count)| **count > 0);
        counted.filter_map(|(index, count)| Some((self.cell(index, spec)?, *count))).collect()
    }

    fn cell(&self, index: usize, spec: &GridSpec) -> Option<[usize; 2]> {
        let row = usize::try_from(self.first[0] + (index / self.side) as i64).ok()?;
        let col = usize::try_from(self.first[1] + (index % self.side) as i64).ok()?;
        (row < spec.rows && col < spec.cols).then_some([row, col])
    }

    /// Lays the voxels around the block before the camera, whichever way it is turned.
    fn place(&mut self, view: &DepthView<'_>, spec: &GridSpec, config: &BevConfig) {
        let cell_m = config.cell_m;
        let [camera_x, _, camera_z] = view.camera.position_m;
        let (sin, cos) = view.camera.yaw_rad.sin_cos();
        let half_m = 0.5 * config.block_m;
        let mut low_m = [f64::INFINITY; 2];
        for [ahead, right] in
            [[0.0, -half_m], [0.0, half_m], [config.block_m, -half_m], [config.block_m, half_m]]
        {
            let corner =
                [camera_x + ahead * sin + right * cos, camera_z + ahead * cos - right * sin];
            low_m = [0, 1].map(|i| low_m[i].min(corner[i]));
        }
        let first = [1, 0].map(|i: usize| ((low_m[i] - spec.corner_m[i]) / cell_m).floor() - 2.0);
        self.first = first.map(|v| v as i64);
        // The block's diagonal, and a rim for what spreads.
        let side = (2.0_f64.sqrt() * config.block_m / cell_m).ceil() as usize + 6;
        let levels = ((config.heights_m[1] - config.heights_m[0]) / cell_m).round() as usize + 2;
        let level =
            |height_m: f64| ((height_m - config.heights_m[0]) / cell_m + 1e-6).max(0.0) as usize;
        let top_m = view.camera.position_m[1] + config.obstacle_above_camera_m;
        self.levels_of =
            [level(-config.obstacle_min_m), level(config.obstacle_min_m), level(top_m)];
        if self.side != side || self.levels != levels {
            (self.side, self.levels) = (side, levels);
            self.weights = vec![0.0; side * side * levels];
        }
    }

    /// The points of every `stride_px`-th pixel that lie in the block before the camera.
    fn collect(&mut self, view: &DepthView<'_>, spec: &GridSpec, config: &BevConfig) {
        let camera = &view.camera;
        let [camera_x, camera_y, camera_z] = camera.position_m;
        let (sin, cos) = camera.yaw_rad.sin_cos();
        let per_m = 1.0 / config.cell_m;
        let origin = [
            spec.corner_m[0] * per_m + self.first[1] as f64,
            config.heights_m[0] * per_m,
            spec.corner_m[1] * per_m + self.first[0] as f64,
        ];
        let start = config.stride_px / 2;
        self.points.clear();
        // Rays are affine in the pixel.
        let corner = camera.ray([0.5, 0.5]);
        let (next_col, next_row) = (camera.ray([1.5, 0.5]), camera.ray([0.5, 1.5]));
        let right: [f64; 3] = std::array::from_fn(|i| next_col[i] - corner[i]);
        let down: [f64; 3] = std::array::from_fn(|i| next_row[i] - corner[i]);
        for row in (start..camera.height_px).step_by(config.stride_px) {
            for col in (start..camera.width_px).step_by(config.stride_px) {
                let index = row * camera.width_px + col;
                let depth_m = f64::from(view.depth_m[index]);
                if !(depth_m > 0.0 && depth_m <= config.max_depth_m) {
                    continue;
                }
                let offset: [f64; 3] = std::array::from_fn(|i| {
                    depth_m * (corner[i] + col as f64 * right[i] + row as f64 * down[i])
                });
                let place: Vec2 =
                    [offset[0] * sin + offset[2] * cos, offset[0] * cos - offset[2] * sin];
                let height_m = camera_y + offset[1];
                let is_inside = (0.0..config.block_m).contains(&place[0])
                    && place[1].abs() < 0.5 * config.block_m
                    && (config.heights_m[0]..config.heights_m[1]).contains(&height_m);
                if is_inside {
                    let at = [
                        (camera_x + offset[0]) * per_m - origin[0] - 0.5,
                        height_m * per_m - origin[1],
                        (camera_z + offset[2]) * per_m - origin[2] - 0.5,
                    ];
                    let category = view.categories.map_or(-1, |categories| categories[index]);
                    self.points.push(Point { at: at.map(|v| v as f32), category });
                }
            }
        }
    }

    /// Adds one point to the eight voxels around it, by its nearness to their centres.
    fn spread(&mut self, point: &Point) {
        let low = point.at.map(f32::floor);
        let share: [f32; 3] = std::array::from_fn(|i| point.at[i] - low[i]);
        let [col, level, row] = low.map(|v| v.max(0.0) as usize);
        for (d_row, row_share) in [(0, 1.0 - share[2]), (1, share[2])] {
            for (d_col, col_share) in [(0, 1.0 - share[0]), (1, share[0])] {
                let column = (row + d_row) * self.side + col + d_col;
                for (d_level, level_share) in [(0, 1.0 - share[1]), (1, share[1])] {
                    let weight = row_share * col_share * level_share;
                    let index = column * self.levels + level + d_level;
                    let Some(voxel) = self.weights.get_mut(index) else { continue };
                    if weight > 0.0 {
                        if *voxel == 0.0 {
                            self.touched.push(index as u32);
                        }
                        *voxel += weight;
                    }
                }
            }
        }
    }
}
