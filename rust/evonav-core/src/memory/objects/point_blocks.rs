//! Points by block of voxels.

use crate::{
    memory::objects::voxels::{Voxel, VoxelIndex, bounds, clamped, voxel_of, voxels_of},
    sensors::unproject::Point,
};

/// Points by block of 4 x 4 x 4 voxels, since those of a surface lie together.
#[derive(Debug, Clone)]
pub(crate) struct PointBlocks {
    /// Blocks with points, in the order of their first ones, and the [`bit`](Spot::bit)s of the
    /// voxels with points.
    pub(crate) blocks: Vec<(Voxel, u64)>,
    /// Voxel of each point.
    pub(crate) spots: Vec<Spot>,
}

/// A voxel of [`PointBlocks`].
#[derive(Debug, Clone, Copy)]
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
        let (mut block, mut number) = ([i32::MAX; 3], 0);
        for voxel in voxels_of(points, inverse_edge).into_iter().map(clamped) {
            let own = voxel.map(|i| i >> 2);
            if own != block {
                block = own;
                number = index.entry(block, blocks.len() as u32);
                if number as usize == blocks.len() {
                    blocks.push((block, 0));
                }
            }
            let spot = Spot(number << 6 | place(voxel) as u32);
            blocks[number as usize].1 |= spot.bit();
            spots.push(spot);
        }
        Self { blocks, spots }
    }
}

/// Return the block of a voxel.
pub(crate) fn block_of(voxel: Voxel) -> Voxel {
    clamped(voxel).map(|i| i >> 2)
}

/// Return the place of a voxel in its block: 0 to 63, z first.
#[inline(always)]
pub(crate) fn place(voxel: Voxel) -> usize {
    let [x, y, z] = voxel.map(|i| (i & 3) as usize);
    x << 4 | y << 2 | z
}

/// Return the bits of a block's voxels that lie in the box between two voxels, these included.
#[inline(always)]
pub(crate) fn bits_between(block: Voxel, [low, high]: [Voxel; 2]) -> u64 {
    // The bits of a block's voxels that have one of the first coordinates along an axis.
    const FIRST: [[u64; 5]; 3] = [
        [0, 0xffff, 0xffff_ffff, 0xffff_ffff_ffff, u64::MAX],
        [0, 0x000f_000f_000f_000f, 0x00ff_00ff_00ff_00ff, 0x0fff_0fff_0fff_0fff, u64::MAX],
        [0, 0x1111_1111_1111_1111, 0x3333_3333_3333_3333, 0x7777_7777_7777_7777, u64::MAX],
    ];
    let mut bits = u64::MAX;
    for axis in 0..3 {
        let corner = block[axis] << 2;
        let before = (low[axis] - corner).clamp(0, 4) as usize;
        let until = (high[axis] + 1 - corner).clamp(0, 4) as usize;
        bits &= FIRST[axis][until] & !FIRST[axis][before];
    }
    bits
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn voxel() -> impl Strategy<Value = Voxel> {
        [-9..9, -9..9, -9..9]
    }

    proptest! {
        #[test]
        fn bits_are_those_of_the_voxels_in_the_box(
            block in [-2..2, -2..2, -2..2], low in voxel(), high in voxel(), step in [0..4, 0..4, 0..4],
        ) {
            let voxel = [0, 1, 2].map(|i| 4 * block[i] + step[i]);
            let is_between = (0..3).all(|i| (low[i]..=high[i]).contains(&voxel[i]));
            let bits = bits_between(block, [low, high]);
            prop_assert_eq!(bits >> place(voxel) & 1 == 1, is_between);
        }
    }
}
