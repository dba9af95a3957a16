//! Depth, instance and colour images of a scene: a scanline z-buffer on one thread.

mod canvas;
mod frame;
mod frustum;
mod hidden;
mod lens;
mod light;
mod panes;
mod render;
mod resolve;
mod shader;
mod style;
mod visible_px;

pub use frame::{FrameBuffer, Want};
pub use light::Light;
pub use render::{relight, render, render_lit, render_rows_of, render_view};
pub use style::Style;
pub use visible_px::visible_px;
