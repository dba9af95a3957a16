//! How many pixels of a body are seen, against a picture of everything.

use evonav_core::{
    assets::part::{Part, Primitive},
    geometry::euler_rotation_deg,
    sensors::{
        camera::Camera,
        raster::{FrameBuffer, Want, render, visible_px},
    },
    world::mesh::SceneMesh,
};
use proptest::{collection::vec, prelude::*};

use crate::common::scenes::scene_of;

fn part() -> impl Strategy<Value = Part> {
    let half_m = [0.02..0.8_f64, 0.02..0.8_f64, 0.02..0.8_f64];
    let primitive = prop_oneof![
        half_m.clone().prop_map(|half_m| Primitive::Cuboid { half_m }),
        half_m.prop_map(|half_m| Primitive::Ellipsoid { half_m }),
    ];
    let place = [-3.0..3.0_f64, -1.0..3.0_f64, -3.0..3.0_f64];
    (primitive, place, [0.0..360.0_f64, 0.0..360.0_f64, 0.0..360.0_f64]).prop_map(
        |(primitive, centre_m, angles_deg)| Part {
            primitive,
            centre_m,
            rotation: euler_rotation_deg(angles_deg),
            colour: [128; 3],
            material: Default::default(),
        },
    )
}

proptest! {
    #[test]
    fn as_many_as_in_the_picture_of_everything(
        bodies in vec(vec(part(), 1..4), 2..12),
        image_px in [20_usize..90, 20_usize..90],
        eye_m in [-2.0..2.0_f64, -0.5..2.0_f64, -2.0..2.0_f64],
        (yaw_rad, horizon_rad) in (0.0..6.3_f64, -1.5..1.5_f64),
        fov_deg in 30.0..120.0_f64,
        least_px in 0_usize..200,
    ) {
        let mesh = SceneMesh::build(&scene_of(&bodies));
        let camera = Camera {
            width_px: image_px[0],
            height_px: image_px[1],
            vertical_fov_rad: fov_deg.to_radians(),
            position_m: eye_m,
            yaw_rad,
            horizon_rad,
        };
        let (mut frame, mut whole) = (FrameBuffer::default(), FrameBuffer::default());
        let want = Want { rgb: None, instances: true };
        render(&mesh, &camera, want, &mut whole)?;
        for body in 0..=bodies.len() {
            let count = whole.instances.iter().filter(|&&id| id == body as i32 + 1).count();
            // The working memory is that of the body before, as it is in use.
            let counted = visible_px(&mesh, &camera, body, least_px, &mut frame)?;
            prop_assert_eq!(counted, (count >= least_px).then_some(count), "body {}", body);
        }
        // A picture that follows is not affected.
        render(&mesh, &camera, want, &mut frame)?;
        prop_assert_eq!(&frame.instances, &whole.instances);
        prop_assert_eq!(&frame.depth_m, &whole.depth_m);
    }
}
