//! What belongs together in recorded houses: by their ids, and without them.

use std::collections::{BTreeMap, BTreeSet};

use crate::common::recorded::{house_lines, house_of};
use evonav_core::{
    assets::{Catalogue, UnknownAssets},
    generation::asset_groups,
    house::House,
};
use serde_json::Value;

const UNKNOWN: UnknownAssets = UnknownAssets::CategoryDefault;

/// Categories of the furniture of each group of two or more, sorted, as the ids tell it, by a plain
/// look at the file; and whether an id is one of `named`, with a word before the numbers.
fn groups_by_id(house: &House) -> BTreeMap<String, BTreeSet<String>> {
    let mut groups: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for object in house.objects.iter().filter(|object| object.parent.is_none()) {
        let parts: Vec<&str> = object.id.split('|').collect();
        let numbers: Vec<&str> =
            parts.iter().copied().filter(|p| p.chars().all(|c| c.is_ascii_digit())).collect();
        if numbers.len() == 3 {
            let key = format!("{}|{}", numbers[0], numbers[1]);
            groups.entry(key).or_default().insert(object.id.clone());
        }
    }
    groups.retain(|_, members| members.len() > 1);
    groups
}

fn groups_found(house: &House) -> BTreeMap<BTreeSet<String>, Option<String>> {
    let groups = asset_groups(house, Catalogue::bundled(), UNKNOWN).unwrap();
    let id = |&index: &usize| house.objects[index].id.clone();
    groups
        .into_iter()
        .filter(|group| group.roots.len() > 1)
        .map(|group| {
            let name = |index: usize| Catalogue::bundled().groups()[index].name.clone();
            (group.roots.iter().map(id).collect(), group.definition.map(name))
        })
        .collect()
}

/// The house with ids that tell nothing.
fn anonymous(line: &str) -> House {
    let mut document: Value = serde_json::from_str(line).unwrap();
    for (index, object) in document["objects"].as_array_mut().unwrap().iter_mut().enumerate() {
        object["id"] = Value::from(format!(
            "thing {index} was {}",
            object["id"].as_str().unwrap().replace("|", "-")
        ));
        for (child, object) in object["children"].as_array_mut().into_iter().flatten().enumerate() {
            object["id"] = Value::from(format!("thing {index} bears {child}"));
        }
    }
    House::from_json("anonymous", &document.to_string()).unwrap()
}

const FILES: [&str; 4] = [
    "ram81-procthor-100k-history/attr-onav-1k-val-100.jsonl.gz",
    "ram81-procthor-100k-history/uniform-hard-val-75.jsonl.gz",
    "roseh-procthor-100k-history/tiny-val.jsonl.gz",
    "roseh-procthor-100k-history/objaverse-val-100.jsonl.gz",
];

#[test]
fn ids_of_recorded_houses_name_procthors_groups() {
    let (mut num_groups, mut num_named) = (0, 0);
    for (file, lines) in house_lines(&FILES) {
        for (i, line) in lines.iter().enumerate() {
            let house = house_of(&file, line);
            let found = groups_found(&house);
            let expected: BTreeSet<BTreeSet<String>> = groups_by_id(&house).into_values().collect();
            assert_eq!(found.keys().cloned().collect::<BTreeSet<_>>(), expected, "{file} {i}");
            num_groups += found.len();
            num_named += found.values().filter(|name| name.is_some()).count();
        }
    }
    eprintln!("{num_groups} groups, {num_named} named");
    assert!(num_groups > 300, "{num_groups}");
    assert!(num_named as f64 > 0.99 * num_groups as f64, "{num_named} of {num_groups}");
}

#[test]
fn furniture_without_ids_is_grouped_as_the_generator_grouped_it() {
    let [mut num_ids, mut num_found, mut num_right] = [0, 0, 0];
    let mut missed: BTreeMap<String, usize> = BTreeMap::new();
    let files = house_lines(&FILES[..3]);
    for (file, line) in files.iter().flat_map(|(f, lines)| lines.iter().map(move |l| (f, l))) {
        let expected: BTreeMap<BTreeSet<String>, Option<String>> =
            groups_found(&house_of(file, line));
        let found: BTreeSet<BTreeSet<String>> = groups_found(&anonymous(line))
            .into_keys()
            .map(|ids| {
                ids.iter().map(|id| id.split(" was ").nth(1).unwrap().replace("-", "|")).collect()
            })
            .collect();
        num_ids += expected.len();
        num_found += found.len();
        num_right += found.iter().filter(|group| expected.contains_key(*group)).count();
        for (_, name) in expected.iter().filter(|(group, _)| !found.contains(*group)) {
            *missed.entry(name.clone().unwrap_or_default()).or_default() += 1;
        }
    }
    eprintln!("{num_ids} groups, {num_found} found, {num_right} of them right; missed: {missed:?}");
    assert!(num_right as f64 > 0.9 * num_ids as f64, "{num_right} of {num_ids}");
    assert!(num_right as f64 > 0.9 * num_found as f64, "{num_right} of {num_found}");
}
