//! Find the largest density cluster of a cloud, most often without looking at its points.

use crate::memory::objects::clouds::{
    block_grid::{BlockGrid, corners},
    blocks::Blocks,
    dbscan::{NOISE, dbscan, distance2},
    density::Density,
};

/// A cluster of a cloud's points.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Cluster {
    /// All points.
    Whole,
    /// Some of them.
    Part {
        is_inside: Vec<bool>,
        /// Whether the others are noise. The cluster is one without them, too.
        is_only: bool,
    },
}

impl Cluster {
    /// Return the points with the most frequent label (the smallest of equals) but [`NOISE`].
    fn of_labels(labels: &[i32]) -> Option<Self> {
        let num = labels.iter().max().map_or(0, |&last| (last + 1) as usize);
        let mut sizes = vec![0_usize; num];
        let inside = labels.iter().filter(|&&label| label != NOISE);
        inside.for_each(|&label| sizes[label as usize] += 1);
        let largest = (0..num).max_by_key(|&i| (sizes[i], std::cmp::Reverse(i)))?;
        if sizes[largest] == labels.len() {
            return Some(Self::Whole);
        }
        let is_inside = labels.iter().map(|&label| label == largest as i32).collect();
        Some(Self::Part { is_inside, is_only: num == 1 })
    }

    /// Return all of `num` points but some that are noise.
    fn without(noise: &[usize], num: usize) -> Option<Self> {
        if noise.is_empty() {
            return Some(Self::Whole);
        }
        let mut is_inside = vec![true; num];
        noise.iter().for_each(|&index| is_inside[index] = false);
        (noise.len() < num).then_some(Self::Part { is_inside, is_only: true })
    }
}

/// Return the largest cluster (the first of equals) that [`dbscan`] finds; `None` if all points are
/// noise.
///
/// # Complexity
/// O(blocks) for most objects.
pub(crate) fn largest_cluster(cloud: &impl Blocks, density: &Density) -> Option<Cluster> {
    let (blocks, points) = (cloud.blocks(), cloud.points());
    // Of blocks with few points, too few are dense to decide.
    let is_sparse = 2 * points.len() < blocks.len() * density.min_points;
    if (cloud.num_old() > 0 || !is_sparse) && density.is_fine {
        let grid = corners(blocks).map(|corners| BlockGrid::new(density, blocks, corners));
        let search = grid.map(|grid| Search { cloud, grid, density });
        if let Some(noise) = search.and_then(|search| search.noise_around_one_cluster()) {
            return Cluster::without(&noise, points.len());
        }
    }
    Cluster::of_labels(&dbscan(points, density.radius_m, density.min_points))
}

/// A search for noise around a cluster.
struct Search<'a, B> {
    cloud: &'a B,
    grid: BlockGrid<'a>,
    density: &'a Density,
}

/// A point without points of dense blocks within the radius.
struct Lone {
    index: usize,
    /// Index and block of the points within the radius, itself included.
    neighbours: Vec<[usize; 2]>,
}

/// Largest number of lone points that are looked at.
const MAX_LONE: usize = 40;

