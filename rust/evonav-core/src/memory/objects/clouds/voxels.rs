//! Voxels: which one contains a point, and tables of voxels.

use evonav_simd::Kernel;

use crate::sensors::unproject::Point;

/// Index of a cube of space: `floor(coordinate / edge)` along each axis.
pub type Voxel = [i32; 3];

/// Return the voxel that contains a point; far outside any house the index saturates.
pub fn voxel_of(point: Point, inverse_edge: f64) -> Voxel {
    point.map(|value| floor(f64::from(value) * inverse_edge))
}

/// Return the voxel that contains each point; see [`voxel_of`].
pub(crate) fn voxels_of(points: &[Point], inverse_edge: f64) -> Vec<Voxel> {
    let mut voxels = vec![[0; 3]; points.len()];
    let floors = voxels.as_flattened_mut();
    evonav_simd::compute(Floors { values: points.as_flattened(), inverse_edge, floors });
    voxels
}

struct Floors<'a> {
    values: &'a [f32],
    inverse_edge: f64,
    floors: &'a mut [i32],
}

impl Kernel for Floors<'_> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        for (whole, value) in self.floors.iter_mut().zip(self.values) {
            *whole = floor(f64::from(*value) * self.inverse_edge);
        }
    }
}

/// Return the largest whole number that is not above a value, or the nearest `i32`.
#[inline(always)]
pub(crate) fn floor(value: f64) -> i32 {
    // `f64::floor` is a library call on baseline x86-64, and a conversion checks what it converts.
    // Added to this number, a value is rounded to a whole one, which the lowest bits then show.
    const ROUNDING: f64 = 1.5 * (1_u64 << 52) as f64;
    let value = if value > f64::from(i32::MIN) { value } else { f64::from(i32::MIN) };
    let value = if value < f64::from(i32::MAX) { value } else { f64::from(i32::MAX) };
    let rounded = value + ROUNDING;
    (rounded.to_bits() as i32).wrapping_sub(i32::from(rounded - ROUNDING > value))
}

/// A hash table from voxels to small numbers: linear probing, with keys of 21 bits per axis in one
/// word.
#[derive(Debug, Clone)]
pub(crate) struct VoxelTable {
    /// Keys and values; a free slot has the key `FREE_SLOT`.
    slots: Vec<(u64, u32)>,
    len: usize,
}

const FREE_SLOT: u64 = u64::MAX;

impl VoxelTable {
    pub(crate) fn with_capacity(num: usize) -> Self {
        Self { slots: vec![(FREE_SLOT, 0); (num * 2).next_power_of_two().max(16)], len: 0 }
    }

    pub(crate) fn num_heap_bytes(&self) -> usize {
        self.slots.capacity() * size_of::<(u64, u32)>()
    }

    #[inline]
    pub(crate) fn get(&self, voxel: Voxel) -> Option<u32> {
        let key = key_of(voxel);
        let (found, value) = self.slots[self.slot(key)];
        (found == key).then_some(value)
    }

    /// Return the value of a voxel for writing, and whether it is new: `value` is inserted if there
    /// is none.
    pub(crate) fn entry(&mut self, voxel: Voxel, value: u32) -> (&mut u32, bool) {
        if (self.len + 1) * 2 > self.slots.len() {
            self.grow();
        }
        let key = key_of(voxel);
        let slot = self.slot(key);
        let is_new = self.slots[slot].0 != key;
        if is_new {
            self.slots[slot] = (key, value);
            self.len += 1;
        }
        (&mut self.slots[slot].1, is_new)
    }

    /// Return the slot of a key, or the free slot where it belongs.
    fn slot(&self, key: u64) -> usize {
        let mask = self.slots.len() - 1;
        let mut slot = (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as usize & mask;
        while self.slots[slot].0 != key && self.slots[slot].0 != FREE_SLOT {
            slot = (slot + 1) & mask;
        }
        slot
    }

    fn grow(&mut self) {
        let larger = vec![(FREE_SLOT, 0); self.slots.len() * 2];
        for (key, value) in std::mem::replace(&mut self.slots, larger) {
            if key != FREE_SLOT {
                let slot = self.slot(key);
                self.slots[slot] = (key, value);
            }
        }
    }
}

/// A map from voxels to small numbers: an array if the voxels are close together, otherwise a
/// table.
#[derive(Debug, Clone)]
pub(crate) enum VoxelIndex {
    Dense { corner: Voxel, size: [usize; 3], slots: Vec<u32> },
    Sparse(VoxelTable),
}

const FREE_INDEX: u32 = u32::MAX;
/// Largest number of slots of an array per inserted voxel.
const SLOTS_A_VOXEL: usize = 64;

impl VoxelIndex {
    /// Create a map for about `num` voxels in the box between two, for look-ups at most `margin`
    /// steps beyond it.
    pub(crate) fn between([low, high]: [Voxel; 2], margin: i32, num: usize) -> Self {
        let size =
            [0, 1, 2].map(|i| i64::from(high[i]) - i64::from(low[i]) + 1 + 2 * i64::from(margin));
        let num_slots = size.iter().try_fold(1_i64, |product, &side| product.checked_mul(side));
        match num_slots.and_then(|num| usize::try_from(num).ok()) {
            Some(num_slots) if num_slots <= SLOTS_A_VOXEL * num => Self::Dense {
                corner: low.map(|i| i.saturating_sub(margin)),
                size: size.map(|side| side as usize),
                slots: vec![FREE_INDEX; num_slots],
            },
            _ => Self::Sparse(VoxelTable::with_capacity(num / 4)),
        }
    }

