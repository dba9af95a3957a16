//! The object map: what was detected, gathered into lasting entries in the way of ConceptGraphs
//! (Gu et al., ICRA 2024) with the parameters of 3D-Mem (Yang et al., CVPR 2025).
//!
//! Entries are beliefs. Nothing here knows a simulator's id, so an object that has moved becomes a
//! new entry and the old one goes stale; taking it out is an agent's decision ([`ObjectMap::remove`]).

use crate::{
    Error,
    geometry::{Vec3, distance_2d_m},
    memory::objects::{
        Entry, ObjectMapConfig,
        cleaning::{centroid_m, clean, denoise},
        cloud::Cloud,
        entry::Sighting,
        sight_lines::{SightConfig, reach_m, visible_shares},
    },
    sensors::unproject::{MaskedDepth, Point, unproject_masks},
};

/// One view's detections.
#[derive(Debug, Clone, Copy)]
pub struct DetectedView<'a> {
    /// Depth and masks.
    pub image: MaskedDepth<'a>,
    /// A word a detection.
    pub labels: &'a [String],
    /// A number in 0..=1 a detection.
    pub confidences: &'a [f32],
    /// Unit feature vectors, row-major, of equal length; empty if the perception has none.
    pub features: &'a [f32],
}

/// What an update did.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Update {
    /// Entry of each detection; `None` if it was filtered out.
    pub entry_ids: Vec<Option<u64>>,
    /// Entries that the clean-up dropped.
    pub removed: Vec<u64>,
    /// Entries that the clean-up merged: the one that is gone, and the one that it became.
    pub merged: Vec<[u64; 2]>,
}

/// How a detection of the present compares with an entry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Part of the detection's points that lie by the entry's.
    pub overlap: f64,
    /// From the detection's centroid to the middle of the entry's box; infinite if it was filtered out.
    pub distance_m: f64,
}

/// The entries of an agent.
#[derive(Debug, Clone)]
pub struct ObjectMap {
    config: ObjectMapConfig,
    entries: Vec<Entry>,
    next_id: u64,
    stage: u32,
    num_views: u64,
    views_since_cleanup: u32,
    num_features: Option<usize>,
}

