//! What a user did, as a file that `heliostat render --replay` renders: the camera's path and the changes.
//!
//! The file is JSON:
//!
//! | field | meaning |
//! |---|---|
//! | `heliostat` | `"replay"` |
//! | `version` | 1 |
//! | `scene` | what was looked at: a name or a file, for [`Replay::scene`] |
//! | `renderer`, `size`, `exposure`, `diffuse` | how it was looked at; no exposure lets the picture decide |
//! | `surfaces`, `effects`, `tone` | shaders by `name` and `parameters`: one in place of all others on surfaces, pixel shaders in order, the tone curve; absent where the picture was as usual |
//! | `clip` | the number of the clip that was played; absent for a scene at rest |
//! | `keys` | views in order: `at` (seconds from the start), `time` (of the clip, seconds), `world_from_camera` (three columns, then the place), `vertical_fov` (radians) or `height` (metres, parallel) or `equidistant` or `equisolid` (fisheye, radians over the height) or none of them (panorama); `lens`, `stereo` and `shader` (`name` and `parameters`, in place of the projection) where the camera has them |
//! | `changes` | in order: `at` (seconds; 0 is before the first picture) and the fields of a [`Change`] |

use std::sync::Arc;

use glam::{Affine3A, Mat3A, Quat};
use heliostat_scene::{Camera, Edit, Lens, Projection, Scene, Stereo, StereoView};
use serde::{Deserialize, Serialize};

use crate::change::{Change, Own};
use crate::document::Refusal;
use crate::style::Effect;

/// Most views of a path and most changes.
const MAX_ENTRIES: usize = 1_000_000;

/// A recording, or a single view with all changes so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Replay {
    heliostat: Kind,
    version: u32,
    /// What was looked at: a built-in scene's name or a file's.
    pub scene: String,
    /// The renderer's name.
    pub renderer: String,
    /// Columns and rows.
    pub size: [u32; 2],
    /// Stops; `None` lets the picture decide.
    #[serde(default)]
    pub exposure: Option<f32>,
    /// Whether all surfaces were shown as diffuse.
    #[serde(default)]
    pub diffuse: bool,
    /// The shader that all surfaces had instead of their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surfaces: Option<Effect>,
    /// The pixel shaders that pictures went through.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<Effect>,
    /// The tone curve, if it was not the usual one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tone: Option<Effect>,
    /// Which clip was played; `None` for a scene at rest.
    #[serde(default)]
    pub clip: Option<usize>,
    /// The path, at least one view, in order of time.
    pub keys: Vec<Key>,
    /// The changes, in order of time.
    #[serde(default)]
    pub changes: Vec<Timed>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Replay,
}

/// A view on the path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Key {
    /// Seconds from the start.
    pub at: f64,
    /// Seconds of the clip.
    #[serde(default)]
    pub time: f64,
    /// Three columns, then the place.
    pub world_from_camera: [f32; 12],
    /// Of a perspective view, radians.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertical_fov: Option<f32>,
    /// Of a parallel view, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<f32>,
    /// Of an equidistant fisheye, radians over the height.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equidistant: Option<f32>,
    /// Of an equisolid fisheye, radians over the height.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equisolid: Option<f32>,
    /// Depth of field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens: Option<KeyLens>,
    /// Two eyes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stereo: Option<KeyStereo>,
    /// A camera shader in place of the projection.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shader: Option<Effect>,
}

/// A lens as in [`Lens`], metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the fields are those of `Lens`")]
pub struct KeyLens {
    pub radius: f32,
    pub focus_distance: f32,
}

/// Two eyes as in [`Stereo`], metres; without a convergence they look along parallel axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the fields are those of `Stereo`")]
pub struct KeyStereo {
    pub separation: f32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub convergence: Option<f32>,
    pub view: KeyView,
}

