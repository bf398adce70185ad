//! Curves keep what they promise, parameters do something, lanes have the bits of single values.

use glam::Vec3;
use heliostat_kernel::Isa;
use heliostat_scene::{ParameterValue, ShaderUse};

use super::{PixelFrame, PixelRegistry, filmic};
use crate::color::luminance;
use crate::surface::LaneMode;

/// A picture with a bright spot, a large and a small step in depth, a sharp and a gentle crease.
struct Picture {
    color: Vec<Vec3>,
    depth: Vec<f32>,
    normal: Vec<f32>,
}

const SIZE: [usize; 2] = [37, 9];

impl Picture {
    fn new() -> Self {
        let [width, height] = SIZE;
        let at = |i: usize| ((i % width) as f32, (i / width) as f32);
        let color =
            |i| Vec3::new(at(i).0 * 0.02, 0.3 + 0.01 * at(i).1, 0.1).powf(if i == 40 { -3.0 } else { 1.0 });
        let depth = |i| match at(i).0 {
            x if x < 10.0 => 2.0 + 0.1 * x,
            x if x < 25.0 => 8.0,
            x if x < 30.0 => 8.5,
            _ => 0.0,
        };
        let normal = |i| match at(i).1 {
            y if y < 4.0 => [0.0, 0.0, 1.0],
            y if y < 7.0 => [0.0, 1.0, 0.0],
            _ => [0.0, 0.9, 0.4],
        };
        let pixels = || 0..width * height;
        Self {
            color: pixels().map(color).collect(),
            depth: pixels().map(depth).collect(),
            normal: pixels().flat_map(normal).collect(),
        }
    }

    fn shaded(&self, shader: &ShaderUse, mode: LaneMode) -> Vec<Vec3> {
        let [width, height] = SIZE;
        let frame =
            PixelFrame { width, height, color: &self.color, depth: &self.depth, normal: &self.normal };
        let shader = PixelRegistry::built_in().bind(shader).expect("a shader");
        let mut out = vec![Vec3::ZERO; width * height];
        for (row, out) in out.chunks_mut(width).enumerate() {
            shader.row(mode, &frame, row, out);
        }
        out
    }
}

/// The answer for one colour everywhere.
fn answer(shader: &str, color: Vec3) -> Vec3 {
    let picture = Picture { color: vec![color; SIZE[0] * SIZE[1]], depth: Vec::new(), normal: Vec::new() };
    picture.shaded(&ShaderUse::named(shader), LaneMode::Single)[0]
}

#[test]
fn curves_rise_from_black_to_white() {
    for name in ["filmic", "reinhard", "aces", "agx", "clip"] {
        let values: Vec<f32> =
            (0..400).map(|i| luminance(answer(name, Vec3::splat((i as f32 * 0.05 - 14.0).exp2())))).collect();
        assert!(values.windows(2).all(|pair| pair[0] <= pair[1] + 2e-4), "{name}");
        assert!(
            values[0] < 2e-3 && values[399] > 0.9 && values[399] < 1.001,
            "{name}: {} {}",
            values[0],
            values[399]
        );
        for broken in [Vec3::NAN, Vec3::INFINITY, Vec3::NEG_INFINITY, Vec3::splat(-1.0)] {
            let shown = answer(name, broken);
            assert!(shown.cmpge(Vec3::ZERO).all() && shown.cmple(Vec3::ONE).all(), "{name}: {shown}");
        }
    }
    assert!((filmic(0.18_f32) - 0.18).abs() < 2e-3);
    // Reinhard's equation 4: its white is white, and at 1 it shows (1 + 1/16) / 2.
    assert!((answer("reinhard", Vec3::splat(4.0)).x - 1.0).abs() < 1e-6);
    assert!((answer("reinhard", Vec3::ONE).x - 0.53125).abs() < 1e-6);
    // AgX keeps middle grey near middle grey, as its authors show it.
    assert!((answer("agx", Vec3::splat(0.18)).x - 0.18).abs() < 0.04, "{}", answer("agx", Vec3::splat(0.18)));
    // A saturated bright light fades to white rather than staying pure.
    let blue = answer("agx", Vec3::new(0.0, 0.0, 60.0));
    assert!(blue.min_element() > 0.1, "{blue}");
}

