//! A scene on show: the view, what is selected, time, and what each input does to them.

use std::time::Instant;

use glam::{Vec2, Vec3};
use heliostat_scene::{
    ApplyReport, Backend, Camera, FrameRequest, InstanceId, Plane, Projection, SceneBounds,
};

use crate::change::{Change, Lamp};
use crate::document::{Document, Refusal};
use crate::geometry::{object_bounds, ray_through};
use crate::gizmo::{self, GizmoMode};
use crate::governor::Goal;
use crate::hand::Hand;
use crate::host::Opened;
use crate::input::{Input, Selection, point};
use crate::navigator::Navigator;
use crate::pick::{Pick, look_along, pick};
use crate::placed::{holders, holders_hit};
use crate::replay::{Key, Recorder, Replay};
use crate::state::{self, SceneState};
use crate::style::{self, Finish, ShaderChoice, Style, false_colors, pixel_shaders};

/// Frames per second that the governor holds unless told otherwise.
const DEFAULT_GOAL: f32 = 15.0;
/// Most and least columns or rows of a picture, and most pixels.
const EDGES: [u32; 2] = [16, 8192];
const MAX_PIXELS: u64 = 1 << 23;
/// Radiance that a picture shows as a middle grey, at 0 stops.
const MIDDLE_GREY: f32 = 0.18;
/// Gestures of the stage's own, beyond those that users number.
const OWN_GESTURES: u64 = 1 << 62;

/// What inputs change.
#[derive(Debug)]
pub(crate) struct Stage {
    pub(crate) title: String,
    pub(crate) document: Document,
    pub(crate) navigator: Navigator,
    home: Camera,
    bounds: Option<SceneBounds>,
    pub(crate) size: [u32; 2],
    pub(crate) renderer: String,
    pub(crate) plane: Option<Plane>,
    style: Style,
    /// The style, ready for pictures.
    pub(crate) finish: Finish,
    choices: [Vec<ShaderChoice>; 2],
    pub(crate) exposure: Option<f32>,
    /// Stops by which the picture on show was brightened.
    pub(crate) shown_exposure: f32,
    pub(crate) goal: Goal,
    pub(crate) selection: Option<Selection>,
    /// The box of the selected instance's object, in its own space.
    pub(crate) selected_box: Option<SceneBounds>,
    pub(crate) gizmo: GizmoMode,
    pub(crate) hand: Hand,
    pub(crate) gestures: u64,
    pub(crate) playing: bool,
    clip: usize,
    pub(crate) time: f64,
    rate: f64,
    /// Whether the timeline has said anything yet: until then the scene is at rest.
    pub(crate) plays: bool,
    recording: Option<Recording>,
}

/// A recording that goes on, or has ended.
#[derive(Debug)]
struct Recording {
    start: Instant,
    goes_on: bool,
    recorder: Recorder,
}

/// What an input did to the picture.
#[derive(Debug, Default)]
pub(crate) struct Effect {
    /// It looks different now.
    pub(crate) picture: bool,
    /// The lines over it do.
    pub(crate) lines: bool,
    /// What was rebuilt.
    pub(crate) report: Option<ApplyReport>,
}

impl Effect {
    pub(crate) const NONE: Self = Self { picture: false, lines: false, report: None };
    const LINES: Self = Self { lines: true, ..Self::NONE };
    pub(crate) const PICTURE: Self = Self { picture: true, ..Self::NONE };

    fn applied(report: ApplyReport) -> Self {
        Self { picture: true, lines: true, report: Some(report) }
    }
}

impl Stage {
    pub(crate) fn new(opened: Opened, size: [u32; 2], renderer: &str) -> Result<Self, Refusal> {
        let Opened { title, backend, scene, timeline, home, .. } = opened;
        let bounds = scene.bounds();
        let document = Document::new(backend, scene, timeline);
        let mut stage = Self {
            navigator: Navigator::new(&home, bounds.as_ref()),
            playing: !document.timeline.is_empty(),
            title,
            document,
            home,
            bounds,
            size,
            renderer: renderer.into(),
            plane: None,
            finish: Style::default().bind()?,
            style: Style::default(),
            choices: [false_colors(), pixel_shaders()],
            exposure: None,
            shown_exposure: 0.0,
            goal: Goal { frames_per_second: Some(DEFAULT_GOAL) },
            selection: None,
            selected_box: None,
            gizmo: GizmoMode::default(),
            hand: Hand::default(),
            gestures: OWN_GESTURES,
            clip: 0,
            time: 0.0,
            rate: 1.0,
            plays: false,
            recording: None,
        };
        let names = stage.document.backend().renderers();
        if let Some(first) = names.first().filter(|_| !names.contains(&renderer)) {
            stage.renderer = (*first).into();
        }
        Ok(stage)
    }

