//! Sample the room that evolves between two stages (paper, Sec. 3.2).

use serde::Serialize;

use crate::{generation::Parameters, rng::Stream};

/// The factors of a room's weight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct RoomHistory {
    /// Number of objects in the room, children included.
    pub num_assets: usize,
    /// Whether the reference trajectory has been in it.
    pub is_visited: bool,
    /// Whether the reference trajectory ends in it.
    pub is_transition_room: bool,
    /// Whether it changed within the last `changed_room_window` transitions.
    pub was_changed_recently: bool,
}

/// Compute `q_asset * q_visited * q_current * q_evolved` of one room, not normalised.
///
/// `q_evolved` looks back `changed_room_window` transitions. The paper's "sampled at k - 2" numbers
/// transitions by their first stage and so means the one just before (k - 1 -> k); its
/// hyperparameter table gives the length of the stored list (Sec. 3.2, A.2).
pub fn evolved_room_weight(room: RoomHistory, parameters: &Parameters) -> f64 {
    if room.is_transition_room {
        return 0.0;
    }
    let visited = if room.is_visited { parameters.visited_factor } else { 1.0 };
    let changed = if room.was_changed_recently { parameters.recently_changed_factor } else { 1.0 };
    room.num_assets as f64 * visited * changed
}

/// Draw the room that evolves.
///
/// # Returns
/// The room's index and every room's weight; `None` for the index if all weights are 0.
pub fn sample_evolved_room(
    rooms: &[RoomHistory],
    parameters: &Parameters,
    stream: &mut Stream,
) -> (Option<usize>, Vec<f64>) {
    let weights: Vec<f64> =
        rooms.iter().map(|&room| evolved_room_weight(room, parameters)).collect();
    (stream.choose_weighted(&weights), weights)
}
