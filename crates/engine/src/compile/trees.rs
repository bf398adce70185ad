//! Triangle trees of objects: built before anything is committed, or refitted when only vertices moved.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use heliostat_kernel as kernel;
use heliostat_kernel::{
    BuildError, BuildOptions, BuildProgress, KdOptions, KdTree, Quadrics, TriangleBvh, Triangles,
};
use heliostat_scene::{
    ApplyReport, BackendError, Geometry, GeometryId, Mesh, Object, ObjectId, Progress, RebuildKind,
    RebuildReason, Rebuilt, Scene, Target,
};
use heliostat_shading::kernel_quadric;
use rayon::prelude::*;

use super::changes::{Cause, Changes};
use super::{BuiltObject, Compiled};
use crate::engine::Accelerator;

/// Objects of fewer triangles are built side by side, one thread each.
const SMALL: u64 = 1 << 13;

/// What is to happen to an object's triangle tree.
#[derive(Debug)]
pub(super) struct TreeWork {
    pub(super) id: ObjectId,
    pub(super) cause: Cause,
    pub(super) triangles: u64,
    /// Keep the tree and move its vertices.
    pub(super) refit: bool,
}

/// A tree that was built ahead.
#[derive(Debug)]
pub(super) struct StagedTree {
    pub(super) triangles: Option<Triangles>,
    pub(super) report: Option<Rebuilt>,
    pub(super) warning: Option<String>,
}

impl Compiled {
    /// The objects whose triangle trees must be built or refitted.
    pub(super) fn tree_work(&self, scene: &Scene, changes: &Changes) -> Vec<TreeWork> {
        let mut causes: BTreeMap<ObjectId, Cause> = BTreeMap::new();
        for &id in &changes.objects {
            let geometries = || scene.objects()[&id].parts.iter().map(|part| part.geometry);
            match self.objects.get(&id) {
                None => _ = causes.insert(id, (Target::Object(id), RebuildReason::New)),
                Some(built) if !geometries().eq(built.geometries.iter().copied()) => {
                    causes.insert(id, (Target::Object(id), RebuildReason::Changed));
                }
                Some(_) => {}
            }
        }
        for &geometry in &changes.geometries {
            for &id in self.users.get(&geometry).into_iter().flatten() {
                if scene.objects().contains_key(&id) {
                    causes.entry(id).or_insert((Target::Geometry(geometry), RebuildReason::Changed));
                }
            }
        }
        for id in self.finished_objects() {
            // What the tree in the background was made for has stopped: take it into service all the same.
            if let Some(part) = scene.objects().get(&id).and_then(|object| object.parts.first()) {
                causes.entry(id).or_insert((Target::Geometry(part.geometry), RebuildReason::Worn));
            }
        }
        let work = |(id, cause): (ObjectId, Cause)| TreeWork {
            id,
            cause,
            triangles: meshes(scene, &scene.objects()[&id]).map(|mesh| mesh.indices.len() as u64).sum(),
            refit: matches!(cause.0, Target::Geometry(_)) && self.can_refit(scene, id),
        };
        causes.into_iter().map(work).collect()
    }

    /// Whether the tree still fits: the same triangles over other positions, and none left out when it was built.
    fn can_refit(&self, scene: &Scene, id: ObjectId) -> bool {
        let built = &self.objects[&id];
        let Some(Triangles::Bvh(tree)) = built.object.triangles() else { return false };
        let stats = tree.stats();
        let mut triangles = 0;
        let object = &scene.objects()[&id];
        if meshes(scene, object).count() != built.indices.len() {
            return false;
        }
        let same = meshes(scene, object).zip(&built.indices).all(|(mesh, indices)| {
            triangles += mesh.indices.len();
            Arc::ptr_eq(&mesh.indices, indices) || mesh.indices == *indices
        });
        let same_motion = built.moving == is_moving(scene, object);
        same && same_motion && stats.triangles == triangles
    }

    /// Builds all trees that are not refitted. Nothing of `self` changes, so it may be cancelled.
    pub(super) fn stage_trees(
        &self,
        scene: &Scene,
        work: &[TreeWork],
        progress: &Progress,
    ) -> Result<BTreeMap<ObjectId, StagedTree>, BackendError> {
        let builds = || work.iter().filter(|work| !work.refit);
        progress.start(builds().map(|work| work.triangles).sum());
        let (small, large): (Vec<_>, Vec<_>) = builds().partition(|work| work.triangles < SMALL);
        let build = |work: &&TreeWork| {
            if progress.is_cancelled() {
                return Err(BackendError::Cancelled);
            }
            Ok((work.id, build_tree(scene, work, self.accelerator, progress)?))
        };
        let mut staged: BTreeMap<_, _> = small.par_iter().map(build).collect::<Result<_, _>>()?;
        for work in &large {
            staged.extend([build(work)?]);
        }
        Ok(staged)
    }
}

