//! The scene that is looked at, with its history: what was changed can be undone and redone.

use std::collections::VecDeque;

use heliostat_scene::{
    ApplyReport, Backend, BackendError, Edit, Environment, Light, LightId, Progress, Scene, Timeline,
};

use crate::change::{Change, Own, Surroundings};

/// Most steps that can be undone; the oldest are forgotten.
const MAX_STEPS: usize = 500;

/// A scene in a backend, a copy of it to read from, and what the user changed in it.
pub(crate) struct Document {
    backend: Box<dyn Backend + Send>,
    scene: Scene,
    /// What the scene came with.
    own: Own,
    surroundings: Surroundings,
    undo: VecDeque<Step>,
    redo: Vec<Step>,
    /// What was changed so long ago that it cannot be undone any more.
    forgotten: Vec<Change>,
    /// How the scene moves by itself.
    pub(crate) timeline: Timeline,
}

/// Something the user did, as one step of the history.
struct Step {
    /// Changes of one gesture, such as a drag, make one step.
    gesture: u64,
    forward: Change,
    back: Change,
    /// The light that was there before, if the change is one of a light: with all that [`Change`] does not say of it.
    light: Option<Light>,
}

/// Why something could not be done; for the user.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct Refusal(pub String);

impl From<BackendError> for Refusal {
    fn from(error: BackendError) -> Self {
        Self(error.to_string())
    }
}

impl std::fmt::Debug for Document {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Document").field("undo", &self.undo.len()).finish_non_exhaustive()
    }
}

impl Document {
    /// A backend that holds `scene` already.
    pub(crate) fn new(backend: Box<dyn Backend + Send>, scene: Scene, timeline: Timeline) -> Self {
        let own = Own::of(&scene);
        Self {
            backend,
            scene,
            own,
            surroundings: Surroundings::default(),
            undo: VecDeque::new(),
            redo: Vec::new(),
            forgotten: Vec::new(),
            timeline,
        }
    }

    /// The scene as it is.
    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    /// For making pictures.
    pub(crate) fn backend(&mut self) -> &mut dyn Backend {
        &mut *self.backend
    }

    /// What surrounds the scene now.
    pub(crate) fn surroundings(&self) -> &Surroundings {
        &self.surroundings
    }

    /// The environment that the scene came with.
    pub(crate) fn own_environment(&self) -> &Environment {
        &self.own.environment
    }

    /// What undoing and redoing would do.
    pub(crate) fn history(&self) -> [Option<&'static str>; 2] {
        [self.undo.back(), self.redo.last()].map(|step| step.map(|step| step.forward.label()))
    }

    /// Everything the user has changed, in order; a later change of the same thing stands for the earlier ones.
    pub(crate) fn changes(&self) -> Vec<Change> {
        let mut changes: Vec<Change> = Vec::new();
        for change in self.forgotten.iter().chain(self.undo.iter().map(|step| &step.forward)) {
            changes.retain(|earlier| !earlier.same_target(change));
            changes.push(change.clone());
        }
        changes
    }

    /// Changes the scene. Changes of the same `gesture` in a row are undone together. Returns the change with all that
    /// makes it stand for itself.
    ///
    /// # Errors
    /// When the scene or the backend refuses; both are then as before.
    pub(crate) fn change(&mut self, change: Change, gesture: u64) -> Result<(Change, ApplyReport), Refusal> {
        let back = change.inverse(&self.scene, &self.surroundings).map_err(Refusal)?;
        let [change, back] = [change, back].map(|change| self.own.complete(change, &self.scene));
        let light = match &change {
            Change::Light { light, .. } => self.scene.lights().get(&LightId(*light)).cloned(),
            _ => None,
        };
        let report = self.perform(&change)?;
        self.redo.clear();
        let done = change.clone();
        match self.undo.back_mut() {
            Some(step) if step.gesture == gesture && step.forward.same_target(&change) => {
                step.forward = change;
            }
            _ => self.undo.push_back(Step { gesture, forward: change, back, light }),
        }
        if self.undo.len() > MAX_STEPS
            && let Some(step) = self.undo.pop_front()
        {
            self.forgotten.retain(|earlier| !earlier.same_target(&step.forward));
            self.forgotten.push(step.forward);
        }
        Ok((done, report))
    }

