//! Path data of polygons, and places of labels.

mod label_point;
mod outline;
