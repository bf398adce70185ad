//! Surfaces ready for light transport: how points emit, scatter and let light through.

use fearless_simd::{Level, Simd};
use glam::Vec3;
use heliostat_kernel::Isa;

use crate::bsdf::{Bsdf, Glass, Reflection, ThinTransmission};
use crate::closure::{Closure, Closures};
use crate::gather::Triangles;
use crate::lanes::{Floats, Mask, Packet, Real, Vector, Vectors, WIDTH};
use crate::lobe_set::{Lobes, Selection};
use crate::lobes::{LobeGeometry, appearance};
use crate::material::{Slot, SurfaceMaterial, TextureCoordinates};
use crate::packet::on_lanes;
use crate::point::Points;

/// A surface point ready for light transport, or several side by side.
#[derive(Clone, Copy, Debug)]
pub struct Surface<F: Real> {
    /// World space.
    pub position: Vector<F>,
    /// Bound on the rounding error of `position`, metres.
    pub error: F,
    /// Whether the viewer is on the front side.
    pub front: F::Mask,
    /// Radiance emitted towards the viewer by the part of the surface that is there (see `coverage`).
    pub emission: Vector<F>,
    /// Share of light that meets the surface; the rest passes.
    pub coverage: F,
    /// Transmittance straight through, per channel: holes and clear thin sheets.
    pub through: Vector<F>,
    /// How the surface scatters, for the share of light that meets it.
    pub bsdf: Bsdf<F>,
    /// Share of uniform white light that is reflected or transmitted.
    pub albedo: Vector<F>,
    /// Radiance of the classical ambient term, which renderers add that do not follow light between surfaces.
    pub ambient: Vector<F>,
    /// Absorption per metre along the ray that arrived: non-zero if it came through a solid.
    pub absorption: Vector<F>,
}

impl<F: Real> Surface<F> {
    /// Unit geometric normal, on the viewer's side.
    pub fn ng(&self) -> Vector<F> {
        self.bsdf.ng
    }

    /// Origin for a ray that leaves towards `direction`: moved off the surface by its error bound.
    #[inline(always)]
    pub fn spawn(&self, direction: Vector<F>) -> Vector<F> {
        self.position + self.bsdf.ng * self.error.copysign(self.bsdf.ng.dot(direction))
    }
}

/// Sixteen surface points of one material in memory: what surface shaders answer.
#[repr(C)]
#[derive(Clone, Debug, Default)]
pub struct Surfaces {
    pub(crate) position: Vectors,
    pub(crate) error: Floats,
    /// 1 where the viewer is on the front side, 0 elsewhere.
    front: Floats,
    emission: Vectors,
    coverage: Floats,
    through: Vectors,
    albedo: Vectors,
    ambient: Vectors,
    absorption: Vectors,
    present: Present,
    pub(crate) normal: Vectors,
    coat_normal: Vectors,
    pub(crate) ng: Vectors,
    wo: Vectors,
    choice: [Floats; 5],
    diffuse: Vectors,
    specular: Gloss,
    coat: Gloss,
    glass: [Floats; 4],
    transmit: Vectors,
    thin: Vectors,
    thin_alpha: Floats,
    lobes: Lobes,
    pub(crate) mode: LaneMode,
}

/// What some lane may have that few surfaces do: the others are spared to be read.
#[derive(Clone, Copy, Debug, Default)]
struct Present {
    emission: bool,
    through: bool,
    ambient: bool,
    absorption: bool,
}

#[repr(C)]
#[derive(Clone, Debug, Default)]
struct Gloss {
    f0: Vectors,
    f90: Vectors,
    alpha: Floats,
}

impl Gloss {
    #[inline(always)]
    fn load<F: Real>(&self, token: F::Token, lane: usize) -> Reflection<F> {
        Reflection {
            f0: Vector::load(token, &self.f0, lane),
            f90: Vector::load(token, &self.f90, lane),
            alpha: F::load(token, &self.alpha, lane),
        }
    }

    #[inline(always)]
    fn store<F: Real>(&mut self, reflection: Reflection<F>, lane: usize) {
        reflection.f0.store(&mut self.f0, lane);
        reflection.f90.store(&mut self.f90, lane);
        reflection.alpha.store(&mut self.alpha, lane);
    }
}

