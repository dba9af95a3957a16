//! Draw the textures of cloth, leather, paper, leaves and of what is made of them.

use crate::textures::{
    building::grey,
    noise::{fract, fractal, hash, line, mix, noise, ramp, random, wave},
    texture::Texel,
};

#[inline(always)]
pub fn carpet(u: f32, v: f32, seed: u32) -> Texel {
    let tufts = random((u * 96.0) as u32, (v * 96.0) as u32, seed) - 0.5;
    let worn = fractal(u, v, [4, 4], 4, seed + 3) - 0.5;
    grey(1.0 + 0.1 * tufts + 0.08 * worn)
}

#[inline(always)]
pub fn fabric(u: f32, v: f32, seed: u32) -> Texel {
    let threads = 24.0;
    let weave = wave(threads * u) * wave(threads * v);
    let slubs = fractal(u, v, [3, 24], 2, seed) + fractal(u, v, [24, 3], 2, seed + 1) - 1.0;
    grey(1.0 + 0.04 * weave + 0.1 * slubs)
}

#[inline(always)]
pub fn leather(u: f32, v: f32, seed: u32) -> Texel {
    let pores = fractal(u, v, [40, 40], 2, seed) - 0.5;
    let folds = fractal(u, v, [4, 3], 4, seed + 1) - 0.5;
    let light = 1.0 + 0.14 * pores + 0.2 * folds;
    [light, light, light, 1.0 + 0.5 * folds]
}

#[inline(always)]
pub fn metal(u: f32, v: f32, seed: u32) -> Texel {
    let brush = fractal(u, v, [2, 64], 2, seed) - 0.5;
    let clouds = noise(u, v, [3, 2], seed + 3) - 0.5;
    grey(1.0 + 0.07 * brush + 0.05 * clouds)
}

#[inline(always)]
pub fn paper(u: f32, v: f32, seed: u32) -> Texel {
    grey(1.0 + 0.06 * (fractal(u, v, [8, 8], 4, seed) - 0.5))
}

#[inline(always)]
pub fn soil(u: f32, v: f32, seed: u32) -> Texel {
    grey(1.0 + 0.9 * (fractal(u, v, [16, 16], 3, seed) - 0.5))
}

#[inline(always)]
pub fn wicker(u: f32, v: f32, seed: u32) -> Texel {
    let [x, y] = [(u * 12.0) as u32, (v * 12.0) as u32];
    let is_over = (x + y) % 2 == 0;
    let t = if is_over { fract(12.0 * v) } else { fract(12.0 * u) };
    let round = 4.0 * t * (1.0 - t);
    grey(0.75 + 0.4 * round + 0.1 * (random(x, y, seed) - 0.5))
}

/// Return leaves that lie over each other.
#[inline(always)]
pub fn leaves(u: f32, v: f32, seed: u32) -> Texel {
    let (mut light, mut top) = (0.62, -1.0);
    let count = 5_u32;
    let [x, y] = [u * count as f32, v * count as f32];
    for dy in 0..3 {
        for dx in 0..3 {
            let [column, row] = [x as u32 + dx, y as u32 + dy];
            let [cx, cy] = [(column + count - 1) % count, (row + count - 1) % count];
            let at = |k: u32| random(cx, cy, seed + k);
            let [px, py] = [x - column as f32 + 1.0 - at(1), y - row as f32 + 1.0 - at(2)];
            let [sin, cos] = [wave(at(3)), wave(at(3) + 0.25)];
            let [along, across] = [px * cos + py * sin, py * cos - px * sin];
            let width = 0.36 * (1.0 - along * along * 1.6).max(0.0);
            if across.abs() < width && at(4) > top {
                top = at(4);
                let rib = 1.0 + 0.25 * line(across, 0.05);
                let side = if across > 0.0 { 1.08 } else { 0.92 };
                light = (0.8 + 0.45 * at(4))
                    * rib
                    * side
                    * (1.0 - 0.3 * ramp(0.6, 1.0, across.abs() / width));
            }
        }
    }
    let yellow = 0.12 * (top.max(0.0) - 0.5);
    [light * (1.0 + yellow), light, light * (1.0 - yellow), 1.0]
}

