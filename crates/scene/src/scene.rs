//! The scene as plain data: what all edits so far add up to.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::Vec3;

use crate::{
    Attributes, Camera, CameraId, Edit, Environment, Geometry, GeometryId, Instance, InstanceId, Light,
    LightId, Material, MaterialId, Object, ObjectId, Quadric, Texture, TextureId,
};

/// All data of a scene by handle. [`Scene::apply`] is the only way to change it, so references are always valid.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    pub(crate) geometries: BTreeMap<GeometryId, Geometry>,
    /// Those of geometries that have any.
    pub(crate) attributes: BTreeMap<GeometryId, Arc<Attributes>>,
    pub(crate) textures: BTreeMap<TextureId, Arc<Texture>>,
    pub(crate) materials: BTreeMap<MaterialId, Arc<Material>>,
    pub(crate) objects: BTreeMap<ObjectId, Object>,
    pub(crate) instances: BTreeMap<InstanceId, Instance>,
    pub(crate) lights: BTreeMap<LightId, Light>,
    pub(crate) cameras: BTreeMap<CameraId, Camera>,
    pub(crate) environment: Environment,
    /// The instances placed in each object; `None` holds those in the world.
    pub(crate) placed_in: BTreeMap<Option<ObjectId>, BTreeSet<InstanceId>>,
    /// The instances that place each object.
    pub(crate) placements_of: BTreeMap<ObjectId, BTreeSet<InstanceId>>,
}

/// An axis-aligned box in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneBounds {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl SceneBounds {
    /// The middle.
    pub fn center(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    /// Half the diagonal: the radius of the sphere around the box.
    pub fn radius(&self) -> f32 {
        0.5 * (self.max - self.min).length()
    }
}

impl Scene {
    /// Geometries by handle.
    pub fn geometries(&self) -> &BTreeMap<GeometryId, Geometry> {
        &self.geometries
    }

    /// The attributes of geometries that have any.
    pub fn attributes(&self) -> &BTreeMap<GeometryId, Arc<Attributes>> {
        &self.attributes
    }

    /// Textures by handle.
    pub fn textures(&self) -> &BTreeMap<TextureId, Arc<Texture>> {
        &self.textures
    }

    /// Materials by handle.
    pub fn materials(&self) -> &BTreeMap<MaterialId, Arc<Material>> {
        &self.materials
    }

    /// Objects by handle.
    pub fn objects(&self) -> &BTreeMap<ObjectId, Object> {
        &self.objects
    }

    /// Instances by handle.
    pub fn instances(&self) -> &BTreeMap<InstanceId, Instance> {
        &self.instances
    }

    /// Lights by handle.
    pub fn lights(&self) -> &BTreeMap<LightId, Light> {
        &self.lights
    }

    /// Cameras by handle; the first is the default view.
    pub fn cameras(&self) -> &BTreeMap<CameraId, Camera> {
        &self.cameras
    }

    /// What surrounds the scene.
    pub fn environment(&self) -> &Environment {
        &self.environment
    }

    /// Whether the scene brings light to be seen by. Textured emission does not count: it is glowing labels and displays
    /// on models that are meant to stand in other light.
    pub fn has_light(&self) -> bool {
        let shines = |material: &Material| {
            material.unlit || (material.is_emissive() && material.emissive_texture.is_none())
        };
        let mut parts = self.objects.values().flat_map(|object| &object.parts);
        !self.lights.is_empty()
            || self.environment != Environment::None
            || parts.any(|part| shines(&self.materials[&part.material]))
    }

    /// The instances placed in an object, or in the world (`None`), ordered by handle.
    pub fn placed_in(&self, parent: Option<ObjectId>) -> impl Iterator<Item = InstanceId> {
        self.placed_in.get(&parent).into_iter().flatten().copied()
    }

    /// The instances that place an object, ordered by handle.
    pub fn placements_of(&self, object: ObjectId) -> impl Iterator<Item = InstanceId> {
        self.placements_of.get(&object).into_iter().flatten().copied()
    }

