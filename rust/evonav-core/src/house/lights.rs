//! Lamps of a house, from its document.

use serde_json::Value;

use crate::{geometry::Vec3, house::House};

/// A lamp that shines in all directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lamp {
    /// Place of the lamp.
    pub position_m: Vec3,
    /// Colour, 0..1, times intensity.
    pub power: [f32; 3],
}

impl House {
    /// Return the point lights of the document; entries that are malformed are left out, since
    /// nothing but colours depends on them.
    pub fn lamps(&self) -> Vec<Lamp> {
        let lights = &self.document["proceduralParameters"]["lights"];
        lights.as_array().into_iter().flatten().filter_map(lamp).collect()
    }
}

fn lamp(light: &Value) -> Option<Lamp> {
    if light["type"] != "point" {
        return None;
    }
    let triple = |node: &Value, keys: [&str; 3]| -> Option<Vec3> {
        let [a, b, c] = keys.map(|key| node[key].as_f64().filter(|v| v.is_finite()));
        Some([a?, b?, c?])
    };
    let intensity = light["intensity"].as_f64()?.clamp(0.0, 2.0);
    let power = triple(&light["rgb"], ["r", "g", "b"])?;
    let power = power.map(|channel| (channel.clamp(0.0, 1.0) * intensity) as f32);
    Some(Lamp { position_m: triple(&light["position"], ["x", "y", "z"])?, power })
}
