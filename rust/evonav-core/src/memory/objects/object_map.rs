//! The object map: detections are merged into lasting entries as in ConceptGraphs (Gu et al., ICRA
//! 2024), with the parameters of 3D-Mem (Yang et al., CVPR 2025).
//!
//! Entries are beliefs. The map has no access to the simulator's ids, so an object that has moved
//! becomes a new entry and the old entry becomes stale. Agents decide whether to remove it
//! ([`ObjectMap::remove`]).

use crate::{
    Error,
    geometry::{Vec3, distance_2d_m},
    memory::objects::{
        Entry, ObjectMapConfig,
        cleaning::{Patch, centroid_m, clean, denoise, is_within},
        clouds::{cloud::Cloud, density::Density, point_blocks::PointBlocks},
        depth_evidence::{DepthEvidence, EvidenceConfig, depth_evidence},
        entry::Sighting,
        sight_lines::{SightConfig, reach_m, visible_shares},
    },
    sensors::{
        camera::Camera,
        unproject::{MaskedDepth, Point, unproject_masks},
    },
};

/// The detections of one view.
#[derive(Debug, Clone, Copy)]
pub struct DetectedView<'a> {
    /// Depth and masks of the view.
    pub image: MaskedDepth<'a>,
    /// Label of each detection.
    pub labels: &'a [String],
    /// Confidence of each detection, in 0..=1.
    pub confidences: &'a [f32],
    /// Unit feature vectors, row-major, of equal length; empty if the perception has none.
    pub features: &'a [f32],
}

/// The result of an update.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Update {
    /// Entry of each detection; `None` if it was filtered out.
    pub entry_ids: Vec<Option<u64>>,
    /// Ids of the entries that the clean-up removed.
    pub removed: Vec<u64>,
    /// Ids of the entries that the clean-up merged: the removed one, and the one into which it was
    /// merged.
    pub merged: Vec<[u64; 2]>,
}

/// A comparison of a detection with an entry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Share of the detection's points that are near the entry's points.
    pub overlap: f64,
    /// Distance from the detection's centroid to the middle of the entry's box; infinite if the
    /// detection was filtered out.
    pub distance_m: f64,
}

/// The entries of an agent.
#[derive(Debug, Clone)]
pub struct ObjectMap {
    pub(super) config: ObjectMapConfig,
    density: Density,
    pub(super) entries: Vec<Entry>,
    next_id: u64,
    stage: u32,
    num_views: u64,
    views_since_cleanup: u32,
    num_features: Option<usize>,
}

impl ObjectMap {
    /// Create a map without entries, in stage 1.
    ///
    /// # Errors
    /// As [`ObjectMapConfig::check`].
    pub fn new(config: ObjectMapConfig) -> Result<Self, Error> {
        config.check()?;
        let radius_m = config.cluster_radius_m as f32;
        Ok(Self {
            config,
            density: Density::new(config.voxel_m, radius_m, config.cluster_min_points),
            entries: Vec::new(),
            next_id: 1,
            stage: 1,
            num_views: 0,
            views_since_cleanup: 0,
            num_features: None,
        })
    }

    /// Return the entries by ascending id.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Return the entry of an id.
    pub fn entry(&self, id: u64) -> Option<&Entry> {
        self.entries.binary_search_by_key(&id, |entry| entry.id).ok().map(|i| &self.entries[i])
    }

    /// Return the number of views integrated so far.
    pub fn num_views(&self) -> u64 {
        self.num_views
    }

    /// Start a stage: entries stay, and the count of views to the next clean-up starts again.
    pub fn begin_stage(&mut self, stage: u32) {
        self.stage = stage;
        self.views_since_cleanup = 0;
    }

    /// Remove an entry; return whether it existed.
    pub fn remove(&mut self, id: u64) -> bool {
        let num = self.entries.len();
        self.entries.retain(|entry| entry.id != id);
        self.entries.len() < num
    }

