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
//! | `clip` | the number of the clip that was played; absent for a scene at rest |
//! | `keys` | views in order: `at` (seconds from the start), `time` (of the clip, seconds), `world_from_camera` (three columns, then the place), `vertical_fov` (radians) or `height` (metres, parallel) or `equidistant` or `equisolid` (fisheye, radians over the height) or none of them (panorama) |
//! | `changes` | in order: `at` (seconds; 0 is before the first picture) and the fields of a [`Change`] |

use glam::{Affine3A, Mat3A, Quat};
use heliostat_scene::{Camera, Edit, Projection, Scene};
use serde::{Deserialize, Serialize};

use crate::change::{Change, Own};
use crate::document::Refusal;

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
            lens: None,
            stereo: None,
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
        let matrix3 = Mat3A::from_quat(from.slerp(to, t).normalize());
        let world_from_camera = Affine3A { matrix3, translation: start.lerp(end, t) };
        Camera { world_from_camera, projection, ..a }
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
        let mut last: Vec<&Change> = Vec::new();
        for Timed { change, .. } in due {
            last.retain(|earlier| !earlier.same_target(change));
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
        let still = |last: &Key| last.world_from_camera == key.world_from_camera && last.time == key.time;
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

    pub(crate) fn change(&mut self, at: f64, change: Change) {
        if self.changes.len() < MAX_ENTRIES {
            self.changes.push(Timed { at, change });
        }
    }

    /// What was recorded so far.
    pub(crate) fn snapshot(&self) -> (Vec<Key>, Vec<Timed>) {
        (self.keys.clone(), self.changes.clone())
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use heliostat_scene::InstanceId;

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
