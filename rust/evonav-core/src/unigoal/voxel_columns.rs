//! Distribute a view's points over the columns of a block of voxels.

use crate::{
    geometry::Vec2,
    grid::GridSpec,
    unigoal::{bev_config::BevConfig, depth_view::DepthView},
};

/// The weights of points in a column of voxels, by height; a point counts by its nearness to a
/// voxel's centre.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Column {
    below: f32,
    floor: f32,
    obstacle: f32,
    above: f32,
}

/// Weight from which a sum of points counts as a point.
const A_POINT: f32 = 0.5;

impl Column {
    /// Return whether the column has a point at any height.
    pub fn is_explored(self) -> bool {
        self.below + self.floor + self.obstacle + self.above >= A_POINT
    }

    /// Return whether the column has a point between the lowest obstacle and the camera, or a hole
    /// in the floor.
    pub fn is_obstacle(self) -> bool {
        let is_hole = self.below >= A_POINT && self.floor < A_POINT;
        self.obstacle >= A_POINT || is_hole
    }
}

/// The columns around the field of view, aligned with the map; the memory is reused.
///
/// Only sums over heights are needed, so voxels are not stored separately: a point adds to the four
/// columns around it, and there to the height ranges of the two levels around it.
#[derive(Debug, Clone, Default)]
pub struct Block {
    /// Cell `[row, col]` of the map on which column (0, 0) stands; may be negative.
    first: [i64; 2],
    /// Number of columns along an edge.
    side: usize,
    columns: Vec<Column>,
    points: Vec<Point>,
}

/// A point among the columns.
#[derive(Debug, Clone, Copy)]
struct Point {
    /// Position `[row, col]` relative to the first column's centre, in cells.
    at: [f32; 2],
    /// Shares of its weight below the floor, around the floor, above it, and above the camera.
    shares: [f32; 4],
    category: i32,
}

/// The first voxel levels of the floor, of obstacles, and above the obstacles.
#[derive(Debug, Clone, Copy)]
struct Levels {
    low_m: f64,
    per_m: f64,
    starts: [i64; 3],
}

impl Levels {
    /// Compute the levels; voxel centres are at whole multiples of a cell above the lowest height.
    fn new(config: &BevConfig, camera_height_m: f64) -> Self {
        let (low_m, per_m) = (config.heights_m[0], 1.0 / config.cell_m);
        let level = |height_m: f64| ((height_m - low_m) * per_m + 1e-6).floor() as i64;
        let top_m = camera_height_m + config.obstacle_above_camera_m;
        let starts = [level(-config.obstacle_min_m), level(config.obstacle_min_m), level(top_m)];
        Self { low_m, per_m, starts }
    }

    fn shares(&self, height_m: f64) -> [f32; 4] {
        let at = (height_m - self.low_m) * self.per_m;
        let low = at.floor();
        let high_share = (at - low) as f32;
        let [floor, obstacle, above] = self.starts;
        let kind = |level: i64| {
            usize::from(level >= floor)
                + usize::from(level >= obstacle)
                + usize::from(level >= above)
        };
        let mut shares = [0.0; 4];
        shares[kind(low as i64)] += 1.0 - high_share;
        shares[kind(low as i64 + 1)] += high_share;
        shares
    }
}

impl Block {
    /// Collect a view's points and add them to their columns.
    pub fn fill(&mut self, view: &DepthView<'_>, spec: &GridSpec, config: &BevConfig) {
        self.place(view, spec, config);
        self.collect(view, spec, config);
        self.columns.clear();
        self.columns.resize(self.side * self.side, Column::default());
        for point in &self.points {
            for (index, weight) in around(point.at, self.side) {
                let Some(column) = self.columns.get_mut(index) else { continue };
                column.below += weight * point.shares[0];
                column.floor += weight * point.shares[1];
                column.obstacle += weight * point.shares[2];
                column.above += weight * point.shares[3];
            }
        }
    }

