//! A texture, with smaller and smaller copies of itself, and how it is looked up.

/// Value of a channel that leaves a surface's colour as it is.
pub const NEUTRAL: f32 = 128.0;

/// Share of a pattern's contrast that is kept, so that large surfaces are as calm as AI2-THOR's.
const CONTRAST: f32 = 0.72;

/// Colours that repeat in both directions, from a square of texels.
///
/// A texel holds four numbers of 16 bits, of which 8 are used: factors of red, green and blue, and
/// of the gloss. [`NEUTRAL`] means 1, so that a surface keeps its colour on average.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Texture {
    levels: Vec<Level>,
}

/// One copy of a texture: a square of `1 << log2_size` texels a side, row by row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Level {
    log2_size: u32,
    texels: Vec<u64>,
}

/// A texel's channels apart, as factors times [`NEUTRAL`].
pub type Texel = [f32; 4];

impl Texture {
    /// Make a texture from its colours.
    ///
    /// # Arguments
    /// * `log2_size` - the logarithm of the number of texels a side.
    /// * `is_picture` - whether the colours are those of a picture; otherwise they are scaled so
    ///   that their mean is [`NEUTRAL`].
    /// * `at` - the factors (or colours from 0 to 1) at `[u, v]`, from 0 to 1.
    pub fn draw(log2_size: u32, is_picture: bool, at: impl Fn(f32, f32) -> Texel) -> Self {
        let size = 1_usize << log2_size;
        let step = 1.0 / size as f32;
        // Four samples a texel soften edges.
        let texel = |index: usize| {
            let (x, y) = (index % size, index / size);
            let mut sum = [0.0; 4];
            for [du, dv] in [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]] {
                let sample = at((x as f32 + du) * step, (y as f32 + dv) * step);
                sum = std::array::from_fn(|i| sum[i] + 0.25 * sample[i]);
            }
            sum
        };
        let mut texels: Vec<Texel> = (0..size * size).map(texel).collect();
        let mean = mean_of(&texels);
        for texel in &mut texels {
            *texel = std::array::from_fn(|i| match (is_picture, i) {
                (true, 0..3) => 255.0 * texel[i].clamp(0.0, 1.0),
                _ => {
                    let factor = texel[i] / mean[i].max(1e-3);
                    (NEUTRAL * (1.0 + CONTRAST * (factor - 1.0))).clamp(0.0, 255.0)
                }
            });
        }
        Self::of_texels(log2_size, texels)
    }

    fn of_texels(log2_size: u32, mut texels: Vec<Texel>) -> Self {
        let mut levels = Vec::new();
        for log2_size in (0..=log2_size).rev() {
            levels.push(Level { log2_size, texels: texels.iter().map(pack).collect() });
            let size = 1_usize << log2_size;
            let half = size / 2;
            texels = (0..half * half)
                .map(|index| {
                    let first = 2 * (index / half) * size + 2 * (index % half);
                    mean_of(&[first, first + 1, first + size, first + size + 1].map(|i| texels[i]))
                })
                .collect();
        }
        Self { levels }
    }

    /// Return the copies of the texture, from the finest to a single texel.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// Return the number of texels a side.
    pub fn size(&self) -> usize {
        1 << (self.levels.len() - 1)
    }

    /// Return the texture's mean around `[u, v]`, in repeats of the texture, as packed channels
    /// times 256; see [`channels_of`].
    ///
    /// # Arguments
    /// * `width2` - square of the width of what is averaged, in texels.
    #[inline(always)]
    pub fn sample(&self, u: f32, v: f32, width2: f32) -> u64 {
        // The bits of a number are close to its logarithm, with 23 bits after the point. Half of it
        // is the logarithm of the width.
        let level = (width2.clamp(1.0, 1e9).to_bits() - 1.0_f32.to_bits()) >> 1;
        let (whole, rest) = ((level >> 23) as usize, level >> 15 & 255);
        let last = self.levels.len() - 1;
        let [fine, coarse] = [whole, whole + 1].map(|level| &self.levels[level.min(last)]);
        // Only in the middle between two copies are both looked up.
        match rest {
            0..64 => fine.sample(u, v),
            192.. => coarse.sample(u, v),
            _ => mixed(fine.sample(u, v), coarse.sample(u, v), u64::from(2 * (rest - 64))),
        }
    }
}

/// Return the mixture of two packed sums; `share` is 256 times that of the second.
#[inline(always)]
fn mixed(first: u64, second: u64, share: u64) -> u64 {
    let [first, second] = [first, second].map(|sum| (sum + HALVES) >> 8 & BYTES);
    first * (256 - share) + second * share
}

/// Half of 256 in each channel, for rounding, and the bits of whole channels.
const HALVES: u64 = 0x0080_0080_0080_0080;
const BYTES: u64 = 0x00ff_00ff_00ff_00ff;

impl Level {
    /// Return the number of texels a side.
    pub fn size(&self) -> usize {
        1 << self.log2_size
    }

    /// Return a texel.
    pub fn texel(&self, x: usize, y: usize) -> Texel {
        unpack(self.texels[y * self.size() + x])
    }

    /// Return the mixture of the four texels around `[u, v]`, in repeats of the texture, as packed
    /// sums of 256 times the channels.
    #[inline(always)]
    pub fn sample(&self, u: f32, v: f32) -> u64 {
        let mask = (1_u32 << self.log2_size) - 1;
        let scale = (256_u32 << self.log2_size) as f32;
        let [x, y] = [fixed(u * scale), fixed(v * scale)].map(|c| c.wrapping_sub(128));
        let [fx, fy] = [u64::from(x & 255), u64::from(y & 255)];
        let [x0, y0] = [x >> 8 & mask, y >> 8 & mask];
        let [x1, y1] = [(x0 + 1) & mask, (y0 + 1) & mask];
        let at = |x: u32, y: u32| self.texels[(y << self.log2_size | x) as usize];
        let right = (fx * fy) >> 8;
        let (left, top) = (fy - right, fx - right);
        let rest = 256 - fx - left;
        at(x0, y0) * rest + at(x1, y0) * top + at(x0, y1) * left + at(x1, y1) * right
    }
}

/// Return the whole number nearest to a number, by the mantissa of a sum with 1.5 times 2^23, as
/// this needs no treatment of numbers out of range.
#[inline(always)]
fn fixed(value: f32) -> u32 {
    (value + 12_582_912.0).to_bits() & 0x003f_ffff
}

fn mean_of(texels: &[Texel]) -> Texel {
    let sum = texels
        .iter()
        .fold([0.0_f64; 4], |sum, texel| std::array::from_fn(|i| sum[i] + f64::from(texel[i])));
    sum.map(|channel| (channel / texels.len() as f64) as f32)
}

fn pack(texel: &Texel) -> u64 {
    let byte = |i: usize| u64::from((texel[i] + 0.5).clamp(0.0, 255.0) as u8);
    byte(0) | byte(1) << 16 | byte(2) << 32 | byte(3) << 48
}

fn unpack(packed: u64) -> Texel {
    std::array::from_fn(|i| (packed >> (16 * i) & 0xffff) as f32)
}

/// Return the channels of a packed sum of [`Level::sample`].
#[inline(always)]
pub fn channels_of(sum: u64) -> Texel {
    std::array::from_fn(|i| f32::from((sum >> (16 * i)) as u16) * (1.0 / 256.0))
}
