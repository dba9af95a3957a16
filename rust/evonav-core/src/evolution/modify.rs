//! The three room modifications (paper, Sec. 3.2).

use super::{
    Mode, Parameters,
    layout::{Layout, Placement},
    placement::{RoomPlan, Unit},
    record::ModificationFailure,
    surfaces::{receptacles_for, sample_surface_place},
};
use crate::{
    assets::{catalogue::Catalogue, placement::Place},
    house::House,
    rng::Stream,
};

/// Free places of one unit that may turn out to cut the house in two before it is left alone.
const NAVIGATION_TRIES: usize = 8;
/// Part of what they stand on, wherever that goes.
const FITTINGS: [&str; 3] = ["Faucet", "ShowerHead", "Sink"];

/// A room, modified.
#[derive(Debug, Clone)]
pub struct Modification {
    /// All objects, where they are now.
    pub layout: Layout,
    /// The object that `SALIENT_OBJECT` moved.
    pub salient: Option<usize>,
    /// Objects that were to move, but for which no valid place was found, and why.
    pub unmoved: Vec<(usize, Blocked)>,
    /// Furniture without the free floor around it that ProcTHOR leaves.
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
pub struct Modifier<'a, N> {
    /// The house as it is.
    pub house: &'a House,
    /// Where things may stand.
    pub catalogue: &'a Catalogue,
    /// Θ.
    pub parameters: &'a Parameters,
    /// Source of all draws.
    pub stream: Stream,
    /// Whether everything that could be reached still can.
    pub is_navigable: N,
}

