//! Applying edits to a scene, and taking them back.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::Affine3A;

use crate::{
    Camera, CameraId, Edit, EditError, Environment, Geometry, GeometryId, Instance, InstanceId, Light,
    LightId, Material, MaterialId, Object, ObjectId, Scene, Target, Texture, TextureId,
};

/// Edits that were applied, for [`Scene::revert`]: what each handle held before.
#[derive(Debug)]
pub struct Applied(Vec<Undo>);

impl Applied {
    /// For edit `index` of the list: the object (`None`: the world) that held the instance which the edit moved,
    /// showed, replaced or removed. `None` for edits of other kinds and of new instances. Spares callers a search.
    pub fn holder(&self, index: usize) -> Option<Option<ObjectId>> {
        match self.0.get(index)? {
            Undo::Place { parent, .. } => Some(*parent),
            Undo::Instance(_, Some(before)) => Some(before.parent),
            _ => None,
        }
    }
}

/// How to take one edit back.
#[derive(Debug)]
pub(crate) enum Undo {
    Geometry(GeometryId, Option<Geometry>),
    Texture(TextureId, Option<Arc<Texture>>),
    Material(MaterialId, Option<Arc<Material>>),
    Object(ObjectId, Option<Object>),
    Instance(InstanceId, Option<Instance>),
    Place { id: InstanceId, parent: Option<ObjectId>, before: Placing },
    Light(LightId, Option<Light>),
    Camera(CameraId, Option<Camera>),
    Environment(Environment),
}

/// What moving and showing an instance change.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placing {
    parent_from_object: Affine3A,
    motion: Option<Affine3A>,
    visible: bool,
}

impl Placing {
    fn of(instance: &Instance) -> Self {
        let &Instance { parent_from_object, motion, visible, .. } = instance;
        Self { parent_from_object, motion, visible }
    }

    fn put(self, instance: &mut Instance) {
        let Self { parent_from_object, motion, visible } = self;
        (instance.parent_from_object, instance.motion, instance.visible) =
            (parent_from_object, motion, visible);
    }
}

impl Scene {
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
                valid(Target::Geometry(*id), geometry.inconsistency())?;
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
                Undo::Instance(*id, self.put_instance(*id, Some(instance.clone())))
            }
            Edit::MoveInstance(id, to) => self.place(*id, |placing| {
                (placing.parent_from_object, placing.motion) = (*to, None);
            })?,
            Edit::SweepInstance(id, from, to) => self.place(*id, |placing| {
                (placing.parent_from_object, placing.motion) = (*from, Some(*to));
            })?,
            Edit::ShowInstance(id, visible) => self.place(*id, |placing| placing.visible = *visible)?,
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
                Undo::Instance(*id, self.put_instance(*id, None))
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

    /// Changes where an instance stands or whether it is shown: the common edit, and so the cheap one.
    fn place(&mut self, id: InstanceId, change: impl FnOnce(&mut Placing)) -> Result<Undo, EditError> {
        let target = Target::Instance(id);
        let instance = self.instances.get_mut(&id).ok_or(EditError::Unknown { target })?;
        let before = Placing::of(instance);
        let mut now = before;
        change(&mut now);
        let transforms = [Some(now.parent_from_object), now.motion];
        if let Some(problem) = transforms.iter().flatten().find_map(transform_problem) {
            return Err(EditError::Invalid { target, problem });
        }
        now.put(instance);
        Ok(Undo::Place { id, parent: instance.parent, before })
    }

    /// Puts an instance, or nothing, in the place of another, and keeps track of who holds whom.
    fn put_instance(&mut self, id: InstanceId, instance: Option<Instance>) -> Option<Instance> {
        let links = instance.as_ref().map(|instance| (instance.parent, instance.object));
        let before = match instance {
            Some(instance) => self.instances.insert(id, instance),
            None => self.instances.remove(&id),
        };
        let links_before = before.as_ref().map(|instance| (instance.parent, instance.object));
        if links != links_before {
            if let Some((parent, object)) = links_before {
                unlink(&mut self.placed_in, parent, id);
                unlink(&mut self.placements_of, object, id);
            }
            if let Some((parent, object)) = links {
                self.placed_in.entry(parent).or_default().insert(id);
                self.placements_of.entry(object).or_default().insert(id);
            }
        }
        before
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
            Undo::Instance(id, before) => _ = self.put_instance(id, before),
            Undo::Place { id, before, .. } => {
                if let Some(instance) = self.instances.get_mut(&id) {
                    before.put(instance);
                }
            }
            Undo::Light(id, before) => restore(&mut self.lights, id, before),
            Undo::Camera(id, before) => restore(&mut self.cameras, id, before),
            Undo::Environment(before) => self.environment = before,
        }
    }
}

fn unlink<K: Ord>(links: &mut BTreeMap<K, BTreeSet<InstanceId>>, key: K, id: InstanceId) {
    if let std::collections::btree_map::Entry::Occupied(mut entry) = links.entry(key) {
        entry.get_mut().remove(&id);
        if entry.get().is_empty() {
            entry.remove();
        }
    }
}

fn transform_problem(transform: &Affine3A) -> Option<String> {
    (!transform.is_finite()).then(|| "the transform is not finite; give finite numbers".into())
}
