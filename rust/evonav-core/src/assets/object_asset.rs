//! The asset of an object: from the catalogue, or guessed from the object's place in the house.

use crate::{
    Error,
    assets::{Asset, Catalogue},
    geometry::{Vec2, Vec3, distance_2d_m},
    house::{House, Object, OwnAsset},
};

/// Treatment of asset ids that the catalogue does not contain (Objaverse assets).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UnknownAssets {
    /// Refuse the house, naming the object.
    #[default]
    Error,
    /// Guess a size from the object's place and category, as [`Catalogue::asset_of`] describes.
    CategoryDefault,
}

/// Words in names of Objaverse categories, and ProcTHOR categories of about the same proportions;
/// the longest match counts.
const ALIKE: [(&str, &str); 40] = [
    ("Painting", "Painting"),
    ("Poster", "Painting"),
    ("Picture", "Painting"),
    ("Photo", "Painting"),
    ("Frame", "Painting"),
    ("Artwork", "Painting"),
    ("Mirror", "Painting"),
    ("Plaque", "Painting"),
    ("Board", "Painting"),
    ("Sideboard", "Dresser"),
    ("Cabinet", "Dresser"),
    ("Commode", "Dresser"),
    ("Wardrobe", "Dresser"),
    ("Book", "Book"),
    ("Bookcase", "ShelvingUnit"),
    ("Bookshelf", "ShelvingUnit"),
    ("Shel", "ShelvingUnit"),
    ("Refrigerator", "Fridge"),
    ("TrashCan", "GarbageCan"),
    ("Mailbox", "GarbageCan"),
    ("Bucket", "GarbageCan"),
    ("Chair", "Chair"),
    ("Stool", "Stool"),
    ("Bench", "CoffeeTable"),
    ("Bathtub", "Sofa"),
    ("Couch", "Sofa"),
    ("Table", "SideTable"),
    ("Lamp", "DeskLamp"),
    ("Soap", "SoapBottle"),
    ("Lotion", "SoapBottle"),
    ("Bottle", "Bottle"),
    ("Phone", "CellPhone"),
    ("Ipod", "CellPhone"),
    ("Calculator", "CellPhone"),
    ("Notebook", "Newspaper"),
    ("Magazine", "Newspaper"),
    ("Envelope", "Newspaper"),
    ("Paper", "Newspaper"),
    ("Flower", "Vase"),
    ("Figure", "Statue"),
];
/// Proportions of assets of unknown kind.
const BLOCK: Vec3 = [0.8, 1.0, 0.8];
/// Largest edge of a guessed footprint, so that a guess does not fill a corridor.
const MAX_EDGE_M: f64 = 1.2;
const MIN_EDGE_M: f64 = 0.02;
const MAX_HEIGHT_M: f64 = 2.4;
/// Largest guessed height of a child: a higher one stands on a shelf that was never recorded.
const MAX_CHILD_HEIGHT_M: f64 = 0.4;
/// Largest distance from its wall of an object that hangs on it; recorded ones hang within 0.2 m.
const MAX_WALL_DISTANCE_M: f64 = 0.25;

impl Catalogue {
    /// Return the asset of an object of `house`: the catalogue's, or else the one whose size the
    /// house's own document gives ([`House::own_assets`]), with the colours of a similar category.
    ///
    /// With [`UnknownAssets::CategoryDefault`] an asset that neither contains gets
    /// * its `objectType`, without Objaverse's prefix `Obja`, as its category;
    /// * the proportions of the nearest catalogue category (by name), or of a block;
    /// * the height that its place implies: twice the height of its centre above the floor or
    ///   the surface under it, since positions are box centres;
    /// * on a wall, the depth that keeps it flush with the wall.
    ///
    /// # Errors
    /// [`Error::House`] naming the object and its `assetId` if the asset is unknown and `unknown`
    /// is [`UnknownAssets::Error`].
    pub fn asset_of(
        &self,
        house: &House,
        object: &Object,
        unknown: UnknownAssets,
    ) -> Result<Asset, Error> {
        match (self.known(house, &object.asset_id), unknown) {
            (Some(asset), _) => Ok(asset),
            (None, UnknownAssets::CategoryDefault) => Ok(category_default(self, house, object)),
            (None, UnknownAssets::Error) => Err(Error::House {
                house: house.name.clone(),
                object: object.id.clone(),
                field: "assetId".to_owned(),
                message: format!(
                    "is {:?}, of which the catalogue knows no size: give a file of sizes \
                     (--assets), or let its category guess one (--allow-unknown-assets)",
                    object.asset_id
                ),
            }),
        }
    }
}

impl Catalogue {
    /// Return the asset of an id, if its size is not a guess: the catalogue or the house gives it.
    fn known(&self, house: &House, asset_id: &str) -> Option<Asset> {
        let own = || house.own_assets.get(asset_id).map(|own| own_asset(self, asset_id, own));
        self.get(asset_id).cloned().or_else(own)
    }

    /// Return whether the size of an asset is not a guess: the catalogue or the house gives it.
    pub fn knows_size(&self, house: &House, asset_id: &str) -> bool {
        self.get(asset_id).is_some() || house.own_assets.contains_key(asset_id)
    }
}

