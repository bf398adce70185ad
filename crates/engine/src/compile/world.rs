//! Objects and the world brought up to date, from the leaves of the hierarchy up.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Instant;

use heliostat_kernel as kernel;
use heliostat_kernel::{BuildError, BuildOptions, InstanceChange, RefitPolicy, TriangleBvh, UpdateKind};
use heliostat_scene::{
    ApplyReport, BackendError, Edit, InstanceId, ObjectId, RebuildKind, RebuildReason, Scene, Target,
};

use rayon::prelude::*;

use super::changes::{Cause, Changes, Holder, Move};
use super::trees::{StagedTree, TreeWork, kernel_meshes, kernel_quadrics, refused, tell};
use super::worn::{self, Pace};
use super::{BuiltObject, Compiled, note};

/// What happened to the hierarchy, for the shader tables.
#[derive(Debug, Default)]
pub(super) struct Touched {
    /// Some object's list of instances or parts is another one: the numbering of paths may have changed.
    pub(super) structure: bool,
    /// Positions of the instances that moved, in each holder's list.
    pub(super) moved: BTreeMap<Holder, Vec<usize>>,
    /// Positions of the instances below which something moved.
    pub(super) below: BTreeMap<Holder, Vec<usize>>,
    /// Objects whose triangles are others, or elsewhere.
    pub(super) reshaped: Vec<ObjectId>,
    /// Objects whose trees should be made anew when there is time.
    pub(super) worn: Vec<ObjectId>,
}

impl Touched {
    /// Whether anything moved inside an object, at any depth.
    pub(super) fn has_moves(&self, id: ObjectId) -> bool {
        let any =
            |map: &BTreeMap<Holder, Vec<usize>>| map.get(&Some(id)).is_some_and(|list| !list.is_empty());
        any(&self.moved) || any(&self.below)
    }
}

/// The holders that have to be looked at.
struct Affected {
    /// Bottom-up, without the world.
    order: Vec<ObjectId>,
    /// For each holder, its instances of affected objects.
    children: BTreeMap<Holder, Vec<InstanceId>>,
}

impl Affected {
    /// Whatever is dirty itself, and everything above it.
    fn new(scene: &Scene, dirty: impl Iterator<Item = ObjectId>) -> Self {
        let mut found: BTreeSet<ObjectId> = BTreeSet::new();
        let mut open: Vec<ObjectId> = dirty.collect();
        let mut children: BTreeMap<Holder, Vec<InstanceId>> = BTreeMap::new();
        while let Some(id) = open.pop() {
            if !found.insert(id) {
                continue;
            }
            for instance in scene.placements_of(id) {
                let holder = scene.instances()[&instance].parent;
                children.entry(holder).or_default().push(instance);
                open.extend(holder);
            }
        }
        let count = |id: &ObjectId| children.get(&Some(*id)).map_or(0, Vec::len);
        let mut waiting: BTreeMap<ObjectId, usize> = found.iter().map(|id| (*id, count(id))).collect();
        let mut order: Vec<ObjectId> = found.iter().filter(|id| waiting[id] == 0).copied().collect();
        let mut next = 0;
        while next < order.len() {
            for instance in scene.placements_of(order[next]) {
                let holder = scene.instances()[&instance].parent;
                if let Some(count) = holder.and_then(|id| waiting.get_mut(&id)) {
                    *count -= 1;
                    if *count == 0 {
                        order.extend(holder);
                    }
                }
            }
            next += 1;
        }
        Self { order, children }
    }
}

/// An object, or the world, whose instances are being brought up to date.
struct Held<'a> {
    holder: Holder,
    name: String,
    object: &'a mut kernel::Object,
    placed: &'a mut Vec<InstanceId>,
}

