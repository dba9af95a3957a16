//! Draw all textures on one sheet, or views of a house in the default style, as PNG files.
//!
//! ```sh
//! cargo run --release --example materials -- sheet.png
//! cargo run --release --example materials -- view.png house.json x z yaw_deg [size_px]
//! ```

use std::{error::Error, fs};

use evonav_core::{
    assets::{
        Catalogue, UnknownAssets,
        material::{Layout, Material, MaterialKind},
    },
    geometry::Pose,
    house::House,
    sensors::{
        camera::Camera,
        png::encode_png,
        raster::{FrameBuffer, Style, Want, render},
    },
    textures::{NEUTRAL, texture_of},
    world::{mesh::SceneMesh, scene::Scene},
};

/// Size of a square of the sheet, with its margin.
const SQUARE_PX: usize = 132;
const COLUMNS: usize = 14;
/// Colour on which textures that are no pictures are drawn.
const GROUND: [f32; 3] = [150.0, 125.0, 100.0];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.as_slice() {
        [file] => sheet(file),
        [file, house, place @ ..] if place.len() >= 3 => view(file, house, place),
        _ => Err("give FILE, or FILE HOUSE X Z YAW_DEG [SIZE_PX]".into()),
    }
}

fn sheet(file: &str) -> Result<(), Box<dyn Error>> {
    let shown = MaterialKind::ALL
        .iter()
        .filter(|kind| kind.layout() != Layout::Plain && kind.drawn_as() == **kind)
        .flat_map(|&kind| {
            (0..kind.num_variants()).map(move |v| Material { kind, variant: v as u8 })
        });
    let squares: Vec<Material> = shown.collect();
    let [width, height] = [COLUMNS, squares.len().div_ceil(COLUMNS)].map(|n| n * SQUARE_PX);
    let mut rgb = vec![255; 3 * width * height];
    for (index, &material) in squares.iter().enumerate() {
        let Some(texture) = texture_of(material) else { continue };
        let own = if material.kind.is_picture() { [NEUTRAL; 3] } else { GROUND };
        let level = texture.finest();
        for (y, x) in (0..128).flat_map(|y| (0..128).map(move |x| (y, x))) {
            let texel = level.texel(x * level.size() / 128, y * level.size() / 128);
            let [left, top] = [index % COLUMNS, index / COLUMNS].map(|n| n * SQUARE_PX);
            let first = 3 * ((top + y) * width + left + x);
            for i in 0..3 {
                rgb[first + i] = (own[i] * texel[i] / NEUTRAL) as u8;
            }
        }
    }
    Ok(fs::write(file, encode_png(&rgb, [height, width])?)?)
}

fn view(file: &str, house: &str, place: &[String]) -> Result<(), Box<dyn Error>> {
    let house = House::from_json("house", &fs::read_to_string(house)?)?;
    let scene = Scene::build(&house, Catalogue::bundled(), UnknownAssets::CategoryDefault)?;
    let mesh = SceneMesh::build(&scene);
    let numbers: Vec<f64> = place.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
    let size_px = numbers.get(3).map_or(600, |&size| size as usize);
    let pose = Pose {
        position_m: [numbers[0], 0.9, numbers[1]],
        yaw_rad: numbers[2].to_radians(),
        horizon_rad: 0.4,
    };
    let camera = Camera::at(&pose, [size_px, size_px], std::f64::consts::FRAC_PI_2, 1.575);
    let mut frame = FrameBuffer::default();
    render(&mesh, &camera, Want { rgb: Some(Style::Default), instances: false }, &mut frame)?;
    Ok(fs::write(file, encode_png(&frame.rgb, [size_px, size_px])?)?)
}
