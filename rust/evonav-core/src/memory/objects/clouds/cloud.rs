//! An object's point cloud, indexed so that new points are matched and merged without a rebuild.

use std::ops::Range;

use crate::{
    geometry::Aabb,
    grid::bits::ones,
    memory::objects::clouds::{
        blocks::{Blocks, bits_between, block_at, block_of, cube_of, place},
        dbscan::distance2,
        point_blocks::{END, PointBlocks, chain},
        voxels::{HALF, Voxel, VoxelTable, clamped, floor},
    },
    sensors::unproject::Point,
};

/// Points in order of arrival, at most one per voxel, and what finds the points near a place.
#[derive(Debug, Clone)]
pub struct Cloud {
    points: Vec<Point>,
    bounds_m: Aabb,
    inverse_edge: f64,
    radius_m: f32,
    /// Index in `cubes` of each cube of 4 x 4 x 4 blocks with points.
    index: VoxelTable,
    cubes: Vec<Cube>,
    /// The next point in the same block of each point, which is older.
    next: Vec<u32>,
    /// Number of points, the first ones, that are known to be one cluster.
    num_old: usize,
}

/// The blocks of a cube, by their [`place`].
#[derive(Debug, Clone)]
struct Cube {
    voxel: Voxel,
    /// The blocks with points.
    blocks: u64,
    /// The voxels with points of each block.
    bits: [u64; 64],
    /// A point of each block; `next` leads to the others.
    firsts: [u32; 64],
}

impl Cloud {
    /// Create a cloud from the first point of each voxel.
    ///
    /// # Arguments
    /// * `voxel_m` - edge length of a voxel.
    /// * `radius_m` - radius within which [`Cloud::overlap`] looks for points.
    pub fn new(points: &[Point], voxel_m: f64, radius_m: f32) -> Self {
        Self::of_blocks(points, &PointBlocks::new(points, 1.0 / voxel_m), voxel_m, radius_m)
    }

    /// Return the same as [`Cloud::new`] for points whose blocks are known.
    pub(crate) fn of_blocks(
        points: &[Point],
        blocks: &PointBlocks,
        voxel_m: f64,
        radius_m: f32,
    ) -> Self {
        let mut cloud = Self {
            points: Vec::with_capacity(points.len()),
            bounds_m: Aabb::EMPTY,
            inverse_edge: 1.0 / voxel_m,
            radius_m,
            index: VoxelTable::with_capacity(blocks.blocks.len() / 8),
            cubes: Vec::new(),
            next: Vec::with_capacity(points.len()),
            num_old: 0,
        };
        cloud.merge_blocks(points, blocks);
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
            + self.cubes.capacity() * size_of::<Cube>()
            + self.index.num_heap_bytes()
    }

    /// Add the points that fall into voxels without a point.
    pub fn merge(&mut self, points: &[Point]) {
        self.merge_blocks(points, &PointBlocks::new(points, self.inverse_edge));
    }

    /// Do the same as [`Cloud::merge`] with points whose blocks are known.
    pub(crate) fn merge_blocks(&mut self, points: &[Point], new: &PointBlocks) {
        // Cube of each new block, and the voxels that are still without a point.
        let mut free: Vec<(u32, u64)> = Vec::with_capacity(new.blocks.len());
        let mut num_free = 0;
        for &(block, bits) in &new.blocks {
            let voxel = cube_of(block);
            let (&mut number, is_new) = self.index.entry(voxel, self.cubes.len() as u32);
            if is_new {
                self.cubes.push(Cube { voxel, blocks: 0, bits: [0; 64], firsts: [END; 64] });
            }
            let cube = &mut self.cubes[number as usize];
            let known = &mut cube.bits[place(block)];
            free.push((number, bits & !*known));
            num_free += (bits & !*known).count_ones();
            *known |= bits;
            cube.blocks |= 1 << place(block);
        }
        if num_free == 0 {
            return;
        }
        for (&point, spot) in points.iter().zip(&new.spots) {
            let (cube, free) = &mut free[spot.block()];
            if *free & spot.bit() != 0 {
                *free ^= spot.bit();
                let first =
                    &mut self.cubes[*cube as usize].firsts[place(new.blocks[spot.block()].0)];
                self.next.push(std::mem::replace(first, self.points.len() as u32));
                self.points.push(point);
                self.bounds_m = self.bounds_m.extended(point.map(f64::from));
            }
        }
    }

    /// Return the share of `points` with a point of this cloud nearer than the radius, 0 if there
    /// are no points.
    pub fn overlap(&self, points: &[Point]) -> f64 {
        self.overlap_blocks(points, &PointBlocks::new(points, self.inverse_edge))
    }

    /// Return the same as [`Cloud::overlap`] for points whose blocks are known.
    pub(crate) fn overlap_blocks(&self, points: &[Point], blocks: &PointBlocks) -> f64 {
        share(self.num_near(points, blocks, |_| false), points.len())
    }

