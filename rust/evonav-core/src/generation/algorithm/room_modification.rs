//! The three room modifications (paper, Sec. 3.2).

use crate::{
    assets::{Catalogue, placement_rule::Place},
    generation::{
        Mode, Parameters,
        placement::{
            asset_groups::{Group, groups_of, rearranged},
            movable_group::{Rules, Unit},
            place_search::{Search, placements},
            reach::Reach,
            room_outline::RoomPlan,
        },
        record::ModificationFailure,
    },
    house::House,
    rng::Stream,
    world::layout::{
        Layout, Placement,
        free_floor::Floor,
        surfaces::{is_fitting, receptacles_for, sample_surface_place},
    },
};

/// Free places of one unit that may turn out to cut the house in two before it is left alone.
const NAVIGATION_TRIES: usize = 8;
/// Ways to put a group together anew that are tried before it is left alone.
const REARRANGE_TRIES: usize = 20;

/// A move this long is seen; shorter ones are made where nothing else is free.
const SEEN_M: f64 = 0.5;

/// A room, modified.
#[derive(Debug, Clone)]
pub struct Modification {
    /// All objects, where they are now.
    pub layout: Layout,
    /// The object that `SALIENT_OBJECT` moved.
    pub salient: Option<usize>,
    /// Objects that were to move, but for which no valid place was found, and why.
    pub unmoved: Vec<(usize, Blocked)>,
    /// Furniture that stands where ProcTHOR's rules would not put it, or with less floor around it.
    pub crowded: Vec<usize>,
    /// Furniture of groups that were arranged anew.
    pub rearranged: Vec<usize>,
}

/// Why something stays where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blocked {
    /// No place drawn was free.
    NoFreePlace,
    /// Places were free, and each cut something off.
    CutsOff,
}

/// What a modification needs to know, and its random stream.
pub struct Modifier<'a> {
    /// The house as it is.
    pub house: &'a House,
    /// Where things may stand.
    pub catalogue: &'a Catalogue,
    /// Θ.
    pub parameters: &'a Parameters,
    /// Source of all draws.
    pub stream: Stream,
    /// What must stay in reach.
    pub reach: Reach,
}

impl Modification {
    /// Nothing done yet.
    fn of(layout: &Layout) -> Self {
        Self {
            layout: layout.clone(),
            salient: None,
            unmoved: Vec::new(),
            crowded: Vec::new(),
            rearranged: Vec::new(),
        }
    }
}

/// A modification at work: the room's units, and what has become of them.
struct Work {
    plan: RoomPlan,
    groups: Vec<Group>,
    /// Floor that each group keeps.
    reserves: Vec<Floor>,
    done: Modification,
}

