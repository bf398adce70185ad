//! Sessions without any face: what goes in, what comes out.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use heliostat_engine::{Engine, EngineOptions};
use heliostat_scene::{Backend, Frame, Progress};

use crate::{
    Button, Change, Effect, Host, Input, Lamp, Opened, Phase, Picture, Refusal, Selected, Session,
    SessionOptions, Setting, Source, State,
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
fn pictures_are_shown_another_way_and_as_they_are_again() {
    let session = session("cornell");
    let plain = paused(&session);
    let mut number = 3;
    let mut shown = |input: Input| {
        number += 1;
        session.input(number, input).expect("taken");
        still(&session, number)
    };
    let normals = shown(Input::Surfaces { shader: Some(Effect::named("show-normal")) });
    assert!(difference(&plain, &normals) > 20.0);
    assert_eq!(session.news().picture.expect("a picture").exposure, 0.0, "colours are data");
    let depth = shown(Input::Surfaces { shader: Some(Effect::named("show-depth")) });
    let replay = session.replay().expect("a scene");
    let far = replay.surfaces.expect("a shader").parameters["far"];
    assert!(
        matches!(far, Setting::Number(far) if far > 0.1 && far < 10.0),
        "of the size of the scene: {far:?}"
    );
    let edges = shown(Input::Effects { shaders: vec![Effect::named("edges")] });
    assert!(difference(&edges, &depth) > 0.2);
    let agx = shown(Input::Tone { curve: Some(Effect::named("agx")) });
    assert!(difference(&agx, &edges) > 1.0);
    let replay = session.replay().expect("a scene");
    assert_eq!((replay.effects.len(), replay.tone.expect("a curve").name), (1, "agx".to_owned()));
    // What is refused changes nothing.
    session.input(50, Input::Tone { curve: Some(Effect::named("edges")) }).expect("taken");
    wait(&session, "a message", |_, state| state.messages.iter().find(|m| m.error).map(|_| ()));
    let state = session.news().state;
    assert_eq!(state.scene.as_ref().expect("a scene").tone, Some(Effect::named("agx")));
    session.input(51, Input::Plain).expect("taken");
    let again = still(&session, 51);
    assert!(
        difference(&plain, &again) < difference(&plain, &normals) / 4.0,
        "{}",
        difference(&plain, &again)
    );
    let scene = session.news().state.scene.clone().expect("a scene");
    assert!(scene.surfaces.is_none() && scene.effects.is_empty() && scene.tone.is_none());
}

#[test]
fn recordings_can_be_thrown_away() {
    let session = session("cornell");
    paused(&session);
    let views = |session: &Session| session.replay().expect("a scene").keys.len();
    let recorded = |session: &Session| session.news().state.scene.as_ref().and_then(|scene| scene.recorded);
    session.input(10, Input::Record { on: true }).expect("taken");
    session.input(11, Input::Pan { by: [0.1, 0.0] }).expect("taken");
    still(&session, 11);
    std::thread::sleep(Duration::from_millis(50));
    session.input(12, Input::Pan { by: [0.1, 0.0] }).expect("taken");
    still(&session, 12);
    session.input(13, Input::Record { on: false }).expect("taken");
    wait(&session, "its end", |_, state| state.scene.as_ref().filter(|scene| !scene.recording).map(|_| ()));
    assert!(views(&session) > 1 && recorded(&session) > Some(0.0));
    session.input(14, Input::Forget).expect("taken");
    wait(&session, "nothing", |_, state| state.scene.as_ref()?.recorded.is_none().then_some(()));
    assert_eq!(views(&session), 1);
    session.input(15, Input::Record { on: true }).expect("taken");
    wait(&session, "another", |_, state| state.scene.as_ref()?.recording.then_some(()));
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
    session.open(Source::Upload {
        name: "x.glb".into(),
        bytes: Arc::from(*b"nonsense"),
        beside: BTreeMap::new(),
    });
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
