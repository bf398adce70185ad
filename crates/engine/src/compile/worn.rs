//! Trees that refitting has worn out: built anew at once where there is time for it, else in the background while the old
//! one goes on serving.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use heliostat_kernel::{BuildOptions, BuildProgress, Mesh, TriangleBvh};
use heliostat_scene::{ObjectId, Rebuilt, Scene};

use super::trees::kernel_meshes;
use super::{BuiltObject, Compiled};

/// Triangles per millisecond that a build is taken to manage before any was measured.
const FIRST_RATE: f64 = 2000.0;
/// Builds of fewer triangles say little about the rate.
const TELLING: u64 = 1000;

/// How fast builds are, and how long one may hold up an edit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    budget: f64,
    triangles_per_millisecond: f64,
}

impl Pace {
    /// `budget` in milliseconds.
    pub(super) fn new(budget: f64) -> Self {
        Self { budget, triangles_per_millisecond: FIRST_RATE }
    }

    /// Whether a build of so many triangles fits into the budget.
    pub(super) fn allows(&self, triangles: u64) -> bool {
        triangles as f64 <= self.budget * self.triangles_per_millisecond
    }

    /// Learns from a build.
    pub(super) fn learn(&mut self, built: &Rebuilt) {
        if built.primitives >= TELLING && built.milliseconds > 0.0 {
            let rate = built.primitives as f64 / built.milliseconds;
            self.triangles_per_millisecond += 0.3 * (rate - self.triangles_per_millisecond);
        }
    }
}

/// A tree being built in the background. Dropping it ends the work soon.
#[derive(Debug)]
pub(super) struct Pending {
    /// Over which triangles.
    indices: Vec<Arc<[[u32; 3]]>>,
    result: Arc<OnceLock<Option<TriangleBvh>>>,
    dropped: Arc<Stop>,
}

#[derive(Debug, Default)]
struct Stop(AtomicBool);

impl BuildProgress for Stop {
    fn fraction(&self, _: f32) {}

    fn cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        self.dropped.0.store(true, Ordering::Relaxed);
    }
}

impl Pending {
    fn start(pool: &rayon::ThreadPool, meshes: Vec<Mesh>) -> Self {
        let indices = meshes.iter().map(|mesh| mesh.indices.clone()).collect();
        let pending = Self { indices, result: Arc::default(), dropped: Arc::default() };
        let (result, stop) = (pending.result.clone(), pending.dropped.clone());
        pool.spawn(move || {
            let tree = TriangleBvh::build_with(&meshes, &BuildOptions::default(), &*stop);
            // A failure leaves the old tree in service.
            result.get_or_init(|| tree.ok());
        });
        pending
    }

    fn is_finished(&self) -> bool {
        // The worker lets go of its share right after it has delivered.
        self.result.get().is_some() && Arc::strong_count(&self.result) == 1
    }
}

/// The tree from the background, once it is there, if it is over these triangles.
pub(super) fn finished(pending: &mut Option<Pending>, indices: &[Arc<[[u32; 3]]>]) -> Option<TriangleBvh> {
    let mut pending = pending.take_if(|pending| pending.is_finished())?;
    let same = pending.indices.len() == indices.len()
        && pending.indices.iter().zip(indices).all(|(a, b)| Arc::ptr_eq(a, b) || a == b);
    let result = Arc::get_mut(&mut pending.result).and_then(OnceLock::take).flatten();
    result.filter(|_| same)
}

impl Compiled {
    /// Whether a tree from the background waits to be taken into service.
    pub(crate) fn has_finished(&self) -> bool {
        self.finished_objects().next().is_some()
    }

    pub(super) fn finished_objects(&self) -> impl Iterator<Item = ObjectId> {
        let finished = |built: &BuiltObject| built.pending.as_ref().is_some_and(Pending::is_finished);
        let waiting = self.rebuilding.iter().copied();
        waiting.filter(move |id| self.objects.get(id).is_some_and(finished))
    }

    /// Starts to build trees of objects anew.
    pub(super) fn start_rebuilds(&mut self, scene: &Scene, worn: &[ObjectId]) {
        let Compiled { objects, rebuilding, background, .. } = self;
        rebuilding.retain(|id| objects.get(id).is_some_and(|built| built.pending.is_some()));
        for id in worn {
            let Some(built) = objects.get_mut(id).filter(|built| built.pending.is_none()) else { continue };
            let pool = match background {
                Some(pool) => pool,
                None => {
                    let name = |_| "heliostat-rebuild".to_owned();
                    // Without a thread to spare the old tree goes on serving.
                    let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(1).thread_name(name).build()
                    else {
                        return;
                    };
                    background.insert(pool)
                }
            };
            built.pending = Some(Pending::start(pool, kernel_meshes(scene, &built.geometries)));
            rebuilding.insert(*id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use heliostat_scene::{RebuildKind, RebuildReason, Target};

    #[test]
    fn the_pace_follows_what_was_measured() {
        let mut pace = Pace::new(10.0);
        assert!(pace.allows(20_000) && !pace.allows(20_001));
        let built = |primitives, milliseconds| Rebuilt {
            what: String::new(),
            cause: Target::Environment,
            reason: RebuildReason::New,
            kind: RebuildKind::Built,
            primitives,
            milliseconds,
        };
        pace.learn(&built(10, 100.0));
        assert!(pace.allows(20_000), "tiny builds say nothing");
        (0..20).for_each(|_| pace.learn(&built(100_000, 100.0)));
        assert!(pace.allows(9_900) && !pace.allows(12_000));
    }
}
