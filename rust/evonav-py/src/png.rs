//! PNG files.

use evonav_core::Error;
use numpy::{PyReadonlyArray3, PyUntypedArrayMethods};
use png::{BitDepth, ColorType, Compression, Encoder, Filter};
use pyo3::{prelude::*, types::PyBytes};

use crate::{arrays, error};

/// Encode an RGB image. Of the fast filters, `Up` gives the smallest files of rendered views.
#[pyfunction]
pub fn encode_png<'py>(
    py: Python<'py>,
    rgb: PyReadonlyArray3<'py, u8>,
) -> PyResult<Bound<'py, PyBytes>> {
    let pixels = arrays::elements("rgb", &rgb)?;
    let &[height_px, width_px, 3] = rgb.shape() else {
        let found = format!("of shape {:?}", rgb.shape());
        return Err(error::to_py(Error::invalid("rgb", found, "an (H, W, 3) array")));
    };
    let file = py.detach(|| {
        let mut file = Vec::new();
        let mut encoder = Encoder::new(&mut file, width_px as u32, height_px as u32);
        encoder.set_color(ColorType::Rgb);
        encoder.set_depth(BitDepth::Eight);
        encoder.set_compression(Compression::Fast);
        encoder.set_filter(Filter::Up);
        encoder.write_header()?.write_image_data(pixels)?;
        Ok(file)
    });
    let file = file.map_err(|e: png::EncodingError| Error::invalid("rgb", e, "an image"));
    Ok(PyBytes::new(py, &file.map_err(error::to_py)?))
}
