//! Runs of equal pixels in images of numbers.

use std::ops::{BitOrAssign, BitXor};

use evonav_simd::Kernel;

use crate::{Error, grid::bits::ones};

/// Equal pixels beside each other in a row of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Run {
    /// The number of each pixel.
    pub value: i32,
    /// Row of the image.
    pub row: usize,
    /// First column, and one past the last.
    pub cols: [usize; 2],
}

impl Run {
    /// Return the number of pixels.
    pub(crate) fn num_pixels(&self) -> usize {
        self.cols[1] - self.cols[0]
    }
}

/// An image of numbers as runs of equal pixels: instances, masks. A view of 300 x 300 pixels has
/// some 1,250 runs, 10 KB, and what is computed from them takes time a run, not a pixel.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RunImage {
    num_rows: usize,
    width_px: usize,
    /// One past the last pixel of each run, in row-major order, and its number. Runs end where rows
    /// end, and runs beside each other in a row differ.
    runs: Vec<[i32; 2]>,
}

impl RunImage {
    /// Find the runs of an image.
    ///
    /// # Arguments
    /// * `pixels` - row-major, `width_px` a row.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the image is not whole rows, or has 2^31 pixels or more.
    pub fn of(pixels: &[i32], width_px: usize) -> Result<Self, Error> {
        Error::require_rows("pixels", pixels.len(), width_px)?;
        let mut image = Self::empty([pixels.len() / width_px, width_px])?;
        image.add_rows(pixels, evonav_simd::compute(Changes(pixels)), width_px, |value| value);
        Ok(image)
    }

    /// Find the runs of an image whose rows have padding, as [`RunImage::of`].
    ///
    /// # Arguments
    /// * `rows` - each of `stride` pixels, the first of which are the image's.
    /// * `number_of` - number in the image of a number in `rows`.
    #[inline(always)]
    pub(crate) fn of_padded(
        shape: [usize; 2],
        rows: &[u32],
        stride: usize,
        number_of: impl Fn(u32) -> i32,
    ) -> Result<Self, Error> {
        let mut image = Self::empty(shape)?;
        image.add_rows(rows, Changes(rows).compute(), stride, number_of);
        Ok(image)
    }

    /// Add the runs of rows.
    ///
    /// # Arguments
    /// * `changes` - those of `rows`.
    #[inline(always)]
    fn add_rows<T: Copy>(
        &mut self,
        rows: &[T],
        mut changes: Vec<u64>,
        stride: usize,
        number_of: impl Fn(T) -> i32,
    ) {
        for first in (0..rows.len()).step_by(stride.max(1)) {
            changes[first / 64] |= 1 << (first % 64);
        }
        let begins = changes.into_iter().enumerate();
        let begins = begins.flat_map(|(index, bits)| ones(bits).map(move |bit| index * 64 + bit));
        let (mut row, mut first, mut begin) = (0, 0, 0);
        for end in begins.skip(1).chain([rows.len()]) {
            if begin == first + stride {
                (row, first) = (row + 1, begin);
            }
            if begin - first < self.width_px && begin < end {
                let end = row * self.width_px + self.width_px.min(end - first);
                self.push(end as i32, number_of(rows[begin]));
            }
            begin = end;
        }
    }

    /// Make an image of given [`RunImage::ends`].
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if they are not the runs of an image of this `[height, width]`.
    pub fn from_ends([num_rows, width_px]: [usize; 2], ends: &[[i32; 2]]) -> Result<Self, Error> {
        let mut image = Self::empty([num_rows, width_px])?;
        image.runs.reserve(ends.len());
        let mut begin = 0;
        for &[end, value] in ends {
            let row_end = (begin as usize / width_px.max(1) + 1) * width_px;
            Error::require(
                "runs",
                end,
                "one past the last pixel of a run, ascending, in one row",
                |end| end > begin && end as usize <= row_end,
            )?;
            image.push(end, value);
            begin = end;
        }
        let expected = format!("the number of pixels, {}", num_rows * width_px);
        Error::require("runs", begin, &expected, |end| end as usize == num_rows * width_px)?;
        Ok(image)
    }

