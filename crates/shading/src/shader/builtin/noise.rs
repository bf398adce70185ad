//! Mixtures of colours by noise: fractal patches, clouds, granite.

use super::{make_matte, make_plastic, matte, plastic, relief::footprint};
use crate::closure::Closure;
use crate::lanes::noise::{Octaves, cells, fbm, linear_step, smooth_step};
use crate::lanes::{Real, Vector, Whole};
use crate::shader::{Inputs, Parameter, Point, ShaderInfo, SurfaceShader};

const FIRST: usize = 0;
const SECOND: usize = 1;
const SIZE: usize = 2;
/// The third parameter of granite is a colour.
const THIRD: usize = 2;

/// fBm between two colours.
#[derive(Debug)]
pub(super) struct Noise;

impl Noise {
    const OCTAVES: usize = 3;
    const GAIN: usize = 4;
    const CONTRAST: usize = 5;
}

impl SurfaceShader for Noise {
    fn info(&self) -> ShaderInfo {
        plastic(
            "noise",
            "fractal noise between two colours; gloss stays the material's",
            vec![
                Parameter::color("first", [0.03, 0.06, 0.12], "colour of the low places"),
                Parameter::color("second", [0.85, 0.72, 0.48], "colour of the high places"),
                Parameter::float("size", 0.08, [1e-6, 1e6], "m", "of the largest patches, object space"),
                Parameter::float(
                    "octaves",
                    7.0,
                    [1.0, 12.0],
                    "",
                    "sizes of detail, each half of the one before",
                ),
                Parameter::float(
                    "gain",
                    0.55,
                    [0.0, 1.0],
                    "",
                    "strength of each octave relative to the one before",
                ),
                Parameter::float("contrast", 2.6, [0.0, 100.0], "", "slope between the colours"),
            ],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let per_patch = inputs.float(SIZE).max(inputs.constant(1e-6)).recip();
        let octaves = Octaves {
            count: inputs.float(Self::OCTAVES),
            gain: inputs.float(Self::GAIN),
            width: footprint(at) * per_patch,
            seed: 41,
        };
        let noise = fbm(at.object_position * per_patch, octaves);
        let share = (noise * inputs.float(Self::CONTRAST) + 0.5).clamp(0.0, 1.0);
        closure.base_color = inputs.vector(FIRST).mix(inputs.vector(SECOND), share);
    }
}

/// Clouds before a sky.
#[derive(Debug)]
pub(super) struct Clouds;

impl Clouds {
    const COVER: usize = 3;
    const SOFTNESS: usize = 4;
}

impl SurfaceShader for Clouds {
    fn info(&self) -> ShaderInfo {
        matte(
            "clouds",
            "matte clouds over a sky of one colour",
            vec![
                Parameter::color("sky", [0.10, 0.26, 0.62], "colour between the clouds"),
                Parameter::color("cloud", [0.92, 0.93, 0.95], "colour of the thickest parts"),
                Parameter::float("size", 0.11, [1e-6, 1e6], "m", "of the largest clouds, object space"),
                Parameter::float("cover", 0.5, [0.0, 1.0], "", "share of the sky that is covered, roughly"),
                Parameter::float("softness", 0.5, [0.0, 1.0], "", "of the borders"),
            ],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let per_cloud = inputs.float(SIZE).max(inputs.constant(1e-6)).recip();
        // Clouds are wider than high.
        let p = at.object_position * per_cloud;
        let octaves = Octaves {
            count: inputs.constant(7.0),
            gain: inputs.constant(0.55),
            width: footprint(at) * per_cloud,
            seed: 42,
        };
        let noise = fbm(Vector::new(p.x, p.y * 1.8, p.z), octaves);
        // Half of the noise lies within 0.13 of its mean.
        let above = noise + (inputs.float(Self::COVER) - 0.5) * 0.8;
        let border = inputs.float(Self::SOFTNESS) * 0.4 + 0.01;
        let thickness = (above / border + 0.5).clamp(0.0, 1.0);
        let thickness = thickness * thickness * (thickness * -2.0 + 3.0);
        make_matte(closure, inputs.vector(FIRST).mix(inputs.vector(SECOND), thickness));
    }
}

/// Polished granite: crystals of three minerals.
///
/// # References
/// Worley, "A Cellular Texture Basis Function", 1996.
#[derive(Debug)]
pub(super) struct Granite;

impl Granite {
    const SIZE: usize = 3;
    const MICA: usize = 4;
    const ROUGHNESS: usize = 5;
}

impl SurfaceShader for Granite {
    fn info(&self) -> ShaderInfo {
        plastic(
            "granite",
            "polished stone of crystals of three kinds",
            vec![
                Parameter::color("feldspar", [0.52, 0.33, 0.27], "colour of the most frequent mineral"),
                Parameter::color("quartz", [0.58, 0.56, 0.54], "colour of the second"),
                Parameter::color("mica", [0.025, 0.025, 0.03], "colour of the flakes"),
                Parameter::float("size", 0.007, [1e-6, 1e6], "m", "of the crystals, object space"),
                Parameter::float("mica_share", 0.25, [0.0, 1.0], "", "share of the flakes"),
                Parameter::float("roughness", 0.16, [0.0, 1.0], "", "of the polish"),
            ],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let per_crystal = inputs.float(Self::SIZE).max(inputs.constant(1e-6)).recip();
        let p = at.object_position * per_crystal;
        let width = footprint(at) * per_crystal;
        let octaves =
            Octaves { count: inputs.constant(5.0), gain: inputs.constant(0.7), width: width * 0.2, seed: 43 };
        let drift = fbm(p.scaled(0.2), octaves);
        let crystal = cells(p, 44);
        let kind = crystal.id.unit();
        let (feldspar, quartz) = (inputs.vector(FIRST), inputs.vector(SECOND));
        let (mica, share) = (inputs.vector(THIRD), inputs.float(Self::MICA));
        // Of what is no mica, two parts in five are quartz.
        let is_mica = kind.lt(share);
        let is_quartz = kind.lt(share + share.complement() * 0.4);
        let own = mica.where_or(is_mica, quartz.where_or(is_quartz, feldspar));
        // Crystals differ a little, and are darker where they meet.
        let light = crystal.id.hashed().unit() * 0.3 + 0.8 + drift * 0.4;
        let border = linear_step(0.0, 0.12, crystal.second - crystal.nearest) * 0.25 + 0.75;
        let mean = feldspar.mix(quartz, share.splat(0.4)).mix(mica, share);
        let seen = smooth_step(0.35, 0.9, width).complement();
        let color = mean.mix(own * (light * border), seen);
        make_plastic(closure, color, inputs.float(Self::ROUGHNESS));
    }
}
