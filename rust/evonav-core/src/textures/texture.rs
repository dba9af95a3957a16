//! A texture, with smaller and smaller copies of itself, and how it is looked up.

/// Value of a channel that leaves a surface's colour as it is.
pub const NEUTRAL: f32 = 128.0;

/// Share of a pattern's contrast that is kept, so that large surfaces are as calm as AI2-THOR's.
const CONTRAST: f32 = 0.72;

/// Colours that repeat in both directions, from a square of texels.
///
/// A texel holds four numbers: factors of red, green and blue, and of the gloss. [`NEUTRAL`] means
/// 1, so that a surface keeps its colour on average.
///
/// Near surfaces are looked up in the texels themselves, mixed. Further ones are looked up in
/// copies that are blurred by the width of a pixel, at two widths for every halving: their nearest
/// texel is already a mixture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Texture {
    finest: Level,
    copies: Vec<Copied>,
}

/// A square of `1 << log2_size` texels a side, row by row, each with four numbers of 16 bits, of
/// which 8 are used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Level {
    log2_size: u32,
    texels: Vec<u64>,
}

/// A blurred copy of a texture, four bytes a texel.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Copied {
    log2_size: u32,
    texels: Vec<[u8; 4]>,
}

/// Number of places that are looked up together.
const LANES: usize = 8;
/// Binary logarithm of the square of the least width, in texels, that is looked up in a copy.
const FIRST_COPY: i32 = 2;
/// Weights, in sixteenths, of a blur whose square is one texel.
const BLUR: [f32; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];

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
        let finest = Level { log2_size, texels: texels.iter().map(pack).collect() };
        let mut copies = Vec::new();
        for log2_size in (0..=log2_size).rev() {
            let size = 1_usize << log2_size;
            let once = blurred(&texels, size);
            for blurred in [&once, &blurred(&once, size)] {
                let texels = blurred.iter().map(|texel| texel.map(to_byte)).collect();
                copies.push(Copied { log2_size, texels });
            }
            let half = size / 2;
            texels = (0..half * half)
                .map(|index| {
                    let first = 2 * (index / half) * size + 2 * (index % half);
                    mean_of(&[first, first + 1, first + size, first + size + 1].map(|i| texels[i]))
                })
                .collect();
        }
        Self { finest, copies }
    }

    /// Return the texels.
    pub fn finest(&self) -> &Level {
        &self.finest
    }

    /// Return the number of texels a side.
    pub fn size(&self) -> usize {
        self.finest.size()
    }

    /// Return the texture's mean around each `[u, v]`, in repeats of the texture: for each channel
    /// of a colour, 256 times its values.
    ///
    /// # Arguments
    /// * `width2` - square of the width of what is averaged, in texels.
    #[inline(always)]
    pub fn sample(&self, u: &[f32; LANES], v: &[f32; LANES], width2: f32) -> [[u16; LANES]; 3] {
        match self.copy_for(width2) {
            None => self.finest.sample(u, v),
            Some(copy) => copy.sample(u, v),
        }
    }

    /// Return the copy that is blurred by about a width.
    #[inline(always)]
    fn copy_for(&self, width2: f32) -> Option<&Copied> {
        // The bits of a number are close to its logarithm, with 23 bits after the point.
        let bits = width2.clamp(1.0, 1e9).to_bits() + (1 << 22);
        let halvings = (bits >> 23) as i32 - 127 - FIRST_COPY;
        let last = self.copies.len() - 1;
        usize::try_from(halvings).ok().map(|index| &self.copies[index.min(last)])
    }
}

/// Blur a square of texels that repeats in both directions.
fn blurred(texels: &[Texel], size: usize) -> Vec<Texel> {
    let along = |texels: &[Texel], step: usize| -> Vec<Texel> {
        let place = |index: usize, shift: usize| {
            let at = index / step % size;
            index - at * step + (at + size * 2 + shift - 2) % size * step
        };
        let mean = |index: usize| {
            let sum =
                |i: usize| (0..5).map(|k| BLUR[k] * texels[place(index, k)][i]).sum::<f32>() / 16.0;
            std::array::from_fn(sum)
        };
        (0..texels.len()).map(mean).collect()
    };
    along(&along(texels, 1), size)
}

impl Copied {
    /// Return 256 times the colours of the nearest texels.
    #[inline(always)]
    fn sample(&self, u: &[f32; LANES], v: &[f32; LANES]) -> [[u16; LANES]; 3] {
        let size = 1_u32 << self.log2_size;
        let (scale, mask) = (size as f32, size - 1);
        let mut index = [0; LANES];
        for lane in 0..LANES {
            let x = fixed(u[lane] * scale - 0.5) & mask;
            let y = fixed(v[lane] * scale - 0.5) & mask;
            index[lane] = y << self.log2_size | x;
        }
        let mut texels = [0; LANES];
        for (texel, index) in texels.iter_mut().zip(index) {
            *texel = u32::from_le_bytes(self.texels[index as usize]);
        }
        let mut sums = [[0; LANES]; 3];
        for (channel, sums) in sums.iter_mut().enumerate() {
            for lane in 0..LANES {
                sums[lane] = ((texels[lane] >> (8 * channel) & 255) as u16) << 8;
            }
        }
        sums
    }
}

impl Level {
    /// Return the number of texels a side.
    pub fn size(&self) -> usize {
        1 << self.log2_size
    }

    /// Return a texel.
    pub fn texel(&self, x: usize, y: usize) -> Texel {
        unpack(self.texels[y * self.size() + x])
    }

    /// Return 256 times the colours of the mixtures of the four texels around each place.
    #[inline(always)]
    fn sample(&self, u: &[f32; LANES], v: &[f32; LANES]) -> [[u16; LANES]; 3] {
        let mask = (1_u32 << self.log2_size) - 1;
        let scale = (256_u32 << self.log2_size) as f32;
        let (mut x, mut y) = ([0; LANES], [0; LANES]);
        for lane in 0..LANES {
            x[lane] = fixed(u[lane] * scale).wrapping_sub(128);
            y[lane] = fixed(v[lane] * scale).wrapping_sub(128);
        }
        let mut sums = [[0; LANES]; 3];
        for lane in 0..LANES {
            let sum = self.mixture(x[lane], y[lane], mask);
            for (channel, sums) in sums.iter_mut().enumerate() {
                sums[lane] = (sum >> (16 * channel)) as u16;
            }
        }
        sums
    }

    /// Return the mixture around a place, in units of 1/256 of a texel, as packed sums.
    #[inline(always)]
    fn mixture(&self, x: u32, y: u32, mask: u32) -> u64 {
        let (fx, fy) = (u64::from(x & 255), u64::from(y & 255));
        let (x0, y0) = (x >> 8 & mask, y >> 8 & mask);
        let (x1, y1) = ((x0 + 1) & mask, (y0 + 1) & mask);
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

fn to_byte(channel: f32) -> u8 {
    (channel + 0.5).clamp(0.0, 255.0) as u8
}

fn pack(texel: &Texel) -> u64 {
    let byte = |i: usize| u64::from(to_byte(texel[i]));
    byte(0) | byte(1) << 16 | byte(2) << 32 | byte(3) << 48
}

fn unpack(packed: u64) -> Texel {
    std::array::from_fn(|i| (packed >> (16 * i) & 0xffff) as f32)
}
