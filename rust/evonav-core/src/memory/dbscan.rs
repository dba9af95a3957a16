//! Density clusters of a point cloud.

use crate::{
    memory::voxels::{Voxel, VoxelIndex, voxel_of},
    sensors::unproject::Point,
};

/// Label of a point that belongs to no cluster.
pub const NOISE: i32 = -1;

/// DBSCAN (Ester, Kriegel, Sander & Xu, KDD 1996): a point with `min_points` points, itself
/// counted, within `radius_m` is a core point; core points within `radius_m` of each other share a cluster.
///
/// # Returns
/// A cluster a point, numbered by their first core point, or [`NOISE`]. A border point within
/// reach of several clusters takes the first, as in scikit-learn.
///
/// # Complexity
/// Exact, by a grid whose cells are small enough that all points of a cell are neighbours (Gunawan,
/// 2013): close to O(points) for the surfaces of objects.
pub fn dbscan(points: &[Point], radius_m: f32, min_points: usize) -> Vec<i32> {
    let grid = Grid::new(points, radius_m);
    let is_core = grid.core_points(min_points);
    let clusters = grid.join_cells(&is_core);
    grid.label(&is_core, clusters)
}

/// The points of the largest cluster (the first of equal ones), in their order; `None` if all is noise.
pub fn largest_cluster(points: &[Point], radius_m: f32, min_points: usize) -> Option<Vec<Point>> {
    let labels = dbscan(points, radius_m, min_points);
    let num = labels.iter().max().map_or(0, |&last| (last + 1) as usize);
    let mut sizes = vec![0_usize; num];
    labels.iter().filter(|&&label| label != NOISE).for_each(|&label| sizes[label as usize] += 1);
    let largest = (0..num).max_by_key(|&i| (sizes[i], std::cmp::Reverse(i)))?;
    let is_inside = |&(_, &label): &(&Point, &i32)| label == largest as i32;
    Some(points.iter().zip(&labels).filter(is_inside).map(|(&point, _)| point).collect())
}

/// Squared distance.
pub(crate) fn distance2(a: Point, b: Point) -> f32 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    x * x + y * y + z * z
}

struct Grid<'a> {
    points: &'a [Point],
    radius2: f32,
    /// Point indices by cell, ascending in each; cell `c` has `members[starts[c]..starts[c + 1]]`.
    members: Vec<u32>,
    starts: Vec<u32>,
    /// Cells that may hold neighbours of each other, each pair once, the nearest first.
    pairs: Vec<[u32; 2]>,
}

impl<'a> Grid<'a> {
    fn new(points: &'a [Point], radius_m: f32) -> Self {
        // A hair less than radius / sqrt(3), so that rounding cannot part the points of a cell.
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
        let pairs = neighbour_pairs(&voxels, &index);
        Self { points, radius2: radius_m * radius_m, members, starts, pairs }
    }

    fn num_cells(&self) -> usize {
        self.starts.len() - 1
    }

