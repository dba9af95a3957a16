//! An agent's discrete actions, with exactly the results of `evonav.world.embedded`.

use crate::{Error, geometry::Pose, simulator::EmbeddedSimulator};

/// Number of steps per degree to which angles of poses are rounded (docs/simulator.md, "Angles").
const PARTS_PER_DEG: f64 = 1e4;

/// A discrete action.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Move straight ahead by the length of a step.
    MoveForward,
    /// Turn counter-clockwise seen from above.
    TurnLeft,
    /// Turn clockwise seen from above.
    TurnRight,
    /// Do nothing. It ends a stage, which the simulator does not handle.
    Stop,
}

impl Action {
    /// Return the action with a number: 0 to 3, in the order of the variants.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for any other number.
    pub fn of(number: u8) -> Result<Self, Error> {
        match number {
            0 => Ok(Self::MoveForward),
            1 => Ok(Self::TurnLeft),
            2 => Ok(Self::TurnRight),
            3 => Ok(Self::Stop),
            _ => Err(Error::invalid("action", number, "0 to 3")),
        }
    }
}

/// The sizes of discrete actions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strides {
    /// Length of a step ahead.
    pub move_m: f64,
    /// Angle of a turn.
    pub turn_rad: f64,
}

/// Return the pose after an action; `None` if the agent collides.
pub fn act(
    world: &EmbeddedSimulator,
    pose: &Pose,
    action: Action,
    strides: Strides,
) -> Option<Pose> {
    let turned = |by_rad: f64| Pose { yaw_rad: canonical_yaw_rad(pose.yaw_rad + by_rad), ..*pose };
    match action {
        Action::Stop => Some(*pose),
        Action::TurnLeft => Some(turned(-strides.turn_rad)),
        Action::TurnRight => Some(turned(strides.turn_rad)),
        Action::MoveForward => {
            let [x_m, _, z_m] = pose.position_m;
            let to_m = [
                x_m + strides.move_m * pose.yaw_rad.sin(),
                z_m + strides.move_m * pose.yaw_rad.cos(),
            ];
            let is_free = world.navigation().try_move([x_m, z_m], to_m);
            is_free.then(|| Pose { position_m: world.body_position_m(to_m), ..*pose })
        }
    }
}

/// Return the pose of an agent that is put at `[x, z]`, looking along `yaw_rad`; `None` if it does
/// not fit there.
pub fn set_down(
    world: &EmbeddedSimulator,
    pose: &Pose,
    point_m: [f64; 2],
    yaw_rad: f64,
) -> Option<Pose> {
    let is_number = point_m.iter().all(|v| v.is_finite()) && yaw_rad.is_finite();
    (is_number && world.navigation().is_free(point_m)).then(|| Pose {
        position_m: world.body_position_m(point_m),
        yaw_rad: canonical_yaw_rad(yaw_rad),
        ..*pose
    })
}

/// Bring a yaw into `[0, 2 pi)` and round it to 1e-4 degrees, as
/// `evonav.world.pose.canonical_yaw_rad`.
pub fn canonical_yaw_rad(yaw_rad: f64) -> f64 {
    rounded_deg(yaw_rad.to_degrees().rem_euclid(360.0)).rem_euclid(360.0).to_radians()
}

/// Round to four decimals exactly as Python's `round(angle_deg, 4)`.
fn rounded_deg(angle_deg: f64) -> f64 {
    let parts = angle_deg * PARTS_PER_DEG;
    let whole = parts.round_ties_even();
    // Scaling rounds too: near a half, only the digits show on which side of it an angle lies.
    if ((parts - whole).abs() - 0.5).abs() < 1e-6 {
        return format!("{angle_deg:.4}").parse().unwrap_or(angle_deg) + 0.0;
    }
    whole / PARTS_PER_DEG + 0.0
}
