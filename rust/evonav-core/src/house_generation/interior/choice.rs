//! Choose the piece of furniture for a place (`ProceduralRoom.sample_asset` of the package
//! `procthor`).

use crate::{
    assets::{Asset, placement_rule::Place},
    geometry::Vec2,
    house_generation::{
        interior::{
            anchor::Anchor,
            group::DrawnGroup,
            stock::{Stock, StockGroup},
        },
        parameters::FloorObjects,
        rectangle::Rectangle,
        sampling::{choose, happens},
    },
    rng::Stream,
};

/// A drawn piece of furniture that has no place yet.
#[derive(Debug, Clone)]
pub(super) enum Chosen {
    Single(&'static Asset),
    Group(DrawnGroup),
}

impl Chosen {
    /// Return the edges of its box along its own x and z.
    pub fn size_m(&self) -> Vec2 {
        match self {
            Self::Single(asset) => [asset.size_m[0], asset.size_m[2]],
            Self::Group(group) => group.size_m,
        }
    }
}

/// The furniture that may still be placed in a room.
#[derive(Debug)]
pub(super) struct Choice<'a> {
    rules: &'a FloorObjects,
    stock: &'a Stock,
    room_type: &'a str,
    /// Groups that may still be placed, by index.
    groups: Vec<usize>,
    /// Categories of which the room has one and may have no more.
    full: Vec<&'static str>,
    /// Categories to place first.
    wanted: Vec<&'a str>,
}

impl<'a> Choice<'a> {
    /// Create the choice for an empty room.
    pub fn new(
        rules: &'a FloorObjects,
        stock: &'a Stock,
        room_type: &'a str,
        stream: &mut Stream,
    ) -> Self {
        let may_have = |index: &usize, stream: &mut Stream| {
            let definition = stock.groups[*index].definition;
            let probability = rules.allowed_groups.get(&definition.name);
            let is_allowed = probability.is_none_or(|&p| happens(stream, p));
            is_allowed && definition.room_weight(room_type) > 0.0
        };
        let groups = (0..stock.groups.len()).filter(|index| may_have(index, stream)).collect();
        let wanted = rules.priority.get(room_type);
        let mut wanted: Vec<&str> = wanted.into_iter().flatten().map(String::as_str).collect();
        stream.shuffle(&mut wanted);
        Self { rules, stock, room_type, groups, full: Vec::new(), wanted }
    }

