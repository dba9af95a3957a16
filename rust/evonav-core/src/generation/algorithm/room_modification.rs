//! The three room modifications (paper, Sec. 3.2).

use crate::{
    assets::{Catalogue, placement_rule::Place},
    generation::{
        Mode, Parameters,
        placement::{
            asset_groups::{AssetGroup, groups_of, rearranged},
            movable_group::{MovableGroup, Rules},
            place_search::{PlaceSearch, placements},
            reach::Reach,
            room_outline::RoomOutline,
        },
        record::ModificationFailure,
    },
    house::House,
    rng::Stream,
    world::layout::{
        Layout, Placement,
        free_floor::FloorPatch,
        surfaces::{is_fitting, receptacles_for, sample_surface_place},
    },
};

/// Number of free places of one group that may cut the house in two before the group is left where
/// it is.
const NAVIGATION_TRIES: usize = 8;
/// Number of rearrangements of a group that are tried before the group is left where it is.
const REARRANGE_TRIES: usize = 20;

/// Length of a move that is noticeable; shorter moves are used only if nothing else is free.
const SEEN_M: f64 = 0.5;

/// A modification of a room.
#[derive(Debug, Clone)]
pub struct Modification {
    /// All objects at their new places.
    pub layout: Layout,
    /// Index of the object that `SALIENT_OBJECT` moved.
    pub salient: Option<usize>,
    /// Objects that were to move and found no valid place, with the reason.
    pub unmoved: Vec<(usize, UnmovedReason)>,
    /// Furniture at places that ProcTHOR's rules do not allow, or with less floor around it.
    pub crowded: Vec<usize>,
    /// Furniture of groups that were rearranged.
    pub rearranged: Vec<usize>,
}

/// Reasons why an object stays where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnmovedReason {
    /// None of the drawn places was free.
    NoFreePlace,
    /// Places were free, but each one cut something off.
    CutsOff,
}

/// The context of a modification, and its random stream.
pub struct Modifier<'a> {
    /// The house before the modification.
    pub house: &'a House,
    /// Facts about where objects may stand.
    pub catalogue: &'a Catalogue,
    /// Θ.
    pub parameters: &'a Parameters,
    /// Source of all draws.
    pub stream: Stream,
    /// Rooms and objects that must stay reachable.
    pub reach: Reach,
}

impl Modification {
    /// Create a modification that changes nothing.
    fn unchanged(layout: &Layout) -> Self {
        Self {
            layout: layout.clone(),
            salient: None,
            unmoved: Vec::new(),
            crowded: Vec::new(),
            rearranged: Vec::new(),
        }
    }
}

/// A modification in progress: the room's groups and the result so far.
struct Work {
    outline: RoomOutline,
    groups: Vec<AssetGroup>,
    /// Floor of each group.
    floors: Vec<FloorPatch>,
    result: Modification,
}

