//! The window: a session on the machine's own display.

mod keys;
mod paint;
mod panel;

use std::collections::BTreeSet;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::Vec3;
use softbuffer::{Context, Surface};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, OwnedDisplayHandle};
use winit::keyboard::{KeyCode, ModifiersState, PhysicalKey};
use winit::window::{Fullscreen, Window, WindowId};

use crate::host::{Host, Source};
use crate::input::{Button, Input, Phase};
use crate::session::{News, Session, SessionOptions};
use paint::{Canvas, color, text_size};

/// How a window begins.
#[derive(Clone, Debug)]
pub struct WindowOptions {
    /// How the session begins.
    pub session: SessionOptions,
    /// Columns and rows.
    pub size: [u32; 2],
}

/// Why there is no window.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WindowError {
    /// The machine has no display, or none that can be reached.
    #[error("there is no display: {0}")]
    NoDisplay(String),
    /// The window system failed.
    #[error("the window failed: {0}")]
    Failed(String),
}

/// How often Ctrl-C and waiting messages are looked for.
const TICK: Duration = Duration::from_millis(100);
/// How long the hint for new users stays.
const HINT: Duration = Duration::from_secs(12);
/// How long a message stays.
const MESSAGE: Duration = Duration::from_secs(8);
/// Height of the bar of time at the bottom, before scaling.
const BAR: f64 = 10.0;

/// Shows a session in a window, until it is closed or `interrupted` says so. To be called on the main thread, once: window
/// systems ask for that.
///
/// # Errors
/// [`WindowError::NoDisplay`] before anything has happened, [`WindowError::Failed`] later.
pub fn show_window(
    host: Arc<dyn Host>,
    source: Source,
    options: &WindowOptions,
    interrupted: &dyn Fn() -> bool,
) -> Result<(), WindowError> {
    let failed = |error: &dyn std::fmt::Display| WindowError::Failed(error.to_string());
    let events = EventLoop::<()>::with_user_event().build();
    let events = events.map_err(|error| WindowError::NoDisplay(error.to_string()))?;
    let context = Context::new(events.owned_display_handle()).map_err(|error| failed(&error))?;
    let proxy = events.create_proxy();
    // A window that is closed needs no news.
    let listener = move || _ = proxy.send_event(());
    let session = Session::start(host.clone(), source, options.session.clone(), listener)
        .map_err(|error| failed(&error))?;
    let mut face = Face {
        session,
        host,
        context,
        interrupted,
        size: options.size,
        window: None,
        surface: None,
        news: News::default(),
        number: 0,
        keys: BTreeSet::new(),
        modifiers: ModifiersState::empty(),
        pointer: [0.0; 2],
        pressed: None,
        seeking: false,
        camera: 0,
        row: None,
        gesture: 0,
        figures: true,
        help: false,
        since: Instant::now(),
        message: None,
        heard: 0,
        problem: None,
    };
    events.run_app(&mut face).map_err(|error| failed(&error))?;
    match face.problem {
        Some(problem) => Err(WindowError::Failed(problem)),
        None => Ok(()),
    }
}

type Screen = Surface<OwnedDisplayHandle, Rc<Window>>;

/// The window's side of a session.
struct Face<'a> {
    session: Session,
    host: Arc<dyn Host>,
    context: Context<OwnedDisplayHandle>,
    interrupted: &'a dyn Fn() -> bool,
    size: [u32; 2],
    window: Option<Rc<Window>>,
    surface: Option<Screen>,
    news: News,
    number: u64,
    /// Movement keys that are held.
    keys: BTreeSet<KeyCode>,
    modifiers: ModifiersState,
    /// Where the pointer is, pixels.
    pointer: [f64; 2],
    pressed: Option<Button>,
    seeking: bool,
    camera: u32,
    /// Which line of the panel is chosen.
    row: Option<usize>,
    /// What is changed by one key, however long it is held, is undone together.
    gesture: u64,
    figures: bool,
    help: bool,
    since: Instant,
    message: Option<(String, Instant)>,
    /// Number of the last message of the session that was shown.
    heard: u64,
    problem: Option<String>,
}