    fn members(&self, cell: usize) -> &[u32] {
        &self.members[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    fn is_near(&self, a: u32, b: u32) -> bool {
        distance2(self.points[a as usize], self.points[b as usize]) <= self.radius2
    }

    fn core_points(&self, min_points: usize) -> Vec<bool> {
        // Neighbours found so far; there is no need to count on from `min_points`.
        let mut counts = vec![0_usize; self.points.len()];
        for cell in 0..self.num_cells() {
            let here = self.members(cell);
            here.iter().for_each(|&point| counts[point as usize] = here.len());
        }
        for &[a, b] in &self.pairs {
            for (cell, other) in [(a, b), (b, a)] {
                let here = self.members(cell as usize);
                if here.len() >= min_points {
                    continue;
                }
                for &point in here {
                    let count = &mut counts[point as usize];
                    if *count < min_points {
                        let others = self.members(other as usize).iter();
                        *count += others.filter(|&&other| self.is_near(point, other)).count();
                    }
                }
            }
        }
        counts.into_iter().map(|count| count >= min_points).collect()
    }

    /// Cells joined by core points within the radius: a representative a cell.
    fn join_cells(&self, is_core: &[bool]) -> Vec<u32> {
        let mut parents: Vec<u32> = (0..self.num_cells() as u32).collect();
        let core_of = |cell: u32| {
            self.members(cell as usize).iter().copied().filter(|&point| is_core[point as usize])
        };
        // Near cells first: most of the farther pairs are then joined already.
        for &[cell, other] in &self.pairs {
            let (a, b) = (root(&mut parents, cell), root(&mut parents, other));
            if a != b && core_of(cell).any(|a| core_of(other).any(|b| self.is_near(a, b))) {
                parents[a.max(b) as usize] = a.min(b);
            }
        }
        (0..self.num_cells() as u32).map(|cell| root(&mut parents, cell)).collect()
    }

    fn label(&self, is_core: &[bool], cluster_of_cell: Vec<u32>) -> Vec<i32> {
        let mut labels = vec![NOISE; self.points.len()];
        let mut cell_of = vec![0; self.points.len()];
        for cell in 0..self.num_cells() {
            self.members(cell).iter().for_each(|&point| cell_of[point as usize] = cell);
        }
        let mut number_of = vec![NOISE; self.num_cells()];
        let mut num = 0;
        for point in (0..self.points.len()).filter(|&point| is_core[point]) {
            let number = &mut number_of[cluster_of_cell[cell_of[point]] as usize];
            if *number == NOISE {
                *number = num;
                num += 1;
            }
            labels[point] = *number;
        }
        self.label_borders(is_core, &mut labels);
        labels
    }

    fn label_borders(&self, is_core: &[bool], labels: &mut [i32]) {
        let is_border = |point: &&u32| !is_core[**point as usize];
        let borders: Vec<Vec<u32>> = (0..self.num_cells())
            .map(|cell| self.members(cell).iter().filter(is_border).copied().collect())
            .collect();
        // The borders in one cell take the first cluster among the core points of another.
        let mut adopt = |borders: &[u32], cell: usize| {
            for &border in borders {
                for &core in self.members(cell) {
                    if is_core[core as usize] && self.is_near(border, core) {
                        let (label, mine) = (labels[core as usize], &mut labels[border as usize]);
                        *mine = if *mine == NOISE { label } else { label.min(*mine) };
                    }
                }
            }
        };
        for (cell, borders) in borders.iter().enumerate() {
            adopt(borders, cell);
        }
        for [a, b] in self.pairs.iter().map(|pair| pair.map(|cell| cell as usize)) {
            adopt(&borders[a], b);
            adopt(&borders[b], a);
        }
    }
}

/// The representative of a cell; shortens the way there.
fn root(parents: &mut [u32], mut cell: u32) -> u32 {
    while parents[cell as usize] != cell {
        let parent = parents[cell as usize];
        parents[cell as usize] = parents[parent as usize];
        cell = parent;
    }
    cell
}

/// Cells at most this many steps away an axis may hold neighbours.
const REACH: i32 = 2;

fn neighbour_pairs(voxels: &[Voxel], index: &VoxelIndex) -> Vec<[u32; 2]> {
    let reach = -REACH..=REACH;
    let mut steps: Vec<Voxel> = reach
        .clone()
        .flat_map(|x| reach.clone().flat_map(move |y| (-REACH..=REACH).map(move |z| [x, y, z])))
        .filter(|&step| step > [0, 0, 0])
        .collect();
    steps.sort_by_key(|step| step.iter().map(|i| i * i).sum::<i32>());
    let mut pairs = Vec::with_capacity(8 * voxels.len());
    for step in steps {
        for (cell, voxel) in voxels.iter().enumerate() {
            let beside = [0, 1, 2].map(|i| voxel[i].saturating_add(step[i]));
            pairs.extend(index.get(beside).map(|other| [cell as u32, other]));
        }
    }
    pairs
}
