//! A drawing aid: parts are given by their start and end inside an asset's box.

use std::ops::Range;

pub use crate::assets::shapes::motion::{Along, Motion};
use crate::{
    assets::{
        Asset,
        material::{Material, hash_of_name},
        part::{Part, Primitive, aabb_of},
        shapes::{
            colour::{self, Paint},
            motion::move_part,
            shape::{Detail, Shape, ShapeTraits},
        },
    },
    geometry::{IDENTITY, Mat3, Vec3, add, euler_rotation_deg, rotate},
    house::Condition,
};

/// Start and end along one axis, metres.
pub type Span = [f64; 2];
/// The whole box along one axis, in fractions of it.
pub const ALL: Span = [0.0, 1.0];

/// Parts that move, and the state in which they are drawn.
struct Moving {
    parts: Range<usize>,
    trim: Range<usize>,
    motion: Motion,
    is_drawn_open: bool,
}

/// The parts drawn so far in an asset's box. x and z are centred on 0, y starts at the floor (0).
pub struct Sketch<'a> {
    asset: &'a Asset,
    condition: Condition,
    size_m: Vec3,
    shape: Shape,
    moving: Vec<Moving>,
    traits: ShapeTraits,
}

impl<'a> Sketch<'a> {
    pub fn new(asset: &'a Asset, condition: Condition) -> Self {
        let positive = |edge: f64| if edge.is_finite() { edge.max(1e-3) } else { 1e-3 };
        let size_m = asset.size_m.map(positive);
        Self {
            asset,
            condition,
            size_m,
            shape: Shape::default(),
            moving: Vec::new(),
            traits: ShapeTraits::default(),
        }
    }

    /// Return the known state: closed or open, on or off.
    pub fn condition(&self) -> Condition {
        self.condition
    }

    /// Return whether the asset is known not to be closed, so that parts inside show.
    pub fn is_ajar(&self) -> bool {
        self.condition.openness.is_some_and(|openness| openness > 0.0)
    }

    /// Record parts that `draw` draws closed and that move by `motion` when the object is fully
    /// open.
    pub fn opening(&mut self, motion: Motion, draw: impl FnOnce(&mut Self)) {
        self.record(motion, false, draw);
    }

    /// Record parts that `draw` draws open and that move by `motion` when the object is closed.
    pub fn closing(&mut self, motion: Motion, draw: impl FnOnce(&mut Self)) {
        self.record(motion, true, draw);
    }

    fn record(&mut self, motion: Motion, is_drawn_open: bool, draw: impl FnOnce(&mut Self)) {
        let [first, first_trim] = [self.shape.parts.len(), self.shape.trim.len()];
        draw(self);
        let Shape { parts, trim } = &self.shape;
        let (parts, trim) = (first..parts.len(), first_trim..trim.len());
        self.moving.push(Moving { parts, trim, motion, is_drawn_open });
    }

    /// Record what `draw` draws as trim: see [`Shape::trim`]. It is clamped to the asset's box, too.
    pub fn trim(&mut self, draw: impl FnOnce(&mut Self)) {
        self.shape.swap();
        draw(self);
        self.shape.swap();
    }

