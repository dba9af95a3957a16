//! Draw paintings, photographs and views out of windows by seed.

use crate::textures::{
    noise::{blend, fract, fractal, hash, mix, noise, ramp, random},
    texture::Texel,
};

type Colour = [f32; 3];

/// Return a colour from 0 to 1.
#[inline(always)]
pub fn rgb(red: u8, green: u8, blue: u8) -> Colour {
    [red, green, blue].map(|channel| f32::from(channel) / 255.0)
}

/// Return a painting or photograph; every third one lies on a pale mount.
#[inline(always)]
pub fn painting(u: f32, v: f32, seed: u32) -> Texel {
    let (mut u, mut v) = (u, v);
    if seed % 3 == 2 {
        let border = u.min(1.0 - u).min(v).min(1.0 - v);
        if border < 0.1 {
            let edge = 1.0 - 0.12 * ramp(0.08, 0.1, border);
            return [0.92 * edge, 0.91 * edge, 0.88 * edge, 1.0];
        }
        (u, v) = ((u - 0.1) / 0.8, (v - 0.1) / 0.8);
    }
    let drawn = match hash(seed, 0, 8) % 6 {
        0 | 1 => landscape(u, v, seed),
        2 => seascape(u, v, seed),
        3 => portrait(u, v, seed),
        4 => flowers(u, v, seed),
        _ => abstraction(u, v, seed),
    };
    let strokes = fractal(u, v, [20, 28], 2, seed + 40) - 0.5;
    let [r, g, b] = drawn.map(|c| (c * (1.0 + 0.22 * strokes)).clamp(0.0, 1.0));
    [r, g, b, 1.0]
}

/// Return the colour of a sky, at a height from 0 (the horizon) to 1.
#[inline(always)]
fn sky(u: f32, height: f32, seed: u32) -> Colour {
    let skies = [
        (rgb(228, 224, 205), rgb(120, 165, 210)),
        (rgb(245, 190, 120), rgb(110, 120, 170)),
        (rgb(205, 210, 215), rgb(140, 160, 185)),
        (rgb(90, 105, 140), rgb(28, 38, 78)),
    ];
    let (low, high) = skies[(hash(seed, 1, 8) % 4) as usize];
    let clouds = ramp(0.52, 0.72, fractal(fract(u), fract(height), [3, 6], 4, seed + 11));
    blend(blend(low, high, height), blend(low, [1.0; 3], 0.5), 0.6 * clouds)
}

#[inline(always)]
fn landscape(u: f32, v: f32, seed: u32) -> Colour {
    let horizon = 0.4 + 0.15 * random(seed, 1, 1);
    let trunk = 0.2 + 0.6 * random(seed, 3, 1);
    let [x, y] = [(u - trunk) / 0.16, (v - 0.5) / 0.2];
    let has_tree = hash(seed, 4, 8).is_multiple_of(2);
    if has_tree && x * x + y * y - 0.4 < 0.8 {
        let crown = x * x + y * y + 0.8 * (fractal(u, v, [9, 9], 3, seed) - 0.5);
        if crown < 0.8 {
            return rgb(62, 84, 42).map(|c| c * (1.35 - 0.5 * (x + y)));
        }
    }
    // The nearest layer of hills that is as high hides the others.
    let greens = [rgb(126, 142, 160), rgb(92, 120, 100), rgb(88, 112, 58), rgb(128, 120, 62)];
    for layer in (0..4_u32).rev() {
        let top_of =
            |rough: f32| horizon + 0.13 * layer as f32 + 0.22 * rough / (1.0 + 0.6 * layer as f32);
        if v <= top_of(-0.5) {
            continue;
        }
        let top = top_of(fractal(fract(u), 0.1, [3 + layer, 1], 4, seed + 20 + layer) - 0.5);
        if v > top {
            let shade = mix(1.1, 0.62, ((v - top) * 2.2).min(1.0));
            let tufts = fractal(u, v, [10 + 6 * layer, 12], 3, seed + 30) - 0.5;
            return greens[layer as usize].map(|c| c * (shade + 0.3 * tufts));
        }
    }
    let colour = sky(u, (1.0 - v / horizon).clamp(0.0, 1.0), seed);
    let sun = [u - 0.2 - 0.6 * random(seed, 2, 1), v - 0.2];
    let glow = 1.0 - ramp(0.002, 0.006, sun[0] * sun[0] + sun[1] * sun[1]);
    blend(colour, rgb(255, 240, 190), 0.9 * glow)
}