    /// Forget all entries; ids start from 1 again.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.next_id = 1;
        self.num_views = 0;
        self.views_since_cleanup = 0;
        self.num_features = None;
    }

    /// Add one view: detections become clouds, each of which joins the entry that it resembles most
    /// or becomes a new one. Every [`ObjectMapConfig::views_per_cleanup`] views there is a
    /// clean-up.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming what does not fit; the map is then unchanged.
    ///
    /// # Complexity
    /// O(pixels + points of the detections x entries whose boxes they touch).
    pub fn update(&mut self, view: &DetectedView<'_>) -> Result<Update, Error> {
        let sightings = self.sightings(view, self.config.max_distance_m)?;
        if view.features.len() >= view.labels.len().max(1) {
            self.num_features = Some(view.features.len() / view.labels.len());
        }
        self.num_views += 1;
        // All detections are matched before any is merged: their order does not matter.
        let num_before = self.entries.len();
        let matches: Vec<Option<usize>> = sightings
            .iter()
            .map(|sighting| self.best_match(sighting.as_ref()?, num_before))
            .collect();
        let mut update = Update::default();
        for (sighting, found) in sightings.into_iter().zip(matches) {
            let entry_id = sighting.map(|sighting| match found {
                Some(index) => {
                    self.entries[index].see(sighting, self.stage, self.num_views);
                    self.entries[index].id
                }
                None => self.insert(sighting),
            });
            update.entry_ids.push(entry_id);
        }
        self.views_since_cleanup += 1;
        if self.views_since_cleanup == self.config.views_per_cleanup {
            self.views_since_cleanup = 0;
            let [x, _, z] = view.image.camera.position_m;
            self.clean_up([x, z], &mut update);
        }
        Ok(update)
    }

    /// Compare the detections of a view with an entry, at any distance; the map does not change.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if there is no such entry, or as [`ObjectMap::update`].
    pub fn compare(&self, id: u64, view: &DetectedView<'_>) -> Result<Vec<Comparison>, Error> {
        let entry = self.known(id)?;
        let centre_m = entry.cloud.bounds_m().centre_m();
        let compare = |sighting: Option<Sighting>| match sighting {
            None => Comparison { overlap: 0.0, distance_m: f64::INFINITY },
            Some(sighting) => Comparison {
                overlap: entry.cloud.overlap_blocks(&sighting.patch.points, &sighting.patch.blocks),
                distance_m: distance_m(centroid_m(&sighting.patch.points), centre_m),
            },
        };
        Ok(self.sightings(view, f64::INFINITY)?.into_iter().map(compare).collect())
    }

    /// Return the share of an object's points that each eye sees, where the points of all entries
    /// and the object's own may block the view.
    ///
    /// # Errors
    /// As [`visible_shares`].
    pub fn visible_shares(
        &self,
        targets: &[Point],
        eyes: &[Vec3],
        config: &SightConfig,
    ) -> Result<Vec<f64>, Error> {
        let reach_m = reach_m(targets, eyes, config);
        let clouds = self.entries.iter().map(|entry| &entry.cloud);
        let near = clouds.filter(|cloud| cloud.bounds_m().intersects(&reach_m));
        visible_shares(near.map(Cloud::points).chain([targets]), targets, eyes, config)
    }

    /// Compare entries with a depth image; the map does not change.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if there is no such entry, or as [`depth_evidence`].
    pub fn depth_evidence(
        &self,
        ids: &[u64],
        camera: &Camera,
        depth_m: &[f32],
        config: &EvidenceConfig,
    ) -> Result<Vec<DepthEvidence>, Error> {
        let entries = ids.iter().map(|&id| self.known(id)).collect::<Result<Vec<_>, _>>()?;
        depth_evidence(entries.iter().map(|entry| entry.cloud.points()), camera, depth_m, config)
    }

    fn known(&self, id: u64) -> Result<&Entry, Error> {
        self.entry(id).ok_or_else(|| Error::invalid("entry_id", id, "the id of an entry"))
    }

    /// Convert detections to clean clouds; `None` for those that are filtered out.
    fn sightings(
        &self,
        view: &DetectedView<'_>,
        max_distance_m: f64,
    ) -> Result<Vec<Option<Sighting>>, Error> {
        let num = view.labels.len();
        let features = self.check_view(view)?;
        let config = &self.config;
        let [x, _, z] = view.image.camera.position_m;
        let clouds = unproject_masks(view.image, num, config.max_points)?;
        let sightings = clouds.into_iter().enumerate().map(|(index, points)| {
            if !is_within(&points, [x, z], max_distance_m) {
                return None;
            }
            let patch = clean(&points, config, &self.density)?;
            let [centre_x, _, centre_z] = patch.bounds_m.centre_m();
            let is_near = distance_2d_m([x, z], [centre_x, centre_z]) <= max_distance_m;
            is_near.then(|| Sighting {
                label: view.labels[index].clone(),
                confidence: view.confidences[index],
                feature: features.map(|n| view.features[index * n..(index + 1) * n].to_vec()),
                patch,
            })
        });
        Ok(sightings.collect())
    }

    /// Check a view; return the length of its features, if it has features.
    fn check_view(&self, view: &DetectedView<'_>) -> Result<Option<usize>, Error> {
        let num = view.labels.len();
        Error::require("confidences", view.confidences.len(), "one a label", |n| n == num)?;
        for &value in view.confidences {
            Error::require("confidences", value, "in 0..=1", |v| (0.0..=1.0).contains(&v))?;
        }
        if view.features.is_empty() {
            return Ok(None);
        }
        let len = view.features.len();
        Error::require("features", len, "rows of one length, one a label", |n| {
            num > 0 && n.is_multiple_of(num)
        })?;
        for &value in view.features {
            Error::require("features", value, "finite", f32::is_finite)?;
        }
        if let Some(before) = self.num_features {
            Error::require("features", len / num, "as long as before", |n| n == before)?;
        }
        Ok(Some(len / num))
    }

    /// Return the entry, among the first `num`, that resembles a sighting most, if the similarity
    /// exceeds the threshold.
    fn best_match(&self, sighting: &Sighting, num: usize) -> Option<usize> {
        let Patch { points, blocks, bounds_m, .. } = &sighting.patch;
        let threshold = self.config.match_threshold;
        let visual = |entry: &Entry| {
            self.config.visual_weight
                * entry.similarity(&sighting.label, sighting.feature.as_deref())
        };
        // For all other entries, even complete overlap would not exceed the threshold.
        let candidates: Vec<(usize, f64)> = self.entries[..num]
            .iter()
            .enumerate()
            .filter(|(_, entry)| entry.is_beside(bounds_m, &self.config))
            .map(|(index, entry)| (index, visual(entry)))
            .filter(|&(_, visual)| visual + 1.0 > threshold)
            .collect();
        // With a single candidate, as in most cases, it only matters whether the threshold is
        // exceeded.
        if let [(index, visual)] = candidates[..] {
            let is_enough = |overlap| visual + overlap > threshold;
            let cloud = &self.entries[index].cloud;
            return cloud.overlaps(points, blocks, is_enough).then_some(index);
        }
        let mut best = (threshold, None);
        for (index, visual) in candidates {
            if visual + 1.0 > best.0 {
                let similarity = visual + self.entries[index].cloud.overlap_blocks(points, blocks);
                if similarity > best.0 {
                    best = (similarity, Some(index));
                }
            }
        }
        best.1
    }

    fn insert(&mut self, sighting: Sighting) -> u64 {
        let id = self.next_id;
        self.next_id += 1;
        self.entries.push(Entry::new(id, sighting, self.stage, self.num_views, &self.config));
        id
    }

    fn clean_up(&mut self, agent_m: [f64; 2], update: &mut Update) {
        let config = self.config;
        // Entries that were not seen since the last clean-up have not changed.
        for entry in self.entries.iter_mut().filter(|entry| entry.has_grown) {
            denoise(&mut entry.cloud, &config, &self.density);
        }
        self.entries.retain(|entry| {
            let [x, _, z] = entry.cloud.bounds_m().centre_m();
            let keep = entry.num_detections >= config.min_detections
                || distance_2d_m([x, z], agent_m) <= config.max_distance_m;
            if !keep {
                update.removed.push(entry.id);
            }
            keep
        });
        self.merge_alike(update);
        for entry in &mut self.entries {
            (entry.is_changed, entry.has_grown) = (false, false);
        }
        for id in &mut update.entry_ids {
            *id = id.filter(|id| !update.removed.contains(id)).map(|id| {
                update.merged.iter().fold(id, |id, pair| if pair[0] == id { pair[1] } else { id })
            });
        }
    }

    /// Merge entries of which one lies in the other, those with the largest overlap first.
    fn merge_alike(&mut self, update: &mut Update) {
        let config = self.config;
        let mut pairs = Vec::new();
        for (i, a) in self.entries.iter().enumerate() {
            for (j, b) in self.entries.iter().enumerate() {
                let is_alike =
                    || a.similarity(b.label(), b.feature.as_deref()) > config.merge_similarity;
                // Two entries that have not changed were not merged the last time and need not be
                // compared again.
                let is_new = i != j && (a.is_changed || b.is_changed);
                if is_new && a.is_beside(b.cloud.bounds_m(), &config) && is_alike() {
                    let points = a.cloud.points();
                    let blocks = PointBlocks::new(points, 1.0 / config.voxel_m);
                    if b.cloud.overlaps(points, &blocks, |overlap| overlap > config.merge_overlap) {
                        pairs.push((b.cloud.overlap_blocks(points, &blocks), i, j));
                    }
                }
            }
        }
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut is_gone = vec![false; self.entries.len()];
        for (_, i, j) in pairs {
            if is_gone[i] || is_gone[j] {
                continue;
            }
            // The more confident entry stays; of equals the one with more detections, then the
            // older one.
            let rank = |k: usize| {
                let entry = &self.entries[k];
                (entry.confidence, entry.num_detections, std::cmp::Reverse(k))
            };
            let (staying, gone) = if rank(i) > rank(j) { (i, j) } else { (j, i) };
            is_gone[gone] = true;
            let other = self.entries[gone].clone();
            update.merged.push([other.id, self.entries[staying].id]);
            self.entries[staying].absorb(other);
            denoise(&mut self.entries[staying].cloud, &config, &self.density);
        }
        let mut is_gone = is_gone.into_iter();
        self.entries.retain(|_| !is_gone.next().unwrap_or(false));
    }
}

fn distance_m(a: Vec3, b: Vec3) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}