    /// Draw a piece for a place in a free rectangle, and count it as placed; `None` if none is
    /// drawn.
    ///
    /// # Returns
    /// The piece, and whether its width is along z.
    pub fn sample(
        &mut self,
        rectangle: &Rectangle,
        anchor: &Anchor,
        stream: &mut Stream,
    ) -> Option<(Chosen, bool)> {
        let chosen = self.choose(rectangle, anchor, stream)?;
        let turns: Vec<bool> = match anchor.must_turn() {
            Some(is_turned) => vec![is_turned],
            None => [false, true]
                .into_iter()
                .filter(|&is_turned| fits(chosen.size_m(), [0.0; 2], rectangle, is_turned))
                .collect(),
        };
        let is_turned = *choose(stream, &turns)?;
        if !fits(chosen.size_m(), [0.0; 2], rectangle, is_turned) {
            return None;
        }
        let assets: Vec<&'static Asset> = match &chosen {
            Chosen::Single(asset) => vec![asset],
            Chosen::Group(group) => group.objects.iter().map(|object| object.asset).collect(),
        };
        for asset in assets {
            self.count(&asset.category);
        }
        Some((chosen, is_turned))
    }

    fn choose(
        &mut self,
        rectangle: &Rectangle,
        anchor: &Anchor,
        stream: &mut Stream,
    ) -> Option<Chosen> {
        let fits_here = |size_m: Vec2| self.fits_place(size_m, rectangle, anchor);
        let place = anchor.place();
        let is_group = |&index: &usize| {
            let group = &self.stock.groups[index];
            group.definition.places.contains(&place) && fits_here(group.size_m)
        };
        let groups: Vec<usize> = self.groups.iter().copied().filter(is_group).collect();
        let singles = self.singles(place, &fits_here);
        for &wanted in &self.wanted {
            let with: Vec<usize> = groups
                .iter()
                .copied()
                .filter(|&index| self.stock.groups[index].has(wanted))
                .collect();
            let may_be_single =
                self.stock.categories.get(wanted).is_some_and(|it| it.stands_in(self.room_type));
            let tries_group = !with.is_empty()
                && (!may_be_single || happens(stream, self.rules.group_probability));
            if let Some((index, group)) = tries_group.then(|| self.draw(&with, stream)).flatten() {
                self.use_group(index);
                return Some(Chosen::Group(group));
            }
            let single = singles.iter().find(|(category, _)| *category == wanted);
            if let Some((_, assets)) = single {
                return choose(stream, assets).map(|&asset| Chosen::Single(asset));
            }
        }
        if !groups.is_empty()
            && happens(stream, self.rules.group_probability)
            && let Some((index, group)) = self.draw(&groups, stream)
        {
            self.use_group(index);
            return Some(Chosen::Group(group));
        }
        let leaves_out = happens(stream, self.rules.skip_untypical_probability);
        let is_typical = |category: &str| {
            let category = self.stock.categories.get(category);
            category.is_none_or(|it| it.rule.room_weight(self.room_type) != 1.0)
        };
        let singles: Vec<&Vec<&'static Asset>> = singles
            .iter()
            .filter(|(category, _)| !leaves_out || is_typical(category))
            .map(|(_, assets)| assets)
            .collect();
        let assets = *choose(stream, &singles)?;
        choose(stream, assets).map(|&asset| Chosen::Single(asset))
    }

    /// Return the categories that may stand alone in such a place, with the assets that fit.
    fn singles(
        &self,
        place: Place,
        fits_here: &dyn Fn(Vec2) -> bool,
    ) -> Vec<(&'static str, Vec<&'static Asset>)> {
        let categories = self.stock.categories.iter().filter(|(name, category)| {
            category.stands_in(self.room_type)
                && category.rule.is_placed(place)
                && !self.full.contains(name)
        });
        let fitting = categories.map(|(&name, category)| {
            let fits = |asset: &&&Asset| fits_here([asset.size_m[0], asset.size_m[2]]);
            (name, category.assets.iter().filter(fits).copied().collect::<Vec<_>>())
        });
        fitting.filter(|(_, assets)| !assets.is_empty()).collect()
    }

    /// Draw one of some groups and its members.
    fn draw(&self, groups: &[usize], stream: &mut Stream) -> Option<(usize, DrawnGroup)> {
        let &index = choose(stream, groups)?;
        let group: &StockGroup = &self.stock.groups[index];
        Some((index, DrawnGroup::sample(group, self.rules.group_tries, stream)?))
    }

    fn use_group(&mut self, index: usize) {
        if !self.stock.groups[index].definition.allows_duplicates {
            self.groups.retain(|&other| other != index);
        }
    }

    /// Count an object of a category as placed.
    fn count(&mut self, category: &'static str) {
        self.wanted.retain(|&wanted| wanted != category);
        let rule = self.stock.categories.get(category).map(|category| category.rule);
        if rule.is_some_and(|rule| !rule.multiple_per_room) && !self.full.contains(&category) {
            self.full.push(category);
            self.groups.retain(|&index| !self.stock.groups[index].has(category));
        }
    }

    /// Return whether a box fits a place with the free floor around it.
    fn fits_place(&self, size_m: Vec2, rectangle: &Rectangle, anchor: &Anchor) -> bool {
        let front_m = self.rules.front_margin_m + self.rules.wall_padding_m;
        let margins_m = match anchor.place() {
            Place::Corner => [self.rules.wall_padding_m, front_m],
            Place::Middle => [2.0 * self.rules.middle_margin_m; 2],
            _ => [0.0, front_m],
        };
        match anchor.must_turn() {
            Some(is_turned) => fits(size_m, margins_m, rectangle, is_turned),
            None => [false, true].iter().any(|&turned| fits(size_m, margins_m, rectangle, turned)),
        }
    }
}

/// Return whether a box with margins along its own axes fits a rectangle.
fn fits(size_m: Vec2, margins_m: Vec2, rectangle: &Rectangle, is_turned: bool) -> bool {
    let [width, depth] = [0, 1].map(|i| size_m[i] + margins_m[i]);
    let [x, z] = rectangle.size_m();
    let [needs_x, needs_z] = if is_turned { [depth, width] } else { [width, depth] };
    needs_x < x && needs_z < z
}
