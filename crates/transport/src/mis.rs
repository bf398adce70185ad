//! Multiple importance sampling: what light is worth when scattering found it that light sampling could have found too.
//!
//! # References
//! Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997, chapter 9.

use glam::Vec3;
use heliostat_kernel::{Hit, Ray};
use heliostat_shading::ShadingScene;

/// How often light sampling visits each emitter at a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Visits<'a> {
    /// One of all, by chance.
    One,
    /// Every one.
    All,
    /// Each so often in the mean.
    Often(&'a [f32]),
}

impl Visits<'_> {
    /// How often in the mean an emitter is visited.
    fn to(self, scene: &ShadingScene, emitter: usize) -> f32 {
        match self {
            Self::One => scene.lights().probability(emitter),
            Self::All => 1.0,
            Self::Often(visits) => visits.get(emitter).copied().unwrap_or(0.0),
        }
    }
}

/// How a ray came to its direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scattered {
    /// Of unit direction.
    pub(crate) ray: Ray,
    /// Density of the direction, per steradian; 0 if no light sample could have found it.
    pub(crate) pdf: f32,
    /// From the scattering surface to the end of the ray, through what let it pass.
    pub(crate) distance: f32,
}

/// Weight of a sample from a strategy of density `a` when another has density `b`: the power heuristic with β = 2
/// (equation 9.13).
pub(crate) fn power_heuristic(a: f32, b: f32) -> f32 {
    // Densities of tiny lights overflow when squared; their ratio does not.
    let ratio = b / a;
    if ratio.is_nan() { 0.0 } else { 1.0 / (1.0 + ratio * ratio) }
}

/// Weight of the emission of the surface that a scattered ray hit.
pub(crate) fn emission_weight(
    scene: &ShadingScene,
    visits: Visits<'_>,
    scattered: &Scattered,
    hit: &Hit,
) -> f32 {
    if scattered.pdf == 0.0 {
        return 1.0;
    }
    let Some(light) = scene.emitter_pdf(hit, &scattered.ray, scattered.distance) else { return 1.0 };
    power_heuristic(scattered.pdf, visits.to(scene, light.emitter) * light.solid_angle)
}

/// Radiance of the environment, weighted, for a scattered ray that hit nothing.
pub(crate) fn environment(scene: &ShadingScene, visits: Visits<'_>, scattered: &Scattered) -> Vec3 {
    let lights = scene.lights();
    let radiance = lights.environment(scattered.ray.direction);
    if scattered.pdf == 0.0 || radiance == Vec3::ZERO {
        return radiance;
    }
    let visited = lights.environment_index().map_or(0.0, |index| visits.to(scene, index));
    radiance * power_heuristic(scattered.pdf, visited * lights.environment_pdf(scattered.ray.direction))
}
