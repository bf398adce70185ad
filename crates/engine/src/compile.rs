//! From the scene's plain data to accelerators and shader tables; only what the edits touch is rebuilt.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use glam::Affine3A;
use heliostat_kernel as kernel;
use heliostat_kernel::{
    BuildError, BuildOptions, BuildProgress, KdOptions, KdTree, TriangleBvh, Triangles, World,
};
use heliostat_scene::{
    ApplyReport, BackendError, Edit, Geometry, GeometryId, InstanceId, MaterialId, MaterialOverride,
    ObjectId, Progress, RebuildReason, Rebuilt, Scene, Target, TextureId,
};
use heliostat_shading::{
    EnvironmentLight, InterfaceCache, MipMap, Placement, ShadedPart, ShadingScene, SurfaceMaterial,
};
use rayon::prelude::*;

use crate::engine::Accelerator;

/// Most objects in the fully expanded tree of instances: each has an entry in the shader tables.
const MAX_PLACEMENTS: u64 = 1 << 22;

/// An object's accelerators.
#[derive(Clone)]
struct BuiltObject {
    /// What the triangle tree was built over.
    geometries: Vec<GeometryId>,
    triangles: Option<Triangles>,
    object: Arc<kernel::Object>,
}

/// Everything compiled from a scene. Cloning shares all the data.
#[derive(Clone)]
pub(crate) struct Compiled {
    accelerator: Accelerator,
    objects: BTreeMap<ObjectId, BuiltObject>,
    parents: BTreeMap<InstanceId, Option<ObjectId>>,
    world: World,
    textures: BTreeMap<TextureId, Arc<MipMap>>,
    interfaces: InterfaceCache,
    environment: Arc<EnvironmentLight>,
    /// The order of the material table.
    materials: Vec<MaterialId>,
    placements: Arc<[Placement]>,
    shading: Arc<ShadingScene>,
    /// Tables for [`MaterialOverride::Diffuse`], made when first asked for.
    diffuse: Option<Arc<ShadingScene>>,
}

impl Default for Compiled {
    fn default() -> Self {
        let environment = Arc::new(EnvironmentLight::None);
        let placements: Arc<[Placement]> = Arc::new([]);
        let shading =
            ShadingScene::new(Vec::new(), placements.clone(), std::iter::empty(), environment.clone(), None);
        Self {
            accelerator: Accelerator::default(),
            objects: BTreeMap::new(),
            parents: BTreeMap::new(),
            world: World::empty(),
            textures: BTreeMap::new(),
            interfaces: InterfaceCache::new(),
            environment,
            materials: Vec::new(),
            placements,
            shading: Arc::new(shading),
            diffuse: None,
        }
    }
}

/// What a list of edits touches, with the first edit that does.
#[derive(Default)]
struct Dirty {
    geometries: BTreeSet<GeometryId>,
    /// Some object was defined, replaced or removed.
    objects: bool,
    /// Objects (`None`: the world) whose list of instances changed.
    instances: BTreeMap<Option<ObjectId>, (Target, RebuildReason)>,
    textures: BTreeSet<TextureId>,
    environment: bool,
}

impl Dirty {
    fn new(edits: &[Edit], scene: &Scene, compiled: &mut Compiled) -> Self {
        let mut dirty = Self::default();
        for edit in edits {
            match edit {
                Edit::Geometry(id, _) => _ = dirty.geometries.insert(*id),
                Edit::Object(..) => dirty.objects = true,
                Edit::RemoveObject(id) => {
                    dirty.objects = true;
                    compiled.objects.remove(id);
                }
                Edit::Instance(id, _) | Edit::RemoveInstance(id) => {
                    dirty.instance(*id, RebuildReason::Changed, scene, compiled);
                }
                Edit::ShowInstance(id, _) => {
                    dirty.instance(*id, RebuildReason::Changed, scene, compiled);
                }
                Edit::MoveInstance(id, _) | Edit::SweepInstance(id, ..) => {
                    dirty.instance(*id, RebuildReason::InstanceMoved, scene, compiled);
                }
                Edit::Texture(id, _) => _ = dirty.textures.insert(*id),
                Edit::RemoveTexture(id) => _ = compiled.textures.remove(id),
                Edit::Environment(_) => dirty.environment = true,
                Edit::Material(..)
                | Edit::RemoveMaterial(_)
                | Edit::RemoveGeometry(_)
                | Edit::Light(..)
                | Edit::RemoveLight(_)
                | Edit::Camera(..)
                | Edit::RemoveCamera(_) => {}
            }
        }
        dirty
    }

