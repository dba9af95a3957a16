//! Houses and recordings that are not in the repository: read from `$EVONAV_SHARED/data`, or from
//! `../shared/data` beside the checkout. Tests that miss them say so and pass.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use evonav_core::{
    assets::catalogue::{Catalogue, UnknownAssets},
    house::House,
    world::{
        collision::AgentBody,
        navigation::{Navigation, NavigationConfig},
        scene::Scene,
    },
};

/// The folder of the recordings, or a line on why nothing is tested.
pub fn recordings() -> Option<PathBuf> {
    let root = std::env::var_os("EVONAV_SHARED").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
        PathBuf::from,
    );
    let data = root.join("data");
    if data.is_dir() {
        return Some(data);
    }
    eprintln!("skipped: no recordings in {}", data.display());
    None
}

/// Lines of a gzipped JSONL file.
pub fn lines(path: &Path) -> Vec<String> {
    let output = Command::new("gzip").arg("-dc").arg(path).output().expect("gzip runs");
    assert!(output.status.success(), "{}", path.display());
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    text.lines().map(str::to_owned).collect()
}

/// A house that must load.
pub fn house_of(name: &str, line: &str) -> House {
    House::from_json(name, line).expect("a recorded house loads")
}

/// A scene that must build.
pub fn scene_of(house: &House) -> Scene {
    Scene::build(house, Catalogue::bundled(), UnknownAssets::CategoryDefault)
        .expect("a recorded house builds")
}

/// Its free space for an agent.
pub fn navigation_of(scene: &Scene, agent: AgentBody) -> Navigation {
    Navigation::build(scene, agent, NavigationConfig::default()).expect("sound geometry")
}
