//! The surroundings of a target that an instruction may mention (paper, Sec. A.4).

use crate::{
    generation::record::{Anchor, Determiner, Relations},
    geometry::{Vec2, distance_2d_m, outline::gap_m},
    house::{House, Opening},
    world::{
        footprint::convex_hull,
        layout::{Item, Layout, contact::bottom_m},
        scene::BodyKind,
    },
};

/// Largest gap in plan between objects that are next to each other.
const NEXT_TO_M: f64 = 0.5;
/// Largest difference in height of objects on the same board of a shelf.
const SAME_BOARD_M: f64 = 0.15;
/// Largest gap in plan to a door or window that is near.
const STRUCTURE_M: f64 = 1.0;
/// Largest gap in plan of furniture that stands in a corner.
const CORNER_M: f64 = 0.3;
/// Largest gap in plan to a wall object that is near; the paper mentions thresholds without values.
const WALL_OBJECT_M: f64 = 1.0;
/// Largest gap in plan of an object that is below another.
const BELOW_M: f64 = 0.3;
/// Number of nearby anchors in an instruction (paper, Sec. A.4).
const MAX_NEIGHBOURS: usize = 2;
/// Number of nearest categories from which the anchors are chosen.
const MAX_CHOICES: usize = 8;

/// Categories that contain objects and never carry them, except that a faucet stands on its sink.
const BASINS: [&str; 6] = ["Bathtub", "Box", "GarbageCan", "LaundryHamper", "Pot", "Sink"];
/// Categories that contain objects unless these stand on the top.
const CLOSED: [&str; 3] = ["Fridge", "Microwave", "Safe"];
/// Depth under the top of a closed object from which an object is inside it.
const INSIDE_M: f64 = 0.05;

/// A statement about an object's surroundings.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Claim<'a> {
    kind: Kind,
    /// Category, or the word for a part of the room.
    what: &'a str,
    determiner: Determiner,
    gap_m: f64,
    /// Whether it is used only after all others of its kind: objects that are not on the target's
    /// support, and corners, which are visible from less far away than doors and windows.
    is_aside: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    NextTo,
    Structure,
    NearOnWall,
    Below,
}

/// All statements about one object's surroundings.
struct Surroundings<'a> {
    support: Option<&'a str>,
    is_in_support: bool,
    /// One claim per kind and category or word, nearest first.
    claims: Vec<Claim<'a>>,
}

impl<'a> Surroundings<'a> {
    fn of_kind(&self, is_kind: impl Fn(Kind) -> bool) -> Vec<Claim<'a>> {
        let of_kind = self.claims.iter().filter(|claim| is_kind(claim.kind));
        of_kind.take(MAX_CHOICES).copied().collect()
    }

    /// Return whether a claim about another object is true of this one, read literally.
    fn fits(&self, claim: &Claim<'_>) -> bool {
        self.claims.iter().any(|own| {
            let is_kind =
                own.kind == claim.kind || (own.kind, claim.kind) == (Kind::Below, Kind::NearOnWall);
            let is_many =
                claim.determiner != Determiner::Some || own.determiner == Determiner::Some;
            is_kind && own.what == claim.what && is_many
        })
    }
}

/// Return the relations of object `index` to its support, at most two neighbours, one part of the
/// room and one object on the wall.
///
/// Chooses, among the anchors within the thresholds, those with which the instruction applies to the
/// fewest other objects, and the nearest among equals. Anchors have other categories than the target,
/// and each category occurs once, because an instruction names only categories.
///
/// # Arguments
/// * `index` - index of the target in `house` and `layout`, which must belong together.
pub fn relations_of(house: &House, layout: &Layout, index: usize) -> Relations {
    let room_type =
        |i: usize| house.objects[i].room.map_or("", |room| house.rooms[room].room_type.as_str());
    let outlines: Vec<Vec<Vec2>> = layout.items.iter().map(outline_of).collect();
    let look = |i: usize| surroundings(house, layout, &outlines, i);
    let own = look(index);
    let category = &layout.items[index].asset.category;
    let namesakes: Vec<usize> = (0..layout.items.len())
        .filter(|&i| i != index && layout.items[i].asset.category == *category)
        .collect();
    let rivals: Vec<Surroundings<'_>> = namesakes
        .iter()
        .filter(|&&i| room_type(i) == room_type(index))
        .map(|&i| look(i))
        .filter(|rival| {
            own.support.is_none()
                || (rival.support, rival.is_in_support) == (own.support, own.is_in_support)
        })
        .collect();
    let (chosen, num_rivals) = choose(&own, &rivals);
    let find = |is_kind: &dyn Fn(Kind) -> bool| {
        chosen.iter().filter(|claim| is_kind(claim.kind)).map(anchor).collect::<Vec<_>>()
    };
    let num_alike = |of: &str| house.rooms.iter().filter(|room| room.room_type == of).count();
    Relations {
        room_type: room_type(index).to_owned(),
        is_category_unique: namesakes.is_empty(),
        is_room_type_unique: num_alike(room_type(index)) <= 1,
        support: own.support.map(|category| Anchor {
            category: category.to_owned(),
            determiner: one_of(count_in_room(house, layout, index, category)),
        }),
        is_in_support: own.is_in_support,
        neighbours: find(&|kind| kind == Kind::NextTo),
        structure: find(&|kind| kind == Kind::Structure).pop(),
        wall_object: find(&|kind| matches!(kind, Kind::NearOnWall | Kind::Below)).pop(),
        is_below_wall_object: chosen.iter().any(|claim| claim.kind == Kind::Below),
        num_fitting: num_rivals + 1,
    }
}

