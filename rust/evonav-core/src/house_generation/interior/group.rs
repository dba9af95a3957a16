//! Draw the members of an asset group (`AssetGroupGenerator` of the package `procthor`).

use std::collections::BTreeMap;

use crate::{
    assets::{Asset, group_definition::GroupMember, shapes::trimmed_shape},
    geometry::{Vec2, Vec3, euler_rotation_deg},
    house::Condition,
    house_generation::{
        interior::{
            piece::PlacedObject,
            stock::{StockGroup, bounds_of},
        },
        sampling::{choose, uniform_in},
    },
    rng::Stream,
    world::{
        footprint::{Footprint, footprint},
        layout::contact::overlap,
    },
};

/// A drawn group in its own frame, with the middle of its box at the origin.
#[derive(Debug, Clone)]
pub(super) struct DrawnGroup {
    /// Members; an object comes after the one that it stands on.
    pub objects: Vec<PlacedObject>,
    /// Edges of its box along x and z.
    pub size_m: Vec2,
}

impl DrawnGroup {
    /// Draw assets and yaws until no members touch; `None` if they do `num_tries` times.
    pub fn sample(group: &StockGroup, num_tries: usize, stream: &mut Stream) -> Option<Self> {
        (0..num_tries).find_map(|_| Self::draw(group, stream).filter(Self::is_sound))
    }

    fn draw(group: &StockGroup, stream: &mut Stream) -> Option<Self> {
        let definition = group.definition;
        let mut by_name: BTreeMap<&str, &'static Asset> = BTreeMap::new();
        for (&name, assets) in &group.assets {
            by_name.insert(name, *choose(stream, assets)?);
        }
        let asset_of = |member: &GroupMember| by_name.get(member.name.as_str()).copied();
        let members = definition.members.iter().map(asset_of).collect::<Option<Vec<_>>>()?;
        let turns_deg: Vec<f64> = definition
            .members
            .iter()
            .map(|member| uniform_in(stream, [-member.spread_deg, member.spread_deg]))
            .collect();
        let sizes_m: Vec<Option<Vec3>> = members.iter().map(|asset| Some(asset.size_m)).collect();
        let [low, high] = bounds_of(definition, &sizes_m, &turns_deg)?;
        let middle_m = [0, 1].map(|i| 0.5 * (low[i] + high[i]));
        let poses = definition.arrange(&sizes_m, &turns_deg);
        let mut objects: Vec<PlacedObject> = Vec::with_capacity(members.len());
        for ((member, asset), pose) in definition.members.iter().zip(members).zip(poses) {
            let pose = pose?;
            let parent = member.parent.filter(|_| member.is_above);
            let floor_m = parent.map_or(0.0, |parent| {
                let object = &objects[parent];
                object.position_m[1] + 0.5 * object.asset.size_m[1]
            });
            let [x, z] = [0, 1].map(|i| pose.centre_m[i] - middle_m[i]);
            objects.push(PlacedObject {
                asset,
                position_m: [x, floor_m + 0.5 * asset.size_m[1], z],
                rotation_deg: [0.0, pose.yaw_deg, 0.0],
                parent,
                openness: None,
            });
        }
        Some(Self { objects, size_m: [0, 1].map(|i| high[i] - low[i]) })
    }

    /// Return whether no two members touch that do not stand on each other.
    fn is_sound(&self) -> bool {
        let solids: Vec<Vec<Footprint>> = self.objects.iter().map(solids).collect();
        (0..solids.len()).all(|b| {
            (0..b).all(|a| self.objects[b].parent == Some(a) || !overlap(&solids[a], &solids[b]))
        })
    }
}

/// Return the outlines of an object's parts.
fn solids(object: &PlacedObject) -> Vec<Footprint> {
    let rotation = euler_rotation_deg(object.rotation_deg);
    let shape = trimmed_shape(object.asset, Condition { openness: object.openness, is_on: None });
    let parts = shape.placed(object.position_m, &rotation).parts;
    parts.iter().filter_map(|part| footprint(part, f64::NEG_INFINITY, f64::INFINITY)).collect()
}