/// See [`StereoView`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(missing_docs, reason = "the names are those of `StereoView`")]
pub enum KeyView {
    Left,
    Right,
    SideBySide,
    OverUnder,
}

impl From<Stereo> for KeyStereo {
    fn from(stereo: Stereo) -> Self {
        let Stereo { separation, convergence, view } = stereo;
        let view = match view {
            StereoView::Left => KeyView::Left,
            StereoView::Right => KeyView::Right,
            StereoView::SideBySide => KeyView::SideBySide,
            StereoView::OverUnder => KeyView::OverUnder,
        };
        Self { separation, convergence: convergence.is_finite().then_some(convergence), view }
    }
}

impl From<KeyStereo> for Stereo {
    fn from(stereo: KeyStereo) -> Self {
        let KeyStereo { separation, convergence, view } = stereo;
        let view = match view {
            KeyView::Left => StereoView::Left,
            KeyView::Right => StereoView::Right,
            KeyView::SideBySide => StereoView::SideBySide,
            KeyView::OverUnder => StereoView::OverUnder,
        };
        Self { separation, convergence: convergence.unwrap_or(f32::INFINITY), view }
    }
}

/// A change at a moment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timed {
    /// Seconds from the start; 0 is before the first picture.
    pub at: f64,
    /// What changed.
    #[serde(flatten)]
    pub change: Change,
}

impl Key {
    /// A view at a moment.
    pub fn new(at: f64, time: f64, camera: &Camera) -> Self {
        let world_from_camera = camera.world_from_camera.to_cols_array();
        let mut key = Self {
            at,
            time,
            world_from_camera,
            vertical_fov: None,
            height: None,
            equidistant: None,
            equisolid: None,
            lens: camera.lens.map(|Lens { radius, focus_distance }| KeyLens { radius, focus_distance }),
            stereo: camera.stereo.map(Into::into),
            shader: camera.shader.as_deref().and_then(Effect::of),
        };
        match camera.projection {
            Projection::Perspective { vertical_fov } => key.vertical_fov = Some(vertical_fov),
            Projection::Orthographic { height } => key.height = Some(height),
            Projection::FisheyeEquidistant { fov } => key.equidistant = Some(fov),
            Projection::FisheyeEquisolid { fov } => key.equisolid = Some(fov),
            Projection::Panoramic => {}
        }
        key
    }

    fn projection(&self) -> Projection {
        match (self.vertical_fov, self.height, self.equidistant, self.equisolid) {
            (Some(vertical_fov), ..) => Projection::Perspective { vertical_fov },
            (_, Some(height), ..) => Projection::Orthographic { height },
            (_, _, Some(fov), _) => Projection::FisheyeEquidistant { fov },
            (_, _, _, Some(fov)) => Projection::FisheyeEquisolid { fov },
            _ => Projection::Panoramic,
        }
    }

    /// The camera of this view.
    pub fn camera(&self) -> Camera {
        Camera {
            name: "replay".into(),
            world_from_camera: Affine3A::from_cols_array(&self.world_from_camera),
            motion: None,
            projection: self.projection(),
            lens: self.lens.map(|KeyLens { radius, focus_distance }| Lens { radius, focus_distance }),
            stereo: self.stereo.map(Into::into),
            shader: self.shader.as_ref().map(|shader| Arc::new(shader.shader())),
        }
    }

