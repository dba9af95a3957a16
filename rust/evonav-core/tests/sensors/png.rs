//! PNG files hold every pixel of the image, whatever its size, and nothing else.

use std::io::Cursor;

use evonav_core::{
    Error,
    sensors::png::{decode_png, encode_png},
};
use png::{BitDepth, ColorType, Decoder, Encoder};
use proptest::{collection::vec, prelude::*};

/// Decode a PNG file of RGB: its pixels and shape.
fn decoded(file: &[u8]) -> (Vec<u8>, [usize; 2]) {
    let mut reader = Decoder::new(Cursor::new(file)).read_info().expect("a PNG file");
    let mut rgb = vec![0; reader.output_buffer_size().expect("a small image")];
    let info = reader.next_frame(&mut rgb).expect("an image");
    assert_eq!((info.color_type, info.buffer_size()), (ColorType::Rgb, rgb.len()));
    (rgb, [info.height as usize, info.width as usize])
}

/// The names of a file's chunks, in order.
fn chunks(file: &[u8]) -> Vec<&[u8]> {
    let mut rest = &file[8..];
    let mut names = Vec::new();
    while let Some((length, after)) = rest.split_first_chunk::<4>() {
        names.push(&after[..4]);
        rest = &after[4 + u32::from_be_bytes(*length) as usize + 4..];
    }
    names
}

/// An image of any shape: noise, or one row that each row repeats, changed at one byte.
fn image() -> impl Strategy<Value = (Vec<u8>, [usize; 2])> {
    let shape = prop_oneof![
        Just([1, 1]),
        [1..24_usize, 1..24_usize],
        [1..3_usize, 200..900_usize],
        [200..900_usize, 1..3_usize],
    ];
    shape.prop_flat_map(|[height, width]| {
        let noise = vec(any::<u8>(), height * width * 3);
        let repeated = (vec(any::<u8>(), width * 3), 0..height * width * 3, any::<u8>());
        let repeated = repeated.prop_map(move |(row, at, byte)| {
            let mut rgb = row.repeat(height);
            rgb[at] = byte;
            rgb
        });
        (prop_oneof![noise, repeated], Just([height, width]))
    })
}

proptest! {
    #[test]
    fn every_pixel_is_decoded_as_it_was((rgb, shape) in image()) {
        let file = encode_png(&rgb, shape).unwrap();
        prop_assert_eq!(decoded(&file), (rgb.clone(), shape));
        prop_assert_eq!(decode_png(&file), Ok((rgb, shape)));
        let chunks = chunks(&file);
        prop_assert_eq!((chunks[0], chunks[chunks.len() - 1]), (&b"IHDR"[..], &b"IEND"[..]));
        prop_assert!(chunks[1..chunks.len() - 1].iter().all(|name| name == b"IDAT"));
    }
}

#[test]
fn bytes_that_are_not_of_the_shape_are_refused() {
    for (num_bytes, shape) in [(0, [0, 4]), (0, [4, 0]), (11, [2, 2]), (13, [2, 2]), (0, [1, 1])] {
        let found = encode_png(&vec![0; num_bytes], shape);
        assert!(
            matches!(&found, Err(Error::InvalidArgument { name, .. }) if name == "rgb"),
            "{found:?}"
        );
    }
}

#[test]
fn files_of_other_kinds_and_parts_of_files_are_refused() {
    let mut grey = Vec::new();
    let mut encoder = Encoder::new(&mut grey, 2, 1);
    encoder.set_color(ColorType::Grayscale);
    encoder.set_depth(BitDepth::Eight);
    encoder.write_header().unwrap().write_image_data(&[0, 1]).unwrap();
    let whole = encode_png(&[1, 2, 3, 4, 5, 6], [1, 2]).unwrap();
    for file in [&grey[..], b"", b"text", &whole[..whole.len() - 12], &whole[..40]] {
        let found = decode_png(file);
        assert!(
            matches!(&found, Err(Error::InvalidArgument { name, .. }) if name == "file"),
            "{found:?}"
        );
    }
}