/// Return one of six printed patterns: stripes, checks, dots, flowers, diamonds and plain linen.
#[inline(always)]
pub fn bedding(u: f32, v: f32, seed: u32) -> Texel {
    let linen = 1.0 + 0.06 * (fractal(u, v, [12, 12], 3, seed) - 0.5);
    let edge = |t: f32| ramp(0.45, 0.5, t) - ramp(0.95, 1.0, t);
    let printed = match seed % 6 {
        0 => edge(fract(8.0 * u)),
        1 => 0.5 * (edge(fract(6.0 * u)) + edge(fract(6.0 * v))),
        2 => {
            let row = (8.0 * v) as u32;
            let [x, y] = [fract(8.0 * u + 0.5 * (row % 2) as f32), fract(8.0 * v)];
            let [x, y] = [x - 0.5, y - 0.5];
            1.0 - ramp(0.06, 0.09, x * x + y * y)
        }
        3 => leaves(u, v, seed)[1] - 0.6,
        4 => line(fract(4.0 * (u + v)) - 0.5, 0.12).max(line(fract(4.0 * (u - v)) - 0.5, 0.12)),
        _ => 0.0,
    };
    // Prints are lighter and less colourful than the cloth.
    let strength = if seed & 8 == 0 { 0.34 } else { -0.26 };
    let [r, g, b] = [0.8, 1.0, 1.15].map(|c| linen * (1.0 + strength * printed * c));
    [r, g, b, 1.0]
}

/// Return the light on something soft that bulges: lighter in the middle and above, dark at its
/// edges.
#[inline(always)]
fn bulge(u: f32, v: f32) -> f32 {
    let [x, y] = [u, v].map(|t| (4.0 * t * (1.0 - t)).clamp(0.0, 1.0));
    let edge = ramp(0.0, 0.5, x.min(y));
    0.8 + 0.22 * edge + 0.05 * (0.5 - v)
}

/// Return folds: soft creases in the directions that `seed` chooses.
#[inline(always)]
fn folds(u: f32, v: f32, seed: u32) -> f32 {
    let bend = fractal(u, v, [3, 3], 3, seed);
    let slant = random(seed, 1, 9) - 0.5;
    let crease = wave(2.0 * (u + slant * v) + 1.3 * bend);
    let fine = wave(5.0 * (v + slant * u) + 2.0 * bend);
    let strength = ramp(0.3, 0.8, fractal(u, v, [2, 2], 2, seed + 5));
    0.6 * crease * strength + 0.4 * fine * (1.0 - strength)
}

#[inline(always)]
pub fn cushion(u: f32, v: f32, seed: u32) -> Texel {
    let border = u.min(1.0 - u).min(v).min(1.0 - v);
    let seam = line(border - 0.045, 0.02);
    let threads = fabric(fract(2.0 * u), fract(2.0 * v), seed)[0];
    grey(bulge(u, v) * threads * (1.0 - 0.22 * seam) * (1.0 + 0.035 * folds(u, v, seed)))
}

#[inline(always)]
pub fn pillow(u: f32, v: f32, seed: u32) -> Texel {
    grey(bulge(u, v) * (1.0 + 0.05 * folds(u, v, seed)))
}

#[inline(always)]
pub fn duvet(u: f32, v: f32, seed: u32) -> Texel {
    let turned = 0.15;
    let shade = 1.0 + 0.05 * folds(u, v, seed) + 0.03 * folds(v, u, seed + 3);
    let edge = ramp(0.0, 0.04, u.min(1.0 - u).min(1.0 - v));
    let light = shade * (0.86 + 0.14 * edge);
    if v < turned {
        // The turned edge shows the lighter lining.
        let round = 1.0 - 0.16 * ramp(0.6, 1.0, v / turned);
        return [1.42 * light * round, 1.4 * light * round, 1.36 * light * round, 1.0];
    }
    let shadow = 1.0 - 0.3 * (1.0 - ramp(turned, turned + 0.03, v));
    let printed = bedding(fract(2.0 * u), fract(2.5 * v), seed);
    let quilted = line(fract(4.0 * u) - 0.5, 0.03).max(line(fract(5.0 * v) - 0.5, 0.03));
    let quilt = if seed.is_multiple_of(2) { 1.0 - 0.1 * quilted } else { 1.0 };
    [0, 1, 2, 3].map(|i| printed[i] * light * shadow * quilt)
}

#[inline(always)]
pub fn rug(u: f32, v: f32, seed: u32) -> Texel {
    let border = u.min(1.0 - u).min(v).min(1.0 - v);
    let tufts = carpet(fract(4.0 * u), fract(4.0 * v), seed);
    let band = (border < 0.14) as u32 + (border < 0.11) as u32 + (border < 0.05) as u32;
    let tone = mix(0.6, 1.5, random(band, seed % 16, 77));
    let field = match hash(seed, 1, 1) % 3 {
        0 => 1.0,
        1 => mix(0.75, 1.3, ramp(0.0, 0.1, wave(4.0 * u) * wave(4.0 * v))),
        _ => mix(0.8, 1.25, line(fract(3.0 * (u + v)) - 0.5, 0.3)),
    };
    let light = if band == 0 { tone * field } else { tone };
    tufts.map(|channel| channel * light)
}
