//! Choose the rooms that are connected, by the rules of the package `procthor` (`doors.select_openings`).

use crate::{
    house_generation::{parameters::RoomNode, parameters::RoomSpec, structure::Structure},
    rng::Stream,
};

/// Draw the pairs of rooms that get a connection: within each group of the spec, every room or
/// group is connected to all others that it touches.
///
/// # Returns
/// `None` if a room or group of rooms touches none that it should be connected to.
pub(super) fn sample_connections(
    structure: &Structure,
    spec: &RoomSpec,
    stream: &mut Stream,
) -> Option<Vec<(usize, usize)>> {
    let leaves = spec.leaves();
    let is_private = |room: usize| leaves[room].is_private;
    let touch = |a: usize, b: usize| {
        let pair = (a.min(b), Some(a.max(b)));
        structure.borders.iter().any(|border| border.rooms == pair)
    };
    let mut groups = Vec::new();
    collect_groups(&spec.rooms, &mut 0, &mut groups);
    let mut chosen: Vec<(usize, usize)> = Vec::new();
    for members in &groups {
        let mut alone: Vec<usize> =
            if members.len() > 1 { (0..members.len()).collect() } else { Vec::new() };
        while !alone.is_empty() {
            let member = alone[stream.below(alone.len())];
            let mut others: Vec<usize> = (0..members.len()).filter(|&i| i != member).collect();
            stream.shuffle(&mut others);
            let mut is_connected = false;
            for other in others {
                let pairs = members[member]
                    .iter()
                    .flat_map(|&a| members[other].iter().map(move |&b| (a.min(b), a.max(b))));
                let mut pairs: Vec<(usize, usize)> = pairs.filter(|&(a, b)| touch(a, b)).collect();
                stream.shuffle(&mut pairs);
                // Doors to private rooms come last; the sort keeps the order otherwise.
                pairs.sort_by_key(|&(a, b)| is_private(a) || is_private(b));
                if let Some(&pair) = pairs.first() {
                    is_connected = true;
                    alone.retain(|&index| index != member && index != other);
                    if !chosen.contains(&pair) {
                        chosen.push(pair);
                    }
                }
            }
            if !is_connected {
                return None;
            }
        }
    }
    Some(chosen)
}

/// Collect, for every group from the inside out, the rooms of each of its members; return all rooms
/// of `rooms`.
fn collect_groups(
    rooms: &[RoomNode],
    next: &mut usize,
    groups: &mut Vec<Vec<Vec<usize>>>,
) -> Vec<usize> {
    let mut members = Vec::with_capacity(rooms.len());
    for node in rooms {
        members.push(if node.rooms.is_empty() {
            *next += 1;
            vec![*next - 1]
        } else {
            collect_groups(&node.rooms, next, groups)
        });
    }
    let all = members.concat();
    groups.push(members);
    all
}

/// Draw the room with the outside door: one of the preferred types if any touches the outside.
pub(super) fn sample_outside_room(
    structure: &Structure,
    preferred: &[String],
    stream: &mut Stream,
) -> Option<usize> {
    let is_outer =
        |&room: &usize| structure.borders.iter().any(|border| border.rooms == (room, None));
    let mut rooms: Vec<usize> = (0..structure.rooms.len()).filter(is_outer).collect();
    stream.shuffle(&mut rooms);
    let is_preferred = |&&room: &&usize| preferred.contains(&structure.rooms[room].room_type);
    rooms.iter().find(is_preferred).or(rooms.first()).copied()
}
