//! The parts of a scene that mirror or refract: where photons are sent to.

use glam::Vec3;
use heliostat_kernel::Aabb;
use heliostat_scene::{Geometry, Material};

use crate::color::luminance;
use crate::light::Tables;
use crate::lobe_set::Lobes;
use crate::material::SurfaceMaterial;
use crate::quadric::kernel_quadric;

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
    /// Area of the sphere times what it reflects or transmits, up to a factor.
    pub weight: f32,
}

/// All reflectors of a scene, in the order of their placements and parts. Lobes of a roughness (perceptual, the square root
/// of GGX α) up to `sharp` count, and interfaces of solids.
pub(crate) fn list(tables: Tables<'_>, sharp: f32) -> Vec<Reflector> {
    let strengths: Vec<f32> = tables.materials.iter().map(|material| strength(material, sharp)).collect();
    let mut list = Vec::new();
    for (index, placement) in (0..).zip(tables.placements) {
        for (part_index, part) in (0..).zip(tables.parts[placement.parts as usize].iter()) {
            let strength = strengths[part.material as usize];
            if strength <= 0.0 || part.bounds.is_empty() {
                continue;
            }
            let bounds = part.bounds.transformed(&placement.world_from_object);
            let radius = 0.5 * bounds.size().length();
            list.push(Reflector {
                placement: index,
                part: part_index,
                center: bounds.center(),
                radius,
                weight: strength * radius * radius,
            });
        }
    }
    list
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
    let solid = m.transmission > 0.0 && m.volume.is_some();
    if solid || m.roughness <= sharp || m.metallic_roughness_texture.is_some() {
        let color = luminance(m.base_color.truncate());
        sum += m.metallic * color + (1.0 - m.metallic) * (DIELECTRIC * m.specular + m.transmission);
    }
    if let Some(coat) = m.clearcoat.as_ref().filter(|c| c.roughness <= sharp || c.roughness_texture.is_some())
    {
        sum += DIELECTRIC * coat.factor;
    }
    sum
}
