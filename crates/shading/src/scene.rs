//! The shader tables of one scene: everything transport asks about hits and lights.

use std::cell::Cell;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use heliostat_kernel::{Hit, PathId, Ray, SeeThrough};
use heliostat_scene::{Attributes, GeometryId, MaterialId, SceneBounds};

use crate::camera::{Cone, Viewer};
use crate::emission::{EmittedRay, Source};
use crate::environment::EnvironmentLight;
use crate::gather::Reached;
use crate::lanes::WIDTH;
use crate::light::{LightSample, Lights, Tables};
use crate::material::SurfaceMaterial;
use crate::packet::Illumination;
use crate::placement::{Placement, ShadedPart};
use crate::point::{Arrival, Met};
use crate::punctual::PunctualLight;
use crate::reflectors::{self, Reflector};
use crate::sort::HitPacket;
use crate::surface::{LaneMode, ShadeScratch, Surface, Surfaces, shade};

/// Materials, placements and lights, indexed the way the kernel reports hits.
///
/// `placements[hit.path]` is the object that was hit and `parts[placement.parts][hit.geometry]` the part. Everything
/// can be changed in place; after changes, [`Self::relight`] brings the lights up to date.
#[derive(Clone, Debug, Default)]
pub struct ShadingScene {
    materials: Vec<SurfaceMaterial>,
    /// The parts of each object, in the order of the kernel's geometries.
    parts: Vec<Arc<[ShadedPart]>>,
    placements: Arc<[Placement]>,
    /// Emissive parts of placements.
    emissive: Vec<(u32, u32)>,
    lights: Lights,
    /// For each object the geometries that let light straight through, as [`SeeThrough`] tells them; empty if none does.
    see_through: Vec<Box<[u64]>>,
    mode: LaneMode,
    viewer: Option<Viewer>,
    bounds: Option<SceneBounds>,
}

/// The light that a hit surface is, for multiple importance sampling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmitterPdf {
    /// Index of the emitter.
    pub emitter: usize,
    /// Density per steradian of sampling the hit point from this emitter.
    pub solid_angle: f32,
}

impl SeeThrough for ShadingScene {
    fn geometries(&self, path: PathId) -> &[u64] {
        let placement = self.placements.get(path.0 as usize);
        placement
            .and_then(|placement| self.see_through.get(placement.parts as usize))
            .map_or(&[], |bits| bits)
    }
}

thread_local! {
    /// Memory for shading one hit, kept between the calls of a thread: there is room for sixteen in it. Holds no state.
    static KEPT: Cell<Option<Box<(ShadeScratch, Surfaces)>>> = const { Cell::new(None) };
}

impl ShadingScene {
    /// Ties tables together; the lights are still missing.
    pub fn new(
        materials: Vec<SurfaceMaterial>,
        parts: Vec<Arc<[ShadedPart]>>,
        placements: Arc<[Placement]>,
    ) -> Self {
        let mut scene = Self { materials, parts, placements, ..Self::default() };
        scene.look_for_see_through();
        scene.emissive = scene.tables().emissive();
        scene
    }

    /// Chooses how shaders run; the default is packets of the best instruction set. No result depends on it.
    pub fn set_lane_mode(&mut self, mode: LaneMode) {
        self.mode = mode;
    }

    /// Says from where the frame is seen that is about to be made; `None` for what is no frame.
    pub fn set_viewer(&mut self, viewer: Option<Viewer>) {
        self.viewer = viewer;
    }

    /// How shaders run.
    pub fn lane_mode(&self) -> LaneMode {
        self.mode
    }

    /// Collects the lights: `lights`, emissive surfaces, the environment. `bounds` sets the power of lights that are
    /// infinitely far away. Costs what there are of them.
    pub fn relight(
        &mut self,
        lights: impl Iterator<Item = PunctualLight>,
        environment: Arc<EnvironmentLight>,
        bounds: Option<SceneBounds>,
    ) {
        self.bounds = bounds;
        self.lights = Lights::new(self.tables(), &self.emissive, lights, environment, bounds);
    }

    /// The placements by path, to be moved: neither their number nor their parts may change. Copies them if another scene
    /// shares them.
    pub fn placements_mut(&mut self) -> &mut [Placement] {
        Arc::make_mut(&mut self.placements)
    }

    /// Replaces the parts of an object by others of the same materials: its shapes changed.
    pub fn reshape(&mut self, object: u32, parts: Arc<[ShadedPart]>) {
        self.parts[object as usize] = parts;
    }

