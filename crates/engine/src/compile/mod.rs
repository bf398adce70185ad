//! From the scene's plain data to accelerators and shader tables; only what the edits touch is rebuilt.
//!
//! What can fail or be cancelled, building trees and textures, happens first and to the side; then everything is brought
//! up to date in place.

mod changes;
mod lights;
mod tables;
mod trees;
mod world;
mod worn;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Instant;

use heliostat_kernel as kernel;
use heliostat_kernel::World;
use heliostat_scene::{
    Applied, ApplyReport, BackendError, Edit, Environment, GeometryId, InstanceId, LightId, MaterialId,
    MaterialOverride, ObjectId, Progress, RebuildKind, RebuildReason, Rebuilt, Scene, SceneBounds, Target,
    TextureId,
};
use heliostat_shading::{
    EnvironmentLight, InterfaceCache, LaneMode, MipMap, PunctualLight, ShaderRegistry, ShadingScene, Viewer,
};
use rayon::prelude::*;

use self::changes::{Cause, Changes};
use crate::engine::{Accelerator, EngineOptions};

/// An object's accelerators.
#[derive(Debug)]
struct BuiltObject {
    /// What the triangle tree was built over.
    geometries: Vec<GeometryId>,
    indices: Vec<Arc<[[u32; 3]]>>,
    /// Whether some of it moves while the shutter is open.
    moving: bool,
    object: Arc<kernel::Object>,
    /// The instances that `object` holds, in its order.
    placed: Vec<InstanceId>,
    /// A better tree, in the making.
    pending: Option<worn::Pending>,
}

impl Default for BuiltObject {
    fn default() -> Self {
        Self {
            geometries: Vec::new(),
            indices: Vec::new(),
            moving: false,
            object: Arc::new(kernel::Object::empty()),
            placed: Vec::new(),
            pending: None,
        }
    }
}

/// Everything compiled from a scene.
pub(crate) struct Compiled {
    accelerator: Accelerator,
    lanes: LaneMode,
    shaders: Arc<ShaderRegistry>,
    objects: BTreeMap<ObjectId, BuiltObject>,
    world: World,
    /// The instances that the world holds, in its order.
    placed: Vec<InstanceId>,
    textures: BTreeMap<TextureId, Arc<MipMap>>,
    interfaces: InterfaceCache,
    environment: Arc<EnvironmentLight>,
    lights: BTreeMap<LightId, PunctualLight>,
    /// The order of the material table.
    materials: Vec<MaterialId>,
    /// Each object's place in the table of parts.
    slots: BTreeMap<ObjectId, u32>,
    /// The objects that use each geometry.
    users: BTreeMap<GeometryId, BTreeSet<ObjectId>>,
    shading: ShadingScene,
    /// The bounds with which the lights were weighed.
    lit_bounds: Option<SceneBounds>,
    /// Tables for the override that was asked for last.
    overridden: Option<(MaterialOverride, ShadingScene)>,
    pace: worn::Pace,
    /// Objects with a tree in the making.
    rebuilding: BTreeSet<ObjectId>,
    /// Where those are made; started when first needed.
    background: Option<rayon::ThreadPool>,
}

/// What was made ahead, to be committed at once.
struct Staged {
    changes: Changes,
    textures: Vec<(TextureId, Arc<MipMap>)>,
    work: Vec<trees::TreeWork>,
    trees: BTreeMap<ObjectId, trees::StagedTree>,
    environment: Option<Arc<EnvironmentLight>>,
    lights: Option<BTreeMap<LightId, PunctualLight>>,
    report: ApplyReport,
}

impl Compiled {
    /// Nothing yet.
    pub(crate) fn new(options: &EngineOptions, shaders: Arc<ShaderRegistry>) -> Self {
        Self {
            accelerator: options.accelerator,
            lanes: options.lanes,
            shaders,
            objects: BTreeMap::new(),
            world: World::empty(),
            placed: Vec::new(),
            textures: BTreeMap::new(),
            interfaces: InterfaceCache::new(),
            environment: Arc::default(),
            lights: BTreeMap::new(),
            materials: Vec::new(),
            slots: BTreeMap::new(),
            users: BTreeMap::new(),
            shading: ShadingScene::default(),
            lit_bounds: None,
            overridden: None,
            pace: worn::Pace::new(options.rebuild_budget.as_secs_f64() * 1e3),
            rebuilding: BTreeSet::new(),
            background: None,
        }
    }

    pub(crate) fn world(&self) -> &World {
        &self.world
    }

