//! Televisions and paintings on walls (`wall_objects` of the package `procthor`).

use crate::{
    assets::{Asset, placement_rule::Place},
    geometry::Vec2,
    house_generation::{
        doors::Openings,
        hanging::{
            wall_space::{Stretch, WallSpace, reach_along},
            windows::PlacedWindow,
        },
        interior::{Piece, PlacedObject, Stock},
        parameters::{HouseParameters, Hung},
        sampling::{beta, choose, happens, uniform_in},
        structure::Structure,
    },
    rng::Stream,
};

/// The walls of a room and the low furniture in front of them.
struct Walls<'a> {
    rules: &'a Hung,
    structure: &'a Structure,
    room: usize,
    space: WallSpace<'a>,
    low: Vec<&'a Piece>,
}

/// Draw what hangs on the walls of each room.
pub(in crate::house_generation) fn sample_hung(
    parameters: &HouseParameters,
    stock: &Stock,
    structure: &Structure,
    openings: &Openings,
    windows: &[PlacedWindow],
    furniture: &[Vec<Piece>],
    stream: &mut Stream,
) -> Vec<Vec<PlacedObject>> {
    let rules = &parameters.hung;
    let assets = |category: &str| {
        stock.categories.get(category).map_or(Vec::new(), |category| category.assets.clone())
    };
    let mut televisions = assets("Television");
    televisions.retain(|asset| rules.televisions.contains(&asset.id));
    let mut paintings = assets("Painting");
    let mut hung = Vec::with_capacity(structure.rooms.len());
    for (index, room) in structure.rooms.iter().enumerate() {
        let mut walls = Walls::of(rules, structure, index, openings, windows, &furniture[index]);
        let mut found = Vec::new();
        let television_probability = rules.television_rooms.get(&room.room_type);
        let wants_television = television_probability.is_some_and(|&p| happens(stream, p))
            && !furniture[index].iter().any(|piece| piece.has("Television"));
        if wants_television {
            found.extend(walls.hang(&televisions, stream));
        }
        let num_paintings = match rules.painting_rooms.contains(&room.room_type) {
            true => stream.choose_weighted(&rules.painting_weights).unwrap_or(0),
            false => 0,
        };
        for _ in 0..num_paintings {
            if let Some(object) = walls.hang(&paintings, stream) {
                // No painting twice in a house.
                paintings.retain(|asset| asset.id != object.asset.id);
                found.push(object);
            }
        }
        hung.push(found);
    }
    hung
}

impl<'a> Walls<'a> {
    fn of(
        rules: &'a Hung,
        structure: &'a Structure,
        room: usize,
        openings: &Openings,
        windows: &[PlacedWindow],
        furniture: &'a [Piece],
    ) -> Self {
        let planned = &structure.rooms[room];
        let mut space = WallSpace::new(planned, |_, side| !openings.is_open[side.border]);
        for (index, side) in planned.sides.iter().enumerate() {
            for door in openings.doors.iter().filter(|door| door.border == side.border) {
                let door = if door.room == room { door } else { &door.flipped(structure) };
                space.take(index, [door.start_m, door.start_m + door.space.hole_m[0]]);
            }
            for window in windows.iter().filter(|window| window.border == side.border) {
                space.take(index, [window.start_m, window.start_m + window.asset.size_m[0]]);
            }
        }
        let mut low = Vec::new();
        for piece in furniture.iter().filter(|piece| piece.place != Place::Middle) {
            if piece.top_m() < rules.clear_above_m {
                low.push(piece);
            } else {
                space.take_behind(&piece.margined);
            }
        }
        Self { rules, structure, room, space, low }
    }

    /// Hang one of some assets on a free stretch; `None` if there is no room for the drawn one.
    fn hang(&mut self, assets: &[&'static Asset], stream: &mut Stream) -> Option<PlacedObject> {
        let widths = assets.iter().map(|asset| asset.size_m[0]);
        let stretch = self.space.sample(widths.fold(f64::INFINITY, f64::min), stream)?;
        let fits = |asset: &&&Asset| asset.size_m[0] < stretch.length_m();
        let fitting: Vec<&Asset> = assets.iter().filter(fits).copied().collect();
        let asset = *choose(stream, &fitting)?;
        let [width_m, height_m, depth_m] = asset.size_m;
        let [from, to] = stretch.along_m;
        let start_m = uniform_in(stream, [from, to - width_m]);
        let along_m = [start_m, start_m + width_m];
        let centre_height_m = self.sample_height_m(stretch, along_m, height_m, stream)?;
        self.space.take(stretch.side, along_m);
        let side = &self.structure.rooms[self.room].sides[stretch.side];
        let along = side.along();
        // The room is on the right of its sides.
        let inward: Vec2 = [along[1], -along[0]];
        let (middle_m, off_m) = (start_m + 0.5 * width_m, self.rules.gap_m + 0.5 * depth_m);
        let [x, z] = [0, 1].map(|i| side.from_m[i] + middle_m * along[i] + off_m * inward[i]);
        Some(PlacedObject {
            asset,
            position_m: [x, centre_height_m, z],
            rotation_deg: [0.0, inward[0].atan2(inward[1]).to_degrees().rem_euclid(360.0), 0.0],
            parent: None,
            openness: None,
        })
    }

    /// Draw the height of an object's middle, above all furniture that stands before it; `None` if
    /// there is too little room.
    fn sample_height_m(
        &self,
        stretch: Stretch,
        along_m: [f64; 2],
        height_m: f64,
        stream: &mut Stream,
    ) -> Option<f64> {
        let side = &self.structure.rooms[self.room].sides[stretch.side];
        let is_before = |piece: &&&Piece| {
            reach_along(side, &piece.floor)
                .is_some_and(|[from, to]| from < along_m[1] && along_m[0] < to)
        };
        let tops = self.low.iter().filter(is_before).map(|piece| piece.top_m());
        let bottom_m = tops.fold(0.0, f64::max);
        let top_m = self.structure.height_m.min(self.rules.centred_below_m);
        let slack_m = top_m - bottom_m - height_m;
        (slack_m >= 0.0)
            .then(|| bottom_m + 0.5 * height_m + slack_m * beta(stream, self.rules.height_beta))
    }
}