#[test]
fn effects_do_what_they_say() {
    let picture = Picture::new();
    let mode = LaneMode::Single;
    let [width, height] = SIZE;
    let brighter = picture.shaded(&ShaderUse::named("exposure").with("stops", 2.0), mode);
    assert!(brighter.iter().zip(&picture.color).all(|(a, b)| a.distance(*b * 4.0) < 1e-5 * a.length()));
    let dark = picture.shaded(&ShaderUse::named("vignette"), mode);
    let share = |i: usize| luminance(dark[i]) / luminance(picture.color[i]);
    // cos⁴ of 45° in the very corner.
    assert!((share(0) - 0.25).abs() < 0.03 && (share(height / 2 * width + width / 2) - 1.0).abs() < 1e-2);
    let lines = picture.shaded(&ShaderUse::named("edges"), mode);
    let inked = |x: usize, y: usize| lines[y * width + x] == Vec3::ZERO;
    assert!(inked(9, 2) && inked(10, 2) && inked(29, 2), "outlines");
    assert!(inked(20, 3) && !inked(20, 2) && !inked(20, 5), "a crease");
    assert!(!inked(5, 2) && !inked(33, 2), "nothing on a slope and in the sky");
    let heat = |l: f32| answer("heat", Vec3::splat(l));
    assert!(heat(0.001) == Vec3::ZERO && heat(20.0).distance(Vec3::ONE) < 1e-5);
    let levels: Vec<f32> = (0..40).map(|i| luminance(heat((i as f32 * 0.25 - 6.5).exp2()))).collect();
    assert!(levels.windows(2).all(|pair| pair[0] <= pair[1] + 0.02), "{levels:?}");
}

#[test]
fn every_parameter_does_something() {
    let picture = Picture::new();
    for (name, program) in PixelRegistry::built_in().programs() {
        let plain = picture.shaded(&ShaderUse::named(name), LaneMode::Single);
        for parameter in program.info().parameters {
            let [low, high] = parameter.range;
            let other = low + 0.37 * (high.min(low.abs() + 3.0) - low);
            let set =
                ShaderUse::named(name).with(&parameter.name, ParameterValue::Vector(Vec3::splat(other)));
            assert_ne!(picture.shaded(&set, LaneMode::Single), plain, "{name}, {}", parameter.name);
        }
    }
}

#[test]
fn lanes_have_the_bits_of_single_pixels() {
    let picture = Picture::new();
    for name in PixelRegistry::built_in().programs().keys() {
        let single = picture.shaded(&ShaderUse::named(name), LaneMode::Single);
        for level in Isa::available().into_iter().filter_map(Isa::level) {
            assert_eq!(picture.shaded(&ShaderUse::named(name), LaneMode::Packets(level)), single, "{name}");
        }
    }
}

#[test]
fn what_cannot_be_bound_is_told() {
    let registry = PixelRegistry::built_in();
    let problem = |wanted: &ShaderUse| registry.bind(wanted).unwrap_err().0;
    assert!(problem(&ShaderUse::named("sepia")).contains("there are: aces, agx"));
    assert!(problem(&ShaderUse::named("heat").with("warm", 1.0)).contains("it has: low, high"));
    assert!(problem(&ShaderUse::named("clip").with("warm", 1.0)).contains("it has: none"));
    assert!(problem(&ShaderUse::named("exposure").with("stops", 99.0)).contains("from -30 to 30"));
    assert!(problem(&ShaderUse::named("exposure").with("stops", f32::NAN)).contains("from -30 to 30"));
}
