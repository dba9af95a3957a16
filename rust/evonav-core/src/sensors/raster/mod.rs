//! Depth, instance and colour images of a scene: a scanline z-buffer on one thread.

mod canvas;
mod lens;
mod render;
mod shader;
mod style;
mod visible_px;

pub use render::{FrameBuffer, Want, render, render_view};
pub use style::Style;
pub use visible_px::visible_px;
