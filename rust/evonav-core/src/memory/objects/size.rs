//! The size of an object map in memory.

use std::mem::size_of;

use crate::memory::objects::{Entry, ObjectMap, clouds::cloud::Cloud};

impl ObjectMap {
    /// Return the number of bytes that the map holds: entries, labels, features, points and the
    /// tables that find them, with the room that is kept free for more.
    pub fn num_bytes(&self) -> usize {
        let spare = self.entries.capacity() - self.entries.len();
        size_of::<Self>()
            + spare * size_of::<Entry>()
            + self.entries.iter().map(Entry::num_bytes).sum::<usize>()
    }
}

impl Entry {
    fn num_bytes(&self) -> usize {
        let labels = self.label_counts.capacity() * size_of::<(String, u32)>()
            + self.label_counts.iter().map(|(label, _)| label.capacity()).sum::<usize>();
        let feature = self.feature.as_ref().map_or(0, |f| f.capacity() * size_of::<f32>());
        let cloud = self.cloud.num_bytes() - size_of::<Cloud>();
        size_of::<Self>() + labels + feature + cloud
    }
}
