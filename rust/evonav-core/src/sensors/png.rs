//! Images as PNG files.

use png::{BitDepth, ColorType, Compression, Encoder, EncodingError, Filter};

use crate::Error;

/// Encode an RGB image as PNG, without metadata.
///
/// The filter `Up` makes the smallest files of rendered views among the fast filters.
///
/// # Arguments
/// * `rgb` - row-major, three bytes a pixel.
/// * `shape` - `[height_px, width_px]`.
///
/// # Errors
/// [`Error::InvalidArgument`] if the image has no pixel, or if `rgb` is not of this shape.
///
/// # Complexity
/// O(pixels).
pub fn encode_png(rgb: &[u8], shape: [usize; 2]) -> Result<Vec<u8>, Error> {
    let [height_px, width_px] = shape;
    let mut file = Vec::new();
    let mut encode = || -> Result<(), EncodingError> {
        let mut encoder = Encoder::new(&mut file, width_px as u32, height_px as u32);
        encoder.set_color(ColorType::Rgb);
        encoder.set_depth(BitDepth::Eight);
        encoder.set_compression(Compression::Fast);
        encoder.set_filter(Filter::Up);
        encoder.write_header()?.write_image_data(rgb)
    };
    encode().map_err(|error| Error::invalid("rgb", error, "an image"))?;
    Ok(file)
}
