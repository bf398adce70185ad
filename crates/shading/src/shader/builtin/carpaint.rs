//! Car paint: a base coat whose colour flops with the angle, metal flakes in it, a clear coat over both.

use super::relief::footprint;
use crate::closure::Closure;
use crate::lanes::noise::{cells, smooth_step};
use crate::lanes::{Real, Vector, Whole, cos_sin_turns, pow};
use crate::lobe_set::Lobes;
use crate::shader::{Inputs, Parameter, Point, ShaderInfo, SurfaceShader};

const BASE: usize = 0;
const FLOP: usize = 1;
const FALLOFF: usize = 2;
const FLAKE: usize = 3;
const FLAKES: usize = 4;
const FLAKE_SIZE: usize = 5;
const FLAKE_TILT: usize = 6;
const ROUGHNESS: usize = 7;
const COAT: usize = 8;
const COAT_ROUGHNESS: usize = 9;

/// How much of the base coat reflects like metal.
const METALLIC: f32 = 0.55;

/// Metallic paint. Each flake is a cell with a normal of its own; where the footprint covers many, their spread becomes
/// roughness (Toksvig's idea).
///
/// # References
/// Ershov, Kolchin, Myszkowski, "Rendering Pearlescent Appearance Based On Paint-Composition Modelling", 2001; Günther,
/// Chen, Goesele, Wald, Seidel, "Efficient Acquisition and Realistic Rendering of Car Paint", 2005; Toksvig, "Mipmapping
/// Normal Maps", 2005.
#[derive(Debug)]
pub(super) struct CarPaint;

impl SurfaceShader for CarPaint {
    fn info(&self) -> ShaderInfo {
        ShaderInfo {
            name: "carpaint".into(),
            about: "metallic paint: flip-flop colour, flakes, a clear coat".into(),
            parameters: vec![
                Parameter::color("base", [0.46, 0.010, 0.016], "colour seen head-on"),
                Parameter::color("flop", [0.11, 0.0, 0.035], "colour seen at grazing angles"),
                Parameter::float(
                    "falloff",
                    1.6,
                    [0.05, 20.0],
                    "",
                    "how late the colour flops: exponent of 1 − cos",
                ),
                Parameter::color("flake", [0.90, 0.20, 0.12], "colour of the flakes"),
                Parameter::float("flakes", 0.25, [0.0, 1.0], "", "share of the surface that flakes cover"),
                Parameter::float("flake_size", 0.0012, [1e-6, 1e6], "m", "of a flake, object space"),
                Parameter::float("flake_tilt", 0.3, [0.0, 1.0], "", "slope of the most tilted flakes"),
                Parameter::float("roughness", 0.42, [0.0, 1.0], "", "of the base coat"),
                Parameter::float("coat", 1.0, [0.0, 1.0], "", "coverage of the clear coat"),
                Parameter::float("coat_roughness", 0.03, [0.0, 1.0], "", "of the clear coat"),
            ],
            lobes: Lobes::DIFFUSE.union(Lobes::SPECULAR).union(Lobes::COAT),
            see_through: false,
        }
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let one = inputs.constant(1.0);
        let facing = closure.normal.dot(at.wo).abs().clamp(0.0, 1.0);
        let flop = pow(facing.complement(), inputs.float(FALLOFF));
        let base = inputs.vector(BASE).mix(inputs.vector(FLOP), flop);

        let per_flake = inputs.float(FLAKE_SIZE).max(inputs.constant(1e-6)).recip();
        let cell = cells(at.object_position * per_flake, 71);
        let (share, tilt) = (inputs.float(FLAKES), inputs.float(FLAKE_TILT));
        let seen = smooth_step(0.4, 1.2, footprint(at) * per_flake).complement();
        let flake = one.only(cell.id.unit().lt(share));
        // Tilted evenly over the disk of slopes, in a random direction.
        let (cos, sin) = cos_sin_turns(cell.id.hashed().unit());
        let slope = cell.id.hashed().hashed().unit().sqrt() * tilt * seen * flake;
        let tilted = closure.normal + at.axes[0] * (slope * cos) + at.axes[1] * (slope * sin);

        let flaked = share.mix(flake, seen);
        let alpha = inputs.float(ROUGHNESS).squared();
        let spread = (alpha.squared() + tilt.squared() * share * seen.complement() * 0.5).sqrt();
        closure.base_color = base.mix(inputs.vector(FLAKE), flaked * facing);
        closure.metallic = (flaked * (1.0 - METALLIC) + METALLIC).clamp(0.0, 1.0);
        closure.roughness = spread.sqrt().mix(one.splat(0.25), flake * seen).clamp(0.0, 1.0);
        closure.specular = one;
        closure.specular_color = Vector::grey(one);
        closure.transmission = one.splat(0.0);
        closure.coat = inputs.float(COAT);
        closure.coat_roughness = inputs.float(COAT_ROUGHNESS);
        closure.normal = tilted.normalized_or(closure.normal);
    }
}
