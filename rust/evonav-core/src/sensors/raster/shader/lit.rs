//! Lit surfaces.
//!
//! Rows are cut into runs of pixels of one face. The light is computed at every few pixels of a run
//! and interpolated, the sun's shadows at each.

use std::ops::Range;

use evonav_simd::Kernel;

use crate::{
    sensors::raster::{
        canvas::{Canvas, LANES},
        lens::{Lens, Rays},
        light::{FaceField, Light},
        shader::{
            bends::Bends,
            edges::Edges,
            response::Develop,
            runs::{Runs, spans},
            surface::Surface,
        },
    },
    textures::{MOST_PLACES, Texture},
    world::mesh::SceneMesh,
};

/// Colour above the horizon behind missing walls, and of maps' surroundings.
const SKY: [u8; 3] = [204, 222, 236];
/// Colour below the horizon where nothing is: the gaps under outer doors, which are in shade.
const GROUND: [u8; 3] = [46, 44, 42];

/// Darkness of corners, most of which is in the light.
const CORNER_SHADE: f32 = 0.08;
/// The root of the light in views without a house around them.
const EVEN: f32 = 0.85;

/// Surfaces that were seen, and working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Lit {
    bends: Bends,
    edges: Edges,
    runs: Runs,
    /// Surfaces by face, and the number of the picture for which they were prepared.
    surfaces: Vec<(u64, Surface)>,
    picture: u64,
    /// Depths of a row's pixels and of a block after them; 1 in orthographic views.
    scale: Vec<f32>,
    /// Results of [`Bends::open`].
    open: Vec<u16>,
    /// Their brightness, then grey levels, by channel.
    bright: [Vec<u16>; 3],
    packed: Vec<u32>,
    /// The runs of the row in which nothing is.
    empty: Vec<Range<usize>>,
}

/// Common to all runs of a row.
struct Shot<'a> {
    mesh: &'a SceneMesh,
    light: Option<&'a Light>,
    rays: &'a Rays,
    row: usize,
    nearness: &'a [f32],
    scale: &'a [f32],
}

impl Lit {
    pub fn shade(
        &mut self,
        mesh: &SceneMesh,
        light: Option<&Light>,
        lens: &Lens,
        canvas: &Canvas,
        rgb: &mut [u8],
    ) {
        let rays = lens.rays();
        self.picture += 1;
        self.surfaces.resize(mesh.faces.len(), Default::default());
        let length = canvas.blocks_per_row() * LANES + 2 * LANES;
        self.scale.clear();
        self.scale.resize(length, 1.0);
        self.open.resize(length, u16::MAX);
        self.bright.iter_mut().for_each(|channel| channel.resize(length, 0));
        self.packed.resize(length, 0);
        evonav_simd::compute(Rows { lit: self, mesh, light, lens, rays: &rays, canvas, rgb });
        self.edges.smooth(canvas, &self.runs, rgb);
    }

    /// Set the brightness of a row, and its empty runs.
    #[inline(always)]
    fn light(
        &mut self,
        mesh: &SceneMesh,
        light: Option<&Light>,
        lens: &Lens,
        rays: &Rays,
        canvas: &Canvas,
        row: usize,
    ) {
        let Self { runs, surfaces, scale, bright, empty, .. } = self;
        let shot = Shot { mesh, light, rays, row, nearness: canvas.row(row), scale };
        empty.clear();
        for (run, tag) in spans(runs.of_row(row), canvas.width_px) {
            let Some(index) = (tag as usize).checked_sub(1) else {
                empty.push(run);
                continue;
            };
            let (picture, surface) = &mut surfaces[index];
            if *picture != self.picture {
                (*picture, *surface) =
                    (self.picture, Surface::of(mesh, light, index, lens, rays.pixel));
            }
            shot.run(index, surface, run.clone(), bright);
            if let Some(texture) = surface.texture {
                evonav_simd::compute(Colour { shot: &shot, surface, texture, run, bright });
            }
        }
    }
}

/// Colours all rows except for the edges between faces.
struct Rows<'a> {
    lit: &'a mut Lit,
    mesh: &'a SceneMesh,
    light: Option<&'a Light>,
    lens: &'a Lens,
    rays: &'a Rays,
    canvas: &'a Canvas,
    rgb: &'a mut [u8],
}