impl Surfaces {
    /// The lobes that may have energy in some lane.
    pub fn lobes(&self) -> Lobes {
        self.lobes
    }

    /// Whether any lobe of a selection may have energy in some lane.
    pub fn may_have(&self, which: Selection) -> bool {
        which.may_take(self.lobes)
    }

    /// Whether any lane emits light, or has an ambient term of its own.
    #[inline]
    pub fn glows(&self) -> bool {
        self.present.emission || self.present.ambient
    }

    /// Whether any lane lets light pass straight through, or is seen through something that absorbs.
    #[inline]
    pub fn filters(&self) -> bool {
        self.present.through || self.present.absorption
    }

    /// World-space position of a lane.
    #[inline]
    pub fn position(&self, lane: usize) -> Vec3 {
        self.position.get(lane)
    }

    /// Shading normal of a lane, on the viewer's side.
    #[inline]
    pub fn normal(&self, lane: usize) -> Vec3 {
        self.normal.get(lane)
    }

    /// See [`Surface::albedo`].
    #[inline]
    pub fn albedo(&self, lane: usize) -> Vec3 {
        self.albedo.get(lane)
    }

    /// Reflectance of the diffuse lobe of a lane.
    #[inline]
    pub fn diffuse(&self, lane: usize) -> Vec3 {
        self.diffuse.get(lane)
    }

    /// See [`Surface::emission`].
    #[inline]
    pub fn emission(&self, lane: usize) -> Vec3 {
        if self.present.emission { self.emission.get(lane) } else { Vec3::ZERO }
    }

    /// See [`Surface::ambient`].
    #[inline]
    pub fn ambient(&self, lane: usize) -> Vec3 {
        if self.present.ambient { self.ambient.get(lane) } else { Vec3::ZERO }
    }

    /// See [`Surface::absorption`].
    #[inline]
    pub fn absorption(&self, lane: usize) -> Vec3 {
        if self.present.absorption { self.absorption.get(lane) } else { Vec3::ZERO }
    }

    /// See [`Surface::coverage`].
    #[inline]
    pub fn coverage(&self, lane: usize) -> f32 {
        self.coverage.0[lane]
    }

    /// See [`Surface::through`].
    #[inline]
    pub fn through(&self, lane: usize) -> Vec3 {
        if self.present.through { self.through.get(lane) } else { Vec3::ZERO }
    }

    /// Origin for a ray that leaves a lane's surface towards `direction`.
    #[inline]
    pub fn origin(&self, lane: usize, direction: Vec3) -> Vec3 {
        let ng = self.ng.get(lane);
        self.position.get(lane) + ng * self.error.0[lane].copysign(ng.dot(direction))
    }

    /// The surface of one lane.
    ///
    /// # Panics
    /// If `lane` is not below [`WIDTH`].
    pub fn lane(&self, lane: usize) -> Surface<f32> {
        assert!(lane < WIDTH, "lane {lane} of {WIDTH}");
        self.load((), lane)
    }

    /// Lanes from `lane` on.
    #[inline(always)]
    pub fn load<F: Real>(&self, token: F::Token, lane: usize) -> Surface<F> {
        let zero = F::constant(token, 0.0);
        Surface {
            position: Vector::load(token, &self.position, lane),
            error: F::load(token, &self.error, lane),
            front: F::load(token, &self.front, lane).gt(zero),
            emission: present(token, self.present.emission, &self.emission, lane),
            coverage: F::load(token, &self.coverage, lane),
            through: present(token, self.present.through, &self.through, lane),
            bsdf: self.bsdf(token, lane),
            albedo: Vector::load(token, &self.albedo, lane),
            ambient: present(token, self.present.ambient, &self.ambient, lane),
            absorption: present(token, self.present.absorption, &self.absorption, lane),
        }
    }

