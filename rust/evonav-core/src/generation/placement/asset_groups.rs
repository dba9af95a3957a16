//! Find the furniture that belongs together: ProcTHOR's asset groups.
//!
//! House files name the members of a group by numbers, `room|group|member`; some of ProcTHOR's
//! versions put a name before them (`chair-diningtable|7|2|0`). If ids contain no such numbers,
//! furniture that is arranged as in one of ProcTHOR's definitions is a group; in recorded houses
//! both ways find the same groups. A piece that an earlier change moved away from its group is on
//! its own.

use crate::{
    Error,
    assets::{Catalogue, UnknownAssets, group_definition::GroupDefinition},
    generation::placement::movable_group::MovableGroup,
    geometry::{Vec2, Vec3, distance_2d_m, rotate, yaw_rotation},
    house::House,
    rng::Stream,
    world::{layout::Layout, scene::Scene},
};

/// Tolerances of furniture's arrangement compared with a definition.
#[derive(Debug, Clone, Copy)]
struct Slack {
    /// Largest distance of a member from its place.
    near_m: f64,
    /// Largest deviation from its yaw, in addition to the definition's own spread.
    near_deg: f64,
}

/// Tolerances to recognise a group by its arrangement: less than the distance to the next seat of a
/// table.
const GROUPED: Slack = Slack { near_m: 0.25, near_deg: 15.0 };
/// Tolerances to confirm a group that the ids name.
const TOGETHER: Slack = Slack { near_m: 0.75, near_deg: 180.0 };

/// Furniture that moves together, the main piece first, and the definition that it matches.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AssetGroup {
    /// Indices of the objects that stand on the floor.
    pub roots: Vec<usize>,
    /// Index in [`Catalogue::groups`].
    pub definition: Option<usize>,
}

/// The group of an object by its id.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Key<'a> {
    /// The object is a member; the numbers of its room and its group.
    Member([&'a str; 2]),
    /// The object stands alone: its id is numbered, but not as a member's.
    Alone,
    /// The id contains no group.
    Unknown,
}

/// Group the furniture of a house by what moves together under `RETAIN_GROUP`.
///
/// # Errors
/// [`Error::House`] for an unknown asset, unless `unknown` allows it.
pub fn asset_groups(
    house: &House,
    catalogue: &Catalogue,
    unknown: UnknownAssets,
) -> Result<Vec<AssetGroup>, Error> {
    let layout = Layout::new(house, catalogue, unknown, Scene::build(house, catalogue, unknown)?)?;
    let of_room = |room: usize| {
        let in_room: Vec<usize> =
            (0..house.objects.len()).filter(|&i| house.objects[i].room == Some(room)).collect();
        groups_of(house, &layout, catalogue, &in_room)
    };
    Ok((0..house.rooms.len()).flat_map(of_room).collect())
}

/// Group the furniture of a room; a piece that belongs to no group is alone.
pub(crate) fn groups_of(
    house: &House,
    layout: &Layout,
    catalogue: &Catalogue,
    in_room: &[usize],
) -> Vec<AssetGroup> {
    let mut groups: Vec<(Key<'_>, AssetGroup)> = Vec::new();
    let mut unknown = Vec::new();
    for &index in in_room.iter().filter(|&&i| layout.items[i].is_on_floor) {
        let key = key_of(&house.objects[index].id);
        let same =
            groups.iter_mut().find(|(other, _)| matches!(key, Key::Member(_)) && *other == key);
        match (same, key) {
            (Some((_, group)), _) => group.roots.push(index),
            (None, Key::Unknown) => unknown.push(index),
            (None, _) => groups.push((key, AssetGroup { roots: vec![index], definition: None })),
        }
    }
    let mut groups: Vec<AssetGroup> = groups.into_iter().map(|(_, group)| group).collect();
    groups.iter_mut().for_each(|group| identify(group, layout, catalogue));
    let groups = groups.into_iter().flat_map(|group| match group.definition {
        Some(_) if group.roots.len() > 1 => standing(layout, catalogue, group.roots, TOGETHER),
        _ => vec![group],
    });
    let mut groups: Vec<AssetGroup> =
        groups.chain(standing(layout, catalogue, unknown, GROUPED)).collect();
    groups.iter_mut().for_each(|group| identify(group, layout, catalogue));
    groups
}

fn key_of(id: &str) -> Key<'_> {
    let is_number = |part: &&str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    let numbers: Vec<&str> = id.rsplit('|').take_while(is_number).collect();
    match numbers[..] {
        [_, group, room, ..] => Key::Member([room, group]),
        [_, _] => Key::Alone,
        _ => Key::Unknown,
    }
}

/// Find the definition of a group, and put its main piece first.
fn identify(group: &mut AssetGroup, layout: &Layout, catalogue: &Catalogue) {
    let category = |index: usize| layout.items[index].asset.category.as_str();
    let own = sorted(group.roots.iter().map(|&root| category(root)));
    let supports = |root: usize, above: &str| {
        layout.with_supported(root).iter().any(|&index| category(index) == above)
    };
    let fits = |definition: &&GroupDefinition| {
        let needs_above = definition.members.iter().filter(|member| member.is_above);
        sorted(definition.floor_categories()) == own
            && needs_above
                .into_iter()
                .all(|m| group.roots.iter().any(|&r| supports(r, &m.category)))
    };
    let Some(found) = catalogue.groups().iter().position(|d| fits(&d)) else { return };
    let main = &catalogue.groups()[found].members[0].category;
    group.definition = Some(found);
    group.roots.sort_by_key(|&root| (category(root) != main, root));
}

fn sorted<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut names: Vec<&str> = names.collect();
    names.sort_unstable();
    names
}

