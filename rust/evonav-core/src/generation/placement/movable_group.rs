//! Objects that move together: a piece of furniture with the objects on it, or an asset group.

use crate::{
    assets::placement_rule::Place,
    generation::placement::room_outline::{AT_WALL_M, RoomOutline},
    geometry::{Vec2, Vec3, add, bounds_2d_m, rotate, sub, yaw_rotation},
    world::{
        footprint::Footprint,
        layout::{
            Layout, PlacedItem, Placement,
            contact::overlap,
            free_floor::{self, FloorPatch},
            rounding::{ROUND_DEG, ROUND_M, round_to, turned_deg},
        },
    },
};

/// Objects that move rigidly together.
#[derive(Debug, Clone)]
pub struct MovableGroup {
    /// Indices of the objects that stand on the floor, the main one first.
    pub roots: Vec<usize>,
    /// Index of ProcTHOR's definition, if they are an asset group.
    pub definition: Option<usize>,
    /// All objects; each root is followed by the objects on it.
    members: Vec<Member>,
    /// Preferred places, and all allowed places.
    anchors: [Vec<Place>; 2],
    /// Centre of the main root.
    pivot_m: Vec3,
    /// Yaw of the group's frame, whose back is at -z.
    yaw_deg: f64,
    /// Smallest corner `[x, z]` of the box of the roots' outlines in that frame, about the pivot.
    pub min_m: Vec2,
    /// Largest corner of that box.
    pub max_m: Vec2,
}

/// A pose of a group's frame.
#[derive(Debug, Clone, Copy)]
pub struct FramePose {
    /// Centre of the group's main object.
    pub point_m: Vec2,
    /// Yaw.
    pub yaw_deg: f64,
    /// Kind of the place.
    pub anchor: Place,
}

/// Strictness with which ProcTHOR's rules are applied.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rules {
    /// Corner, edge or middle as the category requires, and free floor around.
    All,
    /// Furniture that stands in corners may also stand along walls, and the floor around need not
    /// be free.
    Relaxed,
}

/// An object of a group as it stands before it is moved.
#[derive(Debug, Clone)]
struct Member {
    index: usize,
    is_root: bool,
    placement: Placement,
    solids: Vec<Footprint>,
}

impl MovableGroup {
    /// Create a group from roots and the objects on them, where they stand.
    ///
    /// # Arguments
    /// * `roots` - indices of the objects on the floor, the main one first; at least one.
    /// * `definition` - index of the definition of the group that the roots are.
    /// * `anchors` - preferred places and all allowed places; if empty, the kind of place where it
    ///   stands now.
    pub fn new(
        layout: &Layout,
        roots: &[usize],
        definition: Option<usize>,
        anchors: [&[Place]; 2],
        outline: &RoomOutline,
    ) -> Self {
        let mut group = Self {
            roots: roots.to_vec(),
            definition,
            members: Vec::new(),
            anchors: anchors.map(<[Place]>::to_vec),
            pivot_m: layout.items[roots[0]].placement.position_m,
            yaw_deg: layout.items[roots[0]].placement.rotation_deg[1],
            min_m: [0.0; 2],
            max_m: [0.0; 2],
        };
        for &root in roots {
            for index in layout.with_supported(root) {
                let item = &layout.items[index];
                let (placement, solids) = (item.placement, item.solids.clone());
                group.members.push(Member { index, is_root: index == root, placement, solids });
            }
        }
        group.measure();
        if group.anchors[1].is_empty() {
            group.turn_back_to_wall(outline);
        }
        group
    }

    /// Return the centre of the main root.
    pub fn centre_m(&self) -> Vec2 {
        [self.pivot_m[0], self.pivot_m[2]]
    }

    /// Move a root, with the objects on it, within the group.
    ///
    /// # Arguments
    /// * `centre_m`, `yaw_deg` - new pose of the root in the group's frame about the main root.
    pub fn arrange(&mut self, layout: &Layout, root: usize, centre_m: Vec2, yaw_deg: f64) {
        let frame = yaw_rotation(self.yaw_deg.to_radians());
        let to = add(rotate(&frame, [centre_m[0], 0.0, centre_m[1]]), self.pivot_m);
        let family = layout.with_supported(root);
        let Some(from) = self.members.iter().find(|m| m.index == root).map(|m| m.placement) else {
            return;
        };
        let turn_deg = self.yaw_deg + yaw_deg - from.rotation_deg[1];
        let turn = yaw_rotation(turn_deg.to_radians());
        for member in self.members.iter_mut().filter(|m| family.contains(&m.index)) {
            let offset = rotate(&turn, sub(member.placement.position_m, from.position_m));
            let [x_deg, y_deg, z_deg] = member.placement.rotation_deg;
            member.placement.position_m =
                [to[0] + offset[0], member.placement.position_m[1], to[2] + offset[2]];
            member.placement.rotation_deg = [x_deg, turned_deg(y_deg + turn_deg), z_deg];
            member.solids = layout.items[member.index].solids_at(&member.placement);
        }
        self.measure();
    }

