//! The parts of a scene that mirror or refract: where photons are sent to.

use glam::Vec3;
use heliostat_kernel::Aabb;
use heliostat_scene::{Geometry, Material};

use crate::color::luminance;
use crate::light::Tables;
use crate::lobe_set::Lobes;
use crate::material::SurfaceMaterial;
use crate::quadric::kernel_quadric;
use crate::sampling::Discrete;

/// A part of a placement that has sharp lobes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflector {
    /// Index into the placements: the path of its hits.
    pub placement: u32,
    /// Index into the object's parts: the geometry of its hits.
    pub part: u32,
    /// Of a sphere around it, world space.
    pub center: Vec3,
    /// Of the sphere, metres.
    pub radius: f32,
}

/// All reflectors of a scene, chosen in proportion to the area of their spheres times what they reflect or transmit.
#[derive(Clone, Debug, Default)]
pub struct Reflectors {
    list: Vec<Reflector>,
    choice: Discrete,
}

impl Reflectors {
    /// Lists them. Lobes of a roughness (perceptual, the square root of GGX α) up to `sharp` count.
    pub(crate) fn new(tables: Tables<'_>, sharp: f32) -> Self {
        let strengths: Vec<f32> = tables.materials.iter().map(|material| strength(material, sharp)).collect();
        let (mut list, mut weights) = (Vec::new(), Vec::new());
        for (index, placement) in (0..).zip(tables.placements) {
            for (part_index, part) in (0..).zip(tables.parts[placement.parts as usize].iter()) {
                let strength = strengths[part.material as usize];
                if strength <= 0.0 || part.bounds.is_empty() {
                    continue;
                }
                let bounds = part.bounds.transformed(&placement.world_from_object);
                let radius = 0.5 * bounds.size().length();
                list.push(Reflector { placement: index, part: part_index, center: bounds.center(), radius });
                weights.push(strength * radius * radius);
            }
        }
        Self { list, choice: Discrete::new(weights) }
    }

    /// In the order of their placements and parts.
    pub fn list(&self) -> &[Reflector] {
        &self.list
    }

    /// Chooses one by `u` in [0, 1), with its probability.
    pub fn choose(&self, u: f32) -> Option<(&Reflector, f32)> {
        let (index, probability, _) = self.choice.sample(u)?;
        (probability > 0.0).then(|| (&self.list[index], probability))
    }
}

/// The box around a part's shape, over the whole shutter interval; object space.
pub(crate) fn shape_bounds(shape: &Geometry) -> Aabb {
    match shape {
        Geometry::Mesh(mesh) => Aabb::from_points(mesh.positions.iter().chain(mesh.motion.iter()).copied()),
        Geometry::Quadrics(quadrics) => quadrics
            .shapes
            .iter()
            .map(|shape| kernel_quadric(shape).bounds())
            .reduce(Aabb::union)
            .unwrap_or_else(|| Aabb::from_points([])),
    }
}

/// About how much of white light the sharp lobes of a material send on; at least a little where there may be any.
fn strength(material: &SurfaceMaterial, sharp: f32) -> f32 {
    /// Reflectance of the usual dielectric, and what is assumed of lobes that only a shader knows.
    const DIELECTRIC: f32 = 0.04;
    let m: &Material = material.source();
    let lobes = material.lobes().without(Lobes::DIFFUSE);
    if lobes.is_empty() {
        return 0.0;
    }
    if m.shader.is_some() {
        return DIELECTRIC;
    }
    let mut sum = 0.0;
    if m.roughness <= sharp || m.metallic_roughness_texture.is_some() {
        let color = luminance(m.base_color.truncate());
        sum += m.metallic * color + (1.0 - m.metallic) * (DIELECTRIC * m.specular + m.transmission);
    }
    if let Some(coat) = m.clearcoat.as_ref().filter(|c| c.roughness <= sharp || c.roughness_texture.is_some())
    {
        sum += DIELECTRIC * coat.factor;
    }
    sum
}