impl BuiltObject {
    /// Remembers what the object's tree is made of.
    pub(super) fn remember(&mut self, scene: &Scene, id: ObjectId) {
        let object = &scene.objects()[&id];
        self.geometries = object.parts.iter().map(|part| part.geometry).collect();
        self.indices = meshes(scene, object).map(|mesh| mesh.indices.clone()).collect();
        self.moving = is_moving(scene, object);
    }
}

fn is_moving(scene: &Scene, object: &Object) -> bool {
    meshes(scene, object).any(|mesh| !mesh.motion.is_empty())
}

fn meshes<'a>(scene: &'a Scene, object: &'a Object) -> impl Iterator<Item = &'a Arc<Mesh>> {
    object.parts.iter().filter_map(|part| scene.geometries()[&part.geometry].as_mesh())
}

/// A tree over those of an object's parts that are spheres and cones, if there are any.
pub(super) fn kernel_quadrics(scene: &Scene, object: &Object) -> Result<Option<Arc<Quadrics>>, BuildError> {
    let lists: Vec<(u32, Vec<kernel::Quadric>)> = (0..)
        .zip(&object.parts)
        .filter_map(|(index, part)| match &scene.geometries()[&part.geometry] {
            Geometry::Mesh(_) => None,
            Geometry::Quadrics(list) => Some((index, list.shapes.iter().map(kernel_quadric).collect())),
        })
        .collect();
    if lists.is_empty() {
        return Ok(None);
    }
    Quadrics::build(lists.iter().map(|(index, shapes)| (*index, &shapes[..])))
        .map(|tree| Some(Arc::new(tree)))
}

/// An object's meshes as the kernel takes them; other shapes leave their numbers free.
pub(super) fn kernel_meshes(scene: &Scene, geometries: &[GeometryId]) -> Vec<kernel::Mesh> {
    let of = |&geometry: &GeometryId| {
        let Some(mesh) = scene.geometries()[&geometry].as_mesh() else { return kernel::Mesh::default() };
        let motion = (!mesh.motion.is_empty()).then(|| mesh.motion.clone());
        kernel::Mesh { positions: mesh.positions.clone(), indices: mesh.indices.clone(), motion }
    };
    geometries.iter().map(of).collect()
}

fn build_tree(
    scene: &Scene,
    work: &TreeWork,
    accelerator: Accelerator,
    progress: &Progress,
) -> Result<StagedTree, BackendError> {
    let start = Instant::now();
    let object = &scene.objects()[&work.id];
    let name = format!("{} ({:?})", work.id, object.name);
    let lost: usize = meshes(scene, object)
        .map(|mesh| mesh.positions.iter().chain(mesh.motion.iter()).filter(|p| !p.is_finite()).count())
        .sum();
    let warning = (lost > 0).then(|| {
        format!("{name}: {lost} vertices are not finite; the triangles that use them are not shown")
    });
    if work.triangles == 0 {
        return Ok(StagedTree { triangles: None, report: None, warning });
    }
    let geometries: Vec<_> = object.parts.iter().map(|part| part.geometry).collect();
    let meshes = kernel_meshes(scene, &geometries);
    let watched = TreeProgress { progress, triangles: work.triangles, done: AtomicU64::new(0) };
    let tree = match accelerator {
        Accelerator::Bvh => {
            TriangleBvh::build_with(&meshes, &BuildOptions::default(), &watched).map(Triangles::from)
        }
        Accelerator::KdTree => KdTree::build(&meshes, &KdOptions::default()).map(Triangles::from),
    };
    let triangles = Some(tree.map_err(|error| refused(&name, &error))?);
    watched.fraction(1.0);
    let report = Rebuilt {
        what: format!("triangle tree of {name}"),
        cause: work.cause.0,
        reason: work.cause.1,
        kind: RebuildKind::Built,
        primitives: work.triangles,
        milliseconds: start.elapsed().as_secs_f64() * 1e3,
    };
    Ok(StagedTree { triangles, report: Some(report), warning })
}

/// Adds what building a tree ahead had to tell.
pub(super) fn tell(staged: &mut StagedTree, report: &mut ApplyReport) {
    report.rebuilt.extend(staged.report.take());
    report.warnings.extend(staged.warning.take());
}

pub(super) fn refused(what: &str, error: &BuildError) -> BackendError {
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
