//! Relief for whatever the material is: fractal bumps, hammered dents, water ripples.

use super::relief::{Relief, footprint, raised};
use crate::closure::Closure;
use crate::lanes::noise::{Octaves, cells, fbm, smooth_step};
use crate::lanes::{Real, Vector, cos_sin_turns};
use crate::lobe_set::Lobes;
use crate::shader::{Inputs, Parameter, Point, ShaderInfo, SurfaceShader};

const HEIGHT: usize = 0;
const SIZE: usize = 1;

fn relief(name: &str, about: &str, parameters: Vec<Parameter>) -> ShaderInfo {
    ShaderInfo { name: name.into(), about: about.into(), parameters, lobes: Lobes::NONE, see_through: false }
}

/// Fractal bumps.
#[derive(Debug)]
pub(super) struct Bump;

struct Bumps<F> {
    height: F,
    per_bump: F,
    octaves: Octaves<F>,
}

impl<F: Real> Relief<F> for Bumps<F> {
    #[inline(always)]
    fn height(&self, p: Vector<F>) -> F {
        fbm(p * self.per_bump, self.octaves) * self.height
    }
}

impl Bump {
    const OCTAVES: usize = 2;
    const GAIN: usize = 3;
}

impl SurfaceShader for Bump {
    fn info(&self) -> ShaderInfo {
        relief(
            "bump",
            "fractal bumps on the material as it is, from orange peel to rock",
            vec![
                Parameter::float("height", 0.008, [0.0, 1e6], "m", "of the bumps, object space"),
                Parameter::float("size", 0.03, [1e-6, 1e6], "m", "of the largest bumps, object space"),
                Parameter::float(
                    "octaves",
                    5.0,
                    [1.0, 12.0],
                    "",
                    "sizes of detail, each half of the one before",
                ),
                Parameter::float(
                    "gain",
                    0.45,
                    [0.0, 1.0],
                    "",
                    "height of each octave relative to the one before",
                ),
            ],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let size = inputs.float(SIZE).max(inputs.constant(1e-6));
        let octaves = Octaves {
            count: inputs.float(Self::OCTAVES),
            gain: inputs.float(Self::GAIN),
            width: footprint(at) / size,
            seed: 61,
        };
        let bumps = Bumps { height: inputs.float(HEIGHT), per_bump: size.recip(), octaves };
        closure.normal = raised(at, &bumps, size, closure.normal);
    }
}

/// Hammered metal.
#[derive(Debug)]
pub(super) struct Dents;

struct Blows<F> {
    height: F,
    per_blow: F,
    radius: F,
    width: F,
}

impl<F: Real> Relief<F> for Blows<F> {
    #[inline(always)]
    fn height(&self, p: Vector<F>) -> F {
        let depth =
            (cells(p * self.per_blow, 62).nearest / self.radius).min(p.x.splat(1.0)).squared().complement();
        let seen = smooth_step(0.3, 0.8, self.width * self.per_blow).complement();
        -(depth * depth * self.height * seen)
    }
}

impl Dents {
    const RADIUS: usize = 2;
}

impl SurfaceShader for Dents {
    fn info(&self) -> ShaderInfo {
        relief(
            "dents",
            "round dents on the material as it is, as of a hammer",
            vec![
                Parameter::float("depth", 0.003, [0.0, 1e6], "m", "of the dents, object space"),
                Parameter::float("size", 0.03, [1e-6, 1e6], "m", "distance between dents, object space"),
                Parameter::float("radius", 0.9, [0.05, 2.0], "sizes", "of a dent"),
            ],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let size = inputs.float(SIZE).max(inputs.constant(1e-6));
        let blows = Blows {
            height: inputs.float(HEIGHT),
            per_blow: size.recip(),
            radius: inputs.float(Self::RADIUS).max(inputs.constant(0.05)),
            width: footprint(at),
        };
        closure.normal = raised(at, &blows, size, closure.normal);
    }
}

/// Waves on water.
#[derive(Debug)]
pub(super) struct Ripples;

/// Direction (turns), wavelength and height of each wave relative to the chosen ones, and its phase (turns).
const WAVES: [[f32; 4]; 7] = [
    [0.000, 1.00, 1.00, 0.00],
    [0.110, 0.83, 0.80, 0.37],
    [-0.170, 0.71, 0.72, 0.81],
    [0.290, 0.61, 0.55, 0.13],
    [-0.350, 0.47, 0.45, 0.59],
    [0.430, 0.39, 0.32, 0.23],
    [-0.060, 0.31, 0.25, 0.91],
];

struct Water<F> {
    height: F,
    per_wave: F,
    spread: F,
    phase: F,
    width: F,
}

impl<F: Real> Relief<F> for Water<F> {
    #[inline(always)]
    fn height(&self, p: Vector<F>) -> F {
        let mut sum = p.x.splat(0.0);
        for [direction, wavelength, height, phase] in WAVES {
            let (cos, sin) = cos_sin_turns(self.spread * direction);
            let per_wave = self.per_wave * (1.0 / wavelength);
            // Deep water: the frequency goes with the root of 1 / wavelength.
            let turns = (p.x * cos + p.z * sin + p.y * 0.31) * per_wave
                - self.phase * (1.0 / wavelength.sqrt())
                + phase;
            let (_, wave) = cos_sin_turns(turns - turns.floor());
            let seen = smooth_step(0.25, 0.5, self.width * per_wave).complement();
            sum = sum + wave * seen * height;
        }
        sum * self.height * 0.25
    }
}

impl Ripples {
    const SPREAD: usize = 2;
    const PHASE: usize = 3;
}

impl SurfaceShader for Ripples {
    fn info(&self) -> ShaderInfo {
        relief(
            "ripples",
            "waves of water on the material as it is, travelling level in object space",
            vec![
                Parameter::float("height", 0.003, [0.0, 1e6], "m", "of the highest waves, object space"),
                Parameter::float("wavelength", 0.05, [1e-6, 1e6], "m", "of the longest waves, object space"),
                Parameter::float(
                    "spread",
                    0.4,
                    [0.0, 1.0],
                    "",
                    "0: all travel along x; 1: in all directions",
                ),
                Parameter::float(
                    "phase",
                    0.0,
                    [-1000.0, 1000.0],
                    "turns",
                    "of the longest waves; move it to set them going",
                ),
            ],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let size = inputs.float(SIZE).max(inputs.constant(1e-6));
        let water = Water {
            height: inputs.float(HEIGHT),
            per_wave: size.recip(),
            spread: inputs.float(Self::SPREAD),
            phase: inputs.float(Self::PHASE),
            width: footprint(at),
        };
        closure.normal = raised(at, &water, size, closure.normal);
    }
}
