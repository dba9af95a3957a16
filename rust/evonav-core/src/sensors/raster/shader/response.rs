//! The camera's response to brightness, in numbers of 16 bits.

use crate::sensors::raster::canvas::LANES;

/// Brightness as a number of 16 bits, a grey level.
pub(super) const FINE: f32 = 128.0;
/// The greatest brightness; the response to it is white.
pub(super) const MOST: u16 = (1.3 * 255.0 * FINE) as u16;
/// The response `x (a + b x - c x^2)` to brightness `x`: more contrast in the middle than at both ends.
const RESPONSE: [f32; 3] = [0.80, 0.55, 0.40];

/// Return the product over 2^16.
#[inline(always)]
pub(super) fn product(a: u16, b: u16) -> u16 {
    ((u32::from(a) * u32::from(b)) >> 16) as u16
}

/// Turns a row's brightness, [`FINE`] times, into colours.
pub(super) struct Develop<'a> {
    /// Brightness by channel, which becomes grey levels.
    pub bright: &'a mut [Vec<u16>; 3],
    /// The share of light that corners leave, [`u16::MAX`] times.
    pub open: &'a [u16],
    /// Working memory, of the length of `bright`.
    pub packed: &'a mut [u32],
    pub pixels: &'a mut [u8],
}

impl Develop<'_> {
    #[inline(always)]
    pub(super) fn compute(self) {
        let Self { bright, open, packed, pixels } = self;
        for channel in bright.iter_mut() {
            respond(channel, open);
        }
        let [red, green, blue] = &*bright;
        for (((packed, red), green), blue) in packed.iter_mut().zip(red).zip(green).zip(blue) {
            *packed = u32::from(red | green << 8) | u32::from(*blue) << 16;
        }
        write_pixels(packed, pixels);
    }
}

/// Write a row's colours.
///
/// # Arguments
/// * `packed` - a channel a byte; the last block may go on beyond the row.
#[inline(always)]
pub(super) fn write_pixels(packed: &[u32], pixels: &mut [u8]) {
    let (whole, rest) = pixels.as_chunks_mut();
    let (blocks, _) = packed.as_chunks();
    for (pixels, block) in whole.iter_mut().zip(blocks) {
        *pixels = bytes_of(block);
    }
    if !rest.is_empty() {
        rest.copy_from_slice(&bytes_of(&blocks[whole.len()])[..rest.len()]);
    }
}

/// Turn brightness into grey levels.
#[inline(always)]
fn respond(bright: &mut [u16], open: &[u16]) {
    /// Brightness of 1, and what 1 becomes when it is multiplied by that.
    const ONE: f32 = 255.0 * FINE;
    const SHARE: f32 = ONE / 65536.0;
    /// Coefficients as numbers of 16 bits. The last product is 32 times a grey level.
    const LINEAR: f32 = 255.0 * 32.0 / SHARE;
    const A: u16 = (RESPONSE[0] * LINEAR) as u16;
    const B: u16 = (RESPONSE[1] * LINEAR / SHARE) as u16;
    const C: u16 = (RESPONSE[2] * LINEAR / SHARE / SHARE) as u16;
    for (bright, open) in bright.iter_mut().zip(open) {
        let x = product(*bright, *open);
        // Pixels that are not those of a surface, which get their colours later, have any brightness.
        let slope = A.wrapping_add(product(x, B.wrapping_sub(product(x, C))));
        *bright = (product(x, slope).wrapping_add(16) >> 5).min(255);
    }
}

/// Return the three lower bytes of each number.
#[inline(always)]
fn bytes_of(block: &[u32; LANES]) -> [u8; 3 * LANES] {
    let pair = |i: usize| u64::from(block[2 * i]) | u64::from(block[2 * i + 1]) << 24;
    let [a, b, c, d] = [pair(0), pair(1), pair(2), pair(3)];
    let mut bytes = [[0; 8]; 3];
    let numbers = [a | b << 48, b >> 16 | c << 32, c >> 32 | d << 16];
    for (bytes, number) in bytes.iter_mut().zip(numbers) {
        *bytes = number.to_le_bytes();
    }
    *bytes.as_flattened().first_chunk().expect("24 bytes")
}
