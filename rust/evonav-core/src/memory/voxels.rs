//! Cubes of space by hash: the voxel filter and the tables behind neighbour queries.

use crate::sensors::unproject::Point;

/// Index of a cube of space, `floor(coordinate / edge)` an axis.
pub type Voxel = [i32; 3];

/// The voxel that holds a point; far outside any house the index saturates.
pub fn voxel_of(point: Point, inverse_edge: f64) -> Voxel {
    point.map(|value| {
        let scaled = f64::from(value) * inverse_edge;
        // `floor` is a library call on baseline x86-64.
        let truncated = scaled as i32;
        truncated.saturating_sub(i32::from(f64::from(truncated) > scaled))
    })
}

/// A hash table from voxels to small numbers: linear probing, keys of 21 bits an axis in one word.
#[derive(Debug, Clone)]
pub(crate) struct VoxelTable {
    /// Key and value; a free slot has `FREE_SLOT` as its key.
    slots: Vec<(u64, u32)>,
    len: usize,
}

const FREE_SLOT: u64 = u64::MAX;

impl VoxelTable {
    pub(crate) fn with_capacity(num: usize) -> Self {
        Self { slots: vec![(FREE_SLOT, 0); (num * 2).next_power_of_two().max(16)], len: 0 }
    }

    pub(crate) fn get(&self, voxel: Voxel) -> Option<u32> {
        let key = key_of(voxel);
        let (found, value) = self.slots[self.slot(key)];
        (found == key).then_some(value)
    }

    /// The value of a voxel, to change; `value` is entered if there is none. Says whether it was entered.
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

    /// Where the key is, or belongs.
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

/// Exact for voxels within a million of the origin (10 km at 0.01 m); beyond, indices clamp.
fn key_of(voxel: Voxel) -> u64 {
    const HALF: i32 = 1 << 20;
    let [x, y, z] = voxel.map(|i| (i.clamp(-HALF, HALF - 1) + HALF) as u64);
    x << 42 | y << 21 | z
}

/// One point a voxel: the mean of those inside, in the order in which voxels are first met
/// (Open3D's `voxel_down_sample` with voxels aligned to the world instead of the cloud).
pub fn voxel_filter(points: &[Point], edge_m: f64) -> Vec<Point> {
    let inverse_edge = 1.0 / edge_m;
    let mut table = VoxelTable::with_capacity(points.len() / 2);
    let mut sums: Vec<([f64; 3], f64)> = Vec::new();
    // Neighbouring pixels often share a voxel.
    let mut last = (Voxel::default(), None);
    for &point in points {
        let voxel = voxel_of(point, inverse_edge);
        let index = match last {
            (before, Some(index)) if before == voxel => index,
            _ => {
                let (&mut index, is_new) = table.entry(voxel, sums.len() as u32);
                if is_new {
                    sums.push(([0.0; 3], 0.0));
                }
                index
            }
        };
        last = (voxel, Some(index));
        let (sum, count) = &mut sums[index as usize];
        for (sum, value) in sum.iter_mut().zip(point) {
            *sum += f64::from(value);
        }
        *count += 1.0;
    }
    sums.into_iter().map(|(sum, count)| sum.map(|s| (s / count) as f32)).collect()
}
