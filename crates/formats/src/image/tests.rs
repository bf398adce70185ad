//! Tests of reading and writing pictures.

use glam::Vec3;
use heliostat_scene::{Pixels, Plane, PlaneData};
use image_crate::codecs::png::PngEncoder;
use image_crate::{ExtendedColorType, ImageEncoder};

use super::*;

fn encode(pixels: &[u8], width: u32, height: u32, kind: ExtendedColorType) -> Vec<u8> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(pixels, width, height, kind).unwrap();
    bytes
}

fn rgba8(name: &str, bytes: &[u8]) -> Vec<u8> {
    match decode(name, bytes, &Limits::default()).unwrap().pixels {
        Pixels::Rgba8(values) => values,
        Pixels::RgbaF32(_) => panic!("expected 8 bits"),
    }
}

#[test]
fn png_of_every_kind_becomes_rgba8() {
    let rgb = encode_png(2, 1, &[1, 2, 3, 4, 5, 6]).unwrap();
    assert_eq!(rgba8("a.png", &rgb), [1, 2, 3, 255, 4, 5, 6, 255]);
    let grey = encode(&[7, 9], 2, 1, ExtendedColorType::L8);
    assert_eq!(rgba8("no extension", &grey), [7, 7, 7, 255, 9, 9, 9, 255]);
    let grey_alpha = encode(&[7, 9], 1, 1, ExtendedColorType::La8);
    assert_eq!(rgba8("a.png", &grey_alpha), [7, 7, 7, 9]);
    let deep: Vec<u8> = [0u16, 0x8080, 0xFFFF].iter().flat_map(|v| v.to_ne_bytes()).collect();
    assert_eq!(rgba8("a.png", &encode(&deep, 1, 1, ExtendedColorType::Rgb16)), [0, 128, 255, 255]);
}

#[test]
fn tga_is_recognised_by_its_name() {
    let mut tga = vec![0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 24, 0x20];
    tga.extend([3, 2, 1]);
    assert_eq!(rgba8("a.TGA", &tga), [1, 2, 3, 255]);
    assert!(matches!(decode("a.bin", &tga, &Limits::default()), Err(LoadError::Unsupported(_))));
}

#[test]
fn exr_keeps_every_bit_and_names_the_planes() {
    let color = [Vec3::new(1e-8, 2.5, 7e5), Vec3::new(0.1, 0.2, 0.3)];
    let planes = [
        PlaneData { plane: Plane::Normal, values: vec![0.0, 1.0, 0.0, 0.5, 0.25, -1.0] },
        PlaneData { plane: Plane::Depth, values: vec![3.0, 4.0] },
    ];
    let bytes = encode_exr(2, 1, &color, &planes).unwrap();
    let image = decode("a.exr", &bytes, &Limits::default()).unwrap();
    assert_eq!(image.pixels, Pixels::RgbaF32(vec![1e-8, 2.5, 7e5, 1.0, 0.1, 0.2, 0.3, 1.0]));
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(&bytes), true).unwrap();
    let names: Vec<_> = meta.headers[0].channels.list.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["B", "G", "R", "depth.Z", "normal.X", "normal.Y", "normal.Z"]);
}

#[test]
fn hdr_comes_back_within_its_precision() {
    let bytes = encode_hdr(1, 2, &[Vec3::new(100.0, 50.0, 0.5), Vec3::new(-1.0, 1e-3, 1e-3)]).unwrap();
    let Pixels::RgbaF32(values) = decode("a.hdr", &bytes, &Limits::default()).unwrap().pixels else {
        panic!("expected floats")
    };
    assert!((values[0] - 100.0).abs() < 1.0 && (values[1] - 50.0).abs() < 1.0);
    assert_eq!(values[4], 0.0);
    assert!((values[5] - 1e-3).abs() < 1e-5);
}

#[test]
fn wrong_lengths_are_refused_when_writing() {
    assert!(matches!(encode_png(2, 2, &[0; 5]), Err(EncodeError::Size { expected: 12, .. })));
    assert!(matches!(encode_exr(0, 2, &[], &[]), Err(EncodeError::Format(_))));
    let plane = PlaneData { plane: Plane::Albedo, values: vec![0.0] };
    assert!(encode_exr(1, 1, &[Vec3::ONE], &[plane]).unwrap_err().to_string().contains("albedo"));
}