    /// Return the columns on the map that are explored, with their cells.
    pub fn explored<'a>(
        &'a self,
        spec: &'a GridSpec,
    ) -> impl Iterator<Item = ([usize; 2], Column)> + 'a {
        let seen = self.columns.iter().enumerate().filter(|(_, column)| column.is_explored());
        seen.filter_map(|(index, column)| Some((self.cell(index, spec)?, *column)))
    }

    /// Return the categories of the points, each once, ascending.
    pub fn categories(&self) -> Vec<usize> {
        let mut found: Vec<usize> =
            self.points.iter().filter_map(|point| usize::try_from(point.category).ok()).collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Count the points of a category among the obstacles of each cell, rounded.
    pub fn count_category(&self, category: usize, spec: &GridSpec) -> Vec<([usize; 2], u32)> {
        let mut counts = vec![0.0_f32; self.columns.len()];
        for point in &self.points {
            if usize::try_from(point.category) == Ok(category) && point.shares[2] > 0.0 {
                for (index, weight) in around(point.at, self.side) {
                    if let Some(count) = counts.get_mut(index) {
                        *count += weight * point.shares[2];
                    }
                }
            }
        }
        let counted = counts.into_iter().enumerate().filter(|(_, count)| *count >= A_POINT);
        counted
            .filter_map(|(index, count)| Some((self.cell(index, spec)?, count.round() as u32)))
            .collect()
    }

    fn cell(&self, index: usize, spec: &GridSpec) -> Option<[usize; 2]> {
        let row = usize::try_from(self.first[0] + (index / self.side) as i64).ok()?;
        let col = usize::try_from(self.first[1] + (index % self.side) as i64).ok()?;
        (row < spec.rows && col < spec.cols).then_some([row, col])
    }

    /// Place the columns around the block in front of the camera, whatever its heading.
    fn place(&mut self, view: &DepthView<'_>, spec: &GridSpec, config: &BevConfig) {
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
        self.first = [1, 0].map(|axis: usize| {
            ((low_m[axis] - spec.corner_m[axis]) / config.cell_m).floor() as i64 - 2
        });
        // The block's diagonal, and a margin for points that are distributed.
        self.side = (2.0_f64.sqrt() * config.block_m / config.cell_m).ceil() as usize + 6;
    }

    /// Collect the points of every `stride_px`-th pixel that lie in the block in front of the
    /// camera.
    fn collect(&mut self, view: &DepthView<'_>, spec: &GridSpec, config: &BevConfig) {
        let camera = &view.camera;
        let [camera_x, camera_y, camera_z] = camera.position_m;
        let (sin, cos) = camera.yaw_rad.sin_cos();
        let levels = Levels::new(config, camera_y);
        let per_m = 1.0 / config.cell_m;
        // The position of the camera among the columns; a column's centre is a whole number.
        let origin = [
            (camera_z - spec.corner_m[1]) * per_m - self.first[0] as f64 - 0.5,
            (camera_x - spec.corner_m[0]) * per_m - self.first[1] as f64 - 0.5,
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
                let [x, y, z] = std::array::from_fn(|i| {
                    depth_m * (corner[i] + col as f64 * right[i] + row as f64 * down[i])
                });
                let [ahead_m, right_m]: Vec2 = [x * sin + z * cos, x * cos - z * sin];
                let height_m = camera_y + y;
                let is_inside = (0.0..config.block_m).contains(&ahead_m)
                    && right_m.abs() < 0.5 * config.block_m
                    && (config.heights_m[0]..config.heights_m[1]).contains(&height_m);
                if is_inside {
                    let at = [origin[0] + z * per_m, origin[1] + x * per_m].map(|v| v as f32);
                    let category = view.categories.map_or(-1, |categories| categories[index]);
                    self.points.push(Point { at, shares: levels.shares(height_m), category });
                }
            }
        }
    }
}

/// Return the four columns around a point and its nearness to each.
fn around(at: [f32; 2], side: usize) -> [(usize, f32); 4] {
    let low = at.map(f32::floor);
    let [row_share, col_share] = [at[0] - low[0], at[1] - low[1]];
    let first = low[0].max(0.0) as usize * side + low[1].max(0.0) as usize;
    [
        (first, (1.0 - row_share) * (1.0 - col_share)),
        (first + 1, (1.0 - row_share) * col_share),
        (first + side, row_share * (1.0 - col_share)),
        (first + side + 1, row_share * col_share),
    ]
}
