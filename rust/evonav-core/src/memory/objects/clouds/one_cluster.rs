//! Recognise clouds that are one density cluster, most of them without looking at points.

use std::sync::LazyLock;

use crate::{
    grid::components::find,
    memory::objects::clouds::{
        blocks::{Blocks, place},
        cells::{Cells, Step, steps_within},
        dbscan::distance2,
        voxels::{HALF, Voxel},
    },
    sensors::unproject::Point,
};

/// The conditions of [`dbscan`](super::dbscan::dbscan) for a cluster, applied to blocks.
///
/// All points of a block are neighbours if it is small enough, and so are those of some voxels
/// around it. A block with enough points there is called dense: its points are core points.
#[derive(Debug, Clone)]
pub(crate) struct Density {
    radius2: f32,
    min_points: u32,
    /// Whether all points of a block are neighbours.
    is_fine: bool,
    /// The voxels whose points are neighbours of all points of a block, in each of the blocks that
    /// touch it; by [`STEPS`].
    near: [u64; NUM_TOUCHING],
}

impl Density {
    /// Describe clusters.
    ///
    /// # Arguments
    /// * `voxel_m` - edge length of a voxel.
    /// * `radius_m`, `min_points` - those of the cluster.
    pub(crate) fn new(voxel_m: f64, radius_m: f32, min_points: usize) -> Self {
        // Slightly more than the largest distance, for rounding.
        let is_near = |num_voxels: [i32; 3]| {
            let edges = num_voxels.map(|num| f64::from(num) * voxel_m * 1.001);
            edges.iter().map(|edge| edge * edge).sum::<f64>() < f64::from(radius_m).powi(2)
        };
        let near_at = |step: Voxel| {
            let mut near = 0;
            for voxel in (0..64).map(|i| [i >> 4, i >> 2 & 3, i & 3]) {
                // Voxels from the farther end of the block to the farther end of this voxel.
                let across = [0, 1, 2].map(|axis| match step[axis] {
                    0 => (voxel[axis] + 1).max(4 - voxel[axis]),
                    1 => 5 + voxel[axis],
                    _ => 8 - voxel[axis],
                });
                near |= u64::from(is_near(across)) << place(voxel);
            }
            near
        };
        Self {
            radius2: radius_m * radius_m,
            min_points: u32::try_from(min_points).unwrap_or(u32::MAX),
            is_fine: is_near([4; 3]),
            near: std::array::from_fn(|i| near_at(STEPS[i])),
        }
    }

    /// Return whether all points surely are one cluster without noise; `false` if that is not so,
    /// or not seen here.
    ///
    /// # Complexity
    /// O(blocks) for most objects.
    pub(crate) fn is_one_cluster(&self, cloud: &impl Blocks) -> bool {
        let blocks = cloud.blocks();
        let Some(corners) = corners(blocks).filter(|_| self.is_fine) else { return false };
        let grid = BlockGrid::new(self, blocks, corners);
        let is_near = |a: Point, b: Point| distance2(a, b) <= self.radius2;
        let is_beside_core = |block: usize| {
            let mut left: Vec<Point> = cloud.new_points(block).collect();
            let mut dense = grid.dense_around(block);
            while !left.is_empty() {
                let Some(other) = dense.next() else { return false };
                left.retain(|&point| !cloud.points(other).any(|core| is_near(point, core)));
            }
            true
        };
        let are_joined = |a: usize, b: usize| {
            cloud.points(a).any(|point| cloud.points(b).any(|other| is_near(point, other)))
        };
        grid.loose().all(is_beside_core)
            && grid.is_connected(|block| cloud.has_old(block), are_joined)
    }
}

/// Return the smallest and the largest corner of the box around blocks; `None` if there are no
/// blocks, or some so far away that voxels are not distinguished.
fn corners(blocks: &[(Voxel, u64)]) -> Option<[Voxel; 2]> {
    let &(first, _) = blocks.first()?;
    let corners = blocks.iter().fold([first; 2], |[low, high], &(block, _)| {
        [[0, 1, 2].map(|i| low[i].min(block[i])), [0, 1, 2].map(|i| high[i].max(block[i]))]
    });
    let limit = HALF / 4 - 1;
    corners.iter().flatten().all(|i| (-limit..limit).contains(i)).then_some(corners)
}

