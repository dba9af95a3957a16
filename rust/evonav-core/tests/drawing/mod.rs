//! Path data of polygons, places of labels, and draws of clusters.

mod label_point;
mod outline;
mod resampling;
