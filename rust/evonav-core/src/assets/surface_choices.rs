//! The materials and paints that ProcTHOR's rooms have.

use std::sync::OnceLock;

use serde::Deserialize;

use crate::assets::asset::rgb;

/// Materials of floors and of walls, and colours of painted walls and ceilings, as ProcTHOR's
/// houses use them.
#[derive(Debug)]
pub struct SurfaceChoices {
    /// Names of floors' materials.
    pub floors: Vec<String>,
    /// Names of walls' materials.
    pub walls: Vec<String>,
    /// Colours of paint on the material `PureWhite`.
    pub paints: Vec<[u8; 3]>,
}

/// `data/surfaces.json`.
#[derive(Deserialize)]
struct File {
    floors: Vec<String>,
    walls: Vec<String>,
    paints: Vec<String>,
}

impl SurfaceChoices {
    /// Return the choices that are part of this build. They are read once, on first use.
    pub fn bundled() -> &'static Self {
        static BUNDLED: OnceLock<SurfaceChoices> = OnceLock::new();
        BUNDLED.get_or_init(|| {
            // The data is part of the build and read by a test: no user input can make this fail.
            #[allow(clippy::expect_used)]
            let File { floors, walls, paints } =
                serde_json::from_str(include_str!("../../data/surfaces.json"))
                    .expect("bundled surfaces are valid");
            Self { floors, walls, paints: paints.iter().map(|hex| rgb(hex)).collect() }
        })
    }
}
