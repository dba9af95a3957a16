//! Depth, instance and colour images of a scene: a scanline z-buffer on one thread.
//!
//! Parts of houses are convex and few-sided, so whole polygons are drawn rather than triangles,
//! faces turned away are never drawn, and a face's inverse depth is the exact plane equation
//! instead of an interpolation between corners. Colours come after visibility.

use crate::{
    Error,
    geometry::{Aabb, Mat3, Vec2, Vec3, rotate, sub},
    sensors::{
        camera::Camera,
        raster_fill::{Canvas, LANES},
        raster_shade::Shader,
    },
    world::mesh::{Face, PartMesh, SceneMesh, dot},
};

/// Nothing nearer than this (planar depth) is drawn: AI2-THOR's near plane.
pub const NEAR_M: f64 = 0.1;

/// Images to make besides depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Want {
    /// Shaded colours.
    pub rgb: bool,
    /// Body of each pixel.
    pub instances: bool,
}

/// The images of one view, row-major, and the working memory to make the next without allocating.
#[derive(Debug, Clone, Default)]
pub struct FrameBuffer {
    /// `(H, W)` planar z in metres, infinity where nothing is.
    pub depth_m: Vec<f32>,
    /// `(H, W)` 0 where nothing is, else body index + 1; empty if not wanted.
    pub instances: Vec<i32>,
    /// `(H, W, 3)` sRGB; empty if not wanted.
    pub rgb: Vec<u8>,
    canvas: Canvas,
    shader: Shader,
    scratch: Scratch,
}

impl FrameBuffer {
    /// Hands out depth, colours and instances, as vectors of their own.
    pub fn take(&mut self) -> (Vec<f32>, Vec<u8>, Vec<i32>) {
        let Self { depth_m, rgb, instances, .. } = self;
        (std::mem::take(depth_m), std::mem::take(rgb), std::mem::take(instances))
    }
}

/// Vertices of the part and corners of the face at hand.
#[derive(Debug, Clone, Default)]
struct Scratch {
    visible: Vec<(f64, u32)>,
    local_m: Vec<Vec3>,
    projected_px: Vec<Vec2>,
    clipped_m: Vec<Vec3>,
    polygon_px: Vec<Vec2>,
}

/// Renders one view into `out`.
///
/// Depth has an error under 0.1 mm within 10 m. Of surfaces at equal depth the one drawn first
/// stays; the order is a function of mesh and camera alone, and so is every pixel.
///
/// # Errors
/// [`Error::InvalidArgument`] as [`Camera::check`].
///
/// # Complexity
/// O(parts + faces in view + pixels they cover).
pub fn render(
    mesh: &SceneMesh,
    camera: &Camera,
    want: Want,
    out: &mut FrameBuffer,
) -> Result<(), Error> {
    camera.check()?;
    let view = View::new(camera);
    out.canvas.clear(camera.width_px, camera.height_px);
    if want.rgb {
        out.shader.begin(mesh.faces.len(), camera);
    }
    view.collect_visible(mesh, &mut out.scratch.visible);
    for index in 0..out.scratch.visible.len() {
        let part = &mesh.parts[out.scratch.visible[index].1 as usize];
        draw_part(mesh, part, &view, want, out);
    }
    resolve(mesh, camera, want, out);
    Ok(())
}

fn draw_part(mesh: &SceneMesh, part: &PartMesh, view: &View, want: Want, out: &mut FrameBuffer) {
    let FrameBuffer { canvas, shader, scratch, .. } = out;
    let is_clipped = view.transform(&mesh.vertices_m[part.vertices.clone()], scratch);
    for index in part.faces.clone() {
        let face = &mesh.faces[index];
        let height_m = dot(face.normal, view.eye_m) - face.offset_m;
        // Turned away, or so nearly edge-on that no pixel centre can be inside.
        if height_m <= 1e-9 {
            continue;
        }
        let Scratch { local_m, projected_px, clipped_m, polygon_px, .. } = scratch;
        polygon_px.clear();
        let corners = mesh.corners_of(face);
        if is_clipped {
            clip_near(corners.iter().map(|&i| local_m[i as usize]), clipped_m);
            if clipped_m.len() < 3 {
                continue;
            }
            polygon_px.extend(clipped_m.iter().map(|&p| view.to_image(p)));
        } else {
            polygon_px.extend(corners.iter().map(|&i| projected_px[i as usize]));
        }
        let tag = if want.rgb { index as u32 } else { face.body } + 1;
        if want.rgb {
            shader.light(index, face, height_m);
        }
        canvas.fill(polygon_px, view.inverse_depth_plane(face, height_m), tag);
    }
}

/// The part of a polygon in front of the near plane.
fn clip_near(corners_m: impl Iterator<Item = Vec3> + Clone, clipped_m: &mut Vec<Vec3>) {
    clipped_m.clear();
    let next = corners_m.clone().cycle().skip(1);
    for (a, b) in corners_m.zip(next) {
        if a[2] >= NEAR_M {
            clipped_m.push(a);
        }
        if (a[2] >= NEAR_M) != (b[2] >= NEAR_M) {
            // From the nearer end whichever way the edge runs: neighbours get the same point.
            let (near, far) = if a[2] < b[2] { (a, b) } else { (b, a) };
            let t = (NEAR_M - near[2]) / (far[2] - near[2]);
            clipped_m.push(std::array::from_fn(|i| near[i] + t * (far[i] - near[i])));
        }
    }
}

/// The camera, ready for use.
struct View {
    axes: Mat3,
    eye_m: Vec3,
    focal_px: f64,
    centre_px: Vec2,
    /// Inward normals of near plane and the image's borders, all but the first through the eye.
    frustum: [Vec3; 5],
}

