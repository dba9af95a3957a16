//! Find frontiers and follow them from one update to the next.
//!
//! Free cells that were seen from afar but not from close by, surrounded by unexplored cells, form
//! regions; view positions are on the border of the explored floor next to a region. Parameters and
//! rules are those of 3D-Mem (Yang et al., CVPR 2025), with two differences: no random numbers are
//! drawn, and a region's direction is the circular mean, which needs no handling of wrap-around.

use std::sync::Arc;

use crate::{
    Error,
    geometry::{Vec2, distance_2d_m},
    grid::bits::BitGrid,
    memory::{
        frontiers::{
            frontier::{Frontier, FrontierConfig},
            regions::{Region, find_regions},
            viewpoints::{place, place_at_border},
        },
        occupancy::OccupancyMap,
    },
};

/// The frontiers of a map, whose ids persist from one update to the next.
#[derive(Debug, Clone, Default)]
pub struct Frontiers {
    list: Vec<Arc<Frontier>>,
    next_id: u64,
    /// Whether the list contains borders because there are no regions
    /// ([`FrontierConfig::min_border_cells`]).
    is_last_resort: bool,
    given_up: Option<BitGrid>,
    last_agent_m: Option<Vec2>,
    num_stands: u32,
}

impl Frontiers {
    /// Return the frontiers of the last update, by ascending id.
    pub fn list(&self) -> &[Arc<Frontier>] {
        &self.list
    }

    /// Remove all frontiers. Ids are not used again.
    pub fn clear(&mut self) {
        self.list.clear();
        self.given_up = None;
        self.num_stands = 0;
    }

    /// Update the frontiers for the present map. A frontier whose region has hardly changed keeps
    /// its id, position and direction. New ones come in the order of their regions' first cells
    /// (row-major; the parts of a split region by angle).
    ///
    /// # Arguments
    /// * `agent_m` - position of the agent, `[x, z]`; frontiers lie on the free floor connected to
    ///   it.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if a number is not finite or outside its domain.
    ///
    /// # Complexity
    /// O(cells / 64) for the map, O(cells of the regions) for the rest.
    pub fn update(
        &mut self,
        map: &OccupancyMap,
        agent_m: Vec2,
        config: &FrontierConfig,
    ) -> Result<&[Arc<Frontier>], Error> {
        let seeds: Vec<[i32; 2]> = self
            .list
            .iter()
            .filter_map(|old| old.cells.get(old.cells.len() / 2))
            .copied()
            .collect();
        self.give_up(map, agent_m);
        let found = find_regions(map, agent_m, &seeds, self.given_up.as_ref(), config)?;
        self.is_last_resort = found.is_last_resort;
        self.last_agent_m = Some(agent_m);
        if found.is_last_resort {
            self.list.clear();
        }
        let (kept, fresh) = reconcile(std::mem::take(&mut self.list), found.regions, config);
        self.list = kept;
        for region in fresh {
            let place = if found.is_last_resort { place_at_border } else { place };
            let frontier = place(map, &found.edges, agent_m, region, self.next_id, config);
            self.list.push(Arc::new(frontier));
            self.next_id += 1;
        }
        Ok(&self.list)
    }

    /// Give up unknown cells that the agent cannot see: those that it did not see from the view
    /// position, or from as near as it could get (it did not move since the last update). An agent
    /// that does not move twice cannot reach the nearest view position.
    fn give_up(&mut self, map: &OccupancyMap, agent_m: Vec2) {
        let is_standing = self.last_agent_m.is_some_and(|last| distance_2d_m(last, agent_m) < 0.1);
        self.num_stands = if is_standing { self.num_stands + 1 } else { 0 };
        let (reached_m, around_m) = if is_standing { (0.8, 1.0) } else { (0.3, 0.5) };
        let far_m = |f: &&Arc<Frontier>| distance_2d_m(f.position_m, agent_m);
        let nearest = self.list.iter().min_by(|a, b| far_m(a).total_cmp(&far_m(b)));
        let nearest = nearest.filter(|_| self.num_stands >= 2);
        let reached = self.list.iter().filter(|f| self.is_last_resort && far_m(f) < reached_m);
        let is_around = |cell: &&[i32; 2]| {
            distance_2d_m(map.spec().centre_m(cell.map(|i| i as usize)), agent_m) < around_m
        };
        let hidden = reached.flat_map(|frontier| &frontier.cells).filter(is_around);
        for cell in nearest.into_iter().flat_map(|frontier| &frontier.cells).chain(hidden) {
            let [rows, cols] = [map.spec().rows, map.spec().cols];
            let given_up = self.given_up.get_or_insert_with(|| BitGrid::new(rows, cols));
            given_up.insert(cell[0] as usize, cell[1] as usize);
        }
    }
}

