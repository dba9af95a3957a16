//! Convolutions over channel-last images.

use crate::Error;

/// Number of output channels that the inner loop handles at once; `TILE` is the number of output
/// pixels of a row.
const LANES: usize = 8;
const TILE: usize = 4;

/// An image of numbers, row-major, with the channels of a pixel side by side.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tensor {
    /// Number of rows.
    pub height: usize,
    /// Number of columns.
    pub width: usize,
    /// Number of channels.
    pub channels: usize,
    /// Values, `height * width * channels` numbers.
    pub values: Vec<f32>,
}

impl Tensor {
    /// Create an image of zeros.
    pub fn zeros(height: usize, width: usize, channels: usize) -> Self {
        Self { height, width, channels, values: vec![0.0; height * width * channels] }
    }

    /// Add another image of the same shape, then set negative values to 0.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the shapes differ.
    pub fn add_relu(&mut self, other: &Self) -> Result<(), Error> {
        if self.shape() != other.shape() {
            return Err(shape_error(other, &format!("an image of shape {:?}", self.shape())));
        }
        for (value, add) in self.values.iter_mut().zip(&other.values) {
            *value = (*value + add).max(0.0);
        }
        Ok(())
    }

    /// Set negative values to 0.
    pub fn relu(&mut self) {
        for value in &mut self.values {
            *value = value.max(0.0);
        }
    }

    /// Double the resolution by repeating pixels, then cut to a size.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the doubled image is smaller than that size.
    pub fn doubled(&self, height: usize, width: usize) -> Result<Self, Error> {
        if height > 2 * self.height || width > 2 * self.width {
            return Err(shape_error(self, &format!("at least half of ({height}, {width})")));
        }
        let mut values = Vec::with_capacity(height * width * self.channels);
        for row in 0..height {
            let line = &self.values[row / 2 * self.width * self.channels..];
            for col in 0..width {
                values.extend_from_slice(&line[col / 2 * self.channels..][..self.channels]);
            }
        }
        Ok(Self { height, width, channels: self.channels, values })
    }

    /// Return height, width and channels.
    pub fn shape(&self) -> [usize; 3] {
        [self.height, self.width, self.channels]
    }
}

fn shape_error(found: &Tensor, expected: &str) -> Error {
    Error::invalid("image", format!("of shape {:?}", found.shape()), expected)
}

/// The shape of a convolution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConvShape {
    /// Number of channels of the input.
    pub num_in: usize,
    /// Number of channels of the output.
    pub num_out: usize,
    /// Side of the window, odd. The image is padded with zeros, half a window wide.
    pub size: usize,
    /// Number of input pixels from one output pixel to the next.
    pub stride: usize,
    /// Whether every channel is convolved separately.
    pub is_depthwise: bool,
}

impl ConvShape {
    /// Return the number of weights, without biases.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the shape is impossible or too large.
    pub fn num_weights(&self) -> Result<usize, Error> {
        let Self { num_in, num_out, size, stride, is_depthwise } = *self;
        let is_sane = (1..=4096).contains(&num_in)
            && (1..=4096).contains(&num_out)
            && size % 2 == 1
            && size <= 15
            && (1..=8).contains(&stride)
            && (!is_depthwise || num_in == num_out);
        if !is_sane {
            let expected = "1 to 4096 channels, an odd window of at most 15 and a stride of 1 to 8";
            return Err(Error::invalid("shape", format!("{self:?}"), expected));
        }
        Ok(num_out * size * size * if is_depthwise { 1 } else { num_in })
    }
}