impl<B: Blocks> Search<'_, B> {
    /// Return the indices of the noise if all other points surely are one cluster; `None` if that
    /// is not so, or not seen here.
    fn noise_around_one_cluster(&self) -> Option<Vec<usize>> {
        let mut lone = Vec::new();
        for block in self.grid.loose() {
            lone.extend(self.lone(block));
            if lone.len() > MAX_LONE {
                return None;
            }
        }
        let num_old = self.cloud.num_old();
        let is_old =
            |block: usize| num_old > 0 && self.cloud.indices(block).any(|index| index < num_old);
        let are_joined = |a: usize, b: usize| {
            self.cloud.indices(a).any(|index| self.near(index, b).next().is_some())
        };
        let is_connected = self.grid.is_connected(is_old, are_joined);
        if is_connected { self.noise_of(lone) } else { None }
    }

    /// Return the lone points of a block that are not old.
    fn lone(&self, block: usize) -> Vec<Lone> {
        let num_old = self.cloud.num_old();
        let new = self.cloud.indices(block).take_while(|&index| index >= num_old);
        let own = || self.cloud.indices(block).map(|other| [other, block]).collect();
        let mut lone: Vec<Lone> = new.map(|index| Lone { index, neighbours: own() }).collect();
        for other in self.grid.around(block) {
            if self.grid.is_dense(other) {
                lone.retain(|point| self.near(point.index, other).next().is_none());
            } else {
                for point in &mut lone {
                    let near = self.near(point.index, other).map(|near| [near, other]);
                    point.neighbours.extend(near);
                }
            }
            if lone.is_empty() {
                break;
            }
        }
        lone
    }

    /// Return those of the lone points that are noise if all others are in one cluster; `None` if
    /// some are in a second one.
    fn noise_of(&self, mut lone: Vec<Lone>) -> Option<Vec<usize>> {
        lone.sort_unstable_by_key(|point| point.index);
        let min_points = self.density.min_points;
        let mut is_inside = vec![false; lone.len()];
        loop {
            let place_of = |index| lone.binary_search_by_key(&index, |point| point.index);
            let is_core_inside = |&[index, block]: &[usize; 2]| match place_of(index) {
                Ok(place) => is_inside[place] && lone[place].neighbours.len() >= min_points,
                Err(_) => self.is_core(index, block),
            };
            let joins = |&place: &usize| {
                !is_inside[place] && lone[place].neighbours.iter().any(is_core_inside)
            };
            let joining: Vec<usize> = (0..lone.len()).filter(joins).collect();
            if joining.is_empty() {
                break;
            }
            joining.into_iter().for_each(|place| is_inside[place] = true);
        }
        let outside = || lone.iter().zip(&is_inside).filter(|&(_, &is_inside)| !is_inside);
        let is_noise = |(point, _): (&Lone, &bool)| point.neighbours.len() < min_points;
        outside().all(is_noise).then(|| outside().map(|(point, _)| point.index).collect())
    }

    /// Return the points of a block within the radius of a point.
    fn near(&self, index: usize, block: usize) -> impl Iterator<Item = usize> {
        let (points, radius_m) = (self.cloud.points(), self.density.radius_m);
        let is_near =
            move |&other: &usize| distance2(points[index], points[other]) <= radius_m * radius_m;
        self.cloud.indices(block).filter(is_near)
    }

    /// Return whether a point of a block is a core point.
    fn is_core(&self, index: usize, block: usize) -> bool {
        let own = self.cloud.indices(block);
        let others = self.grid.around(block).flat_map(|other| self.near(index, other));
        let min_points = self.density.min_points;
        own.chain(others).take(min_points).count() == min_points
    }
}

#[cfg(test)]
mod tests {
    use proptest::{collection::vec, prelude::*};

    use super::*;
    use crate::{
        memory::objects::clouds::{cloud::Cloud, point_blocks::PointBlocks},
        sensors::unproject::Point,
    };

    /// Surfaces of some points each, near each other, and single points.
    fn points() -> impl Strategy<Value = Vec<Point>> {
        let patch = (
            [-0.12_f32..0.12, -0.12_f32..0.12, -0.12_f32..0.12],
            [0.0_f32..0.2, 0.0_f32..0.2, 0.0_f32..0.05],
            vec([0.0_f32..1.0, 0.0_f32..1.0, 0.0_f32..1.0], 1..60),
        );
        let single = [-0.4_f32..0.4, -0.4_f32..0.4, -0.4_f32..0.4];
        (vec(patch, 1..5), 1.0_f32..3.0, vec(single, 0..20), 0..64_usize).prop_map(
            |(patches, spread, singles, first)| {
                let of_patch = |(corner, size, places): (Point, Point, Vec<Point>)| {
                    places
                        .into_iter()
                        .map(move |at| [0, 1, 2].map(|i| spread * corner[i] + size[i] * at[i]))
                };
                let mut points: Vec<Point> =
                    singles.into_iter().chain(patches.into_iter().flat_map(of_patch)).collect();
                let num = points.len();
                points.rotate_left(first % num);
                points
            },
        )
    }

    fn are_one_cluster(points: &[Point], radius_m: f32, min_points: usize) -> bool {
        dbscan(points, radius_m, min_points).iter().all(|&label| label == 0)
    }

    /// Return the noise around one cluster, if it is recognised.
    fn noise(cloud: &impl Blocks, density: &Density) -> Option<Vec<usize>> {
        let corners = corners(cloud.blocks()).filter(|_| density.is_fine)?;
        let grid = BlockGrid::new(density, cloud.blocks(), corners);
        Search { cloud, grid, density }.noise_around_one_cluster()
    }