#[inline(always)]
fn seascape(u: f32, v: f32, seed: u32) -> Colour {
    let horizon = 0.45;
    if v < horizon {
        return sky(u, 1.0 - v / horizon, seed);
    }
    let depth = (v - horizon) / (1.0 - horizon);
    let waves = noise(fract(u), v, [6, 40], seed + 3) - 0.5;
    let shore = depth > 0.72 + 0.12 * (fractal(fract(u), 0.3, [3, 1], 3, seed) - 0.5);
    if shore {
        return rgb(206, 184, 142).map(|c| c * (0.95 + 0.15 * waves));
    }
    let sail = [(u - 0.3 - 0.4 * random(seed, 5, 1)) / 0.05, (v - 0.42) / 0.12];
    if sail[1] > -1.0 && sail[1] < 0.4 && sail[0].abs() < 0.5 * (sail[1] + 1.0) {
        return rgb(238, 234, 225);
    }
    blend(rgb(120, 160, 180), rgb(38, 84, 112), depth).map(|c| c * (1.0 + 0.3 * waves))
}

#[inline(always)]
fn portrait(u: f32, v: f32, seed: u32) -> Colour {
    let pick = |k: u32| random(seed, k, 7);
    let ground = blend(rgb(70, 82, 72), rgb(160, 138, 110), pick(1));
    let lit = 1.25 - 0.6 * ((u - 0.35) * (u - 0.35) + (v - 0.3) * (v - 0.3)) * 2.0;
    let oval = |cx: f32, cy: f32, rx: f32, ry: f32| {
        let [x, y] = [(u - cx) / rx, (v - cy) / ry];
        x * x + y * y
    };
    let skin = blend(rgb(236, 196, 164), rgb(140, 92, 64), pick(2));
    let hair = blend(rgb(40, 30, 26), rgb(176, 126, 70), pick(3));
    let dress = [0, 1, 2].map(|i| 0.15 + 0.6 * pick(4 + i));
    let side = 1.12 - 0.5 * (u - 0.42).max(0.0) * 2.0;
    let eye = oval(0.435, 0.37, 0.025, 0.014).min(oval(0.565, 0.37, 0.025, 0.014));
    let mouth = oval(0.5, 0.475, 0.05, 0.014);
    if eye < 1.0 {
        rgb(40, 34, 34)
    } else if mouth < 1.0 {
        rgb(160, 82, 76)
    } else if oval(0.5, 0.4, 0.135, 0.17) < 1.0 && v > 0.3 {
        skin.map(|c| c * side)
    } else if oval(0.5, 0.36, 0.18, 0.2) < 1.0
        || (oval(0.5, 0.5, 0.19, 0.24) < 1.0 && pick(9) > 0.5)
    {
        hair.map(|c| c * side)
    } else if (u - 0.5).abs() < 0.065 && v > 0.4 && v < 0.68 {
        skin.map(|c| 0.82 * c * side)
    } else if oval(0.5, 1.02, 0.42, 0.4) < 1.0 {
        dress.map(|c| c * side)
    } else {
        ground.map(|c| c * lit)
    }
}