    /// Replaces the attributes of a geometry in an object, by its place in the table of parts.
    pub fn set_attributes(&mut self, object: u32, geometry: GeometryId, attributes: &Arc<Attributes>) {
        let parts = Arc::make_mut(&mut self.parts[object as usize]);
        for part in parts.iter_mut().filter(|part| part.geometry == geometry) {
            part.attributes = attributes.clone();
        }
    }

    /// What parameters of shaders take from attributes that geometries lack, where `of` looks at a geometry with a material:
    /// a sentence for each parameter.
    pub fn missing_attributes(&self, of: impl Fn(MaterialId, GeometryId) -> bool) -> Vec<String> {
        let mut problems = Vec::new();
        for (index, material) in self.materials.iter().enumerate() {
            for input in material.attribute_inputs() {
                let lacks = |part: &&ShadedPart| {
                    part.material as usize == index
                        && of(material.id, part.geometry)
                        && !part.attributes.contains_key(&input.name)
                };
                let mut lacking: Vec<GeometryId> = self
                    .parts
                    .iter()
                    .flat_map(|parts| parts.iter())
                    .filter(lacks)
                    .map(|p| p.geometry)
                    .collect();
                lacking.sort_unstable();
                lacking.dedup();
                if let Some(first) = lacking.first() {
                    problems.push(input.missing(&material.source().name, *first, lacking.len() - 1));
                }
            }
        }
        problems
    }

    /// Replaces materials, by their index.
    pub fn replace_materials(&mut self, replaced: Vec<(usize, SurfaceMaterial)>) {
        let mut shone = false;
        for (index, material) in replaced {
            shone |= self.materials[index].source().is_emissive() != material.source().is_emissive();
            self.materials[index] = material;
        }
        self.look_for_see_through();
        if shone {
            self.emissive = self.tables().emissive();
        }
    }

    /// Whether some part of an object (by its place in the table of parts) emits light.
    pub fn emits(&self, object: u32) -> bool {
        let parts = &self.parts[object as usize];
        parts.iter().any(|part| self.materials[part.material as usize].source().is_emissive())
    }

    fn look_for_see_through(&mut self) {
        let of_object = |parts: &Arc<[ShadedPart]>| -> Box<[u64]> {
            let lets_through = |part: &ShadedPart| self.materials[part.material as usize].is_see_through();
            let words = parts.iter().rposition(lets_through).map_or(0, |last| last / 64 + 1);
            let word = |parts: &[ShadedPart]| {
                (0..).zip(parts).fold(0, |bits, (at, part)| bits | u64::from(lets_through(part)) << at)
            };
            parts.chunks(64).take(words).map(word).collect()
        };
        self.see_through = self.parts.iter().map(of_object).collect();
        if self.see_through.iter().all(|geometries| geometries.is_empty()) {
            self.see_through.clear();
        }
    }

