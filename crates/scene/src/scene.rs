//! The scene as plain data: what all edits so far add up to.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::{Affine3A, Vec3};

use crate::{
    Camera, CameraId, Edit, EditError, Environment, Geometry, GeometryId, Instance, InstanceId, Light,
    LightId, Material, MaterialId, Object, ObjectId, Target, Texture, TextureId,
};

/// All data of a scene by handle. [`Scene::apply`] is the only way to change it, so references are always valid.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    geometries: BTreeMap<GeometryId, Geometry>,
    textures: BTreeMap<TextureId, Arc<Texture>>,
    materials: BTreeMap<MaterialId, Arc<Material>>,
    objects: BTreeMap<ObjectId, Object>,
    instances: BTreeMap<InstanceId, Instance>,
    lights: BTreeMap<LightId, Light>,
    cameras: BTreeMap<CameraId, Camera>,
    environment: Environment,
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

/// Edits that were applied, for [`Scene::revert`]: what each handle held before.
#[derive(Debug)]
pub struct Applied(Vec<Undo>);

/// How to take one edit back.
#[derive(Debug)]
enum Undo {
    Geometry(GeometryId, Option<Geometry>),
    Texture(TextureId, Option<Arc<Texture>>),
    Material(MaterialId, Option<Arc<Material>>),
    Object(ObjectId, Option<Object>),
    Instance(InstanceId, Option<Instance>),
    Light(LightId, Option<Light>),
    Camera(CameraId, Option<Camera>),
    Environment(Environment),
}

