//! The memory of one object.

use crate::{
    geometry::{Aabb, Vec3},
    memory::objects::{ObjectMapConfig, cleaning::Patch, clouds::cloud::Cloud},
    sensors::unproject::Point,
};

/// A detection that passed the filters.
#[derive(Debug, Clone)]
pub(crate) struct Sighting {
    pub(crate) label: String,
    pub(crate) confidence: f32,
    pub(crate) feature: Option<Vec<f32>>,
    pub(crate) patch: Patch,
}

/// An object entry: detections that appear to be of one object.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Id, ascending from 1.
    pub id: u64,
    /// Number of detections by label, in the order of the labels' first detection.
    pub label_counts: Vec<(String, u32)>,
    /// Number of detections.
    pub num_detections: u32,
    /// Largest confidence of a detection.
    pub confidence: f32,
    /// Unit mean of the detections' features.
    pub feature: Option<Vec<f32>>,
    /// Points of the object.
    pub cloud: Cloud,
    /// Stage of the first detection.
    pub first_seen_stage: u32,
    /// Stage of the last detection.
    pub last_seen_stage: u32,
    /// View of the last detection, counted from 1 since the map began.
    pub last_seen_view: u64,
    /// Whether it was seen or merged since the last clean-up.
    pub(crate) is_changed: bool,
    /// Whether its cloud has got points since the last clean-up.
    pub(crate) has_grown: bool,
}

impl Entry {
    pub(crate) fn new(
        id: u64,
        sighting: Sighting,
        stage: u32,
        view: u64,
        config: &ObjectMapConfig,
    ) -> Self {
        let Patch { points, blocks, is_one_cluster, .. } = &sighting.patch;
        let radius_m = config.overlap_radius_m as f32;
        let mut cloud = Cloud::of_blocks(points, blocks, config.voxel_m, radius_m);
        if *is_one_cluster && cloud.points().len() == points.len() {
            cloud.know_one_cluster();
        }
        Self {
            id,
            label_counts: vec![(sighting.label, 1)],
            num_detections: 1,
            confidence: sighting.confidence,
            feature: sighting.feature,
            cloud,
            first_seen_stage: stage,
            last_seen_stage: stage,
            last_seen_view: view,
            is_changed: true,
            has_grown: true,
        }
    }

    /// Return the label with the most detections, of equals the first.
    pub fn label(&self) -> &str {
        let best = self.label_counts.iter().rev().max_by_key(|(_, count)| *count);
        best.map_or("", |(label, _)| label)
    }

    /// Return the middle of the box around the points.
    pub fn centre_m(&self) -> Vec3 {
        self.cloud.bounds_m().centre_m()
    }

    /// Return the edge lengths of the box around the points.
    pub fn size_m(&self) -> Vec3 {
        self.cloud.bounds_m().size_m()
    }

    /// Return the cosine of the features; if one has no features, 1 for the same label and 0 for
    /// another.
    pub(crate) fn similarity(&self, label: &str, feature: Option<&[f32]>) -> f64 {
        match (&self.feature, feature) {
            (Some(a), Some(b)) => a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum(),
            _ => f64::from(u8::from(self.label() == label)),
        }
    }

    /// Return whether a box touches this entry's box grown by the overlap radius. If it does not,
    /// no points overlap.
    pub(crate) fn is_beside(&self, other_m: &Aabb, config: &ObjectMapConfig) -> bool {
        let mut bounds_m = *self.cloud.bounds_m();
        bounds_m.min_m = bounds_m.min_m.map(|v| v - config.overlap_radius_m);
        bounds_m.max_m = bounds_m.max_m.map(|v| v + config.overlap_radius_m);
        bounds_m.intersects(other_m)
    }

    /// Add a detection.
    pub(crate) fn see(&mut self, sighting: Sighting, stage: u32, view: u64) {
        self.count(vec![(sighting.label, 1)], sighting.feature, 1);
        self.confidence = self.confidence.max(sighting.confidence);
        self.grow(|cloud| cloud.merge_blocks(&sighting.patch.points, &sighting.patch.blocks));
        self.last_seen_stage = stage;
        self.last_seen_view = view;
    }

    /// Merge points into the cloud.
    fn grow(&mut self, merge: impl FnOnce(&mut Cloud)) {
        let num_points = self.cloud.points().len();
        merge(&mut self.cloud);
        self.is_changed = true;
        self.has_grown |= self.cloud.points().len() != num_points;
    }

    /// Remove the points that are to go; return their number.
    pub(crate) fn remove_points(
        &mut self,
        is_gone: impl Fn(Point) -> bool,
        config: &ObjectMapConfig,
    ) -> usize {
        let num_points = self.cloud.points().len();
        let left: Vec<Point> =
            self.cloud.points().iter().copied().filter(|&point| !is_gone(point)).collect();
        if left.len() < num_points {
            self.cloud = Cloud::new(&left, config.voxel_m, config.overlap_radius_m as f32);
            (self.is_changed, self.has_grown) = (true, true);
        }
        num_points - left.len()
    }

    /// Merge another entry into this one; the id stays.
    pub(crate) fn absorb(&mut self, other: Self) {
        self.count(other.label_counts, other.feature, other.num_detections);
        self.confidence = self.confidence.max(other.confidence);
        self.grow(|cloud| cloud.merge(other.cloud.points()));
        self.first_seen_stage = self.first_seen_stage.min(other.first_seen_stage);
        self.last_seen_stage = self.last_seen_stage.max(other.last_seen_stage);
        self.last_seen_view = self.last_seen_view.max(other.last_seen_view);
    }

    /// Add the labels and the mean feature of `num` detections.
    fn count(&mut self, labels: Vec<(String, u32)>, feature: Option<Vec<f32>>, num: u32) {
        for (label, count) in labels {
            match self.label_counts.iter_mut().find(|(known, _)| *known == label) {
                Some((_, known)) => *known += count,
                None => self.label_counts.push((label, count)),
            }
        }
        self.feature = match (self.feature.take(), feature) {
            (Some(a), Some(b)) => Some(weighted_mean(&a, self.num_detections, &b, num)),
            (a, b) => a.or(b),
        };
        self.num_detections += num;
    }
}

/// Return the mean of two vectors, weighted by number of detections and normalised to length 1
/// (unless its length is 0).
fn weighted_mean(a: &[f32], num_a: u32, b: &[f32], num_b: u32) -> Vec<f32> {
    let mix = |(a, b): (&f32, &f32)| a * num_a as f32 + b * num_b as f32;
    let sum: Vec<f32> = a.iter().zip(b).map(mix).collect();
    let length = sum.iter().map(|v| v * v).sum::<f32>().sqrt();
    let scale = if length > 0.0 { 1.0 / length } else { 1.0 };
    sum.into_iter().map(|v| v * scale).collect()
}
