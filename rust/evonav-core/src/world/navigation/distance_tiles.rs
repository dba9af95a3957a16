//! Shortest distances from one point to many: points near each other share the nodes over which
//! their paths may come.
//!
//! Points are halved into smaller and smaller boxes. In each box the distance of one point is
//! computed first. It bounds the others' distances if nothing large stands between them, and nodes
//! beyond that bound are left out for the whole box, as are those whose tangents point elsewhere
//! and those behind an obstacle that hides the box. A point that turns out to be farther is looked
//! up among the nodes of a larger box.

use std::array;

use evonav_simd::Kernel;

use crate::{
    geometry::{Vec2, bounds_2d_m},
    world::navigation::{
        Obstacles,
        distance_field::{DistanceField, Reached},
        nodes::TANGENT_SLACK_M,
    },
};

/// Largest number of points that share their nodes in the smallest boxes, beside the first.
const LEAF: usize = 16;
/// The length that bounds allow for beyond the distance of the point before and the way between
/// both.
const DETOUR_M: f64 = 0.02;
/// Margin of boxes around points, far above rounding.
const ROOM_M: f64 = 1e-9;
/// Relative margin of bounds, far above rounding.
const HAIR: f64 = 1e-12;

/// Compute the shortest distances to free points; infinite where there is no path, or no point.
pub(super) fn distances_m(
    field: &DistanceField,
    obstacles: &Obstacles,
    targets_m: &[Option<Vec2>],
) -> Vec<f64> {
    let mut lengths_m = vec![f64::INFINITY; targets_m.len()];
    let targets = targets_m.iter().enumerate();
    let targets: Vec<Target> =
        targets.filter_map(|(i, target)| Some((target.as_ref().copied()?, i))).collect();
    let (mut hugged, mut others): (Vec<_>, Vec<_>) =
        targets.into_iter().partition(|&(point_m, _)| obstacles.is_hugged(point_m));
    for (is_hugged, points) in [(false, &mut others), (true, &mut hugged)] {
        let mut tiles = Tiles {
            field,
            obstacles,
            is_hugged,
            levels: vec![Level::of_all(field.nodes())],
            lengths_m: &mut lengths_m,
            is_leading: Vec::new(),
            open: Vec::new(),
        };
        tiles.visit(points, 0, None);
    }
    lengths_m
}

/// A point and its place among the targets.
type Target = (Vec2, usize);

/// An upright box, or a point.
#[derive(Debug, Clone, Copy)]
struct Area {
    centre_m: Vec2,
    half_m: Vec2,
}

impl Area {
    fn around(points: &[Target]) -> Self {
        let [low_m, high_m] = bounds_2d_m(points.iter().map(|point| point.0));
        let centre_m: Vec2 = array::from_fn(|i| 0.5 * (low_m[i] + high_m[i]));
        Self { centre_m, half_m: array::from_fn(|i| high_m[i] - centre_m[i] + ROOM_M) }
    }

    fn at(centre_m: Vec2) -> Self {
        Self { centre_m, half_m: [0.0; 2] }
    }

    /// Return a length that distances of points of this area rarely exceed, given a point and its
    /// distance.
    fn likely_m(&self, before: Option<(Vec2, f64)>) -> f64 {
        before.map_or(f64::INFINITY, |(point_m, length_m)| {
            let [x, z]: Vec2 =
                array::from_fn(|i| (self.centre_m[i] - point_m[i]).abs() + self.half_m[i]);
            length_m + (x * x + z * z).sqrt() + DETOUR_M
        })
    }
}

/// The nodes that may be the last before the points of a box.
#[derive(Debug, Default)]
struct Level {
    numbers: Vec<u32>,
    /// A column each for x, z, the length of the path to the node, and x and z of its two normals.
    columns: [Vec<f64>; 7],
    may_see_start: bool,
    /// The length of paths up to which no node is missing.
    most_m: f64,
}

impl Level {
    fn of_all(nodes: &[Reached]) -> Self {
        let mut all = Self { may_see_start: true, most_m: f64::INFINITY, ..Self::default() };
        for (i, node) in nodes.iter().enumerate() {
            all.push(i as u32, node);
        }
        all
    }

    fn push(&mut self, number: u32, Reached { node, cost_m }: &Reached) {
        self.numbers.push(number);
        let ([x, z], [[ax, az], [bx, bz]]) = (node.point_m, node.normals);
        let values = [x, z, *cost_m, ax, az, bx, bz];
        for (column, value) in self.columns.iter_mut().zip(values) {
            column.push(value);
        }
    }

    fn clear(&mut self) {
        self.numbers.clear();
        self.columns.iter_mut().for_each(Vec::clear);
    }

    /// Return the nodes over which a path of at most `most_m` may come to a point of an area, by
    /// its length and its tangents, whose tolerance is `slack_m`.
    fn leading_to<'a>(
        &'a self,
        area: Area,
        most_m: f64,
        slack_m: f64,
        is_leading: &'a mut Vec<bool>,
    ) -> impl Iterator<Item = u32> + 'a {
        is_leading.clear();
        is_leading.resize(self.numbers.len(), false);
        evonav_simd::compute(Leading { level: self, area, most_m, slack_m, is_leading });
        self.numbers.iter().zip(is_leading).filter(|(_, is_leading)| **is_leading).map(|(&n, _)| n)
    }
}

struct Leading<'a> {
    level: &'a Level,
    area: Area,
    most_m: f64,
    slack_m: f64,
    is_leading: &'a mut [bool],
}

