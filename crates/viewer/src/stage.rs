//! A scene on show: the view, what is selected, time, and what each input does to them.

use std::time::Instant;

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{
    ApplyReport, Backend, Camera, FrameRequest, InstanceId, LightId, MaterialOverride, Plane, Projection,
    SceneBounds,
};

use crate::change::{Change, Lamp};
use crate::document::{Document, Refusal};
use crate::geometry::{holder, object_bounds, world_from_parent};
use crate::gizmo::{self, Drag, Gizmo, GizmoMode, Line};
use crate::governor::Goal;
use crate::host::Opened;
use crate::input::{Button, Input, Phase, Selection, point};
use crate::navigator::Navigator;
use crate::pick::{Pick, look_along, pick};
use crate::replay::{Key, Recorder, Replay};
use crate::state::{self, SceneState};

/// Frames per second that the governor holds unless told otherwise.
const DEFAULT_GOAL: f32 = 15.0;
/// Most and least columns or rows of a picture, and most pixels.
const EDGES: [u32; 2] = [16, 8192];
const MAX_PIXELS: u64 = 1 << 23;
/// Furthest that a pointer moves in a click, as a share of the picture's height.
const CLICK: f32 = 0.01;
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
    diffuse: bool,
    pub(crate) exposure: Option<f32>,
    pub(crate) goal: Goal,
    selection: Option<Selection>,
    /// The box of the selected instance's object, in its own space.
    selected_box: Option<SceneBounds>,
    gizmo: GizmoMode,
    hand: Hand,
    gestures: u64,
    pub(crate) playing: bool,
    clip: usize,
    pub(crate) time: f64,
    rate: f64,
    /// Whether the timeline has said anything yet: until then the scene is at rest.
    pub(crate) plays: bool,
    /// When it began and whether it still goes on.
    recording: Option<(Instant, bool, Recorder)>,
}

/// What a pressed pointer is doing.
#[derive(Clone, Copy, Debug, Default)]
enum Hand {
    #[default]
    Free,
    /// A click so far.
    Pressed { from: Vec2, last: Vec2, button: Button },
    /// A drag of the view.
    Turning { last: Vec2, button: Button },
    /// A handle and what it moves: an instance from its place, or a light from its position.
    Handle { drag: Drag, what: Held },
}

#[derive(Clone, Copy, Debug)]
enum Held {
    Instance { id: InstanceId, start: Affine3A, world_from_parent: Affine3A },
    Light { id: LightId, start: Vec3 },
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
    const NONE: Self = Self { picture: false, lines: false, report: None };
    const LINES: Self = Self { lines: true, ..Self::NONE };
    const PICTURE: Self = Self { picture: true, ..Self::NONE };

    fn applied(report: ApplyReport) -> Self {
        Self { picture: true, lines: true, report: Some(report) }
    }
}

impl Stage {
    pub(crate) fn new(opened: Opened, size: [u32; 2], renderer: &str) -> Self {
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
            diffuse: false,
            exposure: None,
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
        stage
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
            Input::Diffuse { on } => self.diffuse = on,
            Input::Exposure { stops } => self.exposure = stops.map(|ev| ev.clamp(-30.0, 30.0)),
            Input::Goal { frames_per_second } => self.goal = Goal { frames_per_second },
            Input::Record { on } => {
                if on {
                    self.recording = Some((Instant::now(), true, Recorder::new(self.document.changes())));
                } else if let Some((_, goes_on, _)) = &mut self.recording {
                    *goes_on = false;
                }
                return Ok(Effect::NONE);
            }
        }
        Ok(Effect::PICTURE)
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

