//! `evonav_core::memory::objects`. Shapes, units and errors: `_core.pyi`.

use evonav_core::{
    Error,
    memory::objects::{
        self, DetectedView, Entry, ObjectMapConfig, depth_evidence::EvidenceConfig,
        seen_through::SeeThroughConfig, sight_lines::SightConfig,
    },
    sensors::{runs::RunImage, unproject::MaskedDepth},
};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::{
    arrays,
    camera::{DepthImage, Intrinsics, PyPose},
    error,
    run_image::NumberImage,
};

/// An object entry at the time of the call that returned it.
#[pyclass(frozen, get_all, module = "evonav._core")]
pub struct ObjectEntry {
    id: u64,
    label: String,
    label_counts: Vec<(String, u32)>,
    num_detections: u32,
    confidence: f32,
    centre_m: (f64, f64, f64),
    size_m: (f64, f64, f64),
    num_points: usize,
    feature: Option<Py<PyArray1<f32>>>,
    first_seen_stage: u32,
    last_seen_stage: u32,
    last_seen_view: u64,
}

impl ObjectEntry {
    fn new(py: Python<'_>, entry: &Entry) -> Self {
        Self {
            id: entry.id,
            label: entry.label().to_owned(),
            label_counts: entry.label_counts.clone(),
            num_detections: entry.num_detections,
            confidence: entry.confidence,
            centre_m: entry.centre_m().into(),
            size_m: entry.size_m().into(),
            num_points: entry.cloud.points().len(),
            feature: entry.feature.as_ref().map(|feature| read_only(py, feature)),
            first_seen_stage: entry.first_seen_stage,
            last_seen_stage: entry.last_seen_stage,
            last_seen_view: entry.last_seen_view,
        }
    }
}

/// Return an array that nobody can write to: an entry may be returned several times.
fn read_only(py: Python<'_>, feature: &[f32]) -> Py<PyArray1<f32>> {
    let array = PyArray1::from_slice(py, feature);
    array.readwrite().make_nonwriteable();
    array.unbind()
}

#[pymethods]
impl ObjectEntry {
    fn __repr__(&self) -> String {
        let ((x, y, z), id, label) = (self.centre_m, self.id, &self.label);
        let num = self.num_detections;
        format!(
            "ObjectEntry(id={id}, label={label:?}, centre_m=({x:.2}, {y:.2}, {z:.2}), num_detections={num})"
        )
    }
}

/// Detections merged into lasting entries.
#[pyclass(module = "evonav._core")]
pub struct ObjectMap {
    map: objects::ObjectMap,
    /// The entries as they were last returned, by ascending id: those that have not changed since
    /// are returned again, so that what was made of them can be found again, too.
    shown: Vec<Py<ObjectEntry>>,
}

impl ObjectMap {
    /// Return an entry, as it was last returned if it has not changed since. With each detection
    /// the number of detections grows, and whatever else changes an entry takes points from it.
    fn show(&self, py: Python<'_>, entry: &Entry) -> PyResult<Py<ObjectEntry>> {
        let num_points = entry.cloud.points().len();
        let is_same = |shown: &ObjectEntry| {
            shown.num_detections == entry.num_detections && shown.num_points == num_points
        };
        match self.shown.binary_search_by_key(&entry.id, |shown| shown.get().id) {
            Ok(index) if is_same(self.shown[index].get()) => Ok(self.shown[index].clone_ref(py)),
            _ => Py::new(py, ObjectEntry::new(py, entry)),
        }
    }
}

type Update = (Vec<Option<u64>>, Vec<u64>, Vec<(u64, u64)>);

#[pymethods]
impl ObjectMap {
    #[new]
    fn new(config: &Bound<'_, PyAny>) -> PyResult<Self> {
        let config = arrays::from_attributes!(
            config,
            ObjectMapConfig {
                min_points,
                max_points,
                min_box_m3,
                voxel_m,
                cluster_radius_m,
                cluster_min_points,
                max_distance_m,
                overlap_radius_m,
                visual_weight,
                match_threshold,
                views_per_cleanup,
                min_detections,
                merge_overlap,
                merge_similarity,
            }
        );
        let map = objects::ObjectMap::new(config).map_err(error::to_py)?;
        Ok(Self { map, shown: Vec::new() })
    }

    fn update(&mut self, py: Python<'_>, view: View<'_>) -> PyResult<Update> {
        let found: Detections<'_> = view.detections.extract()?;
        let masks = found.stored_masks.runs(py, "masks")?;
        let (view, map) = (view.detected(&found, &masks)?, &mut self.map);
        let update = py.detach(|| map.update(&view)).map_err(error::to_py)?;
        let merged = update.merged.into_iter().map(Into::into).collect();
        Ok((update.entry_ids, update.removed, merged))
    }

