//! Draw the compound of convex parts that represents an asset.
//!
//! Every shape fills its asset's box exactly: the box around its parts is the asset's box. The
//! object frame has its origin at the box's centre, y up and the front towards +z (measured on
//! ProcTHOR houses: objects that stand against a wall have their -z side there). Surfaces that bear
//! objects lie at the heights that the catalogue lists.

mod bathroom;
mod beds;
mod colour;
mod decor;
mod devices;
mod food;
mod kitchen;
mod motion;
mod seats;
mod shape;
mod sketch;
mod storage;
mod tables;
mod vessels;

use crate::{
    assets::{Asset, part::Part},
    house::Condition,
};
pub(crate) use colour::{is_pale, lit};
pub use shape::{Detail, Shape, ShapeTraits};
use sketch::Sketch;

/// Return the parts of an asset, in the object frame.
///
/// # Returns
/// At least one part; the box around them is `asset.size_m` about the origin, within rounding.
/// Sizes that are not positive are taken as 1 mm.
pub fn shape_of(asset: &Asset) -> Vec<Part> {
    shape_in(asset, Condition::default())
}

/// Return the parts of an asset in a state, in the object frame.
///
/// # Returns
/// The same as [`shape_of`] in the default state. Open parts may reach out of the asset's box.
pub fn shape_in(asset: &Asset, condition: Condition) -> Vec<Part> {
    trimmed_shape(asset, condition).parts
}

/// Return the parts and the trim of an asset in a state.
pub fn trimmed_shape(asset: &Asset, condition: Condition) -> Shape {
    let mut sketch = Sketch::new(asset, condition);
    draw(&mut sketch);
    sketch.finish()
}

/// Return the form and the striking parts of the shape that [`shape_in`] draws.
pub fn shape_traits(asset: &Asset, condition: Condition) -> ShapeTraits {
    let mut sketch = Sketch::new(asset, condition);
    draw(&mut sketch);
    sketch.into_traits()
}

/// Return the openness with which [`shape_of`] draws an asset; `None` if its shape has no part that
/// opens.
pub fn drawn_openness(asset: &Asset) -> Option<f64> {
    let at = |openness| shape_in(asset, Condition { openness: Some(openness), is_on: None });
    let is_drawn_open =
        matches!(asset.category.as_str(), "Laptop" | "Toilet" | "Box").then_some(1.0);
    (at(0.0) != at(1.0)).then_some(is_drawn_open.unwrap_or(0.0))
}

/// Return whether an asset's shape shows whether it is on.
pub fn shows_light(asset: &Asset) -> bool {
    let at = |is_on| shape_in(asset, Condition { openness: None, is_on: Some(is_on) });
    at(true) != at(false)
}

/// Words in names of Objaverse categories, and the category whose shape fits; the first match
/// counts.
const ALIKE: [(&str, &str); 34] = [
    ("Bookshel", "ShelvingUnit"),
    ("Bookcase", "ShelvingUnit"),
    ("Shelf", "ShelvingUnit"),
    ("Chair", "Chair"),
    ("Stool", "Stool"),
    ("Sofa", "Sofa"),
    ("Couch", "Sofa"),
    ("Desk", "Desk"),
    ("Table", "CoffeeTable"),
    ("Bench", "CoffeeTable"),
    ("Commode", "Dresser"),
    ("Wardrobe", "Dresser"),
    ("Cabinet", "Dresser"),
    ("Refrigerator", "Fridge"),
    ("Lamp", "DeskLamp"),
    ("Painting", "Painting"),
    ("Poster", "Painting"),
    ("Picture", "Painting"),
    ("Frame", "Painting"),
    ("Mirror", "Painting"),
    ("Calendar", "Painting"),
    ("TrashCan", "GarbageCan"),
    ("Bucket", "GarbageCan"),
    ("Plant", "HousePlant"),
    ("Sunflower", "HousePlant"),
    ("Flower", "HousePlant"),
    ("Book", "Book"),
    ("Pillow", "Pillow"),
    ("Cushion", "Pillow"),
    ("Ball", "BasketBall"),
    ("ball", "BasketBall"),
    ("Lotion", "SoapBottle"),
    ("Perfume", "Bottle"),
    ("Phone", "CellPhone"),
];

/// Draw an asset by its category; Objaverse categories by words in their names, all others as a
/// cuboid.
fn draw(s: &mut Sketch<'_>) {
    let category = s.asset().category.as_str();
    if draw_category(s, category) {
        return;
    }
    let alike = ALIKE.iter().find(|(word, _)| category.contains(word));
    if !alike.is_some_and(|&(_, category)| draw_category(s, category)) {
        s.block(s.tint(0, colour::rgb(165, 150, 135)));
    }
}

