//! Sessions without any face: what goes in, what comes out.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use heliostat_engine::{Engine, EngineOptions};
use heliostat_scene::{Backend, Frame, Progress};

use crate::{
    Button, Change, Host, Input, Lamp, Opened, Phase, Picture, Refusal, Selected, Session, SessionOptions,
    Source, State,
};

/// Opens built-in scenes; uploads fail.
#[derive(Default)]
pub(crate) struct TestHost {
    /// While set, opening a scene takes its time.
    slow: AtomicBool,
}

impl Host for TestHost {
    fn open(&self, source: &Source, progress: &Progress) -> Result<Opened, Refusal> {
        progress.start(10);
        while self.slow.load(Ordering::SeqCst) {
            progress.advance(1);
            std::thread::sleep(Duration::from_millis(20));
            if progress.is_cancelled() {
                return Err(Refusal("cancelled".into()));
            }
        }
        let Source::Named(name) = source else { return Err(Refusal("no uploads here".into())) };
        let edits = heliostat_builtin::build(name).ok_or_else(|| Refusal(format!("no scene `{name}`")))?;
        let mut engine = Engine::new(EngineOptions::default()).map_err(Refusal::from)?;
        engine.apply(&edits, progress).map_err(Refusal::from)?;
        let scene = engine.scene().clone();
        let home = scene.cameras().values().next().expect("a camera").clone();
        let timeline = heliostat_builtin::timeline(name);
        Ok(Opened {
            title: name.clone(),
            backend: Box::new(engine),
            scene,
            timeline,
            home,
            notes: Vec::new(),
        })
    }

    fn to_exr(&self, _: &Frame) -> Result<Vec<u8>, Refusal> {
        Err(Refusal("no EXR here".into()))
    }
}

fn session(name: &str) -> Session {
    let options = SessionOptions { size: [64, 48], ..SessionOptions::default() };
    let host = Arc::new(TestHost::default());
    let session = Session::start(host, Source::Named(name.into()), options, || ()).expect("a session");
    session.set_watchers(1);
    session
}