impl Compiled {
    /// Brings objects and the world up to date. After an error they are in between.
    pub(super) fn commit_objects(
        &mut self,
        scene: &Scene,
        (edits, changes): (&[Edit], &Changes),
        work: &[TreeWork],
        mut staged: BTreeMap<ObjectId, StagedTree>,
        report: &mut ApplyReport,
    ) -> Result<Touched, BackendError> {
        let structure = !changes.objects.is_empty() || !changes.removed_objects.is_empty();
        let touched = Touched { structure, ..Touched::default() };
        for id in &changes.removed_objects {
            self.objects.remove(id);
        }
        let holders = changes.lists.keys().chain(changes.moves.keys()).copied().flatten();
        let affected = Affected::new(scene, work.iter().map(|work| work.id).chain(holders));
        self.release(&affected);
        let mut pass =
            Pass { scene, edits, changes, affected: &affected, renewed: BTreeMap::new(), touched, report };
        let work: BTreeMap<ObjectId, &TreeWork> = work.iter().map(|work| (work.id, work)).collect();
        for &id in &affected.order {
            let mut built = self.objects.remove(&id).unwrap_or_default();
            let work = work.get(&id).copied();
            let name = format!("{id} ({:?})", scene.objects()[&id].name);
            // Nobody else holds it since it was released, so nothing is copied.
            let object = Arc::make_mut(&mut built.object);
            if let Some(mut tree) = staged.remove(&id) {
                if let Some(report) = &tree.report {
                    self.pace.learn(report);
                }
                tell(&mut tree, pass.report);
                built.pending = None;
                object.set_triangles(tree.triangles);
            }
            if let Some(work) = work {
                pass.quadrics(object, &name, work)?;
            }
            if let Some(work) = work.filter(|work| work.refit) {
                if let Some(tree) = worn::finished(&mut built.pending, &built.indices) {
                    object.set_triangles(Some(tree.into()));
                }
                pass.refit(object, &name, work, &self.pace)?;
            }
            let name = format!("instance tree of {name}");
            let held = Held { holder: Some(id), name, object, placed: &mut built.placed };
            let listed = pass.instances(&self.objects, held)?;
            if work.is_some() {
                built.remember(scene, id);
                pass.touched.reshaped.push(id);
            }
            let cause = work.map(|work| work.cause).or(listed);
            pass.renewed.insert(id, cause.unwrap_or((Target::Object(id), RebuildReason::Changed)));
            self.objects.insert(id, built);
        }
        let name = "instance tree of the world".to_owned();
        let object = self.world.root_mut();
        pass.instances(&self.objects, Held { holder: None, name, object, placed: &mut self.placed })?;
        Ok(pass.touched)
    }

    /// Takes affected objects out of their holders, top-down, so that they can be changed without a copy.
    fn release(&mut self, affected: &Affected) {
        for holder in std::iter::once(None).chain(affected.order.iter().rev().map(|&id| Some(id))) {
            let children = affected.children.get(&holder).map_or(&[][..], Vec::as_slice);
            let (object, placed) = match holder {
                None => (self.world.root_mut(), &self.placed),
                Some(id) => match self.objects.get_mut(&id) {
                    Some(built) => (Arc::make_mut(&mut built.object), &built.placed),
                    None => continue,
                },
            };
            let mut search = Search::new(placed);
            for index in children.iter().filter_map(|id| search.position(*id)) {
                object.release(index);
            }
        }
    }
}

/// One pass over the affected objects.
struct Pass<'a> {
    scene: &'a Scene,
    edits: &'a [Edit],
    changes: &'a Changes,
    affected: &'a Affected,
    /// Objects that were changed, and why.
    renewed: BTreeMap<ObjectId, Cause>,
    touched: Touched,
    report: &'a mut ApplyReport,
}

