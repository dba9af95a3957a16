//! Transform a scene to the image: find the parts in view, and project their corners.

use std::ops::Range;

use crate::{
    geometry::{Aabb, Mat3, Vec2, Vec3, rotate, sub},
    sensors::{
        camera::{Camera, View},
        raster::{canvas::LANES, frustum::Frustum},
    },
    world::mesh::{Face, Layer, dot},
};

/// Working memory: parts in view, vertices of the current part and corners of the current face.
#[derive(Debug, Clone, Default)]
pub(super) struct Scratch {
    pub visible: Vec<(f64, u32)>,
    pub local_m: Vec<Vec3>,
    pub projected_px: Vec<Vec2>,
    pub clipped_m: Vec<Vec3>,
    pub polygon_px: Vec<Vec2>,
}

/// The relation between image points and depth.
///
/// The canvas stores a *nearness*, which is linear in the image on every plane: inverse depth in a
/// perspective view, [`Lens::horizon_m`] minus depth in an orthographic one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Optics {
    /// A perspective view; `focal_px` is pixels per metre at depth 1.
    Perspective { focal_px: f64 },
    /// An orthographic view, with the same pixels per metre at any depth.
    Orthographic { pixels_per_m: f64 },
}

/// A view, prepared for drawing.
pub(super) struct Lens {
    axes: Mat3,
    pub eye_m: Vec3,
    pub optics: Optics,
    centre_px: Vec2,
    pub clip_m: Vec2,
    frustum: Frustum,
}

impl Lens {
    pub fn new(view: &View) -> Self {
        let axes = view.axes();
        let Camera { height_px, position_m: eye_m, .. } = view.camera;
        let ([near_m, far_m], [u, v]) = (view.clip_m, view.camera.centre_px());
        let optics = match view.half_height_m {
            None => Optics::Perspective { focal_px: view.camera.focal_px() },
            Some(half_m) => Optics::Orthographic { pixels_per_m: height_px as f64 / 2.0 / half_m },
        };
        // A border is where the image coordinate equals half the size: `focal_px x = u z`, or
        // `pixels_per_m x = u`.
        let (scale, [slope_u, slope_v], [least_u, least_v]) = match optics {
            Optics::Perspective { focal_px } => (focal_px, [u, v], [0.0; 2]),
            Optics::Orthographic { pixels_per_m } => (pixels_per_m, [0.0; 2], [-u, -v]),
        };
        let local = [
            ([0.0, 0.0, 1.0], near_m),
            ([0.0, 0.0, -1.0], -far_m),
            ([scale, 0.0, slope_u], least_u),
            ([-scale, 0.0, slope_u], least_u),
            ([0.0, scale, slope_v], least_v),
            ([0.0, -scale, slope_v], least_v),
        ];
        let mut lens = Self {
            axes,
            eye_m,
            optics,
            centre_px: [u, v],
            clip_m: view.clip_m,
            frustum: Frustum::default(),
        };
        for (index, (normal, least)) in local.into_iter().enumerate() {
            lens.frustum.set(index, lens.to_world(normal), least);
        }
        lens
    }

    fn to_world(&self, local: Vec3) -> Vec3 {
        std::array::from_fn(|i| (0..3).map(|j| self.axes[j][i] * local[j]).sum::<f64>())
    }

    /// Restrict a perspective view to some pixels and to a depth.
    pub fn narrow(&mut self, columns: &Range<usize>, rows: &Range<usize>, far_m: f64) {
        let Optics::Perspective { focal_px } = self.optics else { return };
        // The outer borders of the first and the last pixel, with one more pixel for rounding.
        let [low, high] = [[columns.start, rows.start], [columns.end, rows.end]];
        let slope = |axis: usize, at_px: f64| at_px - self.centre_px[axis];
        let low = [0, 1].map(|axis| slope(axis, low[axis] as f64 - 1.0));
        let high = [0, 1].map(|axis| slope(axis, high[axis] as f64 + 1.0));
        let local = [
            ([0.0, 0.0, -1.0], -far_m.min(self.clip_m[1])),
            ([focal_px, 0.0, -low[0]], 0.0),
            ([-focal_px, 0.0, high[0]], 0.0),
            ([0.0, focal_px, -low[1]], 0.0),
            ([0.0, -focal_px, high[1]], 0.0),
        ];
        for (index, (normal, least)) in local.into_iter().enumerate() {
            self.frustum.set(index + 1, self.to_world(normal), least);
        }
    }