    fn pointer(&mut self, phase: Phase, at: Vec2, button: Button) -> Result<Effect, Refusal> {
        match (phase, self.hand) {
            (Phase::Down, _) => {
                self.hand = Hand::Pressed { from: at, last: at, button };
                if button == Button::Turn
                    && let Some((drag, what)) = self.grasp(at)
                {
                    self.gestures += 1;
                    self.hand = Hand::Handle { drag, what };
                }
                Ok(Effect::NONE)
            }
            (_, Hand::Free) => Ok(Effect::NONE),
            (Phase::Move, Hand::Pressed { from, last, button }) => {
                let far = ((at - from) * Vec2::new(self.aspect(), 1.0)).length() > CLICK;
                if !far {
                    return Ok(Effect::NONE);
                }
                self.hand = Hand::Turning { last, button };
                self.pointer(phase, at, button)
            }
            (Phase::Move, Hand::Turning { last, button }) => {
                let drag = (at - last) * Vec2::new(self.aspect(), 1.0);
                match button {
                    Button::Turn => self.navigator.turn(drag),
                    Button::Pan => self.navigator.pan(drag),
                }
                self.hand = Hand::Turning { last: at, button };
                Ok(Effect::PICTURE)
            }
            (Phase::Move, Hand::Handle { drag, what }) => self.pull(&drag, what, at),
            (Phase::Up, Hand::Pressed { button, .. }) => {
                self.hand = Hand::Free;
                let inside = at.cmpge(Vec2::ZERO).all() && at.cmple(Vec2::ONE).all();
                if button == Button::Turn && inside { self.select_at(at) } else { Ok(Effect::NONE) }
            }
            (Phase::Up, _) => {
                self.hand = Hand::Free;
                Ok(Effect::NONE)
            }
        }
    }

    /// The handle under the pointer, and what it holds.
    fn grasp(&self, at: Vec2) -> Option<(Drag, Held)> {
        let drag = self.handles()?.grasp(&self.navigator.camera(), at, self.aspect())?;
        let scene = self.document.scene();
        let what = match self.selection? {
            Selection::Instance { instance, .. } => {
                let id = InstanceId(instance);
                let start = scene.instances().get(&id)?.parent_from_object;
                Held::Instance { id, start, world_from_parent: world_from_parent(scene, id) }
            }
            Selection::Light { light } => {
                let id = LightId(light);
                Held::Light { id, start: Lamp::of(&scene.lights().get(&id)?.kind).position()? }
            }
        };
        Some((drag, what))
    }

    /// Moves what a handle holds.
    fn pull(&mut self, drag: &Drag, what: Held, at: Vec2) -> Result<Effect, Refusal> {
        let Some(change) = drag.world_change(&self.navigator.camera(), at, self.aspect()) else {
            return Ok(Effect::NONE);
        };
        let change = match what {
            Held::Instance { id, start, world_from_parent } => {
                let place = world_from_parent.inverse() * change * world_from_parent * start;
                Change::place(id, place)
            }
            Held::Light { id, start } => {
                let Some(light) = self.document.scene().lights().get(&id) else { return Ok(Effect::NONE) };
                let to = Lamp::of(&light.kind).at(change.transform_point3(start));
                Change::Light { light: id.0, name: light.name.clone(), to: Some(to) }
            }
        };
        self.change(change, self.gestures)
    }

    /// Where the handles of the selected thing stand.
    fn handles(&self) -> Option<Gizmo> {
        let scene = self.document.scene();
        match self.selection? {
            Selection::Instance { instance, .. } => {
                let id = InstanceId(instance);
                let place = world_from_parent(scene, id) * scene.instances().get(&id)?.parent_from_object;
                let middle = self.selected_box.map_or(Vec3::ZERO, |bounds| bounds.center());
                Some(Gizmo { mode: self.gizmo, origin: place.transform_point3(middle) })
            }
            Selection::Light { light } => {
                let position = Lamp::of(&scene.lights().get(&LightId(light))?.kind).position()?;
                // A point can be moved alone.
                Some(Gizmo { mode: GizmoMode::Move, origin: position })
            }
        }
    }

    /// The lines over the picture of a camera.
    pub(crate) fn lines(&self, camera: &Camera) -> Vec<Line> {
        const MAX_MARKS: usize = 64;
        let (scene, aspect) = (self.document.scene(), self.aspect());
        let places = scene.lights().values().filter_map(|light| Lamp::of(&light.kind).position());
        let mut lines: Vec<Line> =
            places.take(MAX_MARKS).filter_map(|place| gizmo::light_mark(camera, aspect, place)).collect();
        if let (Some(Selection::Instance { instance, .. }), Some(bounds)) =
            (self.selection, &self.selected_box)
            && let Some(placed) = scene.instances().get(&InstanceId(instance))
        {
            let place = world_from_parent(scene, InstanceId(instance)) * placed.parent_from_object;
            lines.extend(gizmo::box_lines(camera, aspect, bounds, place));
        }
        lines.extend(self.handles().map(|handles| handles.lines(camera, aspect)).into_iter().flatten());
        lines
    }