    /// Marks where an instance was and where it is now.
    fn instance(&mut self, id: InstanceId, reason: RebuildReason, scene: &Scene, compiled: &mut Compiled) {
        let now = scene.instances().get(&id).map(|instance| instance.parent);
        let before = match now {
            Some(parent) => compiled.parents.insert(id, parent),
            None => compiled.parents.remove(&id),
        };
        for parent in [before, now].into_iter().flatten() {
            self.instances.entry(parent).or_insert((Target::Instance(id), reason));
        }
    }

    fn touches_structure(&self) -> bool {
        !(self.geometries.is_empty() && !self.objects && self.instances.is_empty())
    }
}

impl Compiled {
    /// Nothing yet; trees will be of the kind given.
    pub(crate) fn new(accelerator: Accelerator) -> Self {
        Self { accelerator, ..Self::default() }
    }

    pub(crate) fn world(&self) -> &World {
        &self.world
    }

    /// The shader tables for an override; [`Self::prepare_override`] must have made them.
    pub(crate) fn shading(&self, materials: MaterialOverride) -> &ShadingScene {
        match (materials, &self.diffuse) {
            (MaterialOverride::Diffuse, Some(diffuse)) => diffuse,
            _ => &self.shading,
        }
    }

    pub(crate) fn prepare_override(&mut self, scene: &Scene, materials: MaterialOverride) {
        if self.diffuse.is_none() {
            self.diffuse = Some(Arc::new(self.tables(scene, materials)));
        }
    }

    /// Brings everything up to date with a scene to which `edits` have just been applied. After an error `self` is in
    /// an intermediate state; the caller keeps the one before.
    pub(crate) fn update(
        &mut self,
        scene: &Scene,
        edits: &[Edit],
        progress: &Progress,
    ) -> Result<ApplyReport, BackendError> {
        let mut report = ApplyReport::default();
        let dirty = Dirty::new(edits, scene, self);
        if dirty.touches_structure() {
            self.update_objects(scene, &dirty, progress, &mut report)?;
        }
        self.update_textures(scene, &dirty, progress, &mut report)?;
        if dirty.environment {
            let start = Instant::now();
            self.environment = Arc::new(EnvironmentLight::new(scene.environment()));
            let reason = RebuildReason::Changed;
            note(&mut report, "environment sampling table", Target::Environment, reason, 1, start);
        }
        if progress.is_cancelled() {
            return Err(BackendError::Cancelled);
        }
        let camera_alone = |edit: &Edit| matches!(edit, Edit::Camera(..) | Edit::RemoveCamera(_));
        if edits.iter().all(camera_alone) {
            return Ok(report);
        }
        // Placements refer to materials by their position in the table.
        let same_materials = scene.materials().keys().eq(&self.materials);
        if dirty.touches_structure() || !same_materials {
            self.placements = self.placements(scene)?;
            self.materials = scene.materials().keys().copied().collect();
        }
        self.diffuse = None;
        self.shading = Arc::new(self.tables(scene, MaterialOverride::None));
        self.interfaces.retain(|_, tables| Arc::strong_count(tables) > 1);
        Ok(report)
    }