    fn tables(&self) -> Tables<'_> {
        Tables { placements: &self.placements, parts: &self.parts, materials: &self.materials }
    }

    /// The materials by their index.
    pub fn materials(&self) -> &[SurfaceMaterial] {
        &self.materials
    }

    /// The parts that have lobes of a roughness (perceptual, the square root of GGX α) of at most `sharp`.
    pub fn reflectors(&self, sharp: f32) -> Vec<Reflector> {
        reflectors::list(self.tables(), sharp)
    }

    /// All lights.
    pub fn lights(&self) -> &Lights {
        &self.lights
    }

    /// The placements by path.
    pub fn placements(&self) -> &Arc<[Placement]> {
        &self.placements
    }

    /// The parts of each object.
    pub fn parts(&self) -> &[Arc<[ShadedPart]>] {
        &self.parts
    }

    /// Whether any surface lets light pass straight through, so that shadows are not simply hits.
    pub fn has_see_through(&self) -> bool {
        !self.see_through.is_empty()
    }

    /// The part that was hit, with its placement and material. `hit` must be a hit.
    #[inline]
    pub fn part(&self, hit: &Hit) -> (&Placement, &ShadedPart, &SurfaceMaterial) {
        self.tables().part(hit.path.0 as u32, hit.geometry)
    }

    /// What went wrong in shaders as they ran and was not told before.
    pub fn take_problems(&self) -> Vec<String> {
        self.materials.iter().filter_map(|m| m.shader.as_ref()?.program.take_problem()).collect()
    }

    /// Index of the material that was hit. `hit` must be a hit.
    pub fn material_of(&self, hit: &Hit) -> u32 {
        let placement = &self.placements[hit.path.0 as usize];
        self.parts[placement.parts as usize][hit.geometry as usize].material
    }

    /// Shades the hits of a packet into the lanes of `surfaces`, in their order. `along` gives the ray of each hit.
    /// `scratch` is for inner use.
    pub fn shade<'a>(
        &'a self,
        packet: &HitPacket<'_>,
        along: impl Fn(usize) -> Arrival<'a> + Copy,
        scratch: &mut ShadeScratch,
        surfaces: &mut Surfaces,
    ) {
        let material = &self.materials[packet.material as usize];
        let mut last = self.reached(along(packet.hits[0] as usize));
        // Lanes without a hit repeat the last one's.
        let reached: [Reached<'_>; WIDTH] = std::array::from_fn(|lane| {
            if let Some(&index) = packet.hits.get(lane) {
                let arrival = along(index as usize);
                let same = arrival.hit.is_on_part_of(last.0.hit);
                last = if same { (arrival, last.1, last.2) } else { self.reached(arrival) };
            }
            last
        });
        scratch.points.viewer = self.viewer;
        scratch.points.gather(self.mode, material, (&reached, packet.hits.len()), &mut scratch.triangles);
        shade(self.mode, material, scratch, packet.hits.len(), surfaces);
    }

    #[inline]
    fn reached<'a>(&'a self, arrival: Arrival<'a>) -> Reached<'a> {
        let (placement, part, _) = self.part(arrival.hit);
        (arrival, placement, part)
    }

    /// The surface where `ray`, of unit direction, was hit; its footprint there is `cone`.
    pub fn surface(&self, hit: &Hit, ray: &Ray, cone: Cone) -> Surface<f32> {
        let mut kept = KEPT.take().unwrap_or_default();
        let (scratch, surfaces) = &mut *kept;
        let material = self.part(hit).2;
        let reached = [self.reached(Arrival { hit, ray, cone, level: 1 })];
        scratch.points.viewer = self.viewer;
        scratch.points.gather(LaneMode::Single, material, (&reached, 1), &mut scratch.triangles);
        shade(LaneMode::Single, material, scratch, 1, surfaces);
        let surface = surfaces.lane(0);
        KEPT.set(Some(kept));
        surface
    }

    /// The way straight through the surface at a hit: what passes, per channel, and where the ray goes on. `None` if
    /// nothing passes.
    pub fn see_through(&self, hit: &Hit, ray: &Ray) -> Option<(Vec3, Vec3)> {
        let (.., material) = self.part(hit);
        if !material.is_see_through() {
            return None;
        }
        let surface = self.surface(hit, ray, Cone::default());
        let through = Vec3::from(surface.through);
        (through != Vec3::ZERO).then(|| (through, surface.spawn(ray.direction.into()).into()))
    }

    /// How light sampling from a point `distance` away would have found what `ray` hit; `None` if it is no light.
    pub fn emitter_pdf(&self, hit: &Hit, ray: &Ray, distance: f32) -> Option<EmitterPdf> {
        let path = hit.path.0 as u32;
        let emitter = self.lights.area(path, hit.geometry)?;
        let (placement, part, _) = self.part(hit);
        let moved = placement.at(ray.time);
        let placement = moved.as_ref().unwrap_or(placement);
        let met = Met::new(&part.shape, hit.primitive, Vec2::new(hit.u, hit.v), ray.time);
        let cos = hit.ng.dot(ray.direction).abs();
        let probability = self.lights.triangle_probability(emitter, hit.primitive);
        let solid_angle =
            probability * met.area_pdf(placement) * distance * distance / cos.max(f32::MIN_POSITIVE);
        Some(EmitterPdf { emitter, solid_angle })
    }

    /// Samples light from one emitter at a point, at `time` in [0, 1] of the shutter interval.
    pub fn sample_light(
        &self,
        emitter: usize,
        (position, time): (Vec3, f32),
        u: Vec2,
        u_triangle: f32,
    ) -> Option<LightSample> {
        self.lights.sample(self.tables(), emitter, (position, time), u, u_triangle)
    }

    /// Samples light from one emitter for the first `count` lanes of shaded surfaces. `along` gives the time and, if the
    /// emitter is [extended](Lights::is_extended), the sample points of a lane.
    pub fn illuminate(
        &self,
        emitter: usize,
        surfaces: &Surfaces,
        along: impl Fn(usize) -> (f32, [f32; 4]),
        count: usize,
        out: &mut Illumination,
    ) {
        self.lights.illuminate(self.tables(), emitter, surfaces, along, count, out);
    }

    /// Sends light from an emitter that was chosen with a probability: the point that it leaves, and a ray that carries on
    /// its flux, if the emitter sends any into the scene. `u` are five sample points in [0, 1): three for the place, two for
    /// the direction.
    pub fn emit(&self, chosen: (usize, f32), u: [f32; 5]) -> Option<(Source, Option<EmittedRay>)> {
        self.lights.emit(self.tables(), chosen, u, self.bounds)
    }
}
