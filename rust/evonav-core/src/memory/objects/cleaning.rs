//! Clean point clouds.

use std::borrow::Cow;

use crate::{
    geometry::{Aabb, Vec3},
    memory::objects::{
        ObjectMapConfig, cloud::Cloud, dbscan::largest_cluster, point_blocks::PointBlocks,
        voxel_filter::voxel_filter, voxels::bounds,
    },
    sensors::unproject::Point,
};

/// The points of a detection.
#[derive(Debug, Clone)]
pub(crate) struct Patch {
    pub(crate) points: Vec<Point>,
    /// The same by voxel.
    pub(crate) blocks: PointBlocks,
    pub(crate) bounds_m: Aabb,
}

/// Clean a detection's points; `None` if too few are left.
pub(crate) fn clean(points: &[Point], config: &ObjectMapConfig) -> Option<Patch> {
    if points.len() < config.min_points {
        return None;
    }
    let filtered = voxel_filter(points, config.voxel_m);
    let radius_m = config.cluster_radius_m as f32;
    let cluster = match largest_cluster(&filtered, radius_m, config.cluster_min_points) {
        Some(Cow::Owned(cluster)) if cluster.len() >= 5 => cluster,
        _ => filtered,
    };
    let [min_m, max_m] = bounds(&cluster)?.map(|corner| corner.map(f64::from));
    let bounds_m = Aabb { min_m, max_m };
    // A picture on a wall is a plane, but as a set of voxels it has a volume.
    let volume_m3: f64 = bounds_m.size_m().iter().map(|edge| edge.max(config.voxel_m)).product();
    (volume_m3 >= config.min_box_m3).then(|| {
        let blocks = PointBlocks::new(&cluster, 1.0 / config.voxel_m);
        Patch { points: cluster, blocks, bounds_m }
    })
}

/// Reduce an entry's cloud to its largest cluster, if enough points are left.
pub(crate) fn denoise(cloud: &mut Cloud, config: &ObjectMapConfig) {
    let radius_m = config.cluster_radius_m as f32;
    let cluster = largest_cluster(cloud.points(), radius_m, config.cluster_min_points);
    if let Some(cluster) = cluster.filter(|c| (4..cloud.points().len()).contains(&c.len())) {
        *cloud = Cloud::new(&cluster, config.voxel_m, config.overlap_radius_m as f32);
    }
}

/// Return the mean of points; the origin for none.
pub(crate) fn centroid_m(points: &[Point]) -> Vec3 {
    let count = points.len().max(1) as f64;
    [0, 1, 2].map(|i| points.iter().map(|p| f64::from(p[i])).sum::<f64>() / count)
}