impl Scene {
    /// Geometries by handle.
    pub fn geometries(&self) -> &BTreeMap<GeometryId, Geometry> {
        &self.geometries
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

    /// Applies all edits or none.
    ///
    /// # Errors
    /// The first edit that contradicts itself or the scene; the scene is then unchanged.
    pub fn apply(&mut self, edits: &[Edit]) -> Result<Applied, EditError> {
        let mut undo = Vec::with_capacity(edits.len());
        let result = edits
            .iter()
            .try_for_each(|edit| self.apply_one(edit).map(|step| undo.push(step)))
            .and_then(|()| self.check_references(edits, &undo));
        let applied = Applied(undo);
        match result {
            Ok(()) => Ok(applied),
            Err(error) => {
                self.revert(applied);
                Err(error)
            }
        }
    }

    /// Takes the edits of one call of [`Self::apply`] back; only the latest one may be.
    pub fn revert(&mut self, applied: Applied) {
        applied.0.into_iter().rev().for_each(|step| self.revert_one(step));
    }

    fn apply_one(&mut self, edit: &Edit) -> Result<Undo, EditError> {
        let valid = |target: Target, problem: Option<String>| match problem {
            Some(problem) => Err(EditError::Invalid { target, problem }),
            None => Ok(()),
        };
        let existing = |target: Target, exists: bool| match exists {
            true => Ok(()),
            false => Err(EditError::Unknown { target }),
        };
        Ok(match edit {
            Edit::Geometry(id, geometry) => {
                let Geometry::Mesh(mesh) = geometry;
                valid(Target::Geometry(*id), mesh.inconsistency())?;
                Undo::Geometry(*id, self.geometries.insert(*id, geometry.clone()))
            }
            Edit::Texture(id, texture) => {
                valid(Target::Texture(*id), texture.image.inconsistency())?;
                Undo::Texture(*id, self.textures.insert(*id, texture.clone()))
            }
            Edit::Material(id, material) => {
                valid(Target::Material(*id), material.inconsistency())?;
                Undo::Material(*id, self.materials.insert(*id, material.clone()))
            }
            Edit::Object(id, object) => Undo::Object(*id, self.objects.insert(*id, object.clone())),
            Edit::Instance(id, instance) => {
                let transforms = [Some(instance.parent_from_object), instance.motion];
                valid(Target::Instance(*id), transforms.iter().flatten().find_map(transform_problem))?;
                Undo::Instance(*id, self.instances.insert(*id, instance.clone()))
            }
            Edit::MoveInstance(id, to) => self.change_instance(*id, |instance| {
                (instance.parent_from_object, instance.motion) = (*to, None);
            })?,
            Edit::SweepInstance(id, from, to) => self.change_instance(*id, |instance| {
                (instance.parent_from_object, instance.motion) = (*from, Some(*to));
            })?,
            Edit::ShowInstance(id, visible) => {
                self.change_instance(*id, |instance| instance.visible = *visible)?
            }
            Edit::Light(id, light) => {
                valid(Target::Light(*id), light.inconsistency())?;
                Undo::Light(*id, self.lights.insert(*id, light.clone()))
            }
            Edit::Camera(id, camera) => {
                valid(Target::Camera(*id), camera.problem())?;
                Undo::Camera(*id, self.cameras.insert(*id, camera.clone()))
            }
            Edit::Environment(environment) => {
                valid(Target::Environment, environment.inconsistency())?;
                Undo::Environment(std::mem::replace(&mut self.environment, environment.clone()))
            }
            Edit::RemoveGeometry(id) => {
                existing(Target::Geometry(*id), self.geometries.contains_key(id))?;
                Undo::Geometry(*id, self.geometries.remove(id))
            }
            Edit::RemoveTexture(id) => {
                existing(Target::Texture(*id), self.textures.contains_key(id))?;
                Undo::Texture(*id, self.textures.remove(id))
            }
            Edit::RemoveMaterial(id) => {
                existing(Target::Material(*id), self.materials.contains_key(id))?;
                Undo::Material(*id, self.materials.remove(id))
            }
            Edit::RemoveObject(id) => {
                existing(Target::Object(*id), self.objects.contains_key(id))?;
                Undo::Object(*id, self.objects.remove(id))
            }
            Edit::RemoveInstance(id) => {
                existing(Target::Instance(*id), self.instances.contains_key(id))?;
                Undo::Instance(*id, self.instances.remove(id))
            }
            Edit::RemoveLight(id) => {
                existing(Target::Light(*id), self.lights.contains_key(id))?;
                Undo::Light(*id, self.lights.remove(id))
            }
            Edit::RemoveCamera(id) => {
                existing(Target::Camera(*id), self.cameras.contains_key(id))?;
                Undo::Camera(*id, self.cameras.remove(id))
            }
        })
    }

    /// Changes an instance that is there.
    fn change_instance(
        &mut self,
        id: InstanceId,
        change: impl FnOnce(&mut Instance),
    ) -> Result<Undo, EditError> {
        let target = Target::Instance(id);
        let instance = self.instances.get_mut(&id).ok_or(EditError::Unknown { target })?;
        let before = instance.clone();
        change(instance);
        let transforms = [Some(instance.parent_from_object), instance.motion];
        match transforms.iter().flatten().find_map(transform_problem) {
            None => Ok(Undo::Instance(id, Some(before))),
            Some(problem) => {
                *instance = before;
                Err(EditError::Invalid { target, problem })
            }
        }
    }

    fn revert_one(&mut self, step: Undo) {
        fn restore<K: Ord, V>(map: &mut BTreeMap<K, V>, id: K, before: Option<V>) {
            match before {
                Some(value) => map.insert(id, value),
                None => map.remove(&id),
            };
        }
        match step {
            Undo::Geometry(id, before) => restore(&mut self.geometries, id, before),
            Undo::Texture(id, before) => restore(&mut self.textures, id, before),
            Undo::Material(id, before) => restore(&mut self.materials, id, before),
            Undo::Object(id, before) => restore(&mut self.objects, id, before),
            Undo::Instance(id, before) => restore(&mut self.instances, id, before),
            Undo::Light(id, before) => restore(&mut self.lights, id, before),
            Undo::Camera(id, before) => restore(&mut self.cameras, id, before),
            Undo::Environment(before) => self.environment = before,
        }
    }

    /// Checks what the edits made refer to, and who refers to what they removed. Costs what the edits touch, except
    /// that removals scan for users and structural changes of instances scan for cycles.
    fn check_references(&self, edits: &[Edit], undo: &[Undo]) -> Result<(), EditError> {
        let mut removed = BTreeSet::new();
        let mut structure_changed = false;
        for (edit, before) in edits.iter().zip(undo) {
            match edit {
                Edit::Material(id, _) => self.check_material(*id)?,
                Edit::Object(id, _) => self.check_object(*id)?,
                Edit::Instance(id, instance) => {
                    self.check_instance(*id)?;
                    let same = matches!(before, Undo::Instance(_, Some(old))
                        if old.object == instance.object && old.parent == instance.parent);
                    structure_changed |= !same && instance.parent.is_some();
                }
                Edit::RemoveGeometry(id) => _ = removed.insert(Target::Geometry(*id)),
                Edit::RemoveTexture(id) => _ = removed.insert(Target::Texture(*id)),
                Edit::RemoveMaterial(id) => _ = removed.insert(Target::Material(*id)),
                Edit::RemoveObject(id) => _ = removed.insert(Target::Object(*id)),
                _ => {}
            }
        }
        if !removed.is_empty() {
            self.check_removed(&removed)?;
        }
        if structure_changed {
            self.check_cycles()?;
        }
        Ok(())
    }

    // The three checks below skip a handle that a later edit of the same list removed again.

    fn check_material(&self, id: MaterialId) -> Result<(), EditError> {
        let Some(material) = self.materials.get(&id) else { return Ok(()) };
        for (name, reference) in material.textures() {
            let target = Target::Material(id);
            if !self.textures.contains_key(&reference.texture) {
                return Err(EditError::Dangling { target, missing: Target::Texture(reference.texture) });
            }
            if reference.uv_set > 1 {
                let problem =
                    format!("`{name}` uses coordinate set {}; meshes have sets 0 and 1", reference.uv_set);
                return Err(EditError::Invalid { target, problem });
            }
        }
        Ok(())
    }

    fn check_object(&self, id: ObjectId) -> Result<(), EditError> {
        let target = Target::Object(id);
        for part in self.objects.get(&id).map_or(&[][..], |object| &object.parts) {
            if !self.geometries.contains_key(&part.geometry) {
                return Err(EditError::Dangling { target, missing: Target::Geometry(part.geometry) });
            }
            if !self.materials.contains_key(&part.material) {
                return Err(EditError::Dangling { target, missing: Target::Material(part.material) });
            }
        }
        Ok(())
    }

    fn check_instance(&self, id: InstanceId) -> Result<(), EditError> {
        let Some(instance) = self.instances.get(&id) else { return Ok(()) };
        match [Some(instance.object), instance.parent]
            .into_iter()
            .flatten()
            .find(|o| !self.objects.contains_key(o))
        {
            Some(object) => {
                Err(EditError::Dangling { target: Target::Instance(id), missing: Target::Object(object) })
            }
            None => Ok(()),
        }
    }

    fn check_removed(&self, removed: &BTreeSet<Target>) -> Result<(), EditError> {
        let gone = |target: Target, exists: bool| !exists && removed.contains(&target);
        let in_use = |target: Target, user: Target| Err(EditError::InUse { target, user });
        for (&id, material) in &self.materials {
            for (_, reference) in material.textures() {
                let texture = reference.texture;
                if gone(Target::Texture(texture), self.textures.contains_key(&texture)) {
                    return in_use(Target::Texture(texture), Target::Material(id));
                }
            }
        }
        for (&id, object) in &self.objects {
            for part in &object.parts {
                if gone(Target::Geometry(part.geometry), self.geometries.contains_key(&part.geometry)) {
                    return in_use(Target::Geometry(part.geometry), Target::Object(id));
                }
                if gone(Target::Material(part.material), self.materials.contains_key(&part.material)) {
                    return in_use(Target::Material(part.material), Target::Object(id));
                }
            }
        }
        for (&id, instance) in &self.instances {
            for object in [Some(instance.object), instance.parent].into_iter().flatten() {
                if gone(Target::Object(object), self.objects.contains_key(&object)) {
                    return in_use(Target::Object(object), Target::Instance(id));
                }
            }
        }
        Ok(())
    }

    /// The instances placed in each object; `None` holds those in the world. Ordered by handle.
    pub fn children(&self) -> BTreeMap<Option<ObjectId>, Vec<InstanceId>> {
        let mut children: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for (&id, instance) in &self.instances {
            children.entry(instance.parent).or_default().push(id);
        }
        children
    }

    /// Kahn's algorithm over the edges parent → object: what cannot be ordered lies on or below a cycle.
    fn check_cycles(&self) -> Result<(), EditError> {
        match self.bottom_up() {
            order if order.len() == self.objects.len() => Ok(()),
            order => {
                let ordered: BTreeSet<_> = order.into_iter().collect();
                let left = self.objects.keys().find(|id| !ordered.contains(id));
                left.map_or(Ok(()), |&id| Err(EditError::Cycle { target: Target::Object(id) }))
            }
        }
    }

    /// All objects, each after everything that is placed in it.
    pub fn bottom_up(&self) -> Vec<ObjectId> {
        let mut waiting: BTreeMap<ObjectId, usize> = self.objects.keys().map(|&id| (id, 0)).collect();
        let mut parents: BTreeMap<ObjectId, Vec<ObjectId>> = BTreeMap::new();
        for instance in self.instances.values() {
            if let Some(parent) = instance.parent {
                *waiting.entry(parent).or_default() += 1;
                parents.entry(instance.object).or_default().push(parent);
            }
        }
        let mut order: Vec<ObjectId> = waiting.iter().filter(|(_, n)| **n == 0).map(|(&id, _)| id).collect();
        let mut next = 0;
        while next < order.len() {
            for parent in parents.get(&order[next]).into_iter().flatten() {
                if let Some(count) = waiting.get_mut(parent) {
                    *count -= 1;
                    if *count == 0 {
                        order.push(*parent);
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
        let children = self.children();
        let mut boxes: BTreeMap<ObjectId, Option<SceneBounds>> = BTreeMap::new();
        let around = |parent: Option<ObjectId>, boxes: &BTreeMap<ObjectId, Option<SceneBounds>>| {
            let mut bounds = None;
            for id in children.get(&parent).into_iter().flatten() {
                let instance = &self.instances[id];
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
                let Geometry::Mesh(mesh) = &self.geometries[&part.geometry];
                mesh.positions
                    .iter()
                    .chain(mesh.motion.iter())
                    .filter(|p| p.is_finite())
                    .for_each(|p| grow(&mut bounds, *p));
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

fn transform_problem(transform: &Affine3A) -> Option<String> {
    (!transform.is_finite()).then(|| "the transform is not finite; give finite numbers".into())
}