/// Return the asset that a house's own document describes.
fn own_asset(catalogue: &Catalogue, asset_id: &str, own: &OwnAsset) -> Asset {
    Asset {
        id: asset_id.to_owned(),
        category: own.category.clone(),
        size_m: own.size_m,
        surfaces_m: if own.is_receptacle { vec![own.size_m[1]] } else { Vec::new() },
        colours: palette(catalogue, like(catalogue, &own.category), asset_id),
        is_pickupable: own.is_pickupable,
        is_moveable: own.is_moveable,
        is_receptacle: own.is_receptacle,
        is_openable: own.is_openable,
        ..Asset::default()
    }
}

/// Guess the asset of an object, as [`Catalogue::asset_of`] describes.
fn category_default(catalogue: &Catalogue, house: &House, object: &Object) -> Asset {
    let object_type = object.object_type.as_deref().unwrap_or("Unknown");
    let category =
        object_type.strip_prefix("Obja").filter(|rest| !rest.is_empty()).unwrap_or(object_type);
    let alike = like(catalogue, category);
    let model = alike.and_then(|name| catalogue.median_size_m(name)).unwrap_or(BLOCK);
    // An object that stands on another is not a picture, whatever its name and its distance from a
    // wall.
    let is_like_picture = alike == Some("Painting") && object.parent.is_none();
    let is_on_wall = object.id.contains("|wall|") || is_like_picture;
    let size_m = match wall_distance_m(house, object)
        .filter(|&d| is_on_wall && d < MAX_WALL_DISTANCE_M)
    {
        Some(distance_m) => [model[0], model[1], (2.0 * distance_m).max(MIN_EDGE_M)],
        None => {
            let limit_m = if object.parent.is_some() { MAX_CHILD_HEIGHT_M } else { MAX_HEIGHT_M };
            let height_m = 2.0 * height_above_support_m(catalogue, house, object);
            scaled(model, height_m.clamp(MIN_EDGE_M, limit_m))
        }
    };
    Asset {
        id: object.asset_id.clone(),
        category: category.to_owned(),
        size_m,
        colours: palette(catalogue, alike, &object.asset_id),
        is_pickupable: object.parent.is_some() && !object.is_kinematic,
        ..Asset::default()
    }
}

/// Return the catalogue category of the same name, or of about the same proportions.
fn like<'a>(catalogue: &Catalogue, category: &'a str) -> Option<&'a str> {
    if catalogue.median_size_m(category).is_some() {
        return Some(category);
    }
    // The longest word counts: a bookcase is not a book.
    let matches = ALIKE.iter().filter(|(word, _)| category.contains(word));
    matches.max_by_key(|(word, _)| word.len()).map(|&(_, name)| name)
}

/// Scale `model` to `height_m`, its footprint within sane bounds.
fn scaled(model: Vec3, height_m: f64) -> Vec3 {
    let scale = height_m / model[1].max(MIN_EDGE_M);
    let edge = |length_m: f64| (length_m * scale).clamp(MIN_EDGE_M, MAX_EDGE_M);
    [edge(model[0]), height_m, edge(model[2])]
}

/// Return the height of the object's centre above the floor, or above the highest surface of its
/// parent that lies below the centre.
fn height_above_support_m(catalogue: &Catalogue, house: &House, object: &Object) -> f64 {
    let y = object.position_m[1];
    let Some(parent) = object.parent.and_then(|index| house.objects.get(index)) else {
        return y;
    };
    let Some(asset) = catalogue.known(house, &parent.asset_id) else {
        // The parent is unknown too, and its centre lies below: take half of the distance.
        return 0.5 * (y - parent.position_m[1]).abs();
    };
    let bottom_m = parent.position_m[1] - 0.5 * asset.size_m[1];
    let below = asset.surfaces_m.iter().map(|height_m| bottom_m + height_m).filter(|&top| top < y);
    y - below.fold(bottom_m.min(y), f64::max)
}

/// Return the distance to the nearest wall that is not open plan.
fn wall_distance_m(house: &House, object: &Object) -> Option<f64> {
    let point_m = [object.position_m[0], object.position_m[2]];
    let walls = house.walls.iter().filter(|wall| !wall.is_empty);
    walls.map(|wall| segment_distance_m(wall.from_m, wall.to_m, point_m)).min_by(f64::total_cmp)
}

fn segment_distance_m(from_m: Vec2, to_m: Vec2, point_m: Vec2) -> f64 {
    let along = [to_m[0] - from_m[0], to_m[1] - from_m[1]];
    let offset = [point_m[0] - from_m[0], point_m[1] - from_m[1]];
    let length2 = along[0] * along[0] + along[1] * along[1];
    let part = ((along[0] * offset[0] + along[1] * offset[1]) / length2).clamp(0.0, 1.0);
    distance_2d_m([from_m[0] + part * along[0], from_m[1] + part * along[1]], point_m)
}

/// Return the colours of an asset of the similar category, or of a vase, chosen by the id's
/// checksum.
fn palette(catalogue: &Catalogue, alike: Option<&str>, asset_id: &str) -> Vec<[u8; 3]> {
    let ids = catalogue.assets_in(alike.unwrap_or("Vase"));
    let sum =
        asset_id.bytes().fold(0_usize, |sum, byte| (sum * 31 + usize::from(byte)) % 1_000_003);
    let chosen = sum.checked_rem(ids.len()).and_then(|index| catalogue.get(&ids[index]));
    chosen.map_or_else(Vec::new, |asset| asset.colours.clone())
}
