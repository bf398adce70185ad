//! Counts what a scene holds.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use heliostat::scene::{Geometry, Image, ObjectId, Pixels, Quadric, Scene};

/// Sizes of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Statistics {
    /// Triangles and vertices of all geometries, each once.
    pub(super) triangles: u64,
    pub(super) vertices: u64,
    /// Analytic shapes of all geometries, each once.
    pub(super) spheres: u64,
    pub(super) cones: u64,
    /// Triangles of all visible placements.
    pub(super) instanced_triangles: u64,
    /// Those among them that emit light.
    pub(super) emissive_triangles: u64,
    /// Levels of instances from the world down to the deepest object.
    pub(super) depth: u64,
    /// Bytes of all images, each once however many textures share it.
    pub(super) texture_bytes: u64,
}

/// What one object holds, everything placed inside it included.
#[derive(Clone, Copy, Default)]
struct Content {
    triangles: u64,
    emissive: u64,
    depth: u64,
}

impl Statistics {
    pub(super) fn of(scene: &Scene) -> Self {
        let meshes = || scene.geometries().values().filter_map(Geometry::as_mesh);
        let mut contents: BTreeMap<ObjectId, Content> = BTreeMap::new();
        let placed = |parent: Option<ObjectId>, contents: &BTreeMap<ObjectId, Content>| {
            let mut sum = Content::default();
            for id in scene.placed_in(parent) {
                let instance = &scene.instances()[&id];
                let inner = contents.get(&instance.object).copied().unwrap_or_default();
                if instance.visible {
                    sum.triangles = sum.triangles.saturating_add(inner.triangles);
                    sum.emissive = sum.emissive.saturating_add(inner.emissive);
                }
                sum.depth = sum.depth.max(inner.depth + 1);
            }
            sum
        };
        for id in scene.bottom_up() {
            let mut content = placed(Some(id), &contents);
            for part in &scene.objects()[&id].parts {
                let mesh = scene.geometries()[&part.geometry].as_mesh();
                let triangles = mesh.map_or(0, |mesh| mesh.indices.len() as u64);
                content.triangles = content.triangles.saturating_add(triangles);
                if scene.materials()[&part.material].is_emissive() {
                    content.emissive = content.emissive.saturating_add(triangles);
                }
            }
            contents.insert(id, content);
        }
        let world = placed(None, &contents);
        let [spheres, cones] = shapes(scene);
        Self {
            triangles: meshes().map(|mesh| mesh.indices.len() as u64).sum(),
            vertices: meshes().map(|mesh| mesh.positions.len() as u64).sum(),
            spheres,
            cones,
            instanced_triangles: world.triangles,
            emissive_triangles: world.emissive,
            depth: world.depth,
            texture_bytes: texture_bytes(scene),
        }
    }
}

/// Spheres and cones of all geometries.
fn shapes(scene: &Scene) -> [u64; 2] {
    let mut counts = [0; 2];
    for geometry in scene.geometries().values() {
        if let Geometry::Quadrics(quadrics) = geometry {
            for shape in &quadrics.shapes {
                counts[usize::from(matches!(shape, Quadric::Cone { .. }))] += 1;
            }
        }
    }
    counts
}

fn texture_bytes(scene: &Scene) -> u64 {
    let mut seen: BTreeSet<*const Image> = BTreeSet::new();
    let images = scene.textures().values().map(|texture| &texture.image);
    images.filter(|image| seen.insert(Arc::as_ptr(image))).map(|image| image_bytes(image)).sum()
}

/// Bytes of an image's pixels.
pub(super) fn image_bytes(image: &Image) -> u64 {
    match &image.pixels {
        Pixels::Rgba8(values) => values.len() as u64,
        Pixels::RgbaF32(values) => 4 * values.len() as u64,
    }
}

#[cfg(test)]
mod tests {
    use glam::{Affine3A, Vec3};
    use heliostat::scene::{Material, Mesh, SceneBuilder};

    use super::*;

    #[test]
    fn nested_instances_multiply() {
        let mut builder = SceneBuilder::new();
        let lamp = builder.material(Material::emitter("lamp", Vec3::ONE));
        let quad = builder.mesh(Mesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y));
        let leaf = builder.object("leaf", [(quad, lamp)]);
        let cone = Quadric::Cone { base: Vec3::ZERO, base_radius: 1.0, apex: Vec3::Y, apex_radius: 0.0 };
        builder.quadrics(vec![cone, Quadric::Sphere { center: Vec3::ZERO, radius: 1.0 }, cone]);
        let pair = builder.object("pair", []);
        for _ in 0..2 {
            builder.child(pair, leaf, Affine3A::IDENTITY);
        }
        for _ in 0..3 {
            builder.instance(pair, Affine3A::IDENTITY);
        }
        let mut scene = Scene::default();
        scene.apply(&builder.finish()).unwrap();
        let expected = Statistics {
            triangles: 2,
            vertices: 4,
            spheres: 1,
            cones: 2,
            instanced_triangles: 12,
            emissive_triangles: 12,
            depth: 2,
            texture_bytes: 0,
        };
        assert_eq!(Statistics::of(&scene), expected);
    }
}