/// Blocks by their place, and which of them are dense.
struct BlockGrid<'a> {
    blocks: &'a [(Voxel, u64)],
    near: &'a [u64; NUM_TOUCHING],
    cells: Cells,
    touching: [Step; NUM_TOUCHING],
    is_dense: Vec<bool>,
}

impl<'a> BlockGrid<'a> {
    fn new(density: &'a Density, blocks: &'a [(Voxel, u64)], corners: [Voxel; 2]) -> Self {
        let mut cells = Cells::between(corners, REACH, 4 * blocks.len());
        for &(block, _) in blocks {
            cells.enter(block);
        }
        let touching = std::array::from_fn(|i| cells.step(STEPS[i]));
        let mut grid = Self { blocks, near: &density.near, cells, touching, is_dense: Vec::new() };
        let is_dense = |block: usize| {
            let mut num = blocks[block].1.count_ones();
            let mut near = grid.near(block);
            while num < density.min_points {
                let Some((_, bits)) = near.next() else { return false };
                num += bits.count_ones();
            }
            true
        };
        grid.is_dense = (0..blocks.len()).map(is_dense).collect();
        grid
    }

    /// Return the blocks that touch a block, those with a common face first, and the bits of their
    /// points that are neighbours of all its points.
    #[inline]
    fn near(&self, block: usize) -> impl Iterator<Item = (usize, u64)> {
        let touching = self.touching.iter().zip(self.near);
        touching.filter_map(move |(&step, near)| {
            let other = self.cells.beside(block, step)?;
            Some((other, self.blocks[other].1 & near))
        })
    }

    /// Return the blocks whose points are not all known to have a core point nearby.
    fn loose(&self) -> impl Iterator<Item = usize> {
        let is_loose = |&block: &usize| {
            !self.is_dense[block]
                && !self.near(block).any(|(other, bits)| self.is_dense[other] && bits != 0)
        };
        (0..self.blocks.len()).filter(is_loose)
    }

    /// Return the dense blocks around a block, the nearest first.
    fn dense_around(&self, block: usize) -> impl Iterator<Item = usize> {
        let steps = STEPS.iter().map(|&step| self.cells.step(step));
        let beside = steps.filter_map(move |step| self.cells.beside(block, step));
        beside.filter(|&other| self.is_dense[other])
    }

    /// Return whether all dense blocks and old points are connected: by faces, or joined.
    fn is_connected(
        &self,
        is_old: impl Fn(usize) -> bool,
        are_joined: impl Fn(usize, usize) -> bool,
    ) -> bool {
        let (part_of, sizes) = self.parts();
        // The last part is that of the old points, if there are any.
        let old = sizes.len() as u32;
        let has_old = (0..self.blocks.len()).any(&is_old);
        let mut parents: Vec<u32> = (0..=old).collect();
        let mut num_left = (sizes.len() + usize::from(has_old)).saturating_sub(1);
        let mut join = |a: u32, b: u32, are_joined: &dyn Fn() -> bool| {
            let [a, b] = [a, b].map(|part| find(&mut parents, part));
            if a != b && are_joined() {
                parents[a.max(b) as usize] = a.min(b);
                num_left -= 1;
            }
            num_left == 0
        };
        let dense = || (0..self.blocks.len()).filter(|&block| self.is_dense[block]);
        // Of two parts to be joined, at least one is not the largest.
        let largest = (0..old).max_by_key(|&part| sizes[part as usize]);
        join(old, old, &|| false)
            || has_old && dense().any(|block| join(part_of[block], old, &|| is_old(block)))
            || dense().filter(|&block| Some(part_of[block]) != largest).any(|block| {
                let mut around = self.dense_around(block);
                around
                    .any(|other| join(part_of[block], part_of[other], &|| are_joined(block, other)))
            })
    }

