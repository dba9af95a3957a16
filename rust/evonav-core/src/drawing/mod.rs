//! Parts of drawings of floor plans: path data, and places of labels.

pub mod label_point;
pub mod outline;
