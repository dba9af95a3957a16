//! Lit surfaces.
//!
//! Rows are cut into runs of pixels of one face. The light is computed at every few pixels of a run
//! and interpolated, the sun's shadows at each.

use std::ops::Range;

use crate::{
    sensors::raster::{
        canvas::{Canvas, LANES},
        lens::{Lens, Rays},
        light::Light,
        shader::{
            bends::{Bends, Shades},
            edges::Edges,
            surface::{Pair, Surface, Wide, products, wide},
        },
    },
    world::mesh::SceneMesh,
};

/// Colour above the horizon behind missing walls, and of maps' surroundings.
const SKY: [u8; 3] = [204, 222, 236];
/// Colour below the horizon where nothing is: the gaps under outer doors, which are in shade.
const GROUND: [u8; 3] = [46, 44, 42];

/// Darkness of corners, most of which is in the light.
const SHADES: Shades = Shades { corner: 0.20, line: None, is_even: true };
/// Light in views without a house around them.
const EVEN: f32 = 0.85;
/// The response `x (a + b x - c x^2)` to brightness `x`: more contrast in the middle than at both ends.
const RESPONSE: [f32; 3] = [0.80, 0.55, 0.40];
/// Brightness at which the response is greatest.
const BRIGHTEST: f32 = 1.39;
/// Exposure: brightness of a white surface in light of 1.
const EXPOSURE: f32 = 0.88;

/// Light of 1 as a number of 16 bits; light is below 8.
const LIGHT: f32 = 8192.0;
/// Brightness as a number of 16 bits, a grey level.
const BRIGHT: f32 = 32.0;

/// Surfaces that were seen, and working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Lit {
    bends: Bends,
    edges: Edges,
    /// Surfaces by face, and the number of the picture for which they were prepared.
    surfaces: Vec<(u64, Surface)>,
    picture: u64,
    /// Depth of a row's pixels, and what is left of their light in corners, [`u16::MAX`] times.
    depth_m: Vec<f32>,
    open: Vec<u16>,
    /// Colours of a row, and of the block after it.
    colours: Vec<u8>,
}

/// The parts of a view that all runs share.
struct Shot<'a> {
    light: Option<&'a Light>,
    rays: Rays,
    depth_m: &'a [f32],
    open: &'a [u16],
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
        for (row, pixels) in rgb.chunks_exact_mut(3 * canvas.width_px).enumerate() {
            self.bends.darken(canvas, row, lens.optics, SHADES);
            self.prepare(canvas, row, rays.horizon_m);
            let Self { surfaces, depth_m, open, colours, .. } = self;
            let shot = Shot { light, rays: lens.rays(), depth_m, open };
            let tags = &canvas.tags[canvas.row_blocks(row)].as_flattened()[..canvas.width_px];
            let mut start = 0;
            while start < tags.len() {
                let tag = tags[start];
                let end = start + run_length(&tags[start..]);
                if let Some(index) = (tag as usize).checked_sub(1) {
                    let (picture, surface) = &mut surfaces[index];
                    if *picture != self.picture {
                        (*picture, *surface) =
                            (self.picture, Surface::of(mesh, index, lens, shot.rays.pixel));
                    }
                    shot.run(index, surface, row, start..end, colours);
                } else {
                    // The ends of a run lie on one side of the horizon in level pictures.
                    let is_below = shot.rays.is_below_horizon([start, row]);
                    let colour = if is_below { GROUND } else { SKY };
                    colours[3 * start..3 * end].as_chunks_mut().0.fill(colour);
                }
                start = end;
            }
            pixels.copy_from_slice(&colours[..3 * canvas.width_px]);
        }
        self.edges.smooth(canvas, rgb);
    }

    /// Set the depth and the openness of a row; lanes after its end have any.
    fn prepare(&mut self, canvas: &Canvas, row: usize, horizon_m: Option<f32>) {
        let nearness = canvas.row(row);
        let length = nearness.len() + LANES;
        self.depth_m.resize(length, 1.0);
        self.open.resize(length, u16::MAX);
        self.colours.resize(3 * length + 1, 0);
        match horizon_m {
            None => {
                for (depth_m, w) in self.depth_m.iter_mut().zip(nearness) {
                    *depth_m = 1.0 / w;
                }
            }
            Some(horizon_m) => {
                for (depth_m, w) in self.depth_m.iter_mut().zip(nearness) {
                    *depth_m = horizon_m - w;
                }
            }
        }
        for (open, light) in self.open.iter_mut().zip(&self.bends.light) {
            *open = whole(light * 65535.0);
        }
    }
}

