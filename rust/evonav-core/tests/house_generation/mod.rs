//! Houses from seeds.

mod houses;
mod parameters;

use evonav_core::house_generation::{HouseMaker, HouseParameters};

/// Return a maker of houses with parameters that a test changes.
fn maker(change: impl FnOnce(&mut HouseParameters)) -> HouseMaker {
    let mut parameters = HouseParameters::default();
    change(&mut parameters);
    HouseMaker::new(parameters).unwrap()
}
