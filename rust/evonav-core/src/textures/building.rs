//! Draw the textures of floors, walls and worktops: wood, tiles, bricks, stone and plaster.

use crate::textures::{
    noise::{fract, fractal, hash, line, mix, noise, ramp, random, wave},
    texture::Texel,
};

/// Return a texel that makes a surface darker or lighter, whatever its colour.
#[inline(always)]
pub fn grey(factor: f32) -> Texel {
    [factor, factor, factor, 1.0]
}

/// Return the lightness of wood whose grain runs along u; `[u, v]` repeat every 1.
#[inline(always)]
pub fn grain(u: f32, v: f32, seed: u32) -> f32 {
    let bend = fractal(u, v, [2, 3], 3, seed);
    let rings = wave(7.0 * v + 2.2 * bend);
    let streaks = fractal(u, v, [2, 32], 3, seed + 7);
    let pores = noise(u, v, [8, 64], seed + 13);
    1.0 + 0.016 * rings + 0.13 * (streaks - 0.5) + 0.04 * (pores - 0.5)
}

#[inline(always)]
pub fn wood(u: f32, v: f32, seed: u32) -> Texel {
    let g = grain(u, v, seed);
    // Dark grain is redder than light grain.
    [1.0 + 0.85 * (g - 1.0), g, 1.0 + 1.15 * (g - 1.0), 1.0]
}

#[inline(always)]
pub fn planks(u: f32, v: f32, seed: u32) -> Texel {
    let rows = 8.0;
    let row = (v * rows) as u32;
    let along = fract(u + random(row, 1, seed));
    let board = (2.0 * along) as u32;
    let tone = random(row, board + 2, seed) - 0.5;
    let across = fract(v * rows);
    let [du, dv] = [fract(2.0 * along), across].map(|t| t.min(1.0 - t));
    // A board is 1.2 m long and 15 cm wide; a joint is 4 mm wide.
    let joint = line(du * 1.2, 0.005).max(line(dv * 0.15, 0.005));
    let shift = random(row, board, seed + 5);
    let g = grain(fract(u + shift), fract(v + shift), seed + hash(row, board, 3) % 3);
    let light = (g + 0.1 * tone) * (1.0 - 0.25 * joint);
    [light * (1.0 + 0.03 * tone), light, light * (1.0 - 0.04 * tone), 1.0 - 0.5 * joint]
}

#[inline(always)]
pub fn parquet(u: f32, v: f32, seed: u32) -> Texel {
    let [x, y] = [(u * 4.0) as u32, (v * 4.0) as u32];
    let is_turned = (x + y) % 2 == 1;
    let (along, across) = if is_turned { (v, u) } else { (u, v) };
    let board = (fract(4.0 * across) * 4.0) as u32;
    let tone = random(4 * x + board, 4 * y + board, seed) - 0.5;
    let edge = |t: f32| fract(t).min(1.0 - fract(t));
    let joint = line(edge(4.0 * along) * 0.24, 0.005).max(line(edge(16.0 * across) * 0.06, 0.004));
    let g = grain(fract(along + 0.3 * tone), fract(across + 0.3 * tone), seed);
    grey((g + 0.1 * tone) * (1.0 - 0.19 * joint))
}

/// Return tiles in a grid of `columns` x `rows`, with joints of a share of a tile's height;
/// neighbouring rows are shifted by a share of a tile.
#[inline(always)]
fn grid(u: f32, v: f32, [columns, rows]: [u32; 2], joint: f32, shift: f32, seed: u32) -> Tile {
    let row = (v * rows as f32) as u32;
    let x = fract(u + shift * (row % 2) as f32 / columns as f32) * columns as f32;
    let column = x as u32;
    let [fu, fv] = [fract(x), fract(v * rows as f32)];
    let aspect = rows as f32 / columns as f32;
    let distance = (fu.min(1.0 - fu) * aspect).min(fv.min(1.0 - fv));
    Tile { tone: random(column, row, seed) - 0.5, joint: line(distance, joint), at: [fu, fv] }
}

