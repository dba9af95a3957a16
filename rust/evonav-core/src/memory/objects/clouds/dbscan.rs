//! Find density clusters of a point cloud.

use std::sync::LazyLock;

use crate::{
    grid::components::find,
    memory::objects::clouds::{
        cells::{Cells, Step, steps_within},
        voxels::{Voxel, bounds, voxel_of, voxels_of},
    },
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
    let mut grid = Grid::new(points, radius_m);
    let others = grid.take_others(min_points);
    let parts = grid.parts();
    grid.label(&others, &parts)
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
    /// Points by cell; cell `c` has `fours[starts[c]..starts[c + 1]]`.
    fours: Vec<Four>,
    starts: Vec<u32>,
    /// Number of points of each cell that are not taken out.
    sizes: Vec<u32>,
    cells: Cells,
    /// Steps as in [`STEPS`].
    steps: Vec<Step>,
}

/// Four points of a cell, whose distances are computed together. A place without a point is
/// infinitely far away.
#[derive(Debug, Clone, Copy)]
struct Four {
    /// Coordinates by axis.
    at: [[f32; 4]; 3],
    /// Index of each point.
    points: [u32; 4],
}

impl Four {
    const EMPTY: Self = Self { at: [[f32::INFINITY; 4]; 3], points: [0; 4] };

    fn point(&self, place: usize) -> Point {
        [0, 1, 2].map(|axis| self.at[axis][place])
    }

    fn set(&mut self, place: usize, point: Point) {
        (0..3).for_each(|axis| self.at[axis][place] = point[axis]);
    }

    /// Return whether each of the points is within a distance of a point; see [`distance2`].
    fn is_near(&self, point: Point, radius2: f32) -> [bool; 4] {
        let [x, y, z] = [0, 1, 2].map(|axis| self.at[axis].map(|value| value - point[axis]));
        std::array::from_fn(|i| x[i] * x[i] + y[i] * y[i] + z[i] * z[i] <= radius2)
    }

    fn num_near(&self, point: Point, radius2: f32) -> u32 {
        self.is_near(point, radius2).map(u32::from).iter().sum()
    }
}

impl<'a> Grid<'a> {
    fn new(points: &'a [Point], radius_m: f32) -> Self {
        // The edge is slightly less than radius / sqrt(3), so that rounding cannot separate the
        // points of a cell.
        let inverse_edge = 3.0_f64.sqrt() * 1.0001 / f64::from(radius_m);
        let corners = bounds(points).unwrap_or_default().map(|at| voxel_of(at, inverse_edge));
        let mut cells = Cells::between(corners, REACH, points.len());
        let mut sizes: Vec<u32> = Vec::with_capacity(points.len() / 4);
        let enter = |voxel: Voxel| {
            let cell = cells.enter(voxel);
            if cell == sizes.len() {
                sizes.push(0);
            }
            sizes[cell] += 1;
            cell as u32
        };
        let cell_of: Vec<u32> = voxels_of(points, inverse_edge).into_iter().map(enter).collect();
        let mut starts = Vec::with_capacity(cells.num() + 1);
        let mut num_fours = 0;
        starts.push(0);
        for size in &sizes {
            num_fours += size.div_ceil(4);
            starts.push(num_fours);
        }
        let mut fours = vec![Four::EMPTY; num_fours as usize];
        let mut num_placed = vec![0_u32; cells.num()];
        for (index, (&point, &cell)) in points.iter().zip(&cell_of).enumerate() {
            let place = &mut num_placed[cell as usize];
            let four = &mut fours[(starts[cell as usize] + *place / 4) as usize];
            four.set((*place % 4) as usize, point);
            four.points[(*place % 4) as usize] = index as u32;
            *place += 1;
        }
        let steps = STEPS.iter().map(|&step| cells.step(step)).collect();
        let radius2 = radius_m * radius_m;
        Self { points, radius2, cell_of, fours, starts, sizes, cells, steps }
    }

