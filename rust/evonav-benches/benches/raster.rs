//! One view of a house of 100 objects: what a step of the simulator costs.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use evonav_core::{
    assets::{
        Catalogue, UnknownAssets,
        material::{Material, MaterialKind},
    },
    geometry::Pose,
    house::House,
    sensors::{
        camera::{Camera, View},
        instance_masks::instance_areas,
        png::encode_png,
        raster::{FrameBuffer, Light, Style, Want, render, render_lit, visible_px},
        ray_caster::RayCaster,
        runs::RunImage,
        visible_bodies::visible_bodies,
    },
    textures::{MOST_PLACES, Sums, Texture, texture_of},
    world::{mesh::SceneMesh, scene::Scene},
};
use evonav_simd::Kernel;

const HOUSE: &str = include_str!("../../evonav-core/tests/data/house_100_objects.json");

fn house() -> (House, Scene) {
    let house = House::from_json("house", HOUSE).expect("a valid house");
    let scene = Scene::build(&house, Catalogue::bundled(), UnknownAssets::Error);
    (house, scene.expect("known assets"))
}

/// Views all around from four places.
fn cameras(scene: &Scene, image_px: [usize; 2]) -> Vec<Camera> {
    let (min_m, size_m) = (scene.bounds.min_m, scene.bounds.size_m());
    let places = [[0.3, 0.3], [0.7, 0.3], [0.3, 0.7], [0.7, 0.7]];
    let poses = places.iter().flat_map(|share| {
        (0..8).map(move |turn| Pose {
            position_m: [min_m[0] + share[0] * size_m[0], 0.9, min_m[2] + share[1] * size_m[2]],
            yaw_rad: f64::from(turn) * std::f64::consts::FRAC_PI_4,
            horizon_rad: 0.5,
        })
    });
    poses.map(|pose| Camera::at(&pose, image_px, std::f64::consts::FRAC_PI_2, 1.575)).collect()
}

fn bench_raster(c: &mut Criterion) {
    let (house, scene) = house();
    let mesh = SceneMesh::build(&scene);
    let light = Light::build(&house, &scene, &mesh);
    for image_px in [[300, 300], [640, 480]] {
        for (name, want) in [
            ("depth", Want { rgb: None, instances: false }),
            ("depth_instances", Want { rgb: None, instances: true }),
            ("depth_instances_plain", Want { rgb: Some(Style::Plain), instances: true }),
            ("depth_instances_default", Want { rgb: Some(Style::Default), instances: true }),
        ] {
            let cameras = cameras(&scene, image_px);
            let mut frame = FrameBuffer::default();
            let mut next = cameras.iter().cycle();
            c.bench_function(&format!("raster/{name}_{}x{}", image_px[0], image_px[1]), |b| {
                b.iter(|| {
                    next.next().map(|camera| {
                        render_lit(&mesh, Some(&light), &View::from(*camera), want, &mut frame)
                    })
                });
            });
        }
    }
    // What a candidate for a reference pose costs: bodies in turn, seen or not.
    let mut frame = FrameBuffer::default();
    let cameras_300 = cameras(&scene, [300, 300]);
    let mut next = cameras_300.iter().zip(scene.first_object..scene.bodies.len()).cycle();
    c.bench_function("raster_count/visible_px_300x300", |b| {
        b.iter(|| {
            next.next().map(|(camera, body)| visible_px(&mesh, camera, body, 50, &mut frame))
        });
    });
    // What an evaluator takes from every view.
    let want = Want { rgb: None, instances: true };
    render(&mesh, &cameras_300[0], want, &mut frame).expect("a camera in the house");
    c.bench_function("ground_truth/instance_areas_300x300", |b| {
        b.iter(|| {
            let instances = RunImage::of(black_box(&frame.instances), 300).expect("whole rows");
            instance_areas(&instances, scene.bodies.len())
        });
    });
    // A reference image of a task.
    render(&mesh, &cameras_300[0], Want { rgb: Some(Style::Plain), instances: false }, &mut frame)
        .expect("a camera in the house");
    c.bench_function("png/encode_300x300", |b| {
        b.iter(|| encode_png(black_box(&frame.rgb), [300, 300]));
    });
    // The twin that shares no idea with it: a ray a pixel.
    let caster = RayCaster::build(&mesh);
    let cameras = cameras(&scene, [300, 300]);
    let mut next = cameras.iter().cycle();
    c.bench_function("raycast3d/100_rays", |b| {
        b.iter(|| {
            let camera = next.next().expect("a cycle");
            for i in 0..100 {
                let ray = camera.ray([f64::from(i) * 3.0, f64::from(i) * 2.0 + 50.0]);
                black_box(caster.cast(&mesh, camera.position_m, ray, 100.0));
            }
        });
    });
    // What AI2-THOR's metadata asks for at every step.
    let mut next = cameras.iter().cycle();
    c.bench_function("visibility/visible_bodies_1.5m", |b| {
        b.iter(|| {
            let camera = next.next().expect("a cycle");
            let [x, _, z] = camera.position_m;
            visible_bodies(&scene, &mesh, &caster, &View::from(*camera), [x, z], 1.5)
        });
    });
    // A run of pixels of a textured floor, close up and far away.
    let floor = Material { kind: MaterialKind::Planks, variant: 0 };
    let texture = texture_of(floor).expect("planks have a texture");
    for (name, width2) in [("near", 1.0), ("far", 16.0)] {
        let [u, v] = [0.013, 0.007].map(|step| std::array::from_fn(|i| i as f32 * step));
        let lookup = Lookup { texture, u, v, level: texture.level(width2) };
        c.bench_function(&format!("textures/sample_64_{name}"), |b| {
            b.iter(|| evonav_simd::compute(black_box(&lookup)));
        });
    }
    c.bench_function("mesh/build", |b| b.iter(|| SceneMesh::build(black_box(&scene))));
    c.bench_function("light/build", |b| {
        b.iter(|| Light::build(&house, &scene, black_box(&mesh)));
    });
    c.bench_function("light/build_and_first_picture", |b| {
        let view = View::from(cameras_300[0]);
        let want = Want { rgb: Some(Style::Default), instances: true };
        b.iter(|| {
            let light = Light::build(&house, &scene, black_box(&mesh));
            render_lit(&mesh, Some(&light), &view, want, &mut frame)
        });
    });
    c.bench_function("light/load_with_light_100_objects", |b| {
        b.iter(|| {
            let (house, scene) = self::house();
            let mesh = SceneMesh::build(&scene);
            Light::build(&house, &scene, &mesh)
        });
    });
    c.bench_function("raycast3d/build", |b| b.iter(|| RayCaster::build(black_box(&mesh))));
}

/// Looks a texture up at a run of pixels.
struct Lookup {
    texture: &'static Texture,
    u: [f32; MOST_PLACES],
    v: [f32; MOST_PLACES],
    level: usize,
}

impl Kernel for &Lookup {
    type Output = Sums;

    #[inline(always)]
    fn compute(self) -> Sums {
        let mut sums = [[0; MOST_PLACES]; 3];
        self.texture.sample(self.level, &self.u, &self.v, &mut sums);
        sums
    }
}

criterion_group!(benches, bench_raster);
criterion_main!(benches);