/// Return the number of equal tags at the start.
#[inline(always)]
fn run_length(tags: &[u32]) -> usize {
    let (blocks, _) = tags.as_chunks::<LANES>();
    let is_equal = |block: &&[u32; LANES]| {
        block.iter().fold(0, |different, tag| different | (tag ^ tags[0])) == 0
    };
    let whole = blocks.iter().take_while(is_equal).count() * LANES;
    whole + tags[whole..].iter().take_while(|&&tag| tag == tags[0]).count()
}

/// Return the whole number nearest to one from 0 to 65535. The mantissa of a sum with 2^23 is used,
/// which unlike a conversion needs no treatment of numbers out of range.
#[inline(always)]
fn whole(value: f32) -> u16 {
    (value + 8_388_608.0).to_bits() as u16
}

impl Shot<'_> {
    /// Compute the colours of a run of pixels of one face, and some after it.
    fn run(
        &self,
        index: usize,
        surface: &Surface,
        row: usize,
        run: Range<usize>,
        colours: &mut [u8],
    ) {
        let mut start = End::of(self.light_at(index, [run.start, row]));
        for first in run.clone().step_by(LANES) {
            let last = (first + LANES).min(run.end - 1);
            let end = match last == first {
                true => start,
                false => End::of(self.light_at(index, [last, row])),
            };
            let share = SHARES[last - first];
            let light = self.light_between([first, row], [&start, &end], share);
            let surface = surface
                .plain()
                .unwrap_or_else(|| self.textured(surface, [first, row], (last - first) / 2));
            let found = respond(&surface, &light, lanes(self.open, first));
            let colours = &mut colours[3 * first..][..3 * LANES + 1];
            for (lane, found) in found.as_chunks::<4>().0.iter().enumerate() {
                // The fourth byte is overwritten by the next pixel.
                let [red, green, blue, rest] = &mut colours[3 * lane..][..4] else {
                    unreachable!()
                };
                [*red, *green, *blue, *rest] = *found;
            }
            start = end;
        }
    }

    /// Return the colours of a block before they are lit; the face is seen around `middle`.
    #[inline(always)]
    fn textured(&self, surface: &Surface, [first, row]: [usize; 2], middle: usize) -> Wide {
        let depth_m = lanes(self.depth_m, first);
        let scale = if self.rays.horizon_m.is_some() { &[1.0; LANES] } else { depth_m };
        let length2 = self.rays.length2([first + middle, row]);
        surface.colours([first, row], scale, scale[middle], length2)
    }

    /// Return the light on a pixel of a face without the sun, by channel, and the share of
    /// sunlight that the surface's slope takes up.
    #[inline(always)]
    fn light_at(&self, index: usize, [column, row]: [usize; 2]) -> [f32; 4] {
        let Some(light) = self.light else { return [EVEN * EVEN, EVEN * EVEN, EVEN * EVEN, 0.0] };
        let point_m = self.rays.point([column, row], self.depth_m[column]);
        light.field.at(&light.field.faces[index], point_m)
    }

    /// Return the light on a block, interpolated between two places: the square root of its
    /// strength, since colours are too.
    ///
    /// # Arguments
    /// * `share` - one over the number of pixels between the places.
    #[inline(always)]
    fn light_between(&self, pixel: [usize; 2], ends: [&End; 2], share: f32) -> Wide {
        let smooth = ramp(ends.map(|end| end.rooted), share);
        let slopes = ends.map(|end| end.light[3]);
        let Some(light) = self.light.filter(|_| slopes[0] + slopes[1] > 0.0) else {
            return smooth;
        };
        let points_m = self.rays.points(pixel, lanes(self.depth_m, pixel[0]));
        let reach = light.sun.reaches(&points_m);
        if reach == [0.0; LANES] {
            return smooth;
        }
        let sunny = ends
            .map(|end| rooted(&end.light, light.sunlight.map(|channel| channel * end.light[3])));
        let sunny = ramp(sunny, share);
        if reach == [1.0; LANES] {
            return sunny;
        }
        let reach = reach.map(|share| whole(share * 65535.0));
        let (smooth, sunny) = (smooth.as_chunks::<8>().0, sunny.as_chunks::<8>().0);
        wide(|pair| {
            let (smooth, sunny) = (smooth[pair], sunny[pair]);
            let more = std::array::from_fn(|i| sunny[i].saturating_sub(smooth[i]));
            let more = products(&more, &doubled(&reach, pair));
            std::array::from_fn(|i| smooth[i] + more[i])
        })
    }
}

