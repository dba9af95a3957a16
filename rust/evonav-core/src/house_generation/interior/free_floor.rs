//! The floor of a room that is still free, as rectangles.

use crate::{
    geometry::{Vec2, bounds_2d_m, polygon_contains},
    house_generation::rectangle::Rectangle,
};

/// Distance below which two coordinates are one.
const SAME_M: f64 = 1e-6;

/// A room's floor without doorways and without the floor of its furniture.
#[derive(Debug, Clone)]
pub(in crate::house_generation) struct FreeFloor {
    /// Outline of the room.
    pub polygon_m: Vec<Vec2>,
    /// Rectangles that are not free.
    taken: Vec<Rectangle>,
}

impl FreeFloor {
    /// Create the free floor of an empty room.
    pub fn new(polygon_m: Vec<Vec2>, passages: &[Rectangle]) -> Self {
        Self { polygon_m, taken: passages.to_vec() }
    }

    /// Take a rectangle away.
    pub fn take(&mut self, rectangle: Rectangle) {
        self.taken.push(rectangle);
    }

    /// Return every free rectangle whose edges lie on lines through corners of the room and edges
    /// of what is taken.
    ///
    /// # Complexity
    /// O(n^4) for n lines along each axis, of which a furnished room has about 15.
    pub fn rectangles(&self) -> Vec<Rectangle> {
        let bounds = bounds_2d_m(self.polygon_m.iter().copied());
        let lines = [0, 1].map(|axis| self.lines(axis, bounds));
        let [xs, zs] = &lines;
        let middle = |a: f64, b: f64| 0.5 * (a + b);
        let num_z = zs.len() - 1;
        let is_free: Vec<bool> = xs
            .windows(2)
            .flat_map(|x| zs.windows(2).map(move |z| [middle(x[0], x[1]), middle(z[0], z[1])]))
            .map(|point| self.is_free(point))
            .collect();
        let mut found = Vec::new();
        for left in 0..xs.len() - 1 {
            // Whether the cells of each row are free from `left` to the present column.
            let mut is_open = vec![true; num_z];
            for right in left..xs.len() - 1 {
                for (row, open) in is_open.iter_mut().enumerate() {
                    *open &= is_free[right * num_z + row];
                }
                for bottom in 0..num_z {
                    for top in (bottom..num_z).take_while(|&row| is_open[row]) {
                        let (low_m, high_m) =
                            ([xs[left], zs[bottom]], [xs[right + 1], zs[top + 1]]);
                        found.push(Rectangle { low_m, high_m });
                    }
                }
            }
        }
        found
    }

    /// Return the largest free rectangle; `None` if the floor is full.
    pub fn largest(&self) -> Option<Rectangle> {
        largest_of(&self.rectangles())
    }

    fn is_free(&self, point_m: Vec2) -> bool {
        polygon_contains(&self.polygon_m, point_m)
            && !self.taken.iter().any(|taken| taken.contains(point_m))
    }

    /// Return the coordinates along an axis at which something begins or ends, ascending.
    fn lines(&self, axis: usize, [low, high]: [Vec2; 2]) -> Vec<f64> {
        let corners = self.polygon_m.iter().map(|corner| corner[axis]);
        let edges = self.taken.iter().flat_map(|it| [it.low_m[axis], it.high_m[axis]]);
        let mut lines: Vec<f64> = corners
            .chain(edges)
            .filter(|&value| low[axis] - SAME_M <= value && value <= high[axis] + SAME_M)
            .collect();
        lines.sort_by(f64::total_cmp);
        lines.dedup_by(|a, b| *a - *b < SAME_M);
        lines
    }
}

/// Return the largest of some rectangles, the first of equals; `None` if there are none.
pub(super) fn largest_of(rectangles: &[Rectangle]) -> Option<Rectangle> {
    let mut best: Option<(f64, Rectangle)> = None;
    for &rectangle in rectangles {
        let area_m2 = rectangle.area_m2();
        if best.is_none_or(|(largest_m2, _)| area_m2 > largest_m2) {
            best = Some((area_m2, rectangle));
        }
    }
    best.map(|(_, rectangle)| rectangle)
}