    pub(crate) fn aspect(&self) -> f32 {
        self.size[0] as f32 / self.size[1] as f32
    }

    /// Does what a user asked for.
    pub(crate) fn handle(&mut self, input: Input) -> Result<Effect, Refusal> {
        let nav = &mut self.navigator;
        match input {
            Input::Size { width, height } => return Ok(self.resize([width, height])),
            Input::Pointer { phase, at, button } => return self.pointer(phase, point(at), button),
            Input::Pan { by } => nav.pan(point(by)),
            Input::Zoom { steps } => nav.zoom(steps),
            Input::Drive { way, hurry } => nav.drive(way.into(), hurry),
            Input::Mode { mode } => nav.set_mode(mode),
            Input::Camera { index } => {
                let camera = self.document.scene().cameras().values().nth(index as usize);
                let Some(camera) = camera else { return Err(Refusal(format!("there is no camera {index}"))) };
                nav.jump(camera);
            }
            Input::Home => *nav = Navigator::new(&self.home, self.bounds.as_ref()),
            Input::View { text } => {
                if !nav.restore(&text) {
                    return Err(Refusal("this address holds no view".into()));
                }
            }
            Input::Field { degrees } => nav.set_field(degrees.to_radians()),
            Input::Focus { at } => return self.focus(at.map(point)),
            Input::Select { what } => return Ok(self.select(what)),
            Input::SelectHolder => return Ok(self.select_holder()),
            Input::Gizmo { mode } => {
                self.gizmo = mode;
                return Ok(Effect::LINES);
            }
            Input::Change { change, gesture } => return self.change(change, gesture % OWN_GESTURES),
            Input::AddLight => return self.add_light(),
            Input::Undo => return self.step_back(),
            Input::Redo => return self.step_again(),
            Input::Play { playing } => {
                self.playing = playing && !self.document.timeline.is_empty();
                return Ok(Effect::NONE);
            }
            Input::Seek { time } => return self.seek(time),
            Input::Clip { index } => return self.play_clip(index as usize),
            Input::Rate { rate } => {
                self.rate = rate.clamp(-100.0, 100.0);
                return Ok(Effect::NONE);
            }
            Input::Renderer { name } => {
                if !self.document.backend().renderers().contains(&name.as_str()) {
                    return Err(Refusal(format!("there is no renderer `{name}`")));
                }
                self.renderer = name;
            }
            Input::Show { plane } => {
                let found = |name: &str| Plane::ALL.into_iter().find(|plane| plane.name() == name);
                self.plane = match plane {
                    None => None,
                    Some(name) => {
                        let unknown = || Refusal(format!("there is no plane `{name}`"));
                        Some(found(&name).ok_or_else(unknown)?)
                    }
                };
            }
            Input::Diffuse { on } => {
                return self.restyle(Style { diffuse: on, surfaces: None, ..self.style.clone() });
            }
            Input::Surfaces { shader } => {
                let surfaces = shader.map(|effect| self.sized(effect));
                return self.restyle(Style { diffuse: false, surfaces, ..self.style.clone() });
            }
            Input::Effects { shaders } => {
                return self.restyle(Style { effects: shaders, ..self.style.clone() });
            }
            Input::Tone { curve } => return self.restyle(Style { tone: curve, ..self.style.clone() }),
            Input::Plain => {
                (self.plane, self.exposure) = (None, None);
                return self.restyle(Style::default());
            }
            Input::Exposure { stops } => self.exposure = stops.map(|ev| ev.clamp(-30.0, 30.0)),
            Input::Goal { frames_per_second } => self.goal = Goal { frames_per_second },
            Input::Record { on } => {
                // Where it begins and ends is part of it, even if no picture is made in between.
                let camera = self.navigator.camera();
                if on {
                    let recorder = Recorder::new(self.document.changes());
                    self.recording = Some(Recording { start: Instant::now(), goes_on: true, recorder });
                }
                self.record(&camera);
                if let Some(recording) = self.recording.as_mut().filter(|_| !on) {
                    recording.goes_on = false;
                }
                return Ok(Effect::NONE);
            }
            Input::Forget => {
                self.recording = None;
                return Ok(Effect::NONE);
            }
        }
        Ok(Effect::PICTURE)
    }

