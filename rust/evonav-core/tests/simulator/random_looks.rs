//! Random looks: what they change, and what they leave as it is.

use std::{collections::BTreeSet, sync::LazyLock};

use evonav_core::{
    assets::UnknownAssets,
    geometry::Pose,
    house::{House, HouseDelta, ObjectMove},
    sensors::raster::{FrameBuffer, Style, Want},
    simulator::{EmbeddedSimulator, SimulatorConfig},
    world::{
        appearance::{Appearance, Change, Lighting, Surfaces},
        navigation::AgentBody,
    },
};
use proptest::{collection::vec, option, prelude::*, sample::subsequence};

const HOUSE: &str = include_str!("../data/house_39_objects.json");
const NUM_TURNS: usize = 4;

fn simulator_of(house: House) -> EmbeddedSimulator {
    let config = SimulatorConfig {
        image_px: [40, 30],
        vertical_fov_rad: std::f64::consts::FRAC_PI_2,
        clip_m: [0.1, 20.0],
        camera_height_m: 1.575,
        agent: AgentBody { radius_m: 0.2, height_m: 1.8 },
        unknown: UnknownAssets::CategoryDefault,
        style: Style::Default,
    };
    EmbeddedSimulator::new(house, config).expect("a usable house")
}

static OWN: LazyLock<EmbeddedSimulator> =
    LazyLock::new(|| simulator_of(House::from_json("house", HOUSE).expect("a valid house")));

/// Depth, instances and colours of the views around the start, in a style.
fn seen(simulator: &EmbeddedSimulator, style: Style) -> (Vec<f32>, Vec<i32>, Vec<u8>) {
    let want = Want { rgb: Some(style), instances: true };
    let mut found = (Vec::new(), Vec::new(), Vec::new());
    let mut out = FrameBuffer::default();
    for turn in 0..NUM_TURNS {
        let yaw_rad = std::f64::consts::TAU * turn as f64 / NUM_TURNS as f64;
        let pose = Pose { yaw_rad, ..OWN.start() };
        simulator.render(&simulator.view(&pose), want, &mut out).expect("a valid view");
        let instances = out.instances.clone();
        let (depth_m, rgb) = out.take();
        found.0.extend(depth_m);
        found.1.extend(instances);
        found.2.extend(rgb);
    }
    found
}

fn categories() -> Vec<String> {
    let all: BTreeSet<&String> = OWN.bodies().iter().map(|body| &body.category).collect();
    all.into_iter().cloned().collect()
}

prop_compose! {
    fn surfaces()(
        seed in any::<u64>(),
        categories in option::of(subsequence(categories(), 1..=3)),
    ) -> Surfaces {
        Surfaces { seed, categories, ..Surfaces::default() }
    }
}

fn change() -> impl Strategy<Value = Change> {
    prop_oneof![
        surfaces().prop_map(Change::Materials),
        surfaces().prop_map(Change::Colors),
        any::<u64>().prop_map(|seed| Change::Lighting(Lighting { seed, ..Lighting::default() })),
    ]
}

fn looks() -> impl Strategy<Value = Appearance> {
    vec(change(), 0..4).prop_map(|changes| Appearance { changes })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_look_changes_colours_alone_and_replaces_the_one_before(first in looks(), second in looks()) {
        let (depth_m, instances, rgb) = seen(&OWN, Style::Default);
        let once = seen(&OWN.with_look(&second), Style::Default);
        prop_assert_eq!(&once.0, &depth_m);
        prop_assert_eq!(&once.1, &instances);
        let again = seen(&OWN.with_look(&first).with_look(&second), Style::Default);
        prop_assert_eq!(&again.2, &once.2);
        let back = seen(&OWN.with_look(&second).with_look(&Appearance::default()), Style::Default);
        prop_assert_eq!(&back.2, &rgb);
    }

    #[test]
    fn surfaces_that_a_change_is_not_about_keep_their_colours(surfaces in surfaces(), is_colours: bool) {
        let named = surfaces.categories.clone();
        let change =
            if is_colours { Change::Colors(surfaces) } else { Change::Materials(surfaces) };
        let look = Appearance { changes: vec![change] };
        let (_, instances, before) = seen(&OWN, Style::Plain);
        let (_, _, after) = seen(&OWN.with_look(&look), Style::Plain);
        let pixels = before.chunks_exact(3).zip(after.chunks_exact(3)).zip(&instances);
        for ((before, after), &instance) in pixels {
            if before != after {
                let body = &OWN.bodies()[instance as usize - 1];
                prop_assert!(
                    named.as_ref().is_none_or(|named| named.contains(&body.category)),
                    "{} is {:?} and was {:?}", body.category, after, before
                );
            }
        }
    }

    #[test]
    fn a_change_of_the_house_keeps_its_look(look in looks(), index in any::<prop::sample::Index>()) {
        let house = OWN.house();
        let object = index.get(&house.objects);
        let moved = ObjectMove {
            id: object.id.clone(),
            position_m: object.position_m,
            rotation_deg: object.rotation_deg.map(|angle| angle + 30.0),
            parent: object.parent.map(|above| house.objects[above].id.clone()),
        };
        let delta = HouseDelta { moves: vec![moved], ..HouseDelta::default() };
        let before = OWN.with_look(&look).apply(&delta).expect("a known object");
        let after = OWN.apply(&delta).expect("a known object").with_look(&look);
        prop_assert_eq!(seen(&before, Style::Default), seen(&after, Style::Default));
    }
}

#[test]
fn seeds_give_different_looks() {
    let colours: BTreeSet<Vec<u8>> = (0..8)
        .map(|seed| {
            let surfaces = Surfaces { seed, ..Surfaces::default() };
            let look = Appearance { changes: vec![Change::Materials(surfaces)] };
            seen(&OWN.with_look(&look), Style::Default).2
        })
        .collect();
    assert_eq!(colours.len(), 8);
}
