//! Motions of parts as an object opens.

use crate::{
    assets::part::Part,
    geometry::{Vec3, add, compose, euler_rotation_deg, rotate, sub},
};

/// Axis of a round part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Along {
    X,
    Y,
    Z,
}

/// The motion of parts as an object opens.
#[derive(Debug, Clone, Copy)]
pub enum Motion {
    /// A turn about an axis through a point of the box (x, height, z).
    Hinge { pivot_m: Vec3, axis: Along, angle_rad: f64 },
    /// A shift.
    Slide { by_m: Vec3 },
}

/// Move a part by a share of a motion; `origin_m` is the height of the object frame's origin.
pub fn move_part(part: &mut Part, motion: &Motion, share: f64, origin_m: f64) {
    match *motion {
        Motion::Slide { by_m } => part.centre_m = add(part.centre_m, by_m.map(|by| share * by)),
        Motion::Hinge { pivot_m: [x, y, z], axis, angle_rad } if share != 0.0 => {
            let pivot_m = [x, y - origin_m, z];
            let mut angles_deg = [0.0; 3];
            angles_deg[axis as usize] = (share * angle_rad).to_degrees();
            let turn = euler_rotation_deg(angles_deg);
            part.centre_m = add(pivot_m, rotate(&turn, sub(part.centre_m, pivot_m)));
            part.rotation = compose(&turn, &part.rotation);
        }
        Motion::Hinge { .. } => {}
    }
}