    /// Shows pictures another way; if that is not possible, all stays as it is.
    fn restyle(&mut self, style: Style) -> Result<Effect, Refusal> {
        self.finish = style.bind()?;
        self.style = style;
        Ok(Effect::PICTURE)
    }

    /// Distances are shown from the nearest to the furthest that there is from here, unless the user says otherwise.
    fn sized(&self, mut effect: style::Effect) -> style::Effect {
        let Some(bounds) = self.bounds.filter(|_| effect.name == "show-depth") else { return effect };
        let eye = Vec3::from(self.navigator.camera().world_from_camera.translation);
        let (middle, radius) = (eye.distance(bounds.center()), bounds.radius());
        for (name, distance) in [("near", (middle - radius).max(0.0)), ("far", (middle + radius).max(1e-6))] {
            if distance.is_finite() {
                effect.parameters.entry(name.into()).or_insert(style::Setting::Number(distance));
            }
        }
        effect
    }

    fn resize(&mut self, [width, height]: [u32; 2]) -> Effect {
        let [least, most] = EDGES;
        let (mut width, mut height) = (width.clamp(least, most), height.clamp(least, most));
        let pixels = u64::from(width) * u64::from(height);
        if pixels > MAX_PIXELS {
            let shrink = (MAX_PIXELS as f64 / pixels as f64).sqrt();
            (width, height) = ((f64::from(width) * shrink) as u32, (f64::from(height) * shrink) as u32);
        }
        let changed = self.size != [width, height];
        self.size = [width, height];
        Effect { picture: changed, ..Effect::NONE }
    }

    fn pick_at(&mut self, at: Vec2) -> Result<Option<Pick>, Refusal> {
        let (camera, aspect) = (self.navigator.camera(), self.aspect());
        Ok(pick(self.document.backend(), &camera, at, aspect)?)
    }

    /// Selects the light or the thing under the pointer.
    pub(crate) fn select_at(&mut self, at: Vec2) -> Result<Effect, Refusal> {
        let (camera, aspect) = (self.navigator.camera(), self.aspect());
        let mut lights = self.document.scene().lights().iter();
        let light = lights.find(|(_, light)| {
            let position = Lamp::of(&light.kind).position();
            position.is_some_and(|position| gizmo::on_light(&camera, aspect, position, at))
        });
        if let Some((id, _)) = light {
            let light = id.0;
            return Ok(self.select(Some(Selection::Light { light })));
        }
        let ray = ray_through(&camera, at, aspect);
        let found = self.pick_at(at)?;
        let scene = self.document.scene();
        let instance = |pick: Pick| Selection::Instance {
            instance: pick.instance.0,
            material: Some(pick.material.0),
            holders: holders_hit(scene, pick.instance, &ray, pick.distance),
        };
        let what = found.map(instance);
        Ok(self.select(what))
    }

    fn select(&mut self, what: Option<Selection>) -> Effect {
        let scene = self.document.scene();
        self.selection = what.filter(|what| state::selected(scene, what).is_some());
        self.selected_box = match &self.selection {
            Some(Selection::Instance { instance, .. }) => {
                scene.instances().get(&InstanceId(*instance)).and_then(|i| object_bounds(scene, i.object))
            }
            _ => None,
        };
        Effect::LINES
    }

    fn select_holder(&mut self) -> Effect {
        let Some(Selection::Instance { instance, material, holders: wanted }) = &self.selection else {
            return Effect::NONE;
        };
        let around = holders(self.document.scene(), InstanceId(*instance), wanted);
        let Some((first, rest)) = around.split_first() else { return Effect::NONE };
        let holders = rest.iter().map(|id| id.0).collect();
        self.select(Some(Selection::Instance { instance: first.0, material: *material, holders }))
    }

    fn focus(&mut self, at: Option<Vec2>) -> Result<Effect, Refusal> {
        let target = match at {
            Some(at) => self.pick_at(at)?.map(|pick| (pick.position, None)),
            None => self.handles().map(|handles| {
                (handles.origin, self.selected_box.map(|bounds| bounds.radius() * self.selected_scale()))
            }),
        };
        let Some((point, radius)) = target else {
            return Err(Refusal("nothing to look at: select something first".into()));
        };
        self.navigator.focus(point, radius);
        Ok(Effect::PICTURE)
    }