    fn fours(&self, cell: usize) -> &[Four] {
        &self.fours[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// Return the cells that may hold neighbours of a cell's points, the nearest first.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> {
        self.steps.iter().filter_map(move |&step| self.cells.beside(cell, step))
    }

    /// Take the points that are not core points out of their cells; return their indices,
    /// ascending.
    fn take_others(&mut self, min_points: usize) -> Vec<u32> {
        let mut others: Vec<[usize; 2]> = Vec::new();
        // Four and place of points of a cell with too few neighbours so far, and the number of
        // their neighbours.
        let mut lacking: Vec<([usize; 2], Point, u32)> = Vec::new();
        let min_points = u32::try_from(min_points).unwrap_or(u32::MAX);
        for cell in (0..self.cells.num()).filter(|&cell| self.sizes[cell] < min_points) {
            let (first, size) = (self.starts[cell] as usize, self.sizes[cell]);
            lacking.extend((0..size as usize).map(|i| {
                let (four, place) = (first + i / 4, i % 4);
                ([four, place], self.fours[four].point(place), size)
            }));
            for other in self.around(cell) {
                let fours = self.fours(other);
                lacking.retain_mut(|(_, point, count)| {
                    let near = fours.iter().map(|four| four.num_near(*point, self.radius2));
                    *count += near.sum::<u32>();
                    *count < min_points
                });
                if lacking.is_empty() {
                    break;
                }
            }
            others.extend(lacking.drain(..).map(|(place, ..)| place));
        }
        let take = |[four, place]: [usize; 2]| {
            let four = &mut self.fours[four];
            four.set(place, [f32::INFINITY; 3]);
            self.sizes[self.cell_of[four.points[place] as usize] as usize] -= 1;
            four.points[place]
        };
        let mut others: Vec<u32> = others.into_iter().map(take).collect();
        others.sort_unstable();
        others
    }

    /// Join cells that have core points within the radius of each other; return the part of each
    /// cell. Cells without core points are of no part.
    fn parts(&self) -> Vec<u32> {
        let mut part_of = vec![NO_PART; self.cells.num()];
        let mut sizes = Vec::new();
        let mut left = Vec::new();
        let mut num_left = self.sizes.iter().filter(|&&size| size > 0).count();
        for first in 0..self.cells.num() {
            if part_of[first] != NO_PART || self.sizes[first] == 0 {
                continue;
            }
            let part = sizes.len() as u32;
            part_of[first] = part;
            sizes.push(1_usize);
            left.push(first);
            num_left -= 1;
            while let Some(cell) = left.pop().filter(|_| num_left > 0) {
                for &step in &self.steps[..NUM_TOUCHING] {
                    let Some(other) = self.cells.beside(cell, step) else { continue };
                    if part_of[other] == NO_PART && self.are_joined(cell, other) {
                        part_of[other] = part;
                        sizes[part as usize] += 1;
                        num_left -= 1;
                        left.push(other);
                    }
                }
            }
        }
        if sizes.len() > 1 {
            self.join_rest(&mut part_of, &sizes);
        }
        part_of
    }

    /// Return whether a core point of one cell is near a core point of another.
    fn are_joined(&self, cell: usize, other: usize) -> bool {
        let points = self.fours(cell).iter().flat_map(|four| (0..4).map(|place| four.point(place)));
        let mut cores = points.filter(|point| point[0] != f32::INFINITY);
        let others = self.fours(other);
        cores.any(|point| others.iter().any(|four| four.num_near(point, self.radius2) > 0))
    }

    /// Join the parts that touching cells leave separate. It is enough to start from cells outside
    /// the largest part: of two cells to be joined, at least one is outside.
    fn join_rest(&self, part_of: &mut [u32], sizes: &[usize]) {
        let mut parents: Vec<u32> = (0..sizes.len() as u32).collect();
        let largest = (0..sizes.len()).max_by_key(|&part| sizes[part]);
        let outside =
            |&cell: &usize| part_of[cell] != NO_PART && Some(part_of[cell] as usize) != largest;
        for cell in (0..self.cells.num()).filter(outside) {
            for &step in &self.steps[NUM_TOUCHING..] {
                let Some(other) = self.cells.beside(cell, step) else { continue };
                if part_of[other] == NO_PART || part_of[other] == part_of[cell] {
                    continue;
                }
                let (a, b) =
                    (find(&mut parents, part_of[cell]), find(&mut parents, part_of[other]));
                if a != b && self.are_joined(cell, other) {
                    parents[a.max(b) as usize] = a.min(b);
                }
            }
        }
        let parts = part_of.iter_mut().filter(|part| **part != NO_PART);
        parts.for_each(|part| *part = find(&mut parents, *part));
    }

    /// Number the clusters in the order of their first core points, then look for one near each of
    /// the other points.
    fn label(&self, others: &[u32], parts: &[u32]) -> Vec<i32> {
        let mut labels = vec![0; self.points.len()];
        others.iter().for_each(|&other| labels[other as usize] = NOISE);
        if parts.iter().any(|&part| part != 0 && part != NO_PART) {
            let mut number_of = vec![NOISE; self.cells.num()];
            let mut num = 0;
            for (label, &cell) in labels.iter_mut().zip(&self.cell_of).filter(|(l, _)| **l == 0) {
                let number = &mut number_of[parts[cell as usize] as usize];
                if *number == NOISE {
                    *number = num;
                    num += 1;
                }
                *label = *number;
            }
        }
        for &border in others {
            labels[border as usize] = self.border_label(border as usize, &labels);
        }
        labels
    }

    /// Return the first cluster among the core points around a point that is not a core point.
    fn border_label(&self, border: usize, labels: &[i32]) -> i32 {
        let cell = self.cell_of[border] as usize;
        let mut first = NOISE;
        for four in std::iter::once(cell).chain(self.around(cell)).flat_map(|cell| self.fours(cell))
        {
            let is_near = four.is_near(self.points[border], self.radius2);
            for place in (0..4).filter(|&place| is_near[place]) {
                let label = labels[four.points[place] as usize];
                if label == 0 {
                    return 0;
                }
                first = if first == NOISE { label } else { first.min(label) };
            }
        }
        first
    }
}

const NO_PART: u32 = u32::MAX;

/// Largest number of steps along an axis to cells that may contain neighbours.
const REACH: i32 = 2;

/// Number of [`STEPS`] that lead to touching cells, at most one step along each axis.
const NUM_TOUCHING: usize = 26;

/// Steps to the cells within [`REACH`], the shortest first.
static STEPS: LazyLock<Vec<Voxel>> = LazyLock::new(|| steps_within(REACH));