/// Choose the claims to make; return them and the number of rivals to which all of them apply.
///
/// Every choice is tried in order of distance; the first of the best is taken.
fn choose<'a>(own: &Surroundings<'a>, rivals: &[Surroundings<'_>]) -> (Vec<Claim<'a>>, usize) {
    let near = own.of_kind(|kind| kind == Kind::NextTo);
    let parts = own.of_kind(|kind| kind == Kind::Structure);
    let hung = own.of_kind(|kind| matches!(kind, Kind::NearOnWall | Kind::Below));
    let one_of = |claims: &[Claim<'a>]| -> Vec<Option<Claim<'a>>> {
        if claims.is_empty() { vec![None] } else { claims.iter().copied().map(Some).collect() }
    };
    let mut best: (Vec<Claim<'a>>, usize) = (Vec::new(), usize::MAX);
    for pair in subsets(&near, MAX_NEIGHBOURS) {
        for part in one_of(&parts) {
            for thing in one_of(&hung) {
                let claims: Vec<Claim<'a>> =
                    pair.iter().copied().chain(part).chain(thing).collect();
                let fits = |rival: &&Surroundings<'_>| claims.iter().all(|claim| rival.fits(claim));
                let num_rivals = rivals.iter().filter(fits).count();
                if num_rivals < best.1 {
                    best = (claims, num_rivals);
                }
            }
        }
    }
    best
}

/// Return all pairs of claims, or all claims as a single choice if there are at most `size`;
/// earlier claims first.
fn subsets<'a>(claims: &[Claim<'a>], size: usize) -> Vec<Vec<Claim<'a>>> {
    if claims.len() <= size {
        return vec![claims.to_vec()];
    }
    let mut pairs = Vec::new();
    for j in 1..claims.len() {
        for i in 0..j {
            pairs.push(vec![claims[i], claims[j]]);
        }
    }
    pairs
}

fn anchor(claim: &Claim<'_>) -> Anchor {
    Anchor { category: claim.what.to_owned(), determiner: claim.determiner }
}

/// Describe the surroundings of an object.
fn surroundings<'a>(
    house: &House,
    layout: &'a Layout,
    outlines: &[Vec<Vec2>],
    index: usize,
) -> Surroundings<'a> {
    let target = &layout.items[index];
    let category = &target.asset.category;
    let bottom = bottom_m(&target.solids);
    let top = top_m(target);
    let room = house.objects[index].room;
    let support = target.placement.parent.map(|parent| &layout.items[parent]);
    let gap_to = |i: usize| gap_m(&outlines[index], &outlines[i]);
    let mut claims: Vec<Claim<'a>> = Vec::new();
    let in_room = layout.items.iter().enumerate().filter(|&(i, item)| {
        i != index && house.objects[i].room == room && item.asset.category != *category
    });
    for (i, item) in in_room {
        let what = item.asset.category.as_str();
        // An object on a support is next to others on that support; furniture is next to both.
        let is_fellow = target.placement.parent.is_some()
            && item.placement.parent == target.placement.parent
            && (bottom_m(&item.solids) - bottom).abs() < SAME_BOARD_M;
        let is_company = is_fellow
            || item.is_on_floor && !target.is_hung() && target.placement.parent != Some(i);
        let kind = if is_company {
            Kind::NextTo
        } else if !item.is_hung() || target.is_hung() {
            continue;
        } else if gap_to(i) < BELOW_M && bottom_m(&item.solids) >= top {
            Kind::Below
        } else {
            Kind::NearOnWall
        };
        let reach_m = if kind == Kind::NextTo { NEXT_TO_M } else { WALL_OBJECT_M };
        let gap_m = gap_to(i);
        if gap_m < reach_m {
            let determiner = one_of(count_in_room(house, layout, index, what));
            let is_aside = kind == Kind::NextTo && !is_fellow && target.placement.parent.is_some();
            claims.push(Claim { kind, what, determiner, gap_m, is_aside });
        }
    }
    claims.extend(structures_near(house, layout, room, &outlines[index], target.is_on_floor));
    claims.sort_by(|a, b| {
        let nearer = a.gap_m.total_cmp(&b.gap_m);
        a.is_aside.cmp(&b.is_aside).then(nearer).then(a.what.cmp(b.what))
    });
    let mut nearest: Vec<Claim<'a>> = Vec::new();
    for claim in claims {
        match nearest.iter_mut().find(|c| (c.kind, c.what) == (claim.kind, claim.what)) {
            Some(first) if claim.kind == Kind::NextTo => first.determiner = Determiner::Some,
            Some(_) => {}
            None => nearest.push(claim),
        }
    }
    Surroundings {
        support: support.map(|item| item.asset.category.as_str()),
        is_in_support: support.is_some_and(|item| {
            let name = item.asset.category.as_str();
            BASINS.contains(&name) && category != "Faucet"
                || CLOSED.contains(&name) && bottom < top_m(item) - INSIDE_M
        }),
        claims: nearest,
    }
}