    /// The shader tables for an override; [`Self::prepare_override`] must have made them.
    pub(crate) fn shading(&self, materials: &MaterialOverride) -> &ShadingScene {
        match &self.overridden {
            Some((made_for, tables)) if made_for == materials => tables,
            _ => &self.shading,
        }
    }

    /// Says from where the next frame is seen; `None` when it is made.
    pub(crate) fn set_viewer(&mut self, materials: &MaterialOverride, viewer: Option<Viewer>) {
        let tables = match &mut self.overridden {
            Some((made_for, tables)) if made_for == materials => tables,
            _ => &mut self.shading,
        };
        tables.set_viewer(viewer);
    }

    /// Brings everything up to date with a scene to which `edits` have just been applied.
    ///
    /// # Errors
    /// [`Refused::Untouched`] leaves `self` as it was; after [`Refused::Torn`] it is in between and must be made anew.
    pub(crate) fn update(
        &mut self,
        scene: &Scene,
        edits: &[Edit],
        applied: &Applied,
        progress: &Progress,
    ) -> Result<ApplyReport, Refused> {
        let changes = Changes::new(edits, applied, scene);
        if changes.is_empty() && !self.has_finished() {
            return Ok(ApplyReport::default());
        }
        let staged = self.stage(scene, changes, progress).map_err(Refused::Untouched)?;
        self.commit(scene, edits, staged).map_err(Refused::Torn)
    }

    /// Makes what takes long, to the side.
    fn stage(&self, scene: &Scene, changes: Changes, progress: &Progress) -> Result<Staged, BackendError> {
        let mut report = ApplyReport::default();
        let work = self.tree_work(scene, &changes);
        let trees = self.stage_trees(scene, &work, progress)?;
        let textures = stage_textures(scene, &changes, progress, &mut report)?;
        let environment = changes.environment.then(|| {
            let start = Instant::now();
            let light = Arc::new(self.environment_light(scene.environment(), &mut report));
            let cause = (Target::Environment, RebuildReason::Changed);
            note(&mut report, "environment sampling table".into(), cause, RebuildKind::Built, 1, start);
            light
        });
        let lights = changes.lights.then(|| self.stage_lights(scene, &mut report));
        if progress.is_cancelled() {
            return Err(BackendError::Cancelled);
        }
        Ok(Staged { changes, textures, work, trees, environment, lights, report })
    }

    /// The environment made ready; a placeholder, and a problem, for a shader that there is not.
    fn environment_light(&self, environment: &Environment, report: &mut ApplyReport) -> EnvironmentLight {
        let Environment::Shader(shaded) = environment else { return EnvironmentLight::new(environment) };
        self.shaders.environment(shaded).unwrap_or_else(|problem| {
            report.problems.push(format!("the environment: {}; a placeholder takes its place", problem.0));
            EnvironmentLight::new(environment)
        })
    }

    fn commit(&mut self, scene: &Scene, edits: &[Edit], staged: Staged) -> Result<ApplyReport, BackendError> {
        let Staged { changes, textures, work, trees, environment, lights, mut report } = staged;
        let touched = self.commit_objects(scene, (edits, &changes), &work, trees, &mut report)?;
        self.check_size()?;
        self.textures.extend(textures);
        self.textures.retain(|id, _| !changes.removed_textures.contains(id));
        if let Some(environment) = environment {
            self.environment = environment;
        }
        if let Some(lights) = lights {
            self.lights = lights;
        }
        self.update_tables(scene, &changes, &touched, &mut report);
        self.start_rebuilds(scene, &touched.worn);
        Ok(report)
    }
}

/// Why an update was refused, and what is left of it.
pub(crate) enum Refused {
    /// Nothing was changed.
    Untouched(BackendError),
    /// Some things were.
    Torn(BackendError),
}

fn stage_textures(
    scene: &Scene,
    changes: &Changes,
    progress: &Progress,
    report: &mut ApplyReport,
) -> Result<Vec<(TextureId, Arc<MipMap>)>, BackendError> {
    let textures: Vec<_> = changes.textures.iter().map(|id| (*id, &scene.textures()[id])).collect();
    let Some(&(first, _)) = textures.first() else { return Ok(Vec::new()) };
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
    let cause = (Target::Texture(first), RebuildReason::Changed);
    note(report, "texture pyramids".into(), cause, RebuildKind::Built, texels, start);
    Ok(built)
}

fn note(
    report: &mut ApplyReport,
    what: String,
    (cause, reason): Cause,
    kind: RebuildKind,
    primitives: u64,
    start: Instant,
) {
    let milliseconds = start.elapsed().as_secs_f64() * 1e3;
    report.rebuilt.push(Rebuilt { what, cause, reason, kind, primitives, milliseconds });
}