    /// Rebuilds dirty objects bottom-up, then the world.
    fn update_objects(
        &mut self,
        scene: &Scene,
        dirty: &Dirty,
        progress: &Progress,
        report: &mut ApplyReport,
    ) -> Result<(), BackendError> {
        let order = scene.bottom_up();
        let children = |parent| scene.placed_in(parent).collect::<Vec<_>>();
        let triangles = |id: &ObjectId| -> u64 {
            scene.objects()[id]
                .parts
                .iter()
                .map(|part| mesh_of(scene, part.geometry).indices.len() as u64)
                .sum()
        };
        progress.start(
            order.iter().filter(|id| self.triangle_cause(scene, dirty, **id).is_some()).map(triangles).sum(),
        );
        let mut rebuilt: BTreeMap<ObjectId, Target> = BTreeMap::new();
        for id in order {
            if progress.is_cancelled() {
                return Err(BackendError::Cancelled);
            }
            let placed = &children(Some(id))[..];
            let triangle_cause = self.triangle_cause(scene, dirty, id);
            let instance_cause = instance_cause(scene, dirty, &rebuilt, Some(id), placed);
            if triangle_cause.is_none() && instance_cause.is_none() {
                continue;
            }
            let mut built = self.objects.get(&id).cloned().unwrap_or_else(|| BuiltObject {
                geometries: Vec::new(),
                triangles: None,
                object: Arc::new(kernel::Object::empty()),
            });
            if let Some((cause, reason)) = triangle_cause {
                let count = triangles(&id);
                let watched = TreeProgress { progress, triangles: count, done: AtomicU64::new(0) };
                built.build_triangles(scene, id, self.accelerator, (cause, reason), &watched, report)?;
                watched.fraction(1.0);
            }
            let name = format!("{id} ({:?})", scene.objects()[&id].name);
            let start = Instant::now();
            let instances = self.kernel_instances(scene, placed, report);
            let count = instances.len() as u64;
            let object = kernel::Object::new(built.triangles.clone(), instances);
            built.object = Arc::new(object.map_err(|error| refused(&name, &error))?);
            if let Some((cause, reason)) = instance_cause {
                note(report, format!("instance tree of {name}"), cause, reason, count, start);
            }
            let cause = triangle_cause.or(instance_cause).map_or(Target::Object(id), |(cause, _)| cause);
            rebuilt.insert(id, cause);
            self.objects.insert(id, built);
        }
        let placed = &children(None)[..];
        if let Some((cause, reason)) = instance_cause(scene, dirty, &rebuilt, None, placed) {
            let start = Instant::now();
            let instances = self.kernel_instances(scene, placed, report);
            let count = instances.len() as u64;
            let root = kernel::Object::new(None, instances).map_err(|error| refused("the world", &error))?;
            self.world = World::new(Arc::new(root));
            note(report, "instance tree of the world", cause, reason, count, start);
        }
        Ok(())
    }

    /// Why an object's triangle tree must be built, if it must: its geometries changed, in themselves or as a list.
    fn triangle_cause(&self, scene: &Scene, dirty: &Dirty, id: ObjectId) -> Option<(Target, RebuildReason)> {
        let parts = &scene.objects()[&id].parts;
        let geometry = parts.iter().map(|part| part.geometry).find(|id| dirty.geometries.contains(id));
        match (self.objects.get(&id), geometry) {
            (None, _) => Some((Target::Object(id), RebuildReason::New)),
            (Some(_), Some(geometry)) => Some((Target::Geometry(geometry), RebuildReason::Changed)),
            (Some(built), None) => {
                let same = built.geometries.iter().copied().eq(parts.iter().map(|part| part.geometry));
                (!same).then_some((Target::Object(id), RebuildReason::Changed))
            }
        }
    }

    /// The kernel's form of visible instances; those it cannot carry rays through are left out with a warning.
    fn kernel_instances(
        &self,
        scene: &Scene,
        placed: &[InstanceId],
        report: &mut ApplyReport,
    ) -> Vec<kernel::Instance> {
        let mut instances = Vec::with_capacity(placed.len());
        for id in placed {
            let instance = &scene.instances()[id];
            let object = self.objects[&instance.object].object.clone();
            let parent_from_object = instance.parent_from_object;
            let placed = kernel::Instance { object, parent_from_object, motion: None, id: id.0 };
            if !instance.visible {
                continue;
            }
            if placed.is_placeable() {
                instances.push(placed);
            } else {
                let name = &instance.name;
                report
                    .warnings
                    .push(format!("{id} ({name:?}) is not shown: its transform cannot be inverted"));
            }
        }
        instances
    }

