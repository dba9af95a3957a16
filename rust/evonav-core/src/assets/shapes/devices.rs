//! Shapes of screens, lamps and gadgets.

use std::f64::consts::FRAC_PI_2;

use crate::assets::{
    material::MaterialKind,
    shapes::{
        colour::{DARK, Paint, STEEL, lightest, rgb, shade},
        sketch::{ALL, Along, Motion, Sketch, Span, between, inside},
    },
};

const SCREEN: Paint = rgb(25, 28, 34).of(MaterialKind::DarkScreen);
/// Paint of a screen that is on.
const LIT_SCREEN: Paint = rgb(120, 165, 215).of(MaterialKind::LitScreen);
/// Paint of a lamp's shade that is on.
const LIT_SHADE: Paint = rgb(255, 244, 205);

/// Draw a flat screen; on a foot, or bare where the box is too thin for one.
pub fn television(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, y, z] = s.spans();
    let frame = s.tint(0, DARK);
    let screen = if s.condition().is_on == Some(true) { LIT_SCREEN } else { SCREEN };
    if d < 0.15 {
        s.cuboid(x, y, [z[0], z[1] - 0.01], frame);
        s.cuboid(inside(x, 0.03 * w), inside(y, 0.04 * h), [z[1] - 0.01, z[1]], screen);
        bezel(s, [x, y, [z[1] - 0.012, z[1]]], frame);
        return;
    }
    s.detail("stand", 1);
    let panel = [-0.03, 0.03];
    let bottom = 0.1 * h;
    s.cuboid(x, [bottom, h], panel, frame);
    let (glass, neck) = ([panel[1], panel[1] + 0.006], [panel[0] - 0.03, panel[0]]);
    s.cuboid(inside(x, 0.03 * w), [bottom + 0.04 * h, 0.97 * h], glass, screen);
    s.cuboid(between(x, 0.44, 0.56), [0.015, 0.5 * h], neck, shade(frame, 1.3));
    s.cuboid(between(x, 0.25, 0.75), [0.0, 0.02], z, shade(frame, 1.3));
    bezel(s, [x, [bottom, h], [panel[1] - 0.002, panel[1] + 0.01]], frame);
    s.trim(|s| {
        let neck = [between(x, 0.43, 0.57), [0.0, bottom + 0.02], [-0.02, 0.02]];
        s.pad(neck[0], neck[1], neck[2], 0.01, shade(frame, 0.8));
    });
}

/// Draw a bezel with a lighter lower edge around a screen, as trim.
fn bezel(s: &mut Sketch<'_>, spans: [Span; 3], frame: Paint) {
    let [x, y, z] = spans;
    let edge = (0.03 * (x[1] - x[0])).min(0.04 * (y[1] - y[0])).min(0.03);
    s.trim(|s| {
        s.rim(spans, [0, 1], edge, shade(frame, 0.6));
        let strip = [y[0], y[0] + 0.35 * edge];
        s.cuboid(x, strip, [z[0], z[1] + 0.002], shade(frame, 1.6));
    });
}

/// Draw a laptop: base with keyboard, lid upright at the back.
pub fn laptop(s: &mut Sketch<'_>) {
    let [w, h, _] = s.size();
    let [x, _, z] = s.spans();
    let shell = s.tint(0, s.choose(&[STEEL, DARK, rgb(90, 95, 105)], STEEL));
    let base = (0.1 * h).min(0.025);
    let lid = between(z, 0.0, 0.06);
    s.cuboid(x, [0.0, base], z, shell);
    s.cuboid(
        inside(x, 0.06 * w),
        [base, base + 0.004],
        between(z, 0.15, 0.6),
        DARK.of(MaterialKind::Keyboard),
    );
    s.trim(|s| {
        // The hand rest with its touch pad.
        let touch = between(z, 0.66, 0.92);
        s.cuboid(between(x, 0.34, 0.66), [base, base + 0.003], touch, shade(shell, 0.75));
        let edge = [base - 0.004, base + 0.001];
        s.rim([x, edge, z], [0, 2], 0.006, shade(shell, 1.15));
    });
    let is_closed = s.condition().openness.is_some_and(|openness| openness < 0.2);
    s.detail(if is_closed { "closed lid" } else { "open lid" }, 1);
    let pivot_m = [0.0, base + 0.004, lid[1] + 0.004];
    s.closing(Motion::Hinge { pivot_m, axis: Along::X, angle_rad: FRAC_PI_2 }, |s| {
        s.cuboid(x, [base, h], lid, shell);
        let screen = [base + 0.06 * h, 0.95 * h];
        s.cuboid(inside(x, 0.04 * w), screen, [lid[1], lid[1] + 0.004], SCREEN);
        s.trim(|s| {
            // A black bezel around the screen.
            let glass = [lid[1] + 0.003, lid[1] + 0.005];
            let picture = if s.condition().is_on == Some(true) { LIT_SCREEN } else { SCREEN };
            s.cuboid(inside(x, 0.045 * w), inside(screen, 0.01 * h), glass, picture);
            let frame =
                [inside(x, 0.01 * w), [base + 0.02 * h, 0.99 * h], [lid[1], lid[1] + 0.006]];
            s.rim(frame, [0, 1], 0.035 * w, DARK);
        });
    });
}

