//! Python bindings of `evonav-core`. They convert arguments, release the GIL and map errors, and do
//! nothing else.

mod arrays;
mod camera;
mod drawing;
mod error;
mod generation;
mod house;
mod house_generation;
mod inspection;
mod memory;
mod perception;
mod resampling;
mod run_image;
mod sensors;
mod simulator;
mod unigoal;
mod vectors;

use pyo3::prelude::*;

#[pymodule]
mod _core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::{
        camera::{project_points, unproject_image, unproject_masks},
        drawing::{best_label_point, outlines},
        error::{
            DecisionError, EvonavError, HouseError, InvalidArgumentError, SimulationError,
            StoreError, TaskError,
        },
        generation::{default_generation_parameters, generate_task},
        house::{House, HouseObject, Opening, Room, Wall, assets, object_outlines},
        house_generation::{HouseMaker, default_house_parameters},
        inspection::inspect_house,
        memory::{
            objects::{ObjectEntry, ObjectMap},
            occupancy::{Frontier, OccupancyMap},
            snapshots::update_snapshots,
        },
        perception::{
            mini::MiniNetwork,
            noise::{
                distort_masks, draw_normals, mask_outlines, noisy_depth, paint_blobs, surface_sites,
            },
        },
        resampling::draw_counts,
        run_image::RunImage,
        sensors::{
            decode_png, encode_png, instance_areas, mask_extents, number_instances, renumber_masks,
            visible_cells,
        },
        simulator::{
            batch::{PyBatchSimulator, PyGeodesicField},
            embedded::{PyEmbeddedSimulator, map_spec},
        },
        unigoal::BevMap,
        vectors::has_wide_vectors,
    };

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // Images are freed as often as they are created. After one block of this size was freed,
        // glibc keeps that much memory instead of returning it to the system; getting it back takes
        // a third of a frame.
        drop(std::hint::black_box(vec![0_u8; 1 << 24]));
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        // PyO3 lists every name in `__all__`, which the stub would have to repeat.
        module.delattr("__all__")
    }
}