    fn pick_at(&mut self, at: Vec2) -> Result<Option<Pick>, Refusal> {
        let (camera, aspect) = (self.navigator.camera(), self.aspect());
        Ok(pick(self.document.backend(), &camera, at, aspect)?)
    }

    /// Selects the light or the thing under the pointer.
    fn select_at(&mut self, at: Vec2) -> Result<Effect, Refusal> {
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
        let found = self.pick_at(at)?;
        let instance =
            |pick: Pick| Selection::Instance { instance: pick.instance.0, material: Some(pick.material.0) };
        Ok(self.select(found.map(instance)))
    }

    fn select(&mut self, what: Option<Selection>) -> Effect {
        let scene = self.document.scene();
        self.selection = what.filter(|what| state::selected(scene, *what).is_some());
        self.selected_box = match self.selection {
            Some(Selection::Instance { instance, .. }) => {
                scene.instances().get(&InstanceId(instance)).and_then(|i| object_bounds(scene, i.object))
            }
            _ => None,
        };
        Effect::LINES
    }

    fn select_holder(&mut self) -> Effect {
        let Some(Selection::Instance { instance, material }) = self.selection else { return Effect::NONE };
        match holder(self.document.scene(), InstanceId(instance)) {
            Some(id) => self.select(Some(Selection::Instance { instance: id.0, material })),
            None => Effect::NONE,
        }
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
        let Some(Selection::Instance { instance, .. }) = self.selection else { return 1.0 };
        let (scene, id) = (self.document.scene(), InstanceId(instance));
        let place = scene.instances().get(&id).map(|i| world_from_parent(scene, id) * i.parent_from_object);
        place.map_or(1.0, |place| place.matrix3.determinant().abs().cbrt())
    }

    fn change(&mut self, change: Change, gesture: u64) -> Result<Effect, Refusal> {
        let report = self.document.change(change.clone(), gesture)?;
        self.note(change);
        self.reselect();
        Ok(Effect::applied(report))
    }

    /// What is gone cannot stay selected.
    fn reselect(&mut self) {
        if self.selection.is_some_and(|what| state::selected(self.document.scene(), what).is_none()) {
            self.select(None);
        }
    }

    fn note(&mut self, change: Change) {
        if let Some((start, true, recorder)) = &mut self.recording {
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
        // As bright at a tenth of the scene's size as a white surface in an ordinary room.
        let intensity = [10.0 * (0.1 * radius).powi(2) * std::f32::consts::PI; 3];
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
            materials: if self.diffuse { MaterialOverride::Diffuse } else { MaterialOverride::None },
            ..FrameRequest::new(self.navigator.camera(), width, height)
        };
        if let Some(plane) = self.plane {
            request.planes = vec![plane];
        }
        request
    }

    /// Notes the view for a recording.
    pub(crate) fn record(&mut self, camera: &Camera) {
        let time = self.time;
        if let Some((start, goes_on, recorder)) = &mut self.recording
            && *goes_on
        {
            *goes_on = recorder.view(Key::new(start.elapsed().as_secs_f64(), time, camera));
        }
    }

    /// The recording, or, when there is none, this view with all changes.
    pub(crate) fn replay(&self) -> Replay {
        let camera = self.navigator.camera();
        let recorded = self.recording.as_ref().map(|(_, _, recorder)| recorder.snapshot());
        let (keys, changes) = recorded.filter(|(keys, _)| keys.len() > 1).unwrap_or_else(|| {
            let mut recorder = Recorder::new(self.document.changes());
            recorder.view(Key::new(0.0, self.time, &camera));
            recorder.snapshot()
        });
        let mut replay = Replay::new(self.title.clone(), self.renderer.clone(), self.size, keys, changes);
        replay.exposure = self.exposure;
        replay.diffuse = self.diffuse;
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
            diffuse: self.diffuse,
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
            selection: self.selection.and_then(|what| state::selected(scene, what)),
            gizmo: self.gizmo,
            clips: clips.map(|clip| (clip.name.clone(), clip.motion.duration())).collect(),
            clip: self.clip,
            playing: self.playing,
            rate: self.rate,
            undo,
            redo,
            recording: self.recording.as_ref().is_some_and(|(_, goes_on, _)| *goes_on),
        }
    }
}
