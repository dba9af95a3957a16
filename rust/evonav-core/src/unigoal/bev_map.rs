//! UniGoal's bird's-eye map: obstacles, explored cells and categories, fused by maximum.

use crate::{
    Error,
    geometry::{Vec2, Vec3},
    grid::{GridSpec, bits::BitGrid, dilate::dilate_disk, fast_marching::Window},
    unigoal::{bev_config::BevConfig, depth_view::DepthView, voxel_columns::Block},
};

/// The bird's-eye map of one task. Cells that were once seen are never cleared.
#[derive(Debug, Clone)]
pub struct BevMap {
    spec: GridSpec,
    config: BevConfig,
    obstacles: BitGrid,
    explored: BitGrid,
    visited: BitGrid,
    collisions: BitGrid,
    /// Number of points in each cell by category, at most `category_points`; empty until the
    /// category is first seen.
    categories: Vec<Vec<u8>>,
    /// First and last row and column of the explored and visited cells.
    known: Option<[[usize; 2]; 2]>,
    block: Block,
}

impl BevMap {
    /// Create an empty map centred on `centre_m`.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] as [`BevConfig::check`], if the centre is not finite, or for more
    /// than 256 categories.
    pub fn new(centre_m: Vec2, num_categories: usize, config: BevConfig) -> Result<Self, Error> {
        config.check()?;
        Error::require_finite("centre_m", &centre_m)?;
        Error::require("num_categories", num_categories, "at most 256", |n| n <= 256)?;
        let side = (config.size_m / config.cell_m).round().max(1.0) as usize;
        let half_m = 0.5 * side as f64 * config.cell_m;
        let corner_m = centre_m.map(|v| v - half_m);
        let empty = BitGrid::new(side, side);
        Ok(Self {
            spec: GridSpec { rows: side, cols: side, cell_m: config.cell_m, corner_m },
            config,
            obstacles: empty.clone(),
            explored: empty.clone(),
            visited: empty.clone(),
            collisions: empty,
            categories: vec![Vec::new(); num_categories],
            known: None,
            block: Block::default(),
        })
    }

    /// Return the shape and position of the map.
    pub fn spec(&self) -> &GridSpec {
        &self.spec
    }

    /// Return the cells where an obstacle was seen.
    pub fn obstacles(&self) -> &BitGrid {
        &self.obstacles
    }

    /// Return the cells where something was seen at any height.
    pub fn explored(&self) -> &BitGrid {
        &self.explored
    }

    /// Return the cells where the agent has been.
    pub fn visited(&self) -> &BitGrid {
        &self.visited
    }

    /// Return the cells at which moves have failed.
    pub fn collisions(&self) -> &BitGrid {
        &self.collisions
    }

    /// Return the certainty of a category in each cell, row-major, 0 to 1.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if there is no such category.
    pub fn category(&self, index: usize) -> Result<Vec<f32>, Error> {
        let Some(counts) = self.categories.get(index) else {
            let expected = format!("below {}", self.categories.len());
            return Err(Error::invalid("category", index, &expected));
        };
        if counts.is_empty() {
            return Ok(vec![0.0; self.spec.len()]);
        }
        let most = f32::from(self.config.category_points);
        Ok(counts.iter().map(|&count| f32::from(count) / most).collect())
    }

    /// Add one view to the map.
    ///
    /// A point is distributed over the eight voxels around it. A cell is explored if its column of
    /// voxels has a point at any height. It is an obstacle if it has a point between
    /// `obstacle_min_m` and the camera, or one below `-obstacle_min_m` and none around the floor (a
    /// hole). Half a point counts as one. Points outside the block in front of the camera do not
    /// count.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the images are not of the camera's size, a category is out of
    /// range or the camera makes no image; the map is then unchanged.
    ///
    /// # Complexity
    /// O(pixels / stride^2).
    ///
    /// # Source
    /// The mapping of UniGoal (Yin et al., CVPR 2025), as in SemExp (Chaplot et al., NeurIPS 2020).
    pub fn integrate(&mut self, view: &DepthView<'_>) -> Result<(), Error> {
        view.check(self.categories.len())?;
        let mut block = std::mem::take(&mut self.block);
        block.fill(view, &self.spec, &self.config);
        let spec = self.spec;
        for (cell, seen) in block.explored(&spec) {
            self.explored.insert(cell[0], cell[1]);
            if seen.is_obstacle() {
                self.obstacles.insert(cell[0], cell[1]);
            }
            self.know(cell);
        }
        for category in block.categories() {
            let counts = &mut self.categories[category];
            if counts.is_empty() {
                counts.resize(spec.len(), 0);
            }
            for (cell, count) in block.count_category(category, &spec) {
                let count = count.min(u32::from(self.config.category_points)) as u8;
                let stored = &mut counts[spec.index(cell)];
                *stored = count.max(*stored);
            }
        }
        self.block = block;
        Ok(())
    }