    /// The scattering functions of lanes from `lane` on, if none has lobes but the diffuse one.
    #[inline(always)]
    pub(crate) fn diffuse_bsdf<F: Real>(&self, token: F::Token, lane: usize) -> Bsdf<F> {
        let zero = F::constant(token, 0.0);
        let normal = Vector::load(token, &self.normal, lane);
        Bsdf {
            normal,
            coat_normal: normal,
            ng: Vector::load(token, &self.ng, lane),
            wo: Vector::load(token, &self.wo, lane),
            diffuse: Vector::load(token, &self.diffuse, lane),
            specular: Reflection::none(zero),
            coat: Reflection::none(zero),
            glass: Glass::none(zero),
            thin: ThinTransmission::none(zero),
            lobes: Lobes::DIFFUSE,
            choice: [F::load(token, &self.choice[0], lane), zero, zero, zero, zero],
        }
    }

    /// The scattering functions of lanes from `lane` on.
    #[inline(always)]
    pub fn bsdf<F: Real>(&self, token: F::Token, lane: usize) -> Bsdf<F> {
        let zero = F::constant(token, 0.0);
        let has_glass = !self.lobes.intersection(Lobes::GLASS_REFLECT).is_empty();
        let [c0, c1, c2, c3, c4] = &self.choice;
        let [eta, alpha, reflectance, reflect] = &self.glass;
        let normal = Vector::load(token, &self.normal, lane);
        Bsdf {
            normal,
            coat_normal: match self.lobes.contains(Lobes::COAT) {
                true => Vector::load(token, &self.coat_normal, lane),
                false => normal,
            },
            ng: Vector::load(token, &self.ng, lane),
            wo: Vector::load(token, &self.wo, lane),
            diffuse: Vector::load(token, &self.diffuse, lane),
            specular: match self.lobes.contains(Lobes::SPECULAR) {
                true => self.specular.load(token, lane),
                false => Reflection::none(zero),
            },
            coat: match self.lobes.contains(Lobes::COAT) {
                true => self.coat.load(token, lane),
                false => Reflection::none(zero),
            },
            glass: match has_glass {
                true => Glass {
                    eta: F::load(token, eta, lane),
                    alpha: F::load(token, alpha, lane),
                    reflectance: F::load(token, reflectance, lane),
                    reflect: F::load(token, reflect, lane),
                    transmit: Vector::load(token, &self.transmit, lane),
                },
                false => Glass::none(zero),
            },
            thin: match self.lobes.contains(Lobes::THIN_TRANSMIT) {
                true => ThinTransmission {
                    color: Vector::load(token, &self.thin, lane),
                    alpha: F::load(token, &self.thin_alpha, lane),
                },
                false => ThinTransmission::none(zero),
            },
            lobes: self.lobes,
            choice: [
                F::load(token, c0, lane),
                F::load(token, c1, lane),
                F::load(token, c2, lane),
                F::load(token, c3, lane),
                F::load(token, c4, lane),
            ],
        }
    }

    /// Stores lanes from `lane` on. Fields of lobes that no lane has keep what they held.
    #[inline(always)]
    fn store<F: Real>(&mut self, surface: &Surface<F>, lane: usize) {
        let one = surface.error.splat(1.0);
        let before = if lane == 0 { Present::default() } else { self.present };
        self.present = Present {
            emission: before.emission || !surface.emission.is_zero().all(),
            through: before.through || !surface.through.is_zero().all(),
            ambient: before.ambient || !surface.ambient.is_zero().all(),
            absorption: before.absorption || !surface.absorption.is_zero().all(),
        };
        surface.position.store(&mut self.position, lane);
        surface.error.store(&mut self.error, lane);
        one.only(surface.front).store(&mut self.front, lane);
        // What no lane has is not asked for; of single lanes others may follow that have it.
        let one_by_one = F::LANES == 1;
        if self.present.emission || one_by_one {
            surface.emission.store(&mut self.emission, lane);
        }
        surface.coverage.store(&mut self.coverage, lane);
        if self.present.through || one_by_one {
            surface.through.store(&mut self.through, lane);
        }
        surface.albedo.store(&mut self.albedo, lane);
        if self.present.ambient || one_by_one {
            surface.ambient.store(&mut self.ambient, lane);
        }
        if self.present.absorption || one_by_one {
            surface.absorption.store(&mut self.absorption, lane);
        }
        let bsdf = &surface.bsdf;
        self.lobes = bsdf.lobes;
        bsdf.normal.store(&mut self.normal, lane);
        bsdf.ng.store(&mut self.ng, lane);
        bsdf.wo.store(&mut self.wo, lane);
        for (choice, to) in bsdf.choice.iter().zip(&mut self.choice) {
            choice.store(to, lane);
        }
        bsdf.diffuse.store(&mut self.diffuse, lane);
        if bsdf.lobes.contains(Lobes::SPECULAR) {
            self.specular.store(bsdf.specular, lane);
        }
        if bsdf.lobes.contains(Lobes::COAT) {
            bsdf.coat_normal.store(&mut self.coat_normal, lane);
            self.coat.store(bsdf.coat, lane);
        }
        if bsdf.lobes.contains(Lobes::GLASS_REFLECT) {
            let [eta, alpha, reflectance, reflect] = &mut self.glass;
            bsdf.glass.eta.store(eta, lane);
            bsdf.glass.alpha.store(alpha, lane);
            bsdf.glass.reflectance.store(reflectance, lane);
            bsdf.glass.reflect.store(reflect, lane);
            bsdf.glass.transmit.store(&mut self.transmit, lane);
        }
        if bsdf.lobes.contains(Lobes::THIN_TRANSMIT) {
            bsdf.thin.color.store(&mut self.thin, lane);
            bsdf.thin.alpha.store(&mut self.thin_alpha, lane);
        }
    }
}

