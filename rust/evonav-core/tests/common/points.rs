//! Solids of houses, by points: slow, plain, and nothing of the outlines that placement goes by.

use evonav_core::{
    assets::{
        Catalogue, UnknownAssets,
        part::{Part, Primitive},
        shapes::shape_in,
    },
    geometry::{Vec3, add, euler_rotation_deg, rotate, sub},
    house::{House, Object},
};

const UNKNOWN: UnknownAssets = UnknownAssets::CategoryDefault;

/// The object of an id.
pub fn object<'a>(house: &'a House, id: &str) -> &'a Object {
    &house.objects[house.object_index(id).unwrap()]
}

/// Its parts in the world.
pub fn parts_of(house: &House, id: &str) -> Vec<Part> {
    let object = object(house, id);
    let asset = Catalogue::bundled().asset_of(house, object, UNKNOWN).unwrap();
    let rotation = euler_rotation_deg(object.rotation_deg);
    let parts = shape_in(&asset, object.condition());
    parts.iter().map(|part| part.placed(object.position_m, &rotation)).collect()
}

/// Half edges of a part's own box.
pub fn half_of(part: &Part) -> Vec3 {
    match part.primitive {
        Primitive::Cuboid { half_m }
        | Primitive::Ellipsoid { half_m }
        | Primitive::Pad { half_m, .. } => half_m,
        Primitive::Frustum { bottom_m, top_m, half_height_m, .. } => {
            [bottom_m[0].max(top_m[0]), half_height_m, bottom_m[1].max(top_m[1])]
        }
    }
}

/// Points throughout a part, `share` of the way out.
pub fn points_in(part: &Part, share: f64) -> Vec<Vec3> {
    let half = half_of(part);
    let steps = [-1.0, -0.6, -0.2, 0.2, 0.6, 1.0].map(|t| share * t);
    let mut points = Vec::new();
    for x in steps {
        for y in steps {
            for z in steps {
                let local = [x * half[0], y * half[1], z * half[2]];
                if contains_local(&part.primitive, local, 0.0) {
                    points.push(add(rotate(&part.rotation, local), part.centre_m));
                }
            }
        }
    }
    points
}

/// Whether a point lies in a primitive, `inset_m` from its surface or deeper (roughly).
fn contains_local(primitive: &Primitive, p: Vec3, inset_m: f64) -> bool {
    match *primitive {
        Primitive::Cuboid { half_m } => (0..3).all(|i| p[i].abs() <= half_m[i] - inset_m),
        Primitive::Pad { .. } => unreachable!("only trim has pads"),
        Primitive::Ellipsoid { half_m } => {
            let terms = (0..3).map(|i| (p[i] / (half_m[i] - inset_m).max(1e-9)).powi(2));
            terms.sum::<f64>() <= 1.0
        }
        Primitive::Frustum { bottom_m, top_m, half_height_m, sides } => {
            if p[1].abs() > half_height_m - inset_m {
                return false;
            }
            let t = 0.5 * (p[1] / half_height_m + 1.0);
            // Within the circle that the polygon goes around.
            let inner = (std::f64::consts::PI / f64::from(sides)).cos();
            let half =
                [0, 1].map(|i| inner * (bottom_m[i] + t * (top_m[i] - bottom_m[i])) - inset_m);
            half.iter().all(|h| *h > 0.0)
                && (p[0] / half[0]).powi(2) + (p[2] / half[1]).powi(2) <= 1.0
        }
    }
}

/// Whether a point lies in a part, `inset_m` from its surface or deeper.
pub fn contains(part: &Part, point: Vec3, inset_m: f64) -> bool {
    let offset = sub(point, part.centre_m);
    let local = [0, 1, 2].map(|i| (0..3).map(|j| part.rotation[j][i] * offset[j]).sum());
    contains_local(&part.primitive, local, inset_m)
}

/// Whether solids share points that lie more than 5 mm inside.
pub fn interpenetrate(a: &[Part], b: &[Part]) -> bool {
    let radius = |part: &Part| half_of(part).iter().map(|h| h * h).sum::<f64>().sqrt();
    let are_near = |p: &Part, q: &Part| {
        let offset = sub(p.centre_m, q.centre_m);
        offset.iter().map(|v| v * v).sum::<f64>().sqrt() < radius(p) + radius(q)
    };
    let holds = |p: &Part, q: &Part| points_in(p, 0.98).iter().any(|&x| contains(q, x, 0.005));
    a.iter().any(|p| b.iter().any(|q| are_near(p, q) && (holds(p, q) || holds(q, p))))
}