impl Kernel for Rows<'_> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        let Self { lit, mesh, light, lens, rays, canvas, rgb } = self;
        lit.runs.find(canvas);
        for (row, pixels) in rgb.chunks_exact_mut(3 * canvas.width_px).enumerate() {
            let nearness = canvas.row(row);
            if rays.horizon_m.is_none() {
                for (scale, w) in lit.scale.iter_mut().zip(nearness) {
                    *scale = 1.0 / w;
                }
            }
            let Lit { bends, open, scale, .. } = &mut *lit;
            bends.open(canvas, row, lens.optics, scale, CORNER_SHADE, open);
            lit.light(mesh, light, lens, rays, canvas, row);
            let Lit { bright, open, packed, .. } = &mut *lit;
            Develop { bright, open, packed, pixels }.compute();
            for run in &lit.empty {
                // The ends of a run lie on one side of the horizon in level pictures.
                let colour = if rays.is_below_horizon([run.start, row]) { GROUND } else { SKY };
                pixels[3 * run.start..3 * run.end].as_chunks_mut().0.fill(colour);
            }
        }
    }
}

/// One over the number of pixels between two places; 0 if they are the same.
const SHARES: [f32; 2 * LANES + 1] = {
    let mut shares = [0.0; 2 * LANES + 1];
    let mut num = 1;
    while num < shares.len() {
        shares[num] = 1.0 / num as f32;
        num += 1;
    }
    shares
};

/// Light: without the sun, by channel, and the share of sunlight that the surface's slope takes up.
type Light4 = [f32; 4];

/// The light at a place, and its root as the surface takes it.
#[derive(Clone, Copy)]
struct End {
    light: Light4,
    rooted: [f32; 4],
}

impl End {
    #[inline(always)]
    fn at(face: Option<&FaceField<'_>>, place: [f32; 2], surface: &Surface) -> Self {
        let even = [EVEN * EVEN, EVEN * EVEN, EVEN * EVEN, 0.0];
        let light = face.map_or(even, |face| face.at(place));
        Self { light, rooted: rooted(&light, surface) }
    }
}

impl Shot<'_> {
    /// Compute the light on a run of pixels of one face, and on some after it.
    #[inline(always)]
    fn run(&self, index: usize, surface: &Surface, run: Range<usize>, bright: &mut [Vec<u16>; 3]) {
        let row = self.row as f32 + 0.5;
        let places = surface.places.map(|[du, dv, at]| [du, dv * row + at]);
        let place = |column: usize| {
            let u = column as f32 + 0.5;
            places.map(|[du, at]| (du * u + at) * self.scale[column])
        };
        let face = self.light.and_then(|light| light.field.of_face(self.mesh, index));
        let (mut first, mut from) = (run.start, place(run.start));
        let mut start = End::at(face.as_ref(), from, surface);
        while first < run.end {
            let (mut step, mut last) = (2 * LANES, (first + 2 * LANES).min(run.end - 1));
            let mut to = place(last);
            // Within a cell of the grid, light is even enough for longer steps.
            let is_far = |axis: usize| (to[axis] - from[axis]).abs() > 1.0;
            if last > first + LANES && (is_far(0) || is_far(1)) {
                (step, last) = (LANES, first + LANES);
                to = place(last);
            }
            let stop = if last > first { End::at(face.as_ref(), to, surface) } else { start };
            let columns = first..(first + step).min(run.end);
            self.between(surface, columns, [&start, &stop], SHARES[last - first], bright);
            (first, from, start) = (first + step, to, stop);
        }
    }

    /// Interpolate the light on some pixels.
    ///
    /// # Arguments
    /// * `ends` - the light at the first pixel and further on.
    /// * `share` - one over the number of pixels between the ends.
    #[inline(always)]
    fn between(
        &self,
        surface: &Surface,
        columns: Range<usize>,
        ends: [&End; 2],
        share: f32,
        bright: &mut [Vec<u16>; 3],
    ) {
        for (channel, bright) in bright.iter_mut().enumerate() {
            let ends = ends.map(|end| end.rooted[channel]);
            let block = bright[columns.start..].first_chunk_mut().expect("rows are padded");
            ramp(block, ends, share);
        }
        if ends[0].light[3] + ends[1].light[3] > 0.0 {
            self.add_sun(surface, columns, ends, share, bright);
        }
    }

    /// Add the sun to pixels that it may reach; arguments as of [`Self::between`].
    #[inline(never)]
    fn add_sun(
        &self,
        surface: &Surface,
        columns: Range<usize>,
        ends: [&End; 2],
        share: f32,
        bright: &mut [Vec<u16>; 3],
    ) {
        let Some(light) = self.light else { return };
        let sunny = ends.map(|end| {
            let sun = end.light[3];
            rooted(&std::array::from_fn(|i| end.light[i] + light.sunlight[i] * sun), surface)
        });
        for first in columns.clone().step_by(LANES) {
            let depth_m = match self.rays.horizon_m {
                None => *lanes(self.scale, first),
                // Rows of the canvas have no block after their end.
                Some(horizon_m) => std::array::from_fn(|lane| {
                    self.nearness.get(first + lane).map_or(0.0, |w| horizon_m - w)
                }),
            };
            let points_m = self.rays.points([first, self.row], &depth_m);
            let reach = light.sun.reaches(self.mesh, &points_m);
            if reach == [0.0; LANES] {
                continue;
            }
            for (channel, smooth) in bright.iter_mut().enumerate() {
                let [start, stop] = sunny.map(|end| end[channel]);
                let mut full = [0; 2 * LANES];
                ramp(&mut full, [start, stop], share);
                let full = lanes(&full, first - columns.start);
                for ((smooth, full), reach) in smooth[first..].iter_mut().zip(full).zip(&reach) {
                    *smooth += (f32::from(full.saturating_sub(*smooth)) * reach) as u16;
                }
            }
        }
    }
}