impl Kernel for Leading<'_> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        let Self { level, area: Area { centre_m, half_m }, most_m, slack_m, is_leading } = self;
        let most_m = most_m * (1.0 + HAIR);
        let num = is_leading.len();
        let [xs, zs, costs_m, axs, azs, bxs, bzs] = level.columns.each_ref().map(|c| &c[..num]);
        for (i, is_leading) in is_leading.iter_mut().enumerate() {
            let leg = [centre_m[0] - xs[i], centre_m[1] - zs[i]];
            let x = (leg[0].abs() - half_m[0]).max(0.0);
            let z = (leg[1].abs() - half_m[1]).max(0.0);
            let left_m = most_m - costs_m[i];
            let a = axs[i] * leg[0] + azs[i] * leg[1];
            let b = bxs[i] * leg[0] + bzs[i] * leg[1];
            let a_half = axs[i].abs() * half_m[0] + azs[i].abs() * half_m[1];
            let b_half = bxs[i].abs() * half_m[0] + bzs[i].abs() * half_m[1];
            *is_leading = (left_m >= 0.0)
                & (x * x + z * z <= left_m * left_m)
                & ((a - a_half <= slack_m) | (b - b_half <= slack_m))
                & ((a + a_half >= -slack_m) | (b + b_half >= -slack_m));
        }
    }
}

/// The computation of distances, box by box.
struct Tiles<'a> {
    field: &'a DistanceField,
    obstacles: &'a Obstacles,
    /// Whether all points lie so close to obstacles that any node may lead to them.
    is_hugged: bool,
    /// The nodes of the present box, after those of all boxes around it.
    levels: Vec<Level>,
    lengths_m: &'a mut [f64],
    is_leading: Vec<bool>,
    open: Vec<(f64, u32)>,
}

impl Tiles<'_> {
    /// Compute the distances of the points of a box, whose nodes are among those of a level.
    fn visit(&mut self, points: &mut [Target], depth: usize, before: Option<(Vec2, f64)>) {
        if points.is_empty() {
            return;
        }
        let area = Area::around(points);
        let off_m2 = |point_m: Vec2| -> f64 {
            (0..2).map(|i| (point_m[i] - area.centre_m[i]).powi(2)).sum()
        };
        let middle =
            (0..points.len()).min_by(|&i, &j| off_m2(points[i].0).total_cmp(&off_m2(points[j].0)));
        points.swap(0, middle.unwrap_or(0));
        let Some((&mut first, points)) = points.split_first_mut() else { return };
        let before = Some((first.0, self.solve(first, depth, before)));
        if points.is_empty() {
            return;
        }
        self.open_level(depth + 1, area, area.likely_m(before));
        if points.len() <= LEAF {
            for &mut point in points {
                self.solve(point, depth + 1, before);
            }
            return;
        }
        let axis = usize::from(area.half_m[1] > area.half_m[0]);
        let mut num_low = 0;
        for i in 0..points.len() {
            if points[i].0[axis] < area.centre_m[axis] {
                points.swap(i, num_low);
                num_low += 1;
            }
        }
        // Points that are the same lie on one side.
        let middle = if num_low == 0 { points.len() / 2 } else { num_low };
        let (low, high) = points.split_at_mut(middle);
        self.visit(low, depth + 1, before);
        self.visit(high, depth + 1, before);
    }

    /// Choose the nodes of a box among those of the smallest box around it that surely has them.
    fn open_level(&mut self, depth: usize, area: Area, most_m: f64) {
        if self.levels.len() == depth {
            self.levels.push(Level::default());
        }
        let (field, is_leading) = (self.field, &mut self.is_leading);
        let is_hidden =
            |number| field.is_hidden(self.obstacles, number, area.centre_m, area.half_m);
        let (above, below) = self.levels.split_at_mut(depth);
        let level = &mut below[0];
        level.clear();
        level.most_m = most_m;
        let Some(from) = above.iter().rev().find(|above| above.most_m >= most_m) else { return };
        level.may_see_start = from.may_see_start && !is_hidden(field.nodes().len() as u32);
        let slack_m = if self.is_hugged { f64::INFINITY } else { 2.0 * TANGENT_SLACK_M };
        for number in from.leading_to(area, most_m, slack_m, is_leading) {
            if !is_hidden(number) {
                level.push(number, &field.nodes()[number as usize]);
            }
        }
    }

    /// Compute the distance of a point, whose last node is likely among those of a level.
    fn solve(&mut self, (point_m, i): Target, depth: usize, before: Option<(Vec2, f64)>) -> f64 {
        let may_see_start = self.levels[depth].may_see_start;
        let straight_m =
            may_see_start.then(|| self.field.straight_m(self.obstacles, point_m)).flatten();
        let length_m = straight_m.unwrap_or_else(|| self.around_corners_m(point_m, depth, before));
        self.lengths_m[i] = length_m;
        length_m
    }

    /// Return the distance of a point that the start does not see.
    fn around_corners_m(
        &mut self,
        point_m: Vec2,
        depth: usize,
        before: Option<(Vec2, f64)>,
    ) -> f64 {
        let Self { field, obstacles, is_leading, open, .. } = self;
        let area = Area::at(point_m);
        let slack_m = if self.is_hugged { f64::INFINITY } else { TANGENT_SLACK_M };
        let mut most_m = area.likely_m(before);
        for level in self.levels[..=depth].iter().rev() {
            if level.most_m < most_m {
                continue;
            }
            for number in level.leading_to(area, most_m, slack_m, is_leading) {
                open.extend(field.bound_m(obstacles, number, point_m));
            }
            let length_m = field.least_m(obstacles, point_m, open);
            open.clear();
            if length_m <= most_m {
                return length_m;
            }
            most_m = length_m;
        }
        f64::INFINITY
    }
}
