//! `evonav_core::memory::snapshots`. Shapes, units and errors: `_core.pyi`.

use evonav_core::memory::snapshots::{self, Frame, Located, Snapshot};
use pyo3::prelude::*;

use crate::error;

type Owned = (usize, Vec<u64>);

#[pyfunction]
#[pyo3(signature = (objects, frames, snapshots, *, agent_m, reach_m))]
pub fn update_snapshots(
    py: Python<'_>,
    objects: Vec<(u64, [f64; 2])>,
    frames: Vec<Vec<(u64, f64)>>,
    snapshots: Vec<Owned>,
    agent_m: [f64; 2],
    reach_m: f64,
) -> PyResult<Vec<Owned>> {
    let objects: Vec<Located> =
        objects.into_iter().map(|(id, centre_m)| Located { id, centre_m }).collect();
    let frames: Vec<Frame> = frames.into_iter().map(|seen| Frame { seen }).collect();
    let snapshots: Vec<Snapshot> =
        snapshots.into_iter().map(|(frame, objects)| Snapshot { frame, objects }).collect();
    let update = || snapshots::update_snapshots(&objects, &frames, &snapshots, agent_m, reach_m);
    let updated = py.detach(update).map_err(error::to_py)?;
    Ok(updated.into_iter().map(|snapshot| (snapshot.frame, snapshot.objects)).collect())
}