    fn num_noise(cloud: &impl Blocks, density: &Density) -> Option<usize> {
        noise(cloud, density).map(|noise| noise.len())
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..Default::default() })]

        /// The cluster is that of the plain algorithm, at once and after points came to one.
        #[test]
        fn the_largest_cluster_is_that_of_all_points(
            points in points(), more in points(), shift in [-0.2_f32..0.2, -0.2_f32..0.2, -0.2_f32..0.2],
            voxel_m in 0.002..0.03, radius_m in 0.02_f32..0.2, min_points in 1_usize..15,
        ) {
            let density = Density::new(voxel_m, radius_m, min_points);
            let of_labels =
                |points: &[Point]| Cluster::of_labels(&dbscan(points, radius_m, min_points));
            let cluster = of_labels(&points);
            let blocks = PointBlocks::new(&points, 1.0 / voxel_m);
            prop_assert_eq!(&largest_cluster(&blocks.of(&points), &density), &cluster);
            if let Some(noise) = noise(&blocks.of(&points), &density) {
                prop_assert_eq!(&Cluster::without(&noise, points.len()), &cluster);
            }
            if let Some(Cluster::Part { is_inside, is_only: true }) = cluster {
                let inside = points.iter().zip(is_inside).filter(|(_, is_inside)| *is_inside);
                let inside: Vec<Point> = inside.map(|(&point, _)| point).collect();
                prop_assert!(are_one_cluster(&inside, radius_m, min_points));
            }
            let mut cloud = Cloud::new(&points, voxel_m, 0.05);
            if are_one_cluster(cloud.points(), radius_m, min_points) {
                cloud.know_one_cluster();
            }
            let more: Vec<Point> =
                more.into_iter().map(|point| [0, 1, 2].map(|i| point[i] + shift[i])).collect();
            cloud.merge(&more);
            let cluster = of_labels(cloud.points());
            prop_assert_eq!(&largest_cluster(&cloud.blocks(), &density), &cluster);
            if let Some(noise) = noise(&cloud.blocks(), &density) {
                prop_assert_eq!(&Cluster::without(&noise, cloud.points().len()), &cluster);
            }
        }
    }

    /// Return a square of points that are 0.01 m apart.
    fn square(corner: Point, side: usize) -> Vec<Point> {
        let place =
            |i: usize| [corner[0] + 0.01 * (i / side) as f32, corner[1] + 0.01 * (i % side) as f32];
        (0..side * side)
            .map(place)
            .map(|[x, y]| [x + 0.005, y + 0.005, corner[2] + 0.005])
            .collect()
    }

    #[test]
    fn surfaces_are_recognised() {
        let density = Density::new(0.01, 0.1, 10);
        let num_noise =
            |points: &[Point]| num_noise(&PointBlocks::new(points, 100.0).of(points), &density);
        let surface = square([0.0; 3], 30);
        assert_eq!(num_noise(&surface), Some(0));
        // A second surface is joined if it is near; single points belong to it if they are near.
        let beside =
            |step_m: f32| [surface.clone(), square([0.3 + step_m, 0.0, 0.05], 30)].concat();
        assert_eq!(num_noise(&beside(0.05)), Some(0));
        assert_eq!(num_noise(&beside(0.11)), None);
        let with = |x_m: f32| [surface.clone(), vec![[x_m, 0.105, 0.005]]].concat();
        assert_eq!(num_noise(&with(0.39)), Some(0));
        assert_eq!(num_noise(&with(0.40)), Some(1));
    }

    #[test]
    fn old_points_need_no_proof() {
        let density = Density::new(0.01, 0.1, 10);
        // A line of points, 10 in 0.15 m: they are one cluster, but no block is dense.
        let line: Vec<Point> = (0..100).map(|i| [0.015 * i as f32, 0.005, 0.005]).collect();
        let mut cloud = Cloud::new(&line, 0.01, 0.025);
        assert!(are_one_cluster(&line, 0.1, 10) && num_noise(&cloud.blocks(), &density).is_none());
        cloud.know_one_cluster();
        assert_eq!(num_noise(&cloud.blocks(), &density), Some(0));
        // Surfaces at its two ends are connected by it.
        cloud.merge(&square([-0.1, 0.0, 0.0], 20));
        cloud.merge(&square([1.4, 0.0, 0.0], 20));
        assert_eq!(num_noise(&cloud.blocks(), &density), Some(0));
        cloud.merge(&square([3.0, 0.0, 0.0], 20));
        assert_eq!(num_noise(&cloud.blocks(), &density), None);
        // A surface away from old points is a cluster of its own, though it is the only surface.
        let mut cloud = Cloud::new(&line, 0.01, 0.025);
        cloud.know_one_cluster();
        cloud.merge(&square([3.0, 0.0, 0.0], 20));
        assert_eq!(num_noise(&cloud.blocks(), &density), None);
    }
}