impl Modifier<'_> {
    /// Modifies one room.
    ///
    /// Objects are taken up and put down one unit at a time, in random order, the others staying
    /// where they are: every intermediate layout is valid, so that a unit that fits nowhere else
    /// can keep its place. Units that failed are tried once more when all others have moved.
    ///
    /// # Errors
    /// Why nothing in the room could be moved.
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
                .map(|&index| Group { roots: vec![index], definition: None })
                .collect(),
        };
        let plan = RoomPlan::of(house, &house.rooms[room]);
        let mut work = Work { plan, groups, reserves: Vec::new(), done: Modification::of(layout) };
        work.reserves = (0..work.groups.len())
            .map(|group| self.unit(&work, group).reserve_now(&work.plan))
            .collect();
        let is_moved = match mode {
            Mode::SalientObject => self.move_salient(&mut work),
            Mode::RetainGroup => self.move_groups(&mut work),
            Mode::FullShuffle => {
                let have_moved = self.move_groups(&mut work);
                self.move_small(&mut work.done, &in_room) || have_moved
            }
        };
        let Work { done, .. } = work;
        let cuts_off = || done.unmoved.iter().any(|&(_, why)| why == Blocked::CutsOff);
        match is_moved {
            true => Ok(done),
            false if done.unmoved.is_empty() => Err(ModificationFailure::NothingMovable),
            false if cuts_off() => Err(ModificationFailure::CutsOff),
            false => Err(ModificationFailure::NoFreePlace),
        }
    }

    /// Moves one large object with what stands on it, drawn in proportion to 1 + the number of
    /// things on it; another one if it fits nowhere else.
    ///
    /// The paper does not say how the salient object is drawn; this weight reproduces its
    /// relocated-object ratio (uniform over furniture does not).
    fn move_salient(&mut self, work: &mut Work) -> bool {
        let layout = &work.done.layout;
        let roots: Vec<usize> = work.groups.iter().map(|group| group.roots[0]).collect();
        let mut weights: Vec<f64> =
            roots.iter().map(|&root| layout.with_supported(root).len() as f64).collect();
        while let Some(drawn) = self.stream.choose_weighted(&weights) {
            match self.move_group(work, drawn) {
                Ok(()) => {
                    // It was drawn without replacement: nothing else was to move.
                    work.done.unmoved.clear();
                    work.done.salient = Some(roots[drawn]);
                    return true;
                }
                Err(why) => work.done.unmoved.push((roots[drawn], why)),
            }
            weights[drawn] = 0.0;
        }
        false
    }

    /// Moves groups of furniture with what stands on them.
    fn move_groups(&mut self, work: &mut Work) -> bool {
        let num_groups = work.groups.len();
        let mut order: Vec<usize> = (0..num_groups).collect();
        self.stream.shuffle(&mut order);
        let mut reasons = vec![Blocked::NoFreePlace; num_groups];
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
            let layout = &work.done.layout;
            let roots = work.groups[group].roots.iter();
            let members = roots.flat_map(|&root| layout.with_supported(root));
            work.done.unmoved.extend(members.map(|member| (member, reasons[group])));
        }
        order.len() < num_groups
    }

    /// Moves one group: as it is, by all of ProcTHOR's rules or, where the room is too full for
    /// that, without the floor that they keep free; put together anew where it fits nowhere as it is.
    fn move_group(&mut self, work: &mut Work, group: usize) -> Result<(), Blocked> {
        let unit = self.unit(work, group);
        let tries = self.parameters.placement_tries;
        let least_m = self.parameters.relocated_min_m;
        let seen_m = SEEN_M.max(least_m);
        let (all, relaxed) = (Rules::All, Rules::Relaxed);
        let mut num_cut = 0;
        for how in [(all, seen_m), (relaxed, seen_m), (all, least_m), (relaxed, least_m)] {
            if self.place(work, group, &unit, how, tries, &mut num_cut) {
                return Ok(());
            }
        }
        let num_anew = if unit.roots.len() > 1 { REARRANGE_TRIES } else { 0 };
        for how in [(all, least_m), (relaxed, least_m)] {
            for _ in 0..num_anew {
                let layout = &work.done.layout;
                let anew = rearranged(&unit, layout, self.catalogue, &mut self.stream);
                let tries = tries.div_ceil(REARRANGE_TRIES);
                if anew.is_some_and(|u| self.place(work, group, &u, how, tries, &mut num_cut)) {
                    work.done.rearranged.extend(&unit.roots);
                    return Ok(());
                }
            }
        }
        Err(if num_cut > 0 { Blocked::CutsOff } else { Blocked::NoFreePlace })
    }

    /// Draws places for a unit until one is free and cuts nothing off, and puts it there.
    fn place(
        &mut self,
        work: &mut Work,
        group: usize,
        unit: &Unit,
        (rules, min_move_m): (Rules, f64),
        tries: usize,
        num_cut: &mut usize,
    ) -> bool {
        let most_cut = *num_cut + NAVIGATION_TRIES;
        for _ in 0..tries {
            let search = Search {
                layout: &work.done.layout,
                plan: &work.plan,
                reserves: &work.reserves,
                own: group,
                min_move_m,
            };
            let Some((placed, reserve)) = search.draw(unit, rules, &mut self.stream) else {
                continue;
            };
            if self.put(&mut work.done.layout, &placements(&placed)) {
                work.reserves[group] = reserve;
                if rules == Rules::Relaxed {
                    work.done.crowded.extend(&unit.roots);
                }
                return true;
            }
            *num_cut += 1;
            if *num_cut == most_cut {
                break;
            }
        }
        false
    }

    /// Puts objects somewhere, unless that cuts something off.
    fn put(&mut self, layout: &mut Layout, places: &[(usize, Placement)]) -> bool {
        let moved = || places.iter().map(|(index, _)| *index);
        let before: Vec<Placement> = moved().map(|index| layout.items[index].placement).collect();
        for &(index, placement) in places {
            layout.put(index, placement);
        }
        let is_kept = self.reach.still_reaches(layout, moved());
        if !is_kept {
            for (index, placement) in moved().zip(before) {
                layout.put(index, placement);
            }
            self.reach.take_in(layout, moved());
        }
        is_kept
    }

    /// Moves each small thing of the room to a receptacle of the room.
    fn move_small(&mut self, done: &mut Modification, in_room: &[usize]) -> bool {
        let items = &done.layout.items;
        // What the catalogue does not know has a size that was guessed from its place: it goes
        // where that goes.
        let is_known = |index: usize| self.catalogue.get(&items[index].asset.id).is_some();
        let is_small = |&&index: &&usize| {
            let item = &items[index];
            item.placement.parent.is_some() && !is_fitting(item) && is_known(index)
        };
        let mut order: Vec<usize> = in_room.iter().filter(is_small).copied().collect();
        let num_small = order.len();
        self.stream.shuffle(&mut order);
        let mut reasons = vec![Blocked::NoFreePlace; done.layout.items.len()];
        for _ in 0..2 {
            order.retain(|&index| match self.move_small_one(&mut done.layout, index, in_room) {
                Ok(()) => false,
                Err(why) => {
                    reasons[index] = why;
                    true
                }
            });
        }
        let num_moved = num_small - order.len();
        done.unmoved.extend(order.into_iter().map(|index| (index, reasons[index])));
        num_moved > 0
    }

    fn move_small_one(
        &mut self,
        layout: &mut Layout,
        index: usize,
        in_room: &[usize],
    ) -> Result<(), Blocked> {
        let (receptacles, weights) = receptacles_for(layout, self.catalogue, index, in_room);
        let least_m = self.parameters.relocated_min_m;
        let mut num_cut = 0;
        for _ in 0..self.parameters.placement_tries {
            let Some(drawn) = self.stream.choose_weighted(&weights) else { break };
            let on = [receptacles[drawn]];
            let place = sample_surface_place(layout, index, &on, least_m, &mut self.stream);
            let Some(place) = place else { continue };
            let places = layout.carried(index, place);
            if !layout.is_clear(&places) {
                continue;
            }
            if self.put(layout, &places) {
                return Ok(());
            }
            num_cut += 1;
            if num_cut == NAVIGATION_TRIES {
                break;
            }
        }
        Err(if num_cut > 0 { Blocked::CutsOff } else { Blocked::NoFreePlace })
    }

    /// A group as it stands, with the ways in which it may stand.
    fn unit(&self, work: &Work, group: usize) -> Unit {
        let layout = &work.done.layout;
        let Group { roots, definition } = &work.groups[group];
        let category = &layout.items[roots[0]].asset.category;
        let own = self.places_for(category);
        let Some(index) = *definition else {
            let anchors = if roots.len() == 1 { own } else { Vec::new() };
            return Unit::new(layout, roots, None, [&anchors, &anchors], &work.plan);
        };
        // ProcTHOR also puts a television with its sofa into the middle of a room, and the back of
        // its stand, which alone goes to walls only, to a door: that is left for want of better.
        let all = &self.catalogue.groups()[index].places;
        let both: Vec<Place> = all.iter().copied().filter(|place| own.contains(place)).collect();
        let preferred = if both.is_empty() { all } else { &both };
        Unit::new(layout, roots, Some(index), [preferred, all], &work.plan)
    }

    /// Where a category may stand on the floor, by ProcTHOR's annotations.
    fn places_for(&self, category: &str) -> Vec<Place> {
        let rule = self.catalogue.placement(category);
        let all = [Place::Corner, Place::Edge, Place::Middle];
        all.into_iter().filter(|&place| rule.is_some_and(|r| r.is_placed(place))).collect()
    }
}
