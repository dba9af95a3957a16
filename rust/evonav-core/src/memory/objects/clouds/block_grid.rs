//! Blocks by their place, and which of them are dense.

use crate::{
    grid::components::find,
    memory::objects::clouds::{
        cells::{Cells, Step},
        density::{Density, NUM_TOUCHING, REACH},
        voxels::{HALF, Voxel},
    },
};

/// Number of blocks that have a face in common with a block.
const NUM_FACES: usize = 6;

const NO_PART: u32 = u32::MAX;

/// Return the smallest and the largest corner of the box around blocks; `None` if there are no
/// blocks, or some so far away that voxels are not distinguished.
pub(crate) fn corners(blocks: &[(Voxel, u64)]) -> Option<[Voxel; 2]> {
    let &(first, _) = blocks.first()?;
    let corners = blocks.iter().fold([first; 2], |[low, high], &(block, _)| {
        [[0, 1, 2].map(|i| low[i].min(block[i])), [0, 1, 2].map(|i| high[i].max(block[i]))]
    });
    let limit = HALF / 4 - 1;
    corners.iter().flatten().all(|i| (-limit..limit).contains(i)).then_some(corners)
}

/// Blocks by their place, and which of them are dense.
pub(crate) struct BlockGrid<'a> {
    density: &'a Density,
    blocks: &'a [(Voxel, u64)],
    cells: Cells,
    touching: [Step; NUM_TOUCHING],
    is_dense: Vec<bool>,
}

impl<'a> BlockGrid<'a> {
    pub(crate) fn new(
        density: &'a Density,
        blocks: &'a [(Voxel, u64)],
        corners: [Voxel; 2],
    ) -> Self {
        let mut cells = Cells::between(corners, REACH, 4 * blocks.len());
        for &(block, _) in blocks {
            cells.enter(block);
        }
        let touching = std::array::from_fn(|i| cells.step(density.steps[i]));
        let mut grid = Self { density, blocks, cells, touching, is_dense: Vec::new() };
        let min_points = u32::try_from(density.min_points).unwrap_or(u32::MAX);
        let is_dense = |block: usize| {
            let mut num = blocks[block].1.count_ones();
            let mut near = grid.near(block);
            while num < min_points {
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
        let touching = self.touching.iter().zip(self.density.near);
        touching.filter_map(move |(&step, near)| {
            let other = self.cells.beside(block, step)?;
            Some((other, self.blocks[other].1 & near))
        })
    }

    /// Return the blocks whose points are not all known to have a core point nearby.
    pub(crate) fn loose(&self) -> impl Iterator<Item = usize> {
        let is_loose = |&block: &usize| {
            !self.is_dense[block]
                && !self.near(block).any(|(other, bits)| self.is_dense[other] && bits != 0)
        };
        (0..self.blocks.len()).filter(is_loose)
    }

    /// Return the blocks around a block that may contain neighbours of its points, those that touch
    /// it first.
    pub(crate) fn around(&self, block: usize) -> impl Iterator<Item = usize> {
        let steps = self.density.steps.iter().map(|&step| self.cells.step(step));
        steps.filter_map(move |step| self.cells.beside(block, step))
    }

    /// Return whether all points of a block surely are core points.
    pub(crate) fn is_dense(&self, block: usize) -> bool {
        self.is_dense[block]
    }

    /// Return whether all dense blocks and old points are connected: by faces, or joined.
    pub(crate) fn is_connected(
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
                let mut around = self.around(block).filter(|&other| self.is_dense[other]);
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
                for (&face, near) in self.touching[..NUM_FACES].iter().zip(self.density.near) {
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