    fn between(&self, other: &Self, t: f32) -> Camera {
        let (a, b) = (self.camera(), other.camera());
        let place = |camera: &Camera| {
            let axes = camera.world_from_camera.matrix3;
            (Quat::from_mat3a(&axes), camera.world_from_camera.translation)
        };
        let ((from, start), (to, end)) = (place(&a), place(&b));
        let projection = match (a.projection, b.projection) {
            (Projection::Perspective { vertical_fov: x }, Projection::Perspective { vertical_fov: y }) => {
                Projection::Perspective { vertical_fov: x + t * (y - x) }
            }
            (Projection::Orthographic { height: x }, Projection::Orthographic { height: y }) => {
                Projection::Orthographic { height: x + t * (y - x) }
            }
            (first, _) => first,
        };
        let mix = |x: f32, y: f32| if x.is_finite() && y.is_finite() { x + t * (y - x) } else { x };
        let lens = match (a.lens, b.lens) {
            (Some(x), Some(y)) => Some(Lens {
                radius: mix(x.radius, y.radius),
                focus_distance: mix(x.focus_distance, y.focus_distance),
            }),
            (first, _) => first,
        };
        let stereo = match (a.stereo, b.stereo) {
            (Some(x), Some(y)) => Some(Stereo {
                separation: mix(x.separation, y.separation),
                convergence: mix(x.convergence, y.convergence),
                view: x.view,
            }),
            (first, _) => first,
        };
        let matrix3 = Mat3A::from_quat(from.slerp(to, t).normalize());
        let world_from_camera = Affine3A { matrix3, translation: start.lerp(end, t) };
        Camera { world_from_camera, projection, lens, stereo, ..a }
    }
}

impl Replay {
    /// A recording; `keys` must not be empty.
    pub fn new(scene: String, renderer: String, size: [u32; 2], keys: Vec<Key>, changes: Vec<Timed>) -> Self {
        Self {
            heliostat: Kind::Replay,
            version: 1,
            scene,
            renderer,
            size,
            exposure: None,
            diffuse: false,
            surfaces: None,
            effects: Vec::new(),
            tone: None,
            clip: None,
            keys,
            changes,
        }
    }

    /// Reads a file's text.
    ///
    /// # Errors
    /// When it is no such file, or contradicts itself.
    pub fn from_json(text: &str) -> Result<Self, Refusal> {
        let replay: Self =
            serde_json::from_str(text).map_err(|error| Refusal(format!("this is no replay: {error}")))?;
        let refuse = |problem: String| Err(Refusal(problem));
        if replay.version != 1 {
            return refuse(format!(
                "version {} of replays is not known; this program reads 1",
                replay.version
            ));
        }
        if replay.keys.is_empty() || replay.keys.len().max(replay.changes.len()) > MAX_ENTRIES {
            return refuse(format!("{} views; give 1 to {MAX_ENTRIES}", replay.keys.len()));
        }
        let times = replay.keys.iter().map(|key| key.at);
        let (mut last, changes) = (0.0, replay.changes.iter().map(|timed| timed.at));
        for at in times {
            if !(at >= last && at < 1e7) {
                return refuse(format!("a view at {at} s after one at {last} s; give times in order from 0"));
            }
            last = at;
        }
        let mut last = 0.0;
        for at in changes {
            if !(at >= last && at < 1e7) {
                return refuse(format!(
                    "a change at {at} s after one at {last} s; give times in order from 0"
                ));
            }
            last = at;
        }
        if let Some(problem) = replay.keys.iter().find_map(|key| key.camera().problem()) {
            return refuse(format!("a view: {problem}"));
        }
        if let Some(problem) = replay.keys.iter().find_map(|key| key.shader.as_ref()?.problem()) {
            return refuse(format!("a view's shader: {problem}"));
        }
        Ok(replay)
    }

    /// The file's text.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// Seconds from the first view to the last.
    pub fn duration(&self) -> f64 {
        self.keys.last().map_or(0.0, |key| key.at)
    }

    /// The camera and the clip's time at a moment; before the first view and after the last it stands still.
    pub fn view(&self, at: f64) -> Option<(Camera, f64)> {
        let next = self.keys.partition_point(|key| key.at <= at);
        let before = self.keys.get(next.saturating_sub(1))?;
        let Some(after) = self.keys.get(next).filter(|_| next > 0) else {
            return Some((before.camera(), before.time));
        };
        let t = ((at - before.at) / (after.at - before.at).max(1e-9)).clamp(0.0, 1.0);
        // Where the clip began anew there is nothing in between.
        let time =
            if after.time < before.time { before.time } else { before.time + t * (after.time - before.time) };
        Some((before.between(after, t as f32), time))
    }

