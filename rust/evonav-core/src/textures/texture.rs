//! A texture, with smaller and smaller copies of itself, and how it is looked up.

use evonav_simd::Kernel;

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
    copies: Vec<Level>,
}

/// A square of `1 << log2_size` texels a side, row by row, each with four numbers of 8 bits. Rows
/// have their first texel again at their end, and the last row is the first one again, so that all
/// four neighbours of a place lie at fixed distances.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Level {
    log2_size: u32,
    texels: Vec<u32>,
}

/// Number of places that are looked up together, at most.
pub const MOST_PLACES: usize = 64;

/// The colours of places, by channel: 256 times a texture's values.
pub type Sums = [[u16; MOST_PLACES]; 3];

/// Binary logarithm of the square of the least width, in texels, that is looked up in a copy.
const FIRST_COPY: i32 = 2;
/// Weights, in sixteenths, of a blur whose square is one texel.
const BLUR: [f32; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];

/// A texel's channels apart, as factors times [`NEUTRAL`].
pub type Texel = [f32; 4];

/// The colours of a texture.
pub trait Pattern {
    /// Return the factors (or colours from 0 to 1) at `[u, v]`, from 0 to 1.
    fn at(&self, u: f32, v: f32) -> Texel;
}

/// The samples of a row, by channel.
struct Samples<'a, P> {
    pattern: &'a P,
    u: &'a [f32],
    v: f32,
    out: &'a mut [Vec<f32>; 4],
}

impl<P: Pattern> Kernel for Samples<'_, P> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        let [red, green, blue, gloss] = self.out;
        let rgb = red.iter_mut().zip(green).zip(blue);
        for ((&u, ((red, green), blue)), gloss) in self.u.iter().zip(rgb).zip(gloss) {
            [*red, *green, *blue, *gloss] = self.pattern.at(u, self.v);
        }
    }
}

