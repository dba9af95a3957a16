//! Compute colours after visibility, in one of the [`Style`]s.

mod bends;
mod edges;
mod flat;
mod lit;
mod response;
mod runs;
mod surface;

use crate::{
    sensors::raster::{
        canvas::Canvas,
        lens::Lens,
        light::Light,
        shader::{flat::Flat, lit::Lit},
        style::Style,
    },
    world::mesh::SceneMesh,
};

/// The faces in view, as each style knows them, and working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Shader {
    flat: Flat,
    lit: Lit,
}

impl Shader {
    pub fn begin(&mut self, style: Style, mesh: &SceneMesh, lens: &Lens, size_px: [usize; 2]) {
        match style {
            Style::Plain => self.flat.begin(mesh.faces.len(), size_px, lens.optics),
            Style::Default => {}
        }
    }

    /// Note a face that may be seen, with the second result of [`Lens::nearness_plane`].
    #[inline]
    pub fn note(&mut self, style: Style, mesh: &SceneMesh, index: usize, facing: f64) {
        match style {
            Style::Plain => self.flat.light(index, &mesh.faces[index], facing),
            Style::Default => {}
        }
    }

    /// Fill rows of `rgb` in [`Style::Plain`], with lines around silhouettes or without, from a drawn
    /// canvas whose tags are indices of faces plus 1.
    pub fn shade_flat(
        &mut self,
        has_lines: bool,
        lens: &Lens,
        canvas: &Canvas,
        is_wanted: impl Fn(usize) -> bool,
        rgb: &mut [u8],
    ) {
        self.flat.shade(canvas, lens.optics, has_lines, is_wanted, rgb);
    }

    /// Fill `rgb` in [`Style::Default`] from such a canvas.
    pub fn shade_lit(
        &mut self,
        mesh: &SceneMesh,
        light: Option<&Light>,
        lens: &Lens,
        canvas: &Canvas,
        rgb: &mut [u8],
    ) {
        self.lit.shade(mesh, light, lens, canvas, rgb);
    }
}