impl View {
    fn new(camera: &Camera) -> Self {
        let axes = camera.camera_from_world();
        let (focal_px, [u, v]) = (camera.focal_px(), camera.centre_px());
        let local = [
            [0.0, 0.0, 1.0],
            [focal_px, 0.0, u],
            [-focal_px, 0.0, u],
            [0.0, focal_px, v],
            [0.0, -focal_px, v],
        ];
        let to_world =
            |n: Vec3| std::array::from_fn(|i| (0..3).map(|j| axes[j][i] * n[j]).sum::<f64>());
        Self {
            axes,
            eye_m: camera.position_m,
            focal_px,
            centre_px: [u, v],
            frustum: local.map(to_world),
        }
    }

    fn to_image(&self, local_m: Vec3) -> Vec2 {
        let scale = self.focal_px / local_m[2];
        [self.centre_px[0] + scale * local_m[0], self.centre_px[1] + scale * local_m[1]]
    }

    /// Whether some of the box may be in view.
    fn may_see(&self, aabb: &Aabb) -> bool {
        let (centre, size) = (sub(aabb.centre_m(), self.eye_m), aabb.size_m());
        self.frustum.iter().enumerate().all(|(i, n)| {
            let reach: f64 = (0..3).map(|k| 0.5 * size[k] * n[k].abs()).sum();
            dot(*n, centre) + reach >= if i == 0 { NEAR_M } else { 0.0 }
        })
    }

    /// Parts in view, nearest first.
    fn collect_visible(&self, mesh: &SceneMesh, visible: &mut Vec<(f64, u32)>) {
        visible.clear();
        visible.extend(
            mesh.parts
                .iter()
                .enumerate()
                .filter(|(_, part)| self.may_see(&part.aabb))
                .map(|(i, part)| (self.nearest_m(&part.aabb), i as u32)),
        );
        visible.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }

    /// Smallest planar depth of the box.
    fn nearest_m(&self, aabb: &Aabb) -> f64 {
        let forward = self.axes[2];
        let corner: Vec3 =
            std::array::from_fn(|k| if forward[k] > 0.0 { aabb.min_m[k] } else { aabb.max_m[k] });
        dot(forward, sub(corner, self.eye_m))
    }

    /// Takes a part's vertices to the camera's frame and the image; whether the near plane cuts it.
    fn transform(&self, vertices_m: &[Vec3], scratch: &mut Scratch) -> bool {
        scratch.local_m.clear();
        scratch.projected_px.clear();
        let mut is_clipped = false;
        for &vertex in vertices_m {
            let local = rotate(&self.axes, sub(vertex, self.eye_m));
            is_clipped |= local[2] < NEAR_M;
            scratch.local_m.push(local);
            scratch.projected_px.push(self.to_image(local));
        }
        is_clipped
    }

    /// Inverse depth as a function of the image point: `plane . [u, v, 1]`.
    fn inverse_depth_plane(&self, face: &Face, height_m: f64) -> Vec3 {
        let normal = rotate(&self.axes, face.normal);
        let [a, b] = [0, 1].map(|i| -normal[i] / (height_m * self.focal_px));
        [a, b, -normal[2] / height_m - a * self.centre_px[0] - b * self.centre_px[1]]
    }
}

/// Turns the canvas into images.
fn resolve(mesh: &SceneMesh, camera: &Camera, want: Want, out: &mut FrameBuffer) {
    let FrameBuffer { depth_m, instances, rgb, canvas, shader, .. } = out;
    let num_pixels = camera.width_px * camera.height_px;
    depth_m.resize(num_pixels, 0.0);
    unpad(canvas, &canvas.inverse_depth, depth_m, |block| block.map(|w| 1.0 / w));
    instances.resize(if want.instances { num_pixels } else { 0 }, 0);
    match want {
        Want { instances: true, rgb: true } => {
            unpad(canvas, &canvas.tags, instances, |block| bodies_of(mesh, block));
        }
        Want { instances: true, rgb: false } => {
            unpad(canvas, &canvas.tags, instances, |block| block.map(|tag| tag as i32));
        }
        Want { instances: false, .. } => {}
    }
    rgb.resize(if want.rgb { 3 * num_pixels } else { 0 }, 0);
    if want.rgb {
        shader.shade(canvas, rgb);
    }
}

/// Rows of padded blocks to rows of exactly the image's width.
fn unpad<T: Copy, U: Copy>(
    canvas: &Canvas,
    blocks: &[[T; LANES]],
    image: &mut [U],
    of_block: impl Fn(&[T; LANES]) -> [U; LANES],
) {
    let rows = blocks.chunks_exact(canvas.blocks_per_row());
    for (row, blocks) in image.chunks_exact_mut(canvas.width_px).zip(rows) {
        let (whole, rest) = row.as_chunks_mut();
        for (pixels, block) in whole.iter_mut().zip(blocks) {
            *pixels = of_block(block);
        }
        if let Some(block) = blocks.last() {
            rest.copy_from_slice(&of_block(block)[..rest.len()]);
        }
    }
}

/// Instance ids of face tags. Most blocks lie within one face.
fn bodies_of(mesh: &SceneMesh, tags: &[u32; LANES]) -> [i32; LANES] {
    let body_of = |tag: u32| match tag.checked_sub(1) {
        Some(face) => mesh.faces[face as usize].body as i32 + 1,
        None => 0,
    };
    if tags.iter().all(|&tag| tag == tags[0]) {
        return [body_of(tags[0]); LANES];
    }
    tags.map(body_of)
}
