//! Voxels with points, and the voxels beside them.

use crate::memory::objects::clouds::voxels::{Voxel, VoxelIndex};

/// Voxels with points, numbered in the order in which they are entered.
#[derive(Debug)]
pub(crate) struct Cells {
    voxels: Vec<Voxel>,
    index: VoxelIndex,
    /// Slot of each voxel in the index.
    slots: Vec<usize>,
}

/// A step from one cell to another.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Step {
    voxels: Voxel,
    /// Distance in the index.
    stride: isize,
}

impl Cells {
    /// Create a table without cells, for cells in the box between two voxels.
    ///
    /// # Arguments
    /// * `reach` - largest number of voxels along an axis of a [`Step`].
    /// * `num_points` - number of points, of which a cell has about four.
    pub(crate) fn between(corners: [Voxel; 2], reach: i32, num_points: usize) -> Self {
        let num = num_points / 4;
        Self {
            voxels: Vec::with_capacity(num),
            index: VoxelIndex::between(corners, reach, num_points),
            slots: Vec::with_capacity(num),
        }
    }

    /// Return the number of cells.
    pub(crate) fn num(&self) -> usize {
        self.voxels.len()
    }

    /// Return the cell of a voxel, which is new if its number is [`Cells::num`] before.
    #[inline]
    pub(crate) fn enter(&mut self, voxel: Voxel) -> usize {
        let slot = self.index.slot(voxel);
        let cell = self.index.entry_at(slot, voxel, self.voxels.len() as u32) as usize;
        if cell == self.voxels.len() {
            self.voxels.push(voxel);
            self.slots.push(slot);
        }
        cell
    }

    /// Return a step of some voxels.
    pub(crate) fn step(&self, voxels: Voxel) -> Step {
        Step { voxels, stride: self.index.stride(voxels) }
    }

    /// Return the cell that is a step away, if it has points.
    #[inline]
    pub(crate) fn beside(&self, cell: usize, step: Step) -> Option<usize> {
        let beside = || [0, 1, 2].map(|i| self.voxels[cell][i].saturating_add(step.voxels[i]));
        let slot = self.slots[cell].wrapping_add_signed(step.stride);
        self.index.at(slot, beside).map(|other| other as usize)
    }
}

/// Return the steps to other voxels within a distance along each axis, the shortest first.
pub(crate) fn steps_within(reach: i32) -> Vec<Voxel> {
    let side = 2 * reach + 1;
    let step = |i: i32| [i / (side * side), i / side % side, i % side].map(|i| i - reach);
    let mut steps: Vec<Voxel> =
        (0..side.pow(3)).map(step).filter(|&step| step != [0, 0, 0]).collect();
    steps.sort_by_key(|step| step.iter().map(|i| i * i).sum::<i32>());
    steps
}