    /// The edits that make the changes after `from` up to `to`; from the very start, with those of moment 0, when `from`
    /// is `None`. `own` is of the scene as it came.
    ///
    /// # Errors
    /// When the scene has not what was changed.
    pub fn edits(&self, scene: &Scene, own: &Own, from: Option<f64>, to: f64) -> Result<Vec<Edit>, Refusal> {
        let due =
            self.changes.iter().filter(|timed| from.is_none_or(|from| timed.at > from) && timed.at <= to);
        // Edits of one list see the scene as it was: of several for one thing the last must stand alone.
        let mut last: Vec<Change> = Vec::new();
        for Timed { change, .. } in due {
            let mut change = change.clone();
            last.retain(|earlier| {
                let same = earlier.same_target(&change);
                if same {
                    change.lengthen(earlier);
                }
                !same
            });
            last.push(change);
        }
        last.into_iter().map(|change| change.edit(scene, own).map_err(Refusal)).collect()
    }
}

/// Records what happens.
#[derive(Debug, Default)]
pub(crate) struct Recorder {
    keys: Vec<Key>,
    changes: Vec<Timed>,
}

/// Longest recording, seconds, and most views of it in a second.
const MAX_SECONDS: f64 = 1800.0;
const MAX_RATE: f64 = 30.0;

impl Recorder {
    /// Begins with what was changed before.
    pub(crate) fn new(changes: Vec<Change>) -> Self {
        let changes = changes.into_iter().map(|change| Timed { at: 0.0, change }).collect();
        Self { keys: Vec::new(), changes }
    }

    /// Notes a view; `false` when the recording has become too long and ends here.
    pub(crate) fn view(&mut self, key: Key) -> bool {
        // All but the moment is the same.
        let still = |last: &Key| Key { at: last.at, ..key.clone() } == *last;
        let dense = |last: &Key| key.at - last.at < 1.0 / MAX_RATE;
        // Of a stretch without motion the two ends are enough.
        if let [.., a, b] = &mut self.keys[..]
            && still(a)
            && still(b)
        {
            b.at = key.at;
        } else if !self.keys.last().is_some_and(dense) {
            self.keys.push(key);
            return self.keys.last().is_some_and(|key| key.at < MAX_SECONDS);
        }
        true
    }

    /// Notes a change. What a light is made of is noted once, not with every step of a drag.
    pub(crate) fn change(&mut self, at: f64, mut change: Change) {
        if self.changes.len() >= MAX_ENTRIES {
            return;
        }
        if let Change::Light { to: Some(_), .. } = &change {
            let earlier = || self.changes.iter().rev().map(|timed| &timed.change);
            let mut of_light = earlier().filter(|earlier| earlier.same_target(&change));
            // Those that say less have been shortened by the one before them.
            let known = of_light.find(|earlier| !earlier.is_short()).cloned();
            known.iter().for_each(|known| change.shorten(known));
        }
        self.changes.push(Timed { at, change });
    }

    /// Length so far.
    pub(crate) fn seconds(&self) -> f64 {
        self.keys.last().map_or(0.0, |key| key.at)
    }

