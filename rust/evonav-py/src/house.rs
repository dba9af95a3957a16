//! Houses.

use evonav_core::{
    assets::{Catalogue, UnknownAssets},
    geometry::{Vec2, Vec3},
    house::{self, HouseDelta},
    world::{
        footprint::{Footprint, object_footprints},
        outlines::{self, ObjectOutlines},
    },
};
use pyo3::prelude::*;

use crate::error;

/// Id, category, and outline, lowest and highest height of each convex part.
type ObjectFootprints = (String, String, Vec<(Vec<Vec2>, f64, f64)>);

/// Id, category, centre and size of the box, its corners, and the outline of each convex part.
type Outlines = (String, String, Point3, Point3, [Point2; 4], Vec<Vec<Point2>>);
type Point2 = (f64, f64);
type Point3 = (f64, f64, f64);

/// A ProcTHOR house (schema 0.0.1 or 1.0.0), checked; the document is stored without loss.
///
/// Metres in AI2-THOR's frame: x right, y up, z forward. `plot()` draws it from above.
///
/// Examples:
///     >>> import evonav
///     >>> house = evonav.load_houses("bundled")[1]
///     >>> [room.room_type for room in house.rooms]
///     ['Kitchen', 'LivingRoom']
///     >>> picture = house.plot()
#[pyclass(frozen, eq, module = "evonav._core")]
#[derive(PartialEq)]
pub struct House {
    /// The core's house.
    pub inner: house::House,
}

/// A room: see `evonav_core::house::Room`.
#[pyclass(frozen, get_all, eq, module = "evonav._core")]
#[derive(PartialEq)]
pub struct Room {
    id: String,
    room_type: String,
    polygon_m: Vec<(f64, f64)>,
}

/// One side of a wall: see `evonav_core::house::Wall`.
#[pyclass(frozen, get_all, eq, module = "evonav._core")]
#[derive(PartialEq)]
pub struct Wall {
    id: String,
    room_id: String,
    from_m: (f64, f64),
    to_m: (f64, f64),
    height_m: f64,
    is_empty: bool,
}

/// A door or window: see `evonav_core::house::Opening`.
#[pyclass(frozen, get_all, eq, module = "evonav._core")]
#[derive(PartialEq)]
pub struct Opening {
    id: String,
    asset_id: String,
    wall_ids: (String, String),
    room_ids: (String, String),
    hole_min_m: (f64, f64),
    hole_max_m: (f64, f64),
    openness: f64,
}

/// An object of a house: see `evonav_core::house::Object`.
#[pyclass(frozen, get_all, eq, module = "evonav._core")]
#[derive(PartialEq)]
pub struct HouseObject {
    id: String,
    asset_id: String,
    category: Option<String>,
    position_m: (f64, f64, f64),
    rotation_deg: (f64, f64, f64),
    parent_id: Option<String>,
    child_ids: Vec<String>,
    room_id: Option<String>,
}

#[pymethods]
impl House {
    #[new]
    #[pyo3(signature = (json, *, name = "house"))]
    fn new(py: Python<'_>, json: &str, name: &str) -> PyResult<Self> {
        let inner = py.detach(|| house::House::from_json(name, json)).map_err(error::to_py)?;
        Ok(Self { inner })
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<((String,), Bound<'py, pyo3::types::PyDict>)> {
        let keywords = pyo3::types::PyDict::new(py);
        keywords.set_item("name", &self.inner.name)?;
        Ok(((self.inner.to_json(),), keywords))
    }

    fn __repr__(&self) -> String {
        let house = &self.inner;
        let (num_rooms, num_objects) = (house.rooms.len(), house.objects.len());
        format!("House({:?}, {num_rooms} rooms, {num_objects} objects)", house.name)
    }

    fn plot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("evonav.drawing.pictures")?.call_method1("house_picture", (slf,))
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        Self::plot(slf)?.call_method0("_repr_html_")
    }

    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    fn to_json(&self, py: Python<'_>) -> String {
        py.detach(|| self.inner.to_json())
    }

    fn apply(&self, py: Python<'_>, delta_json: &str) -> PyResult<Self> {
        let changed = py.detach(|| self.inner.apply(&HouseDelta::from_json(delta_json)?));
        Ok(Self { inner: changed.map_err(error::to_py)? })
    }

    fn room_of(&self, x_m: f64, z_m: f64) -> Option<&str> {
        self.inner.room_id_of([x_m, z_m])
    }

    #[pyo3(signature = (*, allow_unknown_assets))]
    fn footprints(
        &self,
        py: Python<'_>,
        allow_unknown_assets: bool,
    ) -> PyResult<Vec<ObjectFootprints>> {
        let unknown = unknown_assets(allow_unknown_assets);
        let found = py
            .detach(|| object_footprints(&self.inner, Catalogue::bundled(), unknown))
            .map_err(error::to_py)?;
        let part = |Footprint { outline_m, bottom_m, top_m }| (outline_m, bottom_m, top_m);
        let objects = self.inner.objects.iter().zip(found);
        Ok(objects
            .map(|(object, (category, parts))| {
                (object.id.clone(), category, parts.into_iter().map(part).collect())
            })
            .collect())
    }

    /// Return position `(x, y, z)`, yaw and horizon of `metadata.agent`.
    #[getter]
    fn start(&self) -> Option<((f64, f64, f64), f64, f64)> {
        let start = self.inner.start?;
        Some((start.position_m.into(), start.yaw_deg.to_radians(), start.horizon_deg.to_radians()))
    }