#[inline(always)]
fn flowers(u: f32, v: f32, seed: u32) -> Colour {
    let ground = if v > 0.78 { rgb(128, 92, 62) } else { rgb(205, 196, 172) };
    let light = 1.1 - 0.35 * v;
    let mut colour = ground.map(|c| c * light);
    let [x, y] = [(u - 0.5) / 0.13, (v - 0.72) / 0.15];
    if x * x + y * y < 1.0 {
        colour = rgb(80, 110, 150).map(|c| c * (1.15 - 0.35 * x));
    }
    for k in 0..26_u32 {
        let at = |i: u32| random(k, i, seed);
        let [cx, cy] = [0.22 + 0.56 * at(1), 0.12 + 0.46 * at(2)];
        let [x, y] = [u - cx, v - cy];
        let radius = 0.05 + 0.045 * at(3);
        let distance = (x * x + y * y).sqrt() / radius;
        if distance >= 1.0 {
            continue; // beyond the longest petals
        }
        let petals = 1.0 - 0.3 * noise(fract(0.5 + x / radius), fract(0.5 + y / radius), [4, 4], k);
        if distance < petals {
            let hues = [rgb(214, 90, 96), rgb(238, 196, 92), rgb(236, 226, 220), rgb(76, 110, 62)];
            let hue = hues[(hash(k, 4, seed) % 4) as usize];
            colour = blend(hue, hue.map(|c| 0.55 * c), distance * distance);
        }
    }
    colour
}

#[inline(always)]
fn abstraction(u: f32, v: f32, seed: u32) -> Colour {
    let palettes = [
        [rgb(232, 222, 200), rgb(196, 74, 52), rgb(40, 66, 92), rgb(226, 174, 74)],
        [rgb(226, 226, 222), rgb(60, 62, 66), rgb(150, 152, 156), rgb(196, 146, 108)],
        [rgb(224, 214, 190), rgb(92, 128, 120), rgb(206, 130, 92), rgb(58, 74, 84)],
    ];
    let palette = palettes[(hash(seed, 5, 8) % 3) as usize];
    if hash(seed, 6, 8).is_multiple_of(2) {
        // Rectangles of two levels.
        let [cu, cv] = [1, 2].map(|k| 0.25 + 0.5 * random(seed, k, 3));
        let [x, y] = [u32::from(u > cu), u32::from(v > cv)];
        let [s, t] = [random(x + 2 * y, 1, seed), random(x + 2 * y, 2, seed)];
        let finer = u32::from(fract(u * 2.0) > s) + 2 * u32::from(fract(v * 2.0) > t);
        return palette[(hash(x + 2 * y, finer, seed) % 4) as usize];
    }
    let bend = fractal(u, v, [2, 2], 3, seed);
    palette[((6.0 * bend + 2.0 * v) as usize + (hash(seed, 7, 8) % 4) as usize) % 4]
}

/// Return the world outside a window: sky, hills or houses far away, trees and a lawn.
#[inline(always)]
pub fn outdoors(u: f32, v: f32, seed: u32) -> Texel {
    if v > 0.84 {
        let lawn = blend(rgb(142, 172, 98), rgb(116, 150, 84), (v - 0.84) * 6.0);
        return [lawn[0], lawn[1], lawn[2], 1.0];
    }
    let clouds = ramp(0.5, 0.75, fractal(u, v, [2, 5], 4, seed));
    let mut colour = blend(rgb(150, 192, 228), rgb(222, 232, 238), (1.2 * v).min(1.0));
    colour = blend(colour, rgb(244, 246, 248), 0.75 * clouds);
    let hill = 0.62 + 0.1 * (fractal(u, 0.2, [3, 1], 3, seed + 1) - 0.5);
    if v > hill {
        colour = rgb(150, 172, 176);
    }
    let column = (6.0 * u) as u32;
    let roof = 0.56 + 0.16 * random(column, 1, seed);
    if seed.is_multiple_of(3) && v > roof && v < 0.78 {
        let walls = blend(rgb(214, 200, 178), rgb(176, 128, 104), random(column, 2, seed));
        let pane = fract(18.0 * u).min(1.0 - fract(18.0 * u)) > 0.25 && fract(14.0 * v) > 0.5;
        colour = if pane { rgb(106, 122, 138) } else { walls };
    }
    let tree = 0.66 + 0.24 * (fractal(u, 0.7, [5, 1], 4, seed + 2) - 0.5);
    if v > tree {
        let leafy = fractal(u, v, [14, 14], 3, seed + 3);
        colour = blend(rgb(74, 104, 62), rgb(150, 176, 110), leafy);
    }
    [colour[0], colour[1], colour[2], 1.0]
}