    #[inline]
    pub(crate) fn get(&self, voxel: Voxel) -> Option<u32> {
        self.at(self.slot(voxel), || voxel)
    }

    /// Return the same as [`VoxelIndex::get`] for a voxel whose slot is known.
    #[inline]
    pub(crate) fn at(&self, slot: usize, voxel: impl FnOnce() -> Voxel) -> Option<u32> {
        match self {
            Self::Dense { slots, .. } => {
                slots.get(slot).copied().filter(|&value| value != FREE_INDEX)
            }
            Self::Sparse(table) => table.get(voxel()),
        }
    }

    /// Return the slot of a voxel in the array; 0 if there is no array.
    #[inline]
    pub(crate) fn slot(&self, voxel: Voxel) -> usize {
        match self {
            Self::Dense { corner, size, .. } => slot_of(voxel, corner, size),
            Self::Sparse(_) => 0,
        }
    }

    /// Return the distance from a voxel's slot to the slot of the voxel a step away.
    #[inline]
    pub(crate) fn stride(&self, step: Voxel) -> isize {
        let Self::Dense { size, .. } = self else { return 0 };
        let [x, y, z] = step.map(|i| i as isize);
        (x * size[1] as isize + y) * size[2] as isize + z
    }

    /// Return the value of a voxel; `value` is inserted if there is none.
    #[inline]
    pub(crate) fn entry(&mut self, voxel: Voxel, value: u32) -> u32 {
        self.entry_at(self.slot(voxel), voxel, value)
    }

    /// Return the same as [`VoxelIndex::entry`] for a voxel whose slot is known.
    #[inline]
    pub(crate) fn entry_at(&mut self, slot: usize, voxel: Voxel, value: u32) -> u32 {
        match self {
            Self::Dense { slots, .. } => {
                let slot = &mut slots[slot];
                if *slot == FREE_INDEX {
                    *slot = value;
                }
                *slot
            }
            Self::Sparse(table) => *table.entry(voxel, value).0,
        }
    }
}

/// Return the slot of a voxel in the array with this corner.
fn slot_of(voxel: Voxel, corner: &Voxel, size: &[usize; 3]) -> usize {
    let [x, y, z] = [0, 1, 2].map(|i| voxel[i].wrapping_sub(corner[i]) as usize);
    (x * size[1] + y) * size[2] + z
}

/// Largest number of voxels from the origin to a voxel that is distinguished.
pub(crate) const HALF: i32 = 1 << 20;

/// Clamp a voxel's index: voxels within a million of the origin (10 km at 0.01 m) are
/// distinguished.
pub(crate) fn clamped(voxel: Voxel) -> Voxel {
    voxel.map(|i| i.clamp(-HALF, HALF - 1))
}

fn key_of(voxel: Voxel) -> u64 {
    let [x, y, z] = clamped(voxel).map(|i| (i + HALF) as u64);
    x << 42 | y << 21 | z
}

/// Return the smallest and the largest corner of the box around points; `None` without points.
pub(crate) fn bounds(points: &[Point]) -> Option<[Point; 2]> {
    let &first = points.first()?;
    Some(evonav_simd::compute(Bounds { points, first }))
}

struct Bounds<'a> {
    points: &'a [Point],
    first: Point,
}

impl Kernel for Bounds<'_> {
    type Output = [Point; 2];

    #[inline(always)]
    fn compute(self) -> [Point; 2] {
        // Coordinates of eight points at a time.
        let (eights, rest) = self.points.as_chunks::<8>();
        let mut low = [self.first; 8];
        let mut high = low;
        for eight in eights {
            let extremes = low.as_flattened_mut().iter_mut().zip(high.as_flattened_mut());
            for ((low, high), &value) in extremes.zip(eight.as_flattened()) {
                (*low, *high) = (low.min(value), high.max(value));
            }
        }
        let corner = |points: &[Point], pick: fn(f32, f32) -> f32| {
            let both = |a: Point, b: &Point| [0, 1, 2].map(|i| pick(a[i], b[i]));
            points.iter().chain(rest).fold(self.first, both)
        };
        [corner(&low, f32::min), corner(&high, f32::max)]
    }
}

#[cfg(test)]
mod tests {
    use proptest::{collection::vec, prelude::*};

    use super::*;

    proptest! {
        #[test]
        fn many_points_at_once_are_as_one_by_one(
            points in vec([-9.0_f32..9.0, -1e-3_f32..1e-3, -1e30_f32..1e30], 0..40),
            edge_m in 0.001..2.0,
        ) {
            let one_by_one: Vec<Voxel> =
                points.iter().map(|&point| voxel_of(point, 1.0 / edge_m)).collect();
            prop_assert_eq!(voxels_of(&points, 1.0 / edge_m), one_by_one);
            let extreme = |axis: usize, pick: fn(f32, f32) -> f32| {
                points.iter().map(|point| point[axis]).reduce(pick)
            };
            let corner = |pick: fn(f32, f32) -> f32| [0, 1, 2].map(|axis| extreme(axis, pick));
            let corners = bounds(&points).map(|corners| corners.map(|corner| corner.map(Some)));
            prop_assert_eq!(corners.unwrap_or_default(), [corner(f32::min), corner(f32::max)]);
        }
    }
}