impl Texture {
    /// Make a texture from its colours.
    ///
    /// # Arguments
    /// * `log2_size` - the logarithm of the number of texels a side.
    /// * `is_picture` - whether the colours are those of a picture; otherwise they are scaled so
    ///   that their mean is [`NEUTRAL`].
    /// * `pattern` - the factors (or colours from 0 to 1).
    pub fn draw(log2_size: u32, is_picture: bool, pattern: &impl Pattern) -> Self {
        let size = 1_usize << log2_size;
        let step = 1.0 / size as f32;
        // Four samples a texel soften edges.
        let places = (0..size).flat_map(|x| [0.25, 0.75].map(|du| (x as f32 + du) * step));
        let u: Vec<f32> = places.collect();
        let mut samples = [const { Vec::new() }; 4].map(|_: Vec<f32>| vec![0.0; u.len()]);
        let mut texels = vec![[0.0; 4]; size * size];
        for (y, texels) in texels.chunks_exact_mut(size).enumerate() {
            for dv in [0.25, 0.75] {
                let v = (y as f32 + dv) * step;
                evonav_simd::compute(Samples { pattern, u: &u, v, out: &mut samples });
                for (channel, samples) in samples.iter().enumerate() {
                    for (texel, pair) in texels.iter_mut().zip(samples.chunks_exact(2)) {
                        let sum: f32 = texel[channel];
                        texel[channel] = sum + 0.25 * pair[0] + 0.25 * pair[1];
                    }
                }
            }
        }
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
        let finest = Level::of(log2_size, &texels);
        let mut copies = Vec::new();
        for log2_size in (0..=log2_size).rev() {
            let size = 1_usize << log2_size;
            let once = blurred(&texels, size);
            copies.push(Level::of(log2_size, &once));
            copies.push(Level::of(log2_size, &blurred(&once, size)));
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

    /// Return the number of the copy that is blurred by about a width, from 1 on; 0 for the texels
    /// themselves.
    ///
    /// # Arguments
    /// * `width2` - square of the width of what is averaged, in texels.
    #[inline(always)]
    pub fn level(&self, width2: f32) -> usize {
        // The bits of a number are close to its logarithm, with 23 bits after the point.
        let bits = width2.clamp(1.0, 1e9).to_bits() + (1 << 22);
        let halvings = (bits >> 23) as i32 - 127 - FIRST_COPY;
        ((halvings + 1).max(0) as usize).min(self.copies.len())
    }

    /// Look the texture up at each `[u, v]`, in repeats of the texture.
    ///
    /// # Arguments
    /// * `level` - a result of [`Self::level`].
    /// * `u`, `v` - [`MOST_PLACES`] or fewer, of equal number.
    #[inline(always)]
    pub fn sample(&self, level: usize, u: &[f32], v: &[f32], sums: &mut Sums) {
        match level.checked_sub(1) {
            None => self.finest.mixed(u, v, sums),
            Some(copy) => self.copies[copy].nearest(u, v, sums),
        }
    }
}

/// Blur a square of texels that repeats in both directions.
fn blurred(texels: &[Texel], size: usize) -> Vec<Texel> {
    let at = |i: usize| (i + 2 * size - 2) % size;
    let mut across = Vec::with_capacity(texels.len());
    for row in texels.chunks_exact(size) {
        let wide: Vec<Texel> = (0..size + 4).map(|x| row[at(x)]).collect();
        across.extend(wide.windows(5).map(|near| weighted(std::array::from_fn(|k| &near[k]))));
    }
    let mut blurred = Vec::with_capacity(texels.len());
    for y in 0..size {
        let [a, b, c, d, e] = std::array::from_fn(|k| &across[at(y + k) * size..][..size]);
        let columns = a.iter().zip(b).zip(c).zip(d).zip(e);
        blurred.extend(columns.map(|((((a, b), c), d), e)| weighted([a, b, c, d, e])));
    }
    blurred
}

fn weighted(near: [&Texel; 5]) -> Texel {
    let [a, b, c, d, e] = near;
    let [wa, wb, wc, wd, we] = BLUR;
    std::array::from_fn(|i| (wa * a[i] + wb * b[i] + wc * c[i] + wd * d[i] + we * e[i]) / 16.0)
}

impl Level {
    fn of(log2_size: u32, texels: &[Texel]) -> Self {
        let size = 1_usize << log2_size;
        let row = |y: usize| &texels[y % size * size..][..size];
        let rows = (0..=size).flat_map(|y| row(y).iter().chain(&row(y)[..1]));
        Self {
            log2_size,
            texels: rows.map(|texel| u32::from_le_bytes(texel.map(to_byte))).collect(),
        }
    }

    /// Return the number of texels a side.
    pub fn size(&self) -> usize {
        1 << self.log2_size
    }

    /// Return a texel.
    pub fn texel(&self, x: usize, y: usize) -> Texel {
        self.texels[y * (self.size() + 1) + x].to_le_bytes().map(f32::from)
    }

    /// Return the index of the texel at a column and row, which may lie beyond the square.
    #[inline(always)]
    fn index(&self, x: u32, y: u32) -> u32 {
        let mask = (1 << self.log2_size) - 1;
        let (x, y) = (x & mask, y & mask);
        (y << self.log2_size) + y + x
    }

    /// Return a texel and its right neighbour.
    #[inline(always)]
    fn pair(&self, at: usize) -> [u32; 2] {
        let pair = &self.texels[at..at + 2];
        [pair[0], pair[1]]
    }

    /// Look up the nearest texels.
    ///
    /// Texels are loaded one by one. What goes before and comes after is done in loops of its own,
    /// which compilers turn into SIMD.
    #[inline(always)]
    fn nearest(&self, u: &[f32], v: &[f32], [red, green, blue]: &mut Sums) {
        let scale = (1_u32 << self.log2_size) as f32;
        let mut texels = [0; MOST_PLACES];
        for ((index, u), v) in texels.iter_mut().zip(u).zip(v) {
            *index = self.index(fixed(u * scale - 0.5), fixed(v * scale - 0.5));
        }
        let texels = &mut texels[..u.len()];
        for texel in texels.iter_mut() {
            *texel = self.texels[*texel as usize];
        }
        for (((texel, red), green), blue) in texels.iter().zip(red).zip(green).zip(blue) {
            (*red, *green) = ((texel << 8) as u16, (texel & 0xff00) as u16);
            *blue = (texel >> 8 & 0xff00) as u16;
        }
    }

    /// Look up the mixtures of the four texels around each place; see [`Self::nearest`].
    #[inline(always)]
    fn mixed(&self, u: &[f32], v: &[f32], [red, green, blue]: &mut Sums) {
        /// Red and blue, which are multiplied together.
        const OUTER: u32 = 0x00ff_00ff;
        let scale = (256_u32 << self.log2_size) as f32;
        let (mut index, mut shares) = ([0; MOST_PLACES], [0; MOST_PLACES]);
        for (((index, share), u), v) in index.iter_mut().zip(&mut shares).zip(u).zip(v) {
            // In units of 1/256 of a texel.
            let x = fixed(u * scale).wrapping_sub(128);
            let y = fixed(v * scale).wrapping_sub(128);
            *index = self.index(x >> 8, y >> 8);
            *share = x & 255 | (y & 255) << 16;
        }
        let (mut upper, mut lower) = ([[0; 2]; MOST_PLACES], [[0; 2]; MOST_PLACES]);
        let (index, next) = (&index[..u.len()], self.size() + 1);
        for ((upper, lower), index) in upper.iter_mut().zip(&mut lower).zip(index) {
            *upper = self.pair(*index as usize);
            *lower = self.pair(*index as usize + next);
        }
        let texels = upper[..u.len()].iter().zip(&lower).zip(&shares);
        for (((([a, b], [c, d]), share), (red, green)), blue) in
            texels.zip(red.iter_mut().zip(green)).zip(blue)
        {
            let (fx, fy) = (share & 255, share >> 16);
            let wd = (fx * fy) >> 8;
            let (wc, wb) = (fy - wd, fx - wd);
            let wa = 256 - fx - wc;
            let outer = (a & OUTER) * wa + (b & OUTER) * wb + (c & OUTER) * wc + (d & OUTER) * wd;
            let [a, b, c, d] = [a >> 8 & 255, b >> 8 & 255, c >> 8 & 255, d >> 8 & 255];
            let inner = a * wa + b * wb + c * wc + d * wd;
            (*red, *green, *blue) = (outer as u16, inner as u16, (outer >> 16) as u16);
        }
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
