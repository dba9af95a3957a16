//! A small detector of our own: a convolutional network, and instances from what it says.
//!
//! Sums have one order, whatever the number of threads: the same picture gives the same bits.

pub mod convolution;
pub mod detector;
pub mod instances;
pub mod network;
pub mod weights;
