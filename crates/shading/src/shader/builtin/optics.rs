//! Mirrors and glass.

use super::relief::{Relief, footprint, raised};
use crate::closure::Closure;
use crate::lanes::noise::{Octaves, fbm};
use crate::lanes::{Real, Vector};
use crate::lobe_set::Lobes;
use crate::shader::{Inputs, Parameter, Point, ShaderInfo, SurfaceShader};

const TINT: usize = 0;
const ROUGHNESS: usize = 1;
const WAVES: usize = 2;
const WAVE_SIZE: usize = 3;

/// A metallic mirror.
#[derive(Debug)]
pub(super) struct Mirror;

impl SurfaceShader for Mirror {
    fn info(&self) -> ShaderInfo {
        ShaderInfo {
            name: "mirror".into(),
            about: "a metallic mirror, polished or brushed".into(),
            parameters: vec![
                Parameter::color("tint", [0.93, 0.94, 0.94], "reflectance, seen head-on"),
                Parameter::float("roughness", 0.0, [0.0, 1.0], "", "0 is a perfect mirror"),
            ],
            lobes: Lobes::SPECULAR,
            see_through: false,
        }
    }

    #[inline(always)]
    fn shade<F: Real>(&self, _: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let one = inputs.constant(1.0);
        closure.base_color = inputs.vector(TINT);
        closure.metallic = one;
        closure.roughness = inputs.float(ROUGHNESS);
        closure.coat = one.splat(0.0);
    }
}

/// Glass. On a material that bounds a solid the material's index bends light; on others it is a thin pane.
#[derive(Debug)]
pub(super) struct Glass;

/// The waves of drawn glass.
struct Waves<F> {
    height: F,
    per_wave: F,
    width: F,
}

impl<F: Real> Relief<F> for Waves<F> {
    #[inline(always)]
    fn height(&self, p: Vector<F>) -> F {
        let octaves = Octaves {
            count: p.x.splat(2.0),
            gain: p.x.splat(0.35),
            width: self.width * self.per_wave,
            seed: 51,
        };
        fbm(p * self.per_wave, octaves) * self.height
    }
}

impl SurfaceShader for Glass {
    fn info(&self) -> ShaderInfo {
        ShaderInfo {
            name: "glass".into(),
            about: "clear, frosted or wavy glass: a solid on materials with a volume, a thin pane on others"
                .into(),
            parameters: vec![
                Parameter::color("tint", [0.97, 0.99, 0.98], "share of light that passes the surface"),
                Parameter::float("roughness", 0.0, [0.0, 1.0], "", "0 is clear, more is frosted"),
                Parameter::float("waves", 0.001, [0.0, 1e6], "m", "height of the waves of hand-made glass"),
                Parameter::float("wave_size", 0.05, [1e-6, 1e6], "m", "distance between waves, object space"),
            ],
            lobes: Lobes::SPECULAR.union(Lobes::THIN_TRANSMIT),
            see_through: true,
        }
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let (zero, one) = (inputs.constant(0.0), inputs.constant(1.0));
        closure.base_color = inputs.vector(TINT);
        closure.roughness = inputs.float(ROUGHNESS);
        closure.metallic = zero;
        closure.specular = one;
        closure.specular_color = Vector::grey(one);
        closure.transmission = one;
        closure.coat = zero;
        let size = inputs.float(WAVE_SIZE).max(inputs.constant(1e-6));
        let waves = Waves { height: inputs.float(WAVES), per_wave: size.recip(), width: footprint(at) };
        closure.normal = raised(at, &waves, size, closure.normal);
    }
}