/// Compare old frontiers with regions: return the frontiers that stay, and the regions that become
/// new ones.
fn reconcile(
    old: Vec<Arc<Frontier>>,
    regions: Vec<Region>,
    config: &FrontierConfig,
) -> (Vec<Arc<Frontier>>, Vec<Region>) {
    let mut is_taken = vec![false; regions.len()];
    let mut is_staying = vec![false; old.len()];
    let overlaps_of = |frontier: &Arc<Frontier>| {
        let overlap = |region: &Region| {
            if frontier.span.meets(&region.span) {
                Overlap::new(&frontier.cells, &region.cells)
            } else {
                Overlap { shared: 0, either: frontier.cells.len() + region.cells.len() }
            }
        };
        regions.iter().map(overlap).collect()
    };
    let overlaps: Vec<Vec<Overlap>> = old.iter().map(overlaps_of).collect();
    for (i, row) in overlaps.iter().enumerate() {
        // The region is the same except for a few cells.
        if let Some(j) = (0..regions.len()).find(|&j| !is_taken[j] && row[j].is_same()) {
            (is_staying[i], is_taken[j]) = (true, true);
            continue;
        }
        // The region was split into parts that together are still the same region.
        let parts: Vec<usize> =
            (0..regions.len()).filter(|&j| !is_taken[j] && row[j].iou() > 0.02).collect();
        let total: f64 = parts.iter().map(|&j| row[j].iou()).sum();
        if parts.len() >= 2 && total > 0.95 && total <= 1.0 {
            is_staying[i] = true;
            parts.iter().for_each(|&j| is_taken[j] = true);
        }
    }
    // Old regions may have merged into one.
    for (j, region) in regions.iter().enumerate() {
        if is_taken[j] {
            continue;
        }
        let parts: Vec<usize> =
            (0..old.len()).filter(|&i| !is_staying[i] && overlaps[i][j].iou() > 0.02).collect();
        let total: f64 = parts.iter().map(|&i| overlaps[i][j].iou()).sum();
        let num_cells: usize = parts.iter().map(|&i| old[i].cells.len()).sum();
        let ratio =
            num_cells.min(region.cells.len()) as f64 / num_cells.max(region.cells.len()) as f64;
        if parts.len() >= 2 && total > 0.95 && total <= 1.0 && ratio > 0.95 {
            is_taken[j] = true;
            parts.iter().for_each(|&i| is_staying[i] = true);
        }
    }
    let staying: Vec<Arc<Frontier>> =
        old.into_iter().zip(is_staying).filter(|(_, keep)| *keep).map(|(f, _)| f).collect();
    let fresh = regions.into_iter().zip(is_taken).filter(|(_, taken)| !taken).filter_map(
        |(Region { mut cells, span }, _)| {
            let num_before = cells.len();
            for frontier in staying.iter().filter(|frontier| frontier.span.meets(&span)) {
                cells.retain(|cell| frontier.cells.binary_search(cell).is_err());
            }
            if cells.len() == num_before {
                return Some(Region { cells, span });
            }
            (cells.len() >= config.min_cells).then(|| Region::new(cells))
        },
    );
    let fresh = fresh.collect();
    (staying, fresh)
}

/// The numbers of cells that two regions (in row-major order) share and have together.
struct Overlap {
    shared: usize,
    either: usize,
}

impl Overlap {
    fn new(a: &[[i32; 2]], b: &[[i32; 2]]) -> Self {
        if a == b {
            return Self { shared: a.len(), either: a.len() };
        }
        let mut shared = 0;
        let (mut i, mut j) = (0, 0);
        while i < a.len() && j < b.len() {
            match a[i].cmp(&b[j]) {
                std::cmp::Ordering::Less => i += 1,
                std::cmp::Ordering::Greater => j += 1,
                std::cmp::Ordering::Equal => (shared, i, j) = (shared + 1, i + 1, j + 1),
            }
        }
        Self { shared, either: a.len() + b.len() - shared }
    }

    fn iou(&self) -> f64 {
        self.shared as f64 / self.either.max(1) as f64
    }

    fn is_same(&self) -> bool {
        let difference = self.either - self.shared;
        (self.iou() > 0.95 && difference < 75) || difference <= 3
    }
}
