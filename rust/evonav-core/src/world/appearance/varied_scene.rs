//! A scene in another look.

use crate::{
    Error,
    assets::{Catalogue, UnknownAssets},
    house::House,
    world::{
        appearance::{
            change::{Appearance, Change, Surfaces},
            colours::colour,
            materials::Painter,
            subject::{Subject, subjects},
        },
        scene::{Body, Scene},
    },
};

/// Types of rooms that ProcTHOR's houses have; a house may have others.
const ROOM_TYPES: [&str; 4] = ["Bathroom", "Bedroom", "Kitchen", "LivingRoom"];
/// Categories of bodies that are not objects.
const STRUCTURE: [&str; 6] = ["Ceiling", "Doorframe", "Doorway", "Floor", "Wall", "Window"];

impl Appearance {
    /// Check that categories and types of rooms exist.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the first that neither the house nor the catalogue has.
    pub fn check_names(&self, house: &House, catalogue: &Catalogue) -> Result<(), Error> {
        self.changes.iter().try_for_each(|change| match change {
            Change::Materials(surfaces) | Change::Colors(surfaces) => {
                surfaces.check_names(house, catalogue)
            }
            Change::Lighting(_) => Ok(()),
        })
    }
}

/// Return a scene in a look, with the same shapes, and the number of materials that were to choose
/// from.
pub(crate) fn scene_of(
    house: &House,
    catalogue: &Catalogue,
    unknown: UnknownAssets,
    scene: &Scene,
    appearance: &Appearance,
) -> (Scene, usize) {
    let mut varied = scene.clone();
    let subjects = subjects(house);
    let mut painter = Painter::new(house, catalogue, unknown);
    for change in &appearance.changes {
        let (Change::Materials(surfaces) | Change::Colors(surfaces)) = change else { continue };
        for (body, subject) in varied.bodies.iter_mut().zip(&subjects) {
            if !surfaces.includes(subject, body) {
                continue;
            }
            match change {
                Change::Materials(_) => painter.paint(surfaces, subject, body),
                _ => colour(surfaces, subject, body),
            }
        }
    }
    (varied, painter.num_materials())
}

impl Surfaces {
    fn includes(&self, subject: &Subject<'_>, body: &Body) -> bool {
        let is_named = |names: &Option<Vec<String>>, wanted: &str| {
            names.as_ref().is_none_or(|names| names.iter().any(|name| name == wanted))
        };
        is_named(&self.categories, &body.category)
            && subject.room_types.iter().any(|wanted| is_named(&self.room_types, wanted))
    }

    fn check_names(&self, house: &House, catalogue: &Catalogue) -> Result<(), Error> {
        let known = |name: &String| {
            let is_own = || house.objects.iter().any(|o| o.object_type.as_ref() == Some(name));
            let is_guessed = || is_own() || house.own_assets.values().any(|a| a.category == *name);
            STRUCTURE.contains(&name.as_str())
                || !catalogue.assets_in(name).is_empty()
                || is_guessed()
        };
        if let Some(name) = self.categories.iter().flatten().find(|name| !known(name)) {
            let expected = "a category of the house or of the catalogue, such as Sofa or Floor";
            return Err(Error::invalid("categories", format!("{name:?}"), expected));
        }
        let known = |name: &String| {
            ROOM_TYPES.contains(&name.as_str())
                || house.rooms.iter().any(|room| room.room_type == *name)
        };
        if let Some(name) = self.room_types.iter().flatten().find(|name| !known(name)) {
            let expected =
                format!("a type of the house's rooms, or one of {}", ROOM_TYPES.join(", "));
            return Err(Error::invalid("room_types", format!("{name:?}"), &expected));
        }
        Ok(())
    }
}