/// Waits for what `found` finds in the news.
fn wait<T>(session: &Session, what: &str, found: impl Fn(Option<&Picture>, &State) -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        let news = session.news();
        if let Some(found) = found(news.picture.as_deref(), &news.state) {
            return found;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "waited for {what}: {:?}", news.state);
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The picture that shows input `number`, standing still.
fn still(session: &Session, number: u64) -> Arc<Vec<u8>> {
    wait(session, "a still picture", |picture, _| {
        picture.filter(|p| p.input >= number && p.still && p.frames >= 2).map(|p| p.rgb.clone())
    })
}

fn difference(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64
}

fn paused(session: &Session) -> Arc<Vec<u8>> {
    session.input(1, Input::Play { playing: false }).expect("taken");
    session.input(2, Input::Seek { time: 0.0 }).expect("taken");
    still(session, 2)
}

#[test]
fn pictures_refine_and_drags_turn_the_view() {
    let session = session("cornell");
    let before = paused(&session);
    let view = session.news().picture.expect("a picture").view.clone();
    let drag = |phase, x| Input::Pointer { phase, at: [x, 0.3], button: Button::Turn };
    session.input(3, drag(Phase::Down, 0.3)).expect("taken");
    session.input(4, drag(Phase::Move, 0.4)).expect("taken");
    session.input(5, drag(Phase::Up, 0.4)).expect("taken");
    let after = still(&session, 5);
    assert!(difference(&before, &after) > 5.0, "the picture changed");
    let turned = session.news().picture.expect("a picture").view.clone();
    assert_ne!(view, turned);
    session.input(6, Input::View { text: view.clone() }).expect("taken");
    still(&session, 6);
    assert_eq!(session.news().picture.expect("a picture").view, view);
}

#[test]
fn a_click_selects_and_a_change_is_seen_and_undone() {
    let session = session("cornell");
    let before = paused(&session);
    // The ceiling lamp, in the upper middle of the picture.
    let press = |phase| Input::Pointer { phase, at: [0.5, 0.14], button: Button::Turn };
    session.input(3, press(Phase::Down)).expect("taken");
    session.input(4, press(Phase::Up)).expect("taken");
    let (material, mut look) =
        wait(&session, "a selection", |_, state| match &state.scene.as_ref()?.selection {
            Some(Selected::Instance { material, look, .. }) => Some(((*material)?, look.clone()?)),
            _ => None,
        });
    assert!(look.emissive[0] > 1.0, "the lamp was picked: {look:?}");
    look.emissive = [0.0, 0.0, 40.0];
    session.input(5, Input::Exposure { stops: Some(0.0) }).expect("taken");
    session
        .input(6, Input::Change { change: Change::Material { material, look }, gesture: 1 })
        .expect("taken");
    let blue = still(&session, 6);
    assert!(difference(&before, &blue) > 10.0);
    let means = |rgb: &[u8]| [0, 2].map(|c| rgb.chunks(3).map(|p| u64::from(p[c])).sum::<u64>());
    let [red, much_blue] = means(&blue);
    assert!(much_blue > 4 * red, "{red} {much_blue}");
    assert_eq!(session.replay().expect("a scene").changes.len(), 1);
    session.input(7, Input::Undo).expect("taken");
    session.input(8, Input::Exposure { stops: None }).expect("taken");
    let back = still(&session, 8);
    assert!(difference(&before, &back) < difference(&before, &blue) / 4.0);
    assert!(session.replay().expect("a scene").changes.is_empty());
}

#[test]
fn time_plays_and_lights_can_be_added_and_dragged() {
    let session = session("cornell");
    session.input(1, Input::Play { playing: true }).expect("taken");
    let times = |session: &Session| wait(session, "a moment", |p, _| p.map(|p| p.time).filter(|&t| t > 0.2));
    assert!(times(&session) > 0.0);
    let paused = paused(&session);
    session.input(3, Input::AddLight).expect("taken");
    let lit = still(&session, 3);
    assert!(difference(&paused, &lit) > 1.0);
    let lamp = |state: &State| state.scene.as_ref()?.lights.last().map(|light| light.lamp.clone());
    let Some(Lamp::Point { position: old, .. }) = lamp(&session.news().state) else { panic!("a lamp") };
    // It stands in the middle of the picture; its second handle points up.
    for (phase, y) in [(Phase::Down, 0.42), (Phase::Move, 0.35), (Phase::Up, 0.35)] {
        session.input(4, Input::Pointer { phase, at: [0.5, y], button: Button::Turn }).expect("taken");
    }
    let moved = wait(&session, "a moved lamp", |_, state| match lamp(state) {
        Some(Lamp::Point { position, .. }) => Some(position).filter(|p| *p != old),
        _ => None,
    });
    assert!(moved[1] > old[1] && (moved[0] - old[0]).abs() < 1e-3, "{old:?} {moved:?}");
}

#[test]
fn renderers_and_planes_switch_and_bad_inputs_are_told() {
    let session = session("cornell");
    let igi = paused(&session);
    session.input(3, Input::Renderer { name: "direct".into() }).expect("taken");
    let direct = still(&session, 3);
    assert!(difference(&igi, &direct) > 1.0);
    session.input(4, Input::Show { plane: Some("normal".into()) }).expect("taken");
    wait(&session, "normals", |p, _| p.filter(|p| p.input >= 4 && p.done).map(|_| ()));
    for bad in [
        Input::Renderer { name: "magic".into() },
        Input::Show { plane: Some("smell".into()) },
        Input::Camera { index: 99 },
        Input::Clip { index: 99 },
    ] {
        session.input(5, bad).expect("taken");
    }
    wait(&session, "messages", |_, state| {
        (state.messages.iter().filter(|m| m.error).count() == 4).then_some(())
    });
    session.input(6, Input::Zoom { steps: f32::NAN }).unwrap_err();
}

#[test]
fn opening_shows_progress_and_failures_keep_the_old_scene() {
    let host = Arc::new(TestHost::default());
    host.slow.store(true, Ordering::SeqCst);
    let options = SessionOptions { size: [32, 24], ..SessionOptions::default() };
    let start = Instant::now();
    let session =
        Session::start(host.clone(), Source::Named("cornell".into()), options, || ()).expect("a session");
    session.set_watchers(1);
    wait(&session, "progress", |_, state| state.loading.as_ref().filter(|l| l.total == 10).map(|_| ()));
    assert!(start.elapsed() < Duration::from_secs(2));
    host.slow.store(false, Ordering::SeqCst);
    wait(&session, "a picture", |picture, _| picture.map(|_| ()));
    session.open(Source::Upload { name: "x.glb".into(), bytes: Arc::from(*b"nonsense") });
    wait(&session, "a failure", |_, state| {
        state.messages.iter().find(|m| m.text == "no uploads here").map(|_| ())
    });
    let state = session.news().state;
    assert!(state.loading.is_none() && state.scene.is_some() && state.title == "cornell");
}

#[test]
fn nobody_watches_no_pictures_are_made() {
    let session = session("cornell");
    wait(&session, "a picture", |picture, _| picture.map(|_| ()));
    session.set_watchers(0);
    std::thread::sleep(Duration::from_millis(300));
    let number = session.news().picture.expect("a picture").number;
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(session.news().picture.expect("a picture").number, number);
}
