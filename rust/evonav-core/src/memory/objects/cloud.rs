//! An object's point cloud, indexed so that new points are matched and merged without a rebuild.

use std::ops::Range;

use crate::{
    geometry::Aabb,
    memory::objects::{
        dbscan::distance2,
        voxels::{Blocks, Voxel, VoxelSet, place, voxel_of},
    },
    sensors::unproject::Point,
};

/// Points in order of arrival, at most one per voxel, and a table to find points near a place.
#[derive(Debug, Clone)]
pub struct Cloud {
    points: Vec<Point>,
    bounds_m: Aabb,
    inverse_edge: f64,
    voxels: VoxelSet,
    radius_m: f32,
    /// First point of each cell with edge `radius_m`; `next` leads to the others.
    cells: Blocks<[u32; 64]>,
    next: Vec<u32>,
}

const END: u32 = u32::MAX;

impl Cloud {
    /// Create a cloud from the first point of each voxel.
    ///
    /// # Arguments
    /// * `voxel_m` - edge length of a voxel.
    /// * `radius_m` - radius within which [`Cloud::overlap`] looks for points.
    pub fn new(points: &[Point], voxel_m: f64, radius_m: f32) -> Self {
        let mut cloud = Self {
            points: Vec::with_capacity(points.len()),
            bounds_m: Aabb::EMPTY,
            inverse_edge: 1.0 / voxel_m,
            voxels: VoxelSet::with_capacity(points.len() / 8),
            radius_m,
            cells: Blocks::with_capacity(points.len() / 64),
            next: Vec::with_capacity(points.len()),
        };
        cloud.merge(points);
        cloud
    }

    /// Return the points, `[x, y, z]`.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Return the smallest box around the points.
    pub fn bounds_m(&self) -> &Aabb {
        &self.bounds_m
    }

    /// Return the number of bytes of the points and of the tables that find them.
    pub(crate) fn num_bytes(&self) -> usize {
        size_of::<Self>()
            + self.points.capacity() * size_of::<Point>()
            + self.next.capacity() * size_of::<u32>()
            + self.voxels.num_heap_bytes()
            + self.cells.num_heap_bytes()
    }

    /// Add the points that fall into voxels without a point.
    pub fn merge(&mut self, points: &[Point]) {
        let inverse_radius = 1.0 / f64::from(self.radius_m);
        for &point in points {
            let index = self.points.len() as u32;
            if !self.voxels.insert(voxel_of(point, self.inverse_edge)) {
                continue;
            }
            let (firsts, place) = self.cells.entry(voxel_of(point, inverse_radius), [END; 64]);
            self.next.push(std::mem::replace(&mut firsts[place], index));
            self.points.push(point);
            self.bounds_m = self.bounds_m.extended(point.map(f64::from));
        }
    }

    /// Return the share of `points` with a point of this cloud nearer than the radius, 0 if there
    /// are no points.
    ///
    /// # Complexity
    /// At most 27 cells per point; the boxes are compared first.
    pub fn overlap(&self, points: &[Point]) -> f64 {
        let mut finder = Finder::new(self);
        let num = points.iter().filter(|&&point| finder.has_near(point)).count();
        num as f64 / points.len().max(1) as f64
    }

    /// Return whether [`Cloud::overlap`] is `enough`, looking at no more points than necessary. If
    /// an overlap is enough, every larger one must be enough too.
    pub(crate) fn overlaps(&self, points: &[Point], enough: impl Fn(f64) -> bool) -> bool {
        let share = |num: usize| num as f64 / points.len().max(1) as f64;
        let mut finder = Finder::new(self);
        let mut num = 0;
        for (index, &point) in points.iter().enumerate() {
            num += usize::from(finder.has_near(point));
            if enough(share(num)) {
                return true;
            }
            if !enough(share(num + points.len() - index - 1)) {
                return false;
            }
        }
        enough(share(num))
    }