/// A point on a tile.
struct Tile {
    /// Random number of the tile, from -0.5 to 0.5.
    tone: f32,
    /// 1 in the joint between tiles, 0 on them.
    joint: f32,
    /// Place on the tile.
    at: [f32; 2],
}

/// Return a tile of a colour that varies by `spread`, with grout of another lightness.
#[inline(always)]
fn tile(tile: &Tile, spread: f32, grout: f32) -> Texel {
    let [_, v] = tile.at;
    let bevel = 0.05 * (ramp(0.88, 0.95, 1.0 - v) - ramp(0.88, 0.95, v));
    let light = mix(1.0 + spread * tile.tone + bevel, grout, tile.joint);
    [light, light, light, 1.0 - 0.8 * tile.joint]
}

#[inline(always)]
pub fn slabs(u: f32, v: f32, seed: u32) -> Texel {
    let place = grid(u, v, [4, 4], 0.022, 0.0, seed);
    let stone = marble(fract(u + place.tone), fract(v - place.tone), seed);
    let drawn = tile(&place, 0.04, 0.85);
    std::array::from_fn(|i| drawn[i] * mix(stone[i], 1.0, 0.4 + 0.6 * place.joint))
}

#[inline(always)]
pub fn tiles(u: f32, v: f32, seed: u32) -> Texel {
    let mottled = 1.0 + 0.05 * (fractal(u, v, [8, 8], 3, seed) - 0.5);
    let drawn = tile(&grid(u, v, [4, 4], 0.05, 0.0, seed), 0.05, 0.91);
    drawn.map(|channel| channel * mottled)
}

#[inline(always)]
pub fn mosaic(u: f32, v: f32, seed: u32) -> Texel {
    tile(&grid(u, v, [8, 8], 0.11, 0.0, seed), 0.1, 0.9)
}

#[inline(always)]
pub fn subway(u: f32, v: f32, seed: u32) -> Texel {
    tile(&grid(u, v, [4, 8], 0.08, 0.5, seed), 0.03, 0.87)
}

#[inline(always)]
pub fn checkerboard(u: f32, v: f32, seed: u32) -> Texel {
    let place = grid(u, v, [4, 4], 0.03, 0.0, seed);
    let is_dark = ((u * 4.0) as u32 + (v * 4.0) as u32) % 2 == 1;
    let light = if is_dark { 0.45 } else { 1.5 };
    tile(&place, 0.05, 0.9).map(|channel| channel * light)
}

#[inline(always)]
pub fn hexagons(u: f32, v: f32, seed: u32) -> Texel {
    // Two interleaved grids of centres; the nearest one counts. Tiles are 8 cm wide.
    let [x, y] = [u * 6.0, v * 6.0 * 0.866_025_4];
    let near = |ox: f32, oy: f32| {
        let row = 1.732_050_8;
        let [cx, cy] = [((x - ox) + 0.5).floor() + ox, ((y - oy) / row + 0.5).floor() * row + oy];
        [x - cx, y - cy, cx, cy]
    };
    let [a, b] = [near(0.0, 0.0), near(0.5, 0.866_025_4)];
    let far = |p: &[f32; 4]| p[0] * p[0] + p[1] * p[1];
    let [dx, dy, cx, cy] = if far(&a) < far(&b) { a } else { b };
    let reach = dx.abs().max(0.5 * dx.abs() + 0.866_025_4 * dy.abs());
    let cell = |c: f32, count: i32| ((2.0 * c + 0.5) as i32).rem_euclid(count) as u32;
    let tone = random(cell(cx, 12), cell(cy / 0.866_025_4, 12), seed) - 0.5;
    grey(mix(1.0 + 0.07 * tone, 0.86, line(0.5 - reach, 0.05)))
}

