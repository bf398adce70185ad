//! Applying edits to a scene, and taking them back.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::Affine3A;

use crate::{
    Attributes, Camera, CameraId, Edit, EditError, Environment, Geometry, GeometryId, Instance, InstanceId,
    Light, LightId, Material, MaterialId, Object, ObjectId, Scene, Target, Texture, TextureId,
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

/// How to take one edit back. Small, since lists of many thousand moves make as many of them: what is large is boxed.
#[derive(Debug)]
pub(crate) enum Undo {
    Geometry(GeometryId, Option<Geometry>),
    RemovedGeometry(GeometryId, Option<Geometry>, Option<Arc<Attributes>>),
    Attributes(GeometryId, Option<Arc<Attributes>>),
    Texture(TextureId, Option<Arc<Texture>>),
    Material(MaterialId, Option<Arc<Material>>),
    Object(ObjectId, Option<Object>),
    Instance(InstanceId, Option<Box<Instance>>),
    Place { id: InstanceId, parent: Option<ObjectId>, before: Placing },
    Light(LightId, Option<Box<Light>>),
    Camera(CameraId, Option<Box<Camera>>),
    Environment(Box<Environment>),
}

/// What moving and showing an instance change.
#[derive(Clone, Debug)]
pub(crate) struct Placing {
    parent_from_object: Affine3A,
    motion: Option<Box<Affine3A>>,
    visible: bool,
}

impl Placing {
    fn of(instance: &Instance) -> Self {
        let &Instance { parent_from_object, motion, visible, .. } = instance;
        Self { parent_from_object, motion: motion.map(Box::new), visible }
    }

    /// Where an edit puts an instance that stands like this; `None` for edits of other kinds.
    fn edited(&self, edit: &Edit) -> Option<Self> {
        let visible = self.visible;
        Some(match *edit {
            Edit::MoveInstance(_, parent_from_object) => Self { parent_from_object, motion: None, visible },
            Edit::SweepInstance(_, parent_from_object, close) => {
                Self { parent_from_object, motion: Some(Box::new(close)), visible }
            }
            Edit::ShowInstance(_, visible) => Self { visible, ..self.clone() },
            _ => return None,
        })
    }

    fn problem(&self) -> Option<String> {
        let transforms = [Some(&self.parent_from_object), self.motion.as_deref()];
        transforms.into_iter().flatten().find_map(transform_problem)
    }

    fn put(self, instance: &mut Instance) {
        let Self { parent_from_object, motion, visible } = self;
        (instance.parent_from_object, instance.motion, instance.visible) =
            (parent_from_object, motion.map(|motion| *motion), visible);
    }
}

impl Scene {
    /// Applies all edits or none.
    ///
    /// # Errors
    /// The first edit that contradicts itself or the scene; the scene is then unchanged.
    pub fn apply(&mut self, edits: &[Edit]) -> Result<Applied, EditError> {
        let mut undo = Vec::with_capacity(edits.len());
        let result = self.apply_all(edits, &mut undo).and_then(|()| self.check_references(edits, &undo));
        let applied = Applied(undo);
        match result {
            Ok(()) => Ok(applied),
            Err(error) => {
                self.revert(applied);
                Err(error)
            }
        }
    }

    fn apply_all(&mut self, edits: &[Edit], undo: &mut Vec<Undo>) -> Result<(), EditError> {
        let mut rest = edits;
        while let Some((edit, after)) = rest.split_first() {
            match self.apply_run(rest, undo)? {
                0 => {
                    undo.push(self.apply_one(edit)?);
                    rest = after;
                }
                done => rest = &rest[done..],
            }
        }
        Ok(())
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
            Edit::Attribute(id, name, attribute) => {
                let problem = attribute.inconsistency();
                valid(
                    Target::Geometry(*id),
                    problem.map(|problem| format!("attribute `{name}`: {problem}")),
                )?;
                let mut attributes = self.attributes.get(id).cloned().unwrap_or_default();
                Arc::make_mut(&mut attributes).insert(name.clone(), attribute.clone());
                Undo::Attributes(*id, self.attributes.insert(*id, attributes))
            }
            Edit::RemoveAttribute(id, name) => {
                let mut attributes = self.attributes.get(id).cloned().unwrap_or_default();
                let removed = Arc::make_mut(&mut attributes).remove(name);
                let problem = || format!("it has no attribute `{name}` to remove");
                valid(Target::Geometry(*id), removed.is_none().then(problem))?;
                let before = match attributes.is_empty() {
                    true => self.attributes.remove(id),
                    false => self.attributes.insert(*id, attributes),
                };
                Undo::Attributes(*id, before)
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
                Undo::Instance(*id, self.put_instance(*id, Some(instance.clone())).map(Box::new))
            }
            Edit::MoveInstance(id, _) | Edit::SweepInstance(id, ..) | Edit::ShowInstance(id, _) => {
                let target = Target::Instance(*id);
                place(self.instances.get_mut(id).ok_or(EditError::Unknown { target })?, *id, edit)?
            }
            Edit::Light(id, light) => {
                valid(Target::Light(*id), light.inconsistency())?;
                Undo::Light(*id, self.lights.insert(*id, light.clone()).map(Box::new))
            }
            Edit::Camera(id, camera) => {
                valid(Target::Camera(*id), camera.problem())?;
                Undo::Camera(*id, self.cameras.insert(*id, camera.clone()).map(Box::new))
            }
            Edit::Environment(environment) => {
                valid(Target::Environment, environment.inconsistency())?;
                Undo::Environment(Box::new(std::mem::replace(&mut self.environment, environment.clone())))
            }
            Edit::RemoveGeometry(id) => {
                existing(Target::Geometry(*id), self.geometries.contains_key(id))?;
                Undo::RemovedGeometry(*id, self.geometries.remove(id), self.attributes.remove(id))
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
                Undo::Instance(*id, self.put_instance(*id, None).map(Box::new))
            }
            Edit::RemoveLight(id) => {
                existing(Target::Light(*id), self.lights.contains_key(id))?;
                Undo::Light(*id, self.lights.remove(id).map(Box::new))
            }
            Edit::RemoveCamera(id) => {
                existing(Target::Camera(*id), self.cameras.contains_key(id))?;
                Undo::Camera(*id, self.cameras.remove(id).map(Box::new))
            }
        })
    }

    /// Applies a run of edits that move existing instances one after the other, by one walk through them instead of a
    /// search for each. Returns how many of the edits it did.
    fn apply_run(&mut self, edits: &[Edit], undo: &mut Vec<Undo>) -> Result<usize, EditError> {
        let length = rising_moves(edits);
        let (Some(first), Some(last)) =
            (edits.first().and_then(moved), edits[..length].last().and_then(moved))
        else {
            return Ok(0);
        };
        // A walk over many that stand still would cost more than it saves.
        if length < 16 || (last.0 - first.0) as usize > 4 * length {
            return Ok(0);
        }
        let mut instances = self.instances.range_mut(first..=last);
        for edit in &edits[..length] {
            let Some(wanted) = moved(edit) else { break };
            let target = Target::Instance(wanted);
            let found = instances.find(|(id, _)| **id >= wanted).filter(|(id, _)| **id == wanted);
            let (_, instance) = found.ok_or(EditError::Unknown { target })?;
            undo.push(place(instance, wanted, edit)?);
        }
        Ok(length)
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
            Undo::RemovedGeometry(id, before, attributes) => {
                restore(&mut self.geometries, id, before);
                restore(&mut self.attributes, id, attributes);
            }
            Undo::Attributes(id, before) => restore(&mut self.attributes, id, before),
            Undo::Texture(id, before) => restore(&mut self.textures, id, before),
            Undo::Material(id, before) => restore(&mut self.materials, id, before),
            Undo::Object(id, before) => restore(&mut self.objects, id, before),
            Undo::Instance(id, before) => _ = self.put_instance(id, before.map(|before| *before)),
            Undo::Place { id, before, .. } => {
                if let Some(instance) = self.instances.get_mut(&id) {
                    before.put(instance);
                }
            }
            Undo::Light(id, before) => restore(&mut self.lights, id, before.map(|before| *before)),
            Undo::Camera(id, before) => restore(&mut self.cameras, id, before.map(|before| *before)),
            Undo::Environment(before) => self.environment = *before,
        }
    }
}

/// The instance that an edit moves, if that is what it does.
fn moved(edit: &Edit) -> Option<InstanceId> {
    match edit {
        Edit::MoveInstance(id, _) | Edit::SweepInstance(id, ..) => Some(*id),
        _ => None,
    }
}

/// How many edits from the first on move instances of rising handles.
fn rising_moves(edits: &[Edit]) -> usize {
    let mut before = None;
    let rising = |edit: &&Edit| {
        let id = moved(edit);
        let rises = id.is_some() && id > before;
        before = id;
        rises
    };
    edits.iter().take_while(rising).count()
}

/// Moves, shows or hides an instance.
fn place(instance: &mut Instance, id: InstanceId, edit: &Edit) -> Result<Undo, EditError> {
    let before = Placing::of(instance);
    if let Some(now) = before.edited(edit) {
        if let Some(problem) = now.problem() {
            return Err(EditError::Invalid { target: Target::Instance(id), problem });
        }
        now.put(instance);
    }
    Ok(Undo::Place { id, parent: instance.parent, before })
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
