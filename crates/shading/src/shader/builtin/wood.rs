//! Wood: yearly rings about an axis, fibres along it, pores in the early wood.

use super::{make_plastic, plastic, relief::footprint};
use crate::closure::Closure;
use crate::lanes::noise::{Octaves, cell_hash, fbm, gradient_noise, smooth_step};
use crate::lanes::{Real, Vector, Whole};
use crate::shader::{Inputs, Parameter, Point, ShaderInfo, SurfaceShader};

const LIGHT: usize = 0;
const DARK: usize = 1;
const RING_WIDTH: usize = 2;
const PITH: usize = 3;
const DISTORTION: usize = 4;
const GRAIN: usize = 5;
const PORES: usize = 6;
const ROUGHNESS: usize = 7;

/// Share of late wood in a ring, on average.
const MEAN_LATE: f32 = 0.33;

/// Timber cut from a trunk along the object's x axis.
///
/// # References
/// Peachey, "Solid Texturing of Complex Surfaces", 1985: rings as cylinders with noise; Liu, Dong, Hanika, Marschner,
/// "Simulating the Structure and Texture of Solid Wood", 2016: early and late wood, fibres and pores, all simplified here.
#[derive(Debug)]
pub(super) struct Wood;

impl SurfaceShader for Wood {
    fn info(&self) -> ShaderInfo {
        plastic(
            "wood",
            "timber from a trunk along the object's x axis: yearly rings, fibres, pores",
            vec![
                Parameter::color("light", [0.52, 0.29, 0.13], "colour of early wood"),
                Parameter::color("dark", [0.23, 0.095, 0.035], "colour of late wood"),
                Parameter::float(
                    "ring_width",
                    0.012,
                    [1e-6, 1e6],
                    "m",
                    "distance between rings, object space",
                ),
                Parameter::float(
                    "pith",
                    0.04,
                    [-1e6, 1e6],
                    "m",
                    "depth of the trunk's axis below the origin",
                ),
                Parameter::float(
                    "distortion",
                    0.35,
                    [0.0, 10.0],
                    "rings",
                    "how far rings stray from circles",
                ),
                Parameter::float("grain", 0.35, [0.0, 1.0], "", "contrast of the fibres"),
                Parameter::float("pores", 0.5, [0.0, 1.0], "", "depth of colour of the pores"),
                Parameter::float(
                    "roughness",
                    0.42,
                    [0.0, 1.0],
                    "",
                    "of early wood; late wood is smoother, pores rougher",
                ),
            ],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let p = at.object_position;
        let per_ring = inputs.float(RING_WIDTH).max(inputs.constant(1e-6)).recip();
        let width = footprint(at) * per_ring;
        let octaves = |count, width, seed| Octaves { count, gain: inputs.constant(0.5), width, seed };

        // Trunks are far more alike along their axis than across it.
        let trunk = Vector::new(p.x * 0.3, p.y, p.z) * (per_ring * 0.1);
        let stray = fbm(trunk, octaves(inputs.constant(2.0), width * 0.1, 1)) * inputs.float(DISTORTION);
        let y = p.y + inputs.float(PITH);
        let age = (y.squared() + p.z.squared()).sqrt() * per_ring + stray * 3.0;
        let late = late_wood(age, width);

        let fibres = Vector::new(p.x * 0.02, p.y, p.z) * (per_ring * 2.5);
        let fibre = fbm(fibres, octaves(inputs.constant(4.0), width * 2.5, 2)) * inputs.float(GRAIN);
        let pore_place = Vector::new(p.x * 0.05, p.y, p.z) * (per_ring * 5.0);
        let pore_seen = smooth_step(0.25, 0.5, width * 5.0).complement() * late.complement();
        let pore = smooth_step(0.3, 0.55, gradient_noise(pore_place, 3).value) * pore_seen;
        let pore = pore * inputs.float(PORES);

        let (light, dark) = (inputs.vector(LIGHT), inputs.vector(DARK));
        let color = light.mix(dark, late) * (fibre * 1.2 + 1.0).max(inputs.constant(0.0));
        let color = color.mix(dark.scaled(0.35), pore);
        let roughness = inputs.float(ROUGHNESS) * (late * -0.3 + 1.0) + pore * 0.3 - fibre * 0.15;
        make_plastic(closure, color, roughness);
    }
}

/// Share of late wood, dark and dense, at an age in years: it sets in slowly and ends with the winter.
#[inline(always)]
fn late_wood<F: Real>(age: F, width: F) -> F {
    let year = age.floor();
    let t = age - year;
    let zero = age.splat(0.0);
    let strength = cell_hash(Vector::new(year, zero, zero), 4).unit() * 0.5 + 0.5;
    let late = smooth_step(0.15, 0.88, t) * smooth_step(0.9, 1.0, t).complement() * strength;
    zero.splat(MEAN_LATE).mix(late, smooth_step(0.25, 0.6, width).complement())
}
