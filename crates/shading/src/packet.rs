//! Whole packets of surfaces asked at once: light from an emitter, scattered light, sampled directions.

use fearless_simd::{Level, Simd};

use crate::lanes::{Floats, Mask, Packet, Real, Vector, Vectors, WIDTH};
use crate::lobe_set::{Lobes, Selection};
use crate::surface::{LaneMode, Surfaces};

/// Light that arrives at the points of a packet from one emitter, a sampled direction each.
#[derive(Clone, Debug, Default)]
pub struct Illumination {
    /// Unit vectors towards the light.
    pub wi: Vectors,
    /// Distance to the light, metres; infinite for far ones.
    pub distance: Floats,
    /// Radiance divided by the density of the sample (without the choice of the emitter); zero where nothing arrives.
    pub weight: Vectors,
    /// Per steradian; 0 for lights without area, which scattering cannot hit.
    pub pdf: Floats,
}

/// What packets of surfaces make of light from given directions.
#[derive(Clone, Debug, Default)]
pub struct Scattering {
    /// f · |cos θi|; smooth lobes contribute nothing.
    pub f_cos: Vectors,
    /// Density of sampling the direction, per steradian.
    pub pdf: Floats,
}

/// Directions sampled from a packet of surfaces; see [`BsdfSample`](crate::BsdfSample).
#[derive(Clone, Debug, Default)]
pub struct Scattered {
    /// Where a lane has a sample.
    pub valid: [bool; WIDTH],
    /// Where light comes from.
    pub wi: Vectors,
    /// f · |cos θi| / pdf.
    pub weight: Vectors,
    /// Per steradian; 0 for perfectly smooth lobes.
    pub pdf: Floats,
    /// GGX α of the lobe.
    pub alpha: Floats,
}

/// Calls a function that is generic over lanes for all of them: at once where the machine has wide registers, one after
/// the other elsewhere. Only wide instruction sets are compiled: on narrow ones packets gain little and take the compiler
/// minutes.
macro_rules! on_lanes {
    ($mode:expr, $count:expr, |$token:ident, $lane:ident| $function:ident::<_>($($argument:expr),*)) => {
        match $mode {
            #[cfg(target_arch = "x86_64")]
            LaneMode::Packets(Level::Avx512($token)) => {
                let $lane = 0;
                $token.vectorize(
                    #[inline(always)]
                    || $function::<Packet<_>>($($argument),*),
                );
            }
            #[cfg(target_arch = "x86_64")]
            LaneMode::Packets(Level::Avx2($token)) => {
                let $lane = 0;
                $token.vectorize(
                    #[inline(always)]
                    || $function::<Packet<_>>($($argument),*),
                );
            }
            #[cfg(target_arch = "aarch64")]
            LaneMode::Packets(Level::Neon($token)) => {
                let $lane = 0;
                $token.vectorize(
                    #[inline(always)]
                    || $function::<Packet<_>>($($argument),*),
                );
            }
            _ => {
                let $token = ();
                for $lane in 0..$count {
                    $function::<f32>($($argument),*);
                }
            }
        }
    };
}
pub(crate) use on_lanes;

impl Surfaces {
    /// Scatters light from `wi`, a direction for each of the first `count` lanes, by the selected lobes.
    pub fn evaluate(&self, wi: &Vectors, which: Selection, count: usize, out: &mut Scattering) {
        on_lanes!(self.mode, count, |token, lane| evaluate::<_>(token, lane, self, wi, which, out));
    }

    /// Samples a direction for each of the first `count` lanes from the selected lobes: `u` are the choices of the lobe and
    /// of the direction.
    pub fn sample(&self, u: [&Floats; 3], which: Selection, count: usize, out: &mut Scattered) {
        on_lanes!(self.mode, count, |token, lane| sample::<_>(token, lane, self, u, which, out));
    }

    /// Share of uniform white light that the selected reflecting lobes of the first `count` lanes send towards the viewer; see
    /// [`Bsdf::albedo_of`](crate::Bsdf::albedo_of).
    pub fn albedo_of(&self, which: Selection, count: usize, out: &mut Vectors) {
        on_lanes!(self.mode, count, |token, lane| albedo_of::<_>(token, lane, self, which, out));
    }

    /// Whether any of the first `count` lanes has a lobe of a selection.
    pub fn have(&self, which: Selection, count: usize) -> bool {
        self.may_have(which) && (0..count).any(|lane| self.bsdf::<f32>((), lane).has_any(which))
    }

    /// Origins for rays that leave towards `directions`, a direction for each of the first `count` lanes.
    pub fn spawn(&self, directions: &Vectors, count: usize, out: &mut Vectors) {
        on_lanes!(self.mode, count, |token, lane| spawn::<_>(token, lane, self, directions, out));
    }
}

#[inline(always)]
fn evaluate<F: Real>(
    token: F::Token,
    lane: usize,
    surfaces: &Surfaces,
    wi: &Vectors,
    which: Selection,
    out: &mut Scattering,
) {
    let wi = Vector::load(token, wi, lane);
    // Diffuse surfaces are frequent and need few of their fields.
    let value = match surfaces.lobes() == Lobes::DIFFUSE {
        true => surfaces.diffuse_bsdf::<F>(token, lane).evaluate(wi, which),
        false => surfaces.bsdf::<F>(token, lane).evaluate(wi, which),
    };
    value.f_cos.store(&mut out.f_cos, lane);
    value.pdf.store(&mut out.pdf, lane);
}

#[inline(always)]
fn albedo_of<F: Real>(
    token: F::Token,
    lane: usize,
    surfaces: &Surfaces,
    which: Selection,
    out: &mut Vectors,
) {
    surfaces.bsdf::<F>(token, lane).albedo_of(which).store(out, lane);
}

#[inline(always)]
fn sample<F: Real>(
    token: F::Token,
    lane: usize,
    surfaces: &Surfaces,
    u: [&Floats; 3],
    which: Selection,
    out: &mut Scattered,
) {
    let u_lobe = F::load(token, u[0], lane);
    let (u, v) = (F::load(token, u[1], lane), F::load(token, u[2], lane));
    let sample = surfaces.bsdf::<F>(token, lane).sample(u_lobe, [u, v], which);
    sample.wi.store(&mut out.wi, lane);
    sample.weight.store(&mut out.weight, lane);
    sample.pdf.store(&mut out.pdf, lane);
    sample.alpha.store(&mut out.alpha, lane);
    sample.valid.store(&mut out.valid, lane);
}

#[inline(always)]
fn spawn<F: Real>(
    token: F::Token,
    lane: usize,
    surfaces: &Surfaces,
    directions: &Vectors,
    out: &mut Vectors,
) {
    let ng = Vector::<F>::load(token, &surfaces.ng, lane);
    let cos = ng.dot(Vector::load(token, directions, lane));
    let offset = F::load(token, &surfaces.error, lane).copysign(cos);
    (Vector::load(token, &surfaces.position, lane) + ng * offset).store(out, lane);
}