impl Modifier<'_> {
    /// Modify one room.
    ///
    /// Groups of objects are moved one at a time, in random order, while the others stay. Every
    /// intermediate layout is valid, so a group that fits nowhere else can stay where it is. Groups
    /// that failed are tried once more after all others have moved.
    ///
    /// # Errors
    /// The reason why nothing in the room could be moved.
    pub fn modify(
        &mut self,
        layout: &Layout,
        room: usize,
        mode: Mode,
    ) -> Result<Modification, ModificationFailure> {
        let house = self.house;
        let in_room: Vec<usize> =
            (0..layout.items.len()).filter(|&i| house.objects[i].room == Some(room)).collect();
        let groups = match mode {
            Mode::RetainGroup => groups_of(house, layout, self.catalogue, &in_room),
            Mode::SalientObject | Mode::FullShuffle => in_room
                .iter()
                .filter(|&&index| layout.items[index].is_on_floor)
                .map(|&index| AssetGroup { roots: vec![index], definition: None })
                .collect(),
        };
        let outline = RoomOutline::of(house, &house.rooms[room]);
        let mut work =
            Work { outline, groups, floors: Vec::new(), result: Modification::unchanged(layout) };
        work.floors = (0..work.groups.len())
            .map(|group| self.movable_group(&work, group).floor_now(&work.outline))
            .collect();
        let is_moved = match mode {
            Mode::SalientObject => self.move_salient(&mut work),
            Mode::RetainGroup => self.move_groups(&mut work),
            Mode::FullShuffle => {
                let have_moved = self.move_groups(&mut work);
                self.move_small(&mut work.result, &in_room) || have_moved
            }
        };
        let Work { result, .. } = work;
        let cuts_off = || result.unmoved.iter().any(|&(_, why)| why == UnmovedReason::CutsOff);
        match is_moved {
            true => Ok(result),
            false if result.unmoved.is_empty() => Err(ModificationFailure::NothingMovable),
            false if cuts_off() => Err(ModificationFailure::CutsOff),
            false => Err(ModificationFailure::NoFreePlace),
        }
    }

    /// Move one large object with the objects on it. It is drawn in proportion to 1 + the number of
    /// objects on it; if it fits nowhere else, another one is drawn.
    ///
    /// The paper does not say how the salient object is drawn; this weight reproduces its
    /// relocated-object ratio (uniform over furniture does not).
    fn move_salient(&mut self, work: &mut Work) -> bool {
        let layout = &work.result.layout;
        let roots: Vec<usize> = work.groups.iter().map(|group| group.roots[0]).collect();
        let mut weights: Vec<f64> =
            roots.iter().map(|&root| layout.with_supported(root).len() as f64).collect();
        while let Some(drawn) = self.stream.choose_weighted(&weights) {
            match self.move_group(work, drawn) {
                Ok(()) => {
                    // The draws before were without replacement: nothing else was to move.
                    work.result.unmoved.clear();
                    work.result.salient = Some(roots[drawn]);
                    return true;
                }
                Err(why) => work.result.unmoved.push((roots[drawn], why)),
            }
            weights[drawn] = 0.0;
        }
        false
    }

    /// Move groups of furniture with the objects on them.
    fn move_groups(&mut self, work: &mut Work) -> bool {
        let num_groups = work.groups.len();
        let mut order: Vec<usize> = (0..num_groups).collect();
        self.stream.shuffle(&mut order);
        let mut reasons = vec![UnmovedReason::NoFreePlace; num_groups];
        for _ in 0..2 {
            order.retain(|&group| match self.move_group(work, group) {
                Ok(()) => false,
                Err(why) => {
                    reasons[group] = why;
                    true
                }
            });
        }
        for &group in &order {
            let layout = &work.result.layout;
            let roots = work.groups[group].roots.iter();
            let members = roots.flat_map(|&root| layout.with_supported(root));
            work.result.unmoved.extend(members.map(|member| (member, reasons[group])));
        }
        order.len() < num_groups
    }

    /// Move one group: as it is, by all of ProcTHOR's rules or, if the room is too full for that,
    /// without the free floor; rearranged, if it fits nowhere as it is.
    fn move_group(&mut self, work: &mut Work, group: usize) -> Result<(), UnmovedReason> {
        let movable = self.movable_group(work, group);
        let tries = self.parameters.placement_tries;
        let least_m = self.parameters.relocated_min_m;
        let seen_m = SEEN_M.max(least_m);
        let (all, relaxed) = (Rules::All, Rules::Relaxed);
        let mut num_cut_off = 0;
        for how in [(all, seen_m), (relaxed, seen_m), (all, least_m), (relaxed, least_m)] {
            if self.place(work, group, &movable, how, tries, &mut num_cut_off) {
                return Ok(());
            }
        }
        let num_anew = if movable.roots.len() > 1 { REARRANGE_TRIES } else { 0 };
        for how in [(all, least_m), (relaxed, least_m)] {
            for _ in 0..num_anew {
                let layout = &work.result.layout;
                let rearranged_group =
                    rearranged(&movable, layout, self.catalogue, &mut self.stream);
                let tries = tries.div_ceil(REARRANGE_TRIES);
                if rearranged_group
                    .is_some_and(|u| self.place(work, group, &u, how, tries, &mut num_cut_off))
                {
                    work.result.rearranged.extend(&movable.roots);
                    return Ok(());
                }
            }
        }
        Err(if num_cut_off > 0 { UnmovedReason::CutsOff } else { UnmovedReason::NoFreePlace })
    }

    /// Draw places for a group until one is free and cuts nothing off, and put the group there.
    fn place(
        &mut self,
        work: &mut Work,
        group: usize,
        movable: &MovableGroup,
        (rules, min_move_m): (Rules, f64),
        tries: usize,
        num_cut_off: &mut usize,
    ) -> bool {
        let max_cut_off = *num_cut_off + NAVIGATION_TRIES;
        for _ in 0..tries {
            let search = PlaceSearch {
                layout: &work.result.layout,
                outline: &work.outline,
                floors: &work.floors,
                own: group,
                min_move_m,
            };
            let Some((placed, floor)) = search.draw(movable, rules, &mut self.stream) else {
                continue;
            };
            if self.put(&mut work.result.layout, &placements(&placed)) {
                work.floors[group] = floor;
                if rules == Rules::Relaxed {
                    work.result.crowded.extend(&movable.roots);
                }
                return true;
            }
            *num_cut_off += 1;
            if *num_cut_off == max_cut_off {
                break;
            }
        }
        false
    }

    /// Move objects, unless that cuts something off; return whether they moved.
    fn put(&mut self, layout: &mut Layout, places: &[(usize, Placement)]) -> bool {
        let moved = || places.iter().map(|(index, _)| *index);
        let before: Vec<Placement> = moved().map(|index| layout.items[index].placement).collect();
        for &(index, placement) in places {
            layout.put(index, placement);
        }
        let is_valid = self.reach.still_reaches(layout, moved());
        if !is_valid {
            for (index, placement) in moved().zip(before) {
                layout.put(index, placement);
            }
            self.reach.take_in(layout, moved());
        }
        is_valid
    }

    /// Move each small object of the room to a receptacle of the room.
    fn move_small(&mut self, result: &mut Modification, in_room: &[usize]) -> bool {
        let items = &result.layout.items;
        // A size that neither catalogue nor house gives was guessed from the object's place, so it
        // moves only with its support.
        let is_known = |index: usize| self.catalogue.knows_size(self.house, &items[index].asset.id);
        let is_small = |&&index: &&usize| {
            let item = &items[index];
            item.placement.parent.is_some() && !is_fitting(item) && is_known(index)
        };
        let mut order: Vec<usize> = in_room.iter().filter(is_small).copied().collect();
        let num_small = order.len();
        self.stream.shuffle(&mut order);
        let mut reasons = vec![UnmovedReason::NoFreePlace; result.layout.items.len()];
        for _ in 0..2 {
            order.retain(|&index| match self.move_small_one(&mut result.layout, index, in_room) {
                Ok(()) => false,
                Err(why) => {
                    reasons[index] = why;
                    true
                }
            });
        }
        let num_moved = num_small - order.len();
        result.unmoved.extend(order.into_iter().map(|index| (index, reasons[index])));
        num_moved > 0
    }

    fn move_small_one(
        &mut self,
        layout: &mut Layout,
        index: usize,
        in_room: &[usize],
    ) -> Result<(), UnmovedReason> {
        let (receptacles, weights) = receptacles_for(layout, self.catalogue, index, in_room);
        let least_m = self.parameters.relocated_min_m;
        let mut num_cut_off = 0;
        for _ in 0..self.parameters.placement_tries {
            let Some(drawn) = self.stream.choose_weighted(&weights) else { break };
            let on = [receptacles[drawn]];
            let place = sample_surface_place(layout, index, &on, least_m, &mut self.stream);
            let Some(place) = place else { continue };
            let places = layout.carry(index, place);
            if !layout.is_clear(&places) {
                continue;
            }
            if self.put(layout, &places) {
                return Ok(());
            }
            num_cut_off += 1;
            if num_cut_off == NAVIGATION_TRIES {
                break;
            }
        }
        Err(if num_cut_off > 0 { UnmovedReason::CutsOff } else { UnmovedReason::NoFreePlace })
    }

    /// Return a group as it stands, with the places at which it may stand.
    fn movable_group(&self, work: &Work, group: usize) -> MovableGroup {
        let layout = &work.result.layout;
        let AssetGroup { roots, definition } = &work.groups[group];
        let category = &layout.items[roots[0]].asset.category;
        let own = self.places_for(category);
        let Some(index) = *definition else {
            let anchors = if roots.len() == 1 { own } else { Vec::new() };
            return MovableGroup::new(layout, roots, None, [&anchors, &anchors], &work.outline);
        };
        // ProcTHOR also puts a television with its sofa in the middle of a room, with the back of
        // its stand, which alone stands only at walls, to a door. Such places are used only if
        // there are no others.
        let all = &self.catalogue.groups()[index].places;
        let both: Vec<Place> = all.iter().copied().filter(|place| own.contains(place)).collect();
        let preferred = if both.is_empty() { all } else { &both };
        MovableGroup::new(layout, roots, Some(index), [preferred, all], &work.outline)
    }

    /// Return the places on the floor at which a category may stand, by ProcTHOR's annotations.
    fn places_for(&self, category: &str) -> Vec<Place> {
        let rule = self.catalogue.placement(category);
        let all = [Place::Corner, Place::Edge, Place::Middle];
        all.into_iter().filter(|&place| rule.is_some_and(|r| r.is_placed(place))).collect()
    }
}
