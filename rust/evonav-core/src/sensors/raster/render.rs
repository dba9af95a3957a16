//! Render depth, instance and colour images of a scene with a scanline z-buffer on one thread.
//!
//! Parts of houses are convex and have few sides. So whole polygons are drawn rather than
//! triangles, faces turned away are never drawn, and a face's inverse depth is the exact plane
//! equation instead of an interpolation between corners. Colours are computed after visibility.

use evonav_simd::Kernel;

use crate::{
    Error,
    geometry::Vec3,
    sensors::{
        camera::{Camera, View},
        raster::{
            canvas::LANES,
            frame::{FrameBuffer, Want},
            lens::{Lens, Scratch},
            light::Light,
            resolve::Resolve,
            style::Style,
        },
    },
    world::mesh::{Layer, PartMesh, SceneMesh},
};

/// Render the view of a camera with AI2-THOR's clip planes, as [`render_view`].
///
/// # Errors
/// [`Error::InvalidArgument`] as [`Camera::check`].
pub fn render(
    mesh: &SceneMesh,
    camera: &Camera,
    want: Want,
    out: &mut FrameBuffer,
) -> Result<(), Error> {
    render_view(mesh, &View::from(*camera), want, out)
}

/// Render one view into `out`; of [`Style::Default`], in an even light.
///
/// The error of depth is under 0.1 mm within 10 m. Of surfaces at equal depth the one drawn first
/// stays. The order depends only on mesh and view, and so does every pixel.
///
/// # Errors
/// [`Error::InvalidArgument`] as [`View::check`].
///
/// # Complexity
/// O(parts + faces in view + pixels they cover).
pub fn render_view(
    mesh: &SceneMesh,
    view: &View,
    want: Want,
    out: &mut FrameBuffer,
) -> Result<(), Error> {
    render_lit(mesh, None, view, want, out)
}

/// Render one view as [`render_view`], with the light of the house where the style wants it.
///
/// # Errors
/// [`Error::InvalidArgument`] as [`View::check`].
pub fn render_lit(
    mesh: &SceneMesh,
    light: Option<&Light>,
    view: &View,
    want: Want,
    out: &mut FrameBuffer,
) -> Result<(), Error> {
    let lens = draw_solid(mesh, view, want, out)?;
    match want.rgb {
        Some(Style::Default) => light_up(mesh, light, view, &lens, out),
        Some(Style::Plain) => {
            out.shader.shade_flat(false, &lens, &out.canvas, |_| true, &mut out.rgb);
        }
        None => {}
    }
    Ok(())
}

/// Render one view in [`Style::Plain`] with instances as [`render_view`], with thin lines around
/// silhouettes, and only the colours of rows that show an instance; those of other rows stay.
///
/// # Errors
/// [`Error::InvalidArgument`] as [`View::check`].
pub fn render_rows_of(
    mesh: &SceneMesh,
    view: &View,
    instance: i32,
    out: &mut FrameBuffer,
) -> Result<(), Error> {
    let want = Want { rgb: Some(Style::Plain), instances: true };
    let lens = draw_solid(mesh, view, want, out)?;
    let FrameBuffer { shader, canvas, instances, rgb, .. } = out;
    let row_of = |row: usize| &instances[row * canvas.width_px..][..canvas.width_px];
    let shows_it = |row: usize| row_of(row).contains(&instance);
    shader.shade_flat(true, &lens, canvas, shows_it, rgb);
    Ok(())
}

/// Render the last view again in [`Style::Default`], with the light of the house: the same colours
/// as by [`render_lit`], while depth and instances are there already.
///
/// # Arguments
/// * `out` - holds the view in another style.
pub fn relight(mesh: &SceneMesh, light: &Light, view: &View, out: &mut FrameBuffer) {
    light_up(mesh, Some(light), view, &Lens::new(view), out);
}

/// Draw the solid parts, and make images of depth and instances of them.
fn draw_solid(
    mesh: &SceneMesh,
    view: &View,
    want: Want,
    out: &mut FrameBuffer,
) -> Result<Lens, Error> {
    view.check()?;
    let lens = Lens::new(view);
    let Camera { width_px, height_px, .. } = view.camera;
    // Nothing beyond the far plane is nearer than an empty pixel.
    out.canvas.clear(width_px, height_px, lens.far_nearness(), want.has_tags());
    if let Some(style) = want.rgb {
        out.shader.begin(style, mesh, &lens, [width_px, height_px]);
    }
    Draw { mesh, layer: mesh.solid_layer(), lens: &lens, want, has_panes: true }.onto(out);
    evonav_simd::compute(Resolve { mesh, lens: &lens, want, out })?;
    Ok(lens)
}

/// Draw what colours alone show over the solid parts, and light all of it.
fn light_up(
    mesh: &SceneMesh,
    light: Option<&Light>,
    view: &View,
    lens: &Lens,
    out: &mut FrameBuffer,
) {
    let want = Want { rgb: Some(Style::Default), instances: false };
    Draw { mesh, layer: mesh.trim_layer(), lens, want, has_panes: true }.onto(out);
    see_through(mesh, view, lens, want, out);
    out.shader.shade_lit(mesh, light, lens, &out.canvas, &mut out.rgb);
    out.panes.cover(&out.canvas, &lens.rays(), &mut out.rgb);
}

