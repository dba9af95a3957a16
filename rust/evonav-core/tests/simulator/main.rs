//! Batches of simulated agents.

mod batch;
