//! ProcTHOR's asset groups: their members, and how the members are arranged.

use std::collections::HashMap;

use serde::Deserialize;

use crate::{
    assets::placement_rule::Place,
    geometry::{Vec2, Vec3},
};

/// One of ProcTHOR's 18 asset groups, in the frame of its first member, which looks along +z.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct GroupDefinition {
    /// Name, for example `chair-diningtable-2`.
    pub name: String,
    /// Places in a room where the group may stand.
    #[serde(rename = "where")]
    pub places: Vec<Place>,
    /// Weight by room type, as [`crate::assets::placement_rule::PlacementRule::room_weight`].
    rooms: HashMap<String, f64>,
    /// Whether a room may have several of these groups.
    pub allows_duplicates: bool,
    /// Members; each comes after its parent. The first has no parent.
    pub members: Vec<GroupMember>,
}

/// A member of a group, and its place relative to another member.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct GroupMember {
    /// Category of the member.
    pub category: String,
    /// Name of the member's asset: members of one name are the same asset.
    pub name: String,
    /// Ids of the assets that the member may be; empty if an earlier member has the same name.
    #[serde(default)]
    pub assets: Vec<String>,
    /// Index of the member to which its place is relative; `None` for the first.
    #[serde(default)]
    pub parent: Option<usize>,
    /// Whether it stands on its parent instead of next to it.
    #[serde(default)]
    pub is_above: bool,
    /// Side of the parent's box, along x and z: -1, 0 or 1.
    #[serde(default)]
    anchor: Vec2,
    /// Side of that edge on which the member's own box lies: -1, 0 (centred) or 1.
    #[serde(default)]
    align: Vec2,
    /// Offset that is added.
    #[serde(default)]
    offset_m: Vec2,
    /// Yaw relative to the group.
    #[serde(default)]
    pub turn_deg: f64,
    /// Largest deviation from that yaw, either way.
    pub spread_deg: f64,
}

/// Pose of a member in the frame of the group's first member.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MemberPose {
    /// Centre, `[x, z]`.
    pub centre_m: Vec2,
    /// Yaw.
    pub yaw_deg: f64,
    /// Edge lengths of the axis-aligned box around the member's turned box.
    pub extent_m: Vec2,
}

impl GroupDefinition {
    /// Place the members next to each other, side to side by their turned boxes, as
    /// `AssetGroupGenerator.sample_object_placement` of the package `procthor` does.
    ///
    /// # Arguments
    /// * `sizes_m` - box per member; `None` leaves out the member and all members placed relative
    ///   to it.
    /// * `turns_deg` - per member, its deviation from its yaw.
    ///
    /// # Returns
    /// One pose per member; `None` for those left out.
    pub fn arrange(&self, sizes_m: &[Option<Vec3>], turns_deg: &[f64]) -> Vec<Option<MemberPose>> {
        let mut poses: Vec<Option<MemberPose>> = Vec::with_capacity(self.members.len());
        for (index, member) in self.members.iter().enumerate() {
            let size_m = sizes_m.get(index).copied().flatten();
            let turn_deg = turns_deg.get(index).copied().unwrap_or(0.0);
            let pose = size_m.and_then(|size_m| {
                let yaw_deg = member.turn_deg + turn_deg;
                let extent_m = turned_extent(size_m, yaw_deg);
                let centre_m = match member.parent {
                    None => [0.0; 2],
                    Some(parent) => {
                        let parent = (*poses.get(parent)?)?;
                        [0, 1].map(|i| {
                            parent.centre_m[i]
                                + member.offset_m[i]
                                + 0.5 * member.anchor[i] * parent.extent_m[i]
                                + 0.5 * member.align[i] * extent_m[i]
                        })
                    }
                };
                Some(MemberPose { centre_m, yaw_deg, extent_m })
            });
            poses.push(pose);
        }
        poses
    }

    /// Return 0 if the group is not placed in rooms of this type.
    pub fn room_weight(&self, room_type: &str) -> f64 {
        self.rooms.get(room_type).copied().unwrap_or(0.0)
    }

    /// Return the categories of the members that stand on the floor, in the members' order.
    pub fn floor_categories(&self) -> impl Iterator<Item = &str> {
        self.members.iter().filter(|m| !m.is_above).map(|m| m.category.as_str())
    }
}

/// Return the edge lengths of the axis-aligned box around a box that is turned about the vertical.
fn turned_extent([x_m, _, z_m]: Vec3, yaw_deg: f64) -> Vec2 {
    let (sin, cos) = yaw_deg.to_radians().sin_cos();
    [x_m * cos.abs() + z_m * sin.abs(), x_m * sin.abs() + z_m * cos.abs()]
}
