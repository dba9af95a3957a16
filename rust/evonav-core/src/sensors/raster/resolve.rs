//! Turn a canvas into images of depth and instances.

use evonav_simd::Kernel;

use crate::{
    Error,
    sensors::{
        raster::{
            canvas::{LANES, shows_only},
            frame::{FrameBuffer, Want},
            lens::{Lens, Optics},
        },
        runs::RunImage,
    },
    world::mesh::SceneMesh,
};

/// Turns the canvas of the solid parts into images of depth and instances.
pub(super) struct Resolve<'a> {
    pub mesh: &'a SceneMesh,
    pub lens: &'a Lens,
    pub want: Want,
    pub out: &'a mut FrameBuffer,
}

impl Kernel for Resolve<'_> {
    type Output = Result<(), Error>;

    #[inline(always)]
    fn compute(self) -> Self::Output {
        let Self { mesh, lens, want, out } = self;
        let FrameBuffer {
            depth_m,
            empty_depth_m,
            instances,
            has_runs,
            instance_runs,
            rgb,
            canvas,
            ..
        } = out;
        let num_pixels = canvas.width_px * canvas.height_px;
        let has_pixels = want.instances && !*has_runs;
        // Appended, since filling images first would take as long as the numbers themselves.
        depth_m.clear();
        depth_m.reserve(num_pixels);
        instances.clear();
        instances.reserve(if has_pixels { num_pixels } else { 0 });
        let (empty, horizon_m) = (lens.far_nearness(), lens.horizon_m() as f32);
        let empty_m = empty_depth_m.unwrap_or(f32::INFINITY);
        for row in 0..canvas.height_px {
            let nearness = canvas.row(row)[..canvas.width_px].iter();
            let depth = |&near: &f32, depth_m: f32| if near > empty { depth_m } else { empty_m };
            match lens.optics {
                Optics::Perspective { .. } => {
                    depth_m.extend(nearness.map(|near| depth(near, 1.0 / near)));
                }
                Optics::Orthographic { .. } => {
                    depth_m.extend(nearness.map(|near| depth(near, horizon_m - near)));
                }
            }
            // In the same turn as depth, whose divisions leave the processor idle.
            if has_pixels {
                let tags = &canvas.tags[canvas.row_blocks(row)];
                match want.rgb {
                    Some(_) => add_bodies(mesh, tags, canvas.width_px, instances),
                    None => {
                        let tags = &tags.as_flattened()[..canvas.width_px];
                        instances.extend(tags.iter().map(|&tag| tag as i32));
                    }
                }
            }
        }
        if want.instances && *has_runs {
            let (shape, stride) =
                ([canvas.height_px, canvas.width_px], LANES * canvas.blocks_per_row());
            let tags = canvas.tags.as_flattened();
            *instance_runs = match want.rgb {
                Some(_) => RunImage::of_padded(shape, tags, stride, |tag| body_of(mesh, tag)),
                None => RunImage::of_padded(shape, tags, stride, |tag| tag as i32),
            }?;
        }
        rgb.resize(if want.rgb.is_some() { 3 * num_pixels } else { 0 }, 0);
        Ok(())
    }
}

/// Return the instance id of a face tag.
#[inline(always)]
fn body_of(mesh: &SceneMesh, tag: u32) -> i32 {
    tag.checked_sub(1).map_or(0, |face| mesh.faces[face as usize].body as i32 + 1)
}

/// Add the instance ids of a row by its face tags.
#[inline(always)]
fn add_bodies(mesh: &SceneMesh, tags: &[[u32; LANES]], width_px: usize, instances: &mut Vec<i32>) {
    let (mut last, whole) = ((0, 0), width_px / LANES);
    for tags in &tags[..whole] {
        instances.extend_from_slice(&bodies_of(mesh, tags, &mut last));
    }
    if let Some(tags) = tags.get(whole) {
        let bodies = bodies_of(mesh, tags, &mut last);
        instances.extend_from_slice(&bodies[..width_px % LANES]);
    }
}

/// Return the instance ids of a block. Most blocks lie within the face that comes last before them.
#[inline(always)]
fn bodies_of(mesh: &SceneMesh, tags: &[u32; LANES], last: &mut (u32, i32)) -> [i32; LANES] {
    if shows_only(tags, last.0) {
        return [last.1; LANES];
    }
    tags.map(|tag| {
        if tag != last.0 {
            *last = (tag, body_of(mesh, tag));
        }
        last.1
    })
}
