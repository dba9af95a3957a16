//! Light that changes slowly, at some points of a grid.

/// Light at some points of a grid, among them the last of each row and column.
pub(super) struct Coarse {
    step: usize,
    /// Columns and rows of the points.
    stops: [Vec<usize>; 2],
    points: Vec<[f32; 3]>,
}

impl Coarse {
    /// Look at every `step`-th point of a grid of `[columns, rows]`, 2 or more.
    pub fn of(size: [usize; 2], step: usize, light: impl Fn(usize, usize) -> [f32; 3]) -> Self {
        let stops = size.map(|num| (0..num - 1).step_by(step).chain([num - 1]).collect::<Vec<_>>());
        let [columns, rows] = &stops;
        let places = rows.iter().flat_map(|&row| columns.iter().map(move |&column| (column, row)));
        let points = places.map(|(column, row)| light(column, row)).collect();
        Self { step, stops, points }
    }

    /// Return the light at a point of the grid, interpolated.
    pub fn at(&self, column: usize, row: usize) -> [f32; 3] {
        let split = |axis: usize, place: usize| {
            let stops = &self.stops[axis];
            let before = (place / self.step).min(stops.len() - 2);
            let [start, end] = [stops[before], stops[before + 1]];
            (before, (place - start) as f32 / (end - start) as f32)
        };
        let ((left, right), (top, down)) = (split(0, column), split(1, row));
        let columns = self.stops[0].len();
        let between = |a: [f32; 3], b: [f32; 3], share: f32| -> [f32; 3] {
            std::array::from_fn(|i| a[i] + share * (b[i] - a[i]))
        };
        let pair = |row: usize| {
            let points = &self.points[row * columns + left..][..2];
            between(points[0], points[1], right)
        };
        between(pair(top), pair(top + 1), down)
    }
}