/// Draw what is behind glass in its place.
fn see_through(mesh: &SceneMesh, view: &View, lens: &Lens, want: Want, out: &mut FrameBuffer) {
    out.panes.forget();
    let mut all = mesh.parts.iter().chain(&mesh.trim);
    if !all.any(|part| part.is_pane && lens.may_see(&part.aabb)) {
        return;
    }
    let layers = [mesh.solid_layer(), mesh.trim_layer()];
    let FrameBuffer { canvas, panes, .. } = out;
    let Some((rows, blocks)) = panes.clear(mesh, lens.far_nearness(), canvas) else { return };
    let mut narrow = Lens::new(view);
    let columns = blocks.start * LANES..(blocks.end * LANES).min(out.canvas.width_px);
    narrow.narrow(&columns, &rows, view.clip_m[1]);
    out.canvas.draw_within(rows, blocks);
    for layer in layers {
        Draw { mesh, layer, lens: &narrow, want, has_panes: false }.onto(out);
    }
}

/// Draws the parts in view, nearest first, without those that others hide.
#[derive(Clone, Copy)]
pub(super) struct Draw<'a> {
    pub mesh: &'a SceneMesh,
    pub layer: Layer<'a>,
    pub lens: &'a Lens,
    pub want: Want,
    /// Whether glass is drawn.
    pub has_panes: bool,
}

impl Draw<'_> {
    pub fn onto(self, out: &mut FrameBuffer) {
        if self.want.has_tags() {
            evonav_simd::compute(DrawOnto::<true> { draw: self, out });
        } else {
            evonav_simd::compute(DrawOnto::<false> { draw: self, out });
        }
    }

    #[inline(always)]
    fn part<const HAS_TAGS: bool>(self, part: &PartMesh, out: &mut FrameBuffer) {
        let Self { mesh, lens, want, .. } = self;
        let FrameBuffer { canvas, shader, scratch, .. } = out;
        let is_clipped = lens.transform(&mesh.vertices_m[part.vertices.clone()], scratch);
        for index in part.faces.clone() {
            let face = &mesh.faces[index];
            let Some((plane, facing)) = lens.nearness_plane(face) else { continue };
            let Scratch { local_m, projected_px, clipped_m, polygon_px, .. } = scratch;
            polygon_px.clear();
            let corners = mesh.corners_of(face);
            if is_clipped {
                clip_near(corners.iter().map(|&i| local_m[i as usize]), lens.clip_m[0], clipped_m);
                if clipped_m.len() < 3 {
                    continue;
                }
                polygon_px.extend(clipped_m.iter().map(|&p| lens.to_image(p)));
            } else {
                polygon_px.extend(corners.iter().map(|&i| projected_px[i as usize]));
            }
            let tag = if want.rgb.is_some() { index as u32 } else { face.body } + 1;
            if let Some(style) = want.rgb {
                shader.note(style, mesh, index, facing);
            }
            canvas.fill_polygon::<HAS_TAGS>(polygon_px, plane, tag);
        }
    }
}

/// [`Draw::onto`] and its argument; whether there are tags is known when this is compiled.
struct DrawOnto<'a, const HAS_TAGS: bool> {
    draw: Draw<'a>,
    out: &'a mut FrameBuffer,
}

impl<const HAS_TAGS: bool> Kernel for DrawOnto<'_, HAS_TAGS> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        let Self { draw, out } = self;
        let Draw { mesh, layer, lens, has_panes, .. } = draw;
        lens.collect_visible(layer, &mut out.scratch.visible);
        out.hidden.begin(&out.canvas);
        for index in 0..out.scratch.visible.len() {
            let (nearest_m, part) = out.scratch.visible[index];
            let part = &layer.parts[part as usize];
            if (has_panes || !part.is_pane)
                && !out.hidden.hides(&out.canvas, mesh, part, lens, nearest_m)
            {
                draw.part::<HAS_TAGS>(part, out);
            }
        }
    }
}

/// Clip a polygon to the part in front of the near plane.
fn clip_near(
    corners_m: impl Iterator<Item = Vec3> + Clone,
    near_m: f64,
    clipped_m: &mut Vec<Vec3>,
) {
    clipped_m.clear();
    let next = corners_m.clone().cycle().skip(1);
    for (a, b) in corners_m.zip(next) {
        if a[2] >= near_m {
            clipped_m.push(a);
        }
        if (a[2] >= near_m) != (b[2] >= near_m) {
            // Computed from the nearer end, whatever the direction of the edge: neighbours get the
            // same point.
            let (near, far) = if a[2] < b[2] { (a, b) } else { (b, a) };
            let t = (near_m - near[2]) / (far[2] - near[2]);
            clipped_m.push(std::array::from_fn(|i| near[i] + t * (far[i] - near[i])));
        }
    }
}