/// Vectors that are zero unless some lane has any.
#[inline(always)]
fn present<F: Real>(token: F::Token, any: bool, from: &Vectors, lane: usize) -> Vector<F> {
    if any { Vector::load(token, from, lane) } else { Vector::grey(F::constant(token, 0.0)) }
}

/// How shaders run. No result depends on it.
#[derive(Clone, Copy, Debug)]
pub enum LaneMode {
    /// Sixteen points at a time, in the registers of an instruction set.
    Packets(Level),
    /// One after the other, for comparison.
    Single,
}

impl Default for LaneMode {
    /// Packets of the instruction set that [`Isa::from_env`] forces, or the machine's best.
    fn default() -> Self {
        let isa = Isa::from_env().ok().flatten().unwrap_or_else(Isa::best);
        isa.level().map_or(Self::Single, Self::Packets)
    }
}

/// What shading a packet takes besides its result.
#[derive(Clone, Debug, Default)]
pub struct ShadeScratch {
    pub(crate) points: Points,
    pub(crate) triangles: Triangles,
    closures: Closures,
}

/// Shades points of one material.
pub(crate) fn shade(
    mode: LaneMode,
    material: &SurfaceMaterial,
    scratch: &mut ShadeScratch,
    count: usize,
    out: &mut Surfaces,
) {
    out.mode = mode;
    let ShadeScratch { points, closures, .. } = scratch;
    match &material.shader {
        None => on_lanes!(mode, count, |token, lane| plain::<_>(token, lane, material, points, out)),
        Some(shader) => {
            on_lanes!(mode, count, |token, lane| begin::<_>(token, lane, material, points, closures));
            shader.program.run(mode, count, points, &shader.inputs, closures);
            on_lanes!(mode, count, |token, lane| finish::<_>(token, lane, material, points, closures, out));
        }
    }
}

/// A material without a shader, in one go.
#[inline(always)]
fn plain<F: Real>(
    token: F::Token,
    lane: usize,
    material: &SurfaceMaterial,
    points: &Points,
    out: &mut Surfaces,
) {
    let closure = closure::<F>(token, material, points, lane);
    // Compiled for the most frequent set of lobes too, which takes a fraction of what all of them take.
    match material.lobes() == Lobes::DIFFUSE {
        true => out.store::<F>(&surface((token, lane), material, Lobes::DIFFUSE, points, closure), lane),
        false => out.store::<F>(&surface((token, lane), material, material.lobes(), points, closure), lane),
    }
}

/// What a shader starts from.
#[inline(always)]
fn begin<F: Real>(
    token: F::Token,
    lane: usize,
    material: &SurfaceMaterial,
    points: &Points,
    closures: &mut Closures,
) {
    closures.store::<F>(&closure(token, material, points, lane), lane);
}