impl<N: FnMut(&Layout) -> bool> Modifier<'_, N> {
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
        let plan = RoomPlan::of(house, &house.rooms[room]);
        let mut done = Modification {
            layout: layout.clone(),
            salient: None,
            unmoved: Vec::new(),
            crowded: Vec::new(),
            rearranged: Vec::new(),
        };
        let is_moved = match mode {
            Mode::SalientObject => self.move_salient(&mut done, &in_room, &plan),
            Mode::RetainGroup => {
                let groups = groups_of(house, layout, &in_room);
                self.move_units(&mut done, &groups, &plan)
            }
            Mode::FullShuffle => {
                let roots = in_room.iter().filter(|&&i| layout.items[i].is_on_floor);
                let singles: Vec<Vec<usize>> = roots.map(|&root| vec![root]).collect();
                let have_moved = self.move_units(&mut done, &singles, &plan);
                self.move_small(&mut done, &in_room) || have_moved
            }
        };
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
    fn move_salient(
        &mut self,
        done: &mut Modification,
        in_room: &[usize],
        plan: &RoomPlan,
    ) -> bool {
        let layout = &done.layout;
        let mut weights: Vec<f64> = in_room
            .iter()
            .map(|&i| match layout.items[i].is_on_floor {
                true => layout.with_supported(i).len() as f64,
                false => 0.0,
            })
            .collect();
        while let Some(drawn) = self.stream.choose_weighted(&weights) {
            let root = in_room[drawn];
            match self.move_unit(&mut done.layout, &[root], plan) {
                Ok(()) => {
                    // It was drawn without replacement: nothing else was to move.
                    done.unmoved.clear();
                    done.salient = Some(root);
                    return true;
                }
                Err(why) => done.unmoved.push((root, why)),
            }
            weights[drawn] = 0.0;
        }
        false
    }

    /// Moves groups of furniture, each rigidly, with what stands on them.
    fn move_units(
        &mut self,
        done: &mut Modification,
        units: &[Vec<usize>],
        plan: &RoomPlan,
    ) -> bool {
        let mut order: Vec<usize> = (0..units.len()).collect();
        self.stream.shuffle(&mut order);
        let mut reasons = vec![Blocked::NoFreePlace; units.len()];
        for _ in 0..2 {
            order.retain(|&unit| match self.move_unit(&mut done.layout, &units[unit], plan) {
                Ok(()) => false,
                Err(why) => {
                    reasons[unit] = why;
                    true
                }
            });
        }
        for &unit in &order {
            let layout = &done.layout;
            let members = units[unit].iter().flat_map(|&root| layout.with_supported(root));
            done.unmoved.extend(members.map(|member| (member, reasons[unit])));
        }
        order.len() < units.len()
    }

    /// Moves each small thing of the room to a receptacle of the room.
    fn move_small(&mut self, done: &mut Modification, in_room: &[usize]) -> bool {
        let is_small = |&&i: &&usize| {
            let item = &done.layout.items[i];
            item.placement.parent.is_some() && !FITTINGS.contains(&item.asset.category.as_str())
        };
        let mut order: Vec<usize> = in_room.iter().filter(is_small).copied().collect();
        let num_small = order.len();
        self.stream.shuffle(&mut order);
        for _ in 0..2 {
            order.retain(|&index| !self.move_small_one(&mut done.layout, index, in_room));
        }
        let num_moved = num_small - order.len();
        done.unmoved.extend(order.into_iter().map(|index| (index, Blocked::NoFreePlace)));
        num_moved > 0
    }

    fn move_small_one(&mut self, layout: &mut Layout, index: usize, in_room: &[usize]) -> bool {
        let receptacles = receptacles_for(layout, self.catalogue, index, in_room);
        let least_m = self.parameters.relocated_min_m;
        let drawn = (0..self.parameters.placement_tries).find_map(|_| {
            sample_surface_place(layout, index, &receptacles, least_m, &mut self.stream)
        });
        if let Some(placement) = drawn {
            // Small things have nothing on them, bar a rare plate: that goes along.
            let old = layout.items[index].placement;
            for member in layout.with_supported(index).into_iter().skip(1) {
                let mut carried = layout.items[member].placement;
                for axis in 0..3 {
                    carried.position_m[axis] += placement.position_m[axis] - old.position_m[axis];
                }
                layout.put(member, carried);
            }
            layout.put(index, placement);
        }
        drawn.is_some()
    }

    fn move_unit(
        &mut self,
        layout: &mut Layout,
        roots: &[usize],
        plan: &RoomPlan,
    ) -> Result<(), Blocked> {
        let places = match roots {
            [root] => self.places_for(&layout.items[*root].asset.category),
            _ => Vec::new(),
        };
        let unit = Unit::new(layout, roots, &places, plan);
        let before: Vec<(usize, Placement)> =
            unit.members.iter().map(|&i| (i, layout.items[i].placement)).collect();
        let mut num_cut = 0;
        for _ in 0..self.parameters.placement_tries {
            let least_m = self.parameters.relocated_min_m;
            let Some(drawn) = unit.sample_places(layout, plan, least_m, &mut self.stream) else {
                continue;
            };
            for (index, placement) in drawn {
                layout.put(index, placement);
            }
            if (self.is_navigable)(layout) {
                return Ok(());
            }
            for &(index, placement) in &before {
                layout.put(index, placement);
            }
            num_cut += 1;
            if num_cut == NAVIGATION_TRIES {
                break;
            }
        }
        Err(if num_cut > 0 { Blocked::CutsOff } else { Blocked::NoFreePlace })
    }

    /// Where a category may stand on the floor, by ProcTHOR's annotations.
    fn places_for(&self, category: &str) -> Vec<Place> {
        let rule = self.catalogue.placement(category);
        let all = [Place::Corner, Place::Edge, Place::Middle];
        all.into_iter().filter(|&place| rule.is_some_and(|r| r.is_placed(place))).collect()
    }
}

/// Furniture of a room by asset group, as ProcTHOR numbers a group's members: `room|group|member`,
/// in some of its versions with a name before it (`chair-diningtable|7|2|0`).
fn groups_of(house: &House, layout: &Layout, in_room: &[usize]) -> Vec<Vec<usize>> {
    let mut groups: Vec<(Option<[&str; 2]>, Vec<usize>)> = Vec::new();
    for &index in in_room.iter().filter(|&&i| layout.items[i].is_on_floor) {
        let key = group_key(&house.objects[index].id);
        match groups.iter_mut().find(|(other, _)| key.is_some() && *other == key) {
            Some((_, members)) => members.push(index),
            None => groups.push((key, vec![index])),
        }
    }
    groups.into_iter().map(|(_, members)| members).collect()
}

/// Room and group by which an id's last numbers name a member of an asset group.
fn group_key(id: &str) -> Option<[&str; 2]> {
    let is_number = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    let mut parts = id.rsplit('|');
    let [member, group, room] = [parts.next()?, parts.next()?, parts.next()?];
    [member, group, room].into_iter().all(is_number).then_some([room, group])
}
