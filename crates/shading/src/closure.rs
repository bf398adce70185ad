//! What a surface shader answers: the parameters of the layered model, point by point.

use crate::lanes::{Floats, Real, Vector, Vectors};

/// How a surface looks at a point, in the terms of the physically based model that every integrator understands. A shader
/// gets the closure of the material as it stands and changes what it wants.
#[derive(Clone, Copy, Debug)]
pub struct Closure<F> {
    /// Linear reflectance, 0 to 1.
    pub base_color: Vector<F>,
    /// Share of light that meets the surface, 0 to 1; the rest passes straight through. Where a material is opaque, its
    /// shadow rays do not ask.
    pub opacity: F,
    /// 0 = dielectric, 1 = metal.
    pub metallic: F,
    /// Perceptual roughness, 0 to 1; the GGX α is its square.
    pub roughness: F,
    /// Strength of the dielectric reflection, 0 to 1.
    pub specular: F,
    /// Tint of the dielectric reflection at normal incidence.
    pub specular_color: Vector<F>,
    /// Share of the dielectric's base that transmits, 0 to 1; counts where the material transmits at all.
    pub transmission: F,
    /// Coverage of the clear coat, 0 to 1.
    pub coat: F,
    /// Its perceptual roughness, 0 to 1.
    pub coat_roughness: F,
    /// Emitted radiance towards the viewer. Light sampling knows the material's own emission alone.
    pub emission: Vector<F>,
    /// Radiance of the classical ambient term.
    pub ambient: Vector<F>,
    /// Unit shading normal in world space, on the front side.
    pub normal: Vector<F>,
    /// The coat's.
    pub coat_normal: Vector<F>,
}

/// Sixteen closures in memory.
#[repr(C)]
#[derive(Clone, Debug, Default)]
#[expect(missing_docs, reason = "the fields are those of Closure")]
pub struct Closures {
    pub base_color: Vectors,
    pub opacity: Floats,
    pub metallic: Floats,
    pub roughness: Floats,
    pub specular: Floats,
    pub specular_color: Vectors,
    pub transmission: Floats,
    pub coat: Floats,
    pub coat_roughness: Floats,
    pub emission: Vectors,
    pub ambient: Vectors,
    pub normal: Vectors,
    pub coat_normal: Vectors,
}

impl Closures {
    /// Lanes from `lane` on.
    #[inline(always)]
    pub fn load<F: Real>(&self, token: F::Token, lane: usize) -> Closure<F> {
        Closure {
            base_color: Vector::load(token, &self.base_color, lane),
            opacity: F::load(token, &self.opacity, lane),
            metallic: F::load(token, &self.metallic, lane),
            roughness: F::load(token, &self.roughness, lane),
            specular: F::load(token, &self.specular, lane),
            specular_color: Vector::load(token, &self.specular_color, lane),
            transmission: F::load(token, &self.transmission, lane),
            coat: F::load(token, &self.coat, lane),
            coat_roughness: F::load(token, &self.coat_roughness, lane),
            emission: Vector::load(token, &self.emission, lane),
            ambient: Vector::load(token, &self.ambient, lane),
            normal: Vector::load(token, &self.normal, lane),
            coat_normal: Vector::load(token, &self.coat_normal, lane),
        }
    }

    /// Stores lanes from `lane` on.
    #[inline(always)]
    pub fn store<F: Real>(&mut self, closure: &Closure<F>, lane: usize) {
        closure.base_color.store(&mut self.base_color, lane);
        closure.opacity.store(&mut self.opacity, lane);
        closure.metallic.store(&mut self.metallic, lane);
        closure.roughness.store(&mut self.roughness, lane);
        closure.specular.store(&mut self.specular, lane);
        closure.specular_color.store(&mut self.specular_color, lane);
        closure.transmission.store(&mut self.transmission, lane);
        closure.coat.store(&mut self.coat, lane);
        closure.coat_roughness.store(&mut self.coat_roughness, lane);
        closure.emission.store(&mut self.emission, lane);
        closure.ambient.store(&mut self.ambient, lane);
        closure.normal.store(&mut self.normal, lane);
        closure.coat_normal.store(&mut self.coat_normal, lane);
    }
}

impl<F: Real> Closure<F> {
    /// With every value in its range, whatever a shader made of it: shares between 0 and 1, radiance finite and not
    /// negative. Numbers that are not finite become the low end.
    #[inline(always)]
    pub(crate) fn sane(self) -> Self {
        Self {
            base_color: self.base_color.clamp(0.0, 1.0),
            opacity: self.opacity.clamp(0.0, 1.0),
            metallic: self.metallic.clamp(0.0, 1.0),
            roughness: self.roughness.clamp(0.0, 1.0),
            specular: self.specular.clamp(0.0, 1.0),
            specular_color: self.specular_color.clamp(0.0, f32::MAX),
            transmission: self.transmission.clamp(0.0, 1.0),
            coat: self.coat.clamp(0.0, 1.0),
            coat_roughness: self.coat_roughness.clamp(0.0, 1.0),
            emission: self.emission.clamp(0.0, f32::MAX),
            ambient: self.ambient.clamp(0.0, f32::MAX),
            ..self
        }
    }
}