    /// By how much the selected instance is larger than its object.
    fn selected_scale(&self) -> f32 {
        self.selected_place().map_or(1.0, |place| place.matrix3.determinant().abs().cbrt())
    }

    pub(crate) fn change(&mut self, change: Change, gesture: u64) -> Result<Effect, Refusal> {
        let (change, report) = self.document.change(change, gesture)?;
        self.note(change);
        self.reselect();
        Ok(Effect::applied(report))
    }

    /// What is gone cannot stay selected.
    fn reselect(&mut self) {
        let scene = self.document.scene();
        if self.selection.as_ref().is_some_and(|what| state::selected(scene, what).is_none()) {
            self.select(None);
        }
    }

    fn note(&mut self, change: Change) {
        if let Some(Recording { start, goes_on: true, recorder }) = &mut self.recording {
            recorder.change(start.elapsed().as_secs_f64(), change);
        }
    }

    fn step_back(&mut self) -> Result<Effect, Refusal> {
        let done = self.document.undo()?;
        self.stepped(done)
    }

    fn step_again(&mut self) -> Result<Effect, Refusal> {
        let done = self.document.redo()?;
        self.stepped(done)
    }

    fn stepped(&mut self, done: Option<(Change, ApplyReport)>) -> Result<Effect, Refusal> {
        let Some((change, report)) = done else { return Ok(Effect::NONE) };
        self.note(change);
        self.reselect();
        Ok(Effect::applied(report))
    }

    /// Adds a light half-way to what is in the middle of the picture.
    fn add_light(&mut self) -> Result<Effect, Refusal> {
        let radius = self.bounds.map_or(1.0, |bounds| bounds.radius()).max(1e-3);
        let distance = self.pick_at(Vec2::splat(0.5))?.map_or(0.5 * radius, |pick| pick.distance);
        let eye = Vec3::from(self.navigator.camera().world_from_camera.translation);
        let position = eye + 0.5 * distance * self.navigator.forward();
        let next = self.document.scene().lights().keys().next_back().map_or(0, |id| id.0.saturating_add(1));
        // Whatever the light, a white surface where the view looks gets four times as bright as a middle grey is now.
        let radiance = 4.0 * MIDDLE_GREY / self.shown_exposure.exp2();
        let intensity = [std::f32::consts::PI * radiance * (0.5 * distance).powi(2); 3];
        let to = Lamp::Point { position: position.to_array(), intensity, range: None };
        self.gestures += 1;
        let gesture = self.gestures;
        let name = format!("lamp {next}");
        let mut effect = self.change(Change::Light { light: next, name, to: Some(to) }, gesture)?;
        effect.lines |= self.select(Some(Selection::Light { light: next })).lines;
        Ok(effect)
    }

    fn seek(&mut self, time: f64) -> Result<Effect, Refusal> {
        if self.document.timeline.is_empty() {
            return Err(Refusal("nothing in this scene moves".into()));
        }
        self.time = time.clamp(0.0, self.document.timeline.duration());
        self.pose()
    }

    fn play_clip(&mut self, index: usize) -> Result<Effect, Refusal> {
        if !self.document.timeline.play(index) {
            return Err(Refusal(format!("there is no clip {index}")));
        }
        (self.clip, self.time) = (index, 0.0);
        self.pose()
    }

    /// Lets time pass.
    pub(crate) fn advance_time(&mut self, seconds: f64) -> Result<Effect, Refusal> {
        let duration = self.document.timeline.duration();
        if !self.playing || duration <= 0.0 {
            return Ok(Effect::NONE);
        }
        self.time = (self.time + seconds * self.rate).rem_euclid(duration);
        let effect = self.pose();
        if effect.is_err() {
            self.playing = false;
        }
        effect
    }

    /// Brings the scene to the current moment.
    fn pose(&mut self) -> Result<Effect, Refusal> {
        self.plays = true;
        let edits = self.document.timeline.edits_at(self.time);
        if edits.is_empty() {
            return Ok(Effect::NONE);
        }
        Ok(Effect::applied(self.document.apply(&edits)?))
    }

