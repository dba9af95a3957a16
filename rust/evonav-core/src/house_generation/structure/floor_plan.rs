//! Grow rooms on the cells of a house: the constrained growth of Lopes et al., "A Constrained
//! Growth Method for Procedural Floor Plan Generation" (GAME-ON 2010), as the package `procthor`
//! does it (`floorplan_generation`).

use crate::{
    house_generation::{
        parameters::{RoomNode, RoomSpec, Structure},
        structure::boundary::{Cell, Cells},
    },
    rng::Stream,
};

/// A rectangle of cells: least x and z, and the cells after the last.
type Span = [[usize; 2]; 2];

/// A room or group while it grows.
struct Growing<'a> {
    node: &'a RoomNode,
    /// Its number among all rooms and groups.
    number: usize,
    /// Rectangle around its cells.
    span: Span,
}

/// Directions of growth: axis, and whether towards larger numbers.
const DIRECTIONS: [(usize, bool); 4] = [(0, true), (0, false), (1, true), (1, false)];

/// Grow floor plans and return the one whose rooms' areas are nearest to the spec's ratios.
///
/// Cells of the result are numbered by the rooms of [`RoomSpec::leaves`].
///
/// # Returns
/// `None` if the outline was too small for the rooms in every attempt.
pub(super) fn grow_floor_plan(
    parameters: &Structure,
    spec: &RoomSpec,
    boundary: &Cells,
    stream: &mut Stream,
) -> Option<Cells> {
    let num_rooms = spec.leaves().len();
    let num_candidates = if num_rooms == 1 { 1 } else { parameters.num_candidates };
    let mut best: Option<(f64, Cells)> = None;
    for _ in 0..num_candidates {
        let mut cells = boundary.clone();
        let whole = [[0, 0], cells.size];
        let grown = grow(parameters, &spec.rooms, &mut cells, whole, [0, num_rooms], stream);
        if grown.is_none() || cells.count(Cell::Empty) > 0 {
            continue;
        }
        let score = overlap_of_areas(spec, &cells);
        if best.as_ref().is_none_or(|(highest, _)| score > *highest) {
            best = Some((score, cells));
        }
    }
    best.map(|(_, cells)| cells)
}

/// Grow `rooms` in the empty cells of `within`, then the rooms of each group in the group's cells.
///
/// # Arguments
/// * `first` - number of the first of all rooms in `rooms`. A group has, until its own rooms grow,
///   the number of its first room, counted on from the number of rooms of the house.
///
/// # Returns
/// `None` if there are too few cells.
fn grow(
    parameters: &Structure,
    rooms: &[RoomNode],
    cells: &mut Cells,
    within: Span,
    [first, num_rooms]: [usize; 2],
    stream: &mut Stream,
) -> Option<()> {
    let mut after = first;
    let mut growing: Vec<Growing<'_>> = rooms
        .iter()
        .map(|node| {
            let number = if node.rooms.is_empty() { after } else { num_rooms + after };
            after += node.leaves().len();
            Growing { node, number, span: within }
        })
        .collect();
    seed_rooms(&mut growing, cells, within, stream)?;
    let mut expand = |step: &dyn Fn(&mut Growing<'_>, &mut Cells, &mut Stream) -> bool| {
        let mut open: Vec<usize> = (0..growing.len()).collect();
        while !open.is_empty() {
            let ratios: Vec<f64> = open.iter().map(|&i| growing[i].node.ratio).collect();
            let Some(choice) = stream.choose_weighted(&ratios) else { break };
            if !step(&mut growing[open[choice]], cells, stream) {
                open.remove(choice);
            }
        }
    };
    let max_per_ratio = parameters.cells_per_ratio;
    expand(&|room, cells, stream| grow_rectangle(room, cells, within, max_per_ratio, stream));
    expand(&|room, cells, stream| grow_along_sides(room, cells, within, stream));
    for room in growing.iter().filter(|room| room.number >= num_rooms) {
        for [x, z] in in_span(room.span) {
            if cells.get(x, z) == Cell::Of(room.number) {
                cells.set(x, z, Cell::Empty);
            }
        }
        let numbers = [room.number - num_rooms, num_rooms];
        grow(parameters, &room.node.rooms, cells, room.span, numbers, stream)?;
    }
    Some(())
}