impl Face<'_> {
    fn send(&mut self, input: Input) {
        self.number += 1;
        if let Err(refusal) = self.session.input(self.number, input) {
            self.say(refusal.0);
        }
    }

    fn say(&mut self, text: String) {
        self.message = Some((text, Instant::now()));
        self.redraw();
    }

    fn redraw(&self) {
        if let Some(window) = &self.window {
            window.request_redraw();
        }
    }

    /// The pointer as a point of the picture.
    fn at(&self) -> [f32; 2] {
        [0, 1].map(|i| (self.pointer[i] / f64::from(self.size[i].max(1))) as f32)
    }

    fn scale(&self) -> usize {
        self.window.as_ref().map_or(1, |window| window.scale_factor().round().max(1.0) as usize)
    }

    fn open(&mut self, events: &ActiveEventLoop) -> Result<(), String> {
        let attributes = Window::default_attributes()
            .with_title("Heliostat")
            .with_inner_size(PhysicalSize::new(self.size[0], self.size[1]));
        let window = Rc::new(events.create_window(attributes).map_err(|error| error.to_string())?);
        let surface = Surface::new(&self.context, window.clone()).map_err(|error| error.to_string())?;
        (self.window, self.surface) = (Some(window), Some(surface));
        self.session.set_watchers(1);
        Ok(())
    }

    fn resized(&mut self, size: PhysicalSize<u32>) {
        self.size = [size.width, size.height];
        if size.width > 0 && size.height > 0 {
            self.send(Input::Size { width: size.width, height: size.height });
        }
    }

    fn pointed(&mut self, state: ElementState, button: MouseButton) {
        let down = state == ElementState::Pressed;
        let pan = button != MouseButton::Left || self.modifiers.shift_key();
        let bar = BAR * self.scale() as f64;
        if down && self.clip().is_some() && self.pointer[1] > f64::from(self.size[1]) - bar {
            self.seeking = true;
            return self.seek();
        }
        if std::mem::take(&mut self.seeking) {
            return;
        }
        let button = match self.pressed {
            Some(button) if !down => button,
            _ if pan => Button::Pan,
            _ => Button::Turn,
        };
        self.pressed = down.then_some(button);
        let phase = if down { Phase::Down } else { Phase::Up };
        self.send(Input::Pointer { phase, at: self.at(), button });
    }

    fn moved(&mut self) {
        if self.seeking {
            self.seek();
        } else if let Some(button) = self.pressed {
            self.send(Input::Pointer { phase: Phase::Move, at: self.at(), button });
        }
    }

    /// Length of the clip that plays.
    fn clip(&self) -> Option<f64> {
        let scene = self.news.state.scene.as_ref()?;
        scene.clips.get(scene.clip).map(|clip| clip.1).filter(|&length| length > 0.0)
    }

    fn seek(&mut self) {
        if let Some(length) = self.clip() {
            let time = f64::from(self.at()[0].clamp(0.0, 1.0)) * length;
            self.send(Input::Seek { time });
        }
    }

    fn key(&mut self, event: &KeyEvent) {
        let PhysicalKey::Code(code) = event.physical_key else { return };
        let down = event.state == ElementState::Pressed;
        let control = self.modifiers.control_key();
        if keys::way(code).is_some() && !control {
            let changed = if down { self.keys.insert(code) } else { self.keys.remove(&code) };
            if changed {
                self.drive();
            }
            return;
        }
        if !down {
            return;
        }
        if event.logical_key.to_text() == Some("?") || code == KeyCode::F1 {
            self.help = !self.help;
            return self.redraw();
        }
        match code {
            KeyCode::KeyO if !control => self.figures = !self.figures,
            KeyCode::KeyP if !control => self.save("png"),
            KeyCode::KeyI if !control => self.save("exr"),
            KeyCode::KeyK if !control => self.save("json"),
            KeyCode::F11 => self.full_screen(),
            KeyCode::Tab => self.choose_row(),
            KeyCode::BracketLeft | KeyCode::BracketRight if self.row.is_some() => {
                self.change_row(code == KeyCode::BracketRight, event.repeat);
            }
            KeyCode::ArrowLeft => self.turn([-1.0, 0.0]),
            KeyCode::ArrowRight => self.turn([1.0, 0.0]),
            KeyCode::ArrowUp => self.turn([0.0, -1.0]),
            KeyCode::ArrowDown => self.turn([0.0, 1.0]),
            _ => {
                let (ev, time) =
                    self.news.picture.as_ref().map_or((0.0, 0.0), |picture| (picture.exposure, picture.time));
                let held = keys::Held { control, shift: self.modifiers.shift_key(), ev, time };
                let state = self.news.state.clone();
                if let Some(input) = keys::input(code, held, &state, &mut self.camera) {
                    if code == KeyCode::Escape {
                        self.row = None;
                    }
                    self.send(input);
                }
            }
        }
        self.redraw();
    }

    /// The panel's lines as they are now.
    fn rows(&self) -> Vec<panel::Row> {
        let size = if self.modifiers.shift_key() { 4.0 } else { 1.0 };
        self.news.state.scene.as_ref().map_or(Vec::new(), |scene| panel::rows(scene, size, self.gesture))
    }

    fn choose_row(&mut self) {
        let (count, back) = (self.rows().len(), self.modifiers.shift_key());
        let next = match self.row {
            None if back => count.checked_sub(1),
            None => Some(0),
            Some(row) if back => row.checked_sub(1),
            Some(row) => Some(row + 1),
        };
        self.row = next.filter(|&row| row < count);
    }

    fn change_row(&mut self, more: bool, repeats: bool) {
        self.gesture += u64::from(!repeats);
        let row = self.row.and_then(|row| self.rows().into_iter().nth(row));
        if let Some(row) = row {
            let [less, greater] = row.steps;
            self.send(if more { greater } else { less });
        }
    }

    /// Turns the view as a drag would.
    fn turn(&mut self, [x, y]: [f32; 2]) {
        let button = if self.modifiers.shift_key() { Button::Pan } else { Button::Turn };
        // From outside the picture, where there is no handle to take hold of.
        let (from, to) = ([-1.0; 2], [-1.0 + 0.03 * x, -1.0 + 0.03 * y]);
        for (phase, at) in [(Phase::Down, from), (Phase::Move, to), (Phase::Up, to)] {
            self.send(Input::Pointer { phase, at, button });
        }
    }

    fn drive(&mut self) {
        let way: Vec3 = self.keys.iter().filter_map(|&key| keys::way(key)).sum();
        let hurry = self.modifiers.shift_key();
        self.send(Input::Drive { way: way.to_array(), hurry });
    }

    fn full_screen(&self) {
        if let Some(window) = &self.window {
            let full = window.fullscreen().is_none().then_some(Fullscreen::Borderless(None));
            window.set_fullscreen(full);
        }
    }

    /// Saves the picture or the replay under a fresh name in the current folder.
    fn save(&mut self, kind: &str) {
        let outcome = self.packed(kind).and_then(|bytes| {
            let path = fresh_name(kind).ok_or("too many pictures of that name")?;
            std::fs::write(&path, bytes).map_err(|error| format!("{}: {error}", path.display()))?;
            Ok(path)
        });
        self.say(match outcome {
            Ok(path) => format!("saved {}", path.display()),
            Err(problem) => format!("not saved: {problem}"),
        });
    }

    fn packed(&self, kind: &str) -> Result<Vec<u8>, String> {
        if kind == "json" {
            return Ok(self.session.replay().ok_or("there is no scene yet")?.to_json().into_bytes());
        }
        let picture = self.news.picture.as_ref().ok_or("there is no picture yet")?;
        match kind {
            "exr" => self.host.to_exr(&picture.frame).map_err(|refusal| refusal.0),
            _ => {
                let mut bytes = Vec::new();
                picture.to_png(&mut bytes).map(|()| bytes).map_err(|error| error.to_string())
            }
        }
    }

    fn take_news(&mut self) {
        self.news = self.session.news();
        if let Some(last) = self.news.state.messages.last()
            && last.number > self.heard
        {
            self.heard = last.number;
            self.message = Some((last.text.clone(), Instant::now()));
        }
        if let Some(window) = &self.window
            && !self.news.state.title.is_empty()
        {
            window.set_title(&format!("{} - Heliostat", self.news.state.title));
        }
        self.redraw();
    }

    fn draw(&mut self) -> Result<(), String> {
        let [width, height] = self.size;
        let (Some(columns), Some(rows)) = (NonZeroU32::new(width), NonZeroU32::new(height)) else {
            return Ok(());
        };
        let scale = self.scale();
        let Some(mut surface) = self.surface.take() else { return Ok(()) };
        surface.resize(columns, rows).map_err(|error| error.to_string())?;
        let mut buffer = surface.buffer_mut().map_err(|error| error.to_string())?;
        let (width, height) = (width as usize, height as usize);
        let mut canvas = Canvas { pixels: &mut buffer, width, height };
        self.paint(&mut canvas, scale);
        buffer.present().map_err(|error| error.to_string())?;
        self.surface = Some(surface);
        Ok(())
    }

    fn paint(&self, canvas: &mut Canvas<'_>, scale: usize) {
        let (width, height) = (canvas.width, canvas.height);
        match &self.news.picture {
            Some(picture) => {
                canvas.picture(picture);
                for line in &picture.lines {
                    let place = |p: [f32; 2]| [p[0] * width as f32, p[1] * height as f32];
                    for ends in line.points.windows(2) {
                        canvas.line(place(ends[0]), place(ends[1]), 4 * scale, 0);
                        canvas.line(place(ends[0]), place(ends[1]), 2 * scale, color(line.kind));
                    }
                }
            }
            None => canvas.pixels.fill(0x10_1010),
        }
        let margin = (8 * scale) as isize;
        let bottom = |rows: usize| height as isize - 3 * margin - text_size(0, rows, scale)[1] as isize;
        if self.figures {
            canvas.text([margin, margin], scale, 0xFF_FFFF, &self.figures());
        }
        self.paint_panel(canvas, scale);
        if let Some(length) = self.clip() {
            let time = self.news.picture.as_ref().map_or(0.0, |picture| picture.time);
            let bar = (BAR * scale as f64) as usize;
            canvas.shade([0, (height.saturating_sub(bar)) as isize], [width, bar]);
            let done = (width as f64 * (time / length).clamp(0.0, 1.0)) as usize;
            canvas.fill([0, height.saturating_sub(bar) as isize], [done, bar], 0xFF_B74A);
        }
        if self.help {
            let lines: Vec<String> = keys::HELP.iter().map(|&line| line.into()).collect();
            let size = text_size(58, lines.len(), scale);
            let corner = [width, height].map(|n| n as isize / 2);
            let corner = [corner[0] - size[0] as isize / 2, corner[1] - size[1] as isize / 2];
            canvas.text(corner.map(|n| n.max(margin)), scale, 0xFF_FFFF, &lines);
        } else if let Some((text, _)) = &self.message {
            canvas.text([margin, bottom(1)], scale, 0xFF_E0A0, std::slice::from_ref(text));
        } else if self.since.elapsed() < HINT {
            let hint = "drag to look around, click a thing, drop a file, ? for help".to_owned();
            canvas.text([margin, bottom(1)], scale, 0xFF_FFFF, &[hint]);
        }
    }

    /// At the right: the properties of what is selected, or, while one is chosen, of the view.
    fn paint_panel(&self, canvas: &mut Canvas<'_>, scale: usize) {
        let selected = self.news.state.scene.as_ref().is_some_and(|scene| scene.selection.is_some());
        if self.help || !(self.row.is_some() || self.figures && selected) {
            return;
        }
        let line = |(index, row): (usize, panel::Row)| {
            let mark = if self.row == Some(index) { '>' } else { ' ' };
            format!("{mark} {:<17} {:>15}", row.name, row.value)
        };
        let mut lines: Vec<String> = self.rows().into_iter().enumerate().map(line).collect();
        lines.push(if self.row.is_some() { "  [ ] changes it" } else { "  Tab chooses a property" }.into());
        let columns = lines.iter().map(String::len).max().unwrap_or(0);
        let [width, _] = text_size(columns, lines.len(), scale);
        let margin = (8 * scale) as isize;
        let left = (canvas.width as isize - width as isize - margin).max(margin);
        canvas.text([left, margin], scale, 0xFF_FFFF, &lines);
    }

    /// The lines of the overlay.
    fn figures(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let state = &self.news.state;
        if let Some(loading) = &state.loading {
            let share = (100 * loading.done).checked_div(loading.total).unwrap_or(0);
            lines.push(format!("opening {} ... {share} %, {:.1} s", loading.title, loading.seconds));
        }
        if self.news.picture.is_none() && state.loading.is_none() && state.scene.is_some() {
            lines.push("making the first picture ...".into());
        }
        if let Some(picture) = &self.news.picture {
            let stats = &picture.stats;
            let (width, height) = (picture.frame.width, picture.frame.height);
            let pace = if picture.still {
                format!("{} frames", picture.frames)
            } else {
                format!("{:.1} fps", stats.fps)
            };
            lines.push(format!("{width}x{height}  {pace}"));
            lines.push(format!("{:.1} Mrays/s", stats.rays_per_second * 1e-6));
            lines.push(format!(
                "render {:.1} ms, edits {:.1} ms, tone {:.1} ms",
                stats.render, stats.apply, stats.tone
            ));
            lines.extend(stats.counts.map(|[mean, white]| format!("mean {mean:.1}, white {white:.0}")));
            lines.extend(
                stats.rebuilt.iter().take(3).map(|(what, time)| format!("rebuilt {what} {time:.1} ms")),
            );
        }
        if let Some(scene) = &state.scene {
            let surfaces = scene.surfaces.as_ref().map(|effect| &effect.name);
            let shown = scene.plane.as_ref().or(surfaces).unwrap_or(&scene.renderer);
            let mode = format!("{:?}", scene.mode).to_lowercase();
            lines.push(format!("{shown}, {mode}{}", if scene.playing { ", playing" } else { "" }));
            let effects = scene.effects.iter().chain(&scene.tone).map(|effect| effect.name.as_str());
            let effects: Vec<&str> = effects.collect();
            if !effects.is_empty() {
                lines.push(effects.join(", "));
            }
            if let Some(seconds) = scene.recorded {
                let what = if scene.recording { "recording" } else { "recorded" };
                lines.push(format!("{what} {seconds:.1} s"));
            }
            match &scene.selection {
                Some(crate::Selected::Instance { name, .. }) => lines.push(format!("selected: {name}")),
                Some(crate::Selected::Light { light }) => {
                    let name =
                        scene.lights.iter().find(|state| state.id == *light).map_or("", |state| &state.name);
                    lines.push(format!("selected: {name}"));
                }
                None => {}
            }
        }
        lines
    }
}

