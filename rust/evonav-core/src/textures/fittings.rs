//! Draw what is on the fronts of things: panels, drawers, screens, keys, covers and dials.

use crate::textures::{
    building::{grain, grey},
    cloth::metal,
    noise::{blend, fract, fractal, hash, line, mix, noise, ramp, random},
    pictures::{painting, rgb},
    texture::Texel,
};

/// Return the distance from the nearest border, as a share of the side.
#[inline(always)]
fn border(u: f32, v: f32) -> f32 {
    u.min(1.0 - u).min(v).min(1.0 - v)
}

/// Return a colour of a picture, with its gloss.
#[inline(always)]
fn pixel([red, green, blue]: [f32; 3]) -> Texel {
    [red, green, blue, 1.0]
}

/// Return the light on a slanted rim `width` wide: dark above and left, light below and right if
/// the middle lies deeper, the other way round if `depth` is negative; 1 in the middle.
#[inline(always)]
fn rim(u: f32, v: f32, width: f32, depth: f32) -> f32 {
    if border(u, v) > width {
        return 1.0;
    }
    let [left, right, above, below] = [u, 1.0 - u, v, 1.0 - v];
    let nearest = left.min(right).min(above).min(below);
    let slope = if nearest == above {
        -1.0
    } else if nearest == below {
        1.0
    } else if nearest == left {
        -0.55
    } else {
        0.55
    };
    1.0 + depth * slope
}

#[inline(always)]
pub fn panel(u: f32, v: f32, seed: u32) -> Texel {
    let fibres = 1.0 + 0.45 * (grain(v, u, seed) - 1.0);
    let gap = line(border(u, v), 0.018);
    let outer = rim(u, v, 0.05, -0.12);
    let is_inner = border(u, v) > 0.1;
    let [s, t] = [(u - 0.1) / 0.8, (v - 0.1) / 0.8];
    let inner = if is_inner { rim(s, t, 0.06, 0.22) } else { 1.0 };
    grey(fibres * outer * inner * (1.0 - 0.45 * gap))
}

#[inline(always)]
pub fn drawer(u: f32, v: f32, seed: u32) -> Texel {
    let fibres = 1.0 + 0.45 * (grain(u, v, seed) - 1.0);
    let gap = line(border(u, v), 0.03);
    grey(fibres * rim(u, v, 0.055, -0.13) * (1.0 - 0.5 * gap) * (1.03 - 0.06 * v))
}

#[inline(always)]
pub fn appliance(u: f32, v: f32, seed: u32) -> Texel {
    let sheen = noise(u, 0.0, [3, 1], seed) - 0.5;
    let gap = line(border(u, v), 0.02);
    let brushed = metal(v, u, seed);
    brushed.map(|c| c * (1.0 + 0.16 * sheen) * (1.04 - 0.08 * v) * (1.0 - 0.4 * gap))
}

#[inline(always)]
pub fn oven_door(u: f32, v: f32, _seed: u32) -> Texel {
    let frame = ramp(0.05, 0.07, border(u, v));
    let reflection = 0.10 * ramp(0.0, 0.5, 1.0 - (u + v)) + 0.03 * (1.0 - v);
    let racks = 0.05 * line(fract(5.0 * v) - 0.5, 0.08) * ramp(0.12, 0.2, border(u, v));
    let glass = 0.1 + reflection + racks;
    pixel(blend(rgb(52, 52, 56), [glass, glass, 1.06 * glass], frame))
}

#[inline(always)]
pub fn hob(u: f32, v: f32, seed: u32) -> Texel {
    let [x, y] = [fract(2.0 * u) - 0.5, fract(2.0 * v) - 0.5];
    let quarter = (2.0 * u) as u32 + 2 * (2.0 * v) as u32;
    let radius = 0.26 + 0.1 * random(quarter, seed % 2, 5);
    let distance = (x * x + y * y).sqrt();
    let ring = line(distance - radius, 0.05).max(0.6 * line(distance - 0.6 * radius, 0.04));
    let plate = 0.05 * (1.0 - ramp(radius - 0.02, radius, distance));
    pixel(blend(rgb(30, 30, 33), rgb(165, 165, 170), (0.55 * ring + plate).min(1.0)))
}

#[inline(always)]
pub fn dark_screen(u: f32, v: f32, _seed: u32) -> Texel {
    let inner = ramp(0.016, 0.022, border(u, v));
    let sheen = 0.14 * ramp(0.0, 0.9, 1.05 - u - 0.8 * v) + 0.035 * (1.0 - v);
    let glass = [0.075 + 0.85 * sheen, 0.085 + 0.95 * sheen, 0.105 + 1.1 * sheen];
    pixel(blend(rgb(38, 38, 41), glass, inner))
}

#[inline(always)]
pub fn lit_screen(u: f32, v: f32, seed: u32) -> Texel {
    let shown = painting(u, v, 3 * (seed % 8) + 1);
    let inner = ramp(0.016, 0.022, border(u, v));
    let bright = [0, 1, 2].map(|i| (0.12 + 1.05 * shown[i]).min(1.0));
    pixel(blend(rgb(38, 38, 41), bright, inner))
}