/// Draw a computer: a screen, a keyboard in front and a tower beside.
pub fn desktop(s: &mut Sketch<'_>) {
    let h = s.size()[1];
    let [x, _, z] = s.spans();
    s.cuboid(between(x, 0.0, 0.72), [0.25 * h, h], between(z, 0.2, 0.32), DARK);
    s.cuboid(between(x, 0.02, 0.7), [0.29 * h, 0.97 * h], between(z, 0.32, 0.34), SCREEN);
    s.cuboid(between(x, 0.3, 0.42), [0.0, 0.3 * h], between(z, 0.1, 0.2), DARK);
    s.cuboid(
        between(x, 0.1, 0.62),
        [0.0, 0.02],
        between(z, 0.65, 1.0),
        shade(DARK, 1.5).of(MaterialKind::Keyboard),
    );
    s.cuboid(between(x, 0.78, 1.0), [0.0, 0.8 * h], z, shade(DARK, 1.2));
}

/// Draw a lamp: foot, pole and shade.
pub fn lamp(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, _, z] = s.spans();
    let metal = s.tint(0, s.choose(&[DARK, STEEL, rgb(150, 115, 70)], DARK));
    let cloths = [rgb(240, 228, 200), rgb(225, 225, 220), rgb(215, 180, 130)];
    s.detail("lampshade", 1);
    let cloth = lightest(s.asset(), s.choose(&cloths, cloths[0])).of(MaterialKind::Fabric);
    let cloth = if s.condition().is_on == Some(true) { LIT_SHADE } else { cloth };
    let is_floor = s.asset().category == "FloorLamp";
    let (foot, shade_from) = if is_floor { (0.02, 0.82) } else { (0.07, 0.55) };
    let pole = (0.012 + 0.01 * w) / w.max(d);
    s.column(between(x, 0.2, 0.8), [0.0, foot * h], between(z, 0.2, 0.8), 0.9, 12, metal);
    let middle = |span| between(span, 0.5 - pole, 0.5 + pole);
    s.column(middle(x), [foot * h, 0.9 * h], middle(z), 1.0, 6, metal);
    s.column_at(ALL, [shade_from, 1.0], ALL, s.choose(&[0.6, 0.75, 1.0], 0.75), 16, cloth);
}

/// Draw a body with a face: phones, remote controls, switches, clocks, watches.
pub fn gadget(s: &mut Sketch<'_>) {
    let [_, h, d] = s.size();
    let is_switch = s.asset().category == "LightSwitch";
    let plain = s.choose(&[DARK, rgb(180, 60, 55), STEEL], DARK);
    let body = s.tint(0, if is_switch { rgb(235, 233, 225) } else { plain });
    if h > d {
        s.cuboid_at(ALL, ALL, [0.0, 0.7], body);
        let face = if is_switch {
            shade(body, 0.8)
        } else {
            rgb(230, 232, 225).of(MaterialKind::ClockFace)
        };
        let inner = if is_switch { [0.38, 0.62] } else { [0.15, 0.85] };
        s.cuboid_at(inner, [0.25, 0.75], [0.7, 1.0], face);
    } else {
        s.cuboid_at(ALL, [0.0, 0.8], ALL, body);
        s.cuboid_at(
            [0.1, 0.9],
            [0.8, 1.0],
            [0.1, 0.9],
            rgb(60, 70, 85).of(MaterialKind::DarkScreen),
        );
    }
}

/// Draw a vacuum cleaner: a head on the floor, a body and an upright handle.
pub fn vacuum_cleaner(s: &mut Sketch<'_>) {
    let [x, y, z] = s.spans();
    let body = s.tint(0, rgb(160, 45, 45));
    s.cuboid_at(ALL, [0.0, 0.1], [0.45, 1.0], DARK);
    s.column_at([0.25, 0.75], [0.08, 0.6], [0.1, 0.6], 0.8, 8, body);
    s.cuboid_at([0.44, 0.56], [0.55, 1.0], [0.0, 0.15], STEEL);
    let wheel = [between(x, 0.1, 0.9), between(y, 0.0, 0.14), between(z, 0.2, 0.45)];
    s.round(Along::X, 1.0, 8, wheel, DARK);
}
