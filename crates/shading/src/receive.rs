//! What the points of a packet make of light from a source that they share.

use std::f32::consts::FRAC_1_PI;

use fearless_simd::{Level, Simd};
use glam::Vec3;

use crate::adjoint::{MEAN_RIM, PatchGloss};
use crate::emission::Source;
use crate::fresnel::schlick_weight;
use crate::lanes::{Floats, Packet, Real, Vector, Vectors, WIDTH};
use crate::lobe_set::{Lobes, Selection};
use crate::packet::on_lanes;
use crate::surface::{LaneMode, Surfaces};

/// Light from one source at the points of a packet, as if nothing stood between.
#[derive(Clone, Debug, Default)]
pub struct Received {
    /// Irradiance over π: what a white diffuse surface would radiate. The shading cosine is in it.
    pub irradiance: Vectors,
    /// Radiance that the other selected lobes reflect towards the viewer.
    pub gloss: Vectors,
    /// Unit vectors towards the light.
    pub wi: Vectors,
    /// From the start of the source's shadow rays to the point, moved off its surface.
    pub way: Vectors,
}

impl Received {
    /// A bit for each of the first `count` lanes to which any light comes.
    pub fn lit(&self, count: usize) -> u16 {
        some([&self.irradiance, &self.gloss], count)
    }

    /// A bit for each of the first `count` lanes that reflect any light by lobes other than the diffuse one.
    pub fn glossy(&self, count: usize) -> u16 {
        some([&self.gloss], count)
    }
}

/// A bit for each of the first `count` lanes in which any channel is not zero.
fn some<const N: usize>(vectors: [&Vectors; N], count: usize) -> u16 {
    let mut bits = [0_u32; WIDTH];
    for vectors in vectors {
        for channel in [&vectors.x, &vectors.y, &vectors.z] {
            // All but the sign: nothing is left of zeros of either, and some of a NaN.
            bits.iter_mut().zip(&channel.0).for_each(|(bits, value)| *bits |= value.to_bits() << 1);
        }
    }
    let mut mask = 0;
    for (lane, &bits) in bits[..count].iter().enumerate() {
        mask |= u16::from(bits != 0) << lane;
    }
    mask
}

/// How light from a source is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taking {
    /// Largest geometric term cos · cos / distance², 1/m²; what is more is cut off.
    pub bound: f32,
    /// The lobes besides the diffuse one.
    pub gloss: Selection,
    /// Lobes on either side that send rays of their own: they share light from emitters with them.
    pub shared: Selection,
}

/// Points with normals that light from many sources is asked for at: at most as many as a packet has lanes.
#[derive(Clone, Debug, Default)]
pub struct Receivers {
    mode: LaneMode,
    count: usize,
    position: Vectors,
    normal: Vectors,
}

impl Receivers {
    /// Of positions and unit normals.
    ///
    /// # Panics
    /// If there are more than [`WIDTH`].
    pub fn new(mode: LaneMode, points: impl IntoIterator<Item = (Vec3, Vec3)>) -> Self {
        let mut receivers = Self { mode, ..Self::default() };
        for (position, normal) in points {
            receivers.position.set(receivers.count, position);
            receivers.normal.set(receivers.count, normal);
            receivers.count += 1;
        }
        receivers
    }

    /// Luminance of the irradiance that a source causes at the points if nothing stands between; zero behind them.
    pub fn irradiance(&self, source: &Source, out: &mut Floats) {
        on_lanes!(self.mode, self.count, |token, lane| irradiance::<_>(token, lane, self, source, out));
    }
}

#[inline(always)]
fn irradiance<F: Real>(
    token: F::Token,
    lane: usize,
    receivers: &Receivers,
    source: &Source,
    out: &mut Floats,
) {
    let (wi, (sent, facing)) = arriving(token, source, Vector::<F>::load(token, &receivers.position, lane));
    let cos = Vector::load(token, &receivers.normal, lane).dot(wi).positive();
    (sent.luminance() * facing * cos).store(out, lane);
}

/// Light from a source at one point, before the surface's cosine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    /// Unit vector towards the light.
    pub wi: Vec3,
    /// What the source sends: radiance times area, or irradiance.
    pub radiance: Vec3,
    /// What of that arrives on a surface that faces it: cos / distance² for patches, 1/m².
    pub facing: f32,
}

impl Source {
    /// One of `count` sources of its kind, among which its light is shared.
    #[must_use]
    pub fn among(mut self, count: f32) -> Self {
        if let Self::Patch { density, .. } | Self::Distant { density, .. } = &mut self {
            *density *= count;
        }
        self
    }

    /// Light at one point.
    pub fn light(&self, at: Vec3) -> PointLight {
        let (wi, (radiance, facing)) = arriving::<f32>((), self, at.into());
        PointLight { wi: wi.into(), radiance: radiance.into(), facing }
    }

    /// Radiance times area of a patch, W/(m² sr) · m², in the mean over the directions that it sends light to.
    pub fn patch_radiance(&self) -> Option<Vec3> {
        let Self::Patch { radiance, rim, ref gloss, .. } = *self else { return None };
        let glossy = |(flux, gloss): &(Vec3, PatchGloss)| *flux * Vec3::from(gloss.albedo) * FRAC_1_PI;
        Some(radiance * (1.0 - rim * MEAN_RIM) + gloss.as_ref().map_or(Vec3::ZERO, glossy))
    }

