//! Exposure and tone curves.

use super::{PixelInfo, PixelRegistry, PixelShader, PixelValues, Pixels};
use crate::lanes::{Real, Vector, exp2, log2, pow};
use crate::shader::Parameter;

pub(super) fn register(registry: &mut PixelRegistry) {
    registry.register(Exposure);
    registry.register(Filmic);
    registry.register(Reinhard);
    registry.register(Aces);
    registry.register(Agx);
    registry.register(Clip);
}

fn curve(name: &str, about: &str, parameters: Vec<Parameter>) -> PixelInfo {
    PixelInfo { name: name.into(), about: about.into(), parameters, for_display: true, needs_geometry: false }
}

/// Three rows times a vector.
#[inline(always)]
fn transform<F: Real>(rows: &[[f32; 3]; 3], v: Vector<F>) -> Vector<F> {
    let [r, g, b] = rows;
    Vector::new(
        v.x * r[0] + v.y * r[1] + v.z * r[2],
        v.x * g[0] + v.y * g[1] + v.z * g[2],
        v.x * b[0] + v.y * b[1] + v.z * b[2],
    )
}

/// Stops of exposure.
#[derive(Debug)]
struct Exposure;

impl PixelShader for Exposure {
    fn info(&self) -> PixelInfo {
        let stops = Parameter::float("stops", 1.0, [-30.0, 30.0], "EV", "doublings of all radiance");
        PixelInfo { for_display: false, ..curve("exposure", "brighter or darker by stops", vec![stops]) }
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Pixels<'_, F>, values: &PixelValues<'_, F>) -> Vector<F> {
        at.color(0, 0) * exp2(values.float(0))
    }
}

/// A filmic curve from [0, ∞) to [0, 1): a slight toe, a straight middle, a long shoulder; keeps middle grey, 0.18.
///
/// # References
/// Narkowicz, "ACES Filmic Tone Mapping Curve", 2016; scaled so that middle grey is kept.
#[inline(always)]
pub fn filmic<F: Real>(x: F) -> F {
    let x = x.clamp(0.0, 1e6) * 0.718;
    ((x * (x * 2.51 + 0.03)) / (x * (x * 2.43 + 0.59) + 0.14)).clamp(0.0, 1.0)
}

/// [`filmic`] for each channel.
#[derive(Debug)]
struct Filmic;

impl PixelShader for Filmic {
    fn info(&self) -> PixelInfo {
        curve("filmic", "a slight toe, a straight middle, a long shoulder, for each channel", Vec::new())
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Pixels<'_, F>, _: &PixelValues<'_, F>) -> Vector<F> {
        let Vector { x, y, z } = at.color(0, 0);
        Vector::new(filmic(x), filmic(y), filmic(z))
    }
}

/// Compresses luminance and keeps hues.
///
/// # References
/// Reinhard, Stark, Shirley, Ferwerda, "Photographic Tone Reproduction for Digital Images", 2002, equation 4.
#[derive(Debug)]
struct Reinhard;

impl PixelShader for Reinhard {
    fn info(&self) -> PixelInfo {
        let about = "the least luminance that is shown as white";
        let white = Parameter::float("white", 4.0, [0.1, 1e6], "", about);
        curve("reinhard", "compresses luminance, the brighter the more, and keeps hues", vec![white])
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Pixels<'_, F>, values: &PixelValues<'_, F>) -> Vector<F> {
        let color = at.color(0, 0).clamp(0.0, 1e9);
        let luminance = color.luminance();
        let white = values.float(0);
        let share = (luminance / (white * white) + 1.0) / (luminance + 1.0);
        (color * share).clamp(0.0, 1.0)
    }
}

/// A fit of the reference rendering and output transforms of the Academy Color Encoding System, in the form by Hill.
///
/// # References
/// Hill, fit of the ACES RRT and ODT for sRGB, 2016; AMPAS, "Academy Color Encoding System", 2014.
#[derive(Debug)]
struct Aces;

const ACES_IN: [[f32; 3]; 3] =
    [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]];
const ACES_OUT: [[f32; 3]; 3] =
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];

impl PixelShader for Aces {
    fn info(&self) -> PixelInfo {
        curve(
            "aces",
            "like film by the Academy's transforms: contrast, and bright colours fade to white",
            Vec::new(),
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Pixels<'_, F>, _: &PixelValues<'_, F>) -> Vector<F> {
        let color = transform(&ACES_IN, at.color(0, 0).clamp(0.0, 1e6));
        let fitted = Vector::new(aces(color.x), aces(color.y), aces(color.z));
        transform(&ACES_OUT, fitted).clamp(0.0, 1.0)
    }
}

#[inline(always)]
fn aces<F: Real>(x: F) -> F {
    (x * (x + 0.024_578_6) - 0.000_090_537) / (x * (x * 0.983_729 + 0.432_951) + 0.238_081)
}

/// Desaturates what is bright along natural paths, in the polynomial form by Wrensch.
///
/// # References
/// Sobotka, AgX, 2022; Wrensch, "Minimal AgX Implementation", 2023.
#[derive(Debug)]
struct Agx;

const AGX_IN: [[f32; 3]; 3] = [
    [0.842_479_06, 0.078_433_6, 0.079_223_745],
    [0.042_328_242, 0.878_468_6, 0.079_166_13],
    [0.042_375_655, 0.078_433_6, 0.879_143],
];
const AGX_OUT: [[f32; 3]; 3] = [
    [1.196_879, -0.098_020_88, -0.099_029_74],
    [-0.052_896_85, 1.151_903_1, -0.098_961_18],
    [-0.052_971_635, -0.098_043_45, 1.151_073_7],
];
/// Stops that the curve covers, as log₂ of radiance.
const AGX_STOPS: [f32; 2] = [-12.473_93, 4.026_069];

impl PixelShader for Agx {
    fn info(&self) -> PixelInfo {
        let about = "more is more vivid";
        let saturation = Parameter::float("saturation", 1.0, [0.0, 2.0], "", about);
        curve("agx", "soft contrast; bright colours fade to white along natural paths", vec![saturation])
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Pixels<'_, F>, values: &PixelValues<'_, F>) -> Vector<F> {
        let color = transform(&AGX_IN, at.color(0, 0).clamp(0.0, 1e6));
        let curved = Vector::new(agx(color.x), agx(color.y), agx(color.z));
        let grey = Vector::grey(curved.luminance());
        let vivid = grey.mix(curved, values.float(0));
        let shown = transform(&AGX_OUT, vivid).clamp(0.0, 1.0);
        // The curve answers as displays of gamma 2.2 take it.
        let gamma = shown.x.splat(2.2);
        let linear = Vector::new(pow(shown.x, gamma), pow(shown.y, gamma), pow(shown.z, gamma));
        linear.clamp(0.0, 1.0)
    }
}

#[inline(always)]
fn agx<F: Real>(radiance: F) -> F {
    let [low, high] = AGX_STOPS;
    let x = ((log2(radiance) - low) * (1.0 / (high - low))).clamp(0.0, 1.0);
    let p = x * 15.5 - 40.14;
    let p = p * x + 31.96;
    let p = p * x - 6.868;
    let p = p * x + 0.4298;
    let p = p * x + 0.1191;
    p * x - 0.00232
}

/// No curve.
#[derive(Debug)]
struct Clip;

impl PixelShader for Clip {
    fn info(&self) -> PixelInfo {
        curve("clip", "no curve: radiance up to 1 as it is, more as 1", Vec::new())
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Pixels<'_, F>, _: &PixelValues<'_, F>) -> Vector<F> {
        at.color(0, 0).clamp(0.0, 1.0)
    }
}
