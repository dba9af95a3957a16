//! Shapes of food and utensils.

use crate::assets::shapes::{
    colour::{DARK, STEEL, WOODS, rgb, shade},
    sketch::{ALL, Along, Sketch, between},
};

/// Draw fruit, vegetables, eggs and bread.
pub fn food(s: &mut Sketch<'_>) {
    let [x, y, z] = s.spans();
    match s.asset().category.as_str() {
        "Apple" => {
            let skin = s
                .choose(&[rgb(185, 40, 40), rgb(120, 165, 60), rgb(205, 70, 50)], rgb(185, 40, 40));
            s.blob_at(ALL, [0.0, 0.88], ALL, skin);
            s.cuboid_at([0.46, 0.54], [0.8, 1.0], [0.46, 0.54], rgb(80, 55, 30));
        }
        "Tomato" => {
            s.blob_at(ALL, [0.0, 0.92], ALL, rgb(200, 45, 35));
            s.column_at([0.3, 0.7], [0.9, 1.0], [0.3, 0.7], 0.4, 5, rgb(70, 120, 50));
        }
        "Potato" => s.blob(x, y, z, rgb(170, 130, 85)),
        "Egg" => {
            s.blob(x, y, z, s.choose(&[rgb(235, 215, 190), rgb(245, 240, 232)], rgb(235, 215, 190)))
        }
        "Lettuce" => {
            s.blob_at(ALL, ALL, [0.0, 0.9], rgb(120, 165, 80));
            let stump = [between(x, 0.3, 0.7), between(y, 0.3, 0.7), between(z, 0.8, 1.0)];
            s.round(Along::Z, 0.6, 8, stump, rgb(185, 205, 150));
        }
        _ => {
            // Bread is a loaf with a rounded top.
            let crust = rgb(190, 130, 70);
            s.cuboid_at(ALL, [0.0, 0.6], ALL, crust);
            s.round(Along::Z, 1.0, 12, [x, between(y, 0.2, 1.0), z], shade(crust, 1.1));
        }
    }
}

/// Draw cutlery, cooking and writing tools: a handle and a tip along the longest side.
pub fn utensil(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, y, z] = s.spans();
    let (tip, grip) = match s.asset().category.as_str() {
        "Pen" => (rgb(40, 60, 140), rgb(35, 35, 40)),
        "Pencil" => (rgb(60, 50, 45), rgb(225, 175, 60)),
        "Spatula" => (DARK, WOODS[0]),
        "Knife" => (STEEL, DARK),
        _ => (STEEL, shade(STEEL, 0.85)),
    };
    let middle = |span| between(span, 0.3, 0.7);
    if d >= w && d >= h {
        s.cuboid_at(ALL, ALL, [0.55, 1.0], tip);
        s.cuboid(middle(x), middle(y), between(z, 0.0, 0.55), grip);
    } else if w >= h {
        s.cuboid_at([0.55, 1.0], ALL, ALL, tip);
        s.cuboid(between(x, 0.0, 0.55), middle(y), middle(z), grip);
    } else {
        s.cuboid_at(ALL, [0.0, 0.45], ALL, tip);
        s.cuboid(middle(x), between(y, 0.45, 1.0), middle(z), grip);
    }
}
