//! The bodies of a house, as changes of a look know them.

use crate::house::House;

/// A body of a house, as changes know it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Subject<'a> {
    /// Kind of thing that the body is in the house file.
    pub part_of_house: PartOfHouse,
    /// Name that things which look alike share: the asset of objects, the room of walls.
    pub look: &'a str,
    /// Types of the rooms in which it is: of a door, of both its sides.
    pub room_types: [&'a str; 2],
}

/// Kind of thing that a body is in the house file, with its index.
#[derive(Debug, Clone, Copy)]
pub(super) enum PartOfHouse {
    Floor,
    Ceiling,
    Wall,
    Door(usize),
    Window,
    Object(usize),
}

/// Return the subjects of all bodies, in the order of [`Scene::bodies`].
pub(super) fn subjects(house: &House) -> Vec<Subject<'_>> {
    let type_of = |id: &str| {
        let room = house.rooms.iter().find(|room| room.id == id);
        room.map_or("", |room| room.room_type.as_str())
    };
    let subject = |part_of_house, look, room_types| Subject { part_of_house, look, room_types };
    let rooms = |part_of_house| {
        house
            .rooms
            .iter()
            .map(move |room| subject(part_of_house, room.id.as_str(), [room.room_type.as_str(); 2]))
    };
    let walls = house
        .walls
        .iter()
        .map(|wall| subject(PartOfHouse::Wall, wall.room_id.as_str(), [type_of(&wall.room_id); 2]));
    let doors = house.doors.iter().enumerate().map(|(index, door)| {
        let room_types = [0, 1].map(|side| type_of(&door.room_ids[side]));
        subject(PartOfHouse::Door(index), door.asset_id.as_str(), room_types)
    });
    let windows = house.windows.iter().map(|window| {
        let room_types = [0, 1].map(|side| type_of(&window.room_ids[side]));
        subject(PartOfHouse::Window, window.asset_id.as_str(), room_types)
    });
    let objects = house.objects.iter().enumerate().map(|(index, object)| {
        let room_type = object.room.map_or("", |room| house.rooms[room].room_type.as_str());
        subject(PartOfHouse::Object(index), object.asset_id.as_str(), [room_type; 2])
    });
    let structure = rooms(PartOfHouse::Floor).chain(rooms(PartOfHouse::Ceiling));
    structure.chain(walls).chain(doors).chain(windows).chain(objects).collect()
}
