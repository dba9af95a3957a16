//! Estimate how much of an object is visible from a place, by remembered points alone (MSGNav's
//! visibility-based viewpoint decision, arXiv 2511.10376).
//!
//! The scene is the union of the clouds of all entries. Walls are in no entry, so they do not block
//! the view; the original has the same property.

use crate::{
    Error,
    geometry::{Aabb, Vec3},
    memory::objects::clouds::voxels::{Voxel, VoxelIndex},
    sensors::unproject::Point,
};

/// Parameters of sight lines; the defaults are MSGNav's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SightConfig {
    /// Distance of a scene point from a sample of a line below which the line is blocked.
    pub radius_m: f64,
    /// Distance between two samples of a line.
    pub step_m: f64,
    /// Length of the first and the last part of a line, which are not sampled.
    pub margin_m: f64,
    /// Largest number of samples of a line; on longer lines they are farther apart.
    pub max_samples: usize,
    /// Largest number of points of a target; a larger target is thinned to every n-th point.
    pub max_targets: usize,
}

impl Default for SightConfig {
    fn default() -> Self {
        Self { radius_m: 0.05, step_m: 0.05, margin_m: 0.15, max_samples: 1000, max_targets: 1000 }
    }
}

impl SightConfig {
    fn check(&self) -> Result<(), Error> {
        let is_length = |v: f64| (1e-3..=10.0).contains(&v);
        Error::require("radius_m", self.radius_m, "0.001 to 10", is_length)?;
        Error::require("step_m", self.step_m, "0.001 to 10", is_length)?;
        Error::require("margin_m", self.margin_m, "0 to 10", |v| (0.0..=10.0).contains(&v))?;
        Error::require("max_samples", self.max_samples, "at least 1", |n| n > 0)?;
        Error::require("max_targets", self.max_targets, "at least 1", |n| n > 0)
    }
}

/// Compute the share of a target's points that each eye sees.
///
/// A point is seen if no sample of the line from the eye to it has a scene point within
/// [`SightConfig::radius_m`]. Samples lie at `margin_m`, `margin_m + step_m`, ... from the eye, up
/// to `margin_m` before the point; a line that is too short for a sample is open.
///
/// # Arguments
/// * `scene` - clouds that may block the view, world frame; points that are not finite block
///   nothing.
/// * `targets` - points of the object, world frame.
/// * `eyes` - `[x, y, z]` of the eyes, world frame.
///
/// # Returns
/// A share in 0..=1 for each eye; 0 for a target without points.
///
/// # Errors
/// [`Error::InvalidArgument`] if an eye or a target is not finite or beyond 10 km, or a parameter is outside its domain.
///
/// # Complexity
/// O(scene points + eyes x targets x samples); points are compared only with samples near them.
pub fn visible_shares<'a>(
    scene: impl IntoIterator<Item = &'a [Point]>,
    targets: &[Point],
    eyes: &[Vec3],
    config: &SightConfig,
) -> Result<Vec<f64>, Error> {
    config.check()?;
    let is_place = |v: f64| v.abs() <= 10_000.0;
    for &value in targets.as_flattened() {
        Error::require("targets", f64::from(value), "-10000 to 10000", is_place)?;
    }
    for &value in eyes.as_flattened() {
        Error::require("eyes", value, "-10000 to 10000", is_place)?;
    }
    let stride = targets.len().div_ceil(config.max_targets).max(1);
    let thinned = targets.iter().step_by(stride);
    let obstacles = Obstacles::within(scene, &reach_m(targets, eyes, config), config.radius_m);
    let targets: Vec<Vec3> = thinned.map(|p| p.map(f64::from)).collect();
    let share = |&eye: &Vec3| {
        let num_seen = targets.iter().filter(|&&t| is_open(&obstacles, eye, t, config)).count();
        num_seen as f64 / targets.len().max(1) as f64
    };
    Ok(eyes.iter().map(share).collect())
}

/// Return the smallest box outside of which no point blocks a line.
pub(crate) fn reach_m(targets: &[Point], eyes: &[Vec3], config: &SightConfig) -> Aabb {
    let ends = targets.iter().map(|p| p.map(f64::from)).chain(eyes.iter().copied());
    let mut bounds_m = Aabb::of_points(ends);
    bounds_m.min_m = bounds_m.min_m.map(|v| v - config.radius_m);
    bounds_m.max_m = bounds_m.max_m.map(|v| v + config.radius_m);
    bounds_m
}

/// Return whether no sample of a line is near an obstacle. Samples at the target's end are tested
/// first, because most obstacles are there.
fn is_open(obstacles: &Obstacles, eye: Vec3, target: Vec3, config: &SightConfig) -> bool {
    let offset: Vec3 = std::array::from_fn(|i| target[i] - eye[i]);
    let length_m = offset.iter().map(|v| v * v).sum::<f64>().sqrt();
    let sampled_m = length_m - 2.0 * config.margin_m;
    if sampled_m < 0.0 || length_m == 0.0 {
        return true;
    }
    let step_m = config.step_m.max(sampled_m / config.max_samples as f64);
    let num = (sampled_m / step_m) as usize;
    let unit = offset.map(|v| v / length_m);
    (0..=num).rev().all(|k| {
        let along_m = config.margin_m + step_m * k as f64;
        let sample: Vec3 = std::array::from_fn(|i| eye[i] + unit[i] * along_m);
        !obstacles.has_near(sample)
    })
}