/// Return the distances to the nearest and second nearest of random points, and the number of the
/// nearest one.
#[inline(always)]
fn cells(u: f32, v: f32, count: u32, seed: u32) -> [f32; 3] {
    let [x, y] = [u * count as f32, v * count as f32];
    let (mut first, mut second, mut nearest) = (9.0_f32, 9.0_f32, 0.0);
    for dy in 0..3 {
        for dx in 0..3 {
            let [cx, cy] =
                [(x as u32 + dx + count - 1) % count, (y as u32 + dy + count - 1) % count];
            let px = (x as u32 + dx) as f32 - 1.0 + random(cx, cy, seed) - x;
            let py = (y as u32 + dy) as f32 - 1.0 + random(cx, cy, seed + 1) - y;
            let distance = px * px + py * py;
            if distance < first {
                (second, first, nearest) = (first, distance, random(cx, cy, seed + 2));
            } else if distance < second {
                second = distance;
            }
        }
    }
    [first.sqrt(), second.sqrt(), nearest]
}

#[inline(always)]
pub fn shards(u: f32, v: f32, seed: u32) -> Texel {
    let [first, second, tone] = cells(u, v, 8, seed);
    grey(mix(0.94 + 0.12 * tone, 0.8, line(second - first, 0.16)))
}

#[inline(always)]
pub fn brick(u: f32, v: f32, seed: u32) -> Texel {
    let place = grid(u, v, [4, 8], 0.16, 0.5, seed);
    let rough = fractal(u, v, [24, 16], 3, seed) - 0.5;
    let light = 1.0 + 0.2 * place.tone + 0.14 * rough;
    let shadow = 0.08 * ramp(0.82, 0.92, place.at[1]);
    // Mortar is greyer than bricks, so that red falls more than green and blue.
    let mortar = [1.05, 1.14, 1.18].map(|m| m * (1.0 + 0.12 * rough));
    let rgb = mortar.map(|m| mix(light - shadow, m, place.joint));
    [rgb[0], rgb[1], rgb[2], 1.0]
}

#[inline(always)]
pub fn concrete(u: f32, v: f32, seed: u32) -> Texel {
    let clouds = fractal(u, v, [3, 3], 5, seed) - 0.5;
    let pores = noise(u, v, [90, 90], seed + 9);
    grey(1.0 + 0.14 * clouds - 0.06 * ramp(0.88, 0.97, pores))
}

#[inline(always)]
pub fn plaster(u: f32, v: f32, seed: u32) -> Texel {
    let clouds = fractal(u, v, [3, 3], 3, seed) - 0.5;
    let rough = fractal(u, v, [48, 48], 2, seed + 4) - 0.5;
    grey(1.0 + 0.015 * clouds + 0.014 * rough)
}

#[inline(always)]
pub fn marble(u: f32, v: f32, seed: u32) -> Texel {
    let clouds = fractal(u, v, [3, 3], 4, seed) - 0.5;
    // Veins run where noise crosses its middle, along a slant, and are seen in places only.
    let bend_u = fractal(u, v, [4, 4], 5, seed + 5) - 0.5;
    let bend_v = fractal(u, v, [4, 4], 5, seed + 6) - 0.5;
    let [x, y] = [fract(u + 0.16 * bend_u), fract(v + 0.16 * bend_v)];
    let seen = ramp(0.4, 0.75, fractal(u, v, [3, 3], 2, seed + 9));
    let strong = line(noise(fract(x + y), y, [2, 3], seed + 3) - 0.5, 0.03);
    let fine = line(noise(fract(x + y), y, [3, 5], seed + 4) - 0.5, 0.02);
    let veins = 0.55 * strong + 0.35 * fine;
    let light = 1.0 + 0.08 * clouds - 0.13 * seen * veins - 0.05 * veins;
    [light, light, light + 0.01 * seen * veins, 1.0]
}

#[inline(always)]
pub fn granite(u: f32, v: f32, seed: u32) -> Texel {
    let grains = random((u * 64.0) as u32, (v * 64.0) as u32, seed) - 0.5;
    let clusters = fractal(u, v, [12, 12], 3, seed + 2) - 0.5;
    grey(1.0 + 0.14 * grains + 0.18 * clusters)
}
