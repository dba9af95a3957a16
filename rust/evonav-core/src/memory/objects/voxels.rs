//! Voxels by hash: the voxel filter, and the tables of neighbour queries.

use crate::sensors::unproject::Point;

/// Index of a cube of space: `floor(coordinate / edge)` along each axis.
pub type Voxel = [i32; 3];

/// Return the voxel that contains a point; far outside any house the index saturates.
pub fn voxel_of(point: Point, inverse_edge: f64) -> Voxel {
    point.map(|value| floor(f64::from(value) * inverse_edge))
}

/// Return the largest whole number that is not above a value, or the nearest `i32`.
fn floor(value: f64) -> i32 {
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

    fn num_heap_bytes(&self) -> usize {
        self.slots.capacity() * size_of::<(u64, u32)>()
    }

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

/// A value for each block of 4 x 4 x 4 voxels, since the voxels of a surface lie together.
#[derive(Debug, Clone)]
pub(crate) struct Blocks<T> {
    /// Index in `values` of each block.
    index: VoxelTable,
    values: Vec<T>,
    /// Block that was used last, and the index of its value.
    last: (Voxel, usize),
}

impl<T> Blocks<T> {
    pub(crate) fn with_capacity(num: usize) -> Self {
        let (index, values) = (VoxelTable::with_capacity(num), Vec::with_capacity(num));
        Self { index, values, last: ([i32::MAX; 3], 0) }
    }

    /// Return the number of bytes of the values and of the table that finds them.
    pub(crate) fn num_heap_bytes(&self) -> usize {
        self.index.num_heap_bytes() + self.values.capacity() * size_of::<T>()
    }

    /// Return the value of a voxel's block.
    pub(crate) fn get(&self, voxel: Voxel) -> Option<&T> {
        self.index.get(block_of(voxel)).map(|index| &self.values[index as usize])
    }

    /// Return the value of a voxel's block, which is `new` if there was none, and the voxel's
    /// [`place`].
    pub(crate) fn entry(&mut self, voxel: Voxel, new: T) -> (&mut T, usize) {
        let voxel = clamped(voxel);
        let block = voxel.map(|i| i >> 2);
        if block != self.last.0 {
            let (&mut index, is_new) = self.index.entry(block, self.values.len() as u32);
            if is_new {
                self.values.push(new);
            }
            self.last = (block, index as usize);
        }
        (&mut self.values[self.last.1], place_in_block(voxel))
    }
}

/// Return the position of a voxel in its block: 0 to 63.
pub(crate) fn place(voxel: Voxel) -> usize {
    place_in_block(clamped(voxel))
}

/// Return the same as [`place`] for a voxel within the bounds.
fn place_in_block(voxel: Voxel) -> usize {
    let [x, y, z] = voxel.map(|i| (i & 3) as usize);
    x << 4 | y << 2 | z
}

/// A set of voxels.
#[derive(Debug, Clone)]
pub(crate) struct VoxelSet(Blocks<u64>);

impl VoxelSet {
    pub(crate) fn with_capacity(num_blocks: usize) -> Self {
        Self(Blocks::with_capacity(num_blocks))
    }

    /// Return the number of bytes of the set's table.
    pub(crate) fn num_heap_bytes(&self) -> usize {
        self.0.num_heap_bytes()
    }

    /// Insert a voxel; return whether it is new.
    pub(crate) fn insert(&mut self, voxel: Voxel) -> bool {
        let (bits, place) = self.0.entry(voxel, 0);
        let is_new = *bits >> place & 1 == 0;
        *bits |= 1 << place;
        is_new
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

    pub(crate) fn get(&self, voxel: Voxel) -> Option<u32> {
        self.at(self.slot(voxel), || voxel)
    }

    /// Return the same as [`VoxelIndex::get`] for a voxel whose slot is known.
    pub(crate) fn at(&self, slot: usize, voxel: impl FnOnce() -> Voxel) -> Option<u32> {
        match self {
            Self::Dense { slots, .. } => {
                slots.get(slot).copied().filter(|&value| value != FREE_INDEX)
            }
            Self::Sparse(table) => table.get(voxel()),
        }
    }

    /// Return the slot of a voxel in the array; 0 if there is no array.
    pub(crate) fn slot(&self, voxel: Voxel) -> usize {
        match self {
            Self::Dense { corner, size, .. } => slot_of(voxel, corner, size),
            Self::Sparse(_) => 0,
        }
    }

    /// Return the distance from a voxel's slot to the slot of the voxel a step away.
    pub(crate) fn stride(&self, step: Voxel) -> isize {
        let Self::Dense { size, .. } = self else { return 0 };
        let [x, y, z] = step.map(|i| i as isize);
        (x * size[1] as isize + y) * size[2] as isize + z
    }

    /// Return the value of a voxel; `value` is inserted if there is none.
    pub(crate) fn entry(&mut self, voxel: Voxel, value: u32) -> u32 {
        self.entry_at(self.slot(voxel), voxel, value)
    }

    /// Return the same as [`VoxelIndex::entry`] for a voxel whose slot is known.
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

const HALF: i32 = 1 << 20;

/// Return the block of 4 x 4 x 4 voxels around a voxel.
fn block_of(voxel: Voxel) -> Voxel {
    clamped(voxel).map(|i| i >> 2)
}

/// Clamp a voxel's index: voxels within a million of the origin (10 km at 0.01 m) are
/// distinguished.
fn clamped(voxel: Voxel) -> Voxel {
    voxel.map(|i| i.clamp(-HALF, HALF - 1))
}

fn key_of(voxel: Voxel) -> u64 {
    let [x, y, z] = clamped(voxel).map(|i| (i + HALF) as u64);
    x << 42 | y << 21 | z
}

/// Return the smallest and the largest corner of the box around points; `None` without points.
pub(crate) fn bounds(points: &[Point]) -> Option<[Point; 2]> {
    let &first = points.first()?;
    Some(points.iter().fold([first; 2], |[low, high], point| {
        // `f32::min` looks out for NaN, which takes longer.
        let lower = [0, 1, 2].map(|i| if point[i] < low[i] { point[i] } else { low[i] });
        [lower, [0, 1, 2].map(|i| if point[i] > high[i] { point[i] } else { high[i] })]
    }))
}

/// Reduce points to one per voxel, the mean of the points inside, in the order of the voxels' first
/// points. This is Open3D's `voxel_down_sample` with voxels aligned to the world instead of the
/// cloud.
pub fn voxel_filter(points: &[Point], edge_m: f64) -> Vec<Point> {
    let inverse_edge = 1.0 / edge_m;
    let Some(corners) = bounds(points) else { return Vec::new() };
    let corners = corners.map(|corner| block_of(voxel_of(corner, inverse_edge)));
    let mut index = VoxelIndex::between(corners, 0, points.len());
    // Number of the average of each voxel, by blocks.
    let mut blocks: Vec<[u32; 64]> = Vec::with_capacity(points.len() / 4);
    let mut last = ([i32::MAX; 3], 0);
    let mut averages: Vec<Point> = Vec::with_capacity(points.len());
    // Of the voxels with several points: sum, number of points, and number of the average.
    let mut sums: Vec<([f64; 3], f64, u32)> = Vec::new();
    let mut sum_of: Vec<u32> = Vec::with_capacity(points.len());
    for &point in points {
        let voxel = clamped(voxel_of(point, inverse_edge));
        let block = voxel.map(|i| i >> 2);
        if block != last.0 {
            last = (block, index.entry(block, blocks.len() as u32) as usize);
            if last.1 == blocks.len() {
                blocks.push([FREE_INDEX; 64]);
            }
        }
        let average = &mut blocks[last.1][place_in_block(voxel)];
        if *average == FREE_INDEX {
            *average = averages.len() as u32;
            averages.push(point);
            sum_of.push(FREE_INDEX);
            continue;
        }
        let sum = &mut sum_of[*average as usize];
        if *sum == FREE_INDEX {
            *sum = sums.len() as u32;
            sums.push((averages[*average as usize].map(f64::from), 1.0, *average));
        }
        let (sum, count, _) = &mut sums[*sum as usize];
        for (sum, value) in sum.iter_mut().zip(point) {
            *sum += f64::from(value);
        }
        *count += 1.0;
    }
    for (sum, count, average) in sums {
        averages[average as usize] = sum.map(|value| (value / count) as f32);
    }
    averages
}
