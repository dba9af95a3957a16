//! The lights of a house (`lights` and `skyboxes` of the package `procthor`).

use serde_json::{Value, json};

use crate::{
    geometry::Vec2,
    house_generation::{
        appearance::HouseLook, document::layers::NUM_LAYERS, parameters::TimeOfDay,
        structure::Structure,
    },
};

/// Distance of a room's lamp from the ceiling.
const BELOW_CEILING_M: f64 = 0.2;

/// Return the sun and a lamp for each room.
pub(super) fn lights(
    structure: &Structure,
    look: &HouseLook,
    layers: Option<&[usize]>,
) -> Vec<Value> {
    let (angles, sun, colour, lamp) = match look.time {
        TimeOfDay::Midday => ([66.0, 75.0, 0.0], 1.0, [1.0, 1.0, 1.0], 0.45),
        TimeOfDay::GoldenHour => ([6.0, -166.0, 0.0], 1.0, [1.0, 0.694, 0.78], 0.75),
        TimeOfDay::BlueHour => ([82.0, -30.0, 0.0], 0.5, [0.638, 0.843, 1.0], 0.75),
    };
    let shadow = |bias: f64| {
        json!({
            "type": "Soft", "strength": 1, "normalBias": 0, "bias": bias, "nearPlane": 0.2,
            "resolution": "FromQualitySettings",
        })
    };
    let rgb = |[r, g, b]: [f64; 3]| json!({"r": r, "g": g, "b": b});
    let mut lights = vec![json!({
        "id": "DirectionalLight",
        "position": {"x": 0.84, "y": 0.1855, "z": -1.09},
        "rotation": {"x": angles[0], "y": angles[1], "z": angles[2]},
        "shadow": shadow(0.0),
        "type": "directional",
        "intensity": sun,
        "indirectMultiplier": 1.0,
        "rgb": rgb(colour),
    })];
    for (index, room) in structure.rooms.iter().enumerate() {
        let [x, z] = centroid_m(&room.polygon_m());
        let mut light = json!({
            "id": format!("light_{}", room.number),
            "type": "point",
            "position": {"x": x, "y": structure.height_m - BELOW_CEILING_M, "z": z},
            "intensity": lamp,
            "range": 15,
            "rgb": rgb([1.0, 0.855, 0.722]),
            "shadow": shadow(0.05),
        });
        if let Some(&own) = layers.and_then(|layers| layers.get(index)) {
            let others = (0..NUM_LAYERS).filter(|&layer| layer != own);
            let names: Vec<String> = others.map(|layer| format!("Procedural{layer}")).collect();
            light["layer"] = json!(format!("Procedural{own}"));
            light["cullingMaskOff"] = json!(names);
        }
        lights.push(light);
    }
    lights
}

/// Return the centroid of a polygon's area.
fn centroid_m(polygon_m: &[Vec2]) -> Vec2 {
    let (mut area, mut sum) = (0.0, [0.0; 2]);
    for (a, b) in polygon_m.iter().zip(polygon_m.iter().cycle().skip(1)) {
        let cross = a[0] * b[1] - b[0] * a[1];
        area += cross;
        (0..2).for_each(|i| sum[i] += cross * (a[i] + b[i]));
    }
    sum.map(|value| value / (3.0 * area))
}
