//! The asset catalogue that ships with evonav; `scripts/data/build_asset_catalogue.py` builds its data.

use std::{collections::HashMap, sync::OnceLock};

use serde::Deserialize;

use crate::{
    assets::{
        Asset, OpeningSpace, asset::rgb, group_definition::GroupDefinition,
        placement_rule::PlacementRule,
    },
    geometry::Vec3,
};

/// Facts about 1,653 assets of 109 categories and 1,245 materials.
#[derive(Debug)]
pub struct Catalogue {
    assets: HashMap<String, Asset>,
    categories: HashMap<String, Category>,
    materials: HashMap<String, [u8; 3]>,
    groups: Vec<GroupDefinition>,
    openings: HashMap<String, OpeningSpace>,
}

/// Facts about a category.
#[derive(Debug, Default)]
struct Category {
    rule: Option<PlacementRule>,
    /// Share of each receptacle category's instances on which this category was recorded.
    supports: HashMap<String, f64>,
    /// Ids of the category's assets, sorted.
    asset_ids: Vec<String>,
    median_size_m: Vec3,
}

/// A file of the catalogue's data; each file has one of these lists.
#[derive(Deserialize, Default)]
#[serde(default)]
struct DataFile {
    assets: Vec<Asset>,
    categories: Vec<CategoryRow>,
    groups: Vec<GroupDefinition>,
    materials: Vec<(String, String)>,
    openings: Vec<OpeningSpace>,
}

#[derive(Deserialize)]
struct CategoryRow {
    name: String,
    #[serde(default)]
    supports: HashMap<String, f64>,
    #[serde(flatten)]
    rule: Option<PlacementRule>,
}

impl Catalogue {
    /// Return the catalogue that is part of this build. It is read once, on first use.
    pub fn bundled() -> &'static Self {
        static BUNDLED: OnceLock<Catalogue> = OnceLock::new();
        BUNDLED.get_or_init(|| {
            // The data is part of the build and read by a test: no user input can make this fail.
            #[allow(clippy::expect_used)]
            let read = |json: &str| -> DataFile {
                serde_json::from_str(json).expect("bundled catalogue is valid")
            };
            Self::new(DataFile {
                assets: read(include_str!("../../data/assets.json")).assets,
                categories: read(include_str!("../../data/categories.json")).categories,
                groups: read(include_str!("../../data/groups.json")).groups,
                materials: read(include_str!("../../data/materials.json")).materials,
                openings: read(include_str!("../../data/openings.json")).openings,
            })
        })
    }

    fn new(data: DataFile) -> Self {
        let mut by_name: HashMap<String, Category> = HashMap::new();
        for CategoryRow { name, supports, rule } in data.categories {
            by_name.insert(name, Category { rule, supports, ..Category::default() });
        }
        let mut assets = HashMap::new();
        for asset in data.assets {
            let category = by_name.entry(asset.category.clone()).or_default();
            category.asset_ids.push(asset.id.clone());
            assets.insert(asset.id.clone(), asset);
        }
        #[allow(clippy::iter_over_hash_type, reason = "each entry on its own")]
        for category in by_name.values_mut() {
            category.median_size_m =
                median_size(category.asset_ids.iter().filter_map(|id| assets.get(id)));
        }
        let colours = data.materials.into_iter().map(|(name, hex)| (name, rgb(&hex)));
        let openings = data.openings.into_iter().map(|space| (space.id.clone(), space)).collect();
        Self {
            assets,
            categories: by_name,
            materials: colours.collect(),
            groups: data.groups,
            openings,
        }
    }

    /// Return the facts about an asset; `None` if the catalogue does not hold it.
    pub fn get(&self, asset_id: &str) -> Option<&Asset> {
        self.assets.get(asset_id)
    }

    /// Return the ids of all assets, sorted.
    pub fn asset_ids(&self) -> Vec<&str> {
        let mut ids: Vec<&str> = self.assets.keys().map(String::as_str).collect();
        ids.sort_unstable();
        ids
    }

    /// Return the names of all categories, sorted.
    pub fn categories(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.categories.keys().map(String::as_str).collect();
        names.sort_unstable();
        names
    }

    /// Return the ids of the assets of a category, sorted; empty if the category is unknown.
    pub fn assets_in(&self, category: &str) -> &[String] {
        self.categories.get(category).map_or(&[], |category| &category.asset_ids)
    }

    /// Return the median edge lengths of a category's assets.
    pub fn median_size_m(&self, category: &str) -> Option<Vec3> {
        self.categories.get(category).map(|category| category.median_size_m)
    }

    /// Return ProcTHOR's placement annotations of a category; `None` if it was never annotated.
    pub fn placement(&self, category: &str) -> Option<&PlacementRule> {
        self.categories.get(category)?.rule.as_ref()
    }

    /// Return ProcTHOR's asset groups, ordered by name.
    pub fn groups(&self) -> &[GroupDefinition] {
        &self.groups
    }

    /// Return the share, 0..1, of `parent_category`'s instances on which a `child_category` was
    /// recorded.
    pub fn rest_probability(&self, child_category: &str, parent_category: &str) -> f64 {
        let supports = self.categories.get(child_category).map(|category| &category.supports);
        supports.and_then(|supports| supports.get(parent_category)).copied().unwrap_or(0.0)
    }

    /// Return whether a category was ever recorded on or in another.
    pub fn can_rest_on(&self, child_category: &str, parent_category: &str) -> bool {
        self.rest_probability(child_category, parent_category) > 0.0
    }

    /// Return the space that a door, doorframe or window takes; `None` for any other asset.
    pub fn opening(&self, asset_id: &str) -> Option<&OpeningSpace> {
        self.openings.get(asset_id)
    }

    /// Return the mean albedo of a material, sRGB.
    pub fn material_colour(&self, name: &str) -> Option<[u8; 3]> {
        self.materials.get(name).copied()
    }
}

/// Return the median of each edge length; zeros for no assets.
fn median_size<'a>(assets: impl Iterator<Item = &'a Asset> + Clone) -> Vec3 {
    std::array::from_fn(|axis| {
        let mut edges: Vec<f64> = assets.clone().map(|asset| asset.size_m[axis]).collect();
        edges.sort_by(f64::total_cmp);
        edges.get(edges.len() / 2).copied().unwrap_or(0.0)
    })
}
