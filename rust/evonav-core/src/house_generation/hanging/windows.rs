//! Windows (`wall_objects.add_windows` of the package `procthor`).

use crate::{
    assets::{Asset, Catalogue, OpeningSpace, placement_rule::Place},
    house_generation::{
        doors::Openings,
        hanging::wall_space::WallSpace,
        interior::Piece,
        parameters::HouseParameters,
        sampling::{choose, uniform_in},
        structure::Structure,
    },
    rng::Stream,
};

/// A window in an outer wall.
#[derive(Debug, Clone)]
pub(in crate::house_generation) struct PlacedWindow {
    pub asset: &'static Asset,
    pub space: &'static OpeningSpace,
    /// Index of its room.
    pub room: usize,
    /// Index of its border.
    pub border: usize,
    /// Start of its box along the room's side of the border.
    pub start_m: f64,
    /// Height of its lower edge.
    pub bottom_m: f64,
}

/// Draw the windows of a house, at most one on each side of a room.
pub(in crate::house_generation) fn sample_windows(
    parameters: &HouseParameters,
    structure: &Structure,
    openings: &Openings,
    furniture: &[Vec<Piece>],
    stream: &mut Stream,
) -> Vec<PlacedWindow> {
    let catalogue = Catalogue::bundled();
    let rules = &parameters.hung;
    let assets: Vec<(&Asset, &OpeningSpace)> = catalogue
        .assets_in("Window")
        .iter()
        .filter_map(|id| catalogue.get(id).zip(catalogue.opening(id)))
        .filter(|(asset, _)| {
            asset.split == Some(parameters.split) && asset.size_m[1] < structure.height_m
        })
        .collect();
    let widths = assets.iter().map(|(asset, _)| asset.size_m[0]);
    let narrowest_m = widths.fold(f64::INFINITY, f64::min);
    let mut windows = Vec::new();
    for (index, room) in structure.rooms.iter().enumerate() {
        if !rules.window_rooms.contains(&room.room_type) {
            continue;
        }
        // A wall has a door or a window, not both: a limit of AI2-THOR.
        let mut space = WallSpace::new(room, |_, side| {
            structure.borders[side.border].rooms.1.is_none()
                && openings.doors.iter().all(|door| door.border != side.border)
        });
        let backed = furniture[index].iter().filter(|piece| piece.place != Place::Middle);
        backed.for_each(|piece| space.take_behind(&piece.margined));
        let num_windows = stream.choose_weighted(&rules.window_weights).unwrap_or(0);
        for _ in 0..num_windows {
            let Some(stretch) = space.sample(narrowest_m, stream) else { break };
            let fitting: Vec<_> =
                assets.iter().filter(|(asset, _)| asset.size_m[0] < stretch.length_m()).collect();
            let Some(&&(asset, opening)) = choose(stream, &fitting) else { break };
            let [from, to] = stretch.along_m;
            let ceiling_m = structure.height_m.min(rules.centred_below_m);
            windows.push(PlacedWindow {
                asset,
                space: opening,
                room: index,
                border: room.sides[stretch.side].border,
                start_m: uniform_in(stream, [from, to - asset.size_m[0]]),
                bottom_m: (0.5 * (ceiling_m - asset.size_m[1])).max(0.0),
            });
            space.stretches.retain(|other| other.side != stretch.side);
        }
    }
    windows
}