    #[getter]
    fn rooms(&self) -> Vec<Room> {
        self.inner.rooms.iter().map(room).collect()
    }

    #[getter]
    fn walls(&self) -> Vec<Wall> {
        self.inner.walls.iter().map(wall).collect()
    }

    #[getter]
    fn doors(&self) -> Vec<Opening> {
        self.inner.doors.iter().map(opening).collect()
    }

    #[getter]
    fn windows(&self) -> Vec<Opening> {
        self.inner.windows.iter().map(opening).collect()
    }

    #[getter]
    fn objects(&self) -> Vec<HouseObject> {
        self.inner.objects.iter().map(|entry| object(&self.inner, entry)).collect()
    }
}

#[pymethods]
impl Room {
    fn __repr__(&self) -> String {
        let corners = self.polygon_m.iter().zip(self.polygon_m.iter().cycle().skip(1));
        let doubled: f64 = corners.map(|(a, b)| a.0 * b.1 - b.0 * a.1).sum();
        let area_m2 = doubled.abs() / 2.0;
        format!("Room(id={:?}, type={:?}, area_m2={area_m2:.1})", self.id, self.room_type)
    }
}

#[pymethods]
impl Wall {
    fn __repr__(&self) -> String {
        let ((x0, z0), (x1, z1)) = (self.from_m, self.to_m);
        let (id, room) = (&self.id, &self.room_id);
        format!(
            "Wall(id={id:?}, room_id={room:?}, from_m=({x0:.2}, {z0:.2}), to_m=({x1:.2}, {z1:.2}))"
        )
    }
}

#[pymethods]
impl Opening {
    fn __repr__(&self) -> String {
        let (a, b) = &self.room_ids;
        format!("Opening(id={:?}, room_ids=({a:?}, {b:?}), openness={:?})", self.id, self.openness)
    }
}

#[pymethods]
impl HouseObject {
    fn __repr__(&self) -> String {
        let (x, y, z) = self.position_m;
        let text =
            |name: &Option<String>| name.as_ref().map_or("None".into(), |t| format!("{t:?}"));
        let (category, room) = (text(&self.category), text(&self.room_id));
        format!(
            "HouseObject(id={:?}, category={category}, position_m=({x:.2}, {y:.2}, {z:.2}), room_id={room})",
            self.id
        )
    }
}

/// Return the treatment of assets that the catalogue does not contain.
pub fn unknown_assets(are_allowed: bool) -> UnknownAssets {
    if are_allowed { UnknownAssets::CategoryDefault } else { UnknownAssets::Error }
}

fn room(room: &house::Room) -> Room {
    Room {
        id: room.id.clone(),
        room_type: room.room_type.clone(),
        polygon_m: room.polygon_m.iter().copied().map(Into::into).collect(),
    }
}

fn wall(wall: &house::Wall) -> Wall {
    Wall {
        id: wall.id.clone(),
        room_id: wall.room_id.clone(),
        from_m: wall.from_m.into(),
        to_m: wall.to_m.into(),
        height_m: wall.height_m,
        is_empty: wall.is_empty,
    }
}

fn opening(opening: &house::Opening) -> Opening {
    Opening {
        id: opening.id.clone(),
        asset_id: opening.asset_id.clone(),
        wall_ids: (opening.wall0.clone(), opening.wall1.clone()),
        room_ids: opening.room_ids.clone().into(),
        hole_min_m: opening.hole_min_m.into(),
        hole_max_m: opening.hole_max_m.into(),
        openness: opening.openness,
    }
}

fn object(house: &house::House, object: &house::Object) -> HouseObject {
    let id = |&index: &usize| house.objects[index].id.clone();
    let known = Catalogue::bundled().get(&object.asset_id).map(|asset| asset.category.clone());
    let own = || house.own_assets.get(&object.asset_id).map(|asset| asset.category.clone());
    HouseObject {
        id: object.id.clone(),
        asset_id: object.asset_id.clone(),
        category: known.or_else(own).or_else(|| object.object_type.clone()),
        position_m: object.position_m.into(),
        rotation_deg: object.rotation_deg.into(),
        parent_id: object.parent.as_ref().map(id),
        child_ids: object.children.iter().map(id).collect(),
        room_id: object.room.map(|index| house.rooms[index].id.clone()),
    }
}

/// Return the outlines of a house's objects: see `evonav_core::world::outlines`.
#[pyfunction]
pub fn object_outlines(py: Python<'_>, house: &House) -> PyResult<Vec<Outlines>> {
    let unknown = unknown_assets(true);
    let found = py
        .detach(|| outlines::object_outlines(&house.inner, Catalogue::bundled(), unknown))
        .map_err(error::to_py)?;
    let points = |outline: Vec<Vec2>| outline.into_iter().map(Into::into).collect();
    let object = |one: ObjectOutlines| {
        let outlines_m = one.outlines_m.into_iter().map(points).collect();
        let corners_m = one.corners_m.map(Into::into);
        (one.id, one.category, one.centre_m.into(), one.size_m.into(), corners_m, outlines_m)
    };
    Ok(found.into_iter().map(object).collect())
}

/// Return the id, category and size of every asset of the catalogue, by id.
#[pyfunction]
pub fn assets() -> Vec<(String, String, Vec3)> {
    let catalogue = Catalogue::bundled();
    let known = catalogue.asset_ids().into_iter().filter_map(|id| catalogue.get(id));
    known.map(|asset| (asset.id.clone(), asset.category.clone(), asset.size_m)).collect()
}
