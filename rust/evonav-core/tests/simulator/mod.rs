//! Batches of simulated agents, and houses in random looks.

mod batch;
mod random_looks;
