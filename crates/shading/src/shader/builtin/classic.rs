//! The shading models of fixed-function graphics, in the terms of the layered model.

use super::{make_matte, make_plastic, matte, plastic};
use crate::closure::Closure;
use crate::lanes::{Real, Vector};
use crate::shader::{Inputs, Parameter, Point, ShaderInfo, SurfaceShader};

const DIFFUSE: usize = 0;
const SPECULAR: usize = 1;
const SHININESS: usize = 2;

/// Reflectance of the layered model's base at normal incidence for specular 1, white and an index of 1.5.
const USUAL_F0: f32 = 0.04;

/// The diffuse reflector.
///
/// # References
/// Lambert, *Photometria*, 1760.
#[derive(Debug)]
pub(super) struct Lambert;

impl SurfaceShader for Lambert {
    fn info(&self) -> ShaderInfo {
        let diffuse = Parameter::color("diffuse", [0.62, 0.60, 0.56], "reflectance");
        matte("lambert", "matte: reflects alike in all directions", vec![diffuse])
    }

    #[inline(always)]
    fn shade<F: Real>(&self, _: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        make_matte(closure, inputs.vector(DIFFUSE));
    }
}

/// A highlight over a diffuse base with OpenGL's parameters. The Blinn–Phong exponent n becomes a GGX lobe of
/// α = √(2 / (n + 2)), whose peak and second derivative there are close to those of cosⁿ; the specular colour becomes the
/// reflectance at normal incidence (exact for materials of index 1.5). Unlike OpenGL's the lobe is normalised: it
/// grows brighter as it narrows, and no more is reflected than arrives.
///
/// # References
/// Phong, "Illumination for Computer Generated Pictures", 1975; Blinn, "Models of Light Reflection for Computer
/// Synthesized Pictures", 1977; Walter, Marschner, Li, Torrance, "Microfacet Models for Refraction through Rough
/// Surfaces", 2007, section 5.2, for the conversion.
#[derive(Debug)]
pub(super) struct Phong;

impl SurfaceShader for Phong {
    fn info(&self) -> ShaderInfo {
        plastic(
            "phong",
            "a highlight over a matte base, by OpenGL's parameters",
            vec![
                Parameter::color("diffuse", [0.05, 0.20, 0.42], "reflectance of the base"),
                Parameter::color(
                    "specular",
                    [0.10, 0.10, 0.10],
                    "reflectance of the highlight, seen head-on",
                ),
                Parameter::float("shininess", 60.0, [0.0, 10000.0], "", "Blinn–Phong exponent"),
            ],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, _: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        // Perceptual roughness is the root of α.
        let alpha = ((inputs.float(SHININESS).positive() + 2.0).recip() * 2.0).sqrt();
        make_plastic(closure, inputs.vector(DIFFUSE), alpha.sqrt());
        let specular = inputs.vector(SPECULAR);
        let strength = specular.largest();
        let tint = (strength.max(strength.splat(1e-6)) * USUAL_F0).recip();
        closure.specular = strength;
        closure.specular_color = Vector::new(specular.x * tint, specular.y * tint, specular.z * tint);
    }
}