/// Draw the shape of a category; return false if it has none.
fn draw_category(s: &mut Sketch<'_>, category: &str) -> bool {
    match category {
        "DiningTable" | "CoffeeTable" | "SideTable" => tables::table(s),
        "Desk" => tables::desk(s),
        "TVStand" | "Dresser" | "Cabinet" | "Drawer" => storage::carcass(s),
        "ShelvingUnit" | "Shelf" | "Bookcase" => storage::shelves(s),
        "Cart" => storage::cart(s),
        "CounterTop" => kitchen::counter(s),
        "Fridge" => kitchen::fridge(s),
        "Microwave" => kitchen::microwave(s),
        "CoffeeMachine" => kitchen::coffee_machine(s),
        "Toaster" => kitchen::toaster(s),
        "Pan" => kitchen::pan(s),
        "Pot" => kitchen::pot(s),
        "Kettle" | "WateringCan" => kitchen::kettle(s),
        "Chair" => seats::chair(s),
        "Stool" => seats::stool(s),
        "ArmChair" | "Sofa" => seats::sofa(s),
        "Ottoman" | "Footstool" => seats::ottoman(s),
        "Bed" => beds::bed(s),
        "DogBed" => beds::dog_bed(s),
        "Pillow" => beds::pillow(s),
        "Toilet" => bathroom::toilet(s),
        "Bathtub" | "BathtubBasin" => bathroom::bathtub(s),
        "Sink" | "SinkBasin" => bathroom::sink(s),
        "Faucet" => bathroom::faucet(s),
        "ShowerHead" => bathroom::shower_head(s),
        "ShowerCurtain" | "Blinds" => bathroom::curtain(s),
        "Towel" | "HandTowel" | "Cloth" => bathroom::towel(s),
        "TowelHolder" | "HandTowelHolder" | "ToiletPaperHanger" => bathroom::holder(s),
        "Plunger" | "ScrubBrush" => bathroom::brush(s),
        "WashingMachine" | "ClothesDryer" => bathroom::washer(s),
        "Television" => devices::television(s),
        "Laptop" => devices::laptop(s),
        "Desktop" => devices::desktop(s),
        "FloorLamp" | "DeskLamp" => devices::lamp(s),
        "CellPhone" | "RemoteControl" | "LightSwitch" | "AlarmClock" | "Watch" => {
            devices::gadget(s);
        }
        "VacuumCleaner" => devices::vacuum_cleaner(s),
        "HousePlant" => decor::plant(s),
        "Painting" => decor::painting(s),
        "Window" => decor::window(s),
        "Doorway" | "Doorframe" => decor::doorway(s),
        "Statue" | "RoomDecor" => decor::statue(s),
        "TeddyBear" => decor::teddy_bear(s),
        "BasketBall" => decor::ball(s),
        "Boots" => decor::boots(s),
        "BaseballBat" => decor::bat(s),
        "TennisRacket" => decor::racket(s),
        "Dumbbell" => decor::dumbbell(s),
        "Candle" => decor::candle(s),
        "GarbageCan" | "LaundryHamper" => vessels::bin(s),
        "GarbageBag" => vessels::bag(s),
        "Box" => vessels::open_box(s),
        "Safe" => storage::safe(s),
        "Bottle" | "WineBottle" | "SoapBottle" | "SprayBottle" => vessels::bottle(s),
        "PepperShaker" | "SaltShaker" => vessels::shaker(s),
        "Mug" | "Cup" => vessels::mug(s),
        "Bowl" => vessels::bowl(s),
        "Plate" | "CD" => vessels::plate(s),
        "Vase" => vessels::vase(s),
        "TissueBox" => vessels::tissue_box(s),
        "PaperTowelRoll" | "ToiletPaper" | "AluminumFoil" => vessels::roll(s),
        "Book" | "Newspaper" | "CreditCard" | "DishSponge" | "SoapBar" => decor::slab(s),
        "Apple" | "Tomato" | "Potato" | "Egg" | "Lettuce" | "Bread" => food::food(s),
        "Knife" | "ButterKnife" | "Fork" | "Spoon" | "Spatula" | "Ladle" | "Pen" | "Pencil" => {
            food::utensil(s);
        }
        "KeyChain" | "TableTopDecor" => decor::slab(s),
        _ => return false,
    }
    true
}
