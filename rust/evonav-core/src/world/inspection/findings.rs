//! Check whether a changed house is physically possible, by GJK and EPA on the bodies' convex
//! parts.
//!
//! Generation checks its houses by its own arithmetic on outlines and heights. This module shares
//! none of that code, so that one can be tested against the other.

use serde::Serialize;

use crate::{
    Error,
    assets::{Catalogue, UnknownAssets},
    geometry::{Mat3, Vec2, Vec3, compose, polygon_contains, rotate, sub, transposed},
    house::House,
    world::{
        inspection::solid::Solid,
        scene::{Body, BodyKind, Scene},
    },
};

/// Largest difference of positions that counts as rounding: house files have four decimals of
/// metres.
const SAME_POSE_M: f64 = 1e-3;
/// Largest difference of rotation matrices' entries that counts as rounding.
const SAME_TURN: f64 = 1e-4;
/// A problem of one body of a house.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Kind of the problem.
    pub kind: FindingKind,
    /// Id of the object.
    pub id: String,
    /// Id of the other object, wall, door, window, floor, ceiling, room or support.
    pub other_id: String,
    /// Depth of penetration, or length that sticks out; 0 if it is not measured.
    pub amount_m: f64,
    /// Whether the source house has the same problem.
    pub is_own: bool,
}

/// Kinds of problems.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// Two objects share space.
    Penetration,
    /// An object is in a wall, door or window.
    InWall,
    /// An object is in a floor or ceiling.
    InFloor,
    /// An object that stands on the floor of a room sticks out of the room.
    OutOfRoom,
    /// No part of its support is under an object, or the object hovers over its support or over the
    /// floor.
    Unsupported,
}

/// Tolerances of an inspection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances {
    /// Largest depth of penetration, and largest distance out of a room, that is not a problem.
    pub touch_m: f64,
    /// Largest height over its support at which an object still rests on it.
    pub rest_m: f64,
}

/// Build the scenes of two houses and [`inspect`] them.
///
/// # Errors
/// Those of [`Scene::build`]; [`Error::InvalidArgument`] for tolerances below 0 or not finite.
pub fn inspect_houses(
    source: &House,
    stage: &House,
    catalogue: &Catalogue,
    unknown: UnknownAssets,
    tolerances: Tolerances,
) -> Result<Vec<Finding>, Error> {
    for (name, value) in [("touch_m", tolerances.touch_m), ("rest_m", tolerances.rest_m)] {
        if !(value.is_finite() && value >= 0.0) {
            return Err(Error::invalid(name, value, "a length"));
        }
    }
    let [before, after] = [source, stage].map(|house| Scene::build(house, catalogue, unknown));
    Ok(inspect((source, &before?), (stage, &after?), tolerances))
}

