//! The images of one view, and which of them to render.

use crate::sensors::{
    raster::{
        canvas::Canvas, hidden::Hidden, lens::Scratch, panes::Panes, shader::Shader, style::Style,
    },
    runs::RunImage,
};

/// The images to render besides depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Want {
    /// The style of colours to render, if any.
    pub rgb: Option<Style>,
    /// Whether to render the body of each pixel.
    pub instances: bool,
}

impl Want {
    /// Return whether it matters which surface a pixel shows.
    pub(super) fn has_tags(self) -> bool {
        self.rgb.is_some() || self.instances
    }
}

/// The images of one view, row-major, and working memory to render the next one without allocating.
#[derive(Debug, Clone, Default)]
pub struct FrameBuffer {
    /// Planar depth in metres, `(H, W)`; where nothing is, `empty_depth_m`.
    pub depth_m: Vec<f32>,
    /// Depth of pixels where nothing is; infinite if there is none.
    pub empty_depth_m: Option<f32>,
    /// Body index + 1 of each pixel, `(H, W)`; 0 where nothing is. Empty if not rendered.
    pub instances: Vec<i32>,
    /// Whether instances are rendered as `instance_runs`, in place of `instances`.
    pub has_runs: bool,
    /// See `has_runs`.
    pub instance_runs: RunImage,
    /// Colours, sRGB, `(H, W, 3)`. Empty if not rendered.
    pub rgb: Vec<u8>,
    pub(super) canvas: Canvas,
    pub(super) hidden: Hidden,
    pub(super) shader: Shader,
    pub(super) panes: Panes,
    pub(super) scratch: Scratch,
}

impl FrameBuffer {
    /// Take depth and colours out as vectors of their own.
    pub fn take(&mut self) -> (Vec<f32>, Vec<u8>) {
        (std::mem::take(&mut self.depth_m), std::mem::take(&mut self.rgb))
    }
}