/// A convolution with its weights.
#[derive(Debug, Clone)]
pub struct Conv {
    shape: ConvShape,
    /// Weights by block of output channels, row and column of the window, input channel; depthwise
    /// ones by row, column, channel.
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl Conv {
    /// Create a convolution.
    ///
    /// # Arguments
    /// * `shape` - shape of the convolution.
    /// * `weights` - by output channel, input channel (one if depthwise), row, column, as in torch.
    /// * `bias` - by output channel.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the shape is impossible, or the weights do not fit it or are
    /// not finite.
    pub fn new(shape: ConvShape, weights: &[f32], bias: &[f32]) -> Result<Self, Error> {
        Error::require("weights", weights.len(), "as many as the shape says", {
            let num = shape.num_weights()?;
            move |len| len == num
        })?;
        Error::require("bias", bias.len(), "one an output channel", |len| len == shape.num_out)?;
        if let Some(bad) = weights.iter().chain(bias).find(|value| !value.is_finite()) {
            return Err(Error::invalid("weights", bad, "finite numbers"));
        }
        let area = shape.size * shape.size;
        let packed = if shape.is_depthwise {
            (0..area).flat_map(|k| (0..shape.num_out).map(move |c| weights[c * area + k])).collect()
        } else {
            let num_blocks = shape.num_out.div_ceil(LANES);
            let mut packed = Vec::with_capacity(num_blocks * LANES * shape.num_in * area);
            for block in 0..num_blocks {
                for (k, input) in (0..area).flat_map(|k| (0..shape.num_in).map(move |i| (k, i))) {
                    packed.extend((0..LANES).map(|lane| {
                        let output = block * LANES + lane;
                        weights.get((output * shape.num_in + input) * area + k).unwrap_or(&0.0)
                    }));
                }
            }
            packed
        };
        let mut bias = bias.to_vec();
        bias.resize(shape.num_out.div_ceil(LANES) * LANES, 0.0);
        Ok(Self { shape, weights: packed, bias })
    }

    /// Return the shape.
    pub fn shape(&self) -> ConvShape {
        self.shape
    }

    /// Convolve an image. Every output is its bias plus the products by row and column of the
    /// window and input channel, added in that order.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the image has a different number of channels, or no pixels.
    ///
    /// # Complexity
    /// O(output pixels x weights).
    pub fn run(&self, image: &Tensor) -> Result<Tensor, Error> {
        let ConvShape { num_in, num_out, size, stride, is_depthwise } = self.shape;
        let is_whole = image.values.len() == image.height * image.width * image.channels;
        if image.channels != num_in || image.values.is_empty() || !is_whole {
            return Err(shape_error(image, &format!("pixels of {num_in} channels")));
        }
        let [height, width] = [image.height, image.width].map(|side| (side - 1) / stride + 1);
        let num_tiles = width.div_ceil(TILE);
        let padded = Padded::new(image, size, (num_tiles * TILE - 1) * stride + size);
        let mut out = Tensor::zeros(height, width, num_out);
        for (row, line) in out.values.chunks_exact_mut(width * num_out).enumerate() {
            let lines: Vec<&[f32]> = (0..size).map(|ky| padded.line(row * stride + ky)).collect();
            if is_depthwise {
                self.depthwise_row(&lines, line);
            } else {
                self.row(&lines, line);
            }
        }
        Ok(out)
    }

    /// Compute one row of the output from the rows of the window.
    fn row(&self, lines: &[&[f32]], out: &mut [f32]) {
        let ConvShape { num_in, num_out, size, stride, .. } = self.shape;
        let (step, reach) = (stride * num_in, size * num_in);
        for (block, weights) in self.weights.chunks_exact(size * reach * LANES).enumerate() {
            let first = block * LANES;
            let num = LANES.min(num_out - first);
            let bias: [f32; LANES] = std::array::from_fn(|lane| self.bias[first + lane]);
            for (tile, pixels) in out.chunks_mut(TILE * num_out).enumerate() {
                let mut sums = [bias; TILE];
                for (line, weights) in lines.iter().zip(weights.chunks_exact(reach * LANES)) {
                    let start = tile * TILE * step;
                    let windows: [&[f32]; TILE] =
                        std::array::from_fn(|p| &line[start + p * step..][..reach]);
                    add_products(&mut sums, windows, weights.as_chunks().0);
                }
                for (pixel, sums) in pixels.chunks_exact_mut(num_out).zip(&sums) {
                    pixel[first..first + num].copy_from_slice(&sums[..num]);
                }
            }
        }
    }

    fn depthwise_row(&self, lines: &[&[f32]], out: &mut [f32]) {
        let ConvShape { num_in, size, stride, .. } = self.shape;
        for (col, pixel) in out.chunks_exact_mut(num_in).enumerate() {
            pixel.copy_from_slice(&self.bias[..num_in]);
            for (k, weights) in self.weights.chunks_exact(num_in).enumerate() {
                let window = &lines[k / size][(col * stride + k % size) * num_in..][..num_in];
                for ((sum, value), weight) in pixel.iter_mut().zip(window).zip(weights) {
                    *sum += value * weight;
                }
            }
        }
    }
}

/// Add a row of the window to a tile's sums. Compilers turn the plain arrays into SIMD as long as
/// the function is not inlined and the sums stay in registers.
#[inline(never)]
fn add_products(
    sums: &mut [[f32; LANES]; TILE],
    windows: [&[f32]; TILE],
    weights: &[[f32; LANES]],
) {
    let mut registers = *sums;
    let windows = windows.map(|window| &window[..weights.len()]);
    for (i, weights) in weights.iter().enumerate() {
        let values = windows.map(|window| window[i]);
        for (sums, value) in registers.iter_mut().zip(values) {
            for (sum, weight) in sums.iter_mut().zip(weights) {
                *sum += value * weight;
            }
        }
    }
    *sums = registers;
}

/// An image padded with zeros.
struct Padded {
    width: usize,
    channels: usize,
    values: Vec<f32>,
}

impl Padded {
    /// Pad an image with half a window of zeros on every side, and on the right up to `min_width`.
    fn new(image: &Tensor, size: usize, min_width: usize) -> Self {
        let (half, channels) = (size / 2, image.channels);
        let width = (image.width + 2 * half).max(min_width);
        let mut values = vec![0.0; (image.height + 2 * half) * width * channels];
        let lines = values.chunks_exact_mut(width * channels).skip(half);
        for (line, pixels) in lines.zip(image.values.chunks_exact(image.width * channels)) {
            line[half * channels..][..pixels.len()].copy_from_slice(pixels);
        }
        Self { width, channels, values }
    }

    fn line(&self, row: usize) -> &[f32] {
        let len = self.width * self.channels;
        &self.values[row * len..][..len]
    }
}
