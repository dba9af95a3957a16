//! Parameters of the object map.

use crate::Error;

/// Parameters of the object map; the defaults are 3D-Mem's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectMapConfig {
    /// Fewest pixels with a depth of a detection.
    pub min_points: usize,
    /// A mask is thinned to about this many points.
    pub max_points: usize,
    /// Smallest volume of a detection's box, whose edges count as a voxel's at least.
    pub min_box_m3: f64,
    /// Edge of the voxels that clouds are thinned by.
    pub voxel_m: f64,
    /// DBSCAN's radius for cleaning clouds.
    pub cluster_radius_m: f64,
    /// DBSCAN's neighbours of a core point.
    pub cluster_min_points: usize,
    /// Detections and unconfirmed entries farther from the agent than this, on the ground plane, do not count.
    pub max_distance_m: f64,
    /// Two points nearer than this are the same place.
    pub overlap_radius_m: f64,
    /// What visual similarity counts for beside overlap; 0 matches by overlap alone.
    pub visual_weight: f64,
    /// A detection joins an entry if overlap plus weighted visual similarity exceeds this.
    pub match_threshold: f64,
    /// Views between two clean-ups; 0 for none.
    pub views_per_cleanup: u32,
    /// Entries with fewer detections are dropped at a clean-up if far from the agent.
    pub min_detections: u32,
    /// Entries merge at a clean-up if one lies in the other by more than this part ...
    pub merge_overlap: f64,
    /// ... and they look alike by more than this.
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
