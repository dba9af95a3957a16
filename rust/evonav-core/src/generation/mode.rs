//! How a room is modified.

use serde::{Deserialize, Serialize};

use crate::{generation::Parameters, rng::Stream};

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
