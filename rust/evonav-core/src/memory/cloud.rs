//! An object's point cloud, kept so that new points are matched and merged without a rebuild.

use crate::{
    geometry::Aabb,
    memory::{
        dbscan::distance2,
        voxels::{VoxelSet, VoxelTable, voxel_of},
    },
    sensors::unproject::Point,
};

/// At most one point a voxel, in the order in which they came, and a table to find points near a place.
#[derive(Debug, Clone)]
pub struct Cloud {
    points: Vec<Point>,
    bounds_m: Aabb,
    inverse_edge: f64,
    voxels: VoxelSet,
    radius_m: f32,
    /// First point of each cell of edge `radius_m`; `next` leads to the others.
    cells: VoxelTable,
    next: Vec<u32>,
}

const END: u32 = u32::MAX;

impl Cloud {
    /// A cloud of the first point of each voxel.
    ///
    /// # Arguments
    /// * `voxel_m` - edge of a voxel.
    /// * `radius_m` - within which [`Cloud::overlap`] looks.
    pub fn new(points: &[Point], voxel_m: f64, radius_m: f32) -> Self {
        let mut cloud = Self {
            points: Vec::with_capacity(points.len()),
            bounds_m: Aabb::EMPTY,
            inverse_edge: 1.0 / voxel_m,
            voxels: VoxelSet::with_capacity(points.len() / 8),
            radius_m,
            cells: VoxelTable::with_capacity(points.len() / 4),
            next: Vec::with_capacity(points.len()),
        };
        cloud.merge(points);
        cloud
    }

    /// The points, `[x, y, z]`.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Smallest box around the points.
    pub fn bounds_m(&self) -> &Aabb {
        &self.bounds_m
    }

    /// Adds the points that fall into voxels without one.
    pub fn merge(&mut self, points: &[Point]) {
        let inverse_radius = 1.0 / f64::from(self.radius_m);
        for &point in points {
            let index = self.points.len() as u32;
            if !self.voxels.insert(voxel_of(point, self.inverse_edge)) {
                continue;
            }
            let (first, is_new) = self.cells.entry(voxel_of(point, inverse_radius), index);
            self.next.push(if is_new { END } else { std::mem::replace(first, index) });
            self.points.push(point);
            self.bounds_m = self.bounds_m.extended(point.map(f64::from));
        }
    }

    /// Part of `points` with a point of this cloud nearer than the radius, 0 for no points.
    ///
    /// # Complexity
    /// At most 27 cells a point; the boxes are compared first.
    pub fn overlap(&self, points: &[Point]) -> f64 {
        let num = points.iter().filter(|&&point| self.has_near(point)).count();
        num as f64 / points.len().max(1) as f64
    }

    /// Whether [`Cloud::overlap`] is `enough`, which every larger overlap must be, too; looks at no more points than it takes.
    pub(crate) fn overlaps(&self, points: &[Point], enough: impl Fn(f64) -> bool) -> bool {
        let share = |num: usize| num as f64 / points.len().max(1) as f64;
        let mut num = 0;
        for (index, &point) in points.iter().enumerate() {
            num += usize::from(self.has_near(point));
            if enough(share(num)) {
                return true;
            }
            if !enough(share(num + points.len() - index - 1)) {
                return false;
            }
        }
        enough(share(num))
    }

    fn has_near(&self, point: Point) -> bool {
        let (low, high) = (self.bounds_m.min_m, self.bounds_m.max_m);
        let radius = f64::from(self.radius_m);
        let is_far = |i: usize| {
            let value = f64::from(point[i]);
            value < low[i] - radius || value > high[i] + radius
        };
        if (0..3).any(is_far) {
            return false;
        }
        let inverse_radius = 1.0 / radius;
        let cell = voxel_of(point, inverse_radius);
        // The point's own cell first: nearly always it decides.
        if self.cell_has_near(cell, point) {
            return true;
        }
        // Where the point lies in its cell says how near the next ones are.
        let inside = [0, 1, 2].map(|i| f64::from(point[i]) * inverse_radius - f64::from(cell[i]));
        for x in -1..=1 {
            for y in -1..=1 {
                for z in -1..=1 {
                    let step = [x, y, z];
                    let gap2: f64 = (0..3)
                        .map(|i| match step[i] {
                            -1 => inside[i] * inside[i],
                            1 => (1.0 - inside[i]) * (1.0 - inside[i]),
                            _ => 0.0,
                        })
                        .sum();
                    let beside = [0, 1, 2].map(|i| cell[i].saturating_add(step[i]));
                    if gap2 < 1.0001 && step != [0; 3] && self.cell_has_near(beside, point) {
                        return true;
                    }
                }
            }
        }
        false
    }

    fn cell_has_near(&self, cell: [i32; 3], point: Point) -> bool {
        let mut index = self.cells.get(cell).unwrap_or(END);
        while index != END {
            if distance2(self.points[index as usize], point) < self.radius_m * self.radius_m {
                return true;
            }
            index = self.next[index as usize];
        }
        false
    }
}