    fn compare<'py>(
        &self,
        py: Python<'py>,
        entry_id: u64,
        view: View<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found: Detections<'_> = view.detections.extract()?;
        let masks = found.stored_masks.runs(py, "masks")?;
        let view = view.detected(&found, &masks)?;
        let found = py.detach(|| self.map.compare(entry_id, &view));
        let found = found.map_err(error::to_py)?;
        arrays::rows_of(py, found.into_iter().map(|c| [c.overlap, c.distance_m]).collect())
    }

    fn visible_shares<'py>(
        &self,
        py: Python<'py>,
        targets_m: PyReadonlyArray2<'py, f32>,
        eyes_m: PyReadonlyArray2<'py, f64>,
        config: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let config = arrays::from_attributes!(
            config,
            SightConfig { radius_m, step_m, margin_m, max_samples, max_targets }
        );
        let (targets, eyes) =
            (arrays::rows("targets_m", &targets_m)?, arrays::rows("eyes_m", &eyes_m)?);
        let shares = py.detach(|| self.map.visible_shares(targets, eyes, &config));
        Ok(PyArray1::from_vec(py, shares.map_err(error::to_py)?))
    }

    fn depth_evidence<'py>(
        &self,
        py: Python<'py>,
        entry_ids: Vec<u64>,
        view: View<'py>,
        config: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let config =
            arrays::from_attributes!(config, EvidenceConfig { max_points, band_m, band_share });
        let (depth_m, [height_px, width_px]) = arrays::row_major("depth_m", &view.depth_m)?;
        let camera = view.pose.camera([width_px, height_px], view.intrinsics.vertical_fov_rad);
        let found = py.detach(|| self.map.depth_evidence(&entry_ids, &camera, depth_m, &config));
        let found = found.map_err(error::to_py)?.into_iter();
        let rows =
            found.map(|e| [e.num_see_through, e.num_supported, e.num_occluded, e.num_out_of_view]);
        arrays::rows_of(py, rows.collect())
    }

    fn in_view(
        &self,
        py: Python<'_>,
        view: DepthImage<'_>,
        max_distance_m: f64,
    ) -> PyResult<Vec<u64>> {
        let (camera, _) = view.borrow()?;
        py.detach(|| self.map.in_view(&camera, max_distance_m)).map_err(error::to_py)
    }

    fn remove_seen_through(
        &mut self,
        py: Python<'_>,
        view: DepthImage<'_>,
        config: &Bound<'_, PyAny>,
    ) -> PyResult<Vec<(u64, usize, usize)>> {
        let config = arrays::from_attributes!(
            config,
            SeeThroughConfig { near_m, far_m, band_m, band_share, margin_px }
        );
        let (camera, depth_m) = view.borrow()?;
        let map = &mut self.map;
        let eroded = py.detach(|| map.remove_seen_through(&camera, depth_m, &config));
        let rows = eroded.map_err(error::to_py)?.into_iter();
        Ok(rows.map(|e| (e.id, e.num_removed, e.num_left)).collect())
    }

    fn num_bytes(&self) -> usize {
        self.map.num_bytes()
    }

    fn begin_stage(&mut self, stage: u32) {
        self.map.begin_stage(stage);
    }

    fn remove(&mut self, entry_id: u64) -> bool {
        self.map.remove(entry_id)
    }

    fn clear(&mut self) {
        self.map.clear();
        self.shown.clear();
    }

    #[getter]
    fn num_views(&self) -> u64 {
        self.map.num_views()
    }

    #[getter]
    fn entries(&mut self, py: Python<'_>) -> PyResult<Vec<Py<ObjectEntry>>> {
        let entries = self.map.entries().iter().map(|entry| self.show(py, entry));
        let entries: Vec<_> = entries.collect::<PyResult<_>>()?;
        self.shown = entries.iter().map(|entry| entry.clone_ref(py)).collect();
        Ok(entries)
    }

    fn entry(&self, py: Python<'_>, entry_id: u64) -> PyResult<Option<Py<ObjectEntry>>> {
        self.map.entry(entry_id).map(|entry| self.show(py, entry)).transpose()
    }

    fn points_m<'py>(
        &self,
        py: Python<'py>,
        entry_id: u64,
    ) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        let entry = self.map.entry(entry_id);
        entry.map(|entry| arrays::rows_of(py, entry.cloud.points().to_vec())).transpose()
    }

    fn __len__(&self) -> usize {
        self.map.entries().len()
    }
}

/// `evonav.sensors.observation.View`.
#[derive(FromPyObject)]
struct View<'py> {
    depth_m: PyReadonlyArray2<'py, f32>,
    pose: PyPose,
    intrinsics: Intrinsics,
    /// Extracted on its own, so that errors name the array.
    detections: Bound<'py, PyAny>,
}

/// `evonav.sensors.observation.Detections`.
#[derive(FromPyObject)]
struct Detections<'py> {
    stored_masks: NumberImage<'py>,
    labels: Vec<String>,
    confidences: PyReadonlyArray1<'py, f32>,
    features: Option<PyReadonlyArray2<'py, f32>>,
}

impl View<'_> {
    /// Return the view as slices, which can be used without the interpreter; the image has the size
    /// of `masks`.
    fn detected<'a>(
        &'a self,
        found: &'a Detections<'_>,
        masks: &'a RunImage,
    ) -> PyResult<DetectedView<'a>> {
        let Detections { labels, confidences, features, .. } = found;
        let [height_px, width_px] = masks.shape();
        let (depth_m, depth_shape) = arrays::row_major("depth_m", &self.depth_m)?;
        let expected = "as many rows as `masks`";
        Error::require("depth_m", depth_shape[0], expected, |n| n == height_px)
            .map_err(error::to_py)?;
        let (features, num_features) = match features {
            Some(features) => {
                arrays::row_major("features", features).map(|(values, shape)| (values, shape[0]))?
            }
            None => (&[][..], labels.len()),
        };
        Error::require("features", num_features, "a row a label", |n| n == labels.len())
            .map_err(error::to_py)?;
        let camera = self.pose.camera([width_px, height_px], self.intrinsics.vertical_fov_rad);
        let image = MaskedDepth { camera, depth_m, masks };
        Ok(DetectedView { image, labels, confidences: confidences.as_slice()?, features })
    }
}