/// Compare a stage's house with the source house and report its problems.
///
/// # Arguments
/// * `source`, `stage` - the houses, each with the scene built from it.
/// * `tolerances` - deviations that are not problems.
///
/// # Returns
/// Findings in the order of the stage's objects. A problem that the source house has too (the same
/// two bodies, at least as deep, in the same relative pose) is marked by [`Finding::is_own`].
pub fn inspect(
    source: (&House, &Scene),
    stage: (&House, &Scene),
    tolerances: Tolerances,
) -> Vec<Finding> {
    let before = Inspector::new(source.1);
    let after = Inspector::new(stage.1);
    let mut findings = Vec::new();
    let (house, scene) = stage;
    for (first, second) in after.near_pairs() {
        let depth_m = after.depth_m(first, second);
        if depth_m <= tolerances.touch_m {
            continue;
        }
        let [one, other] = [first, second].map(|index| &scene.bodies[index]);
        let kind = match one.kind {
            BodyKind::Object => FindingKind::Penetration,
            BodyKind::Floor | BodyKind::Ceiling => FindingKind::InFloor,
            BodyKind::Wall | BodyKind::Door | BodyKind::Window => FindingKind::InWall,
        };
        let old = before.index_of(other);
        let is_own = if kind == FindingKind::InFloor {
            // Level floors are the same everywhere. Shapes that reach below the floor do so
            // wherever their object stands.
            let extent = |body: &Body| [body.aabb.min_m[1], body.aabb.max_m[1]];
            old.is_some_and(|old| {
                let was = extent(&source.1.bodies[old]);
                let now = extent(other);
                now[0] >= was[0] - SAME_POSE_M && now[1] <= was[1] + SAME_POSE_M
            })
        } else {
            before.index_of(one).zip(old).is_some_and(|(a, b)| {
                let was = [a, b].map(|index| &source.1.bodies[index]);
                is_same_relation(was, [one, other]) && before.depth_m(a, b) >= depth_m - SAME_POSE_M
            })
        };
        let (id, other_id) = (other.id.clone(), one.id.clone());
        findings.push(Finding { kind, id, other_id, amount_m: depth_m, is_own });
    }
    for (index, object) in house.objects.iter().enumerate() {
        let body_index = scene.first_object + index;
        let Some(body) = scene.bodies.get(body_index) else { continue };
        let was = before.index_of(body).map(|old| &source.1.bodies[old]);
        let stays = was.is_some_and(|was| is_same_pose(was, body));
        let push = |findings: &mut Vec<Finding>, kind, other: &str, amount_m, is_own| {
            let (id, other_id) = (object.id.clone(), other.to_owned());
            findings.push(Finding { kind, id, other_id, amount_m, is_own });
        };
        let stands = object.parent.is_none() && body.aabb.min_m[1] < tolerances.rest_m;
        if let Some(room) = object.room.and_then(|room| house.rooms.get(room)).filter(|_| stands) {
            let out_m = after.outside_m(body_index, &room.polygon_m);
            if out_m > tolerances.touch_m {
                push(&mut findings, FindingKind::OutOfRoom, &room.id, out_m, stays);
            }
        }
        if let Some(parent) = object.parent {
            let support = scene.first_object + parent;
            // Scenes let objects fall onto their support, so the height in the file is checked as
            // well.
            let hover_m = (object.position_m[1] - body.oriented.centre_m[1]).abs();
            let is_supported = after.rests_on(body_index, support, tolerances.rest_m);
            if !is_supported || hover_m > tolerances.rest_m {
                let is_own = was.zip(scene.bodies.get(support)).is_some_and(|(was, supporter)| {
                    before.index_of(supporter).is_some_and(|old| {
                        is_same_relation([&source.1.bodies[old], was], [supporter, body])
                    })
                });
                let id = &house.objects[parent].id;
                push(&mut findings, FindingKind::Unsupported, id, hover_m, is_own);
            }
        } else if !stays && !stands {
            // Objects on walls never move, so an object that moved and has no support must stand on
            // the floor.
            push(&mut findings, FindingKind::Unsupported, "floor", body.aabb.min_m[1], false);
        }
    }
    findings
}

/// Return whether a body has the same pose as before.
fn is_same_pose(before: &Body, after: &Body) -> bool {
    let offset = sub(after.oriented.centre_m, before.oriented.centre_m);
    is_small(offset) && is_same_turn(&before.oriented.rotation, &after.oriented.rotation)
}

/// Return whether two bodies have the same relative pose as before.
fn is_same_relation(before: [&Body; 2], after: [&Body; 2]) -> bool {
    let relation = |[one, other]: [&Body; 2]| {
        let (a, b) = (&one.oriented, &other.oriented);
        let turned = transposed(&a.rotation);
        let offset = rotate(&turned, sub(b.centre_m, a.centre_m));
        (offset, compose(&turned, &b.rotation))
    };
    let ((offset, turn), (offset_now, turn_now)) = (relation(before), relation(after));
    is_small(sub(offset_now, offset)) && is_same_turn(&turn, &turn_now)
}

fn is_small(offset: Vec3) -> bool {
    offset.iter().all(|value| value.abs() <= SAME_POSE_M)
}

fn is_same_turn(a: &Mat3, b: &Mat3) -> bool {
    a.iter().flatten().zip(b.iter().flatten()).all(|(x, y)| (x - y).abs() <= SAME_TURN)
}

/// A scene's bodies, prepared for queries between any two of them.
pub struct Inspector<'a> {
    scene: &'a Scene,
    solids: Vec<Vec<Solid>>,
}