#[test]
fn truncated_and_oversized_images_are_errors() {
    let png = encode_png(64, 64, &[100; 64 * 64 * 3]).unwrap();
    for len in 0..png.len() {
        // The decoder forgives a missing end marker, nothing else.
        let result = decode("a.png", &png[..len], &Limits::default());
        assert!(result.is_err() || len + 16 > png.len(), "{len} of {}", png.len());
    }
    let small = Limits { image_pixels: 64 * 63, ..Limits::default() };
    assert!(matches!(decode("a.png", &png, &small), Err(LoadError::Limit(_))));
    let poor = Limits { memory_bytes: 64 * 64 * 4 - 1, ..Limits::default() };
    assert!(matches!(decode("a.png", &png, &poor), Err(LoadError::Limit(_))));
    // A header that claims 4 billion pixels.
    let mut bomb = png.clone();
    bomb[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    assert!(decode("a.png", &bomb, &Limits::default()).is_err());
}

#[test]
fn exr_headers_are_checked_before_anything_is_allocated() {
    let bytes = encode_exr(64, 64, &[Vec3::ONE; 64 * 64], &[]).unwrap();
    let small = Limits { image_pixels: 100, ..Limits::default() };
    assert!(matches!(decode("a.exr", &bytes, &small), Err(LoadError::Limit(_))));
    let poor = Limits { memory_bytes: 1000, ..Limits::default() };
    assert!(matches!(decode("a.exr", &bytes, &poor), Err(LoadError::Limit(_))));
    assert!(matches!(decode("a.exr", &bytes[..200], &Limits::default()), Err(LoadError::Input(_))));
}

#[test]
fn damaged_exr_files_of_every_compression_never_panic() {
    use exr::prelude::{
        Compression, Encoding, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage, f16,
    };
    for compression in
        [Compression::RLE, Compression::ZIP16, Compression::PIZ, Compression::PXR24, Compression::B44]
    {
        let channels = SpecificChannels::rgb(|at: Vec2<usize>| {
            (f16::from_f32(at.x() as f32), f16::from_f32(at.y() as f32), f16::ONE)
        });
        let encoding = Encoding { compression, ..Encoding::default() };
        let layer = Layer::new((9, 7), LayerAttributes::default(), encoding, channels);
        let mut bytes = Cursor::new(Vec::new());
        exr::prelude::Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
        let bytes = bytes.into_inner();
        let image = decode("a.exr", &bytes, &Limits::default()).unwrap();
        assert_eq!((image.width, image.height), (9, 7), "{compression}");
        for position in 0..bytes.len() {
            for value in [0, 255] {
                let mut damaged = bytes.clone();
                damaged[position] = value;
                // Whether it is still an image is the decoder's to say.
                if let Err(error) = decode("a.exr", &damaged, &Limits::default()) {
                    assert!(!error.problem().is_empty());
                }
            }
        }
    }
}

#[test]
fn damaged_images_of_every_other_format_never_panic() {
    let picture: Vec<u8> = (0..20 * 17 * 3).map(|i| (i * 7 % 256) as u8).collect();
    let picture = image_crate::RgbImage::from_raw(20, 17, picture).unwrap();
    for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Tga] {
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, format).unwrap();
        let bytes = bytes.into_inner();
        assert!(decode("a.tga", &bytes, &Limits::default()).is_ok(), "{format:?}");
        // Headers in full, data in samples.
        for position in (0..bytes.len()).filter(|p| *p < 700 || p % 13 == 0) {
            for value in [0, 0x24, 0x41, 255] {
                let mut damaged = bytes.clone();
                damaged[position] = value;
                let limits = Limits { image_pixels: 1 << 20, memory_bytes: 1 << 26, ..Limits::default() };
                if let Err(error) = decode("a.tga", &damaged, &limits) {
                    assert!(!error.problem().is_empty());
                }
            }
        }
    }
}