/// Count the objects of a category in the room of object `index`.
fn count_in_room(house: &House, layout: &Layout, index: usize, category: &str) -> usize {
    let room = house.objects[index].room;
    let items = layout.items.iter().zip(&house.objects);
    items.filter(|(item, o)| o.room == room && item.asset.category == category).count()
}

fn one_of(count: usize) -> Determiner {
    if count > 1 { Determiner::A } else { Determiner::The }
}

/// Find the doors, windows and corners of the room within the thresholds.
fn structures_near(
    house: &House,
    layout: &Layout,
    room: Option<usize>,
    outline: &[Vec2],
    is_on_floor: bool,
) -> Vec<Claim<'static>> {
    let Some(room) = room.and_then(|room| house.rooms.get(room)) else {
        return Vec::new();
    };
    let mut near = Vec::new();
    let bodies = &layout.scene.bodies[..layout.scene.first_object.min(layout.scene.bodies.len())];
    let openings =
        [(&house.doors, BodyKind::Door, "doorway"), (&house.windows, BodyKind::Window, "window")];
    for (openings, kind, what) in openings {
        let of_room: Vec<&Opening> =
            openings.iter().filter(|opening| opening.room_ids.contains(&room.id)).collect();
        for body in bodies.iter().filter(|body| body.kind == kind && !body.parts.is_empty()) {
            if !of_room.iter().any(|opening| opening.id == body.id) {
                continue;
            }
            let (low, high) = (body.aabb.min_m, body.aabb.max_m);
            let corners =
                [[low[0], low[2]], [high[0], low[2]], [high[0], high[2]], [low[0], high[2]]];
            let gap_m = gap_m(outline, &corners);
            if gap_m < STRUCTURE_M {
                let (kind, determiner) = (Kind::Structure, one_of(of_room.len()));
                near.push(Claim { kind, what, determiner, gap_m, is_aside: false });
            }
        }
    }
    let is_open = |p: Vec2| {
        let ends = |wall: &crate::house::Wall| {
            distance_2d_m(wall.from_m, p).min(distance_2d_m(wall.to_m, p)) < 0.05
        };
        house.walls.iter().any(|wall| wall.is_empty && ends(wall))
    };
    let corners = convex_corners(&room.polygon_m).into_iter().filter(|&corner| !is_open(corner));
    let gap_m = corners.map(|corner| gap_m(outline, &[corner])).fold(f64::INFINITY, f64::min);
    if is_on_floor && gap_m < CORNER_M {
        let determiner = Determiner::A;
        let (kind, what, is_aside) = (Kind::Structure, "corner", true);
        near.push(Claim { kind, what, determiner, gap_m, is_aside });
    }
    near
}

/// Return the corners of a floor outline in which furniture can stand.
fn convex_corners(polygon: &[Vec2]) -> Vec<Vec2> {
    let n = polygon.len();
    let cross =
        |o: Vec2, a: Vec2, b: Vec2| (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    let turn = |i: usize| cross(polygon[(i + n - 1) % n], polygon[i], polygon[(i + 1) % n]);
    let area: f64 = (1..n.max(2) - 1).map(|i| cross(polygon[0], polygon[i], polygon[i + 1])).sum();
    (0..n).filter(|&i| turn(i) * area > 0.0).map(|i| polygon[i]).collect()
}

/// Return the convex outline of a whole object on the ground plane.
fn outline_of(item: &Item) -> Vec<Vec2> {
    convex_hull(item.solids.iter().flat_map(|solid| solid.outline_m.iter().copied()).collect())
}

fn top_m(item: &Item) -> f64 {
    item.solids.iter().map(|solid| solid.top_m).fold(f64::NEG_INFINITY, f64::max)
}