    /// Return whether [`Cloud::overlap`] is `enough`, looking at no more points than necessary. If
    /// an overlap is enough, every larger one must be enough too.
    pub(crate) fn overlaps(
        &self,
        points: &[Point],
        blocks: &PointBlocks,
        enough: impl Fn(f64) -> bool,
    ) -> bool {
        let is_enough = |num: usize| enough(share(num, points.len()));
        // Most often, points in common voxels or in blocks beyond the cloud decide.
        let shares_voxels = self.shares_voxels();
        let Aabb { min_m, max_m } = self.reach_m();
        let reach = [min_m, max_m]
            .map(|corner| block_of(corner.map(|value| floor(value * self.inverse_edge))));
        let (mut num, mut left) = (0, points.len());
        for &(block, bits) in &blocks.blocks {
            if (0..3).any(|i| block[i] < reach[0][i] || block[i] > reach[1][i]) {
                left -= bits.count_ones() as usize;
            } else if shares_voxels {
                num += (bits & self.bits(block)).count_ones() as usize;
            }
        }
        if is_enough(num) || !is_enough(left) {
            return is_enough(num);
        }
        let is_decided = |[num, left]: [usize; 2]| is_enough(num) || !is_enough(num + left);
        is_enough(self.num_near(points, blocks, is_decided))
    }

    /// Return the points by block.
    pub(crate) fn blocks(&self) -> CloudBlocks<'_> {
        let (mut blocks, mut firsts) = (Vec::new(), Vec::new());
        for cube in &self.cubes {
            for place in ones(cube.blocks) {
                blocks.push((block_at(cube.voxel, place), cube.bits[place]));
                firsts.push(cube.firsts[place]);
            }
        }
        CloudBlocks { cloud: self, blocks, firsts }
    }

    /// Note that all points are one cluster.
    pub(crate) fn know_one_cluster(&mut self) {
        self.num_old = self.points.len();
    }

    /// Return whether one of a block's points is nearer to a point than the radius.
    fn has_near(&self, first: u32, point: Point) -> bool {
        let radius2 = self.radius_m * self.radius_m;
        chain(&self.next, first)
            .any(|index| distance2(self.points[index as usize], point) < radius2)
    }

    /// Return the bounds grown by the radius.
    fn reach_m(&self) -> Aabb {
        let (mut reach_m, radius) = (self.bounds_m, f64::from(self.radius_m));
        reach_m.min_m = reach_m.min_m.map(|v| v - radius);
        reach_m.max_m = reach_m.max_m.map(|v| v + radius);
        reach_m
    }

    /// Return the bits of a block's voxels with points.
    fn bits(&self, block: Voxel) -> u64 {
        let cube = self.index.get(cube_of(block));
        cube.map_or(0, |cube| self.cubes[cube as usize].bits[place(block)])
    }

    /// Return whether points in the same voxel are nearer to each other than the radius.
    fn shares_voxels(&self) -> bool {
        // Voxels farther away are not distinguished.
        let limit_m = f64::from(HALF - 8) / self.inverse_edge;
        let bounds_m = self.bounds_m.min_m.iter().chain(&self.bounds_m.max_m);
        3.0_f64.sqrt() * 1.001 < self.inverse_edge * f64::from(self.radius_m)
            && bounds_m.into_iter().all(|v| v.abs() < limit_m)
    }

    /// Count the points with a point of this cloud nearer than the radius until their number and
    /// that of the points left decide.
    fn num_near(
        &self,
        points: &[Point],
        blocks: &PointBlocks,
        is_decided: impl Fn([usize; 2]) -> bool,
    ) -> usize {
        let mut num = 0;
        let mut finder = Finder::new(self, blocks);
        for (index, &point) in points.iter().enumerate() {
            num += usize::from(finder.has_near(point, index));
            if is_decided([num, points.len() - index - 1]) {
                break;
            }
        }
        num
    }
}

/// The points of a [`Cloud`] by block.
pub(crate) struct CloudBlocks<'a> {
    cloud: &'a Cloud,
    blocks: Vec<(Voxel, u64)>,
    /// A point of each block.
    firsts: Vec<u32>,
}

impl Blocks for CloudBlocks<'_> {
    fn blocks(&self) -> &[(Voxel, u64)] {
        &self.blocks
    }

    fn points(&self) -> &[Point] {
        &self.cloud.points
    }

    fn num_old(&self) -> usize {
        self.cloud.num_old
    }

    fn indices(&self, block: usize) -> impl Iterator<Item = usize> {
        chain(&self.cloud.next, self.firsts[block]).map(|index| index as usize)
    }
}

fn share(num: usize, num_points: usize) -> f64 {
    num as f64 / num_points.max(1) as f64
}

