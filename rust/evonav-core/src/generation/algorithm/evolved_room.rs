//! Sample the room that evolves between two stages (paper, Sec. 3.2).

use crate::{
    generation::{Parameters, record::RoomHistory},
    rng::Stream,
};

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