/// Multiplies the light on a run of pixels, and on some after it, by a texture.
struct Colour<'a> {
    shot: &'a Shot<'a>,
    surface: &'a Surface,
    texture: &'a Texture,
    run: Range<usize>,
    bright: &'a mut [Vec<u16>; 3],
}

impl Kernel for Colour<'_> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        let Self { shot: &Shot { rays, row, scale, .. }, surface, texture, run, bright } = self;
        let (mut u, mut v) = ([0.0; MOST_PLACES], [0.0; MOST_PLACES]);
        let mut sums = [[0; MOST_PLACES]; 3];
        let (mut first, mut end, mut level) = (run.start, run.start, 0);
        while first < run.end {
            // Blocks are looked up together while they are at the same level.
            let mut next = level;
            while end < run.end && end - first < MOST_PLACES {
                let middle = end + ((end + LANES).min(run.end - 1) - end) / 2;
                next = surface.level(texture, scale[middle], rays.length2([middle, row]));
                if end > first && next != level {
                    break;
                }
                (level, end) = (next, end + LANES);
            }
            let num = end - first;
            let uv = [&mut u[..num], &mut v[..num]];
            surface.coordinates([first, row], &scale[first..end], uv);
            texture.sample(level, &u[..num], &v[..num], &mut sums);
            for (channel, (bright, sums)) in bright.iter_mut().zip(&sums).enumerate() {
                surface.colour(channel, &sums[..num], &mut bright[first..end]);
            }
            (first, level) = (end, next);
        }
    }
}

/// Return a block of a row, from any pixel on.
#[inline(always)]
fn lanes<T>(row: &[T], first: usize) -> &[T; LANES] {
    row[first..].first_chunk().expect("rows are padded by a block")
}

/// Return the square root of light times the surface's scale, since colours are roots, too.
#[inline(always)]
fn rooted(light: &Light4, surface: &Surface) -> [f32; 4] {
    let mut rooted = [0.0; 4];
    for i in 0..4 {
        let root = light[i].sqrt() * surface.scale[i];
        rooted[i] = if root < surface.most { root } else { surface.most };
    }
    rooted
}

/// Interpolate between two numbers from 0 to 65535. Values after the second may be wrong.
///
/// Four numbers at a time are those of 16 bits in a sum of products.
#[inline(always)]
fn ramp(block: &mut [u16; 2 * LANES], [start, end]: [f32; 2], share: f32) {
    const ROUND: f32 = 12_582_912.0;
    // Whole numbers by the mantissa of a sum, which unlike a conversion needs no treatment of
    // numbers out of range.
    let whole = |value: f32| i64::from((value + ROUND).to_bits() as i32 - ROUND.to_bits() as i32);
    let (first, step) = (whole(start), whole((end - start) * share));
    let times = |value: i64, factors: i64| value.wrapping_mul(factors);
    let mut four = times(first, 0x1_0001_0001_0001).wrapping_add(times(step, 0x3_0002_0001_0000));
    let next = times(step, 0x4_0004_0004_0004);
    for values in block.as_chunks_mut::<4>().0 {
        *values = std::array::from_fn(|lane| (four >> (16 * lane)) as u16);
        four = four.wrapping_add(next);
    }
}
