//! Collects edits and hands out handles.

use std::sync::Arc;

use glam::Affine3A;

use crate::{
    Attribute, Camera, CameraId, Edit, Environment, Geometry, GeometryId, Instance, InstanceId, Light,
    LightId, Material, MaterialId, Mesh, Object, ObjectId, Part, Quadric, Quadrics, Scene, Texture,
    TextureId,
};

/// Makes lists of edits with fresh handles: what importers and programs use to write scenes.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    edits: Vec<Edit>,
    next: Next,
}

/// The next free number of each handle type.
#[derive(Clone, Copy, Debug, Default)]
struct Next {
    geometry: u32,
    texture: u32,
    material: u32,
    object: u32,
    instance: u32,
    light: u32,
    camera: u32,
}

/// The next number. Counting saturates: a scene whose last handle is 2^32 − 1 has that one replaced.
fn take(counter: &mut u32) -> u32 {
    let number = *counter;
    *counter = counter.saturating_add(1);
    number
}

impl SceneBuilder {
    /// Handles start at 0, for an empty scene.
    pub fn new() -> Self {
        Self::default()
    }

    /// Handles start after those that `scene` uses.
    pub fn continuing(scene: &Scene) -> Self {
        let next = Next {
            geometry: scene.geometries().keys().next_back().map_or(0, |id| id.0.saturating_add(1)),
            texture: scene.textures().keys().next_back().map_or(0, |id| id.0.saturating_add(1)),
            material: scene.materials().keys().next_back().map_or(0, |id| id.0.saturating_add(1)),
            object: scene.objects().keys().next_back().map_or(0, |id| id.0.saturating_add(1)),
            instance: scene.instances().keys().next_back().map_or(0, |id| id.0.saturating_add(1)),
            light: scene.lights().keys().next_back().map_or(0, |id| id.0.saturating_add(1)),
            camera: scene.cameras().keys().next_back().map_or(0, |id| id.0.saturating_add(1)),
        };
        Self { edits: Vec::new(), next }
    }

    /// Adds a mesh.
    pub fn mesh(&mut self, mesh: Mesh) -> GeometryId {
        let id = GeometryId(take(&mut self.next.geometry));
        self.edits.push(Edit::Geometry(id, Geometry::Mesh(Arc::new(mesh))));
        id
    }

    /// Adds spheres and cones.
    pub fn quadrics(&mut self, shapes: Vec<Quadric>) -> GeometryId {
        let id = GeometryId(take(&mut self.next.geometry));
        self.edits.push(Edit::Geometry(id, Geometry::Quadrics(Arc::new(Quadrics { shapes }))));
        id
    }

    /// Gives a geometry an attribute, in place of one that has the name already.
    pub fn attribute(&mut self, geometry: GeometryId, name: impl Into<String>, attribute: Attribute) {
        self.edits.push(Edit::Attribute(geometry, name.into(), attribute));
    }

    /// Adds a texture.
    pub fn texture(&mut self, texture: Texture) -> TextureId {
        let id = TextureId(take(&mut self.next.texture));
        self.edits.push(Edit::Texture(id, Arc::new(texture)));
        id
    }

    /// Adds a material.
    pub fn material(&mut self, material: Material) -> MaterialId {
        let id = MaterialId(take(&mut self.next.material));
        self.edits.push(Edit::Material(id, Arc::new(material)));
        id
    }

    /// Adds an object made of `parts`; none makes a group for further instances.
    pub fn object(
        &mut self,
        name: impl Into<String>,
        parts: impl IntoIterator<Item = (GeometryId, MaterialId)>,
    ) -> ObjectId {
        let id = ObjectId(take(&mut self.next.object));
        let parts = parts.into_iter().map(|(geometry, material)| Part { geometry, material }).collect();
        self.edits.push(Edit::Object(id, Object { name: name.into(), parts }));
        id
    }

    /// Places an object in the world.
    pub fn instance(&mut self, object: ObjectId, world_from_object: Affine3A) -> InstanceId {
        self.place("", object, None, world_from_object)
    }

    /// Places an object inside another one.
    pub fn child(&mut self, parent: ObjectId, object: ObjectId, parent_from_object: Affine3A) -> InstanceId {
        self.place("", object, Some(parent), parent_from_object)
    }

    /// Places an object, with a name, in the world (`None`) or inside another object.
    pub fn place(
        &mut self,
        name: impl Into<String>,
        object: ObjectId,
        parent: Option<ObjectId>,
        parent_from_object: Affine3A,
    ) -> InstanceId {
        let id = InstanceId(take(&mut self.next.instance));
        let name = name.into();
        let instance = Instance { name, object, parent, parent_from_object, motion: None, visible: true };
        self.edits.push(Edit::Instance(id, instance));
        id
    }

    /// Shows or hides an instance; placed ones are visible.
    pub fn show(&mut self, instance: InstanceId, visible: bool) {
        self.edits.push(Edit::ShowInstance(instance, visible));
    }

    /// Adds a light.
    pub fn light(&mut self, light: Light) -> LightId {
        let id = LightId(take(&mut self.next.light));
        self.edits.push(Edit::Light(id, light));
        id
    }

    /// Adds a camera; the first one is the default view.
    pub fn camera(&mut self, camera: Camera) -> CameraId {
        let id = CameraId(take(&mut self.next.camera));
        self.edits.push(Edit::Camera(id, camera));
        id
    }

    /// Sets the environment.
    pub fn environment(&mut self, environment: Environment) {
        self.edits.push(Edit::Environment(environment));
    }

    /// The edits so far, in order.
    pub fn finish(self) -> Vec<Edit> {
        self.edits
    }
}