/// Find groups by the arrangement of furniture: the largest group of each main piece.
fn standing(
    layout: &Layout,
    catalogue: &Catalogue,
    mut alone: Vec<usize>,
    slack: Slack,
) -> Vec<AssetGroup> {
    let mut groups = Vec::new();
    for main in alone.clone() {
        let best = catalogue
            .groups()
            .iter()
            .map(|definition| members_about(layout, definition, main, &alone, slack))
            .max_by_key(Vec::len);
        if let Some(roots) = best.filter(|roots| roots.len() > 1) {
            alone.retain(|index| !roots.contains(index));
            groups.push(AssetGroup { roots, definition: None });
        }
    }
    groups
        .extend(alone.into_iter().map(|index| AssetGroup { roots: vec![index], definition: None }));
    groups
}

/// Return `main` and the pieces that are arranged around it as in the definition; empty if `main`
/// is not the definition's main piece.
fn members_about(
    layout: &Layout,
    definition: &GroupDefinition,
    main: usize,
    others: &[usize],
    slack: Slack,
) -> Vec<usize> {
    let item = |index: usize| &layout.items[index];
    if !others.contains(&main) || item(main).asset.category != definition.members[0].category {
        return Vec::new();
    }
    let mut slots: Vec<Option<usize>> = vec![None; definition.members.len()];
    let mut turns_deg = vec![0.0; slots.len()];
    slots[0] = Some(main);
    for slot in 1..slots.len() {
        let member = &definition.members[slot];
        let is_free = |&&index: &&usize| {
            !slots.contains(&Some(index)) && item(index).asset.category == member.category
        };
        let candidates: Vec<usize> = others.iter().filter(is_free).copied().collect();
        let near = candidates.into_iter().filter(|_| !member.is_above).filter_map(|index| {
            let (centre_m, yaw_deg) = in_frame(layout, main, index);
            let turn_deg = signed_deg(yaw_deg - member.turn_deg);
            slots[slot] = Some(index);
            turns_deg[slot] = turn_deg;
            let pose = poses(layout, definition, &slots, &turns_deg)[slot];
            slots[slot] = None;
            let distance_m = distance_2d_m(pose?, centre_m);
            let is_near =
                distance_m < slack.near_m && turn_deg.abs() <= member.spread_deg + slack.near_deg;
            is_near.then_some((distance_m, index, turn_deg))
        });
        if let Some((_, index, turn_deg)) = near.min_by(|a, b| a.0.total_cmp(&b.0)) {
            (slots[slot], turns_deg[slot]) = (Some(index), turn_deg);
        }
    }
    slots.into_iter().flatten().collect()
}

