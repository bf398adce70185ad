//! The shader tables of one scene: everything transport asks about hits and lights.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use heliostat_kernel::Hit;
use heliostat_scene::{Light, SceneBounds};

use crate::camera::Cone;
use crate::environment::EnvironmentLight;
use crate::light::{LightSample, Lights, Tables};
use crate::material::SurfaceMaterial;
use crate::surface::{Placement, ShadedPart, Surface, SurfaceQuery, surface};

/// Materials, placements and lights, indexed the way the kernel reports hits.
///
/// `placements[hit.path]` is the object that was hit and `placement.parts[hit.geometry]` the part.
#[derive(Clone, Debug)]
pub struct ShadingScene {
    materials: Vec<SurfaceMaterial>,
    placements: Arc<[Placement]>,
    lights: Lights,
    see_through: bool,
}

/// The light that a hit surface is, for multiple importance sampling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmitterPdf {
    /// Probability of choosing the emitter.
    pub choice: f32,
    /// Density per steradian of sampling the hit point from this emitter.
    pub solid_angle: f32,
}

impl ShadingScene {
    /// Ties the tables together and collects the lights.
    pub fn new<'a>(
        materials: Vec<SurfaceMaterial>,
        placements: Arc<[Placement]>,
        lights: impl Iterator<Item = &'a Light>,
        environment: Arc<EnvironmentLight>,
        bounds: Option<SceneBounds>,
    ) -> Self {
        let tables = Tables { placements: &placements, materials: &materials };
        let lights = Lights::new(tables, lights, environment, bounds);
        let used = placements.iter().flat_map(|p| p.parts.iter()).map(|part| part.material as usize);
        let see_through = used.into_iter().any(|material| materials[material].is_see_through());
        Self { materials, placements, lights, see_through }
    }

    /// All lights.
    pub fn lights(&self) -> &Lights {
        &self.lights
    }

    /// The placements by path.
    pub fn placements(&self) -> &[Placement] {
        &self.placements
    }

    /// Whether any surface lets light pass straight through, so that shadows are not simply hits.
    pub fn has_see_through(&self) -> bool {
        self.see_through
    }

    /// The part that was hit, with its placement and material. `hit` must be a hit.
    pub fn part(&self, hit: &Hit) -> (&Placement, &ShadedPart, &SurfaceMaterial) {
        let placement = &self.placements[hit.path.0 as usize];
        let part = &placement.parts[hit.geometry as usize];
        (placement, part, &self.materials[part.material as usize])
    }

    /// The surface at a hit of a ray of unit `direction` whose footprint there is `cone`.
    pub fn surface(&self, hit: &Hit, direction: Vec3, cone: Cone) -> Surface {
        let (placement, part, material) = self.part(hit);
        surface(placement, part, material, &query(hit, direction, cone))
    }

    /// The way straight through the surface at a hit: what passes, per channel, and where the ray goes on. `None` if
    /// nothing passes.
    pub fn see_through(&self, hit: &Hit, direction: Vec3) -> Option<(Vec3, Vec3)> {
        let (placement, part, material) = self.part(hit);
        if !material.is_see_through() {
            return None;
        }
        let surface = surface(placement, part, material, &query(hit, direction, Cone::default()));
        (surface.through != Vec3::ZERO).then(|| (surface.through, surface.spawn(direction)))
    }

    /// How light sampling from a point `distance` away would have found this hit; `None` if it is no light.
    pub fn emitter_pdf(&self, hit: &Hit, direction: Vec3, distance: f32) -> Option<EmitterPdf> {
        let path = hit.path.0 as u32;
        let (emitter, choice) = self.lights.area(path, hit.geometry)?;
        let (placement, part, _) = self.part(hit);
        let corners = crate::surface::Corners::new(&part.mesh, hit.primitive, Vec2::new(hit.u, hit.v));
        let [a, b, c] = corners.world(&placement.world_from_object);
        let area = 0.5 * (b - a).cross(c - a).length();
        let cos = hit.ng.dot(direction).abs();
        let probability = self.lights.triangle_probability(emitter, hit.primitive);
        let solid_angle = probability * distance * distance / (area * cos).max(f32::MIN_POSITIVE);
        Some(EmitterPdf { choice, solid_angle })
    }

    /// Samples light from one emitter at a point.
    pub fn sample_light(
        &self,
        emitter: usize,
        position: Vec3,
        u: Vec2,
        u_triangle: f32,
    ) -> Option<LightSample> {
        let tables = Tables { placements: &self.placements, materials: &self.materials };
        self.lights.sample(tables, emitter, position, u, u_triangle)
    }
}

fn query(hit: &Hit, direction: Vec3, cone: Cone) -> SurfaceQuery {
    SurfaceQuery { uv: Vec2::new(hit.u, hit.v), ng: hit.ng, primitive: hit.primitive, wo: -direction, cone }
}
