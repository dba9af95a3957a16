//! Count the pixels of one body in a view without drawing the rest of the view.

use std::ops::Range;

use crate::{
    Error,
    sensors::{
        camera::{Camera, View},
        raster::{
            canvas::LANES,
            frame::{FrameBuffer, Want},
            lens::Lens,
            render::Draw,
        },
    },
    world::mesh::SceneMesh,
};

/// Share of the body's depth by which a part must be behind the body to be left out.
const BEHIND: f64 = 1e-4;

/// Return the number of pixels of a body in the image of [`crate::sensors::raster::render`]; `None`
/// if it is less than `least_px`.
///
/// Only the part of the image that contains the body is drawn, with the bodies that may be in front
/// of it.
///
/// # Arguments
/// * `body` - index of the body.
/// * `frame` - working memory; its images do not change.
///
/// # Errors
/// [`Error::InvalidArgument`] as [`Camera::check`].
///
/// # Complexity
/// O(parts + pixels of the body's box in the image).
pub fn visible_px(
    mesh: &SceneMesh,
    camera: &Camera,
    body: usize,
    least_px: usize,
    frame: &mut FrameBuffer,
) -> Result<Option<usize>, Error> {
    let view = View::from(*camera);
    view.check()?;
    let mut lens = Lens::new(&view);
    let counted = |count: usize| Ok((count >= least_px).then_some(count));
    let Some((columns, rows, farthest_m)) = box_of(mesh, &lens, camera, body, frame) else {
        return counted(0);
    };
    if columns.len() * rows.len() < least_px {
        return Ok(None);
    }
    lens.narrow(&columns, &rows, farthest_m * (1.0 + BEHIND));
    let blocks = columns.start / LANES..columns.end.div_ceil(LANES);
    let size_px = [camera.width_px, camera.height_px];
    frame.canvas.clear_within(size_px, lens.far_nearness(), rows.clone(), blocks.clone());
    let want = Want { rgb: None, instances: true };
    Draw { mesh, layer: mesh.solid_layer(), lens: &lens, want, has_panes: true }.onto(frame);
    let tag = body as u32 + 1;
    let canvas = &frame.canvas;
    let drawn = rows.flat_map(|row| {
        let first = canvas.row_blocks(row).start;
        canvas.tags[first + blocks.start..first + blocks.end].as_flattened()
    });
    counted(drawn.filter(|&&other| other == tag).count())
}

/// Return the columns and rows that contain a body's image, and its largest depth; `None` if it is
/// out of view.
fn box_of(
    mesh: &SceneMesh,
    lens: &Lens,
    camera: &Camera,
    body: usize,
    frame: &mut FrameBuffer,
) -> Option<(Range<usize>, Range<usize>, f64)> {
    let size_px = [camera.width_px, camera.height_px].map(|side| side as f64);
    let (mut low_px, mut high_px) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let mut farthest_m = f64::NEG_INFINITY;
    let first = mesh.parts.partition_point(|part| (part.body as usize) < body);
    let parts = mesh.parts[first..].iter().take_while(|part| part.body as usize == body);
    for part in parts.filter(|part| lens.may_see(&part.aabb)) {
        let vertices_m = &mesh.vertices_m[part.vertices.clone()];
        if lens.transform(vertices_m, &mut frame.scratch) {
            // A part that the near plane cuts may be anywhere in the image.
            (low_px, high_px) = ([0.0; 2], size_px);
        }
        for (local_m, point_px) in frame.scratch.local_m.iter().zip(&frame.scratch.projected_px) {
            farthest_m = farthest_m.max(local_m[2]);
            for axis in 0..2 {
                low_px[axis] = low_px[axis].min(point_px[axis]);
                high_px[axis] = high_px[axis].max(point_px[axis]);
            }
        }
    }
    let [columns, rows] = [0, 1].map(|axis| {
        let bound = |value: f64| value.clamp(0.0, size_px[axis]) as usize;
        bound(low_px[axis].floor())..bound(high_px[axis].ceil())
    });
    (!columns.is_empty() && !rows.is_empty()).then_some((columns, rows, farthest_m))
}