impl ObjectMap {
    /// Return a map without entries, in stage 1.
    ///
    /// # Errors
    /// As [`ObjectMapConfig::check`].
    pub fn new(config: ObjectMapConfig) -> Result<Self, Error> {
        config.check()?;
        Ok(Self {
            config,
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

    /// Return the views integrated so far.
    pub fn num_views(&self) -> u64 {
        self.num_views
    }

    /// Start a stage: entries stay, the count of views to the next clean-up starts over.
    pub fn begin_stage(&mut self, stage: u32) {
        self.stage = stage;
        self.views_since_cleanup = 0;
    }

    /// Take an entry out; whether there was one.
    pub fn remove(&mut self, id: u64) -> bool {
        let num = self.entries.len();
        self.entries.retain(|entry| entry.id != id);
        self.entries.len() < num
    }

    /// Forget all entries; the map is as new, ids included.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.next_id = 1;
        self.num_views = 0;
        self.views_since_cleanup = 0;
        self.num_features = None;
    }

    /// Take over one view: detections become clouds, each joins the entry that it resembles most or
    /// becomes a new one; every [`ObjectMapConfig::views_per_cleanup`] views, a clean-up.
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

    /// Compare the detections of a view with an entry; nothing changes. How far away a detection is
    /// does not matter here.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if there is no such entry, or as [`ObjectMap::update`].
    pub fn compare(&self, id: u64, view: &DetectedView<'_>) -> Result<Vec<Comparison>, Error> {
        let entry =
            self.entry(id).ok_or_else(|| Error::invalid("entry_id", id, "the id of an entry"))?;
        let centre_m = entry.cloud.bounds_m().centre_m();
        let compare = |sighting: Option<Sighting>| match sighting {
            None => Comparison { overlap: 0.0, distance_m: f64::INFINITY },
            Some(sighting) => Comparison {
                overlap: entry.cloud.overlap(&sighting.points),
                distance_m: distance_m(centroid_m(&sighting.points), centre_m),
            },
        };
        Ok(self.sightings(view, f64::INFINITY)?.into_iter().map(compare).collect())
    }

    /// Return the share of an object's points that each eye sees past the points of all entries and
    /// the object's own.
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

    /// Return the detections as clean clouds, `None` where one is filtered out.
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
            let (points, bounds_m) = clean(&points, config)?;
            let [centre_x, _, centre_z] = bounds_m.centre_m();
            let is_near = distance_2d_m([x, z], [centre_x, centre_z]) <= max_distance_m;
            is_near.then(|| Sighting {
                label: view.labels[index].clone(),
                confidence: view.confidences[index],
                feature: features.map(|n| view.features[index * n..(index + 1) * n].to_vec()),
                points,
                bounds_m,
            })
        });
        Ok(sightings.collect())
    }

    /// Return the length of a feature, if there are features.
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

    /// Return the entry, among the first `num`, that resembles a sighting most, if it does enough.
    fn best_match(&self, sighting: &Sighting, num: usize) -> Option<usize> {
        let threshold = self.config.match_threshold;
        let visual = |entry: &Entry| {
            self.config.visual_weight
                * entry.similarity(&sighting.label, sighting.feature.as_deref())
        };
        // Even lying wholly inside any other entry could not lift it over the threshold.
        let candidates: Vec<(usize, f64)> = self.entries[..num]
            .iter()
            .enumerate()
            .filter(|(_, entry)| entry.is_beside(&sighting.bounds_m, &self.config))
            .map(|(index, entry)| (index, visual(entry)))
            .filter(|&(_, visual)| visual + 1.0 > threshold)
            .collect();
        // With one candidate, as mostly, it only matters whether it resembles it enough.
        if let [(index, visual)] = candidates[..] {
            let is_enough = |overlap| visual + overlap > threshold;
            let cloud = &self.entries[index].cloud;
            return cloud.overlaps(&sighting.points, is_enough).then_some(index);
        }
        let mut best = (threshold, None);
        for (index, visual) in candidates {
            if visual + 1.0 > best.0 {
                let similarity = visual + self.entries[index].cloud.overlap(&sighting.points);
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
        // What was not seen since the last clean-up is as that one left it.
        for entry in self.entries.iter_mut().filter(|entry| entry.has_grown) {
            denoise(&mut entry.cloud, &config);
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

    /// Merge entries of which one lies in the other, those that do so most first.
    fn merge_alike(&mut self, update: &mut Update) {
        let config = self.config;
        let mut pairs = Vec::new();
        for (i, a) in self.entries.iter().enumerate() {
            for (j, b) in self.entries.iter().enumerate() {
                let is_alike =
                    || a.similarity(b.label(), b.feature.as_deref()) > config.merge_similarity;
                // Two that have not changed were not to be merged the last time, nor are they now.
                let is_new = i != j && (a.is_changed || b.is_changed);
                if is_new && a.is_beside(b.cloud.bounds_m(), &config) && is_alike() {
                    let points = a.cloud.points();
                    if b.cloud.overlaps(points, |overlap| overlap > config.merge_overlap) {
                        pairs.push((b.cloud.overlap(points), i, j));
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
            // The surer one stays; of equal ones the more often seen, then the older.
            let rank = |k: usize| {
                let entry = &self.entries[k];
                (entry.confidence, entry.num_detections, std::cmp::Reverse(k))
            };
            let (kept, gone) = if rank(i) > rank(j) { (i, j) } else { (j, i) };
            is_gone[gone] = true;
            let other = self.entries[gone].clone();
            update.merged.push([other.id, self.entries[kept].id]);
            self.entries[kept].absorb(other);
            denoise(&mut self.entries[kept].cloud, &config);
        }
        let mut is_gone = is_gone.into_iter();
        self.entries.retain(|_| !is_gone.next().unwrap_or(false));
    }
}

fn distance_m(a: Vec3, b: Vec3) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}