/// What becomes of a shader's answer.
#[inline(always)]
fn finish<F: Real>(
    token: F::Token,
    lane: usize,
    material: &SurfaceMaterial,
    points: &Points,
    closures: &Closures,
    out: &mut Surfaces,
) {
    let closure = closures.load::<F>(token, lane).sane();
    out.store::<F>(&surface((token, lane), material, material.lobes(), points, closure), lane);
}

/// The closure of a material at points, from `lane` on.
#[inline(always)]
fn closure<F: Real>(token: F::Token, material: &SurfaceMaterial, points: &Points, lane: usize) -> Closure<F> {
    let at = points.coordinates(token, lane);
    let wo = Vector::<F>::load(token, &points.wo, lane);
    let front = Vector::<F>::load(token, &points.ng, lane).dot(wo).gt(F::constant(token, 0.0));
    let smooth = Vector::load(token, &points.normal, lane);
    let source = material.source();
    let normal = mapped(points, 0, lane, smooth, &material.normal, source.normal_scale, &at);
    let coat_normal = match &source.clearcoat {
        Some(coat) => mapped(points, 1, lane, smooth, &material.coat_normal, coat.normal_scale, &at),
        None => normal,
    };
    material.closure(&at, (normal, coat_normal), front)
}

/// The surface at points, from `lane` on, of a closure. `lobes` are the material's.
#[inline(always)]
fn surface<F: Real>(
    (token, lane): (F::Token, usize),
    material: &SurfaceMaterial,
    lobes: Lobes,
    points: &Points,
    mut closure: Closure<F>,
) -> Surface<F> {
    let zero = F::constant(token, 0.0);
    let wo = Vector::<F>::load(token, &points.wo, lane);
    let ng = Vector::<F>::load(token, &points.ng, lane);
    let front = ng.dot(wo).gt(zero);
    closure.normal = towards_viewer(closure.normal.where_or(front, -closure.normal), wo);
    closure.coat_normal = match lobes.contains(Lobes::COAT) {
        true => towards_viewer(closure.coat_normal.where_or(front, -closure.coat_normal), wo),
        false => closure.normal,
    };
    let ng = ng.where_or(front, -ng);
    let mut appearance = appearance((material, lobes), &closure, &LobeGeometry { ng, wo, front });
    let (mut emission, mut ambient) = (closure.emission, closure.ambient);
    if material.source().unlit {
        emission = closure.base_color;
        appearance.through = Vector::grey(closure.opacity.complement());
        appearance.albedo = emission;
        ambient = Vector::grey(zero);
    }
    Surface {
        position: Vector::load(token, &points.position, lane),
        error: F::load(token, &points.error, lane),
        front,
        emission,
        coverage: closure.opacity,
        through: appearance.through,
        bsdf: appearance.bsdf,
        albedo: appearance.albedo,
        ambient,
        absorption: Vector::constant(token, material.absorption()).only(!front),
    }
}

/// The normal of a normal map, in world space on the front side; `smooth` where there is none.
#[inline(always)]
fn mapped<F: Real>(
    points: &Points,
    map: usize,
    lane: usize,
    smooth: Vector<F>,
    slot: &Option<Slot>,
    scale: f32,
    at: &TextureCoordinates<F>,
) -> Vector<F> {
    let Some(slot) = slot else { return smooth };
    let [x, y] = &points.tangents[map];
    let x = Vector::load(smooth.token(), x, lane);
    let y = Vector::load(smooth.token(), y, lane);
    let t = slot.lookup(at).rgb.scaled(2.0) - Vector::grey(smooth.x.splat(1.0));
    let n = x * (t.x * scale) + y * (t.y * scale) + smooth * t.z;
    let length = x.length_squared();
    n.normalized_or(smooth).where_or(length.gt(length.splat(0.0)), smooth)
}

/// Bends a normal just enough that the viewer is above its horizon.
#[inline(always)]
fn towards_viewer<F: Real>(n: Vector<F>, wo: Vector<F>) -> Vector<F> {
    const LEAST_COSINE: f32 = 0.01;
    let least = n.x.splat(LEAST_COSINE);
    let cos = n.dot(wo);
    if cos.ge(least).all() {
        return n;
    }
    let bent = (n + wo * (least - cos)).normalized_or(wo);
    n.where_or(cos.ge(least), bent)
}
