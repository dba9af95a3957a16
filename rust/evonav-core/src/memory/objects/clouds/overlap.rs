//! Find the share of points that are near a cloud.

use std::ops::Range;

use crate::{
    geometry::Aabb,
    grid::bits::ones,
    memory::objects::clouds::{
        blocks::{bits_between, block_at, block_of, cube_of, place},
        cloud::{Cloud, Cube, NO_CUBE},
        dbscan::distance2,
        point_blocks::{PointBlocks, chain},
        voxels::{HALF, Voxel, clamped, floor},
    },
    sensors::unproject::Point,
};

impl Cloud {
    /// Return the share of `points` with a point of this cloud nearer than the radius, 0 if there
    /// are no points.
    pub fn overlap(&self, points: &[Point]) -> f64 {
        self.overlap_blocks(points, &PointBlocks::new(points, self.inverse_edge))
    }

    /// Return the same as [`Cloud::overlap`] for points whose blocks are known.
    pub(crate) fn overlap_blocks(&self, points: &[Point], blocks: &PointBlocks) -> f64 {
        let num = self.num_near(points, blocks, &self.answers(blocks), |_| false);
        share(num, points.len())
    }

    /// Return whether [`Cloud::overlap`] is `enough`, looking at no more points than necessary. If
    /// an overlap is enough, every larger one must be enough too.
    pub(crate) fn overlaps(
        &self,
        points: &[Point],
        blocks: &PointBlocks,
        enough: impl Fn(f64) -> bool,
    ) -> bool {
        let needed = least_enough(points.len(), enough);
        let is_decided = |[num, open]: [usize; 2]| num >= needed || num + open < needed;
        // Most often, points in common voxels or in blocks beyond the cloud decide.
        let answers = self.answers(blocks);
        let (mut num, mut num_far) = (0, 0);
        for (answer, (_, bits)) in answers.iter().zip(&blocks.blocks) {
            num += answer.near.count_ones() as usize;
            num_far += (bits & !answer.near & !answer.open).count_ones() as usize;
        }
        if !is_decided([num, points.len() - num_far - num]) {
            num = self.num_near(points, blocks, &answers, is_decided);
        }
        num >= needed
    }

    /// Answer for the voxels of each block whether points there are near this cloud, if that is
    /// seen at once.
    fn answers(&self, blocks: &PointBlocks) -> Vec<Answer> {
        let shares_voxels = self.shares_voxels();
        let Aabb { min_m, max_m } = self.reach_m();
        let [low, high] = [min_m, max_m]
            .map(|corner| block_of(corner.map(|value| floor(value * self.inverse_edge))));
        // Most blocks are in the cube of the one before.
        let (mut voxel, mut cube) = (NO_CUBE, None);
        let mut answer = |&(block, bits): &(Voxel, u64)| {
            if (0..3).any(|i| block[i] < low[i] || block[i] > high[i]) {
                return Answer { near: 0, open: 0 };
            }
            if voxel != cube_of(block) {
                voxel = cube_of(block);
                cube = self.index.get(voxel).map(|number| &self.cubes[number as usize]);
            }
            let common = cube.map_or(0, |cube: &Cube| bits & cube.bits[place(block)]);
            let near = if shares_voxels { common } else { 0 };
            Answer { near, open: bits & !near }
        };
        blocks.blocks.iter().map(&mut answer).collect()
    }

    /// Count the points with a point of this cloud nearer than the radius until their number and
    /// that of the points left decide.
    fn num_near(
        &self,
        points: &[Point],
        blocks: &PointBlocks,
        answers: &[Answer],
        is_decided: impl Fn([usize; 2]) -> bool,
    ) -> usize {
        let (mut num, mut num_open) = (0, 0);
        for spot in &blocks.spots {
            let Answer { near, open } = answers[spot.block()];
            num += (near >> spot.place() & 1) as usize;
            num_open += (open >> spot.place() & 1) as usize;
        }
        let mut finder = Finder::new(self, blocks);
        for (&point, spot) in points.iter().zip(&blocks.spots) {
            if is_decided([num, num_open]) {
                break;
            }
            if answers[spot.block()].open & spot.bit() != 0 {
                num_open -= 1;
                num += usize::from(finder.has_near(point, spot.block()));
            }
        }
        num
    }

