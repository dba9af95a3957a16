//! Houses and recordings that are not in the repository: in the folder that `EVONAV_DATA` names,
//! see CONTRIBUTING.md. Tests that miss them say so, and use the bundled houses or pass.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use evonav_core::{
    assets::{Catalogue, UnknownAssets},
    house::House,
    world::{
        navigation::{AgentBody, Navigation, NavigationConfig},
        scene::Scene,
    },
};

const BUNDLED: &str =
    concat!(env!("CARGO_MANIFEST_DIR"), "/../../python/evonav/data/houses.jsonl.gz");

/// A file or folder of the data sets; `None`, and a line on what is missing, where it is not.
pub fn data_set(name: &str) -> Option<PathBuf> {
    let path = data_folder().join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {name} not found: set EVONAV_DATA to a folder that has it");
    None
}

/// Names and lines of those files of houses that are there, or of the bundled houses if none is.
pub fn house_lines(names: &[&str]) -> Vec<(String, Vec<String>)> {
    let found: Vec<_> = names
        .iter()
        .filter_map(|&name| data_set(name).map(|path| (name.to_owned(), lines(&path))))
        .collect();
    if found.is_empty() { vec![bundled_lines()] } else { found }
}

/// The houses that ship with evonav.
pub fn bundled_lines() -> (String, Vec<String>) {
    ("bundled".to_owned(), lines(Path::new(BUNDLED)))
}

/// `EVONAV_DATA`, or the folder beside the checkout.
pub fn data_folder() -> PathBuf {
    std::env::var_os("EVONAV_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..").join("shared/data"),
        PathBuf::from,
    )
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