    /// Return the depth of nearness 0 in an orthographic view. It is beyond the far plane, so that
    /// every nearness is positive.
    pub fn horizon_m(&self) -> f64 {
        self.clip_m[1] + 1.0
    }

    /// Return the nearness of the far plane.
    pub fn far_nearness(&self) -> f32 {
        match self.optics {
            Optics::Perspective { .. } => (1.0 / self.clip_m[1]) as f32,
            Optics::Orthographic { .. } => (self.horizon_m() - self.clip_m[1]) as f32,
        }
    }

    #[inline(always)]
    pub fn to_image(&self, local_m: Vec3) -> Vec2 {
        let scale = match self.optics {
            Optics::Perspective { focal_px } => focal_px / local_m[2],
            Optics::Orthographic { pixels_per_m } => pixels_per_m,
        };
        [self.centre_px[0] + scale * local_m[0], self.centre_px[1] + scale * local_m[1]]
    }

    /// Return whether a part of the box may be in view.
    #[inline(always)]
    pub fn may_see(&self, aabb: &Aabb) -> bool {
        self.frustum.may_contain(sub(aabb.centre_m(), self.eye_m), aabb.size_m())
    }

    /// Collect the parts in view, nearest first. Where the box of a body is not in view, its parts are
    /// not looked at.
    #[inline(always)]
    pub fn collect_visible(&self, layer: Layer<'_>, visible: &mut Vec<(f64, u32)>) {
        visible.clear();
        for body in layer.bodies {
            // An adaptor of iterators is not compiled for wide vectors.
            if !self.may_see(&body.aabb) {
                continue;
            }
            for index in body.parts.clone() {
                let aabb = &layer.parts[index].aabb;
                if body.parts.len() == 1 || self.may_see(aabb) {
                    visible.push((self.nearest_m(aabb), index as u32));
                }
            }
        }
        visible.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }

    /// Return the smallest planar depth of the box.
    #[inline(always)]
    fn nearest_m(&self, aabb: &Aabb) -> f64 {
        let forward = self.axes[2];
        let corner: Vec3 =
            std::array::from_fn(|k| if forward[k] > 0.0 { aabb.min_m[k] } else { aabb.max_m[k] });
        dot(forward, sub(corner, self.eye_m))
    }

    /// Return the columns and rows of pixels that may show a box in front of the camera of a
    /// perspective view, with one more on each side for rounding; they may lie out of the image.
    #[inline(always)]
    pub fn box_px(&self, aabb: &Aabb) -> [Range<usize>; 2] {
        let (Optics::Perspective { focal_px: scale }
        | Optics::Orthographic { pixels_per_m: scale }) = self.optics;
        let (low, high) = (sub(aabb.min_m, self.eye_m), sub(aabb.max_m, self.eye_m));
        // Corners in the camera's frame: sums of a term for each axis of the box.
        let mut local = [[0.0; 8]; 3];
        for (local, axis) in local.iter_mut().zip(&self.axes) {
            for (corner, local) in local.iter_mut().enumerate() {
                for i in 0..3 {
                    let side = if corner >> i & 1 == 0 { low } else { high };
                    *local += axis[i] * side[i];
                }
            }
        }
        let [mut u_px, mut v_px, z] = local;
        for i in 0..8 {
            let scale = scale / z[i];
            u_px[i] = self.centre_px[0] + scale * u_px[i];
            v_px[i] = self.centre_px[1] + scale * v_px[i];
        }
        [range_px(&u_px), range_px(&v_px)]
    }

