//! The checks that every house passes: rooms that the agent reaches, doors that it passes, and
//! objects that touch nothing and rest on something.

use crate::{
    Error,
    assets::Catalogue,
    geometry::{Vec2, polygon_contains},
    house::House,
    house_generation::{doors::PlacedDoor, structure::Structure},
    world::{
        inspection::{Finding, FindingKind, Tolerances, inspect},
        layout::surfaces::FITTINGS,
        navigation::{AgentBody, Navigation, NavigationConfig},
        scene::Scene,
    },
};

/// Spacing of the places that an agent reaches, as in AI2-THOR.
pub(super) const GRID_M: f64 = 0.25;
/// Tolerances of the checks of generated tasks (`evonav.generation.validation.world`).
const TOLERANCES: Tolerances = Tolerances { touch_m: 0.0025, rest_m: 0.02 };
/// Distance before and behind a door between which an agent must be able to walk straight.
const DOOR_REACH_M: f64 = 0.4;
/// Shares of a door's width at which an agent tries to walk through, in this order.
const DOOR_SHARES: [f64; 7] = [0.5, 0.4, 0.6, 0.35, 0.65, 0.3, 0.7];

/// The free space of a house.
pub(super) struct Walkable {
    navigation: Navigation,
}

impl Walkable {
    /// Build the free space.
    ///
    /// # Errors
    /// [`Error::Simulation`] if the scene's geometry is not finite.
    pub fn of(scene: &Scene) -> Result<Self, Error> {
        let config = NavigationConfig::default();
        Ok(Self { navigation: Navigation::build(scene, AgentBody::DEFAULT, config)? })
    }

    /// Return whether the agent can stand at a point.
    pub fn is_free(&self, point_m: Vec2) -> bool {
        self.navigation.is_free(point_m)
    }

    /// Return whether an agent that starts at a point reaches `least` places of the grid in each
    /// room.
    ///
    /// # Errors
    /// None in practice: those of [`Navigation::reachable_positions`].
    pub fn reaches_all(
        &self,
        structure: &Structure,
        from_m: Vec2,
        least: usize,
    ) -> Result<bool, Error> {
        let places = self.navigation.reachable_positions(from_m, GRID_M)?;
        Ok(structure.rooms.iter().all(|room| {
            let polygon_m = room.polygon_m();
            let inside = places.iter().filter(|&&place| polygon_contains(&polygon_m, place));
            inside.take(least).count() == least
        }))
    }

    /// Return whether an agent can walk straight through a door; the outside door is closed.
    pub fn passes(&self, structure: &Structure, door: &PlacedDoor) -> bool {
        let (Some(side), Some(_)) = (structure.side(door.room, door.border), door.other) else {
            return true;
        };
        let along = side.along();
        let width_m = door.space.hole_m[0];
        DOOR_SHARES.iter().any(|share| {
            let along_m = door.start_m + share * width_m;
            let middle_m = [0, 1].map(|i| side.from_m[i] + along_m * along[i]);
            let [near, far] = [1.0, -1.0].map(|sign| {
                let across_m = sign * DOOR_REACH_M;
                [middle_m[0] + across_m * along[1], middle_m[1] - across_m * along[0]]
            });
            self.navigation.try_move(near, far)
        })
    }
}

/// Return what is wrong with the objects of a house, given the same house without its objects.
pub(super) fn problems(bare: (&House, &Scene), furnished: (&House, &Scene)) -> Vec<Finding> {
    let house = furnished.0;
    let object = |id: &str| house.object_index(id).map(|index| &house.objects[index]);
    let is_hung = |id: &str| object(id).is_some_and(|it| it.parent.is_none() && it.is_kinematic);
    // Taps reach into their sink: they are made for it.
    let is_fitted = |id: &str, other: &str| {
        let parent = object(id).and_then(|it| it.parent).map(|parent| &house.objects[parent]);
        let asset = object(id).and_then(|it| Catalogue::bundled().get(&it.asset_id));
        parent.is_some_and(|parent| parent.id == other)
            && asset.is_some_and(|asset| FITTINGS.contains(&asset.category.as_str()))
    };
    let mut findings = inspect(bare, furnished, TOLERANCES);
    findings.retain(|finding| match finding.kind {
        // What hangs on a wall has no support under it.
        FindingKind::Unsupported => finding.other_id != "floor" || !is_hung(&finding.id),
        FindingKind::Penetration => !is_fitted(&finding.id, &finding.other_id),
        _ => true,
    });
    findings
}