/// Give every room one cell, not next to the cells of others; `None` if there are too few.
fn seed_rooms(
    rooms: &mut [Growing<'_>],
    cells: &mut Cells,
    within: Span,
    stream: &mut Stream,
) -> Option<()> {
    let is_empty = |&[x, z]: &[usize; 2]| cells.get(x, z) == Cell::Empty;
    let mut free: Vec<[usize; 2]> = in_span(within).filter(is_empty).collect();
    for room in rooms {
        let [x, z] = *free.get(stream.below(free.len()))?;
        room.span = [[x, z], [x + 1, z + 1]];
        cells.set(x, z, Cell::Of(room.number));
        free.retain(|other| other[0].abs_diff(x) > 1 || other[1].abs_diff(z) > 1);
    }
    Some(())
}

/// Grow a room by the longest line of empty cells that leaves it a rectangle; false if there is
/// none, or if it is large enough.
fn grow_rectangle(
    room: &mut Growing<'_>,
    cells: &mut Cells,
    within: Span,
    max_per_ratio: f64,
    stream: &mut Stream,
) -> bool {
    let [low, high] = room.span;
    let area = (high[0] - low[0]) * (high[1] - low[1]);
    if area as f64 > room.node.ratio * max_per_ratio {
        return false;
    }
    let lines = DIRECTIONS.map(|direction| {
        let line = line_beyond(room.span, within, direction);
        let is_free = line.iter().all(|&[x, z]| cells.get(x, z) == Cell::Empty);
        if is_free { line } else { Vec::new() }
    });
    extend(room, cells, lines, stream)
}

/// Grow a room into the longest stretch of empty cells along one of its sides; false if there is
/// none.
fn grow_along_sides(
    room: &mut Growing<'_>,
    cells: &mut Cells,
    within: Span,
    stream: &mut Stream,
) -> bool {
    let lines = DIRECTIONS.map(|direction| {
        let (axis, is_up) = direction;
        let mut line = line_beyond(room.span, within, direction);
        line.retain(|&[x, z]| {
            let mut inner = [x, z];
            if is_up {
                inner[axis] -= 1
            } else {
                inner[axis] += 1
            }
            cells.get(x, z) == Cell::Empty && cells.get(inner[0], inner[1]) == Cell::Of(room.number)
        });
        line
    });
    extend(room, cells, lines, stream)
}

/// Add the longest of four lines of cells, one for each of [`DIRECTIONS`], to a room.
fn extend(
    room: &mut Growing<'_>,
    cells: &mut Cells,
    lines: [Vec<[usize; 2]>; 4],
    stream: &mut Stream,
) -> bool {
    let longest = lines.iter().map(Vec::len).max().unwrap_or(0);
    if longest == 0 {
        return false;
    }
    let choices: Vec<usize> = (0..4).filter(|&i| lines[i].len() == longest).collect();
    let choice = choices[stream.below(choices.len())];
    for &[x, z] in &lines[choice] {
        cells.set(x, z, Cell::Of(room.number));
    }
    let (axis, is_up) = DIRECTIONS[choice];
    if is_up {
        room.span[1][axis] += 1;
    } else {
        room.span[0][axis] -= 1;
    }
    true
}

/// Return the line of cells beside a rectangle; empty if it is beyond `within`.
fn line_beyond([low, high]: Span, within: Span, (axis, is_up): (usize, bool)) -> Vec<[usize; 2]> {
    let is_inside = if is_up { high[axis] < within[1][axis] } else { low[axis] > within[0][axis] };
    if !is_inside {
        return Vec::new();
    }
    let other = 1 - axis;
    let mut cell = [0; 2];
    cell[axis] = if is_up { high[axis] } else { low[axis] - 1 };
    let at = |along: usize| {
        let mut cell = cell;
        cell[other] = along;
        cell
    };
    (low[other]..high[other]).map(at).collect()
}

fn in_span([low, high]: Span) -> impl Iterator<Item = [usize; 2]> {
    (low[0]..high[0]).flat_map(move |x| (low[1]..high[1]).map(move |z| [x, z]))
}

/// Return the share of the floor, 0..1, that is divided as the ratios say
/// (`get_ratio_overlap_score`).
fn overlap_of_areas(spec: &RoomSpec, cells: &Cells) -> f64 {
    let mut ideal = Vec::new();
    ideal_shares(&spec.rooms, 1.0, &mut ideal);
    let counts: Vec<usize> = (0..ideal.len()).map(|room| cells.count(Cell::Of(room))).collect();
    let total = counts.iter().sum::<usize>().max(1) as f64;
    ideal.iter().zip(&counts).map(|(&share, &count)| share.min(count as f64 / total)).sum()
}

fn ideal_shares(rooms: &[RoomNode], whole: f64, shares: &mut Vec<f64>) {
    let sum: f64 = rooms.iter().map(|room| room.ratio).sum();
    for room in rooms {
        let share = whole * room.ratio / sum;
        if room.rooms.is_empty() {
            shares.push(share);
        } else {
            ideal_shares(&room.rooms, share, shares);
        }
    }
}
