//! Points of masks, voxels, clusters and overlap, each against a plain quadratic twin.

use std::collections::BTreeMap;

use evonav_core::{
    memory::objects::clouds::{cloud::Cloud, dbscan::dbscan, voxel_filter::voxel_filter},
    sensors::unproject::{MaskedDepth, Point},
};
use proptest::{collection::vec, prelude::*};

pub fn distance2(a: Point, b: Point) -> f32 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    x * x + y * y + z * z
}

pub fn unproject_naive(image: MaskedDepth<'_>, num: usize, max_points: usize) -> Vec<Vec<Point>> {
    let masks = image.masks.pixels();
    let of_mask = |mask: usize| {
        let pixels: Vec<usize> = (0..masks.len())
            .filter(|&i| masks[i] == mask as i32)
            .filter(|&i| image.depth_m[i].is_finite() && image.depth_m[i] > 0.0)
            .collect();
        let stride = pixels.len().div_ceil(max_points).max(1);
        let point = |&i: &usize| {
            let (row, col) = (i / image.camera.width_px, i % image.camera.width_px);
            let uv = [col as f64 + 0.5, row as f64 + 0.5];
            image.camera.unproject(uv, f64::from(image.depth_m[i])).map(|v| v as f32)
        };
        pixels.iter().step_by(stride).map(point).collect()
    };
    (0..num).map(of_mask).collect()
}

pub fn voxel_filter_naive(points: &[Point], edge_m: f64) -> Vec<Point> {
    let voxel = |p: &Point| p.map(|v| (f64::from(v) / edge_m).floor() as i64);
    let mut groups: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    points.iter().enumerate().for_each(|(i, p)| groups.entry(voxel(p)).or_default().push(i));
    let mut groups: Vec<Vec<usize>> = groups.into_values().collect();
    groups.sort();
    let mean = |group: &Vec<usize>| {
        let sum = |axis: usize| group.iter().map(|&i| f64::from(points[i][axis])).sum::<f64>();
        [0, 1, 2].map(|axis| (sum(axis) / group.len() as f64) as f32)
    };
    groups.iter().map(mean).collect()
}

/// The textbook: grow clusters from core points in the order of the points.
pub fn dbscan_naive(points: &[Point], radius: f32, min_points: usize) -> Vec<i32> {
    let near = |i: usize| -> Vec<usize> {
        (0..points.len()).filter(|&j| distance2(points[i], points[j]) <= radius * radius).collect()
    };
    let mut labels = vec![-1; points.len()];
    let mut num = 0;
    for start in 0..points.len() {
        if labels[start] != -1 || near(start).len() < min_points {
            continue;
        }
        labels[start] = num;
        let mut queue = vec![start];
        while let Some(i) = queue.pop() {
            let around = near(i);
            if around.len() >= min_points {
                for j in around {
                    if labels[j] == -1 {
                        labels[j] = num;
                        queue.push(j);
                    }
                }
            }
        }
        num += 1;
    }
    labels
}

pub fn first_of_voxels(points: &[Point], edge_m: f64) -> Vec<Point> {
    let mut seen = std::collections::BTreeSet::new();
    let voxel = |p: &Point| p.map(|v| (f64::from(v) / edge_m).floor() as i64);
    points.iter().filter(|p| seen.insert(voxel(p))).copied().collect()
}

pub fn overlap_naive(points: &[Point], others: &[Point], radius: f32) -> f64 {
    let has_near = |p: &&Point| others.iter().any(|q| distance2(**p, *q) < radius * radius);
    points.iter().filter(has_near).count() as f64 / points.len().max(1) as f64
}

fn point() -> impl Strategy<Value = Point> {
    [-0.4_f32..0.4, -0.4_f32..0.4, -0.4_f32..0.4]
}

/// Points in clumps, so that there are clusters, borders and noise.
fn points() -> impl Strategy<Value = Vec<Point>> {
    let clump = (point(), vec([-0.12_f32..0.12, -0.12_f32..0.12, -0.12_f32..0.12], 1..25));
    vec(clump, 0..6).prop_map(|clumps| {
        let around = |(centre, offsets): (Point, Vec<Point>)| {
            offsets.into_iter().map(move |o| [0, 1, 2].map(|i| centre[i] + o[i]))
        };
        clumps.into_iter().flat_map(around).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]

    #[test]
    fn clusters_are_those_of_the_textbook(
        points in points(),
        radius in 0.03_f32..0.2,
        min_points in 1_usize..12,
    ) {
        prop_assert_eq!(dbscan(&points, radius, min_points), dbscan_naive(&points, radius, min_points));
    }

    #[test]
    fn the_voxel_filter_averages_what_shares_a_voxel(points in points(), edge_m in 0.01..0.3) {
        prop_assert_eq!(voxel_filter(&points, edge_m), voxel_filter_naive(&points, edge_m));
    }

    #[test]
    fn overlap_counts_the_points_with_a_near_one(
        points in points(), others in points(), more in points(), radius in 0.01_f32..0.2,
        voxel_m in 0.01..0.1,
    ) {
        let mut cloud = Cloud::new(&others, voxel_m, radius);
        cloud.merge(&more);
        let kept = cloud.points().to_vec();
        prop_assert_eq!(&kept, &first_of_voxels(&[others, more].concat(), voxel_m));
        prop_assert_eq!(cloud.overlap(&points), overlap_naive(&points, &kept, radius));
    }
}