    /// Return whether one of a cell's points is nearer to a point than the radius.
    fn has_near(&self, first: u32, point: Point) -> bool {
        let mut index = first;
        while index != END {
            if distance2(self.points[index as usize], point) < self.radius_m * self.radius_m {
                return true;
            }
            index = self.next[index as usize];
        }
        false
    }
}

/// A search for a cloud's points near a sequence of neighbouring points.
struct Finder<'a> {
    cloud: &'a Cloud,
    /// Bounds grown by the radius.
    reach_m: Aabb,
    inverse_radius: f64,
    /// Cell of the last point, and the first of the cloud's points there.
    last: (Voxel, u32),
    /// Cell for which `beside` was filled.
    known: Voxel,
    /// Cells with points around it: their offset, and their first point.
    beside: Vec<(Voxel, u32)>,
}

impl<'a> Finder<'a> {
    fn new(cloud: &'a Cloud) -> Self {
        let (mut reach_m, radius) = (cloud.bounds_m, f64::from(cloud.radius_m));
        reach_m.min_m = reach_m.min_m.map(|v| v - radius);
        reach_m.max_m = reach_m.max_m.map(|v| v + radius);
        let nowhere = [i32::MAX; 3];
        let (inverse_radius, last) = (1.0 / radius, (nowhere, END));
        Self { cloud, reach_m, inverse_radius, last, known: nowhere, beside: Vec::new() }
    }

    /// Return whether a point of the cloud is nearer than the radius.
    fn has_near(&mut self, point: Point) -> bool {
        let is_far = |i: usize| {
            let value = f64::from(point[i]);
            value < self.reach_m.min_m[i] || value > self.reach_m.max_m[i]
        };
        if (0..3).any(is_far) {
            return false;
        }
        let cell = voxel_of(point, self.inverse_radius);
        if cell != self.last.0 {
            let firsts = self.cloud.cells.get(cell);
            self.last = (cell, firsts.map_or(END, |firsts| firsts[place(cell)]));
        }
        // The point's own cell comes first: it nearly always decides.
        if self.cloud.has_near(self.last.1, point) {
            return true;
        }
        if cell != self.known {
            self.look_beside(cell);
        }
        // The point's position in its cell bounds the distance to the neighbouring cells.
        let inside =
            [0, 1, 2].map(|i| f64::from(point[i]) * self.inverse_radius - f64::from(cell[i]));
        self.beside.iter().any(|&(step, first)| {
            let gap2: f64 = (0..3)
                .map(|i| match step[i] {
                    -1 => inside[i] * inside[i],
                    1 => (1.0 - inside[i]) * (1.0 - inside[i]),
                    _ => 0.0,
                })
                .sum();
            gap2 < 1.0001 && self.cloud.has_near(first, point)
        })
    }

    /// Find the points in the cells around a cell, block by block.
    fn look_beside(&mut self, cell: Voxel) {
        self.known = cell;
        self.beside.clear();
        let moved = |step: Voxel| [0, 1, 2].map(|i| cell[i].saturating_add(step[i]));
        for xs in within_blocks(cell[0]) {
            for ys in within_blocks(cell[1]) {
                for zs in within_blocks(cell[2]) {
                    let corner = moved([xs.start, ys.start, zs.start]);
                    let Some(firsts) = self.cloud.cells.get(corner) else { continue };
                    for x in xs.clone() {
                        for y in ys.clone() {
                            for z in zs.clone() {
                                let first = firsts[place(moved([x, y, z]))];
                                if first != END && [x, y, z] != [0; 3] {
                                    self.beside.push(([x, y, z], first));
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Return the steps -1, 0 and 1 from a coordinate, split where a block ends.
fn within_blocks(coordinate: i32) -> impl Iterator<Item = Range<i32>> {
    let end = match coordinate & 3 {
        0 => 0,
        3 => 1,
        _ => 2,
    };
    [-1..end, end..2].into_iter().filter(|steps| !steps.is_empty())
}
