//! Find density clusters of a point cloud.

use std::{borrow::Cow, sync::LazyLock};

use crate::{
    grid::components::find,
    memory::objects::voxels::{Voxel, VoxelIndex, voxel_of},
    sensors::unproject::Point,
};

/// Label of a point that belongs to no cluster.
pub const NOISE: i32 = -1;

/// Label points by DBSCAN (Ester, Kriegel, Sander & Xu, KDD 1996): a point with `min_points` points
/// within `radius_m`, itself included, is a core point; core points within `radius_m` of each other
/// share a cluster.
///
/// # Returns
/// The cluster of each point, or [`NOISE`]. Clusters are numbered in the order of their first core
/// point. A border point within reach of several clusters belongs to the first, as in scikit-learn.
///
/// # Complexity
/// The result is exact. The grid's cells are so small that all points of a cell are neighbours
/// (Gunawan, 2013); this takes close to O(points) for the surfaces of objects.
pub fn dbscan(points: &[Point], radius_m: f32, min_points: usize) -> Vec<i32> {
    let grid = Grid::new(points, radius_m);
    let is_core = grid.core_points(min_points);
    let clusters = grid.join_cells(&is_core);
    grid.label(&is_core, &clusters)
}

/// Return the points of the largest cluster (the first of equals), in their order; `None` if all
/// points are noise. They are borrowed if they are all points.
pub fn largest_cluster(
    points: &[Point],
    radius_m: f32,
    min_points: usize,
) -> Option<Cow<'_, [Point]>> {
    let labels = dbscan(points, radius_m, min_points);
    let num = labels.iter().max().map_or(0, |&last| (last + 1) as usize);
    let mut sizes = vec![0_usize; num];
    labels.iter().filter(|&&label| label != NOISE).for_each(|&label| sizes[label as usize] += 1);
    let largest = (0..num).max_by_key(|&i| (sizes[i], std::cmp::Reverse(i)))?;
    if sizes[largest] == points.len() {
        return Some(Cow::Borrowed(points));
    }
    let is_inside = |&(_, &label): &(&Point, &i32)| label == largest as i32;
    Some(points.iter().zip(&labels).filter(is_inside).map(|(&point, _)| point).collect())
}

/// Return the squared distance of two points.
pub(crate) fn distance2(a: Point, b: Point) -> f32 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    x * x + y * y + z * z
}

/// Points by cell. Most points have enough neighbours in their own cell and the nearest ones, so
/// other cells are looked up only when they are needed.
struct Grid<'a> {
    points: &'a [Point],
    radius2: f32,
    cell_of: Vec<u32>,
    /// Point indices by cell, ascending in each; cell `c` has `members[starts[c]..starts[c + 1]]`.
    members: Vec<u32>,
    starts: Vec<u32>,
    voxels: Vec<Voxel>,
    index: VoxelIndex,
    /// Slot of each voxel in the index.
    slots: Vec<usize>,
    /// Steps as in [`HALF_STEPS`].
    half_steps: Vec<Step>,
}

/// A step from one cell to another.
#[derive(Debug, Clone, Copy)]
struct Step {
    voxels: Voxel,
    /// Distance in the index.
    stride: isize,
}

impl Step {
    fn back(self) -> Self {
        Self { voxels: self.voxels.map(|i| -i), stride: -self.stride }
    }
}

impl<'a> Grid<'a> {
    fn new(points: &'a [Point], radius_m: f32) -> Self {
        // The edge is slightly less than radius / sqrt(3), so that rounding cannot separate the
        // points of a cell.
        let inverse_edge = 3.0_f64.sqrt() * 1.0001 / f64::from(radius_m);
        let voxel_of_point: Vec<Voxel> =
            points.iter().map(|&point| voxel_of(point, inverse_edge)).collect();
        let mut index = VoxelIndex::spanning(&voxel_of_point, REACH);
        let mut voxels: Vec<Voxel> = Vec::new();
        let enter = |&voxel: &Voxel| {
            let cell = index.entry(voxel, voxels.len() as u32);
            if cell as usize == voxels.len() {
                voxels.push(voxel);
            }
            cell
        };
        let cell_of: Vec<u32> = voxel_of_point.iter().map(enter).collect();
        let mut starts = vec![0_u32; voxels.len() + 1];
        cell_of.iter().for_each(|&cell| starts[cell as usize + 1] += 1);
        (0..voxels.len()).for_each(|cell| starts[cell + 1] += starts[cell]);
        let mut next = starts.clone();
        let mut members = vec![0; points.len()];
        for (point, &cell) in cell_of.iter().enumerate() {
            members[next[cell as usize] as usize] = point as u32;
            next[cell as usize] += 1;
        }
        let slots = voxels.iter().map(|&voxel| index.slot(voxel)).collect();
        let step = |&voxels: &Voxel| Step { voxels, stride: index.stride(voxels) };
        let half_steps = HALF_STEPS.iter().map(step).collect();
        let radius2 = radius_m * radius_m;
        Self { points, radius2, cell_of, members, starts, voxels, index, slots, half_steps }
    }

    fn num_cells(&self) -> usize {
        self.voxels.len()
    }

