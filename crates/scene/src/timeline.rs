//! Motion over time: what is known about how a scene moves, turned into edits.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;

use glam::Affine3A;

use crate::{Camera, CameraId, Edit, Geometry, GeometryId, InstanceId, Light, LightId, Mesh, Target};

/// How things move: a function from time to the state of everything it moves. Importers implement it.
pub trait Motion: fmt::Debug + Send + Sync {
    /// Seconds from the first to the last moment at which something changes.
    fn duration(&self) -> f64;

    /// Writes the state at `time`, in seconds from 0 to [`Self::duration`], of everything that any clip of the same
    /// [`Timeline`] moves: what this one leaves alone is written as it rests, so that clips can be switched.
    fn sample(&self, time: f64, pose: &mut Pose);

    /// What this motion itself moves, which may be less than what it writes. For lists and statistics.
    fn moves(&self) -> BTreeSet<Target> {
        let mut pose = Pose::default();
        self.sample(0.0, &mut pose);
        pose.targets()
    }
}

/// The state of moving things at one moment.
#[derive(Clone, Debug, Default)]
pub struct Pose {
    instances: BTreeMap<InstanceId, Affine3A>,
    shown: BTreeMap<InstanceId, bool>,
    meshes: BTreeMap<GeometryId, Arc<Mesh>>,
    lights: BTreeMap<LightId, Light>,
    cameras: BTreeMap<CameraId, Camera>,
}

impl Pose {
    /// Where an instance stands: its `parent_from_object`.
    pub fn instance(&mut self, id: InstanceId, parent_from_object: Affine3A) {
        self.instances.insert(id, parent_from_object);
    }

    /// Whether an instance is visible.
    pub fn show(&mut self, id: InstanceId, visible: bool) {
        self.shown.insert(id, visible);
    }

    /// A deforming mesh. While its triangles stay the same, share `indices` between the moments: its tree is then
    /// refitted, not rebuilt.
    pub fn mesh(&mut self, id: GeometryId, mesh: Arc<Mesh>) {
        self.meshes.insert(id, mesh);
    }

    /// A moving or changing light.
    pub fn light(&mut self, id: LightId, light: Light) {
        self.lights.insert(id, light);
    }

    /// A moving or changing camera.
    pub fn camera(&mut self, id: CameraId, camera: Camera) {
        self.cameras.insert(id, camera);
    }

    /// Everything this pose says something about.
    pub fn targets(&self) -> BTreeSet<Target> {
        let instances = self.instances.keys().chain(self.shown.keys()).copied().map(Target::Instance);
        let meshes = self.meshes.keys().copied().map(Target::Geometry);
        let lights = self.lights.keys().copied().map(Target::Light);
        let cameras = self.cameras.keys().copied().map(Target::Camera);
        instances.chain(meshes).chain(lights).chain(cameras).collect()
    }
}

/// A motion with a name.
#[derive(Clone, Debug)]
pub struct Clip {
    /// For people and the command line; need not be unique.
    pub name: String,
    /// Frames per second for which it was made, where the file says so.
    pub frame_rate: Option<f64>,
    /// What moves.
    pub motion: Arc<dyn Motion>,
}

/// Turns time into edits and sends only what changed since the last ones.
///
/// ```
/// use std::sync::Arc;
/// use glam::{Affine3A, Vec3};
/// use heliostat_scene::{Clip, InstanceId, Motion, Pose, Timeline};
///
/// #[derive(Debug)]
/// struct Rise;
/// impl Motion for Rise {
///     fn duration(&self) -> f64 {
///         2.0
///     }
///     fn sample(&self, time: f64, pose: &mut Pose) {
///         pose.instance(InstanceId(0), Affine3A::from_translation(Vec3::Y * time as f32));
///     }
/// }
///
/// let clip = Clip { name: "rise".into(), frame_rate: None, motion: Arc::new(Rise) };
/// let mut timeline = Timeline::new(vec![clip]);
/// assert_eq!(timeline.edits_at(1.0).len(), 1);
/// assert_eq!(timeline.edits_at(1.0).len(), 0); // nothing changed
/// assert_eq!(timeline.edits_at(9.0).len(), 1); // stays at the end
/// ```
#[derive(Clone, Debug, Default)]
pub struct Timeline {
    clips: Vec<Clip>,
    playing: usize,
    /// The state at the opening and the closing of the shutter that was last turned into edits.
    sent: Option<[Pose; 2]>,
}

impl Timeline {
    /// A timeline that plays the first of `clips`.
    pub fn new(clips: Vec<Clip>) -> Self {
        Self { clips, ..Self::default() }
    }

    /// The clips there are.
    pub fn clips(&self) -> &[Clip] {
        &self.clips
    }

    /// Whether nothing moves.
    pub fn is_empty(&self) -> bool {
        self.clips.is_empty()
    }

    /// The clip that plays.
    pub fn playing(&self) -> Option<&Clip> {
        self.clips.get(self.playing)
    }

