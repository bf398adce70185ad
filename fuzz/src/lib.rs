//! What the fuzz targets share.

use heliostat_formats::{FileSource, Limits, load_bytes};
use heliostat_scene::Scene;

/// Small, so that a run notices at once when a limit does not hold.
pub fn limits() -> Limits {
    Limits {
        file_bytes: 1 << 24,
        memory_bytes: 1 << 26,
        vertices: 1 << 20,
        triangles: 1 << 20,
        image_pixels: 1 << 20,
        ..Limits::default()
    }
}

/// Loads a file. It may fail, but must not panic; if it succeeds, the edits must be valid, those of its motion too, and
/// every message must have something to say.
pub fn load(name: &str, bytes: &[u8], source: &dyn FileSource) {
    match load_bytes(name, bytes, source, &limits()) {
        Ok(mut loaded) => {
            let mut scene = Scene::default();
            scene.apply(&loaded.edits).expect("the edits of a load are valid");
            for clip in 0..loaded.timeline.clips().len().min(4) {
                loaded.timeline.play(clip);
                assert!(loaded.timeline.playing().expect("it plays").motion.moves().is_subset(&loaded.timeline.targets()));
                for share in [0.0, 0.3, 0.7, 1.0] {
                    let time = share * loaded.timeline.duration();
                    let edits = loaded.timeline.edits_over(time, time + 0.1);
                    scene.apply(&edits).expect("the edits of a motion are valid");
                }
            }
            assert!(loaded.diagnostics.iter().all(|diagnostic| !diagnostic.message.is_empty()));
        }
        Err(error) => {
            assert!(!error.problem().is_empty());
            if let Some(snippet) = error.snippet() {
                assert!(snippet.text.get(snippet.start..snippet.start + snippet.length).is_some());
            }
        }
    }
}
