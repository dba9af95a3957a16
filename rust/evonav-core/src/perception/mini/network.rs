//! The detector's network, a small U-Net; `scripts/mini_detector/mini_net.py` defines it for training.

use crate::{
    Error,
    perception::mini::{
        convolution::{Conv, Tensor},
        weights::Weights,
    },
};

/// Side of the square to which images are resized.
pub const SIDE_PX: usize = 150;
/// Side of the square of cells for which the network has outputs.
pub const SIDE_CELLS: usize = SIDE_PX / 2;

/// The layers of the network.
#[derive(Debug, Clone)]
pub struct Network {
    classes: Vec<String>,
    stem: Conv,
    down: [Conv; 3],
    mid: [Conv; 3],
    /// Second convolutions of the two lower levels' residuals.
    mid_b: [Conv; 2],
    up: Conv,
    skip: [Conv; 3],
    fuse: [Conv; 2],
    fuse_top: [Conv; 2],
    head: Conv,
}

impl Network {
    /// Read the network from a weights file.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] stating the error in the file.
    pub fn read(bytes: &[u8]) -> Result<Self, Error> {
        let mut file = Weights::read(bytes)?;
        let mut take = |name, size, stride| file.take(name, size, stride, false);
        let network = Self {
            classes: Vec::new(),
            stem: take("stem", 3, 2)?,
            down: [take("down1", 3, 2)?, take("down2", 3, 2)?, take("down3", 3, 2)?],
            mid: [take("mid1", 3, 1)?, take("mid2", 3, 1)?, take("mid3", 3, 1)?],
            mid_b: [take("mid2b", 3, 1)?, take("mid3b", 3, 1)?],
            up: take("up3", 1, 1)?,
            skip: [take("skip0", 1, 1)?, take("skip1", 1, 1)?, take("skip2", 1, 1)?],
            fuse: [take("fuse1", 3, 1)?, take("fuse2", 3, 1)?],
            head: take("head", 1, 1)?,
            fuse_top: [file.take("fuse0d", 3, 1, true)?, file.take("fuse0p", 1, 1, false)?],
        };
        let network = Self { classes: file.classes, ..network };
        // Running the network shows whether the layers fit each other.
        let logits = network.run(&Tensor::zeros(SIDE_PX, SIDE_PX, 6))?;
        Error::require("weights", logits.channels, "3 outputs more than classes", |channels| {
            !network.classes.is_empty() && channels == network.classes.len() + 3
        })?;
        Ok(network)
    }

    /// Return the classes that it distinguishes, without the background.
    pub fn classes(&self) -> &[String] {
        &self.classes
    }

    /// Compute the logits of each cell: background, classes, and links to the cell on the right and
    /// to the one below.
    ///
    /// # Arguments
    /// * `input` - the result of [`input`].
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if a layer does not fit its input.
    pub fn run(&self, input: &Tensor) -> Result<Tensor, Error> {
        let top = relu(self.stem.run(input)?);
        let mut high = relu(self.down[0].run(&top)?);
        let more = self.mid[0].run(&high)?;
        high.add_relu(&more)?;
        let middle = self.level(1, &high)?;
        let low = self.level(2, &middle)?;
        let mut y = self.up.run(&low)?.doubled(middle.height, middle.width)?;
        y.add_relu(&self.skip[2].run(&middle)?)?;
        y = relu(self.fuse[1].run(&y)?).doubled(high.height, high.width)?;
        y.add_relu(&self.skip[1].run(&high)?)?;
        y = relu(self.fuse[0].run(&y)?).doubled(top.height, top.width)?;
        y.add_relu(&self.skip[0].run(&top)?)?;
        let more = relu(self.fuse_top[0].run(&y)?);
        y.add_relu(&self.fuse_top[1].run(&more)?)?;
        self.head.run(&y)
    }

    /// Compute a level: half the resolution, then a residual of two convolutions.
    fn level(&self, level: usize, above: &Tensor) -> Result<Tensor, Error> {
        let mut y = relu(self.down[level].run(above)?);
        let more = self.mid_b[level - 1].run(&relu(self.mid[level].run(&y)?))?;
        y.add_relu(&more)?;
        Ok(y)
    }
}

fn relu(mut image: Tensor) -> Tensor {
    image.relu();
    image
}

/// Convert an image to the network's input: colours, depth, height below the camera, nearness.
///
/// # Arguments
/// * `rgb` - row-major, three bytes per pixel.
/// * `depth_m` - planar z of each pixel, infinite where nothing is.
/// * `size_px` - width and height.
/// * `horizon_rad` - pitch of the camera; positive looks down.
///
/// # Errors
/// [`Error::InvalidArgument`] if there are no pixels, their numbers do not agree with the size, a
/// depth is not a number or the horizon is not finite.
pub fn input(
    rgb: &[u8],
    depth_m: &[f32],
    size_px: [usize; 2],
    horizon_rad: f64,
) -> Result<Tensor, Error> {
    let [width, height] = size_px;
    Error::require("depth_m", depth_m.len(), "one a pixel", |len| {
        len > 0 && Some(len) == width.checked_mul(height)
    })?;
    Error::require("rgb", rgb.len(), "three bytes a pixel", |len| len == 3 * depth_m.len())?;
    Error::require("horizon_rad", horizon_rad, "finite", f64::is_finite)?;
    let (sin, cos) = (horizon_rad.sin() as f32, horizon_rad.cos() as f32);
    let (pixels, rows, cols) = (rgb.as_chunks::<3>().0, samples(height), samples(width));
    let mut values = Vec::with_capacity(SIDE_PX * SIDE_PX * 6);
    for (i, row) in rows.iter().enumerate() {
        // Metres below the camera per metre of depth, in a field of view of 90 degrees.
        let below = sin + cos * ((i as f32 + 0.5) / (SIDE_PX as f32 / 2.0) - 1.0);
        for col in &cols {
            let place = row * width + col;
            let z_m = depth_m[place];
            Error::require("depth_m", z_m, "no NaN", |z_m| !z_m.is_nan())?;
            let z_m = z_m.clamp(0.05, 20.0);
            values.extend(pixels[place].map(|channel| f32::from(channel) / 127.5 - 1.0));
            values.extend([
                z_m.min(10.0) / 5.0 - 1.0,
                (z_m * below).clamp(-3.0, 3.0),
                1.0 / z_m.max(0.25) - 1.0,
            ]);
        }
    }
    Ok(Tensor { height: SIDE_PX, width: SIDE_PX, channels: 6, values })
}

/// Return the image's pixel, along one side, of each of the network's pixels.
pub fn samples(side_px: usize) -> Vec<usize> {
    (0..SIDE_PX).map(|i| (2 * i + 1) * side_px / (2 * SIDE_PX)).collect()
}
