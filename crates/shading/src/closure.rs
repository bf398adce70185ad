//! What a surface shader answers: the parameters of the layered model, point by point.

use fearless_simd::{Level, Simd};

use crate::lanes::{Floats, Mask, Packet, Real, Vector, Vectors, WIDTH};
use crate::packet::on_lanes;
use crate::point::Points;
use crate::surface::LaneMode;

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

impl Closures {
    /// Replaces those of the first `count` closures that no honest shader answers, by a plain magenta glow. Such have a
    /// value that is not finite or further out of range than rounding explains, or a normal that is not of unit length.
    /// Returns the name of a field at fault.
    pub fn mark_faults(&mut self, mode: LaneMode, count: usize, points: &Points) -> Option<&'static str> {
        let mut at_fault = [false; WIDTH];
        let closures = &*self;
        on_lanes!(mode, count, |token, lane| find_faults::<_>(token, lane, closures, &mut at_fault));
        let mut field = None;
        for lane in (0..count).filter(|lane| at_fault[*lane]) {
            let faults = self.load::<f32>((), lane).faults();
            field = field.or_else(|| faults.iter().find(|(_, is)| *is).map(|(name, _)| *name));
            self.store(&Closure::marked(Vector::load((), &points.ng, lane)), lane);
        }
        field
    }
}

#[inline(always)]
fn find_faults<F: Real>(token: F::Token, lane: usize, closures: &Closures, at_fault: &mut [bool; WIDTH]) {
    let [(_, first), rest @ ..] = closures.load::<F>(token, lane).faults();
    let mut faults = first;
    for (_, fault) in rest {
        faults = faults | fault;
    }
    if faults.any() {
        faults.store(at_fault, lane);
    }
}

/// What rounding may add to a share or to the square of a unit vector's length.
const ROUNDING: f32 = 0.01;

impl<F: Real> Closure<F> {
    /// Which fields hold what they must not.
    #[inline(always)]
    fn faults(&self) -> [(&'static str, F::Mask); 13] {
        [
            ("base_color", beyond_all(self.base_color, 1.0)),
            ("opacity", beyond(self.opacity, 0.0, 1.0)),
            ("metallic", beyond(self.metallic, 0.0, 1.0)),
            ("roughness", beyond(self.roughness, 0.0, 1.0)),
            ("specular", beyond(self.specular, 0.0, 1.0)),
            ("specular_color", beyond_all(self.specular_color, f32::MAX)),
            ("transmission", beyond(self.transmission, 0.0, 1.0)),
            ("coat", beyond(self.coat, 0.0, 1.0)),
            ("coat_roughness", beyond(self.coat_roughness, 0.0, 1.0)),
            ("emission", beyond_all(self.emission, f32::MAX)),
            ("ambient", beyond_all(self.ambient, f32::MAX)),
            ("normal", beyond(self.normal.dot(self.normal), 1.0, 1.0)),
            ("coat_normal", beyond(self.coat_normal.dot(self.coat_normal), 1.0, 1.0)),
        ]
    }

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

impl Closure<f32> {
    /// What stands for a shader's answer that makes no sense.
    fn marked(normal: Vector<f32>) -> Self {
        let black = Vector::new(0.0, 0.0, 0.0);
        Self {
            base_color: black,
            opacity: 1.0,
            metallic: 0.0,
            roughness: 1.0,
            specular: 0.0,
            specular_color: black,
            transmission: 0.0,
            coat: 0.0,
            coat_roughness: 0.0,
            emission: Vector::new(1.0, 0.0, 1.0),
            ambient: black,
            normal,
            coat_normal: normal,
        }
    }
}

/// Where `x` is not a number, or beyond the range by more than rounding.
#[inline(always)]
fn beyond<F: Real>(x: F, low: f32, high: f32) -> F::Mask {
    !(x.ge(x.splat(low - ROUNDING)) & x.le(x.splat(high + ROUNDING)))
}

/// The same for components from 0 on.
#[inline(always)]
fn beyond_all<F: Real>(v: Vector<F>, high: f32) -> F::Mask {
    beyond(v.x, 0.0, high) | beyond(v.y, 0.0, high) | beyond(v.z, 0.0, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White plaster in every lane.
    fn sound() -> Closures {
        let mut closures = Closures { opacity: Floats::splat(1.0), ..Closures::default() };
        for vectors in [&mut closures.normal, &mut closures.coat_normal] {
            vectors.z = Floats::splat(1.0);
        }
        closures
    }

    #[test]
    fn answers_that_make_no_sense_are_marked_lane_by_lane() {
        let points = Points { ng: sound().normal, ..Points::default() };
        type Spoil = fn(&mut Closures);
        let spoil: [(&str, Spoil); 7] = [
            ("base_color", |c| c.base_color.y.0[5] = f32::NAN),
            ("opacity", |c| c.opacity.0[5] = 1.5),
            ("metallic", |c| c.metallic.0[5] = -0.1),
            ("emission", |c| c.emission.z.0[5] = f32::INFINITY),
            ("ambient", |c| c.ambient.x.0[5] = f32::NEG_INFINITY),
            ("normal", |c| c.normal.z.0[5] = 0.0),
            ("coat_normal", |c| c.coat_normal.x.0[5] = f32::NAN),
        ];
        for mode in [LaneMode::default(), LaneMode::Single] {
            for (field, spoil) in spoil {
                let mut closures = sound();
                spoil(&mut closures);
                let mut untouched = closures.clone();
                assert_eq!(untouched.mark_faults(mode, 5, &points), None, "beyond the count: {field}");
                assert_eq!(closures.mark_faults(mode, 6, &points), Some(field));
                assert_eq!(closures.emission.get(5), glam::Vec3::new(1.0, 0.0, 1.0), "{field}");
                assert_eq!(closures.emission.get(4), glam::Vec3::ZERO, "{field}");
                assert_eq!(closures.mark_faults(mode, WIDTH, &points), None, "the mark makes sense: {field}");
            }
        }
    }

    #[test]
    fn rounding_is_no_fault() {
        for mode in [LaneMode::default(), LaneMode::Single] {
            let mut closures = sound();
            closures.base_color.x = Floats::splat(1.001);
            closures.opacity = Floats::splat(-0.001);
            closures.normal.z = Floats::splat(0.999);
            closures.emission.x = Floats::splat(f32::MAX);
            assert_eq!(closures.mark_faults(mode, WIDTH, &Points::default()), None);
        }
    }
}