/// Points in cells slightly larger than the radius, so that near points lie in the same cell or in
/// one beside it.
struct Obstacles {
    radius2: f64,
    inverse_edge: f64,
    /// Smallest index of cells with points, minus one; `high` is the largest, plus one.
    low: Voxel,
    high: Voxel,
    /// Index into `ranges` of every cell that contains points or lies beside one that does.
    cells: VoxelIndex,
    /// Start and end of each cell's points in `points`.
    ranges: Vec<[u32; 2]>,
    points: Vec<Vec3>,
}

impl Obstacles {
    fn within<'a>(
        scene: impl IntoIterator<Item = &'a [Point]>,
        bounds_m: &Aabb,
        radius_m: f64,
    ) -> Self {
        let is_inside =
            |p: &Vec3| (0..3).all(|i| p[i] >= bounds_m.min_m[i] && p[i] <= bounds_m.max_m[i]);
        let inverse_edge = 1.0 / (radius_m * 1.001);
        let points: Vec<Vec3> = scene
            .into_iter()
            .flatten()
            .map(|point| point.map(f64::from))
            .filter(is_inside)
            .collect();
        let voxels: Vec<Voxel> = points.iter().map(|&p| voxel_of(p, inverse_edge)).collect();
        let bound = |pick: fn(i32, i32) -> i32, by: i32| {
            let corner =
                voxels.iter().copied().reduce(|a, b| std::array::from_fn(|i| pick(a[i], b[i])));
            corner.map_or([by; 3], |corner| corner.map(|i| i.saturating_add(by)))
        };
        let (low, high) = (bound(i32::min, -1), bound(i32::max, 1));
        let mut cells = VoxelIndex::between([low, high], 1, voxels.len());
        let mut counts: Vec<u32> = Vec::new();
        let mut owners = Vec::with_capacity(points.len());
        for &voxel in &voxels {
            let cell = cells.entry(voxel, counts.len() as u32);
            if cell as usize == counts.len() {
                counts.push(0);
            }
            counts[cell as usize] += 1;
            owners.push(cell);
        }
        let num_occupied = counts.len();
        let mut ranges = Vec::with_capacity(2 * num_occupied);
        let mut end = 0;
        for count in counts {
            ranges.push([end, end]);
            end += count;
        }
        // Sort the points by cell.
        let mut ordered = vec![[0.0; 3]; points.len()];
        let mut is_grown = vec![false; num_occupied];
        for ((point, voxel), owner) in points.into_iter().zip(voxels).zip(owners) {
            let range = &mut ranges[owner as usize];
            ordered[range[1] as usize] = point;
            range[1] += 1;
            if !std::mem::replace(&mut is_grown[owner as usize], true) {
                for beside in around(voxel) {
                    let cell = cells.entry(beside, ranges.len() as u32);
                    if cell as usize == ranges.len() {
                        ranges.push([0, 0]);
                    }
                }
            }
        }
        Self {
            radius2: radius_m * radius_m,
            inverse_edge,
            low,
            high,
            cells,
            ranges,
            points: ordered,
        }
    }

    /// Return whether a point is nearer than the radius.
    fn has_near(&self, place: Vec3) -> bool {
        let voxel = voxel_of(place, self.inverse_edge);
        if (0..3).any(|i| voxel[i] < self.low[i] || voxel[i] > self.high[i]) {
            return false;
        }
        let Some(cell) = self.cells.get(voxel) else { return false };
        // The own cell comes first: it nearly always decides.
        if self.contains_near(cell, place) {
            return true;
        }
        let inside: Vec3 =
            std::array::from_fn(|i| place[i] * self.inverse_edge - f64::from(voxel[i]));
        around(voxel).any(|beside| {
            let gap2: f64 = (0..3)
                .map(|i| match beside[i] - voxel[i] {
                    -1 => inside[i] * inside[i],
                    1 => (1.0 - inside[i]) * (1.0 - inside[i]),
                    _ => 0.0,
                })
                .sum();
            gap2 < 1.0001
                && self.cells.get(beside).is_some_and(|cell| self.contains_near(cell, place))
        })
    }

    fn contains_near(&self, cell: u32, place: Vec3) -> bool {
        let [first, end] = self.ranges[cell as usize];
        self.points[first as usize..end as usize].iter().any(|point| {
            let [x, y, z] = std::array::from_fn(|i| point[i] - place[i]);
            x * x + y * y + z * z < self.radius2
        })
    }
}

/// Return the 26 voxels beside one.
fn around(voxel: Voxel) -> impl Iterator<Item = Voxel> {
    (0..27).filter(|&n| n != 13).map(move |n| {
        let step = [n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1];
        std::array::from_fn(|i| voxel[i] + step[i])
    })
}

fn voxel_of(place: Vec3, inverse_edge: f64) -> Voxel {
    place.map(|value| {
        let scaled = value * inverse_edge;
        // `floor` is a library call on baseline x86-64.
        let truncated = scaled as i32;
        truncated - i32::from(f64::from(truncated) > scaled)
    })
}