    /// Lets the view move on; says whether it did.
    pub(crate) fn advance_view(&mut self, seconds: f32) -> bool {
        let before = self.navigator.camera().world_from_camera;
        let backend: &mut dyn Backend = self.document.backend();
        // A backend that cannot look is one without walls.
        let mut probe = |origin: Vec3, direction: Vec3| {
            look_along(backend, origin, direction).ok().flatten().map(|pick| pick.distance)
        };
        self.navigator.advance(seconds, &mut probe);
        before != self.navigator.camera().world_from_camera
    }

    /// The request for a picture of `scale` times the full width and height.
    pub(crate) fn request(&self, scale: f32, frame: u32) -> FrameRequest {
        let [width, height] = self.size.map(|n| ((n as f32 * scale).round() as u32).max(1));
        let mut request = FrameRequest {
            renderer: self.renderer.clone(),
            samples: 1,
            frame,
            materials: self.style.materials(),
            ..FrameRequest::new(self.navigator.camera(), width, height)
        };
        if let Some(plane) = self.plane {
            request.planes = vec![plane];
        } else if self.finish.needs_geometry {
            request.planes = Finish::GEOMETRY.to_vec();
        }
        request
    }

    /// Notes the view for a recording.
    pub(crate) fn record(&mut self, camera: &Camera) {
        let time = self.time;
        if let Some(Recording { start, goes_on, recorder }) = &mut self.recording
            && *goes_on
        {
            *goes_on = recorder.view(Key::new(start.elapsed().as_secs_f64(), time, camera));
        }
    }

    /// The recording, or, when there is none, this view with all changes.
    pub(crate) fn replay(&self) -> Replay {
        let camera = self.navigator.camera();
        let recorded = self.recording.as_ref().map(|recording| recording.recorder.snapshot());
        let (keys, changes) = recorded.filter(|(keys, _)| keys.len() > 1).unwrap_or_else(|| {
            let mut recorder = Recorder::new(self.document.changes());
            recorder.view(Key::new(0.0, self.time, &camera));
            recorder.snapshot()
        });
        let mut replay = Replay::new(self.title.clone(), self.renderer.clone(), self.size, keys, changes);
        replay.exposure = self.exposure;
        let Style { diffuse, surfaces, effects, tone } = self.style.clone();
        (replay.diffuse, replay.surfaces, replay.effects, replay.tone) = (diffuse, surfaces, effects, tone);
        replay.clip = self.plays.then_some(self.clip);
        replay
    }

    /// What the panels show.
    pub(crate) fn state(&mut self) -> SceneState {
        let renderers = self.document.backend().renderers().iter().map(|&name| name.into()).collect();
        let document = &self.document;
        let scene = document.scene();
        let [undo, redo] = document.history();
        let clips = document.timeline.clips().iter();
        let field = match self.navigator.camera().projection {
            Projection::Perspective { vertical_fov } => vertical_fov.to_degrees(),
            _ => 0.0,
        };
        SceneState {
            renderers,
            renderer: self.renderer.clone(),
            planes: Plane::ALL.iter().map(|plane| plane.name().into()).collect(),
            plane: self.plane.map(|plane| plane.name().into()),
            diffuse: self.style.diffuse,
            false_colors: self.choices[0].clone(),
            surfaces: self.style.surfaces.clone(),
            pixel_shaders: self.choices[1].clone(),
            effects: self.style.effects.clone(),
            tone: self.style.tone.clone(),
            exposure: self.exposure,
            goal: self.goal.frames_per_second,
            cameras: scene.cameras().values().map(|camera| camera.name.clone()).collect(),
            mode: self.navigator.mode(),
            field,
            lights: state::lights(scene),
            light_count: scene.lights().len(),
            things: state::things(scene),
            thing_count: scene.placed_in(None).count(),
            surroundings: document.surroundings().clone(),
            has_surroundings: state::has_surroundings(document),
            selection: self.selection.as_ref().and_then(|what| state::selected(scene, what)),
            gizmo: self.gizmo,
            clips: clips.map(|clip| (clip.name.clone(), clip.motion.duration())).collect(),
            clip: self.clip,
            playing: self.playing,
            rate: self.rate,
            undo,
            redo,
            recording: self.recording.as_ref().is_some_and(|recording| recording.goes_on),
            recorded: self.recording.as_ref().map(|recording| recording.recorder.seconds()),
        }
    }
}
