//! Images as PNG files.

use std::io::Cursor;

use png::{
    BitDepth, ColorType, Compression, Decoder, DecodingError, Encoder, EncodingError, Filter,
};

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

/// Decode an RGB image from a whole PNG file.
///
/// # Returns
/// The row-major pixels, three bytes each, and `[height_px, width_px]`.
///
/// # Errors
/// [`Error::InvalidArgument`] if the file is damaged, or is not of three channels of 8 bits.
///
/// # Complexity
/// O(pixels).
pub fn decode_png(file: &[u8]) -> Result<(Vec<u8>, [usize; 2]), Error> {
    let decode = || -> Result<_, DecodingError> {
        let mut reader = Decoder::new(Cursor::new(file)).read_info()?;
        let mut rgb = vec![0; reader.output_buffer_size().unwrap_or(0)];
        let frame = reader.next_frame(&mut rgb)?;
        reader.finish()?;
        Ok((rgb, frame))
    };
    let (rgb, frame) = decode().map_err(|error| Error::invalid("file", error, "a PNG image"))?;
    if (frame.color_type, frame.bit_depth) != (ColorType::Rgb, BitDepth::Eight) {
        let found = format!("{:?} of {:?} bits", frame.color_type, frame.bit_depth);
        return Err(Error::invalid("file", found, "an RGB image of 8 bits"));
    }
    Ok((rgb, [frame.height as usize, frame.width as usize]))
}
