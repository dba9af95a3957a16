//! The density at which blocks of voxels are dense.

use std::sync::LazyLock;

use crate::memory::objects::clouds::{blocks::place, cells::steps_within, voxels::Voxel};

/// The conditions of [`dbscan`](super::dbscan::dbscan) for a cluster, applied to blocks.
///
/// All points of a block are neighbours if it is small enough, and so are those of some voxels
/// around it. A block with enough points there is called dense: its points are core points.
#[derive(Debug, Clone)]
pub(crate) struct Density {
    pub(crate) radius_m: f32,
    pub(crate) min_points: usize,
    /// Whether all points of a block are neighbours, and all neighbours within [`STEPS`].
    pub(crate) is_fine: bool,
    /// Those of [`STEPS`] that lead to blocks with neighbours.
    pub(crate) steps: Vec<Voxel>,
    /// The voxels whose points are neighbours of all points of a block, in each of the blocks that
    /// touch it; by [`STEPS`].
    pub(crate) near: [u64; NUM_TOUCHING],
}

impl Density {
    /// Describe clusters.
    ///
    /// # Arguments
    /// * `voxel_m` - edge length of a voxel.
    /// * `radius_m`, `min_points` - those of the cluster.
    pub(crate) fn new(voxel_m: f64, radius_m: f32, min_points: usize) -> Self {
        // Slightly more than the largest distance, for rounding.
        let is_near = |num_voxels: [i32; 3]| is_within(num_voxels, voxel_m * 1.001, radius_m);
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
        // The distance of two blocks is at least that of the voxels between them.
        let between = |step: &&Voxel| step.map(|i| 4 * (i.abs() - 1).max(0));
        let is_in_reach = |step: &&Voxel| is_within(between(step), voxel_m * 0.999, radius_m);
        Self {
            radius_m,
            min_points,
            is_fine: is_near([4; 3]) && !is_within([4 * REACH, 0, 0], voxel_m * 0.999, radius_m),
            steps: STEPS.iter().filter(is_in_reach).copied().collect(),
            near: std::array::from_fn(|i| near_at(STEPS[i])),
        }
    }
}

/// Return whether a distance, given by the voxels along each axis, is less than a radius.
fn is_within(num_voxels: [i32; 3], voxel_m: f64, radius_m: f32) -> bool {
    let edges_m = num_voxels.map(|num| f64::from(num) * voxel_m);
    edges_m.iter().map(|edge| edge * edge).sum::<f64>() < f64::from(radius_m).powi(2)
}

/// Largest number of blocks along an axis to blocks that may contain neighbours.
pub(crate) const REACH: i32 = 3;

/// Number of blocks that touch a block.
pub(crate) const NUM_TOUCHING: usize = 26;

/// Steps to the blocks within [`REACH`]: to those with a common face first, then to the others that
/// touch.
static STEPS: LazyLock<Vec<Voxel>> = LazyLock::new(|| steps_within(REACH));

#[cfg(test)]
mod tests {
    use super::*;

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
}