    /// Takes the last step back; `None` if there is none.
    ///
    /// # Errors
    /// As for [`Self::change`].
    pub(crate) fn undo(&mut self) -> Result<Option<(Change, ApplyReport)>, Refusal> {
        let Some(step) = self.undo.back() else { return Ok(None) };
        let done = step.back.clone();
        let report = match (&done, step.light.clone()) {
            (Change::Light { light, .. }, Some(before)) => {
                self.apply(&[Edit::Light(LightId(*light), before)])?
            }
            _ => self.perform(&done)?,
        };
        self.redo.extend(self.undo.pop_back());
        Ok(Some((done, report)))
    }

    /// Does again what was taken back last; `None` if there is nothing.
    ///
    /// # Errors
    /// As for [`Self::change`].
    pub(crate) fn redo(&mut self) -> Result<Option<(Change, ApplyReport)>, Refusal> {
        let Some(done) = self.redo.last().map(|step| step.forward.clone()) else { return Ok(None) };
        let report = self.perform(&done)?;
        self.undo.extend(self.redo.pop());
        Ok(Some((done, report)))
    }

    fn perform(&mut self, change: &Change) -> Result<ApplyReport, Refusal> {
        let edit = change.edit(&self.scene, &self.own).map_err(Refusal)?;
        let report = self.apply(&[edit])?;
        if let Change::Environment { to } = change {
            self.surroundings = to.clone();
        }
        Ok(report)
    }