/// `heliostat-1.png` and so on: the first that is not there.
fn fresh_name(kind: &str) -> Option<PathBuf> {
    let names = (1..10_000).map(|n| PathBuf::from(format!("heliostat-{n}.{kind}")));
    names.into_iter().find(|path| !path.exists())
}

impl ApplicationHandler for Face<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.window.is_none()
            && let Err(problem) = self.open(events)
        {
            self.problem = Some(problem);
            events.exit();
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, (): ()) {
        self.take_news();
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::Resized(size) => self.resized(size),
            WindowEvent::Occluded(hidden) => self.session.set_watchers(usize::from(!hidden)),
            WindowEvent::RedrawRequested => {
                if let Err(problem) = self.draw() {
                    self.problem = Some(problem);
                    events.exit();
                }
            }
            WindowEvent::ModifiersChanged(modifiers) => {
                let hurried = self.modifiers.shift_key();
                self.modifiers = modifiers.state();
                if hurried != self.modifiers.shift_key() && !self.keys.is_empty() {
                    self.drive();
                }
            }
            WindowEvent::KeyboardInput { event, .. } => self.key(&event),
            WindowEvent::CursorMoved { position, .. } => {
                self.pointer = [position.x, position.y];
                self.moved();
            }
            WindowEvent::MouseInput { state, button, .. } => self.pointed(state, button),
            WindowEvent::MouseWheel { delta, .. } => {
                let steps = match delta {
                    MouseScrollDelta::LineDelta(_, y) => y,
                    MouseScrollDelta::PixelDelta(by) => (by.y / 40.0) as f32,
                };
                self.send(Input::Zoom { steps });
            }
            WindowEvent::PinchGesture { delta, .. } => self.send(Input::Zoom { steps: 10.0 * delta as f32 }),
            WindowEvent::Focused(false) => {
                self.keys.clear();
                self.drive();
            }
            WindowEvent::DroppedFile(path) => self.session.open(Source::Named(path.display().to_string())),
            _ => {}
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        if (self.interrupted)() {
            events.exit();
        }
        if self.message.as_ref().is_some_and(|(_, since)| since.elapsed() > MESSAGE) {
            self.message = None;
            self.redraw();
        }
        events.set_control_flow(ControlFlow::WaitUntil(Instant::now() + TICK));
    }
}
