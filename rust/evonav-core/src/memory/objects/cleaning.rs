//! Clean point clouds.

use std::borrow::Cow;

use crate::{
    geometry::{Aabb, Vec3, distance_2d_m},
    memory::objects::{
        ObjectMapConfig,
        clouds::{
            cloud::Cloud, dbscan::largest_cluster, one_cluster::Density, point_blocks::PointBlocks,
            voxel_filter::one_a_voxel, voxels::bounds,
        },
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
    /// Whether the points are known to be one cluster.
    pub(crate) is_one_cluster: bool,
}

/// Return whether a box around some of the points can have its middle within a distance of a place,
/// `[x, z]`, on the ground plane.
pub(crate) fn is_within(points: &[Point], place_m: [f64; 2], max_distance_m: f64) -> bool {
    bounds(points).is_some_and(|[low, high]| {
        let nearest_m =
            [0, 1].map(|i| place_m[i].clamp(f64::from(low[2 * i]), f64::from(high[2 * i])));
        distance_2d_m(place_m, nearest_m) <= max_distance_m
    })
}

/// Clean a detection's points; `None` if too few are left.
pub(crate) fn clean(
    points: &[Point],
    config: &ObjectMapConfig,
    density: &Density,
) -> Option<Patch> {
    if points.len() < config.min_points {
        return None;
    }
    let (mut points, mut blocks) = one_a_voxel(points, config.voxel_m);
    let mut is_one_cluster = density.is_one_cluster(&blocks.of(&points));
    if !is_one_cluster {
        match largest_cluster(&points, config.cluster_radius_m as f32, config.cluster_min_points) {
            Some(Cow::Borrowed(_)) => is_one_cluster = true,
            Some(Cow::Owned(cluster)) if cluster.len() >= 5 => {
                blocks = PointBlocks::new(&cluster, 1.0 / config.voxel_m);
                points = cluster;
            }
            _ => {}
        }
    }
    let [min_m, max_m] = bounds(&points)?.map(|corner| corner.map(f64::from));
    let bounds_m = Aabb { min_m, max_m };
    // A picture on a wall is a plane, but as a set of voxels it has a volume.
    let volume_m3: f64 = bounds_m.size_m().iter().map(|edge| edge.max(config.voxel_m)).product();
    (volume_m3 >= config.min_box_m3).then_some(Patch { points, blocks, bounds_m, is_one_cluster })
}

/// Reduce an entry's cloud to its largest cluster, if enough points are left.
pub(crate) fn denoise(cloud: &mut Cloud, config: &ObjectMapConfig, density: &Density) {
    if !density.is_one_cluster(&cloud.blocks()) {
        let (radius_m, min_points) = (config.cluster_radius_m as f32, config.cluster_min_points);
        match largest_cluster(cloud.points(), radius_m, min_points) {
            Some(Cow::Borrowed(_)) => {}
            Some(Cow::Owned(cluster)) if cluster.len() >= 4 => {
                *cloud = Cloud::new(&cluster, config.voxel_m, config.overlap_radius_m as f32);
                return;
            }
            _ => return,
        }
    }
    cloud.know_one_cluster();
}

/// Return the mean of points; the origin for none.
pub(crate) fn centroid_m(points: &[Point]) -> Vec3 {
    let count = points.len().max(1) as f64;
    [0, 1, 2].map(|i| points.iter().map(|p| f64::from(p[i])).sum::<f64>() / count)
}
