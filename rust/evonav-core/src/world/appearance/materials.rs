//! Surfaces of other materials of their class.

use std::collections::BTreeMap;

use crate::{
    assets::{
        Asset, Catalogue, SurfaceChoices, UnknownAssets,
        material::{Finish, Material},
        part::Part,
        shapes::{Shape, lit, trimmed_shape},
    },
    house::House,
    rng::Stream,
    world::{
        appearance::{
            change::Surfaces,
            subject::{PartOfHouse, Subject},
        },
        scene::{Body, door_shape},
    },
};

/// Material of painted walls.
const PAINTED: &str = "PureWhite";
/// Share of rooms whose walls are painted rather than tiled or papered, about as in ProcTHOR.
const PAINTED_SHARE: f64 = 0.5;

/// Paints bodies of a house, and notes what there was to choose from.
pub(super) struct Painter<'a> {
    house: &'a House,
    catalogue: &'a Catalogue,
    unknown: UnknownAssets,
    /// Number of choices, by what is painted.
    num_choices: BTreeMap<String, usize>,
}

impl<'a> Painter<'a> {
    pub fn new(house: &'a House, catalogue: &'a Catalogue, unknown: UnknownAssets) -> Self {
        Self { house, catalogue, unknown, num_choices: BTreeMap::new() }
    }

    /// Return the number of materials and assets that there were to choose from.
    pub fn num_materials(&self) -> usize {
        self.num_choices.values().sum()
    }

    /// Give a body other materials of its class, if there are any.
    pub fn paint(&mut self, change: &Surfaces, subject: &Subject<'_>, body: &mut Body) {
        let label = match subject.part_of_house {
            PartOfHouse::Floor => "floor",
            PartOfHouse::Ceiling => "ceiling",
            PartOfHouse::Wall => "wall",
            _ => "asset",
        };
        let draws = Stream::new(change.seed, &["materials", label, subject.look]);
        let shape = match subject.part_of_house {
            PartOfHouse::Floor | PartOfHouse::Ceiling | PartOfHouse::Wall => {
                let finish = self.surface(subject.part_of_house, draws);
                let finish_part = |part: &Part| Part {
                    material: finish.material,
                    colour: finish.colour,
                    ..*part
                };
                let parts = body.parts.iter().map(finish_part).collect();
                Some(Shape { parts, trim: body.trim.iter().map(finish_part).collect() })
            }
            PartOfHouse::Door(index) => self.donor(change, &body.category, draws).map(|donor| {
                // A leaf of glass stays one, with its bars.
                let is_glazed = !body.trim.is_empty();
                door_shape(self.house, &self.house.doors[index], Some(donor), is_glazed)
            }),
            PartOfHouse::Object(index) => self
                .donor(change, &body.category, draws)
                .and_then(|donor| self.repainted(index, donor, body)),
            PartOfHouse::Window => None,
        };
        if let Some(shape) = shape.filter(|shape| is_alike(shape, body)) {
            finish(&mut body.parts, &shape.parts);
            finish(&mut body.trim, &shape.trim);
        }
    }

    /// Draw the finish of a floor, a ceiling or walls.
    fn surface(&mut self, place: PartOfHouse, mut draws: Stream) -> Finish {
        let choices = SurfaceChoices::bundled();
        let is_floor = matches!(place, PartOfHouse::Floor);
        let is_painted = match place {
            PartOfHouse::Wall => draws.uniform() < PAINTED_SHARE,
            _ => !is_floor,
        };
        let (what, num) = match (is_floor, is_painted) {
            (true, _) => ("floors", choices.floors.len()),
            (_, true) => ("paints", choices.paints.len()),
            _ => ("walls", choices.walls.len()),
        };
        self.num_choices.insert(what.to_owned(), num);
        let drawn = draws.below(num);
        if is_painted {
            let colour = lit(choices.paints[drawn]);
            return Finish { colour, material: Material::of_name(PAINTED) };
        }
        let names = if is_floor { &choices.floors } else { &choices.walls };
        let (name, grey) = (&names[drawn], [180; 3]);
        let colour = lit(self.catalogue.material_colour(name).unwrap_or(grey));
        Finish { colour, material: Material::of_name(name) }
    }

    /// Draw the asset of a category whose materials a body gets; `None` if there is none.
    fn donor(&mut self, change: &Surfaces, category: &str, mut draws: Stream) -> Option<&'a Asset> {
        let ids = self.catalogue.assets_in(category);
        let is_in_split = |asset: &&Asset| match (&change.splits, asset.split) {
            (Some(splits), Some(split)) => splits.contains(&split),
            _ => true,
        };
        let donors: Vec<&Asset> =
            ids.iter().filter_map(|id| self.catalogue.get(id)).filter(is_in_split).collect();
        self.num_choices.insert(format!("category {category}"), donors.len());
        donors.get(draws.below(donors.len())).copied()
    }

    /// Return the shape of an object in the materials of another asset; `None` if shapes of its
    /// category depend on materials.
    fn repainted(&self, index: usize, donor: &Asset, body: &Body) -> Option<Shape> {
        let object = &self.house.objects[index];
        let own = self.catalogue.asset_of(self.house, object, self.unknown).ok()?;
        let Asset { colours, made_of, materials, id, .. } = donor.clone();
        let painted = Asset { colours, made_of, materials, ..own };
        let renamed = Asset { id, ..painted.clone() };
        // An asset's name decides pictures and patterns, but may decide its shape too.
        [renamed, painted]
            .iter()
            .map(|asset| trimmed_shape(asset, object.condition()))
            .find(|shape| is_alike(shape, body))
    }
}

/// Return whether a body has the solids of a shape, wherever they are.
fn is_alike(shape: &Shape, body: &Body) -> bool {
    let same = |ours: &[Part], theirs: &[Part]| {
        ours.len() == theirs.len()
            && ours.iter().zip(theirs).all(|(one, other)| one.primitive == other.primitive)
    };
    same(&shape.parts, &body.parts) && same(&shape.trim, &body.trim)
}

/// Copy the finishes of parts onto parts of the same solids.
fn finish(parts: &mut [Part], painted: &[Part]) {
    for (part, painted) in parts.iter_mut().zip(painted) {
        (part.colour, part.material) = (painted.colour, painted.material);
    }
}
