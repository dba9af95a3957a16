//! The rasteriser, the ray caster and what rests on it against a ray tracer that tries every
//! triangle.

use evonav_core::{
    assets::part::{Part, Primitive},
    geometry::{Vec3, add, euler_rotation_deg, rotate, sub},
    sensors::{
        camera::{Camera, View},
        raster::{FrameBuffer, Style, Want, render_view},
        ray_caster::RayCaster,
        runs::RunImage,
        visible_bodies::{visibility_points, visible_bodies},
    },
    world::mesh::{SceneMesh, Triangle},
};
use proptest::{collection::vec, prelude::*};

use super::tracer::{intersect, look_through, scene_of};
use crate::common::scenes::{cross, dot};

/// Nearest front face along a ray from `least` on: `(distance, body)`. Triangles grown (or, negative, shrunk) by
/// `margin` of their size.
fn cast_naive(
    triangles: &[Triangle],
    origin_m: Vec3,
    direction: Vec3,
    least: f64,
    margin: f64,
) -> Option<(f64, u32)> {
    triangles
        .iter()
        .filter_map(|triangle| {
            let (distance, inside) = intersect(triangle, origin_m, direction)?;
            (distance >= least && inside >= -margin).then_some((distance, triangle.body))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
}

fn primitive() -> impl Strategy<Value = Primitive> {
    let length = 0.02..1.5_f64;
    let half_m = [length.clone(), length.clone(), length.clone()];
    prop_oneof![
        half_m.clone().prop_map(|half_m| Primitive::Cuboid { half_m }),
        half_m.prop_map(|half_m| Primitive::Ellipsoid { half_m }),
        ([length.clone(), length.clone()], [0.0..1.0_f64, 0.0..1.0_f64], length, 3..9_u8).prop_map(
            |(bottom_m, top_m, half_height_m, sides)| Primitive::Frustum {
                bottom_m,
                top_m,
                half_height_m,
                sides
            }
        ),
    ]
}

fn part() -> impl Strategy<Value = Part> {
    let place = [-3.0..3.0_f64, -1.0..3.0_f64, -3.0..3.0_f64];
    let angles = prop_oneof![
        (0.0..360.0_f64).prop_map(|yaw_deg| [0.0, yaw_deg, 0.0]),
        [0.0..360.0_f64, 0.0..360.0_f64, 0.0..360.0_f64]
    ];
    (primitive(), place, angles, any::<[u8; 3]>()).prop_map(
        |(primitive, centre_m, angles_deg, colour)| Part {
            primitive,
            centre_m,
            rotation: euler_rotation_deg(angles_deg),
            colour,
            material: Default::default(),
        },
    )
}

fn camera() -> impl Strategy<Value = Camera> {
    let place = [-3.0..3.0_f64, 0.0..2.0_f64, -3.0..3.0_f64];
    (place, 0.0..6.3_f64, -1.2..1.2_f64, 1..50_usize, 1..40_usize, 0.6..2.0_f64).prop_map(
        |(position_m, yaw_rad, horizon_rad, width_px, height_px, vertical_fov_rad)| Camera {
            width_px,
            height_px,
            vertical_fov_rad,
            position_m,
            yaw_rad,
            horizon_rad,
        },
    )
}

/// AI2-THOR's agent camera, and others with clip planes within the scene, rolled, orthographic.
fn view() -> impl Strategy<Value = View> {
    let own = (0.01..2.0_f64, 0.1..4.0_f64, -3.2..3.2_f64, proptest::option::of(0.05..4.0_f64));
    (camera(), proptest::option::of(own)).prop_map(|(camera, own)| {
        own.map_or(View::from(camera), |(near_m, reach_m, roll_rad, half_height_m)| View {
            camera,
            clip_m: [near_m, near_m + reach_m],
            roll_rad,
            half_height_m,
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// A scene of triangles shrunk by a hair is seen deeper, one of grown triangles nearer; where
    /// both agree the image has no choice.
    #[test]
    fn images_lie_between_shrunk_and_grown_scenes(
        parts in vec(part(), 0..12),
        view in view(),
    ) {
        const HAIR: f64 = 1e-7;
        let View { camera, clip_m: [near_m, far_m], .. } = view;
        let mesh = SceneMesh::build(&scene_of(&parts));
        let triangles: Vec<Triangle> = mesh.triangles().collect();
        let mut frame = FrameBuffer::default();
        render_view(&mesh, &view, Want { rgb: None, instances: true }, &mut frame).unwrap();
        for index in 0..camera.width_px * camera.height_px {
            let (row, col) = (index / camera.width_px, index % camera.width_px);
            let (origin_m, ray) = look_through(&view, [col as f64 + 0.5, row as f64 + 0.5]);
            // A plane that is seen edge-on takes rounding to depth by the sine of that angle.
            let grazing = |depth: f64| {
                let point_m = add(origin_m, ray.map(|r| depth * r));
                let sines = triangles.iter().filter_map(|t| {
                    let [a, b, c] = t.vertices_m;
                    let normal = cross(sub(b, a), sub(c, a));
                    let length = dot(normal, normal).sqrt();
                    let is_on = dot(normal, sub(point_m, a)).abs() < 1e-4 * length;
                    is_on.then(|| dot(normal, ray).abs() / length)
                });
                sines.fold(0.1, f64::min).max(1e-4)
            };
            let slack = |depth: f64| {
                let at = if depth.is_finite() { grazing(depth) } else { 0.1 };
                1e-7 * depth.max(1.0) * (1.0 + 10.0 * depth) / at
            };
            let nearest = |least, margin, most| {
                cast_naive(&triangles, origin_m, ray, least, margin).filter(|hit| hit.0 < most)
            };
            let grown = nearest(near_m - HAIR, HAIR, far_m + slack(far_m));
            let shrunk = nearest(near_m + HAIR, -HAIR, far_m - slack(far_m));
            let got = f64::from(frame.depth_m[index]);
            match grown {
                Some((depth, _)) => prop_assert!(got >= depth - slack(depth), "{got} {depth}"),
                None => prop_assert!(got.is_infinite(), "{got} where nothing is"),
            }
            if let Some((depth, _)) = shrunk {
                prop_assert!(got <= depth + slack(depth), "{got} {depth}");
            }
            if let (Some(near), Some(far)) = (grown, shrunk)
                && near == far
            {
                // Another body at the same depth within rounding may win.
                let others: Vec<Triangle> =
                    triangles.iter().filter(|t| t.body != near.1).copied().collect();
                let second = cast_naive(&others, origin_m, ray, near.0 - slack(near.0), HAIR);
                if second.is_none_or(|s| s.0 > near.0 + 2.0 * slack(near.0)) {
                    prop_assert_eq!(frame.instances[index], near.1 as i32 + 1);
                }
            }
            prop_assert_eq!(frame.instances[index] == 0, got.is_infinite());
        }
    }

    /// What hides what decides only what need not be drawn: every pixel is that of the nearest of the
    /// parts, each drawn alone.
    #[test]
    fn hidden_parts_leave_no_trace(
        parts in vec(part(), 1..12),
        wall_m in [0.3..2.0_f64, 0.3..2.0_f64, 0.2..3.0_f64],
        view in view(),
    ) {
        // A wall before the camera hides much of the rest.
        let ahead_m = view.axes()[2].map(|axis| axis * wall_m[2]);
        let wall = Part {
            primitive: Primitive::Cuboid { half_m: [wall_m[0], wall_m[1], 0.05] },
            centre_m: add(view.camera.position_m, ahead_m),
            rotation: euler_rotation_deg([0.0, view.camera.yaw_rad.to_degrees(), 0.0]),
            ..parts[0]
        };
        let parts: Vec<Part> = parts.into_iter().chain([wall]).collect();
        let view = View { camera: Camera { width_px: 3 * view.camera.width_px, ..view.camera }, ..view };
        let draw = |parts: &[Part]| {
            let mut frame = FrameBuffer::default();
            let want = Want { rgb: None, instances: true };
            render_view(&SceneMesh::build(&scene_of(parts)), &view, want, &mut frame).unwrap();
            frame
        };
        let all = draw(&parts);
        let alone: Vec<FrameBuffer> = parts.iter().map(|part| draw(&[*part])).collect();
        for (index, &depth_m) in all.depth_m.iter().enumerate() {
            let depths_m = alone.iter().map(|frame| frame.depth_m[index]);
            prop_assert_eq!(depth_m, depths_m.fold(f32::INFINITY, f32::min));
            if let Ok(body) = usize::try_from(all.instances[index] - 1) {
                prop_assert_eq!(depth_m, alone[body].depth_m[index]);
            }
        }
    }

    /// Asking for more images changes none of them.
    #[test]
    fn wants_do_not_change_images(parts in vec(part(), 0..12), view in view()) {
        let mesh = SceneMesh::build(&scene_of(&parts));
        let mut frames = [None, Some(Style::Plain), Some(Style::Default)].map(|rgb| {
            let mut frame = FrameBuffer::default();
            render_view(&mesh, &view, Want { rgb, instances: true }, &mut frame).unwrap();
            frame
        });
        let [used, coloured @ ..] = &mut frames;
        for (frame, (_, style)) in coloured.iter().zip(Style::NAMES) {
            prop_assert_eq!(&used.depth_m, &frame.depth_m);
            prop_assert_eq!(frame.rgb.len(), 3 * frame.depth_m.len());
            // A used buffer gives what a new one gives.
            let mut again = used.clone();
            render_view(&mesh, &view, Want { rgb: Some(style), instances: false }, &mut again).unwrap();
            prop_assert_eq!(&again.rgb, &frame.rgb);
            prop_assert!(again.instances.is_empty());
            render_view(&mesh, &view, Want { rgb: Some(style), instances: true }, &mut again).unwrap();
            prop_assert_eq!(&used.instances, &frame.instances);
            prop_assert_eq!(&again.rgb, &frame.rgb);
        }
        let runs = RunImage::of(&frames[0].instances, view.camera.width_px).unwrap();
        for rgb in [None, Some(Style::Plain), Some(Style::Default)] {
            let mut frame = FrameBuffer::default();
            frame.has_runs = true;
            render_view(&mesh, &view, Want { rgb, instances: true }, &mut frame).unwrap();
            prop_assert_eq!(&frame.instance_runs, &runs);
            prop_assert!(frame.instances.is_empty());
        }
    }

    /// Trim is seen in the colours of the default style, and nowhere else.
    #[test]
    fn trim_changes_only_colours_of_the_default_style(
        parts in vec(part(), 0..8),
        trim in vec(part(), 1..4),
        view in view(),
        ray in [-4.0..4.0_f64, 0.0..2.0_f64, -4.0..4.0_f64],
    ) {
        let bare = scene_of(&parts);
        let mut trimmed = scene_of(&parts);
        let Some(body) = trimmed.bodies.first_mut() else { return Ok(()) };
        body.trim = trim;
        let [bare, trimmed] = [bare, trimmed].map(|scene| SceneMesh::build(&scene));
        prop_assert_eq!(bare.faces(), trimmed.faces());
        prop_assert!(bare.triangles().eq(trimmed.triangles()));
        for (name, style) in Style::NAMES {
            let frames = [&bare, &trimmed].map(|mesh| {
                let mut frame = FrameBuffer::default();
                render_view(mesh, &view, Want { rgb: Some(style), instances: true }, &mut frame).unwrap();
                frame
            });
            prop_assert_eq!(&frames[0].depth_m, &frames[1].depth_m);
            prop_assert_eq!(&frames[0].instances, &frames[1].instances);
            prop_assert!(style == Style::Default || frames[0].rgb == frames[1].rgb, "{}", name);
        }
        let cast = |mesh: &SceneMesh| {
            RayCaster::build(mesh).cast(mesh, ray, [0.6, 0.0, 0.8], f64::INFINITY)
        };
        prop_assert_eq!(cast(&bare), cast(&trimmed));
    }

    /// The hierarchy finds what trying every triangle finds.
    #[test]
    fn rays_hit_what_a_search_over_all_triangles_hits(
        parts in vec(part(), 0..12),
        origin_m in [-3.0..3.0_f64, 0.0..2.0_f64, -3.0..3.0_f64],
        target_m in [-3.0..3.0_f64, 0.0..2.0_f64, -3.0..3.0_f64],
    ) {
        const HAIR: f64 = 1e-7;
        let mesh = SceneMesh::build(&scene_of(&parts));
        let caster = RayCaster::build(&mesh);
        let triangles: Vec<Triangle> = mesh.triangles().collect();
        let direction = sub(target_m, origin_m);
        let got = caster.cast(&mesh, origin_m, direction, f64::INFINITY);
        let distance = got.map_or(f64::INFINITY, |hit| hit.distance);
        let naive = |least, margin| {
            cast_naive(&triangles, origin_m, direction, least, margin)
                .map_or(f64::INFINITY, |hit| hit.0)
        };
        let (grown, shrunk) = (naive(-HAIR, HAIR), naive(HAIR, -HAIR));
        prop_assert!(grown - 1e-6 <= distance && distance <= shrunk + 1e-6);
        let is_visible = caster.is_visible(&mesh, origin_m, target_m, |_| false);
        prop_assert!(!is_visible || shrunk > 1.0 - 1e-6, "{shrunk}");
        prop_assert!(is_visible || grown < 1.0 + 1e-6, "{grown}");
        prop_assert!(caster.is_visible(&mesh, origin_m, target_m, |_| true));
    }

    /// Projecting what was unprojected gives the pixel and depth back.
    #[test]
    fn projection_inverts_unprojection(
        camera in camera(),
        image_px in [0.0..50.0_f64, 0.0..40.0_f64],
        depth_m in 0.1..20.0_f64,
    ) {
        let [u, v, z] = camera.project(camera.unproject(image_px, depth_m)).unwrap();
        prop_assert!((u - image_px[0]).abs() < 1e-8);
        prop_assert!((v - image_px[1]).abs() < 1e-8);
        prop_assert!((z - depth_m).abs() < 1e-9);
    }
}

/// Whether a triangle's shadow on the ground comes within `reach_m` of a point: its sides and its
/// inside, each tried with a formula of its own.
fn is_shadow_near(triangle: &Triangle, axis_m: [f64; 2], reach_m: f64) -> bool {
    let [a, b, c] = triangle.vertices_m.map(|v| [v[0] - axis_m[0], v[2] - axis_m[1]]);
    let turn = |p: [f64; 2], q: [f64; 2]| p[0] * q[1] - p[1] * q[0];
    let turns = [turn(a, b), turn(b, c), turn(c, a)];
    let is_inside = turns.iter().all(|t| *t > 0.0) || turns.iter().all(|t| *t < 0.0);
    let is_side_near = |p: [f64; 2], q: [f64; 2]| {
        (0..=1000).any(|k| {
            let t = f64::from(k) / 1000.0;
            (p[0] + t * (q[0] - p[0])).hypot(p[1] + t * (q[1] - p[1])) <= reach_m
        })
    };
    is_inside || is_side_near(a, b) || is_side_near(b, c) || is_side_near(c, a)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Every triangle tried for every point; a hair's breadth may go either way.
    #[test]
    fn visible_bodies_have_a_point_in_the_picture_that_a_ray_meets_first(
        parts in vec(part(), 1..10),
        view in view(),
        reach_m in 0.1..4.0_f64,
    ) {
        const HAIR: f64 = 1e-7;
        let scene = scene_of(&parts);
        let mesh = SceneMesh::build(&scene);
        let rays = RayCaster::build(&mesh);
        let triangles: Vec<Triangle> = mesh.triangles().collect();
        let eye_m = view.camera.position_m;
        let axis_m = [eye_m[0], eye_m[2]];
        let got = visible_bodies(&scene, &mesh, &rays, &view, axis_m, reach_m).unwrap();
        let half_m = (view.camera.vertical_fov_rad / 2.0).tan();
        let aspect = view.camera.width_px as f64 / view.camera.height_px as f64;
        let angles_deg = [view.camera.horizon_rad, view.camera.yaw_rad, view.roll_rad].map(f64::to_degrees);
        let to_world = euler_rotation_deg(angles_deg);
        let to_camera: [Vec3; 3] = std::array::from_fn(|i| std::array::from_fn(|j| to_world[j][i]));
        // How far inside of the picture's nearest border, as a share of its half height.
        let margin = |point_m: Vec3| {
            let [x, y, z] = rotate(&to_camera, sub(point_m, eye_m));
            let half_m = view.half_height_m.unwrap_or(half_m * z);
            if z > 0.0 { (aspect - x.abs() / half_m).min(1.0 - y.abs() / half_m) } else { -1.0 }
        };
        for body in 0..scene.bodies.len() as u32 {
            let is_own = |t: &&Triangle| t.body == body;
            let is_near = |slack_m: f64| {
                triangles.iter().filter(is_own).any(|t| is_shadow_near(t, axis_m, reach_m + slack_m))
            };
            let is_met = |slack: f64| {
                visibility_points(&mesh, body as usize).into_iter().any(|point_m| {
                    let direction = sub(point_m, eye_m);
                    let most = 1.0 + 0.5 / dot(direction, direction).sqrt() + slack;
                    let (own, others): (Vec<Triangle>, Vec<Triangle>) =
                        triangles.iter().copied().partition(|t| t.body == body);
                    let own = cast_naive(&own, eye_m, direction, -slack, slack);
                    let others = cast_naive(&others, eye_m, direction, slack, -slack);
                    margin(point_m) > -slack
                        && own.is_some_and(|own| {
                            own.0 < most && others.is_none_or(|other| other.0 > own.0 - slack)
                        })
                })
            };
            if got.contains(&(body as usize)) {
                prop_assert!(is_near(0.01) && is_met(HAIR), "{body} is not visible");
            } else {
                prop_assert!(!(is_near(-0.01) && is_met(-HAIR)), "{body} is visible");
            }
        }
    }
}
