//! Points by block of voxels.

use std::cell::OnceCell;

use crate::{
    memory::objects::clouds::{
        blocks::{Blocks, block_of, place},
        voxels::{Voxel, VoxelIndex, bounds, clamped, voxel_of, voxels_of},
    },
    sensors::unproject::Point,
};

/// Points by block of 4 x 4 x 4 voxels, since those of a surface lie together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct PointBlocks {
    /// Blocks with points, in the order of their first ones, and the [`bit`](Spot::bit)s of the
    /// voxels with points.
    pub(crate) blocks: Vec<(Voxel, u64)>,
    /// Voxel of each point.
    pub(crate) spots: Vec<Spot>,
}

/// A voxel of [`PointBlocks`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Spot(u32);

impl Spot {
    /// Return the index of the block.
    #[inline(always)]
    pub(crate) fn block(self) -> usize {
        (self.0 >> 6) as usize
    }

    /// Return the place in the block: 0 to 63, z first.
    #[inline(always)]
    pub(crate) fn place(self) -> usize {
        (self.0 & 63) as usize
    }

    /// Return the bit of the place.
    #[inline(always)]
    pub(crate) fn bit(self) -> u64 {
        1 << self.place()
    }
}

impl PointBlocks {
    pub(crate) fn new(points: &[Point], inverse_edge: f64) -> Self {
        let Some(corners) = bounds(points) else {
            return Self { blocks: Vec::new(), spots: Vec::new() };
        };
        let corners = corners.map(|corner| block_of(voxel_of(corner, inverse_edge)));
        let mut index = VoxelIndex::between(corners, 0, points.len());
        let mut blocks: Vec<(Voxel, u64)> = Vec::with_capacity(points.len() / 4);
        let mut spots = Vec::with_capacity(points.len());
        for voxel in voxels_of(points, inverse_edge).into_iter().map(clamped) {
            let block = voxel.map(|i| i >> 2);
            let number = index.entry(block, blocks.len() as u32);
            if number as usize == blocks.len() {
                blocks.push((block, 0));
            }
            let spot = Spot(number << 6 | place(voxel) as u32);
            blocks[number as usize].1 |= spot.bit();
            spots.push(spot);
        }
        Self { blocks, spots }
    }

    /// Return the same for some of the points.
    pub(crate) fn part(&self, is_inside: &[bool]) -> Self {
        let mut number_of = vec![END; self.blocks.len()];
        let mut blocks: Vec<(Voxel, u64)> = Vec::with_capacity(self.blocks.len());
        let inside = self.spots.iter().zip(is_inside).filter(|&(_, &is_inside)| is_inside);
        let enter = |(&spot, _): (&Spot, &bool)| {
            let number = &mut number_of[spot.block()];
            if *number == END {
                *number = blocks.len() as u32;
                blocks.push((self.blocks[spot.block()].0, 0));
            }
            blocks[*number as usize].1 |= spot.bit();
            Spot(*number << 6 | spot.place() as u32)
        };
        Self { spots: inside.map(enter).collect(), blocks }
    }

    /// Return the points by block.
    pub(crate) fn of<'a>(&'a self, points: &'a [Point]) -> LinkedBlocks<'a> {
        LinkedBlocks { points, blocks: self, links: OnceCell::new() }
    }
}

/// The points of [`PointBlocks`] by block.
pub(crate) struct LinkedBlocks<'a> {
    points: &'a [Point],
    blocks: &'a PointBlocks,
    /// A point of each block, and the next one in the same block of each point; see [`chain`].
    links: OnceCell<(Vec<u32>, Vec<u32>)>,
}

impl LinkedBlocks<'_> {
    fn linked(&self) -> (Vec<u32>, Vec<u32>) {
        let mut firsts = vec![END; self.blocks.blocks.len()];
        let link = |(index, spot): (usize, &Spot)| {
            std::mem::replace(&mut firsts[spot.block()], index as u32)
        };
        let next = self.blocks.spots.iter().enumerate().map(link).collect();
        (firsts, next)
    }
}

impl Blocks for LinkedBlocks<'_> {
    fn blocks(&self) -> &[(Voxel, u64)] {
        &self.blocks.blocks
    }

    fn points(&self) -> &[Point] {
        self.points
    }

    fn num_old(&self) -> usize {
        0
    }

    fn indices(&self, block: usize) -> impl Iterator<Item = usize> {
        let (firsts, next) = self.links.get_or_init(|| self.linked());
        chain(next, firsts[block]).map(|index| index as usize)
    }
}

/// The end of a chain.
pub(crate) const END: u32 = u32::MAX;

/// Return an index, the next one, the one next to that and so on.
#[inline]
pub(crate) fn chain(next: &[u32], first: u32) -> impl Iterator<Item = u32> {
    let is_index = |&index: &u32| index != END;
    let following = move |&index: &u32| Some(next[index as usize]).filter(is_index);
    std::iter::successors(Some(first).filter(is_index), following)
}

#[cfg(test)]
mod tests {
    use proptest::{collection::vec, prelude::*};

    use super::*;

    proptest! {
        #[test]
        fn the_blocks_of_a_part_are_those_of_its_points(
            points in vec(([-0.2_f32..0.2, -0.2_f32..0.2, -0.2_f32..0.2], any::<bool>()), 0..99),
            inverse_edge in 2.0..200.0,
        ) {
            let (points, is_inside): (Vec<Point>, Vec<bool>) = points.into_iter().unzip();
            let inside = points.iter().zip(&is_inside).filter(|&(_, &is_inside)| is_inside);
            let part: Vec<Point> = inside.map(|(&point, _)| point).collect();
            let blocks = PointBlocks::new(&points, inverse_edge).part(&is_inside);
            prop_assert_eq!(blocks, PointBlocks::new(&part, inverse_edge));
        }
    }
}
