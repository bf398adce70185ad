//! What the viewer needs of the program around it: scenes and file formats, of which it knows nothing itself.

use std::collections::BTreeMap;
use std::sync::Arc;

use heliostat_scene::{Backend, Camera, Frame, Progress, Scene, Timeline};

use crate::document::Refusal;

/// A scene to be opened.
#[derive(Clone, Debug)]
pub enum Source {
    /// A built-in scene or a file of this machine. Never comes from a page.
    Named(String),
    /// The contents of files that somebody gave us: not to be trusted.
    Upload {
        /// The file's name, to tell its format.
        name: String,
        /// Its contents.
        bytes: Arc<[u8]>,
        /// What came with it, by paths as the file may refer to them.
        beside: BTreeMap<String, Arc<[u8]>>,
    },
}

/// An opened scene, ready to be rendered.
pub struct Opened {
    /// What to call it; what [`crate::Replay::scene`] holds.
    pub title: String,
    /// Holds the scene.
    pub backend: Box<dyn Backend + Send>,
    /// The same scene, to read from.
    pub scene: Scene,
    /// How it moves.
    pub timeline: Timeline,
    /// The first view.
    pub home: Camera,
    /// What the user should know.
    pub notes: Vec<String>,
}

impl std::fmt::Debug for Opened {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Opened").field("title", &self.title).finish_non_exhaustive()
    }
}

/// The program around the viewer.
pub trait Host: Send + Sync {
    /// Opens a scene; tells how far it is and stops when it is cancelled.
    ///
    /// # Errors
    /// What the user should know when it cannot be opened.
    fn open(&self, source: &Source, progress: &Progress) -> Result<Opened, Refusal>;

    /// Packs linear radiance as an OpenEXR file.
    ///
    /// # Errors
    /// When the encoder refuses.
    fn to_exr(&self, frame: &Frame) -> Result<Vec<u8>, Refusal>;
}