    fn empty([num_rows, width_px]: [usize; 2]) -> Result<Self, Error> {
        let num_pixels = num_rows.checked_mul(width_px).filter(|&num| i32::try_from(num).is_ok());
        if num_pixels.is_none() {
            let found = format!("{num_rows} x {width_px} pixels");
            return Err(Error::invalid("image", found, "less than 2^31 pixels"));
        }
        Ok(Self { num_rows, width_px, runs: Vec::new() })
    }

    /// Append the next run, which is part of the last one if that has the same number and row.
    fn push(&mut self, end: i32, value: i32) {
        if let Some([last, number]) = self.runs.last_mut()
            && *number == value
            && !(*last as usize).is_multiple_of(self.width_px)
        {
            *last = end;
        } else {
            self.runs.push([end, value]);
        }
    }

    /// Return height and width.
    pub fn shape(&self) -> [usize; 2] {
        [self.num_rows, self.width_px]
    }

    /// Return one past the last pixel of each run, in row-major order, and the number of its
    /// pixels.
    pub fn ends(&self) -> &[[i32; 2]] {
        &self.runs
    }

    /// Return the runs in row-major order.
    pub fn runs(&self) -> impl Iterator<Item = Run> {
        let (mut row, mut first, mut begin) = (0, 0, 0);
        self.runs.iter().map(move |&[end, value]| {
            if begin == first + self.width_px {
                (row, first) = (row + 1, begin);
            }
            let run = Run { value, row, cols: [begin - first, end as usize - first] };
            begin = end as usize;
            run
        })
    }

    /// Return the image with other numbers.
    ///
    /// # Errors
    /// That of `number_of`.
    pub(crate) fn renumbered(
        &self,
        mut number_of: impl FnMut(i32) -> Result<i32, Error>,
    ) -> Result<Self, Error> {
        let mut image = Self { runs: Vec::with_capacity(self.runs.len()), ..*self };
        for &[end, value] in &self.runs {
            image.push(end, number_of(value)?);
        }
        Ok(image)
    }

    /// Return the number of each pixel, row-major.
    pub fn pixels(&self) -> Vec<i32> {
        let mut pixels = Vec::with_capacity(self.num_rows * self.width_px);
        for &[end, value] in &self.runs {
            pixels.resize(end as usize, value);
        }
        pixels
    }
}

/// Pixels that differ from the one before: a bit for each, in words of 64.
struct Changes<'a, T>(&'a [T]);

impl<T: Copy + Eq + Default + BitXor<Output = T> + BitOrAssign> Kernel for Changes<'_, T> {
    type Output = Vec<u64>;

    #[inline(always)]
    fn compute(self) -> Vec<u64> {
        let pixels = self.0;
        let mut bits = vec![0; pixels.len().div_ceil(64)];
        for (index, word) in bits.iter_mut().enumerate() {
            let start = index * 64;
            let before = start.checked_sub(1).and_then(|before| pixels[before..].first_chunk());
            if let (Some(before), Some(here)) = (before, pixels[start..].first_chunk()) {
                *word = changes(before, here);
            } else {
                for i in start.max(1)..pixels.len().min(start + 64) {
                    *word |= u64::from(pixels[i] != pixels[i - 1]) << (i - start);
                }
            }
        }
        bits
    }
}

#[inline(always)]
fn changes<T: Copy + Eq + Default + BitXor<Output = T> + BitOrAssign>(
    before: &[T; 64],
    here: &[T; 64],
) -> u64 {
    let mut differences = T::default();
    for (&a, &b) in before.iter().zip(here) {
        differences |= a ^ b;
    }
    if differences == T::default() {
        return 0;
    }
    let mut bytes = [0_u8; 64];
    for ((byte, a), b) in bytes.iter_mut().zip(before).zip(here) {
        *byte = u8::from(a != b);
    }
    // The product collects the lowest bit of eight bytes in the highest byte.
    let eight_bits =
        |eight: &[u8; 8]| u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    bytes.as_chunks().0.iter().rev().fold(0, |word, eight| word << 8 | eight_bits(eight))
}

