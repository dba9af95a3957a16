//! Shortest paths in real houses against a fine any-angle lattice.
//!
//! `EVONAV_NUM_PAIRS=1000` runs the whole comparison (minutes); 60 pairs are the default.
//!
//! The twin knows nothing of corners or tangents: Dijkstra over a 0.05 m lattice whose points
//! are joined in every direction up to half a metre, by moves that the swept capsule allows.

use std::{cmp::Reverse, collections::BinaryHeap};

use crate::common::recorded::{house_lines, house_of, navigation_of, scene_of};
use evonav_core::{
    geometry::{Vec2, distance_2d_m},
    grid::GridSpec,
    rng::Stream,
    world::navigation::{AgentBody, Navigation, path_length_m},
};

const PITCH_M: f64 = 0.05;
const REACH: i64 = 10;

/// The lattice of one house: free points, and which of the directions lead on from each.
struct Lattice<'a> {
    navigation: &'a Navigation,
    spec: GridSpec,
    is_free: Vec<bool>,
    directions: Vec<[i64; 2]>,
}

impl<'a> Lattice<'a> {
    fn new(navigation: &'a Navigation) -> Self {
        let spec = navigation.map_spec(PITCH_M).expect("a house of moderate size");
        let gcd = |mut a: i64, mut b: i64| {
            while b != 0 {
                (a, b) = (b, a % b);
            }
            a.abs()
        };
        let directions = (-REACH..=REACH)
            .flat_map(|x| (-REACH..=REACH).map(move |z| [x, z]))
            .filter(|&[x, z]| gcd(x, z) == 1 && x * x + z * z <= REACH * REACH)
            .collect();
        let mut lattice = Self { navigation, spec, is_free: Vec::new(), directions };
        lattice.is_free = (0..spec.len()).map(|i| navigation.is_free(lattice.point(i))).collect();
        lattice
    }

    /// Lattice points are the cells' smallest corners: multiples of the pitch.
    fn point(&self, i: usize) -> Vec2 {
        let cell = [i % self.spec.cols, i / self.spec.cols];
        [0, 1].map(|k| ((self.spec.corner_m[k] / PITCH_M).round() + cell[k] as f64) * PITCH_M)
    }

    fn index_of(&self, point_m: Vec2) -> usize {
        let cell =
            [0, 1].map(|k| ((point_m[k] - self.spec.corner_m[k]) / PITCH_M).round() as usize);
        cell[1] * self.spec.cols + cell[0]
    }

    /// Costs and parents from one point to all, or until `target` is settled.
    fn path(&self, start: usize, target: usize) -> Option<Vec<Vec2>> {
        let mut cost = vec![f64::INFINITY; self.spec.len()];
        let mut parent = vec![usize::MAX; self.spec.len()];
        let mut is_done = vec![false; self.spec.len()];
        let mut open = BinaryHeap::from([(Reverse(0), start)]);
        cost[start] = 0.0;
        while let Some((_, i)) = open.pop() {
            if std::mem::replace(&mut is_done[i], true) {
                continue;
            }
            if i == target {
                let mut path = vec![self.point(target)];
                let mut at = target;
                while at != start {
                    at = parent[at];
                    path.push(self.point(at));
                }
                return Some(path);
            }
            for &[dx, dz] in &self.directions {
                let cell = [(i % self.spec.cols) as i64 + dx, (i / self.spec.cols) as i64 + dz];
                let is_on = (0..2).all(|k| cell[k] >= 0)
                    && cell[0] < self.spec.cols as i64
                    && cell[1] < self.spec.rows as i64;
                if !is_on {
                    continue;
                }
                let j = cell[1] as usize * self.spec.cols + cell[0] as usize;
                let through = cost[i] + distance_2d_m(self.point(i), self.point(j));
                let is_move = !is_done[j] && self.is_free[j] && through < cost[j] - 1e-9;
                let obstacles = self.navigation.obstacles();
                if is_move && obstacles.is_clear_between(self.point(i), self.point(j)) {
                    (cost[j], parent[j]) = (through, i);
                    // A* with the straight line, in micrometres.
                    let ahead = distance_2d_m(self.point(j), self.point(target));
                    open.push((Reverse(((through + ahead) * 1e6) as u64), j));
                }
            }
        }
        None
    }
}

/// Leaves out every point of a path that can be passed by.
fn pulled_taut(navigation: &Navigation, path: &[Vec2]) -> Vec<Vec2> {
    let mut taut = vec![path[0]];
    let mut i = 0;
    while i + 1 < path.len() {
        let is_clear = |&j: &usize| navigation.obstacles().is_clear_between(path[i], path[j]);
        i = (i + 1..path.len()).rev().find(is_clear).unwrap_or(i + 1);
        taut.push(path[i]);
    }
    taut
}

#[test]
fn paths_in_real_houses_are_those_of_a_fine_any_angle_lattice() {
    let num_pairs: usize =
        std::env::var("EVONAV_NUM_PAIRS").ok().and_then(|v| v.parse().ok()).unwrap_or(60);
    let files = house_lines(&["roseh-procthor-100k-history/tiny-val.jsonl.gz"]);
    let (name, lines) = &files[0];
    let houses = &lines[..20];
    let (mut worst, mut best, mut sum) = (0.0_f64, f64::INFINITY, 0.0);
    let (mut num_done, mut num_close) = (0, 0);
    for (i, line) in houses.iter().enumerate() {
        let house = house_of(&format!("{name}:{i}"), line);
        let navigation = navigation_of(&scene_of(&house), AgentBody::DEFAULT);
        let start = house.start.expect("a start").position_m;
        let reached = navigation.reachable_positions([start[0], start[2]], 0.25).expect("a grid");
        let lattice = Lattice::new(&navigation);
        let mut rng = Stream::new(i as u64, &["pairs"]);
        for _ in 0..num_pairs.div_ceil(houses.len()) {
            let [a, b] = [0; 2].map(|_| reached[rng.below(reached.len())]);
            if a == b {
                continue;
            }
            let path = navigation.shortest_path(a, b).expect("both are reachable");
            let length_m = path_length_m(&path);
            let field_m = navigation.distances_m(a, &[b])[0];
            assert!((length_m - field_m).abs() < 1e-6, "{length_m} {field_m}");
            let fine = lattice.path(lattice.index_of(a), lattice.index_of(b)).expect("a path");
            let fine_m = path_length_m(&pulled_taut(&navigation, &fine));
            let ratio = length_m / fine_m;
            assert!(length_m >= distance_2d_m(a, b) - 1e-9);
            // The lattice is coarse where passages are narrow: there it is the longer one.
            assert!((0.95..=1.001).contains(&ratio), "house {i} {a:?} {b:?}: {length_m} {fine_m}");
            num_close += usize::from(ratio >= 0.98);
            (worst, best) = (worst.max(ratio), best.min(ratio));
            (sum, num_done) = (sum + ratio, num_done + 1);
        }
    }
    let mean = sum / num_done as f64;
    assert!(num_close * 100 >= num_done * 99, "{num_close} of {num_done} within 2%");
    eprintln!(
        "{num_done} pairs, {num_close} within 2%: ours / fine reference {best:.4} to {worst:.4}, mean {mean:.5}"
    );
}
