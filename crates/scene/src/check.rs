//! Checks after a list of edits: references lead somewhere, what is gone has no users, nothing contains itself.

use std::collections::BTreeSet;

use crate::apply::Undo;
use crate::{Edit, EditError, GeometryId, InstanceId, MaterialId, ObjectId, Scene, Target};

impl Scene {
    /// Checks what the edits made refer to, and who refers to what they removed. Costs what the edits touch, except
    /// that removals scan for users and structural changes of instances scan for cycles.
    pub(crate) fn check_references(&self, edits: &[Edit], undo: &[Undo]) -> Result<(), EditError> {
        let mut removed = BTreeSet::new();
        let mut structure_changed = false;
        for (edit, before) in edits.iter().zip(undo) {
            match edit {
                Edit::Geometry(id, _) | Edit::Attribute(id, ..) => self.check_attributes(*id)?,
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

    // The four checks below skip a handle that a later edit of the same list removed again.

    fn check_attributes(&self, id: GeometryId) -> Result<(), EditError> {
        let Some(attributes) = self.attributes.get(&id) else { return Ok(()) };
        let target = Target::Geometry(id);
        let geometry = self.geometries.get(&id).ok_or(EditError::Unknown { target })?;
        match attributes.iter().find_map(|(name, attribute)| Some((name, attribute.misfit(geometry)?))) {
            Some((name, problem)) => {
                Err(EditError::Invalid { target, problem: format!("attribute `{name}`: {problem}") })
            }
            None => Ok(()),
        }
    }

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
        for &target in removed {
            let Target::Object(object) = target else { continue };
            let user = self.placements_of(object).chain(self.placed_in(Some(object))).next();
            if let (Some(user), true) = (user, gone(target, self.objects.contains_key(&object))) {
                return in_use(target, Target::Instance(user));
            }
        }
        Ok(())
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
}