#[inline(always)]
pub fn keyboard(u: f32, v: f32, _seed: u32) -> Texel {
    let row = (5.0 * v) as u32;
    let x = fract(14.0 * u + 0.35 * row as f32);
    let is_space = row == 4 && u > 0.28 && u < 0.66;
    let y = fract(5.0 * v);
    let side = if is_space { 0.5 } else { x.min(1.0 - x) };
    let key = ramp(0.1, 0.16, side.min(y.min(1.0 - y)));
    let letter = 0.25 * line(x - 0.5, 0.3) * line(y - 0.45, 0.3) * f32::from(!is_space);
    pixel(blend(rgb(24, 24, 26), rgb(72, 73, 77), key * (1.0 + letter)))
}

/// Return the cover of a book: a title, a name and a block or bands, lighter or darker than it.
#[inline(always)]
pub fn cover(u: f32, v: f32, seed: u32) -> Texel {
    let spine = 1.0 - 0.25 * line(u - 0.06, 0.03);
    let is_light = hash(seed, 2, 2).is_multiple_of(2);
    let print = if is_light { [1.7, 1.7, 1.6] } else { [0.45, 0.45, 0.5] };
    let text = |top: f32, height: f32, width: f32| {
        let inside = (u - 0.53).abs() < 0.5 * width && v > top && v < top + height;
        f32::from(inside) * ramp(0.25, 0.4, noise(u, v, [34, 12], seed))
    };
    let title = text(0.12, 0.07, 0.62).max(text(0.22, 0.07, 0.45)).max(text(0.86, 0.04, 0.4));
    let is_block = u > 0.2 && u < 0.86 && v > 0.38 && v < 0.78;
    let figure = match hash(seed, 3, 3) % 3 {
        0 => f32::from(is_block) * 0.7,
        1 => f32::from(is_block) * ramp(0.45, 0.55, fractal(u, v, [4, 4], 3, seed)),
        _ => f32::from(v > 0.55 && v < 0.66) * 0.8,
    };
    let share = title.max(figure);
    let tints = [random(seed, 1, 4), random(seed, 2, 4), random(seed, 3, 4)];
    let ink: [f32; 3] = std::array::from_fn(|i| print[i] * mix(0.75, 1.1, tints[i]));
    let [r, g, b] = blend([1.0; 3], ink, share).map(|c| c * spine);
    [r, g, b, 1.0]
}

#[inline(always)]
pub fn pages(u: f32, v: f32, seed: u32) -> Texel {
    grey(1.0 + 0.12 * (noise(u, v, [1, 48], seed) - 0.5))
}

/// Return a printed page: headlines, columns of text and pictures.
#[inline(always)]
pub fn print(u: f32, v: f32, seed: u32) -> Texel {
    let paper = rgb(232, 229, 219);
    let column = (3.0 * u) as u32;
    let [x, y] = [fract(3.0 * u), v];
    let is_margin = border(u, v) < 0.04 || !(0.06..=0.94).contains(&x);
    let is_title = v > 0.05 && v < 0.13 && u > 0.1 && u < 0.9;
    let from = 0.2 + 0.4 * random(column, seed, 6);
    let is_photo = y > from && y < from + 0.2 && column != seed % 3;
    let lines = ramp(0.3, 0.5, fract(34.0 * v)) * ramp(0.2, 0.35, noise(u, v, [40, 34], seed));
    let ink = if is_title {
        0.75 * ramp(0.3, 0.45, noise(u, v, [22, 2], seed + 1))
    } else if is_margin || v < 0.16 {
        0.0
    } else if is_photo {
        mix(0.25, 0.75, fractal(u, v, [5, 5], 4, seed + 2))
    } else {
        0.42 * lines
    };
    pixel(blend(paper, rgb(60, 58, 58), ink))
}

#[inline(always)]
pub fn clock_face(u: f32, v: f32, seed: u32) -> Texel {
    let [x, y] = [u - 0.5, v - 0.5];
    let radius = (x * x + y * y).sqrt();
    let hand = |hx: f32, hy: f32, length: f32| {
        let along = x * hx + y * hy;
        f32::from(along > -0.03 && along < length) * line(x * hy - y * hx, 0.035)
    };
    let hands = hand(0.6, -0.8, 0.26).max(hand(-0.866, -0.5, 0.36));
    // Twelve marks: two directions of a square grid turned by 30 degrees each.
    let marks = [(1.0, 0.0), (0.866, 0.5), (0.5, 0.866)]
        .into_iter()
        .map(|(c, s): (f32, f32)| line(x * s - y * c, 0.03).max(line(x * c + y * s, 0.03)))
        .fold(0.0, f32::max)
        * (ramp(0.36, 0.38, radius) - ramp(0.44, 0.46, radius));
    let face = if seed.is_multiple_of(2) { rgb(240, 240, 234) } else { rgb(225, 230, 235) };
    pixel(blend(face, rgb(30, 30, 34), hands.max(marks).max(line(radius - 0.48, 0.03))))
}
