//! Layers of rooms: neighbours are in different ones, so that no light shines through a wall
//! (`layer` of the package `procthor`).

use crate::house_generation::structure::Structure;

/// Number of layers.
pub(super) const NUM_LAYERS: usize = 4;
/// Largest number of assignments tried; a plane map of rooms needs few.
const MAX_STEPS: usize = 100_000;

/// Return the layer of each room; rooms with an open border share one.
///
/// # Returns
/// `None` if no two rooms have a wall between them: files then have no layers.
pub(super) fn layers(structure: &Structure, is_open: &[bool]) -> Option<Vec<usize>> {
    let mut group: Vec<usize> = (0..structure.rooms.len()).collect();
    let pairs: Vec<(usize, usize, bool)> = structure
        .borders
        .iter()
        .zip(is_open)
        .filter_map(|(border, &open)| border.rooms.1.map(|other| (border.rooms.0, other, open)))
        .collect();
    for &(a, b, _) in pairs.iter().filter(|(_, _, open)| *open) {
        let (from, to) = (group[a], group[b]);
        group.iter_mut().filter(|other| **other == from).for_each(|other| *other = to);
    }
    let walls: Vec<(usize, usize)> =
        pairs.iter().map(|&(a, b, _)| (group[a], group[b])).filter(|(a, b)| a != b).collect();
    if walls.is_empty() {
        return None;
    }
    let mut layer = vec![None; group.len()];
    assign(0, &group, &walls, &mut layer, &mut 0)
        .then(|| group.iter().map(|&own| layer[own].unwrap_or(0)).collect())
}

/// Assign layers to the groups from `next` on; false if there is no way, or too many were tried.
fn assign(
    next: usize,
    group: &[usize],
    walls: &[(usize, usize)],
    layer: &mut [Option<usize>],
    num_steps: &mut usize,
) -> bool {
    let Some(own) = (next..group.len()).find(|&room| group[room] == room) else { return true };
    for choice in 0..NUM_LAYERS {
        *num_steps += 1;
        let clashes = |&(a, b): &(usize, usize)| {
            (a == own && layer[b] == Some(choice)) || (b == own && layer[a] == Some(choice))
        };
        if walls.iter().any(clashes) || *num_steps > MAX_STEPS {
            continue;
        }
        layer[own] = Some(choice);
        if assign(own + 1, group, walls, layer, num_steps) {
            return true;
        }
        layer[own] = None;
    }
    false
}