    fn members(&self, cell: usize) -> &[u32] {
        &self.members[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// Return the cell that is a step away, if it has points.
    fn beside(&self, cell: usize, step: Step) -> Option<usize> {
        let beside = || [0, 1, 2].map(|i| self.voxels[cell][i].saturating_add(step.voxels[i]));
        let slot = self.slots[cell].wrapping_add_signed(step.stride);
        self.index.at(slot, beside).map(|other| other as usize)
    }

    /// Return the cells that may hold neighbours of a cell's points, the nearest first.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> {
        let steps = self.half_steps.iter().flat_map(|&step| [step, step.back()]);
        steps.filter_map(move |step| self.beside(cell, step))
    }

    fn is_near(&self, a: u32, b: u32) -> bool {
        distance2(self.points[a as usize], self.points[b as usize]) <= self.radius2
    }

    fn core_points(&self, min_points: usize) -> Vec<bool> {
        let mut is_core = vec![true; self.points.len()];
        // Points of a cell with too few neighbours so far, and their numbers of neighbours.
        let mut lacking: Vec<(u32, usize)> = Vec::new();
        for cell in 0..self.num_cells() {
            let here = self.members(cell);
            if here.len() >= min_points {
                continue;
            }
            lacking.extend(here.iter().map(|&point| (point, here.len())));
            for other in self.around(cell) {
                let others = self.members(other);
                lacking.retain_mut(|(point, count)| {
                    *count += others.iter().filter(|&&other| self.is_near(*point, other)).count();
                    *count < min_points
                });
                if lacking.is_empty() {
                    break;
                }
            }
            lacking.drain(..).for_each(|(point, _)| is_core[point as usize] = false);
        }
        is_core
    }

    /// Join cells that have core points within the radius of each other; return a representative
    /// for each cell.
    fn join_cells(&self, is_core: &[bool]) -> Vec<u32> {
        let mut parents: Vec<u32> = (0..self.num_cells() as u32).collect();
        let cores = |cell: usize| {
            self.members(cell).iter().copied().filter(|&point| is_core[point as usize])
        };
        let has_core: Vec<bool> =
            (0..self.num_cells()).map(|cell| cores(cell).next().is_some()).collect();
        // Joins a cell and the one a step away; returns whether two parts became one.
        let join = |parents: &mut [u32], cell: usize, step: Step| {
            let Some(other) = self.beside(cell, step).filter(|&other| has_core[other]) else {
                return false;
            };
            let (a, b) = (find(parents, cell as u32), find(parents, other as u32));
            let is_joined = a != b && cores(cell).any(|a| cores(other).any(|b| self.is_near(a, b)));
            if is_joined {
                parents[a.max(b) as usize] = a.min(b);
            }
            is_joined
        };
        let with_core = || (0..self.num_cells()).filter(|&cell| has_core[cell]);
        let mut num_parts = with_core().count();
        for &step in &self.half_steps[..NUM_TOUCHING] {
            if num_parts < 2 {
                break;
            }
            num_parts -= with_core().filter(|&cell| join(&mut parents, cell, step)).count();
        }
        if num_parts > 1 {
            self.join_rest(&mut parents, &has_core, join);
        }
        (0..self.num_cells() as u32).map(|cell| find(&mut parents, cell)).collect()
    }

    /// Join the parts that touching cells leave separate. It is enough to start from cells outside
    /// the largest part: of two cells to be joined, at least one is outside.
    fn join_rest(
        &self,
        parents: &mut [u32],
        has_core: &[bool],
        join: impl Fn(&mut [u32], usize, Step) -> bool,
    ) {
        let with_core = || (0..self.num_cells()).filter(|&cell| has_core[cell]);
        let mut sizes = vec![0_usize; self.num_cells()];
        with_core().for_each(|cell| sizes[find(parents, cell as u32) as usize] += 1);
        let largest = (0..sizes.len()).max_by_key(|&cell| sizes[cell]);
        let mut left: Vec<usize> = with_core().collect();
        left.retain(|&cell| Some(find(parents, cell as u32) as usize) != largest);
        for &step in &self.half_steps[NUM_TOUCHING..] {
            for &cell in &left {
                join(parents, cell, step);
                join(parents, cell, step.back());
            }
        }
    }

    fn label(&self, is_core: &[bool], cluster_of_cell: &[u32]) -> Vec<i32> {
        let mut labels = vec![NOISE; self.points.len()];
        let mut number_of = vec![NOISE; self.num_cells()];
        let mut num = 0;
        for point in (0..self.points.len()).filter(|&point| is_core[point]) {
            let number = &mut number_of[cluster_of_cell[self.cell_of[point] as usize] as usize];
            if *number == NOISE {
                *number = num;
                num += 1;
            }
            labels[point] = *number;
        }
        for border in (0..self.points.len()).filter(|&point| !is_core[point]) {
            labels[border] = self.border_label(border, is_core, &labels);
        }
        labels
    }

    /// Return the first cluster among the core points around a point that is not a core point.
    fn border_label(&self, border: usize, is_core: &[bool], labels: &[i32]) -> i32 {
        let cell = self.cell_of[border] as usize;
        let others = std::iter::once(cell).chain(self.around(cell));
        let near = others.flat_map(|other| self.members(other)).copied();
        let cores = near.filter(|&i| is_core[i as usize] && self.is_near(border as u32, i));
        cores.map(|core| labels[core as usize]).min().unwrap_or(NOISE)
    }
}

/// Largest number of steps along an axis to cells that may contain neighbours.
const REACH: i32 = 2;

/// Number of [`HALF_STEPS`] that lead to touching cells, at most one step along each axis.
const NUM_TOUCHING: usize = 13;

/// One of every two opposite steps to cells within [`REACH`], the shortest first.
static HALF_STEPS: LazyLock<Vec<Voxel>> = LazyLock::new(|| {
    let side = 2 * REACH + 1;
    let step = |i: i32| [i / (side * side), i / side % side, i % side].map(|i| i - REACH);
    let mut steps: Vec<Voxel> =
        (0..side.pow(3)).map(step).filter(|&step| step > [0, 0, 0]).collect();
    steps.sort_by_key(|step| step.iter().map(|i| i * i).sum::<i32>());
    steps
});