/// A search for a cloud's points near others.
struct Finder<'a> {
    cloud: &'a Cloud,
    blocks: &'a PointBlocks,
    /// Bounds grown by the radius.
    reach_m: Aabb,
    /// Voxels of each block, once looked up, where points are certainly near, and the range of
    /// `around` that holds the cloud's blocks around it, by cube and place.
    found: Vec<Option<(u64, Range<usize>)>>,
    around: Vec<(u32, usize)>,
}

impl<'a> Finder<'a> {
    fn new(cloud: &'a Cloud, blocks: &'a PointBlocks) -> Self {
        let reach_m = cloud.reach_m();
        let found = vec![None; blocks.blocks.len()];
        Self { cloud, blocks, reach_m, found, around: Vec::new() }
    }

    /// Return whether a point of the cloud is nearer than the radius to a point with this index.
    fn has_near(&mut self, point: Point, index: usize) -> bool {
        let is_far = |i: usize| {
            let value = f64::from(point[i]);
            value < self.reach_m.min_m[i] || value > self.reach_m.max_m[i]
        };
        if (0..3).any(is_far) {
            return false;
        }
        let spot = self.blocks.spots[index];
        let number = spot.block();
        if self.found[number].is_none() {
            self.look_around(number);
        }
        let Some((near, around)) = &self.found[number] else { return false };
        if near & spot.bit() != 0 {
            return true;
        }
        // Slightly more than the radius, so that rounding cannot leave out a voxel.
        let radius_m = f64::from(self.cloud.radius_m) * 1.0001;
        let window = [-radius_m, radius_m].map(|step| {
            clamped(point.map(|v| floor((f64::from(v) + step) * self.cloud.inverse_edge)))
        });
        self.around[around.clone()].iter().any(|&(cube, slot)| {
            let cube = &self.cloud.cubes[cube as usize];
            cube.bits[slot] & bits_between(block_at(cube.voxel, slot), window) != 0
                && self.cloud.has_near(cube.firsts[slot], point)
        })
    }

    /// Find the cloud's blocks that may hold points near those of a block.
    fn look_around(&mut self, number: usize) {
        let (block, _) = self.blocks.blocks[number];
        let cloud = self.cloud;
        let near = if cloud.shares_voxels() { cloud.bits(block) } else { 0 };
        let begin = self.around.len();
        let edge_m = 4.0 / cloud.inverse_edge;
        let reach = (f64::from(cloud.radius_m) * 1.0001 / edge_m).ceil() as i32;
        let window = [block.map(|i| i - reach), block.map(|i| i + reach)];
        let mut add = |cube: u32| {
            let Cube { voxel, blocks, .. } = cloud.cubes[cube as usize];
            let places = ones(blocks & bits_between(voxel, window));
            self.around.extend(places.map(|place| (cube, place)));
        };
        let [low, high] = window.map(cube_of);
        let num: f64 = (0..3).map(|i| f64::from(high[i] - low[i] + 1)).product();
        if num > 27.0 + cloud.cubes.len() as f64 {
            (0..cloud.cubes.len() as u32).for_each(add);
        } else {
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    (low[2]..=high[2])
                        .filter_map(|z| cloud.index.get([x, y, z]))
                        .for_each(&mut add);
                }
            }
        }
        self.found[number] = Some((near, begin..self.around.len()));
    }
}

#[cfg(test)]
mod tests {
    use proptest::{collection::vec, prelude::*};

    use super::*;

    fn points() -> impl Strategy<Value = Vec<Point>> {
        let clump = (
            [-0.4_f32..0.4, -0.4_f32..0.4, -0.4_f32..0.4],
            vec([0.0_f32..0.06, 0.0_f32..0.06, 0.0_f32..0.06], 1..25),
        );
        vec(clump, 0..6).prop_map(|clumps| {
            let around = |(centre, steps): (Point, Vec<Point>)| {
                steps.into_iter().map(move |step| [0, 1, 2].map(|i| centre[i] + step[i]))
            };
            clumps.into_iter().flat_map(around).collect()
        })
    }

    proptest! {
        /// Early answers are those of all points.
        #[test]
        fn whether_an_overlap_is_enough_follows_from_it(
            known in points(), points in points(), shift in [-0.02_f32..0.02, 0.0_f32..0.1, -0.2_f32..0.2],
            voxel_m in 0.005..0.1, radius_m in 0.01_f32..0.2, least in 0.0..1.0,
        ) {
            let cloud = Cloud::new(&known, voxel_m, radius_m);
            let moved = known.iter().map(|point| [0, 1, 2].map(|i| point[i] + shift[i]));
            let points: Vec<Point> = points.into_iter().chain(moved).collect();
            let blocks = PointBlocks::new(&points, 1.0 / voxel_m);
            let is_enough = cloud.overlaps(&points, &blocks, |overlap| overlap > least);
            prop_assert_eq!(is_enough, cloud.overlap(&points) > least);
        }
    }
}