    /// Return whether no root, with the objects on it, overlaps another.
    pub fn is_sound(&self) -> bool {
        let families = self.members.chunk_by(|_, next| !next.is_root).collect::<Vec<_>>();
        let touch = |a: &[Member], b: &[Member]| {
            a.iter().any(|a| b.iter().any(|b| overlap(&a.solids, &b.solids)))
        };
        (1..families.len()).all(|i| !families[..i].iter().any(|other| touch(other, families[i])))
    }

    /// Compute the box for the present frame.
    fn measure(&mut self) {
        let into_frame = yaw_rotation(-self.yaw_deg.to_radians());
        let solids = self.members.iter().filter(|m| m.is_root).flat_map(|m| &m.solids);
        let corners = solids.flat_map(|solid| &solid.outline_m).map(|p| {
            let offset = [p[0] - self.pivot_m[0], 0.0, p[1] - self.pivot_m[2]];
            let [x, _, z] = rotate(&into_frame, offset);
            [x, z]
        });
        [self.min_m, self.max_m] = bounds_2d_m(corners);
    }

    /// Return the distance of the middle of the back from the nearest wall.
    fn back_gap_m(&self, outline: &RoomOutline) -> f64 {
        let from_frame = yaw_rotation(self.yaw_deg.to_radians());
        let middle_x = 0.5 * (self.min_m[0] + self.max_m[0]);
        let back = add(rotate(&from_frame, [middle_x, 0.0, self.min_m[1]]), self.pivot_m);
        outline.wall_distance_m([back[0], back[2]])
    }

    /// Choose the side at a wall as the back, and the kind of place by the number of such sides.
    /// This is for categories without annotations by ProcTHOR.
    fn turn_back_to_wall(&mut self, outline: &RoomOutline) {
        let quarters = (0..4).map(|quarter| {
            let mut turned = self.clone();
            turned.yaw_deg = self.yaw_deg + 90.0 * f64::from(quarter);
            turned.measure();
            turned
        });
        let mut at_wall: Vec<Self> =
            quarters.filter(|turned| turned.back_gap_m(outline) < AT_WALL_M).collect();
        // Furniture in a corner also stands at an edge.
        let anchors = match at_wall.len() {
            0 => vec![Place::Middle],
            1 => vec![Place::Edge],
            _ => vec![Place::Corner, Place::Edge],
        };
        if !at_wall.is_empty() {
            *self = at_wall.swap_remove(0);
        }
        self.anchors = [anchors.clone(), anchors];
    }

    /// Return the places that the rules allow.
    pub fn anchors(&self, rules: Rules) -> &[Place] {
        let [preferred, all] = &self.anchors;
        if rules == Rules::All { preferred } else { all }
    }

    /// Return the floor of the group where it stands.
    pub fn floor_now(&self, outline: &RoomOutline) -> FloorPatch {
        let is_at_wall = self.back_gap_m(outline) < AT_WALL_M;
        let anchor = if is_at_wall { Place::Edge } else { Place::Middle };
        let pose = FramePose { point_m: self.centre_m(), yaw_deg: self.yaw_deg, anchor };
        self.floor_at(&pose)
    }

    /// Return the floor of the group at a pose of its frame.
    pub fn floor_at(&self, pose: &FramePose) -> FloorPatch {
        let turn = yaw_rotation(pose.yaw_deg.to_radians());
        let to_world = |[x, z]: Vec2| {
            let offset = rotate(&turn, [x, 0.0, z]);
            [pose.point_m[0] + offset[0], pose.point_m[1] + offset[2]]
        };
        free_floor::floor_around(pose.anchor, self.min_m, self.max_m, to_world)
    }

    /// Return all members with the group's frame at a pose.
    pub fn placed_at(&self, pose: &FramePose) -> Vec<PlacedItem> {
        let turn_deg = round_to(pose.yaw_deg - self.yaw_deg, ROUND_DEG);
        let turn = yaw_rotation(turn_deg.to_radians());
        let moved = |[x, z]: Vec2| {
            let offset = rotate(&turn, [x - self.pivot_m[0], 0.0, z - self.pivot_m[2]]);
            [pose.point_m[0] + offset[0], pose.point_m[1] + offset[2]]
        };
        let placed = |member: &Member| {
            let old = member.placement;
            let [x_deg, y_deg, z_deg] = old.rotation_deg;
            let [x_m, z_m] = moved([old.position_m[0], old.position_m[2]]);
            let placement = Placement {
                position_m: [round_to(x_m, ROUND_M), old.position_m[1], round_to(z_m, ROUND_M)],
                rotation_deg: [x_deg, turned_deg(y_deg + turn_deg), z_deg],
                parent: old.parent,
            };
            let solids = member.solids.iter().map(|solid| Footprint {
                outline_m: solid.outline_m.iter().map(|&point| moved(point)).collect(),
                ..*solid
            });
            PlacedItem {
                index: member.index,
                is_root: member.is_root,
                placement,
                solids: solids.collect(),
            }
        };
        self.members.iter().map(placed).collect()
    }
}