    /// Applies edits that are no part of the history, such as those of the timeline.
    ///
    /// # Errors
    /// When the scene or the backend refuses; both are then as before.
    pub(crate) fn apply(&mut self, edits: &[Edit]) -> Result<ApplyReport, Refusal> {
        let applied = self.scene.apply(edits).map_err(|error| Refusal(error.to_string()))?;
        match self.backend.apply(edits, &Progress::new()) {
            Ok(report) => Ok(report),
            Err(error) => {
                self.scene.revert(applied);
                Err(error.into())
            }
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use heliostat_engine::{Engine, EngineOptions};
    use heliostat_scene::{InstanceId, LightKind, MaterialId};

    use super::*;
    use crate::change::{Lamp, Look};

    /// A built-in scene in the CPU engine.
    pub(crate) fn document(name: &str) -> Document {
        let edits = heliostat_builtin::build(name).expect("a built-in scene");
        let mut engine = Engine::new(EngineOptions::default()).expect("an engine");
        engine.apply(&edits, &Progress::new()).expect("valid edits");
        let scene = engine.scene().clone();
        Document::new(Box::new(engine), scene, heliostat_builtin::timeline(name))
    }

    fn moved(to: f32) -> Change {
        Change::place(InstanceId(0), glam::Affine3A::from_translation(glam::Vec3::X * to))
    }

    #[test]
    fn changes_can_be_undone_and_redone() {
        let mut document = document("cornell");
        let before = document.scene().to_edits();
        let look = Look { roughness: 0.25, ..Look::of(&document.scene().materials()[&MaterialId(0)]) };
        let lamp = Lamp::Point { position: [0.2; 3], intensity: [1.0; 3], range: None };
        let changes = [
            moved(0.5),
            Change::Show { instance: 1, visible: false },
            Change::Material { material: 0, look },
            Change::Light { light: 7, name: "new".into(), to: Some(lamp) },
            Change::Environment { to: Surroundings::Constant { radiance: [0.1; 3] } },
        ];
        for (gesture, change) in (0..).zip(&changes) {
            document.change(change.clone(), gesture).expect("accepted");
        }
        assert_eq!(document.changes(), changes);
        let after = format!("{:?}", document.scene().to_edits());
        assert!(document.scene().lights().contains_key(&LightId(7)));
        while document.undo().expect("accepted").is_some() {}
        assert_eq!(format!("{before:?}"), format!("{:?}", document.scene().to_edits()));
        assert_eq!((document.changes().len(), document.history()[1]), (0, Some("move object")));
        while document.redo().expect("accepted").is_some() {}
        assert_eq!(after, format!("{:?}", document.scene().to_edits()));
        assert_eq!(document.changes(), changes);
    }

    #[test]
    fn lights_come_back_as_they_were() {
        let mut document = document("cornell");
        let image = std::sync::Arc::new(heliostat_scene::Image::rgba8(1, 1, vec![9, 200, 30, 255]));
        // Not one that the scene came with: it is of the kind that a clip or another program brings.
        let kind = LightKind::Projector {
            position: glam::Vec3::ONE,
            world_from_light: glam::Mat3::from_rotation_y(0.7),
            intensity: glam::Vec3::splat(3.0),
            vertical_fov: 0.6,
            image,
            range: 7.0,
        };
        let light = Light { name: "beam".into(), kind };
        document.apply(&[Edit::Light(LightId(5), light.clone())]).expect("valid");
        let dim = Lamp::of(&light.kind).times(0.5).at(glam::Vec3::ZERO);
        let dimmed = Change::Light { light: 5, name: "beam".into(), to: Some(dim) };
        document.change(dimmed, 0).expect("accepted");
        let LightKind::Projector { vertical_fov, range, intensity, .. } =
            document.scene().lights()[&LightId(5)].kind
        else {
            panic!("it is still a projector")
        };
        assert_eq!((vertical_fov, range, intensity.x), (0.6, 7.0, 1.5));
        let remove = Change::Light { light: 5, name: String::new(), to: None };
        document.change(remove, 1).expect("accepted");
        assert!(!document.scene().lights().contains_key(&LightId(5)));
        // What is kept of it says all of it: a replay can bring it into the scene as it came.
        document.undo().expect("accepted").expect("a step");
        let text = serde_json::to_string(&document.changes()[0]).expect("JSON");
        let change: Change = serde_json::from_str(&text).expect("a change");
        let mut scene = Scene::default();
        scene.apply(&heliostat_builtin::build("cornell").expect("built in")).expect("valid");
        let edit = change.edit(&scene, &Own::of(&scene)).expect("it stands for itself");
        let whole = Edit::Light(LightId(5), document.scene().lights()[&LightId(5)].clone());
        assert_eq!(format!("{edit:?}"), format!("{whole:?}"));
        document.undo().expect("accepted").expect("a step");
        assert_eq!(document.scene().lights()[&LightId(5)], light);
        document.redo().expect("accepted").expect("a step");
        document.redo().expect("accepted").expect("a step");
        assert!(!document.scene().lights().contains_key(&LightId(5)));
    }

    #[test]
    fn a_drag_is_one_step() {
        let mut document = document("cornell");
        for i in 0..10 {
            document.change(moved(i as f32), 42).expect("accepted");
        }
        document.undo().expect("accepted").expect("a step");
        assert_eq!(document.scene().instances()[&InstanceId(0)].parent_from_object, glam::Affine3A::IDENTITY);
        assert_eq!(document.history()[0], None);
    }

    #[test]
    fn refused_changes_leave_everything_as_it_was() {
        let mut document = document("cornell");
        let before = format!("{:?}", document.scene().to_edits());
        let lamp = Lamp::Point { position: [0.2; 3], intensity: [-1.0; 3], range: None };
        for bad in [
            moved(f32::NAN),
            Change::Show { instance: 999, visible: true },
            Change::Light { light: 0, name: String::new(), to: Some(lamp) },
            Change::Light { light: 999, name: String::new(), to: None },
        ] {
            document.change(bad, 0).unwrap_err();
        }
        assert_eq!(before, format!("{:?}", document.scene().to_edits()));
        assert_eq!(document.history(), [None, None]);
    }

    #[test]
    fn forgotten_steps_stay_done() {
        let mut document = document("cornell");
        for i in 0..MAX_STEPS as u64 + 10 {
            document.change(moved(i as f32), i).expect("accepted");
        }
        assert_eq!(document.undo.len(), MAX_STEPS);
        assert_eq!(document.changes(), [moved(MAX_STEPS as f32 + 9.0)]);
    }
}