    /// Return the part of each dense block, connected by faces, and the number of blocks of each.
    fn parts(&self) -> (Vec<u32>, Vec<usize>) {
        let mut part_of = vec![NO_PART; self.blocks.len()];
        let (mut sizes, mut left) = (Vec::new(), Vec::new());
        for first in (0..self.blocks.len()).filter(|&block| self.is_dense[block]) {
            if part_of[first] != NO_PART {
                continue;
            }
            let part = sizes.len() as u32;
            part_of[first] = part;
            let mut size = 0;
            left.push(first);
            while let Some(block) = left.pop() {
                size += 1;
                for (&face, near) in self.touching[..NUM_FACES].iter().zip(self.near) {
                    let Some(other) = self.cells.beside(block, face) else { continue };
                    if self.is_dense[other]
                        && part_of[other] == NO_PART
                        && self.blocks[other].1 & near != 0
                    {
                        part_of[other] = part;
                        left.push(other);
                    }
                }
            }
            sizes.push(size);
        }
        (part_of, sizes)
    }
}

const NO_PART: u32 = u32::MAX;

/// Largest number of blocks along an axis to dense blocks that are looked for; there may be more.
const REACH: i32 = 2;

/// Numbers of blocks that have a face in common with a block, and of those that touch it.
const NUM_FACES: usize = 6;
const NUM_TOUCHING: usize = 26;

/// Steps to the blocks within [`REACH`]: to those with a common face first, then to the others that
/// touch.
static STEPS: LazyLock<Vec<Voxel>> = LazyLock::new(|| {
    let mut steps = steps_within(REACH);
    steps.sort_by_key(|step| step.iter().any(|i| i.abs() > 1));
    steps
});

#[cfg(test)]
mod tests {
    use proptest::{collection::vec, prelude::*};

    use super::*;
    use crate::memory::objects::clouds::{cloud::Cloud, dbscan::dbscan, point_blocks::PointBlocks};

    /// Surfaces of some points each, near each other.
    fn points() -> impl Strategy<Value = Vec<Point>> {
        let patch = (
            [-0.12_f32..0.12, -0.12_f32..0.12, -0.12_f32..0.12],
            [0.0_f32..0.2, 0.0_f32..0.2, 0.0_f32..0.05],
            vec([0.0_f32..1.0, 0.0_f32..1.0, 0.0_f32..1.0], 1..60),
        );
        vec(patch, 1..5).prop_map(|patches| {
            let of_patch = |(corner, size, places): (Point, Point, Vec<Point>)| {
                places.into_iter().map(move |at| [0, 1, 2].map(|i| corner[i] + size[i] * at[i]))
            };
            patches.into_iter().flat_map(of_patch).collect()
        })
    }

    fn are_one_cluster(points: &[Point], radius_m: f32, min_points: usize) -> bool {
        dbscan(points, radius_m, min_points).iter().all(|&label| label == 0)
    }

    proptest! {
        /// Recognised clouds are one cluster, at once and after points came to one.
        #[test]
        fn what_is_recognised_is_one_cluster(
            points in points(), more in points(), shift in [-0.2_f32..0.2, -0.2_f32..0.2, -0.2_f32..0.2],
            voxel_m in 0.002..0.03, radius_m in 0.02_f32..0.2, min_points in 1_usize..15,
        ) {
            let density = Density::new(voxel_m, radius_m, min_points);
            let is_one_cluster = |points: &[Point]| are_one_cluster(points, radius_m, min_points);
            let blocks = PointBlocks::new(&points, 1.0 / voxel_m);
            if density.is_one_cluster(&blocks.of(&points)) {
                prop_assert!(is_one_cluster(&points));
            }
            let mut cloud = Cloud::new(&points, voxel_m, 0.05);
            if is_one_cluster(cloud.points()) {
                cloud.know_one_cluster();
            }
            let more: Vec<Point> =
                more.into_iter().map(|point| [0, 1, 2].map(|i| point[i] + shift[i])).collect();
            cloud.merge(&more);
            if density.is_one_cluster(&cloud.blocks()) {
                prop_assert!(is_one_cluster(cloud.points()));
            }
        }
    }