    /// Return the bounds grown by the radius.
    fn reach_m(&self) -> Aabb {
        let (mut reach_m, radius) = (self.bounds_m, f64::from(self.radius_m));
        reach_m.min_m = reach_m.min_m.map(|v| v - radius);
        reach_m.max_m = reach_m.max_m.map(|v| v + radius);
        reach_m
    }

    /// Return whether points in the same voxel are nearer to each other than the radius.
    fn shares_voxels(&self) -> bool {
        // Voxels farther away are not distinguished.
        let limit_m = f64::from(HALF - 8) / self.inverse_edge;
        let bounds_m = self.bounds_m.min_m.iter().chain(&self.bounds_m.max_m);
        3.0_f64.sqrt() * 1.001 < self.inverse_edge * f64::from(self.radius_m)
            && bounds_m.into_iter().all(|v| v.abs() < limit_m)
    }
}

/// The voxels of a block by what is known about points in them.
#[derive(Clone, Copy)]
struct Answer {
    /// Those where points certainly are near.
    near: u64,
    /// Those where points may be near.
    open: u64,
}

fn share(num: usize, num_points: usize) -> f64 {
    num as f64 / num_points.max(1) as f64
}

/// Return the least number of points whose share is enough; more than all if no share is.
fn least_enough(num_points: usize, enough: impl Fn(f64) -> bool) -> usize {
    let (mut low, mut high) = (0, num_points + 1);
    while low < high {
        let middle = usize::midpoint(low, high);
        if enough(share(middle, num_points)) { high = middle } else { low = middle + 1 }
    }
    low
}

/// A search for a cloud's points near others.
struct Finder<'a> {
    cloud: &'a Cloud,
    blocks: &'a PointBlocks,
    /// Bounds grown by the radius.
    reach_m: Aabb,
    /// The range of `around` that holds the cloud's blocks around each block, once looked up.
    found: Vec<Option<Range<usize>>>,
    /// Blocks of the cloud, by cube and place.
    around: Vec<(u32, usize)>,
}

impl<'a> Finder<'a> {
    fn new(cloud: &'a Cloud, blocks: &'a PointBlocks) -> Self {
        let reach_m = cloud.reach_m();
        let found = vec![None; blocks.blocks.len()];
        Self { cloud, blocks, reach_m, found, around: Vec::new() }
    }

    /// Return whether a point of the cloud is nearer than the radius to a point of a block.
    fn has_near(&mut self, point: Point, block: usize) -> bool {
        let is_far = |i: usize| {
            let value = f64::from(point[i]);
            value < self.reach_m.min_m[i] || value > self.reach_m.max_m[i]
        };
        if (0..3).any(is_far) {
            return false;
        }
        let around = match &self.found[block] {
            Some(around) => around.clone(),
            None => self.look_around(block),
        };
        let cloud = self.cloud;
        // Slightly more than the radius, so that rounding cannot leave out a voxel.
        let radius_m = f64::from(cloud.radius_m) * 1.0001;
        let window = [-radius_m, radius_m]
            .map(|step| clamped(point.map(|v| floor((f64::from(v) + step) * cloud.inverse_edge))));
        let radius2 = cloud.radius_m * cloud.radius_m;
        self.around[around].iter().any(|&(cube, place)| {
            let cube = &cloud.cubes[cube as usize];
            cube.bits[place] & bits_between(block_at(cube.voxel, place), window) != 0
                && chain(&cloud.next, cube.firsts[place])
                    .any(|index| distance2(cloud.points[index as usize], point) < radius2)
        })
    }

    /// Find the cloud's blocks that may hold points near those of a block.
    fn look_around(&mut self, number: usize) -> Range<usize> {
        let (block, _) = self.blocks.blocks[number];
        let cloud = self.cloud;
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
        let around = begin..self.around.len();
        self.found[number] = Some(around.clone());
        around
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
