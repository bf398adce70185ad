//! Replays of the viewer: its camera path and changes, frame by frame.

use std::path::Path;

use heliostat::scene::{Camera, Edit, Scene};
use heliostat_viewer::{Own, Replay};

use super::failure::Failure;

/// Largest file that is read, bytes.
const MAX_BYTES: u64 = 1 << 28;

/// A replay on its way.
pub(super) struct Playback {
    pub(super) replay: Replay,
    /// The moment up to which changes have been made.
    done: Option<f64>,
}

impl Playback {
    /// Reads a file that the viewer saved.
    ///
    /// # Errors
    /// When it cannot be read or is none.
    pub(super) fn load(path: &Path) -> Result<Self, Failure> {
        let failed = |problem: String| Failure::new(format!("{}: {problem}", path.display()));
        let size = std::fs::metadata(path).map_err(|error| failed(error.to_string()))?.len();
        if size > MAX_BYTES {
            return Err(failed(format!("{size} bytes; a replay has at most {MAX_BYTES}")));
        }
        let text = std::fs::read_to_string(path).map_err(|error| failed(error.to_string()))?;
        let replay = Replay::from_json(&text).map_err(|refusal| failed(refusal.0))?;
        Ok(Self { replay, done: None })
    }

    /// Frames from the first view to the last, both included.
    pub(super) fn frames(&self, frames_per_second: f64) -> u32 {
        (self.replay.duration() * frames_per_second).round() as u32 + 1
    }

    /// The moment of the clip that is shown at a moment of the recording.
    pub(super) fn clip_time(&self, at: f64) -> f64 {
        self.replay.view(at).map_or(0.0, |(_, time)| time)
    }

    /// The point of view at a moment.
    pub(super) fn camera(&self, at: f64) -> Option<Camera> {
        self.replay.view(at).map(|(camera, _)| camera)
    }

    /// What was changed since the moment asked for before, up to this one; `own` is of the scene as it
    /// came.
    ///
    /// # Errors
    /// When this is not the scene in which it was changed.
    pub(super) fn changes(&mut self, at: f64, scene: &Scene, own: &Own) -> Result<Vec<Edit>, Failure> {
        let edits = self.replay.edits(scene, own, self.done, at);
        self.done = Some(at);
        edits.map_err(|refusal| {
            Failure::new(format!("the replay does not fit this scene: {refusal}"))
                .with_help("give the scene that was looked at when it was saved")
        })
    }
}