/// The light at an end of a block, as from [`Shot::light_at`], and the result of [`rooted`] without
/// the sun.
#[derive(Clone, Copy)]
struct End {
    light: [f32; 4],
    rooted: [f32; 4],
}

impl End {
    #[inline(always)]
    fn of(light: [f32; 4]) -> Self {
        Self { light, rooted: rooted(&light, [0.0; 4]) }
    }
}

/// One over the number of pixels between two places; 0 if they are the same.
const SHARES: [f32; LANES + 1] =
    [0.0, 1.0, 1.0 / 2.0, 1.0 / 3.0, 0.25, 0.2, 1.0 / 6.0, 1.0 / 7.0, 0.125];

/// Return a block of a row, from any pixel on.
#[inline(always)]
fn lanes<T>(row: &[T], first: usize) -> &[T; LANES] {
    row[first..].first_chunk().expect("rows are padded by a block")
}

/// Return the square root of light and sunlight, times the exposure, as numbers of 16 bits.
#[inline(always)]
fn rooted(light: &[f32; 4], sun: [f32; 4]) -> [f32; 4] {
    let mut rooted = [0.0; 4];
    for i in 0..4 {
        let root = (light[i] + sun[i]).max(0.0).sqrt();
        rooted[i] = (root * (EXPOSURE * LIGHT)).min(65535.0);
    }
    rooted
}

/// Interpolate between two places.
#[inline(always)]
fn ramp([start, end]: [[f32; 4]; 2], share: f32) -> Wide {
    let (mut first, mut step) = ([0_u16; 4], [0_u16; 4]);
    for i in 0..4 {
        first[i] = whole(start[i]);
        // A negative step is one modulo 2^16.
        step[i] = ((end[i] - start[i]) * share + 12_582_912.0).to_bits() as u16;
    }
    let next: [u16; 4] = std::array::from_fn(|i| first[i].wrapping_add(step[i]));
    let first = beside(first, next);
    let twice = beside(step, step).map(|step| step.wrapping_mul(2));
    wide(|pair| {
        let num = pair as u16;
        std::array::from_fn(|i| first[i].wrapping_add(twice[i].wrapping_mul(num)))
    })
}

/// Return the channels of two pixels.
#[inline(always)]
fn beside([a, b, c, d]: [u16; 4], [e, f, g, h]: [u16; 4]) -> Pair {
    [a, b, c, d, e, f, g, h]
}

/// Return the numbers of a pair of pixels, for each of their channels.
#[inline(always)]
fn doubled(of_pixels: &[u16; LANES], pair: usize) -> Pair {
    let (left, right) = (of_pixels[2 * pair], of_pixels[2 * pair + 1]);
    beside([left; 4], [right; 4])
}

/// Return the colours of a lit surface as a camera responds to them.
///
/// It is not inlined: compilers would take the blocks, which come from several branches, apart into
/// single numbers.
#[inline(never)]
fn respond(surface: &Wide, light: &Wide, open: &[u16; LANES]) -> [u8; 4 * LANES] {
    const MOST: u16 = (BRIGHTEST * 255.0 * BRIGHT) as u16;
    const WHITE: u16 = (255.0 * BRIGHT) as u16;
    /// The response to brightness of 1 as a number of 16 bits, and factors that make brightness
    /// and the result of squaring it such a number.
    const ONE: f32 = 8192.0;
    const LINEAR: u16 = (RESPONSE[1] * ONE / (255.0 * BRIGHT) * 65536.0) as u16;
    const SQUARE: u16 =
        (RESPONSE[2] * ONE * 4096.0 / (255.0 * BRIGHT * 255.0 * BRIGHT) * 65536.0) as u16;
    let (surface, light) = (surface.as_chunks().0, light.as_chunks().0);
    let levels = wide(|pair| {
        let surface: &Pair = &surface[pair];
        let light = products(&light[pair], &doubled(open, pair));
        let bright = products(&surface.map(|colour| 2 * colour), &light);
        let bright = bright.map(|bright| bright.min(MOST));
        let fourfold = bright.map(|bright| 4 * bright);
        let square = products(&products(&fourfold, &fourfold), &[SQUARE; 8]);
        let linear = products(&bright, &[LINEAR; 8]);
        let response: Pair =
            std::array::from_fn(|i| 2 * ((RESPONSE[0] * ONE) as u16 + linear[i] - square[i]));
        let level = products(&fourfold, &response);
        level.map(|level| (level.min(WHITE) + 16) >> 5)
    });
    levels.map(|level| level as u8)
}
