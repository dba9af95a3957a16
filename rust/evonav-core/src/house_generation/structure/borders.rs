//! Rooms as polygons, and the borders between them, from a floor plan's cells.

use crate::{
    geometry::{Vec2, distance_2d_m},
    house_generation::{
        parameters::{HouseParameters, RoomSpec},
        sampling::{beta, uniform_in},
        structure::{
            boundary::{Cell, Cells, sample_boundary},
            floor_plan::grow_floor_plan,
        },
    },
    rng::Stream,
    world::layout::rounding::round_to,
};

/// Step to which corners are rounded (`scale_boundary_groups`).
const CORNER_M: f64 = 1e-3;
/// Number of the first room: 0 and 1 are taken for empty cells and the outside.
const FIRST_ROOM: usize = 2;

/// A corner of cells: numbers along x and z.
type Corner = [usize; 2];

/// The rooms of a house and the borders between them.
#[derive(Debug, Clone)]
pub(in crate::house_generation) struct Structure {
    /// Name of the room spec.
    pub spec_id: String,
    /// Rooms, in the order of the spec.
    pub rooms: Vec<PlannedRoom>,
    /// Straight borders of rooms, each as long as it separates the same two.
    pub borders: Vec<Border>,
    /// Height of the ceiling.
    pub height_m: f64,
}

/// A room of a structure.
#[derive(Debug, Clone)]
pub(in crate::house_generation) struct PlannedRoom {
    /// Number in ids, as in `room|4`.
    pub number: usize,
    /// Room type.
    pub room_type: String,
    /// Sides, clockwise seen from above: the room is on the right of each.
    pub sides: Vec<Side>,
}

/// A border as a room sees it.
#[derive(Debug, Clone, Copy)]
pub(in crate::house_generation) struct Side {
    /// Index of the border.
    pub border: usize,
    /// First end.
    pub from_m: Vec2,
    /// Second end.
    pub to_m: Vec2,
}

/// A straight border between two rooms, or between a room and the outside.
#[derive(Debug, Clone)]
pub(in crate::house_generation) struct Border {
    /// Index of a room, and of the other one; `None` for the outside.
    pub rooms: (usize, Option<usize>),
    /// End of smaller coordinates.
    pub low_m: Vec2,
    /// End of larger coordinates.
    pub high_m: Vec2,
}

impl Border {
    /// Return the length.
    pub fn length_m(&self) -> f64 {
        distance_2d_m(self.low_m, self.high_m)
    }

    /// Return the part of wall ids that tells where the wall is.
    pub fn position_id(&self) -> String {
        let ([x0, z0], [x1, z1]) = (self.low_m, self.high_m);
        format!("{x0:.2}|{z0:.2}|{x1:.2}|{z1:.2}")
    }
}

impl PlannedRoom {
    /// Return the floor's outline, clockwise, with a corner wherever a border ends.
    pub fn polygon_m(&self) -> Vec<Vec2> {
        self.sides.iter().map(|side| side.from_m).collect()
    }
}

impl Side {
    /// Return the unit vector from the first end to the second.
    pub fn along(&self) -> Vec2 {
        let length_m = distance_2d_m(self.from_m, self.to_m);
        [0, 1].map(|i| (self.to_m[i] - self.from_m[i]) / length_m)
    }
}

impl Structure {
    /// Draw rooms, borders and height.
    ///
    /// # Returns
    /// `None` if the drawn outline does not hold the rooms, or if a room would be in two pieces,
    /// around another one, or two of its cells would only touch at a corner.
    pub fn sample(
        parameters: &HouseParameters,
        spec: &RoomSpec,
        stream: &mut Stream,
    ) -> Option<Self> {
        let leaves = spec.leaves();
        let cell_m = uniform_in(stream, parameters.structure.cell_m);
        let boundary = sample_boundary(&parameters.structure, spec, leaves.len(), stream);
        let cells = grow_floor_plan(&parameters.structure, spec, &boundary, stream)?;
        let runs = border_runs(&cells);
        let at = |corner: Corner| corner.map(|number| round_to(number as f64 * cell_m, CORNER_M));
        let borders: Vec<Border> = runs
            .iter()
            .map(|run| Border { rooms: run.rooms, low_m: at(run.low), high_m: at(run.high) })
            .collect();
        let mut rooms = Vec::with_capacity(leaves.len());
        for (index, leaf) in leaves.iter().enumerate() {
            let ordered = loop_of(&runs, &cells, index)?
                .into_iter()
                .map(|(border, from, to)| Side { border, from_m: at(from), to_m: at(to) });
            rooms.push(PlannedRoom {
                number: FIRST_ROOM + index,
                room_type: leaf.room_type.clone().unwrap_or_default(),
                sides: ordered.collect(),
            });
        }
        let [low, high] = parameters.structure.height_m;
        let height_m = low + (high - low) * beta(stream, parameters.structure.height_beta);
        Some(Self {
            spec_id: spec.id.clone(),
            rooms,
            borders,
            height_m: round_to(height_m, CORNER_M),
        })
    }

