//! Updates: instances that move, or whose objects change, without a new object.
use super::{Instance, Object, PlacedInstance, path_totals, place, place::Placement};
use crate::error::BuildError;

/// An instance tree that refitting made this much costlier than it was when built is built anew.
const WORN: f32 = 1.3;
/// One path from a leaf to the root costs about as much as this many nodes of a refit of the whole tree.
const PATH_NODES: usize = 8;
/// Changes per task.
const CHUNK: usize = 1024;

/// What one instance of an object shall be from now on.
#[derive(Clone, Debug)]
pub struct InstanceChange {
    /// Its index among the object's instances.
    pub index: usize,
    /// Its new placement, object and tag. The same object may be given again; a refitted one comes as a new `Arc` and
    /// brings new bounds along.
    pub instance: Instance,
}

/// How [`Object::update`] brought the tree over the instances up to date.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum UpdateKind {
    /// New boxes from the leaves of the changed instances up to the root.
    RefittedPaths,
    /// New boxes everywhere: so many instances changed that going path by path would take longer.
    Refitted,
    /// A new tree, because the refitted one would have cost more than 1.3 times what it did when it was built, or
    /// because an instance came into range that had no leaf, or places what is entered at other parts.
    Rebuilt,
}

/// What an update did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    /// The way it went.
    pub kind: UpdateKind,
    /// Nodes that were written; where paths meet, a node counts once for each.
    pub nodes: usize,
    /// Expected cost of a random ray in the tree over the instances, by the surface area heuristic, before the update.
    pub sah_before: f32,
    /// The same if the tree had only been refitted: what the choice was made by.
    pub sah_refitted: f32,
    /// The same now.
    pub sah: f32,
    /// The same when the tree was last built.
    pub sah_at_build: f32,
}

impl Object {
    /// Moves instances, or replaces what they place, at a cost that depends on the number of changes: a new box on the
    /// way from each to the root, or for the whole tree, which is built anew only when refitting has made it too costly.
    /// Path ids stay in the order of the instances. Gives the same bits for any number of threads. Runs on the current
    /// rayon pool.
    ///
    /// `changes` name instances in rising order. On success they hold what was there before: the same call again takes
    /// the update back, save that the tree may be another one over the same boxes.
    ///
    /// # Errors
    /// [`BuildError::NoSuchInstance`], [`BuildError::UnorderedChanges`], and those of [`Object::new`]; the object and
    /// the changes are then as they were.
    pub fn update(&mut self, changes: &mut [InstanceChange]) -> Result<Update, BuildError> {
        self.check_order(changes)?;
        let totals = self.changed_totals(changes)?;
        let moving = self.moving || changes.iter().any(|change| change.instance.has_motion());
        let placements = place::all(changes.len(), |i| (changes[i].index, &changes[i].instance))?;
        swap(&mut self.instances, 0, changes, &placements);
        if let Some(depth) = totals {
            self.depth = depth;
            self.number_paths();
        }
        let update = self.update_tree(changes, &placements);
        self.unite_bounds();
        if moving {
            self.look_for_motion();
        }
        Ok(update)
    }

    fn check_order(&self, changes: &[InstanceChange]) -> Result<(), BuildError> {
        let count = self.instances.len();
        if let Some(change) = changes.iter().position(|change| change.index >= count) {
            return Err(BuildError::NoSuchInstance { change, instance: changes[change].index, count });
        }
        match changes.windows(2).position(|pair| pair[0].index >= pair[1].index) {
            Some(before) => Err(BuildError::UnorderedChanges { change: before + 1 }),
            None => Ok(()),
        }
    }

    /// The depth to come, if a change affects that or the numbers of paths.
    fn changed_totals(&self, changes: &[InstanceChange]) -> Result<Option<usize>, BuildError> {
        // What was released is not there to compare with, but its numbers are still taken.
        let numbers = |index: usize| {
            let end = self.instances.get(index + 1).map_or(self.path_count, |next| next.path_offset);
            end - self.instances[index].path_offset
        };
        let same = |change: &InstanceChange| {
            let (before, now) = (&self.instances[change.index].instance.object, &change.instance.object);
            numbers(change.index) == now.path_count && (before.depth == now.depth || now.path_count == 1)
        };
        if changes.iter().all(same) {
            return Ok(None);
        }
        let mut next = changes.iter().peekable();
        let children = self.instances.iter().enumerate().map(|(index, placed)| {
            let changed = next.next_if(|change| change.index == index);
            &*changed.map_or(&placed.instance, |change| &change.instance).object
        });
        path_totals(children).map(|(depth, _)| Some(depth))
    }

    fn update_tree(&mut self, changes: &[InstanceChange], placements: &[Placement]) -> Update {
        let tree = &mut self.instance_tree;
        let (sah_before, _) = tree.sah();
        let mut whole = true;
        for (change, placement) in changes.iter().zip(placements) {
            let placed = &self.instances[change.index];
            whole &= tree.set_box(change.index, placed, placement.bounds);
        }
        let (kind, nodes) = if changes.len() * tree.leaves_each() * PATH_NODES < tree.nodes() {
            (UpdateKind::RefittedPaths, tree.refit_paths(changes.iter().map(|change| change.index)))
        } else {
            tree.refit();
            (UpdateKind::Refitted, tree.nodes())
        };
        let (sah_refitted, built) = tree.sah();
        let mut update =
            Update { kind, nodes, sah_before, sah_refitted, sah: sah_refitted, sah_at_build: built };
        if !whole || sah_refitted > WORN * built {
            tree.rebuild(&self.instances);
            (update.kind, update.nodes) = (UpdateKind::Rebuilt, tree.nodes());
            (update.sah, update.sah_at_build) = tree.sah();
        }
        update
    }
}

/// Exchanges instances with changes; `first` is the index of the first of `instances`.
fn swap(
    instances: &mut [PlacedInstance],
    first: usize,
    changes: &mut [InstanceChange],
    placements: &[Placement],
) {
    if changes.len() <= CHUNK {
        for (change, placement) in changes.iter_mut().zip(placements) {
            let placed = &mut instances[change.index - first];
            std::mem::swap(&mut placed.instance, &mut change.instance);
            placed.object_from_parent = placement.object_from_parent;
            placed.only_moved = placement.only_moved();
            placed.normal_from_object = placement.normal_from_object;
        }
        return;
    }
    let middle = changes.len() / 2;
    let border = changes[middle].index;
    let (low, high) = instances.split_at_mut(border - first);
    let (low_changes, high_changes) = changes.split_at_mut(middle);
    let (low_placements, high_placements) = placements.split_at(middle);
    rayon::join(
        || swap(low, first, low_changes, low_placements),
        || swap(high, border, high_changes, high_placements),
    );
}