    fn update_textures(
        &mut self,
        scene: &Scene,
        dirty: &Dirty,
        progress: &Progress,
        report: &mut ApplyReport,
    ) -> Result<(), BackendError> {
        // A texture may have been defined and removed by the same list of edits.
        let textures: Vec<_> =
            dirty.textures.iter().filter_map(|id| Some((*id, scene.textures().get(id)?))).collect();
        let Some(&(first, _)) = textures.first() else { return Ok(()) };
        let start = Instant::now();
        progress.start(textures.len() as u64);
        let built: Vec<_> = textures
            .par_iter()
            .map(|(id, texture)| {
                let map = (!progress.is_cancelled()).then(|| Arc::new(MipMap::new(texture)));
                progress.advance(1);
                map.map(|map| (*id, map))
            })
            .collect::<Option<_>>()
            .ok_or(BackendError::Cancelled)?;
        let texels = textures.iter().map(|(_, t)| u64::from(t.image.width) * u64::from(t.image.height)).sum();
        self.textures.extend(built);
        note(report, "texture pyramids", Target::Texture(first), RebuildReason::Changed, texels, start);
        Ok(())
    }

    /// The table of all objects in the expanded tree of instances, by path.
    fn placements(&self, scene: &Scene) -> Result<Arc<[Placement]>, BackendError> {
        let count = self.world.path_count();
        if count > MAX_PLACEMENTS {
            return Err(BackendError::Limit(format!(
                "{count} placed objects once nested instances are expanded; the limit is {MAX_PLACEMENTS}"
            )));
        }
        let slots: BTreeMap<MaterialId, u32> = scene.materials().keys().copied().zip(0..).collect();
        let part = |part: &heliostat_scene::Part| ShadedPart {
            mesh: mesh_of(scene, part.geometry).clone(),
            material: slots[&part.material],
            geometry: part.geometry,
        };
        let parts: BTreeMap<ObjectId, Arc<[ShadedPart]>> = scene
            .objects()
            .iter()
            .map(|(&id, object)| (id, object.parts.iter().map(part).collect()))
            .collect();
        let mut placements = Vec::with_capacity(count as usize);
        self.world.for_each_path(&mut |_, world_from_object: &Affine3A, ids: &[u32], _| {
            placements.push(match ids.last() {
                Some(&id) => {
                    let instance = InstanceId(id);
                    let object = scene.instances()[&instance].object;
                    let detour = detour(scene, ids);
                    Placement::new(*world_from_object, detour, object, instance, parts[&object].clone())
                }
                // The world itself has no triangles of its own.
                None => Placement::new(
                    *world_from_object,
                    0.0,
                    ObjectId(u32::MAX),
                    InstanceId(u32::MAX),
                    Arc::new([]),
                ),
            });
        });
        Ok(placements.into())
    }

    fn tables(&mut self, scene: &Scene, materials: MaterialOverride) -> ShadingScene {
        let compiled = scene.materials().iter().map(|(&id, material)| {
            let material = SurfaceMaterial::overridden(material, materials);
            SurfaceMaterial::new(id, &material, &self.textures, &mut self.interfaces)
        });
        let compiled = compiled.collect();
        let lights = scene.lights().values();
        let bounds = self.world.bounds();
        let bounds =
            (!bounds.is_empty()).then_some(heliostat_scene::SceneBounds { min: bounds.min, max: bounds.max });
        ShadingScene::new(compiled, self.placements.clone(), lights, self.environment.clone(), bounds)
    }
}

