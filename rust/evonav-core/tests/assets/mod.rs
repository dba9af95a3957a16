//! The asset catalogue and the shapes drawn for assets.

mod catalogue;
mod materials;
mod shapes;
mod shapes_open;