    /// Return the id of a room's side of a border; of the outer side if `room` is `None`.
    pub fn wall_id(&self, room: Option<usize>, border: usize) -> String {
        let position = self.borders[border].position_id();
        match room {
            Some(room) => format!("wall|{}|{position}", self.rooms[room].number),
            None => format!("wall|exterior|{position}"),
        }
    }

    /// Return a room's side of a border; `None` if the room does not touch it.
    pub fn side(&self, room: usize, border: usize) -> Option<Side> {
        self.rooms[room].sides.iter().copied().find(|side| side.border == border)
    }
}

/// A border in numbers of cells.
#[derive(Debug, Clone)]
struct Run {
    rooms: (usize, Option<usize>),
    /// Cells on its side of smaller coordinates.
    before: Cell,
    low: Corner,
    high: Corner,
}

/// Return all borders: maximal straight lines between the same two rooms, each on one side.
fn border_runs(cells: &Cells) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for axis in 0..2 {
        // Lines across `axis`, so at a fixed number of it, from one end of the grid to the other.
        for fixed in 0..=cells.size[axis] {
            for along in 0..cells.size[1 - axis] {
                let beside = |offset: i64| {
                    let mut cell = [along as i64; 2];
                    cell[axis] = fixed as i64 + offset;
                    cells.at(cell[0], cell[1])
                };
                let before = beside(-1);
                let rooms = match (before, beside(0)) {
                    (Cell::Of(a), Cell::Of(b)) if a != b => (a.min(b), Some(a.max(b))),
                    (Cell::Of(a), Cell::Outside) | (Cell::Outside, Cell::Of(a)) => (a, None),
                    _ => continue,
                };
                let mut low = [along; 2];
                low[axis] = fixed;
                let mut high = low;
                high[1 - axis] += 1;
                let continues = |run: &&mut Run| {
                    (run.rooms, run.before, run.high, run.low[axis]) == (rooms, before, low, fixed)
                };
                match runs.last_mut().filter(continues) {
                    Some(run) => run.high = high,
                    None => runs.push(Run { rooms, before, low, high }),
                }
            }
        }
    }
    runs
}

/// Return the borders of a room with their ends in the order in which they are met clockwise;
/// `None` if they are not one loop that meets no corner twice.
fn loop_of(runs: &[Run], cells: &Cells, room: usize) -> Option<Vec<(usize, Corner, Corner)>> {
    let touches = |run: &Run| run.rooms.0 == room || run.rooms.1 == Some(room);
    let own: Vec<usize> = (0..runs.len()).filter(|&index| touches(&runs[index])).collect();
    let directed = |index: usize| {
        let run = &runs[index];
        let is_upright = run.low[0] == run.high[0];
        let [x, z] = [run.low[0] as i64, run.low[1] as i64];
        // Clockwise, with z up: the room is to the right of an upward line, and below a rightward
        // one.
        let is_forward = match is_upright {
            true => cells.at(x, z) == Cell::Of(room),
            false => cells.at(x, z - 1) == Cell::Of(room),
        };
        if is_forward { (index, run.low, run.high) } else { (index, run.high, run.low) }
    };
    let lines: Vec<(usize, Corner, Corner)> = own.into_iter().map(directed).collect();
    let mut found = vec![*lines.first()?];
    while found.len() < lines.len() {
        let end = found[found.len() - 1].2;
        let mut next = lines.iter().filter(|side| side.1 == end);
        let side = *next.next()?;
        // Two sides begin where cells of the room only touch at a corner.
        if next.next().is_some() || side.0 == found[0].0 {
            return None;
        }
        found.push(side);
    }
    let is_closed = found[found.len() - 1].2 == found[0].1;
    let is_simple = (0..found.len()).all(|i| found[..i].iter().all(|side| side.1 != found[i].1));
    (is_closed && is_simple).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::{border_runs, loop_of};
    use crate::house_generation::structure::boundary::{Cell, Cells};

    /// Two rooms on four cells: beside each other, and each in two cells that touch at a corner.
    #[test]
    fn rooms_that_touch_themselves_at_a_corner_have_no_outline() {
        let outlines = |rooms: [[usize; 2]; 2]| {
            let mut cells = Cells::empty([2, 2]);
            for (x, column) in rooms.into_iter().enumerate() {
                for (z, room) in column.into_iter().enumerate() {
                    cells.set(x, z, Cell::Of(room));
                }
            }
            let runs = border_runs(&cells);
            [0, 1].map(|room| loop_of(&runs, &cells, room).map(|sides| sides.len()))
        };
        assert_eq!(outlines([[0, 0], [1, 1]]), [Some(4), Some(4)]);
        assert_eq!(outlines([[0, 1], [1, 0]]), [None, None]);
    }
}