    /// Mark the cells of a straight path as visited; cells off the map are left out.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if a number is not finite.
    pub fn visit(&mut self, from_m: Vec2, to_m: Vec2) -> Result<(), Error> {
        Error::require_finite("visit", &[from_m, to_m].concat())?;
        let far_m = (to_m[0] - from_m[0]).hypot(to_m[1] - from_m[1]);
        let num_steps = (2.0 * far_m / self.spec.cell_m).ceil().clamp(1.0, 1e5);
        for step in 0..=num_steps as usize {
            let share = step as f64 / num_steps;
            let point_m = [0, 1].map(|i| from_m[i] + share * (to_m[i] - from_m[i]));
            if let Some(cell) = self.spec.cell_of(point_m) {
                self.visited.insert(cell[0], cell[1]);
                self.know(cell);
            }
        }
        Ok(())
    }

    /// Mark cells at which a move failed; those off the map are left out.
    pub fn collide(&mut self, cells: &[[usize; 2]]) {
        cells.iter().for_each(|cell| self.collisions.insert(cell[0], cell[1]));
    }

    fn know(&mut self, cell: [usize; 2]) {
        let [low, high] = self.known.get_or_insert([cell; 2]);
        for axis in 0..2 {
            low[axis] = low[axis].min(cell[axis]);
            high[axis] = high[axis].max(cell[axis]);
        }
    }

    /// Return the cell of a point.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if it is off the map.
    pub fn require_cell(&self, name: &str, point_m: Vec2) -> Result<[usize; 2], Error> {
        let off = || Error::invalid(name, format!("{point_m:?}"), "a place on the map");
        self.spec.cell_of(point_m).ok_or_else(off)
    }

    /// Return the cells that a path may cross: all but obstacles grown by `radius` cells. Visited
    /// cells are free, cells at which a move failed are not, and the 3 x 3 cells around the agent
    /// are free.
    pub fn traversable(&self, agent: [usize; 2], radius: usize) -> BitGrid {
        let mut blocked = dilate_disk(&self.obstacles, radius);
        blocked.subtract(&self.visited);
        blocked.unite(&self.collisions);
        for row in agent[0].saturating_sub(1)..=agent[0] + 1 {
            for col in agent[1].saturating_sub(1)..=agent[1] + 1 {
                blocked.remove(row, col);
            }
        }
        blocked.invert();
        blocked
    }

    /// Return the rectangle around everything known and `cells`, grown by `margin` cells.
    pub fn window(&self, cells: &[[usize; 2]], margin: usize) -> Window {
        let known = self.known.iter().flatten().chain(cells);
        let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
        for cell in known {
            for axis in 0..2 {
                low[axis] = low[axis].min(cell[axis]);
                high[axis] = high[axis].max(cell[axis]);
            }
        }
        let first = low.map(|v| v.saturating_sub(margin));
        let shape = [self.spec.rows, self.spec.cols];
        let end = [0, 1].map(|i| high[i].saturating_add(margin + 1).min(shape[i]));
        Window { first, shape: [0, 1].map(|i| end[i].saturating_sub(first[i])) }
    }

    /// Return the cells of the marked pixels of a view, each once, row-major; cells off the map are
    /// left out.
    ///
    /// # Errors
    /// As [`Self::integrate`], and for a mask of another size.
    pub fn cells_of(&self, view: &DepthView<'_>, mask: &[bool]) -> Result<Vec<[i32; 2]>, Error> {
        view.check(self.categories.len())?;
        Error::require("mask", mask.len(), "one value a pixel", |n| n == view.depth_m.len())?;
        let width = view.camera.width_px;
        let mut cells = BitGrid::new(self.spec.rows, self.spec.cols);
        for (index, _) in mask.iter().enumerate().filter(|(_, marked)| **marked) {
            let depth_m = f64::from(view.depth_m[index]);
            if depth_m > 0.0 && depth_m <= self.config.max_depth_m {
                let pixel = [index % width, index / width].map(|k| k as f64 + 0.5);
                let point_m: Vec3 = view.camera.unproject(pixel, depth_m);
                if let Some([row, col]) = self.spec.cell_of([point_m[0], point_m[2]]) {
                    cells.insert(row, col);
                }
            }
        }
        Ok(cells.cells().map(|cell| cell.map(|i| i as i32)).collect())
    }
}