    pub fn asset(&self) -> &'a Asset {
        self.asset
    }

    /// Return width, height and depth.
    pub fn size(&self) -> Vec3 {
        self.size_m
    }

    /// Return the spans of the whole box along x, y and z.
    pub fn spans(&self) -> [Span; 3] {
        let [w, h, d] = self.size_m;
        [[-0.5 * w, 0.5 * w], [0.0, h], [-0.5 * d, 0.5 * d]]
    }

    /// Return the heights within the box at which objects stand, ascending. Of two heights less
    /// than 8 cm apart only the lower counts: recorded children hover up to 5 cm over their
    /// surface.
    pub fn levels(&self) -> Vec<f64> {
        let mut levels: Vec<f64> = Vec::new();
        for &level in &self.asset.surfaces_m {
            let level = level.min(self.size_m[1]);
            if level > 0.0 && levels.last().is_none_or(|&last| level - last >= 0.08) {
                levels.push(level);
            }
        }
        levels
    }

    /// Return the asset's colour number `index`, or `otherwise` if it has none.
    pub fn tint(&self, index: usize, otherwise: Paint) -> Paint {
        colour::tint(self.asset, index, otherwise)
    }

    /// Choose one of `choices`, always the same for the same asset.
    pub fn choose<T: Copy>(&self, choices: &[T], otherwise: T) -> T {
        let index = hash_of_name(&self.asset.id) as usize % choices.len().max(1);
        choices.get(index).copied().unwrap_or(otherwise)
    }

    /// Return the spans between fractions of the box's width, height and depth.
    fn fractions(&self, x: Span, y: Span, z: Span) -> [Span; 3] {
        let [width, height, depth] = self.spans();
        [(width, x), (height, y), (depth, z)].map(|(span, [from, to])| between(span, from, to))
    }

    /// Draw a cuboid between fractions of the box's width, height and depth.
    pub fn cuboid_at(&mut self, x: Span, y: Span, z: Span, paint: Paint) {
        let [x, y, z] = self.fractions(x, y, z);
        self.cuboid(x, y, z, paint);
    }

    /// Draw a [`Sketch::column`] between fractions of the box's width, height and depth.
    pub fn column_at(&mut self, x: Span, y: Span, z: Span, taper: f64, sides: u8, paint: Paint) {
        self.round(Along::Y, taper, sides, self.fractions(x, y, z), paint);
    }

    /// Draw an ellipsoid between fractions of the box's width, height and depth.
    pub fn ellipsoid_at(&mut self, x: Span, y: Span, z: Span, paint: Paint) {
        let [x, y, z] = self.fractions(x, y, z);
        self.ellipsoid(x, y, z, paint);
    }

    /// Draw a [`Sketch::blob`] between fractions of the box's width, height and depth.
    pub fn blob_at(&mut self, x: Span, y: Span, z: Span, paint: Paint) {
        let [x, y, z] = self.fractions(x, y, z);
        self.blob(x, y, z, paint);
    }

    /// Draw a rim: cuboids `thick` wide at both ends of the spans along `axes`, the second pair
    /// between the first.
    pub fn rim(&mut self, spans: [Span; 3], axes: [usize; 2], thick: f64, paint: Paint) {
        let mut rest = spans;
        for axis in axes {
            for end in ends(spans[axis], thick, 0.0) {
                rest[axis] = end;
                self.cuboid(rest[0], rest[1], rest[2], paint);
            }
            rest[axis] = inside(spans[axis], thick);
        }
    }

    pub fn cuboid(&mut self, x: Span, y: Span, z: Span, paint: Paint) {
        let spans = self.clamped([x, y, z]);
        let half_m = spans.map(|[low, high]| 0.5 * (high - low));
        self.push(Primitive::Cuboid { half_m }, spans, IDENTITY, paint);
    }

    /// Draw a cuboid with cut edges, for trim.
    pub fn pad(&mut self, x: Span, y: Span, z: Span, cut_m: f64, paint: Paint) {
        let spans = self.clamped([x, y, z]);
        let half_m = spans.map(|[low, high]| 0.5 * (high - low));
        self.push(Primitive::Pad { half_m, cut_m }, spans, IDENTITY, paint);
    }

    /// Draw a leaf, a thin six-sided plate, for trim. A leaf that would leave the box is left out.
    ///
    /// # Arguments
    /// * `root_m` - where it begins; y from the floor.
    /// * `turn_deg` - its direction, from +x towards +z.
    /// * `rise_deg` - its slope, 90 is upwards.
    /// * `size_m` - length and width.
    pub fn leaf(
        &mut self,
        root_m: Vec3,
        turn_deg: f64,
        rise_deg: f64,
        size_m: [f64; 2],
        paint: Paint,
    ) {
        let half_m = size_m.map(|edge| 0.5 * edge);
        let rotation = euler_rotation_deg([0.0, -turn_deg, rise_deg]);
        let along = rotate(&rotation, [half_m[0], 0.0, 0.0]);
        let root_m = [root_m[0], root_m[1] - 0.5 * self.size_m[1], root_m[2]];
        let part = Part {
            primitive: Primitive::Frustum {
                bottom_m: half_m,
                top_m: half_m,
                half_height_m: 0.0015,
                sides: 6,
            },
            centre_m: add(root_m, along),
            rotation,
            colour: colour::lit(paint.colour),
            material: Material::named(paint.kind, &self.asset.id),
        };
        let (bounds, half) = (part.aabb(), self.size_m.map(|edge| 0.48 * edge));
        if (0..3).all(|i| bounds.max_m[i] <= half[i] && bounds.min_m[i] >= -half[i]) {
            self.shape.parts.push(part);
        }
    }

    /// Draw one cuboid that fills the box.
    pub fn block(&mut self, paint: Paint) {
        let [x, y, z] = self.spans();
        self.cuboid(x, y, z, paint);
    }

    pub fn ellipsoid(&mut self, x: Span, y: Span, z: Span, paint: Paint) {
        let spans = self.clamped([x, y, z]);
        let half_m = spans.map(|[low, high]| 0.5 * (high - low));
        self.push(Primitive::Ellipsoid { half_m }, spans, IDENTITY, paint);
    }

    /// Draw a round part with half the triangles of an ellipsoid: two frusta base to base.
    pub fn blob(&mut self, x: Span, y: Span, z: Span, paint: Paint) {
        let middle = 0.45 * y[1] + 0.55 * y[0];
        self.column(x, [y[0], middle], z, 1.8, 8, paint);
        self.column(x, [middle, y[1]], z, 0.5, 8, paint);
    }

    /// Draw an upright cylinder (`taper` 1) or cone; see [`Sketch::round`].
    pub fn column(&mut self, x: Span, y: Span, z: Span, taper: f64, sides: u8, paint: Paint) {
        self.round(Along::Y, taper, sides, [x, y, z], paint);
    }

    /// Draw an upright cylinder of radius `radius` about `[x, z]`.
    pub fn pole(&mut self, centre: [f64; 2], radius: f64, y: Span, sides: u8, paint: Paint) {
        let [x, z] = centre.map(|c| [c - radius, c + radius]);
        self.column(x, y, z, 1.0, sides, paint);
    }

    /// Draw a cylinder (`taper` 1) or cone whose far end along its axis is `taper` times as wide as
    /// its near end; the spans enclose the wider end.
    pub fn round(&mut self, along: Along, taper: f64, sides: u8, spans: [Span; 3], paint: Paint) {
        let spans = self.clamped(spans);
        let half = spans.map(|[low, high]| 0.5 * (high - low));
        // The columns of the rotations are the directions of the part's own x, y and z.
        let (half_height_m, across, rotation): (f64, [f64; 2], Mat3) = match along {
            Along::Y => (half[1], [half[0], half[2]], IDENTITY),
            Along::X => {
                (half[0], [half[1], half[2]], [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
            }
            Along::Z => {
                (half[2], [half[0], half[1]], [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
            }
        };
        let scaled = |factor: f64| across.map(|a| a * factor);
        let (bottom_m, top_m) =
            if taper <= 1.0 { (across, scaled(taper)) } else { (scaled(1.0 / taper), across) };
        let primitive = Primitive::Frustum { bottom_m, top_m, half_height_m, sides };
        self.push(primitive, spans, rotation, paint);
    }

    /// Draw four square uprights, `thick` wide, at the corners of the box, `inset` from its sides.
    pub fn legs(&mut self, y: Span, thick: f64, inset: f64, paint: Paint) {
        let [x, _, z] = self.spans();
        for x in ends(x, thick, inset) {
            for z in ends(z, thick, inset) {
                self.cuboid(x, y, z, paint);
            }
        }
    }

    /// Clamp spans to the box.
    fn clamped(&self, spans: [Span; 3]) -> [Span; 3] {
        let all = self.spans();
        std::array::from_fn(|i| spans[i].map(|end| end.clamp(all[i][0], all[i][1])))
    }

    fn push(&mut self, primitive: Primitive, spans: [Span; 3], rotation: Mat3, paint: Paint) {
        if spans.iter().any(|[low, high]| high - low <= 1e-9) {
            return;
        }
        let [x, y, z] = spans.map(|[low, high]| 0.5 * (low + high));
        let centre_m = [x, y - 0.5 * self.size_m[1], z];
        let colour = colour::lit(paint.colour);
        let material = Material::named(paint.kind, &self.asset.id);
        self.shape.parts.push(Part { primitive, centre_m, rotation, colour, material });
    }

    /// Record the form.
    pub fn form(&mut self, form: &'static str) {
        self.traits.form = Some(form);
    }

    /// Record a drawn part, unless `count` is 0.
    pub fn detail(&mut self, noun: &'static str, count: usize) {
        if count > 0 {
            self.traits.details.push(Detail { noun, count });
        }
    }

    /// Return the recorded traits.
    pub fn into_traits(self) -> ShapeTraits {
        self.traits
    }

    /// Finish the shape: stretch the drawn parts slightly so that they fill the box, then move them
    /// to their places in the asset's state.
    pub fn finish(mut self) -> Shape {
        if self.shape.parts.is_empty() {
            self.block(colour::rgb(160, 150, 140));
        }
        let Shape { mut parts, mut trim } = self.shape;
        let drawn = aabb_of(&parts);
        let (middle, size) = (drawn.centre_m(), drawn.size_m());
        let is_full = |i: usize| (size[i] - self.size_m[i]).abs() < 1e-9 && middle[i].abs() < 1e-9;
        if !(0..3).all(is_full) {
            let scale: Vec3 = std::array::from_fn(|i| self.size_m[i] / size[i]);
            for part in parts.iter_mut().chain(&mut trim) {
                stretch(part, middle, scale);
            }
        }
        if let Some(openness) = self.condition.openness {
            for moving in self.moving {
                let share = if moving.is_drawn_open { 1.0 - openness } else { openness };
                let parts = parts.get_mut(moving.parts).into_iter().flatten();
                let trim = trim.get_mut(moving.trim).into_iter().flatten();
                for part in parts.chain(trim) {
                    move_part(part, &moving.motion, share, 0.5 * self.size_m[1]);
                }
            }
        }
        Shape { parts, trim }
    }
}

/// Return the two pieces of a span `thick` long that end `inset` before its ends.
pub fn ends(span: Span, thick: f64, inset: f64) -> [Span; 2] {
    let [low, high] = [span[0] + inset, span[1] - inset];
    let thick = thick.min(0.5 * (high - low));
    [[low, low + thick], [high - thick, high]]
}

/// Return the span without `by` at both ends.
pub fn inside(span: Span, by: f64) -> Span {
    let by = by.min(0.49 * (span[1] - span[0]));
    [span[0] + by, span[1] - by]
}

/// Return piece `index` of `count` equal pieces of a span.
pub fn piece(span: Span, index: usize, count: usize) -> Span {
    let n = count as f64;
    between(span, index as f64 / n, (index as f64 + 1.0) / n)
}

/// Return the part of a span between two fractions of it.
pub fn between(span: Span, from: f64, to: f64) -> Span {
    let length = span[1] - span[0];
    [span[0] + from * length, span[0] + to * length]
}

/// Scale a part whose rotation maps axes to axes, about `middle`, which moves to the origin.
fn stretch(part: &mut Part, middle: Vec3, scale: Vec3) {
    part.centre_m = std::array::from_fn(|i| (part.centre_m[i] - middle[i]) * scale[i]);
    // The part's own axis j points along the box's axis i where rotation[i][j] is 1 or -1.
    let own = |j: usize| (0..3).map(|i| part.rotation[i][j].powi(2) * scale[i]).sum::<f64>();
    let [x, y, z] = [own(0), own(1), own(2)];
    match &mut part.primitive {
        Primitive::Cuboid { half_m }
        | Primitive::Ellipsoid { half_m }
        | Primitive::Pad { half_m, .. } => {
            *half_m = [half_m[0] * x, half_m[1] * y, half_m[2] * z];
        }
        Primitive::Frustum { bottom_m, top_m, half_height_m, .. } => {
            *bottom_m = [bottom_m[0] * x, bottom_m[1] * z];
            *top_m = [top_m[0] * x, top_m[1] * z];
            *half_height_m *= y;
        }
    }
}
