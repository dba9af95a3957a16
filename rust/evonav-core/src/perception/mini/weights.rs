//! Read the weights file of a network: `EVONAVNN`, the header's length (4 bytes, little-endian),
//! the header (JSON), then every layer's weights and biases as half-precision numbers.

use serde::Deserialize;

use crate::{
    Error,
    perception::mini::convolution::{Conv, ConvShape},
};

const MAGIC: &[u8; 8] = b"EVONAVNN";
const FORMAT: &str = "evonav-mini/2";

#[derive(Deserialize)]
struct Header {
    format: String,
    classes: Vec<String>,
    layers: Vec<LayerHeader>,
}

#[derive(Deserialize)]
struct LayerHeader {
    name: String,
    num_in: usize,
    num_out: usize,
    size: usize,
    stride: usize,
    is_depthwise: bool,
}

/// The contents of a weights file.
#[derive(Debug, Clone)]
pub struct Weights {
    /// Classes that the network distinguishes, without the background.
    pub classes: Vec<String>,
    layers: Vec<(String, Conv)>,
}

impl Weights {
    /// Read a file.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] stating the error in the file.
    pub fn read(bytes: &[u8]) -> Result<Self, Error> {
        let rest = bytes
            .strip_prefix(MAGIC)
            .ok_or_else(|| broken("no weights", "a file that begins with EVONAVNN"))?;
        let (len, rest) = rest.split_at_checked(4).ok_or_else(cut)?;
        let len = u32::from_le_bytes(len.try_into().map_err(|_| cut())?) as usize;
        let (header, mut rest) = rest.split_at_checked(len).ok_or_else(cut)?;
        let header: Header = serde_json::from_slice(header)
            .map_err(|error| broken(&format!("of a broken header ({error})"), "a JSON header"))?;
        if header.format != FORMAT {
            return Err(broken(&format!("of format {}", header.format), FORMAT));
        }
        let mut layers = Vec::with_capacity(header.layers.len());
        for layer in header.layers {
            let LayerHeader { name, num_in, num_out, size, stride, is_depthwise } = layer;
            let shape = ConvShape { num_in, num_out, size, stride, is_depthwise };
            let weights = take_halves(&mut rest, shape.num_weights()?)?;
            let bias = take_halves(&mut rest, num_out)?;
            layers.push((name, Conv::new(shape, &weights, &bias)?));
        }
        if !rest.is_empty() {
            return Err(broken(&format!("{} bytes too long", rest.len()), "a whole file"));
        }
        Ok(Self { classes: header.classes, layers })
    }

    /// Take a layer out of the weights.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the layer is missing or has a different window.
    pub fn take(
        &mut self,
        name: &str,
        size: usize,
        stride: usize,
        is_depthwise: bool,
    ) -> Result<Conv, Error> {
        let place = self.layers.iter().position(|(known, _)| known == name);
        let place =
            place.ok_or_else(|| broken(&format!("without layer `{name}`"), "all of the layers"))?;
        let (_, conv) = self.layers.swap_remove(place);
        let shape = conv.shape();
        if (shape.size, shape.stride, shape.is_depthwise) != (size, stride, is_depthwise) {
            let found = format!("with layer `{name}` of {shape:?}");
            return Err(broken(&found, &format!("a window of {size} and a stride of {stride}")));
        }
        Ok(conv)
    }
}

fn broken(found: &str, expected: &str) -> Error {
    Error::invalid("weights", found, expected)
}

fn cut() -> Error {
    broken("cut off", "a whole file")
}

fn take_halves(rest: &mut &[u8], num: usize) -> Result<Vec<f32>, Error> {
    let (taken, left) = rest.split_at_checked(2 * num).ok_or_else(cut)?;
    *rest = left;
    Ok(taken.as_chunks().0.iter().map(|&half| from_half(u16::from_le_bytes(half))).collect())
}

/// Convert a half-precision number (IEEE 754 binary16).
pub fn from_half(half: u16) -> f32 {
    let sign = if half >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(half >> 10 & 0x1f), f32::from(half & 0x3ff));
    match exponent {
        0 => sign * fraction * 2.0_f32.powi(-24),
        0x1f if fraction == 0.0 => sign * f32::INFINITY,
        0x1f => f32::NAN,
        _ => sign * (1.0 + fraction / 1024.0) * 2.0_f32.powi(exponent - 15),
    }
}