    /// Transform a part's vertices to the camera's frame and the image; return whether the near
    /// plane cuts the part.
    #[inline(always)]
    pub fn transform(&self, vertices_m: &[Vec3], scratch: &mut Scratch) -> bool {
        scratch.local_m.clear();
        scratch.projected_px.clear();
        let mut is_clipped = false;
        for &vertex in vertices_m {
            let local = rotate(&self.axes, sub(vertex, self.eye_m));
            is_clipped |= local[2] < self.clip_m[0];
            scratch.local_m.push(local);
            scratch.projected_px.push(self.to_image(local));
        }
        is_clipped
    }

    /// Return the nearness as a function of the image point, `plane . [u, v, 1]`, and the value
    /// from which the shader lights the face: the camera's distance from its plane, or the cosine
    /// between normal and viewing direction.
    ///
    /// `None` for a face that is turned away, or so nearly edge-on that no pixel centre can be
    /// inside.
    #[inline(always)]
    pub fn nearness_plane(&self, face: &Face) -> Option<(Vec3, f64)> {
        let height_m = dot(face.normal, self.eye_m) - face.offset_m;
        let (a, b, at_centre, facing) = match self.optics {
            Optics::Perspective { focal_px } => {
                if height_m <= 1e-9 {
                    return None;
                }
                let normal = rotate(&self.axes, face.normal);
                let [a, b] = [0, 1].map(|i| -normal[i] / (height_m * focal_px));
                (a, b, -normal[2] / height_m, height_m)
            }
            Optics::Orthographic { pixels_per_m } => {
                let normal = rotate(&self.axes, face.normal);
                if normal[2] >= -1e-9 {
                    return None;
                }
                let [a, b] = [0, 1].map(|i| normal[i] / (normal[2] * pixels_per_m));
                (a, b, self.horizon_m() + height_m / normal[2], -normal[2])
            }
        };
        Some(([a, b, at_centre - a * self.centre_px[0] - b * self.centre_px[1]], facing))
    }

    /// Return the image coordinates and the nearness of world points `p` in an orthographic view:
    /// `row . [p, 1]`.
    pub fn map_rows(&self) -> [[f32; 4]; 3] {
        let (Optics::Perspective { focal_px: scale }
        | Optics::Orthographic { pixels_per_m: scale }) = self.optics;
        let [right, down, forward] = self.axes;
        let row = |axis: Vec3, scale: f64, at: f64| {
            let offset = at - scale * dot(axis, self.eye_m);
            [axis[0] * scale, axis[1] * scale, axis[2] * scale, offset].map(|term| term as f32)
        };
        [
            row(right, scale, self.centre_px[0]),
            row(down, scale, self.centre_px[1]),
            row(forward, -1.0, self.horizon_m()),
        ]
    }

    /// Return a linear function of the world points of a plane, `along . p + offset`, as a function
    /// of the image point: `row . [u, v, 1]`, in perspective views times the nearness there.
    ///
    /// # Arguments
    /// * `plane` - nearness of the plane, from [`Self::nearness_plane`].
    pub fn on_plane(&self, plane: Vec3, along: Vec3, offset: f64) -> [f32; 3] {
        let [right, down, forward] = self.axes.map(|axis| dot(axis, along));
        let (Optics::Perspective { focal_px: scale }
        | Optics::Orthographic { pixels_per_m: scale }) = self.optics;
        let (du, dv) = (right / scale, down / scale);
        let at_eye = dot(along, self.eye_m) + offset;
        // The value is `at_eye`, and more for the ray.
        let centre = du * self.centre_px[0] + dv * self.centre_px[1];
        let (ray, weight) = match self.optics {
            Optics::Perspective { .. } => ([du, dv, forward - centre], at_eye),
            Optics::Orthographic { .. } => {
                ([du, dv, at_eye + forward * self.horizon_m() - centre], -forward)
            }
        };
        std::array::from_fn(|i| (ray[i] + weight * plane[i]) as f32)
    }

    /// Return the value of a linear function of world points at the camera.
    pub fn at_eye(&self, along: Vec3, offset: f64) -> f64 {
        dot(along, self.eye_m) + offset
    }

