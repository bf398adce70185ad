//! Marble: veins where a wave, bent by turbulence, has its crests.

use super::{make_plastic, plastic, relief::footprint};
use crate::closure::Closure;
use crate::lanes::noise::{Octaves, fbm, ridged, smooth_step};
use crate::lanes::{Real, Vector, cos_sin_turns, pow};
use crate::shader::{Inputs, Parameter, Point, ShaderInfo, SurfaceShader};

const BASE: usize = 0;
const VEIN: usize = 1;
const SIZE: usize = 2;
const TURBULENCE: usize = 3;
const SHARPNESS: usize = 4;
const HAIRLINES: usize = 5;
const CLOUDINESS: usize = 6;
const ROUGHNESS: usize = 7;

/// The direction across the veins.
const ACROSS: glam::Vec3 = glam::Vec3::new(0.68, 0.49, 0.545);

/// Polished marble.
///
/// # References
/// Perlin, "An Image Synthesizer", 1985: the wave bent by noise.
#[derive(Debug)]
pub(super) struct Marble;

impl SurfaceShader for Marble {
    fn info(&self) -> ShaderInfo {
        plastic(
            "marble",
            "polished stone with dark veins, hairlines and clouds",
            vec![
                Parameter::color("base", [0.80, 0.78, 0.74], "colour between the veins"),
                Parameter::color("vein", [0.14, 0.15, 0.17], "colour of the veins"),
                Parameter::float("size", 0.12, [1e-6, 1e6], "m", "distance between veins, object space"),
                Parameter::float("turbulence", 1.1, [0.0, 10.0], "veins", "how far veins stray from planes"),
                Parameter::float("sharpness", 14.0, [0.1, 1000.0], "", "narrowness of the veins"),
                Parameter::float("hairlines", 0.4, [0.0, 1.0], "", "strength of the fine web of cracks"),
                Parameter::float("cloudiness", 0.35, [0.0, 1.0], "", "how much the base varies"),
                Parameter::float("roughness", 0.12, [0.0, 1.0], "", "of the polish"),
            ],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let per_vein = inputs.float(SIZE).max(inputs.constant(1e-6)).recip();
        let p = at.object_position * per_vein;
        let width = footprint(at) * per_vein;
        let octaves = Octaves { count: inputs.constant(7.0), gain: inputs.constant(0.55), width, seed: 21 };

        let turbulence = inputs.float(TURBULENCE);
        let bent = fbm(p.scaled(0.7), Octaves { width: width * 0.7, ..octaves });
        let across = Vector::constant(p.token(), ACROSS);
        let vein = crest(p.dot(across) + bent * turbulence * 2.5, inputs.float(SHARPNESS), width);
        // Veins come and go.
        let vein = vein * smooth_step(-0.35, 0.25, bent + 0.1);

        let crack =
            ridged(p.scaled(1.3), Octaves { width: width * 1.3, count: inputs.constant(3.0), ..octaves });
        let crack = smooth_step(0.82, 0.98, crack) * inputs.float(HAIRLINES);
        let cloud = (bent * 1.6 + 0.4).clamp(0.0, 1.0) * inputs.float(CLOUDINESS);

        let (base, dark) = (inputs.vector(BASE), inputs.vector(VEIN));
        let color = base.mix(base.mix(dark, inputs.constant(0.55)), cloud);
        let color = color.mix(dark, (crack * 0.7).max(vein * 0.9));
        make_plastic(closure, color, inputs.float(ROUGHNESS) + crack * 0.1);
    }
}

/// ((1 + cos 2πx) / 2)ˢ, which gives way to its mean where the footprint covers the wave.
#[inline(always)]
fn crest<F: Real>(x: F, sharpness: F, width: F) -> F {
    let (cos, _) = cos_sin_turns(x - x.floor());
    let crest = pow((cos * 0.5 + 0.5).positive(), sharpness);
    // Within 0.2 % of Γ(s + ½) / (√π Γ(s + 1)) for s ≥ 1.
    let mean = ((sharpness + 0.27) * std::f32::consts::PI).sqrt().recip();
    crest.mix(mean, smooth_step(0.25, 0.6, width))
}