impl Pass<'_> {
    /// Moves the vertices in an object's tree, and makes the tree anew if it has become too bad for that.
    fn refit(
        &mut self,
        object: &mut kernel::Object,
        name: &str,
        work: &TreeWork,
        pace: &Pace,
    ) -> Result<(), BackendError> {
        let start = Instant::now();
        let parts = &self.scene.objects()[&work.id].parts;
        let geometries: Vec<_> = parts.iter().map(|part| part.geometry).collect();
        let meshes = kernel_meshes(self.scene, &geometries);
        let refit = object.follow(&meshes, &RefitPolicy::default()).map_err(|error| refused(name, &error))?;
        let Some(refit) = refit else { return Ok(()) };
        let what = format!("triangle tree of {name}");
        if refit.rebuild && pace.allows(work.triangles) {
            let tree = TriangleBvh::build(&meshes, &BuildOptions::default());
            object.set_triangles(Some(tree.map_err(|error| refused(name, &error))?.into()));
            let cause = (work.cause.0, RebuildReason::Worn);
            note(self.report, what, cause, RebuildKind::Built, work.triangles, start);
            return Ok(());
        }
        if refit.rebuild {
            self.touched.worn.push(work.id);
        }
        let kind = RebuildKind::Refitted { cost: refit.sah / refit.sah_at_build };
        note(self.report, what, work.cause, kind, work.triangles, start);
        Ok(())
    }

    /// Rebuilds the tree of an object's spheres and cones: there are few of them, beside triangles.
    fn quadrics(
        &mut self,
        object: &mut kernel::Object,
        name: &str,
        work: &TreeWork,
    ) -> Result<(), BackendError> {
        let start = Instant::now();
        let quadrics = kernel_quadrics(self.scene, &self.scene.objects()[&work.id]);
        let quadrics = quadrics.map_err(|error| refused(name, &error))?;
        if let Some(quadrics) = &quadrics {
            let (what, count) = (format!("tree of the spheres and cones of {name}"), quadrics.len() as u64);
            note(self.report, what, work.cause, RebuildKind::Built, count, start);
        }
        object.set_quadrics(quadrics);
        Ok(())
    }

    /// Brings a holder's instances up to date and says why that was needed, if it was.
    fn instances(
        &mut self,
        objects: &BTreeMap<ObjectId, BuiltObject>,
        mut held: Held<'_>,
    ) -> Result<Option<Cause>, BackendError> {
        let moves = self.changes.moves.get(&held.holder).map_or(&[][..], Vec::as_slice);
        let children = self.affected.children.get(&held.holder).map_or(&[][..], Vec::as_slice);
        let first = moves.first().and_then(|&index| Move::of(&self.edits[index as usize]));
        let moved = first.map(|step| (Target::Instance(step.id), RebuildReason::InstanceMoved));
        let child = || {
            let object_of = |id: &InstanceId| self.scene.instances()[id].object;
            let (target, _) = children.iter().find_map(|id| self.renewed.get(&object_of(id)))?;
            Some((*target, RebuildReason::ChildChanged))
        };
        let listed = self.changes.lists.get(&held.holder).copied();
        let Some(cause) = listed.or(moved).or_else(child) else { return Ok(None) };
        let start = Instant::now();
        let updated = match listed {
            None => self.update(objects, &mut held, moves, children)?,
            Some(_) => None,
        };
        let (kind, count) = match updated {
            Some(updated) => updated,
            None => (RebuildKind::Built, self.list(objects, &mut held)?),
        };
        note(self.report, held.name, cause, kind, count, start);
        Ok(Some(cause))
    }

    /// What moves make of a holder's instances. `None` if one of those that can be seen was not shown so far.
    fn moved(&self, held: &Held<'_>, moves: &[u32]) -> Option<Vec<InstanceChange>> {
        let mut search = Search::new(held.placed);
        let mut found: Vec<(usize, &kernel::Instance, &Edit)> = Vec::with_capacity(moves.len());
        for &edit in moves {
            let edit = &self.edits[edit as usize];
            let Some(step) = Move::of(edit) else { continue };
            match search.position(step.id).and_then(|index| Some((index, held.object.instance(index)?))) {
                Some((index, before)) => found.push((index, before, edit)),
                // Nothing is to be done for hidden ones.
                None if self.scene.instances().get(&step.id).is_some_and(|instance| instance.visible) => {
                    return None;
                }
                None => {}
            }
        }
        let change = |&(index, before, edit): &(usize, &kernel::Instance, &Edit)| {
            let (object, id) = (before.object.clone(), before.id);
            let (parent_from_object, motion) = Move::of(edit)
                .map_or((before.parent_from_object, before.motion), |step| (step.open, step.close));
            InstanceChange { index, instance: kernel::Instance { object, parent_from_object, motion, id } }
        };
        Some(found.par_iter().with_min_len(1024).map(change).collect())
    }

    /// Updates instances in place. `None` if the list must be made anew: what could not be shown now can, or the other
    /// way round.
    fn update(
        &mut self,
        objects: &BTreeMap<ObjectId, BuiltObject>,
        held: &mut Held<'_>,
        moves: &[u32],
        children: &[InstanceId],
    ) -> Result<Option<(RebuildKind, u64)>, BackendError> {
        let Some(mut updates) = self.moved(held, moves) else { return Ok(None) };
        in_order(&mut updates);
        let moved: Vec<usize> = updates.iter().map(|update| update.index).collect();
        let mut below = Vec::new();
        let mut search = Search::new(held.placed);
        for &id in children {
            let Some(index) = search.position(id) else { continue };
            let object = objects[&self.scene.instances()[&id].object].object.clone();
            match moved.binary_search(&index) {
                Ok(at) => updates[at].instance.object = object,
                Err(_) => {
                    let Some(before) = held.object.instance(index) else { continue };
                    below.push(index);
                    let instance = kernel::Instance { object, ..before.clone() };
                    updates.push(InstanceChange { index, instance });
                }
            }
        }
        in_order(&mut updates);
        let (count, paths) = (updates.len() as u64, held.object.path_count());
        let update = match held.object.update(&mut updates) {
            Ok(update) => update,
            Err(BuildError::SingularTransform { .. } | BuildError::NonFiniteTransform { .. }) => {
                return Ok(None);
            }
            Err(error) => return Err(refused(&held.name, &error)),
        };
        self.touched.structure |= held.object.path_count() != paths;
        self.touched.moved.insert(held.holder, moved);
        self.touched.below.insert(held.holder, below);
        let kind = match update.kind {
            UpdateKind::Rebuilt => RebuildKind::Built,
            _ if update.sah_at_build > 0.0 => {
                RebuildKind::Refitted { cost: update.sah / update.sah_at_build }
            }
            _ => RebuildKind::Refitted { cost: 1.0 },
        };
        Ok(Some((kind, count)))
    }

    /// Lists a holder's visible instances anew; those that rays cannot be carried through are left out with a warning.
    fn list(
        &mut self,
        objects: &BTreeMap<ObjectId, BuiltObject>,
        held: &mut Held<'_>,
    ) -> Result<u64, BackendError> {
        self.touched.structure = true;
        held.placed.clear();
        let mut instances = Vec::new();
        for id in self.scene.placed_in(held.holder) {
            let instance = &self.scene.instances()[&id];
            if !instance.visible {
                continue;
            }
            let placed = kernel::Instance {
                object: objects[&instance.object].object.clone(),
                parent_from_object: instance.parent_from_object,
                motion: instance.motion,
                id: id.0,
            };
            if placed.is_placeable() {
                held.placed.push(id);
                instances.push(placed);
            } else {
                let name = &instance.name;
                self.report
                    .warnings
                    .push(format!("{id} ({name:?}) is not shown: its transform cannot be inverted"));
            }
        }
        let count = instances.len() as u64;
        let object = kernel::Object::new(held.object.triangles().cloned(), instances);
        let quadrics = held.object.quadrics().cloned();
        *held.object = object.map_err(|error| refused(&held.name, &error))?;
        held.object.set_quadrics(quadrics);
        Ok(count)
    }
}

/// Sorts updates by instance; of several for one, the last counts.
fn in_order(updates: &mut Vec<InstanceChange>) {
    if updates.is_sorted_by(|a, b| a.index < b.index) {
        return;
    }
    updates.sort_by_key(|update| update.index);
    updates.dedup_by(|later, kept| {
        let same = later.index == kept.index;
        if same {
            std::mem::swap(later, kept);
        }
        same
    });
}

/// Finds instances in a sorted list; those that follow one another are found at once.
struct Search<'a> {
    placed: &'a [InstanceId],
    next: usize,
}

impl<'a> Search<'a> {
    fn new(placed: &'a [InstanceId]) -> Self {
        Self { placed, next: 0 }
    }

    fn position(&mut self, id: InstanceId) -> Option<usize> {
        let found = match self.placed.get(self.next) == Some(&id) {
            true => self.next,
            false => self.placed.binary_search(&id).ok()?,
        };
        self.next = found + 1;
        Some(found)
    }
}