    /// Plays another clip from the next edits on; `false` if there is none of that number.
    pub fn play(&mut self, clip: usize) -> bool {
        let exists = clip < self.clips.len();
        if exists {
            self.playing = clip;
        }
        exists
    }

    /// Seconds that the playing clip takes; 0 when nothing moves.
    pub fn duration(&self) -> f64 {
        self.playing().map_or(0.0, |clip| clip.motion.duration())
    }

    /// Everything that any clip may change; the rest of the scene never does.
    pub fn targets(&self) -> BTreeSet<Target> {
        let Some(clip) = self.playing() else { return BTreeSet::new() };
        let mut pose = Pose::default();
        clip.motion.sample(0.0, &mut pose);
        pose.targets()
    }

    /// What has to change for the scene to stand as at `time`, in seconds, clamped to the clip. The first call sends
    /// everything that moves.
    pub fn edits_at(&mut self, time: f64) -> Vec<Edit> {
        self.edits_over(time, time)
    }

    /// As [`Self::edits_at`], for a shutter that opens and closes at these times: instances, meshes and cameras
    /// move in between, linearly; lights and visibility are those of its opening.
    pub fn edits_over(&mut self, open: f64, close: f64) -> Vec<Edit> {
        let Some(clip) = self.clips.get(self.playing) else { return Vec::new() };
        let at = |time: f64| {
            let time = if time.is_finite() { time.clamp(0.0, clip.motion.duration()) } else { 0.0 };
            let mut pose = Pose::default();
            clip.motion.sample(time, &mut pose);
            (time, pose)
        };
        let (start, first) = at(open);
        let (end, last) = at(close);
        let last = if start == end { first.clone() } else { last };
        let now = [first, last];
        let edits = changes(self.sent.as_ref(), &now);
        self.sent = Some(now);
        edits
    }
}

/// The edits from one shutter interval to another.
fn changes(before: Option<&[Pose; 2]>, now: &[Pose; 2]) -> Vec<Edit> {
    let mut edits = Vec::new();
    let [open, close] = now;
    let moved = |id: &InstanceId| {
        before.is_none_or(|[a, b]| {
            a.instances.get(id) != open.instances.get(id) || b.instances.get(id) != close.instances.get(id)
        })
    };
    for (id, &from) in open.instances.iter().filter(|(id, _)| moved(id)) {
        edits.push(match close.instances.get(id) {
            Some(&to) if to != from => Edit::SweepInstance(*id, from, to),
            _ => Edit::MoveInstance(*id, from),
        });
    }
    for (id, &visible) in &open.shown {
        if before.is_none_or(|[a, _]| a.shown.get(id) != Some(&visible)) {
            edits.push(Edit::ShowInstance(*id, visible));
        }
    }
    for (id, mesh) in &open.meshes {
        // Triangles that are not the same ones at the end cannot move there.
        let movable = |end: &&Arc<Mesh>| {
            end.positions.len() == mesh.positions.len() && !same_shape(mesh, end) && same_triangles(mesh, end)
        };
        let end = close.meshes.get(id).filter(movable);
        let unchanged = |[a, b]: &[Pose; 2]| {
            let kept =
                |pose: &Pose, mesh: &Arc<Mesh>| pose.meshes.get(id).is_some_and(|m| same_shape(m, mesh));
            kept(a, mesh) && kept(b, end.unwrap_or(mesh))
        };
        if !before.is_some_and(unchanged) {
            let mesh = match end {
                None => mesh.clone(),
                Some(end) => Arc::new(mesh.moving_to(end)),
            };
            edits.push(Edit::Geometry(*id, Geometry::Mesh(mesh)));
        }
    }
    for (id, light) in &open.lights {
        if before.is_none_or(|[a, _]| a.lights.get(id) != Some(light)) {
            edits.push(Edit::Light(*id, light.clone()));
        }
    }
    for (id, camera) in &open.cameras {
        let mut camera = camera.clone();
        let end = close.cameras.get(id).map(|end| end.world_from_camera);
        camera.motion = end.filter(|end| *end != camera.world_from_camera);
        let unchanged = |[a, b]: &[Pose; 2]| {
            a.cameras.get(id) == open.cameras.get(id) && b.cameras.get(id) == close.cameras.get(id)
        };
        if !before.is_some_and(unchanged) {
            edits.push(Edit::Camera(*id, camera));
        }
    }
    edits
}

/// Whether two states of a deforming mesh look alike. Attributes other than positions and normals do not move.
fn same_shape(a: &Arc<Mesh>, b: &Arc<Mesh>) -> bool {
    Arc::ptr_eq(a, b) || (a.positions == b.positions && a.normals == b.normals && same_triangles(a, b))
}

fn same_triangles(a: &Mesh, b: &Mesh) -> bool {
    Arc::ptr_eq(&a.indices, &b.indices) || a.indices == b.indices
}