    /// Return the relation between pixels and world points.
    pub fn rays(&self) -> Rays {
        let [right, down, forward] = self.axes;
        let (Optics::Perspective { focal_px: scale }
        | Optics::Orthographic { pixels_per_m: scale }) = self.optics;
        let [centre_u, centre_v] = self.centre_px;
        let is_perspective = matches!(self.optics, Optics::Perspective { .. });
        let along = |axis: usize| {
            let (u, v) = (right[axis] / scale, down[axis] / scale);
            let ahead = if is_perspective { forward[axis] } else { 0.0 };
            [u, v, ahead - u * centre_u - v * centre_v].map(|term| term as f32)
        };
        Rays {
            eye_m: self.eye_m.map(|x| x as f32),
            forward: forward.map(|x| x as f32),
            slopes: [0, 1, 2].map(along),
            pixel: (1.0 / scale) as f32,
            horizon_m: (!is_perspective).then_some(self.horizon_m() as f32),
        }
    }
}

/// Return the pixels between the least and the greatest of some places, with one more on each side.
#[inline(always)]
fn range_px(places_px: &[f64; 8]) -> Range<usize> {
    let (mut low_px, mut high_px) = (*places_px, *places_px);
    for half in [4, 2, 1] {
        for i in 0..half {
            let (low, high) = (low_px[i + half], high_px[i + half]);
            low_px[i] = if low < low_px[i] { low } else { low_px[i] };
            high_px[i] = if high > high_px[i] { high } else { high_px[i] };
        }
    }
    // Conversions of numbers below 0 give 0.
    (low_px[0] - 1.0) as usize..(high_px[0] + 2.0) as usize
}

/// World points of pixels, from their depth.
pub(super) struct Rays {
    eye_m: [f32; 3],
    forward: [f32; 3],
    /// The coefficients, by world axis, of the ray at depth 1 (the ray's place in orthographic
    /// views): `slopes . [u, v, 1]`.
    slopes: [[f32; 3]; 3],
    /// Width of a pixel at depth 1, or at any depth.
    pub pixel: f32,
    /// The result of [`Lens::horizon_m`] for orthographic views.
    pub horizon_m: Option<f32>,
}

impl Rays {
    /// Return the point that a pixel shows.
    #[inline(always)]
    pub fn point(&self, [column, row]: [usize; 2], depth_m: f32) -> [f32; 3] {
        let ray = self.ray(column as f32 + 0.5, row as f32 + 0.5);
        let mut point_m = self.eye_m;
        for axis in 0..3 {
            point_m[axis] += match self.horizon_m {
                None => ray[axis] * depth_m,
                Some(_) => ray[axis] + self.forward[axis] * depth_m,
            };
        }
        point_m
    }

    #[inline(always)]
    fn ray(&self, u: f32, v: f32) -> [f32; 3] {
        let mut ray = [0.0; 3];
        for (ray, [du, dv, at]) in ray.iter_mut().zip(self.slopes) {
            *ray = du * u + (dv * v + at);
        }
        ray
    }

    /// Return whether a pixel of a perspective view looks below the horizon.
    pub fn is_below_horizon(&self, [column, row]: [usize; 2]) -> bool {
        self.horizon_m.is_none() && self.ray(column as f32 + 0.5, row as f32 + 0.5)[1] < 0.0
    }

    /// Return the square of the distance of what a pixel shows, relative to its depth; 1 in
    /// orthographic views.
    #[inline(always)]
    pub fn length2(&self, [column, row]: [usize; 2]) -> f32 {
        if self.horizon_m.is_some() {
            return 1.0;
        }
        let [x, y, z] = self.ray(column as f32 + 0.5, row as f32 + 0.5);
        x * x + y * y + z * z
    }

    /// Return the points that a run of pixels shows.
    #[inline(always)]
    pub fn points(&self, start: [usize; 2], depth_m: &[f32; LANES]) -> [[f32; LANES]; 3] {
        let mut points_m = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let point_m = self.point([start[0] + lane, start[1]], depth_m[lane]);
            for axis in 0..3 {
                points_m[axis][lane] = point_m[axis];
            }
        }
        points_m
    }
}
