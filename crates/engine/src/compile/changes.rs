//! What a list of edits touches, with the first edit that does.

use std::collections::{BTreeMap, BTreeSet};

use glam::Affine3A;
use heliostat_scene::{
    Applied, Edit, GeometryId, InstanceId, MaterialId, ObjectId, RebuildReason, Scene, Target, TextureId,
};

/// Who holds an instance: an object, or the world (`None`).
pub(super) type Holder = Option<ObjectId>;

/// Why something must be rebuilt.
pub(super) type Cause = (Target, RebuildReason);

/// Where an edit that moves an instance puts it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Move {
    pub(super) id: InstanceId,
    /// `parent_from_object` when the shutter opens, and when it closes if the instance moves meanwhile.
    pub(super) open: Affine3A,
    pub(super) close: Option<Affine3A>,
}

impl Move {
    /// `None` for edits of other kinds.
    pub(super) fn of(edit: &Edit) -> Option<Self> {
        match *edit {
            Edit::MoveInstance(id, open) => Some(Self { id, open, close: None }),
            Edit::SweepInstance(id, open, close) => Some(Self { id, open, close: Some(close) }),
            _ => None,
        }
    }
}

#[derive(Debug, Default)]
pub(super) struct Changes {
    pub(super) geometries: BTreeSet<GeometryId>,
    /// Geometries that got attributes, others, or lost some.
    pub(super) attributes: BTreeSet<GeometryId>,
    /// Geometries that lost some.
    pub(super) lost_attributes: BTreeSet<GeometryId>,
    /// Defined or replaced.
    pub(super) objects: BTreeSet<ObjectId>,
    pub(super) removed_objects: BTreeSet<ObjectId>,
    /// Holders in which instances came, went, or changed what they place.
    pub(super) lists: BTreeMap<Holder, Cause>,
    /// The edits, by their index, that moved instances and did nothing else.
    pub(super) moves: BTreeMap<Holder, Vec<u32>>,
    pub(super) textures: BTreeSet<TextureId>,
    pub(super) removed_textures: BTreeSet<TextureId>,
    /// Defined, replaced or removed.
    pub(super) materials: BTreeSet<MaterialId>,
    pub(super) lights: bool,
    pub(super) environment: bool,
}

impl Changes {
    /// Of edits that have just been applied to `scene`.
    pub(super) fn new(edits: &[Edit], applied: &Applied, scene: &Scene) -> Self {
        let mut changes = Self::default();
        // Successive moves mostly happen in the same holder.
        let mut last: Option<(Holder, Vec<u32>)> = None;
        for (index, edit) in edits.iter().enumerate() {
            match edit {
                Edit::MoveInstance(..) | Edit::SweepInstance(..) => {
                    let Some(holder) = applied.holder(index) else { continue };
                    match &mut last {
                        Some((same, moves)) if *same == holder => moves.push(index as u32),
                        _ => {
                            changes.take_moves(last.replace((holder, vec![index as u32])));
                        }
                    }
                }
                Edit::ShowInstance(id, _) | Edit::Instance(id, _) | Edit::RemoveInstance(id) => {
                    let now = scene.instances().get(id).map(|instance| instance.parent);
                    for holder in [applied.holder(index), now].into_iter().flatten() {
                        changes
                            .lists
                            .entry(holder)
                            .or_insert((Target::Instance(*id), RebuildReason::Changed));
                    }
                }
                Edit::Geometry(id, _) => _ = changes.geometries.insert(*id),
                Edit::Attribute(id, ..) => _ = changes.attributes.insert(*id),
                Edit::RemoveAttribute(id, _) => {
                    changes.attributes.insert(*id);
                    changes.lost_attributes.insert(*id);
                }
                Edit::Object(id, _) => _ = changes.objects.insert(*id),
                Edit::RemoveObject(id) => _ = changes.removed_objects.insert(*id),
                Edit::Texture(id, _) => _ = changes.textures.insert(*id),
                Edit::RemoveTexture(id) => _ = changes.removed_textures.insert(*id),
                Edit::Material(id, _) | Edit::RemoveMaterial(id) => _ = changes.materials.insert(*id),
                Edit::Light(..) | Edit::RemoveLight(_) => changes.lights = true,
                Edit::Environment(_) => changes.environment = true,
                Edit::RemoveGeometry(_) | Edit::Camera(..) | Edit::RemoveCamera(_) => {}
            }
        }
        changes.take_moves(last);
        // The same list may define and remove a thing, in either order: what counts is whether it is there now.
        changes.objects.retain(|id| scene.objects().contains_key(id));
        changes.removed_objects.retain(|id| !scene.objects().contains_key(id));
        changes.geometries.retain(|id| scene.geometries().contains_key(id));
        changes.textures.retain(|id| scene.textures().contains_key(id));
        changes.removed_textures.retain(|id| !scene.textures().contains_key(id));
        let exists = |holder: &Holder| holder.is_none_or(|id| scene.objects().contains_key(&id));
        changes.lists.retain(|holder, _| exists(holder));
        changes.moves.retain(|holder, _| exists(holder));
        changes
    }

    fn take_moves(&mut self, moves: Option<(Holder, Vec<u32>)>) {
        if let Some((holder, moves)) = moves {
            self.moves.entry(holder).or_default().extend(moves);
        }
    }

    /// Whether only cameras changed, if anything.
    pub(super) fn is_empty(&self) -> bool {
        let Self { geometries, objects, removed_objects, lists, moves, .. } = self;
        let geometry = geometries.is_empty() && objects.is_empty() && removed_objects.is_empty();
        let instances = lists.is_empty() && moves.is_empty();
        let Self { textures, removed_textures, materials, lights, environment, .. } = self;
        let look = self.attributes.is_empty()
            && textures.is_empty()
            && removed_textures.is_empty()
            && materials.is_empty();
        geometry && instances && look && !lights && !environment
    }
}