impl<'a> Inspector<'a> {
    /// Prepare a scene's parts for GJK.
    pub fn new(scene: &'a Scene) -> Self {
        let solids = scene.bodies.iter().map(|body| body.parts.iter().map(Solid::of).collect());
        Self { scene, solids: solids.collect() }
    }

    /// Return the index of the body with the same id and kind as a body of another scene.
    fn index_of(&self, body: &Body) -> Option<usize> {
        self.scene.bodies.iter().position(|one| one.kind == body.kind && one.id == body.id)
    }

    /// Return the pairs of bodies whose boxes meet, the second one an object, the first one before
    /// it.
    fn near_pairs(&self) -> Vec<(usize, usize)> {
        let bodies = &self.scene.bodies;
        let mut pairs = Vec::new();
        for (second, body) in bodies.iter().enumerate().skip(self.scene.first_object) {
            let meets = |&first: &usize| bodies[first].aabb.intersects(&body.aabb);
            pairs.extend((0..second).filter(meets).map(|first| (first, second)));
        }
        pairs
    }

    /// Return the depth of penetration of two bodies: the largest depth of a part of one in a part
    /// of the other.
    ///
    /// The depth of two convex parts is the length of the shortest move that separates them.
    pub fn depth_m(&self, first: usize, second: usize) -> f64 {
        let (Some(first), Some(second)) = (self.solids.get(first), self.solids.get(second)) else {
            return 0.0;
        };
        let mut deepest_m = 0.0_f64;
        for one in first {
            for other in second.iter().filter(|other| one.aabb.intersects(&other.aabb)) {
                deepest_m = deepest_m.max(one.depth_m(other));
            }
        }
        deepest_m
    }

    /// Return whether a body rests on its support: its support is under its middle and touches it
    /// when it is lowered by `rest_m`; or it lies within its support's box, where drawers and
    /// shelves that the parts do not show may hold it.
    fn rests_on(&self, body: usize, support: usize, rest_m: f64) -> bool {
        let (Some(solids), Some(under)) = (self.solids.get(body), self.solids.get(support)) else {
            return false;
        };
        let touches = |solid: &Solid| under.iter().any(|other| solid.lowered(rest_m).meets(other));
        let [thing, holder] = [body, support].map(|index| self.scene.bodies[index].aabb);
        let is_inside =
            (0..3).all(|i| holder.min_m[i] <= thing.min_m[i] && thing.max_m[i] <= holder.max_m[i]);
        let [x, _, z] = thing.centre_m();
        let column = Solid::column([x, z]);
        let is_over = || under.iter().any(|other| column.meets(other));
        is_inside || solids.iter().any(touches) && is_over()
    }

    /// Return the length by which a body sticks out of a simple polygon `[x, z]`, seen from above.
    ///
    /// A convex part is inside if and only if its corners are inside and no corner of the polygon
    /// is under it.
    pub fn outside_m(&self, body: usize, polygon_m: &[Vec2]) -> f64 {
        let Some(solids) = self.solids.get(body) else { return 0.0 };
        let mut farthest_m = 0.0_f64;
        for solid in solids {
            for point in solid.points().filter(|&point| !polygon_contains(polygon_m, point)) {
                farthest_m = farthest_m.max(distance_to_border_m(point, polygon_m));
            }
            for &corner in polygon_m {
                farthest_m = farthest_m.max(solid.depth_m(&Solid::column(corner)));
            }
        }
        farthest_m
    }
}

/// Return the distance of a point from the border of a polygon.
fn distance_to_border_m(point: Vec2, polygon_m: &[Vec2]) -> f64 {
    let edges = polygon_m.iter().zip(polygon_m.iter().cycle().skip(1));
    edges.fold(f64::INFINITY, |nearest_m, (a, b)| {
        let (along, to) = ([b[0] - a[0], b[1] - a[1]], [point[0] - a[0], point[1] - a[1]]);
        let squared = along[0].mul_add(along[0], along[1] * along[1]).max(f64::MIN_POSITIVE);
        let t = ((to[0] * along[0] + to[1] * along[1]) / squared).clamp(0.0, 1.0);
        nearest_m.min((to[0] - t * along[0]).hypot(to[1] - t * along[1]))
    })
}