    #[test]
    fn near_voxels_are_those_within_the_radius_of_a_whole_block() {
        let corners = |first: Voxel, side: i32| {
            (0..8).map(move |i| [0, 1, 2].map(|axis| first[axis] + side * (i >> axis & 1)))
        };
        for radius_m in [0.03, 0.05, 0.07, 0.08, 0.1, 0.15] {
            let density = Density::new(0.01, radius_m, 10);
            let block: Vec<Voxel> = corners([0; 3], 4).collect();
            for (step, near) in STEPS.iter().zip(density.near) {
                for voxel in (0..64).map(|i| [i >> 4, i >> 2 & 3, i & 3]) {
                    let first = [0, 1, 2].map(|axis| 4 * step[axis] + voxel[axis]);
                    let distance = |a: Voxel, b: &Voxel| {
                        let steps = [0, 1, 2].map(|i| f64::from(a[i] - b[i]).powi(2));
                        0.01 * steps.iter().sum::<f64>().sqrt()
                    };
                    let all =
                        corners(first, 1).flat_map(|a| block.iter().map(move |b| distance(a, b)));
                    let is_near = all.fold(0.0, f64::max) * 1.001 < f64::from(radius_m);
                    assert_eq!(
                        near >> place(voxel) & 1 == 1,
                        is_near,
                        "{radius_m} {step:?} {voxel:?}"
                    );
                }
            }
        }
    }

    /// Return a square of points that are 0.01 m apart.
    fn square(corner: Point, side: usize) -> Vec<Point> {
        let place =
            |i: usize| [corner[0] + 0.01 * (i / side) as f32, corner[1] + 0.01 * (i % side) as f32];
        (0..side * side)
            .map(place)
            .map(|[x, y]| [x + 0.005, y + 0.005, corner[2] + 0.005])
            .collect()
    }

    #[test]
    fn surfaces_are_recognised() {
        let density = Density::new(0.01, 0.1, 10);
        let is_recognised =
            |points: &[Point]| density.is_one_cluster(&PointBlocks::new(points, 100.0).of(points));
        let surface = square([0.0; 3], 30);
        assert!(is_recognised(&surface));
        // A second surface is joined if it is near; single points belong to it if they are near.
        let beside =
            |step_m: f32| [surface.clone(), square([0.3 + step_m, 0.0, 0.05], 30)].concat();
        assert!(is_recognised(&beside(0.05)));
        assert!(!is_recognised(&beside(0.11)));
        let with = |x_m: f32| [surface.clone(), vec![[x_m, 0.105, 0.005]]].concat();
        assert!(is_recognised(&with(0.39)));
        assert!(!is_recognised(&with(0.40)));
    }

    #[test]
    fn old_points_need_no_proof() {
        let density = Density::new(0.01, 0.1, 10);
        // A line of points, 10 in 0.15 m: they are one cluster, but no block is dense.
        let line: Vec<Point> = (0..100).map(|i| [0.015 * i as f32, 0.005, 0.005]).collect();
        let mut cloud = Cloud::new(&line, 0.01, 0.025);
        assert!(are_one_cluster(&line, 0.1, 10) && !density.is_one_cluster(&cloud.blocks()));
        cloud.know_one_cluster();
        assert!(density.is_one_cluster(&cloud.blocks()));
        // Surfaces at its two ends are connected by it.
        cloud.merge(&square([-0.1, 0.0, 0.0], 20));
        cloud.merge(&square([1.4, 0.0, 0.0], 20));
        assert!(density.is_one_cluster(&cloud.blocks()));
        cloud.merge(&square([3.0, 0.0, 0.0], 20));
        assert!(!density.is_one_cluster(&cloud.blocks()));
        // A surface away from old points is a cluster of its own, though it is the only surface.
        let mut cloud = Cloud::new(&line, 0.01, 0.025);
        cloud.know_one_cluster();
        cloud.merge(&square([3.0, 0.0, 0.0], 20));
        assert!(!density.is_one_cluster(&cloud.blocks()));
    }
}