    /// Whether it sends a flux of light into the scene: lights that shine alike at any distance have none.
    pub fn has_flux(&self) -> bool {
        !matches!(self, Self::Light { light, .. } if light.is_constant())
    }

    /// Where shadow rays to points start; `None` if the light comes from infinitely far away.
    pub fn origin(&self) -> Option<Vec3> {
        match *self {
            Self::Patch { position, error, normal, .. } => Some(position + normal * error),
            Self::Light { ref light, .. } => light.position(),
            Self::Distant { .. } => None,
        }
    }
}

impl Surfaces {
    /// Light from a source at the first `count` lanes.
    pub fn receive(&self, source: &Source, taking: &Taking, count: usize, out: &mut Received) {
        on_lanes!(self.mode, count, |token, lane| receive::<_>(token, lane, self, source, taking, out));
    }
}

#[inline(always)]
fn receive<F: Real>(
    token: F::Token,
    lane: usize,
    surfaces: &Surfaces,
    source: &Source,
    taking: &Taking,
    out: &mut Received,
) {
    let x = Vector::<F>::load(token, &surfaces.position, lane);
    let ng = Vector::<F>::load(token, &surfaces.ng, lane);
    let normal = Vector::<F>::load(token, &surfaces.normal, lane);
    let (wi, arriving) = arriving(token, source, x);
    let zero = F::constant(token, 0.0);
    let cos_ng = ng.dot(wi);
    let cos = normal.dot(wi).positive().only(cos_ng.gt(zero));
    // The geometric term is bounded as a whole: the share that is kept counts for every lobe. Only patches stand for an
    // area that could be near; other lights have no bound.
    let mut radiance = arriving.0 * arriving.1;
    if let Source::Patch { .. } = source {
        let kept = F::constant(token, taking.bound) / (cos * arriving.1);
        radiance = radiance * kept.min(F::constant(token, 1.0));
    }
    (radiance * (cos * FRAC_1_PI)).store(&mut out.irradiance, lane);
    let rest = taking.gloss.among(Lobes::ALL.without(Lobes::DIFFUSE));
    let mut gloss = match surfaces.may_have(rest) {
        true => surfaces.bsdf::<F>(token, lane).evaluate(wi, rest).f_cos * radiance,
        false => Vector::grey(zero),
    };
    if let Some(density) = density(token, source, arriving.1) {
        for side in [Lobes::REFLECTING, Lobes::TRANSMITTING] {
            let which = taking.shared.among(side);
            if surfaces.may_have(which) {
                let value = surfaces.bsdf::<F>(token, lane).evaluate(wi, which);
                let ratio = value.pdf / density;
                gloss = gloss + value.f_cos * radiance * (ratio * ratio + 1.0).recip();
            }
        }
    }
    gloss.store(&mut out.gloss, lane);
    wi.store(&mut out.wi, lane);
    if let Some(origin) = source.origin() {
        let offset = F::load(token, &surfaces.error, lane).copysign(cos_ng);
        (x + ng * offset - Vector::constant(token, origin)).store(&mut out.way, lane);
    }
}

/// Sources of its kind per steradian seen from a point, if rays share their light: infinitely many where no ray would find one.
/// `facing` is cos / distance² for patches.
#[inline(always)]
fn density<F: Real>(token: F::Token, source: &Source, facing: F) -> Option<F> {
    match *source {
        Source::Light { .. } => Some(F::constant(token, f32::INFINITY)),
        Source::Patch { density, .. } if density > 0.0 => {
            Some(F::constant(token, density) / facing.max(F::constant(token, f32::MIN_POSITIVE)))
        }
        Source::Distant { density, .. } if density > 0.0 => Some(F::constant(token, density)),
        _ => None,
    }
}

/// Direction towards the light, what it sends (radiance times area, or irradiance), and what of that arrives on a surface
/// that faces it.
#[inline(always)]
fn arriving<F: Real>(token: F::Token, source: &Source, x: Vector<F>) -> (Vector<F>, (Vector<F>, F)) {
    let one = F::constant(token, 1.0);
    match *source {
        Source::Patch { position, normal, radiance, rim, ref gloss, .. } => {
            let to_light = Vector::constant(token, position) - x;
            let distance2 = to_light.length_squared();
            let wi = to_light.normalized_or(Vector::grey(F::constant(token, 0.0)));
            let cos = -Vector::constant(token, normal).dot(wi);
            let cos = cos.positive();
            let facing = cos / distance2.max(F::constant(token, f32::MIN_POSITIVE));
            let mut sent = Vector::constant(token, radiance) * (one - schlick_weight(cos) * rim);
            if let Some((flux, gloss)) = gloss {
                sent = sent + Vector::constant(token, *flux) * gloss.towards(token, -wi);
            }
            (wi, (sent, facing))
        }
        Source::Light { ref light, factor } => {
            let (wi, _, weight) = light.arriving::<F>(x);
            (wi, (weight, one * factor))
        }
        Source::Distant { wi, irradiance, .. } => {
            (Vector::constant(token, wi), (Vector::constant(token, irradiance), one))
        }
    }
}
