//! Which room evolves between two stages (paper, Sec. 3.2), and how.

use serde::{Deserialize, Serialize};

use crate::{evolution::Parameters, rng::Stream};

/// How a room is modified.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum Mode {
    /// One large object moves, with what stands on it.
    SalientObject,
    /// All objects move; asset groups and supported objects stay together.
    RetainGroup,
    /// All objects move, each on its own.
    FullShuffle,
}

impl Mode {
    /// In the order of [`Parameters::mode_weights`].
    pub const ALL: [Self; 3] = [Self::SalientObject, Self::RetainGroup, Self::FullShuffle];

    /// As records name it.
    pub fn name(self) -> &'static str {
        match self {
            Self::SalientObject => "SALIENT_OBJECT",
            Self::RetainGroup => "RETAIN_GROUP",
            Self::FullShuffle => "FULL_SHUFFLE",
        }
    }

    /// Draws a mode (paper, Sec. A.2).
    pub fn sample(parameters: &Parameters, stream: &mut Stream) -> Option<Self> {
        stream.choose_weighted(&parameters.mode_weights()).map(|index| Self::ALL[index])
    }
}

/// What a room's weight is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RoomHistory {
    /// Objects in the room, children included.
    pub num_assets: usize,
    /// The reference trajectory has been in it.
    pub is_visited: bool,
    /// The reference trajectory is in it now.
    pub is_transition_room: bool,
    /// It changed within the last `changed_room_window` transitions.
    pub was_changed_recently: bool,
}

/// `q_asset * q_visited * q_current * q_evolved` of one room, not normalised.
///
/// `q_evolved` looks back `changed_room_window` transitions. The paper's "sampled at k - 2" counts
/// transitions by their first stage: the one just before (k - 1 -> k); its hyperparameter table
/// gives the length of the stored list (Sec. 3.2, A.2).
pub fn evolved_room_weight(room: RoomHistory, parameters: &Parameters) -> f64 {
    if room.is_transition_room {
        return 0.0;
    }
    let visited = if room.is_visited { parameters.visited_factor } else { 1.0 };
    let changed = if room.was_changed_recently { parameters.recently_changed_factor } else { 1.0 };
    room.num_assets as f64 * visited * changed
}

/// Draws the room that evolves.
///
/// # Returns
/// Its index and every room's weight; `None` for the index if all weights are 0.
pub fn sample_evolved_room(
    rooms: &[RoomHistory],
    parameters: &Parameters,
    stream: &mut Stream,
) -> (Option<usize>, Vec<f64>) {
    let weights: Vec<f64> =
        rooms.iter().map(|&room| evolved_room_weight(room, parameters)).collect();
    (stream.choose_weighted(&weights), weights)
}