impl BuiltObject {
    fn build_triangles(
        &mut self,
        scene: &Scene,
        id: ObjectId,
        accelerator: Accelerator,
        (cause, reason): (Target, RebuildReason),
        progress: &TreeProgress<'_>,
        report: &mut ApplyReport,
    ) -> Result<(), BackendError> {
        let start = Instant::now();
        let object = &scene.objects()[&id];
        self.geometries = object.parts.iter().map(|part| part.geometry).collect();
        let meshes: Vec<kernel::Mesh> = self
            .geometries
            .iter()
            .map(|&geometry| {
                let mesh = mesh_of(scene, geometry);
                kernel::Mesh {
                    positions: mesh.positions.clone(),
                    indices: mesh.indices.clone(),
                    motion: None,
                }
            })
            .collect();
        let count: u64 = meshes.iter().map(|mesh| mesh.indices.len() as u64).sum();
        let lost: usize = meshes.iter().map(|m| m.positions.iter().filter(|p| !p.is_finite()).count()).sum();
        if lost > 0 {
            let name = &object.name;
            report.warnings.push(format!(
                "{id} ({name:?}): {lost} vertices are not finite; the triangles that use them are not shown"
            ));
        }
        self.triangles = None;
        if count > 0 {
            let name = format!("{id} ({:?})", object.name);
            let tree = match accelerator {
                Accelerator::Bvh => {
                    let options = BuildOptions::default();
                    TriangleBvh::build_with(&meshes, &options, progress).map(Triangles::from)
                }
                Accelerator::KdTree => KdTree::build(&meshes, &KdOptions::default()).map(Triangles::from),
            };
            self.triangles = Some(tree.map_err(|error| refused(&name, &error))?);
            note(report, format!("triangle tree of {name}"), cause, reason, count, start);
        }
        Ok(())
    }
}

/// Why the instance tree of an object (`None`: the world) must be built, if it must.
fn instance_cause(
    scene: &Scene,
    dirty: &Dirty,
    rebuilt: &BTreeMap<ObjectId, Target>,
    parent: Option<ObjectId>,
    placed: &[InstanceId],
) -> Option<(Target, RebuildReason)> {
    dirty.instances.get(&parent).copied().or_else(|| {
        let child = placed.iter().find_map(|id| rebuilt.get(&scene.instances()[id].object));
        child.map(|&cause| (cause, RebuildReason::ChildChanged))
    })
}

/// See [`Placement::detour`]: each instance's translation, scaled by what lies above it.
fn detour(scene: &Scene, ids: &[u32]) -> f32 {
    if ids.len() < 2 {
        return 0.0;
    }
    let mut sum = 0.0;
    let mut world_from_parent = Affine3A::IDENTITY;
    for id in ids {
        let parent_from_object = scene.instances()[&InstanceId(*id)].parent_from_object;
        sum += world_from_parent.transform_vector3a(parent_from_object.translation).length();
        world_from_parent *= parent_from_object;
    }
    sum
}

fn mesh_of(scene: &Scene, geometry: GeometryId) -> &Arc<heliostat_scene::Mesh> {
    let Geometry::Mesh(mesh) = &scene.geometries()[&geometry];
    mesh
}

fn note(
    report: &mut ApplyReport,
    what: impl Into<String>,
    cause: Target,
    reason: RebuildReason,
    primitives: u64,
    start: Instant,
) {
    let milliseconds = start.elapsed().as_secs_f64() * 1e3;
    report.rebuilt.push(Rebuilt { what: what.into(), cause, reason, primitives, milliseconds });
}

fn refused(what: &str, error: &BuildError) -> BackendError {
    match error {
        BuildError::Cancelled => BackendError::Cancelled,
        error => BackendError::Limit(format!("{what}: {error}")),
    }
}

/// Shows the building of one tree as triangles done, and hands the cancelling on.
struct TreeProgress<'a> {
    progress: &'a Progress,
    triangles: u64,
    /// What `progress` was told so far.
    done: AtomicU64,
}

impl BuildProgress for TreeProgress<'_> {
    fn fraction(&self, done: f32) {
        let done = (f64::from(done) * self.triangles as f64) as u64;
        self.progress.advance(done - self.done.swap(done, Ordering::Relaxed));
    }

    fn cancelled(&self) -> bool {
        self.progress.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_tree_shows_its_progress_in_triangles_and_hears_of_cancelling() {
        let progress = Progress::new();
        progress.start(1000);
        progress.advance(300);
        let tree = TreeProgress { progress: &progress, triangles: 700, done: AtomicU64::new(0) };
        tree.fraction(0.5);
        assert_eq!(progress.state(), (650, 1000));
        assert!(!tree.cancelled());
        tree.fraction(1.0);
        assert_eq!(progress.state(), (1000, 1000));
        progress.cancel();
        assert!(tree.cancelled());
        assert_eq!(refused("a tree", &BuildError::Cancelled), BackendError::Cancelled);
    }
}
