//! Facts about ProcTHOR's assets, and the compound shapes that represent them.

mod asset;
mod catalogue;
pub mod group_definition;
pub mod material;
mod material_names;
mod object_asset;
mod opening_space;
pub mod part;
pub mod placement_rule;
pub mod shapes;
mod surface_choices;

pub use asset::{Asset, Split};
pub use catalogue::Catalogue;
pub use material_names::kind_of_name;
pub use object_asset::UnknownAssets;
pub use opening_space::OpeningSpace;
pub use surface_choices::SurfaceChoices;