    /// What was recorded so far.
    pub(crate) fn snapshot(&self) -> (Vec<Key>, Vec<Timed>) {
        (self.keys.clone(), self.changes.clone())
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use heliostat_scene::{InstanceId, ShaderUse};

    use super::*;

    fn key(at: f64, time: f64, x: f32) -> Key {
        let eye = Vec3::new(x, 0.0, 5.0);
        Key::new(at, time, &Camera::look_at("", eye, eye + Vec3::NEG_Z, Vec3::Y, 0.8))
    }

    fn replay() -> Replay {
        let place = |x| Change::place(InstanceId(0), Affine3A::from_translation(Vec3::X * x));
        let changes = [(0.0, 1.0), (0.5, 2.0), (0.5, 3.0)];
        let changes = changes.map(|(at, x)| Timed { at, change: place(x) }).to_vec();
        let keys = vec![key(0.0, 0.0, 0.0), key(1.0, 2.0, 4.0), key(2.0, 0.5, 4.0)];
        Replay::new("cornell".into(), "igi".into(), [64, 48], keys, changes)
    }

    #[test]
    fn files_come_back_as_they_were_written() {
        let replay = replay();
        assert_eq!(Replay::from_json(&replay.to_json()).expect("valid"), replay);
        let broken = |from: &str, to: &str| Replay::from_json(&replay.to_json().replacen(from, to, 1));
        assert!(broken("\"version\": 1", "\"version\": 9").unwrap_err().0.contains("version 9"));
        assert!(broken("\"at\": 1.0", "\"at\": 7.0").unwrap_err().0.contains("in order"));
        assert!(broken("\"place\"", "\"plaice\"").is_err());
        assert!(Replay::from_json("{}").is_err());
        assert!(Replay { keys: Vec::new(), ..replay.clone() }.to_json().contains("keys"));
    }

    #[test]
    fn views_are_interpolated_and_changes_come_in_time() {
        let replay = replay();
        let x = |at| replay.view(at).map(|(camera, time)| (camera.world_from_camera.translation.x, time));
        assert_eq!(x(-1.0), Some((0.0, 0.0)));
        assert_eq!(x(0.25), Some((1.0, 0.5)));
        assert_eq!(x(1.5), Some((4.0, 2.0)), "the clip began anew");
        assert_eq!(x(9.0), Some((4.0, 0.5)));
        let mut scene = Scene::default();
        scene.apply(&heliostat_builtin::build("cornell").expect("built in")).expect("valid");
        let edits = |from, to| {
            let edits = replay.edits(&scene, &Own::default(), from, to).expect("it has the instance");
            edits
                .iter()
                .map(|edit| match edit {
                    Edit::MoveInstance(_, place) => place.translation.x,
                    _ => f32::NAN,
                })
                .collect::<Vec<_>>()
        };
        assert_eq!((edits(None, 0.0), edits(Some(0.0), 0.6)), (vec![1.0], vec![3.0]));
        assert!(edits(Some(0.6), 9.0).is_empty());
    }

    #[test]
    fn foreign_lights_are_told_once_and_whole() {
        use heliostat_scene::{Image, Light, LightId, LightKind};
        let image = Arc::new(Image::rgba8(1, 1, vec![9, 200, 30, 255]));
        let beam = |x: f32| LightKind::Projector {
            position: Vec3::X * x,
            world_from_light: glam::Mat3::IDENTITY,
            intensity: Vec3::ONE,
            vertical_fov: 0.6,
            image: image.clone(),
            range: f32::INFINITY,
        };
        let mut scene = Scene::default();
        scene.apply(&heliostat_builtin::build("cornell").expect("built in")).expect("valid");
        let own = Own::of(&scene);
        let mut with = scene.clone();
        with.apply(&[Edit::Light(LightId(7), Light { name: "beam".into(), kind: beam(0.0) })])
            .expect("valid");
        let moved = |x: f32| {
            let to = Some(crate::change::Lamp::of(&beam(x)));
            own.complete(Change::Light { light: 7, name: "beam".into(), to }, &with)
        };
        let removed = Change::Light { light: 7, name: String::new(), to: None };
        let mut recorder = Recorder::new(Vec::new());
        recorder.view(key(0.0, 0.0, 0.0));
        for (at, change) in
            [(0.1, moved(1.0)), (0.2, moved(2.0)), (0.3, moved(3.0)), (0.4, removed), (0.5, moved(4.0))]
        {
            recorder.change(at, change);
        }
        let (keys, changes) = recorder.snapshot();
        let replay = Replay::new("cornell".into(), "igi".into(), [64, 48], keys, changes);
        let text = replay.to_json();
        assert_eq!(text.matches("rgba8").count(), 2, "told when it comes, and when it comes again: {text}");
        let replay = Replay::from_json(&text).expect("valid");
        let edits = |scene: &Scene, from, to| replay.edits(scene, &own, from, to).expect("it is whole");
        let light = |x: f32| {
            format!("{:?}", vec![Edit::Light(LightId(7), Light { name: "beam".into(), kind: beam(x) })])
        };
        // All at once into the scene as it came, step by step, and anew after it was gone.
        assert_eq!(format!("{:?}", edits(&scene, None, 0.35)), light(3.0));
        assert_eq!(format!("{:?}", edits(&with, Some(0.15), 0.25)), light(2.0));
        assert_eq!(format!("{:?}", edits(&scene, Some(0.35), 0.6)), light(4.0));
    }

    #[test]
    fn lenses_and_pairs_of_eyes_are_kept() {
        let mut replay = replay();
        let camera = |focus: f32, convergence: f32| {
            let view = StereoView::SideBySide;
            let mut camera = key(0.0, 0.0, 0.0).camera();
            camera.lens = Some(Lens { radius: 0.02, focus_distance: focus });
            camera.stereo = Some(Stereo { separation: 0.064, convergence, view });
            camera
        };
        replay.keys = vec![Key::new(0.0, 0.0, &camera(2.0, 3.0)), Key::new(1.0, 0.0, &camera(4.0, 5.0))];
        replay.effects = vec![Effect::named("edges")];
        let read = Replay::from_json(&replay.to_json()).expect("valid");
        assert_eq!(read, replay);
        let (middle, _) = read.view(0.5).expect("a view");
        assert_eq!(middle.lens.map(|lens| lens.focus_distance), Some(3.0));
        assert_eq!(middle.stereo.map(|stereo| stereo.convergence), Some(4.0));
        // Parallel axes meet nowhere, which no number in the file says.
        replay.keys = vec![Key::new(0.0, 0.0, &camera(2.0, f32::INFINITY))];
        let read = Replay::from_json(&replay.to_json()).expect("valid");
        assert_eq!(
            read.view(0.0).expect("a view").0,
            Camera { name: "replay".into(), ..camera(2.0, f32::INFINITY) }
        );
        let ripples = ShaderUse::named("ripples").with("count", 3.0).with("axis", Vec3::X);
        let shaded = Camera { shader: Some(Arc::new(ripples)), ..camera(2.0, 3.0) };
        replay.keys = vec![Key::new(0.0, 0.0, &shaded), Key::new(1.0, 0.0, &shaded)];
        let read = Replay::from_json(&replay.to_json()).expect("valid");
        assert_eq!(read.view(0.5).expect("a view").0.shader, shaded.shader);
        replay.keys[1].shader = Some(Effect::named("x".repeat(1000)));
        assert!(Replay::from_json(&replay.to_json()).is_err());
        replay.keys[1].shader = None;
        replay.keys[0].lens = Some(KeyLens { radius: -1.0, focus_distance: 1.0 });
        assert!(Replay::from_json(&replay.to_json()).is_err());
    }

    #[test]
    fn recordings_stay_small_while_nothing_moves() {
        let mut recorder = Recorder::new(Vec::new());
        for i in 0..1000 {
            assert!(recorder.view(key(f64::from(i) * 0.05, 0.0, 1.0)));
        }
        assert!(recorder.view(key(60.0, 0.0, 2.0)));
        assert!(!recorder.view(key(MAX_SECONDS, 0.0, 3.0)));
        let (keys, _) = recorder.snapshot();
        assert_eq!(keys.iter().map(|key| key.at).collect::<Vec<_>>(), [0.0, 49.95, 60.0, MAX_SECONDS]);
    }
}
