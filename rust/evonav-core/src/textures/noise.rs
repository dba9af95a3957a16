//! Noise that repeats, from whole numbers and basic arithmetic alone: the same on every platform.

/// Scramble whole numbers to a whole number.
#[inline(always)]
pub fn hash(x: u32, y: u32, seed: u32) -> u32 {
    let mut h = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77);
    h = (h ^ seed.wrapping_mul(0xc2b2_ae3d)).wrapping_add(0x27d4_eb2f);
    h = (h ^ h >> 15).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ h >> 12).wrapping_mul(0x297a_2d39);
    h ^ h >> 15
}

/// Return a number between 0 and 1 for whole numbers.
#[inline(always)]
pub fn random(x: u32, y: u32, seed: u32) -> f32 {
    (hash(x, y, seed) >> 8) as f32 / 16_777_216.0
}

/// Return smooth noise between 0 and 1 at `[u, v]`, which repeats every 1 in both directions.
///
/// # Arguments
/// * `cells` - number of random values from 0 to 1 in each direction.
#[inline(always)]
pub fn noise(u: f32, v: f32, cells: [u32; 2], seed: u32) -> f32 {
    let [(x0, x1, fx), (y0, y1, fy)] = [lattice(u, cells[0]), lattice(v, cells[1])];
    let at = |x: u32, y: u32| random(x, y, seed);
    mix(mix(at(x0, y0), at(x1, y0), fx), mix(at(x0, y1), at(x1, y1), fx), fy)
}

/// Return the cells before and after a coordinate, and the smoothed distance from the first.
#[inline(always)]
fn lattice(u: f32, cells: u32) -> (u32, u32, f32) {
    let scaled = fract(u) * cells as f32;
    let cell = (scaled as u32).min(cells - 1);
    let t = scaled - cell as f32;
    // A division would take longer than all else.
    let next = if cell + 1 < cells { cell + 1 } else { 0 };
    (cell, next, t * t * (3.0 - 2.0 * t))
}

/// Return the sum of `octaves` of noise, 1 to 5, each twice as fine and half as strong, between 0
/// and 1.
#[inline(always)]
pub fn fractal(u: f32, v: f32, cells: [u32; 2], octaves: u32, seed: u32) -> f32 {
    // A loop in the loop over samples would keep compilers from SIMD.
    let sum = 0.0;
    let sum = if octaves > 0 { sum + octave(u, v, cells, 0, seed) } else { sum };
    let sum = if octaves > 1 { sum + octave(u, v, cells, 1, seed) } else { sum };
    let sum = if octaves > 2 { sum + octave(u, v, cells, 2, seed) } else { sum };
    let sum = if octaves > 3 { sum + octave(u, v, cells, 3, seed) } else { sum };
    let sum = if octaves > 4 { sum + octave(u, v, cells, 4, seed) } else { sum };
    // 1 + 1/2 + 1/4 and so on.
    let finest = (1 << octaves) as f32;
    sum / (2.0 - 2.0 / finest)
}

/// Return one octave of noise at its strength.
#[inline(always)]
fn octave(u: f32, v: f32, cells: [u32; 2], octave: u32, seed: u32) -> f32 {
    let [columns, rows] = cells;
    let cells = [columns << octave, rows << octave];
    let weight = 1.0 / (1 << octave) as f32;
    weight * noise(u, v, cells, seed.wrapping_add(101 * octave))
}

/// Return the part of a number after its whole part, from 0 to 1.
#[inline(always)]
pub fn fract(value: f32) -> f32 {
    let rest = value - value as i32 as f32;
    if rest < 0.0 { rest + 1.0 } else { rest }
}

/// Return the number between `a` and `b` at a share of the way.
#[inline(always)]
pub fn mix(a: f32, b: f32, share: f32) -> f32 {
    a + (b - a) * share
}

/// Return the colour between two others at a share of the way.
#[inline(always)]
pub fn blend(a: [f32; 3], b: [f32; 3], share: f32) -> [f32; 3] {
    std::array::from_fn(|i| mix(a[i], b[i], share))
}

/// Return 0 up to `from`, 1 beyond `to` and a smooth ramp between.
#[inline(always)]
pub fn ramp(from: f32, to: f32, value: f32) -> f32 {
    let t = ((value - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Return a wave between -1 and 1 of period 1, close to the sine.
#[inline(always)]
pub fn wave(value: f32) -> f32 {
    let t = fract(value);
    let half = if t < 0.5 { t } else { t - 0.5 };
    let arch = 16.0 * half * (0.5 - half);
    if t < 0.5 { arch } else { -arch }
}

/// Return how dark and light a groove or an edge `width` wide is at a distance from it: 1 on it, 0
/// beyond.
#[inline(always)]
pub fn line(distance: f32, width: f32) -> f32 {
    1.0 - ramp(0.5 * width, width, distance.abs())
}
