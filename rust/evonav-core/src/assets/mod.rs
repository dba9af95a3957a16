//! Facts about ProcTHOR's assets, and the compound shapes that represent them.

mod asset;
mod catalogue;
pub mod group_definition;
mod object_asset;
pub mod part;
pub mod placement_rule;
pub mod shapes;

pub use asset::{Asset, Split};
pub use catalogue::Catalogue;
pub use object_asset::UnknownAssets;