#[cfg(test)]
mod tests {
    use proptest::{collection::vec, prelude::*};

    use super::{Run, RunImage};

    proptest! {
        #[test]
        fn runs_are_equal_pixels_of_a_row(
            stretches in vec((0..3_i32, 1..150_usize), 0..20),
            width_px in 1..200_usize,
            padding in 0..20_usize,
        ) {
            let stretch = |&(value, length): &(i32, usize)| std::iter::repeat_n(value, length);
            let mut pixels: Vec<i32> = stretches.iter().flat_map(stretch).collect();
            pixels.truncate(pixels.len() / width_px * width_px);
            let mut expected = Vec::new();
            for (row, pixels) in pixels.chunks_exact(width_px).enumerate() {
                let mut begin = 0;
                for equal in pixels.chunk_by(|a, b| a == b) {
                    let cols = [begin, begin + equal.len()];
                    expected.push(Run { value: equal[0], row, cols });
                    begin += equal.len();
                }
            }
            let image = RunImage::of(&pixels, width_px).unwrap();
            prop_assert_eq!(image.runs().collect::<Vec<_>>(), expected);
            prop_assert_eq!(image.pixels(), &pixels[..]);
            prop_assert_eq!(&RunImage::from_ends(image.shape(), image.ends()).unwrap(), &image);
            // What is in the padding does not matter, and other numbers may be the same in the image.
            let padded = |row: &[i32]| {
                let pixels = row.iter().map(|&value| 2 * value as u32 + row.len() as u32 % 2);
                let rest = (0..padding as u32).map(|i| if i < 5 { 2 * row[0] as u32 } else { i });
                pixels.chain(rest).collect::<Vec<_>>()
            };
            let rows: Vec<u32> = pixels.chunks_exact(width_px).flat_map(padded).collect();
            let number_of = |value: u32| value as i32 / 2;
            let found = RunImage::of_padded(image.shape(), &rows, width_px + padding, number_of);
            prop_assert_eq!(found.unwrap(), image);
        }

        #[test]
        fn renumbered_images_are_those_of_renumbered_pixels(
            pixels in vec(-1..3_i32, 0..60), width_px in 1..9_usize, numbers in [0..3_i32, 0..3, 0..3, 0..3],
        ) {
            let pixels = &pixels[..pixels.len() / width_px * width_px];
            let number_of = |value: i32| numbers[(value + 1) as usize];
            let image = RunImage::of(pixels, width_px).unwrap();
            let renumbered = image.renumbered(|value| Ok(number_of(value))).unwrap();
            let expected: Vec<i32> = pixels.iter().map(|&value| number_of(value)).collect();
            prop_assert_eq!(renumbered, RunImage::of(&expected, width_px).unwrap());
        }

        /// Any pairs of numbers are an error or an image.
        #[test]
        fn ends_that_are_no_image_are_refused(
            ends in vec([-1..13_i32, 0..2_i32], 0..9), shape in [0..4_usize, 1..4_usize],
        ) {
            if let Ok(image) = RunImage::from_ends(shape, &ends) {
                prop_assert_eq!(&RunImage::of(&image.pixels(), shape[1]).unwrap().runs, &image.runs);
                prop_assert_eq!(image.pixels().len(), shape[0] * shape[1]);
            } else {
                let is_whole = ends.last().map_or(0, |end| end[0]) as usize == shape[0] * shape[1];
                let starts = [0].into_iter().chain(ends.iter().map(|end| end[0]));
                let are_in_rows = starts.zip(&ends).all(|(begin, &[end, _])| {
                    end > begin && begin as usize / shape[1] == (end - 1) as usize / shape[1]
                });
                prop_assert!(!(is_whole && are_in_rows));
            }
        }
    }
}