    /// The edits that make this scene from an empty one.
    pub fn to_edits(&self) -> Vec<Edit> {
        let mut edits = vec![Edit::Environment(self.environment.clone())];
        edits.extend(self.geometries.iter().map(|(id, geometry)| Edit::Geometry(*id, geometry.clone())));
        let attributes = self.attributes.iter().flat_map(|(id, named)| {
            named.iter().map(|(name, attribute)| Edit::Attribute(*id, name.clone(), attribute.clone()))
        });
        edits.extend(attributes);
        edits.extend(self.textures.iter().map(|(id, texture)| Edit::Texture(*id, texture.clone())));
        edits.extend(self.materials.iter().map(|(id, material)| Edit::Material(*id, material.clone())));
        edits.extend(self.objects.iter().map(|(id, object)| Edit::Object(*id, object.clone())));
        edits.extend(self.instances.iter().map(|(id, instance)| Edit::Instance(*id, instance.clone())));
        edits.extend(self.lights.iter().map(|(id, light)| Edit::Light(*id, light.clone())));
        edits.extend(self.cameras.iter().map(|(id, camera)| Edit::Camera(*id, camera.clone())));
        edits
    }

    /// All objects, each after everything that is placed in it.
    pub fn bottom_up(&self) -> Vec<ObjectId> {
        let mut waiting: BTreeMap<ObjectId, usize> = self.objects.keys().map(|&id| (id, 0)).collect();
        for (parent, placed) in &self.placed_in {
            if let Some(parent) = parent {
                waiting.insert(*parent, placed.len());
            }
        }
        let mut order: Vec<ObjectId> = waiting.iter().filter(|(_, n)| **n == 0).map(|(&id, _)| id).collect();
        let mut next = 0;
        while next < order.len() {
            for id in self.placements_of(order[next]) {
                let Some(parent) = self.instances[&id].parent else { continue };
                if let Some(count) = waiting.get_mut(&parent) {
                    *count -= 1;
                    if *count == 0 {
                        order.push(parent);
                    }
                }
            }
            next += 1;
        }
        order
    }

    /// The box around all visible instances, wherever they move while the shutter is open; `None` when nothing is
    /// visible.
    pub fn bounds(&self) -> Option<SceneBounds> {
        let mut boxes: BTreeMap<ObjectId, Option<SceneBounds>> = BTreeMap::new();
        let around = |parent: Option<ObjectId>, boxes: &BTreeMap<ObjectId, Option<SceneBounds>>| {
            let mut bounds = None;
            for id in self.placed_in(parent) {
                let instance = &self.instances[&id];
                let Some(Some(inner)) = boxes.get(&instance.object).filter(|_| instance.visible) else {
                    continue;
                };
                for place in [Some(instance.parent_from_object), instance.motion].into_iter().flatten() {
                    corners(inner).for_each(|c| grow(&mut bounds, place.transform_point3(c)));
                }
            }
            bounds
        };
        for id in self.bottom_up() {
            let mut bounds = around(Some(id), &boxes);
            for part in &self.objects[&id].parts {
                match &self.geometries[&part.geometry] {
                    Geometry::Mesh(mesh) => {
                        let points = mesh.positions.iter().chain(mesh.motion.iter());
                        points.filter(|p| p.is_finite()).for_each(|p| grow(&mut bounds, *p));
                    }
                    Geometry::Quadrics(quadrics) => {
                        let corners = quadrics.shapes.iter().flat_map(Quadric::bounds);
                        corners.filter(|p| p.is_finite()).for_each(|p| grow(&mut bounds, p));
                    }
                }
            }
            boxes.insert(id, bounds);
        }
        around(None, &boxes)
    }
}

fn grow(bounds: &mut Option<SceneBounds>, p: Vec3) {
    *bounds = Some(match bounds {
        Some(b) => SceneBounds { min: b.min.min(p), max: b.max.max(p) },
        None => SceneBounds { min: p, max: p },
    });
}

fn corners(b: &SceneBounds) -> impl Iterator<Item = Vec3> {
    let pick = |bit: bool, axis: usize| if bit { b.max[axis] } else { b.min[axis] };
    (0..8).map(move |i| Vec3::new(pick(i & 1 != 0, 0), pick(i & 2 != 0, 1), pick(i & 4 != 0, 2)))
}
