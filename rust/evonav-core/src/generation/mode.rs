//! The modes in which a room is modified.

use serde::{Deserialize, Serialize};

use crate::{generation::Parameters, rng::Stream};

/// A mode in which a room is modified.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum Mode {
    /// One large object moves, with the objects on it.
    SalientObject,
    /// All objects move; asset groups and supported objects stay together.
    RetainGroup,
    /// All objects move, each on its own.
    FullShuffle,
}

impl Mode {
    /// All modes, in the order of [`Parameters::mode_weights`].
    pub const ALL: [Self; 3] = [Self::SalientObject, Self::RetainGroup, Self::FullShuffle];

    /// Return the mode's name in records.
    pub fn name(self) -> &'static str {
        match self {
            Self::SalientObject => "SALIENT_OBJECT",
            Self::RetainGroup => "RETAIN_GROUP",
            Self::FullShuffle => "FULL_SHUFFLE",
        }
    }

    /// Draw a mode (paper, Sec. A.2).
    pub fn sample(parameters: &Parameters, stream: &mut Stream) -> Option<Self> {
        stream.choose_weighted(&parameters.mode_weights()).map(|index| Self::ALL[index])
    }
}
