//! The assets and groups from which a split's houses are furnished.

use std::collections::BTreeMap;

use crate::{
    assets::{
        Asset, Catalogue, Split,
        group_definition::GroupDefinition,
        placement_rule::{Place, PlacementRule},
    },
    geometry::{Vec2, Vec3},
};

/// Categories and groups with the assets of one split.
#[derive(Debug)]
pub(in crate::house_generation) struct Stock {
    /// Annotated categories, by name.
    pub categories: BTreeMap<&'static str, StockCategory>,
    /// Asset groups whose members all have assets.
    pub groups: Vec<StockGroup>,
}

/// A category with the assets that may be used.
#[derive(Debug)]
pub(in crate::house_generation) struct StockCategory {
    pub rule: &'static PlacementRule,
    pub assets: Vec<&'static Asset>,
    /// Whether such objects can be picked up or pushed: any asset of the category, of whatever
    /// split, since the database lacks this of some.
    pub is_movable: bool,
}

/// An asset group with the assets that may be used.
#[derive(Debug)]
pub(in crate::house_generation) struct StockGroup {
    pub definition: &'static GroupDefinition,
    /// Assets of each name of a member.
    pub assets: BTreeMap<&'static str, Vec<&'static Asset>>,
    /// Largest edges of the group, along x and z.
    pub size_m: Vec2,
}

impl Stock {
    /// Collect what a split may use: its own assets, and those of no split.
    pub fn of(catalogue: &'static Catalogue, split: Split) -> Self {
        let is_used = |asset: &&Asset| asset.split.is_none_or(|own| own == split);
        let used = |ids: &'static [String]| {
            ids.iter().filter_map(|id| catalogue.get(id)).filter(is_used).collect::<Vec<_>>()
        };
        let categories = catalogue.categories().into_iter().filter_map(|name| {
            let assets = used(catalogue.assets_in(name));
            let rule = catalogue.placement(name)?;
            let mut all = catalogue.assets_in(name).iter().filter_map(|id| catalogue.get(id));
            let is_movable = all.any(|asset| asset.is_pickupable || asset.is_moveable);
            (!assets.is_empty()).then_some((name, StockCategory { rule, assets, is_movable }))
        });
        let groups = catalogue.groups().iter().filter_map(|definition| {
            let named = definition.members.iter().filter(|member| !member.assets.is_empty());
            let assets: BTreeMap<&str, Vec<&Asset>> =
                named.map(|member| (member.name.as_str(), used(&member.assets))).collect();
            let is_complete = assets.values().all(|assets| !assets.is_empty());
            is_complete.then(|| StockGroup::new(definition, assets))
        });
        Self { categories: categories.collect(), groups: groups.collect() }
    }
}

impl StockCategory {
    /// Return whether single assets of the category stand on the floor of such a room.
    pub fn stands_in(&self, room_type: &str) -> bool {
        self.rule.is_placed(Place::Floor) && self.rule.room_weight(room_type) > 0.0
    }
}

impl StockGroup {
    fn new(
        definition: &'static GroupDefinition,
        assets: BTreeMap<&'static str, Vec<&'static Asset>>,
    ) -> Self {
        let mut size_m = [0.0; 2];
        for (axis, edge) in [(0, 0), (1, 2)] {
            let widest = |member: &str| {
                let assets = assets.get(member)?;
                assets.iter().max_by(|a, b| a.size_m[edge].total_cmp(&b.size_m[edge]))
            };
            let sizes_m: Vec<Option<Vec3>> = definition
                .members
                .iter()
                .map(|member| widest(&member.name).map(|asset| asset.size_m))
                .collect();
            size_m[axis] = bounds_of(definition, &sizes_m, &[])
                .map_or(0.0, |[low, high]| high[axis] - low[axis]);
        }
        Self { definition, assets, size_m }
    }

    /// Return whether a member may be of a category.
    pub fn has(&self, category: &str) -> bool {
        self.assets.values().flatten().any(|asset| asset.category == category)
    }
}

/// Return the box around the members of a group, in the frame of its first member.
pub(super) fn bounds_of(
    definition: &GroupDefinition,
    sizes_m: &[Option<Vec3>],
    turns_deg: &[f64],
) -> Option<[Vec2; 2]> {
    let poses = definition.arrange(sizes_m, turns_deg);
    let corners = poses.iter().flatten().map(|pose| {
        [-0.5, 0.5].map(|sign| [0, 1].map(|i| pose.centre_m[i] + sign * pose.extent_m[i]))
    });
    corners.reduce(|[low, high], [a, b]| {
        [[low[0].min(a[0]), low[1].min(a[1])], [high[0].max(b[0]), high[1].max(b[1])]]
    })
}
