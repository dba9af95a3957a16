//! The rooms of a house, and the shares of the floor that they get.

use serde::{Deserialize, Serialize};

/// A kind of house: its rooms as a tree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoomSpec {
    /// Name, written into the house as `roomSpecId`.
    pub id: String,
    /// Weight with which the spec is drawn.
    pub weight: f64,
    /// Sizes of the house along x and z in cells, each `[least, most]`; `None`: they depend on the
    /// number of rooms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cells: Option<[[usize; 2]; 2]>,
    /// Rooms and groups of rooms.
    pub rooms: Vec<RoomNode>,
}

/// A room, or a group of rooms that lie together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoomNode {
    /// Share of the floor, relative to the other rooms and groups beside this one.
    pub ratio: f64,
    /// Room type; `None` for a group.
    #[serde(default, rename = "type", skip_serializing_if = "Option::is_none")]
    pub room_type: Option<String>,
    /// Whether doors from outside its group lead to other rooms, if that is possible.
    #[serde(default, skip_serializing_if = "is_false")]
    pub is_private: bool,
    /// Rooms of a group; empty for a room.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rooms: Vec<RoomNode>,
}

fn is_false(flag: &bool) -> bool {
    !flag
}

impl RoomSpec {
    /// Return the rooms of the tree, depth first: the order in which rooms are numbered.
    pub fn leaves(&self) -> Vec<&RoomNode> {
        self.rooms.iter().flat_map(RoomNode::leaves).collect()
    }
}

impl RoomNode {
    /// Return the rooms of this group, or the room itself.
    pub fn leaves(&self) -> Vec<&Self> {
        match self.rooms.is_empty() {
            true => vec![self],
            false => self.rooms.iter().flat_map(Self::leaves).collect(),
        }
    }

    fn room(ratio: f64, room_type: &str) -> Self {
        let room_type = Some(room_type.to_owned());
        Self { ratio, room_type, is_private: false, rooms: Vec::new() }
    }

    fn private(ratio: f64, room_type: &str) -> Self {
        Self { is_private: true, ..Self::room(ratio, room_type) }
    }

    fn group(ratio: f64, rooms: Vec<Self>) -> Self {
        Self { ratio, room_type: None, is_private: false, rooms }
    }
}

/// Return the 16 specs of ProcTHOR-10k (`room_specs.PROCTHOR10K_ROOM_SPEC_SAMPLER`).
pub(super) fn procthor_specs() -> Vec<RoomSpec> {
    let room = RoomNode::room;
    let group = RoomNode::group;
    let bath = |ratio| RoomNode::private(ratio, "Bathroom");
    let bed = |ratio| room(ratio, "Bedroom");
    let kitchen = |ratio| room(ratio, "Kitchen");
    let living = |ratio| room(ratio, "LivingRoom");
    let suite = |ratio| group(ratio, vec![bed(2.0), bath(1.0)]);
    let public = |ratio| group(ratio, vec![kitchen(3.0), living(2.0)]);
    let even = |ratio| group(ratio, vec![kitchen(3.0), living(3.0)]);
    let spec = |id: &str, weight, rooms| RoomSpec { id: id.to_owned(), weight, cells: None, rooms };
    let lounge = |ratio| group(ratio, vec![living(2.0), bath(1.0)]);
    vec![
        RoomSpec {
            cells: Some([[5, 8], [13, 16]]),
            ..spec(
                "8-room-3-bed",
                1.0,
                vec![
                    group(4.0, vec![even(2.0), lounge(1.0)]),
                    group(1.0, vec![bed(1.0)]),
                    group(1.0, vec![bed(1.0)]),
                    group(2.0, vec![bed(1.0), bath(1.0)]),
                ],
            )
        },
        spec(
            "7-room-3-bed",
            1.0,
            vec![
                group(3.0, vec![even(2.0), lounge(1.0)]),
                group(2.0, vec![bed(2.0), bed(2.0), bed(2.0)]),
            ],
        ),
        spec(
            "12-room-3-bed",
            1.0,
            vec![
                group(1.0, vec![even(1.0), group(1.0, vec![living(1.0), living(1.0)])]),
                group(1.0, vec![suite(1.0), suite(1.0), suite(1.0)]),
            ],
        ),
        spec(
            "12-room",
            1.0,
            vec![
                group(2.0, vec![even(1.0), suite(1.0)]),
                group(3.0, vec![suite(1.0), suite(1.0), suite(1.0)]),
            ],
        ),
        spec("4-room", 5.0, vec![suite(2.0), public(2.0)]),
        spec(
            "2-bed-1-bath",
            1.0,
            vec![group(2.0, vec![kitchen(3.0), bath(2.0), living(3.0)]), bed(1.0), bed(1.0)],
        ),
        spec("5-room", 1.0, vec![suite(2.0), bed(2.0), public(2.0)]),
        spec("2-bed-2-bath", 1.0, vec![suite(2.0), suite(2.0), public(2.0)]),
        spec("bedroom-bathroom", 2.0, vec![bed(2.0), room(1.0, "Bathroom")]),
        spec("kitchen-living-bedroom-room", 1.0, vec![public(2.0), bed(1.0)]),
        spec(
            "kitchen-living-bedroom-room2",
            1.0,
            vec![group(2.0, vec![kitchen(1.0), living(1.0)]), bed(1.0)],
        ),
        spec("kitchen-living-room", 2.0, vec![kitchen(1.0), living(1.0)]),
        spec("kitchen", 1.0, vec![kitchen(1.0)]),
        spec("living-room", 1.0, vec![living(1.0)]),
        spec("bedroom", 1.0, vec![bed(1.0)]),
        spec("bathroom", 1.0, vec![room(1.0, "Bathroom")]),
    ]
}