/// Return the centres of the objects in a definition's slots, by the definition.
fn poses(
    layout: &Layout,
    definition: &GroupDefinition,
    slots: &[Option<usize>],
    turns_deg: &[f64],
) -> Vec<Option<Vec2>> {
    let size = |slot: &Option<usize>| slot.map(|index| layout.items[index].asset.size_m);
    let sizes_m: Vec<Option<Vec3>> = slots.iter().map(size).collect();
    let poses = definition.arrange(&sizes_m, turns_deg);
    poses.into_iter().map(|pose| pose.map(|pose| pose.centre_m)).collect()
}

/// Return the centre and yaw of an object in another's frame.
fn in_frame(layout: &Layout, main: usize, index: usize) -> (Vec2, f64) {
    let [from, to] = [main, index].map(|i| layout.items[i].placement);
    let [x, z] = [0, 2].map(|axis| to.position_m[axis] - from.position_m[axis]);
    let local = rotate(&yaw_rotation(-from.rotation_deg[1].to_radians()), [x, 0.0, z]);
    ([local[0], local[2]], to.rotation_deg[1] - from.rotation_deg[1])
}

/// Bring an angle into -180..180.
fn signed_deg(angle_deg: f64) -> f64 {
    (angle_deg + 180.0).rem_euclid(360.0) - 180.0
}

/// Rearrange a group by a definition with the same main piece and a slot for each other piece.
/// Definition and slots are drawn if there are several.
///
/// # Returns
/// `None` if the furniture is not a group, or if pieces overlap in this draw.
pub(crate) fn rearranged(
    group: &MovableGroup,
    layout: &Layout,
    catalogue: &Catalogue,
    stream: &mut Stream,
) -> Option<MovableGroup> {
    group.definition?;
    let (&main, others) = group.roots.split_first()?;
    let category = |index: usize| layout.items[index].asset.category.as_str();
    let mut choices: Vec<usize> = (0..catalogue.groups().len()).collect();
    stream.shuffle(&mut choices);
    let (definition, slots) = choices.into_iter().find_map(|choice| {
        let definition = &catalogue.groups()[choice];
        let is_alike = definition.members[0].category == category(main);
        let mut slots: Vec<Option<usize>> = vec![None; definition.members.len()];
        slots[0] = Some(main);
        for &root in others {
            let free: Vec<usize> = (1..slots.len())
                .filter(|&slot| {
                    let member = &definition.members[slot];
                    let has_parent = member.parent.is_some_and(|parent| slots[parent].is_some());
                    slots[slot].is_none()
                        && !member.is_above
                        && has_parent
                        && member.category == category(root)
                })
                .collect();
            slots[*free.get(stream.below(free.len()))?] = Some(root);
        }
        is_alike.then_some((definition, slots))
    })?;
    let turns_deg: Vec<f64> = definition
        .members
        .iter()
        .map(|member| member.spread_deg * (2.0 * stream.uniform() - 1.0))
        .collect();
    let sizes_m: Vec<Option<Vec3>> =
        slots.iter().map(|slot| slot.map(|index| layout.items[index].asset.size_m)).collect();
    let poses = definition.arrange(&sizes_m, &turns_deg);
    let mut rearranged = group.clone();
    for (root, pose) in slots.iter().zip(poses).skip(1) {
        if let (Some(root), Some(pose)) = (root, pose) {
            rearranged.arrange(layout, *root, pose.centre_m, pose.yaw_deg);
        }
    }
    rearranged.is_sound().then_some(rearranged)
}
