//! Clean point clouds.

use crate::{
    geometry::{Aabb, Vec3, distance_2d_m},
    memory::objects::{
        ObjectMapConfig,
        clouds::{
            cloud::Cloud,
            density::Density,
            largest_cluster::{Cluster, largest_cluster},
            point_blocks::PointBlocks,
            voxel_filter::one_a_voxel,
            voxels::bounds,
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
    let mut is_one_cluster = false;
    match largest_cluster(&blocks.of(&points), density) {
        Some(Cluster::Whole) => is_one_cluster = true,
        Some(Cluster::Part { is_inside, is_only }) => {
            let cluster = part(&points, &is_inside);
            if cluster.len() >= 5 {
                (points, blocks) = (cluster, blocks.part(&is_inside));
                is_one_cluster = is_only;
            }
        }
        None => {}
    }
    let [min_m, max_m] = bounds(&points)?.map(|corner| corner.map(f64::from));
    let bounds_m = Aabb { min_m, max_m };
    // A picture on a wall is a plane, but as a set of voxels it has a volume.
    let volume_m3: f64 = bounds_m.size_m().iter().map(|edge| edge.max(config.voxel_m)).product();
    (volume_m3 >= config.min_box_m3).then_some(Patch { points, blocks, bounds_m, is_one_cluster })
}

/// Reduce an entry's cloud to its largest cluster, if enough points are left.
pub(crate) fn denoise(cloud: &mut Cloud, config: &ObjectMapConfig, density: &Density) {
    match largest_cluster(&cloud.blocks(), density) {
        Some(Cluster::Whole) => cloud.know_one_cluster(),
        Some(Cluster::Part { is_inside, is_only }) => {
            let cluster = part(cloud.points(), &is_inside);
            if cluster.len() >= 4 {
                *cloud = Cloud::new(&cluster, config.voxel_m, config.overlap_radius_m as f32);
                if is_only {
                    cloud.know_one_cluster();
                }
            }
        }
        None => {}
    }
}

/// Return the points that are inside.
fn part(points: &[Point], is_inside: &[bool]) -> Vec<Point> {
    let inside = points.iter().zip(is_inside).filter(|&(_, &is_inside)| is_inside);
    inside.map(|(&point, _)| point).collect()
}

/// Return the mean of points; the origin for none.
pub(crate) fn centroid_m(points: &[Point]) -> Vec3 {
    let count = points.len().max(1) as f64;
    [0, 1, 2].map(|i| points.iter().map(|p| f64::from(p[i])).sum::<f64>() / count)
}
