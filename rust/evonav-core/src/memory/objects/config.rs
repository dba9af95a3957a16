//! Parameters of the object map.

use crate::Error;

/// Parameters of the object map; the defaults are 3D-Mem's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectMapConfig {
    /// Smallest number of pixels with a depth of a detection.
    pub min_points: usize,
    /// Number of points to which a mask is thinned.
    pub max_points: usize,
    /// Smallest volume of a detection's box; each edge counts as at least a voxel's.
    pub min_box_m3: f64,
    /// Edge length of the voxels by which clouds are thinned.
    pub voxel_m: f64,
    /// Radius of DBSCAN for cleaning clouds.
    pub cluster_radius_m: f64,
    /// Number of neighbours of a core point of DBSCAN.
    pub cluster_min_points: usize,
    /// Largest distance from the agent on the ground plane at which detections and unconfirmed
    /// entries count.
    pub max_distance_m: f64,
    /// Distance below which two points count as the same place.
    pub overlap_radius_m: f64,
    /// Weight of visual similarity relative to overlap; 0 matches by overlap alone.
    pub visual_weight: f64,
    /// Threshold of overlap plus weighted visual similarity above which a detection joins an entry.
    pub match_threshold: f64,
    /// Number of views between two clean-ups; 0 for no clean-ups.
    pub views_per_cleanup: u32,
    /// Number of detections below which a clean-up removes entries that are far from the agent.
    pub min_detections: u32,
    /// Share of one entry's points in another above which a clean-up merges them, if they are
    /// similar.
    pub merge_overlap: f64,
    /// Visual similarity above which a clean-up merges entries that overlap.
    pub merge_similarity: f64,
}

impl Default for ObjectMapConfig {
    fn default() -> Self {
        Self {
            min_points: 16,
            max_points: 5000,
            min_box_m3: 1e-6,
            voxel_m: 0.01,
            cluster_radius_m: 0.1,
            cluster_min_points: 10,
            max_distance_m: 3.5,
            overlap_radius_m: 0.025,
            visual_weight: 1.0,
            match_threshold: 1.2,
            views_per_cleanup: 12,
            min_detections: 2,
            merge_overlap: 0.7,
            merge_similarity: 0.7,
        }
    }
}

impl ObjectMapConfig {
    /// Check every field.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the first field outside its domain.
    pub fn check(&self) -> Result<(), Error> {
        let is_length = |v: f64| (1e-4..=100.0).contains(&v);
        Error::require("voxel_m", self.voxel_m, "0.0001 to 100", is_length)?;
        Error::require("cluster_radius_m", self.cluster_radius_m, "0.0001 to 100", is_length)?;
        Error::require("overlap_radius_m", self.overlap_radius_m, "0.0001 to 100", is_length)?;
        Error::require("max_points", self.max_points, "at least 1", |n| n > 0)?;
        let is_amount = |v: f64| v >= 0.0;
        Error::require("min_box_m3", self.min_box_m3, "at least 0", is_amount)?;
        Error::require("max_distance_m", self.max_distance_m, "at least 0", is_amount)?;
        let is_weight = |v: f64| v.is_finite() && v >= 0.0;
        Error::require("visual_weight", self.visual_weight, "at least 0", is_weight)?;
        Error::require("match_threshold", self.match_threshold, "a number", |v| !v.is_nan())?;
        Error::require("merge_overlap", self.merge_overlap, "a number", |v| !v.is_nan())?;
        Error::require("merge_similarity", self.merge_similarity, "a number", |v| !v.is_nan())
    }
}
