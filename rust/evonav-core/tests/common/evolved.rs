//! Parameters under which every transition evolves.

use evonav_core::generation::{Mode, Parameters};

/// Every transition evolves, by one mode.
pub fn always(mode: Mode, num_stages: usize) -> Parameters {
    let [salient, retain, shuffle] = Mode::ALL.map(|m| f64::from(u8::from(m == mode)));
    Parameters {
        evolve_probability: 1.0,
        salient_object_probability: salient,
        retain_group_probability: retain,
        full_shuffle_probability: shuffle,
        num_stages: vec![num_stages],
        ..Parameters::default()
    }
}
