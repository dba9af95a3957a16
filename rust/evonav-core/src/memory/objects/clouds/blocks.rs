//! Blocks of 4 x 4 x 4 voxels, and cubes of 4 x 4 x 4 blocks.

use crate::{
    memory::objects::clouds::voxels::{Voxel, clamped},
    sensors::unproject::Point,
};

/// The points of a cloud by block of 4 x 4 x 4 voxels. The first of them, the old ones, may be known
/// to be one cluster: more points can only extend it.
pub(crate) trait Blocks {
    /// Return the blocks, and a bit for each voxel with points.
    fn blocks(&self) -> &[(Voxel, u64)];

    /// Return the points.
    fn points(&self) -> &[Point];

    /// Return the number of old points.
    fn num_old(&self) -> usize;

    /// Return the indices of a block's points, descending.
    fn indices(&self, block: usize) -> impl Iterator<Item = usize>;
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

/// Return the cube of a block.
pub(crate) fn cube_of(block: Voxel) -> Voxel {
    block.map(|i| i >> 2)
}

/// Return the block at a place in a cube.
pub(crate) fn block_at(cube: Voxel, place: usize) -> Voxel {
    let steps = [place >> 4, place >> 2 & 3, place & 3];
    [0, 1, 2].map(|i| (cube[i] << 2) + steps[i] as i32)
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
