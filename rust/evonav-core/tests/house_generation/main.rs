//! Houses from seeds.

#![allow(clippy::unwrap_used, reason = "clippy.toml allows it in tests, but not in their helpers")]

mod houses;
mod parameters;

use evonav_core::house_generation::{HouseMaker, HouseParameters};

/// Return a maker of houses with parameters that a test changes.
fn maker(change: impl FnOnce(&mut HouseParameters)) -> HouseMaker {
    let mut parameters = HouseParameters::default();
    change(&mut parameters);
    HouseMaker::new(parameters).unwrap()
}
