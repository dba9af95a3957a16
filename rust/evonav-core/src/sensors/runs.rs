//! Runs of equal pixels in images of numbers.

use evonav_simd::Kernel;

use crate::grid::bits::ones;

/// Equal pixels beside each other in a row of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Run {
    pub(crate) value: i32,
    pub(crate) row: usize,
    /// First column, and one past the last.
    pub(crate) cols: [usize; 2],
}

impl Run {
    /// Return the number of pixels.
    pub(crate) fn len(&self) -> usize {
        self.cols[1] - self.cols[0]
    }
}

/// Return the runs of an image in row-major order. Pixels after the last whole row are left out.
///
/// # Complexity
/// O(pixels), most of it 64 pixels at once.
pub(crate) fn runs(pixels: &[i32], width_px: usize) -> impl Iterator<Item = Run> {
    let num_rows = pixels.len().checked_div(width_px).unwrap_or(0);
    let pixels = &pixels[..num_rows * width_px];
    let mut starts = evonav_simd::compute(Changes(pixels));
    for first in (0..pixels.len()).step_by(width_px.max(1)) {
        starts[first / 64] |= 1 << (first % 64);
    }
    let starts = starts.into_iter().enumerate();
    let starts = starts.flat_map(|(index, bits)| ones(bits).map(move |bit| index * 64 + bit));
    let mut starts = starts.chain([pixels.len()]);
    let mut begin = starts.next().unwrap_or(0);
    let (mut row, mut first) = (0, 0);
    starts.map(move |end| {
        if begin == first + width_px {
            (row, first) = (row + 1, begin);
        }
        let run = Run { value: pixels[begin], row, cols: [begin - first, end - first] };
        begin = end;
        run
    })
}

/// Pixels that differ from the one before: a bit for each, in words of 64.
struct Changes<'a>(&'a [i32]);

impl Kernel for Changes<'_> {
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
fn changes(before: &[i32; 64], here: &[i32; 64]) -> u64 {
    let mut differences = 0;
    for (a, b) in before.iter().zip(here) {
        differences |= a ^ b;
    }
    if differences == 0 {
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

    use super::{Run, runs};

    proptest! {
        #[test]
        fn runs_are_equal_pixels_of_a_row(
            stretches in vec((-1..3_i32, 1..150_usize), 0..20),
            width_px in 0..200_usize,
        ) {
            let stretch = |&(value, length): &(i32, usize)| std::iter::repeat_n(value, length);
            let pixels: Vec<i32> = stretches.iter().flat_map(stretch).collect();
            let mut expected = Vec::new();
            for (row, pixels) in pixels.chunks_exact(width_px.max(1)).enumerate() {
                let mut begin = 0;
                for equal in pixels.chunk_by(|a, b| a == b) {
                    let cols = [begin, begin + equal.len()];
                    expected.push(Run { value: equal[0], row, cols });
                    begin += equal.len();
                }
            }
            let found: Vec<Run> = runs(&pixels, width_px).collect();
            prop_assert_eq!(found, if width_px == 0 { Vec::new() } else { expected });
        }
    }
}
