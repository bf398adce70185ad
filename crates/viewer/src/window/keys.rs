//! What keys do in the window.

use glam::Vec3;
use winit::keyboard::KeyCode;

use crate::change::Change;
use crate::gizmo::GizmoMode;
use crate::input::{Input, Selection};
use crate::navigator::Mode;
use crate::state::{SceneState, Selected, State};
use crate::style::{Effect, ShaderChoice};

/// For the help on the screen.
pub(super) const HELP: [&str; 26] = [
    "drag, arrows      turn the view, pull a handle",
    "right/shift drag  shift the view",
    "wheel, + -        nearer, further",
    "click, F          select; look at it",
    "Y                 select the next thing (shift: before)",
    "B  Esc            select the whole group, nothing",
    "G R X             handles: move, turn, scale",
    "Tab               next property of the selected thing,",
    "                  or of the view (shift: before)",
    "[ ]               less, more of it (shift: four times);",
    "                  without one: the light's power",
    "Delete  L         remove light, hide thing; add a lamp",
    "W A S D Q E       move (shift: faster)",
    "1 2 3             orbit, fly, walk",
    "H  C              start view, next camera",
    ", .  0            exposure; automatic",
    "T  V              next renderer, next plane",
    "M  N  J           false colours; tone curve; filter",
    "Backspace         show the picture as it is",
    "space  U          play; next clip",
    "PgUp PgDn Home    back, on, start; or drag the bar below",
    "Ctrl+Z, Ctrl+Y    undo, redo",
    "P  I  K           save PNG, EXR, replay",
    "Z  shift+Z        record the replay; forget it",
    "O  F11            figures, full screen",
    "?  drop a file    this help; open it",
];

/// Which way a key goes: right, up, forward.
pub(super) fn way(key: KeyCode) -> Option<Vec3> {
    Some(match key {
        KeyCode::KeyD => Vec3::X,
        KeyCode::KeyA => Vec3::NEG_X,
        KeyCode::KeyE => Vec3::Y,
        KeyCode::KeyQ => Vec3::NEG_Y,
        KeyCode::KeyW => Vec3::Z,
        KeyCode::KeyS => Vec3::NEG_Z,
        _ => return None,
    })
}

/// What goes with a key.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    pub(super) control: bool,
    pub(super) shift: bool,
    /// Exposure and moment of the clip of the picture on show.
    pub(super) ev: f32,
    pub(super) time: f64,
}

/// What a key asks of the session; `camera` counts the cameras gone through.
pub(super) fn input(key: KeyCode, held: Held, state: &State, camera: &mut u32) -> Option<Input> {
    let scene = state.scene.as_ref()?;
    let Held { ev, time, .. } = held;
    let step = if held.shift { 1.0 } else { 0.1 };
    if held.control {
        return match key {
            KeyCode::KeyZ => Some(Input::Undo),
            KeyCode::KeyY => Some(Input::Redo),
            _ => None,
        };
    }
    Some(match key {
        KeyCode::Digit1 => Input::Mode { mode: Mode::Orbit },
        KeyCode::Digit2 => Input::Mode { mode: Mode::Fly },
        KeyCode::Digit3 => Input::Mode { mode: Mode::Walk },
        KeyCode::KeyF => Input::Focus { at: None },
        KeyCode::KeyH => Input::Home,
        KeyCode::KeyC => {
            *camera = (*camera + 1) % (scene.cameras.len() as u32).max(1);
            Input::Camera { index: *camera }
        }
        KeyCode::KeyG => Input::Gizmo { mode: GizmoMode::Move },
        KeyCode::KeyR => Input::Gizmo { mode: GizmoMode::Rotate },
        KeyCode::KeyX => Input::Gizmo { mode: GizmoMode::Scale },
        KeyCode::KeyB => Input::SelectHolder,
        KeyCode::Escape => Input::Select { what: None },
        KeyCode::KeyL => Input::AddLight,
        KeyCode::Space => Input::Play { playing: !scene.playing },
        KeyCode::KeyT => Input::Renderer { name: next(&scene.renderers, Some(&scene.renderer))? },
        KeyCode::KeyV => Input::Show { plane: next_plane(scene) },
        KeyCode::KeyM => next_surfaces(scene),
        KeyCode::KeyN => Input::Tone { curve: next_effect(&scene.pixel_shaders, true, scene.tone.as_ref()) },
        KeyCode::KeyJ => {
            let next = next_effect(&scene.pixel_shaders, false, scene.effects.last());
            Input::Effects { shaders: next.into_iter().collect() }
        }
        KeyCode::Backspace => Input::Plain,
        KeyCode::KeyU if !scene.clips.is_empty() => {
            Input::Clip { index: ((scene.clip + 1) % scene.clips.len()) as u32 }
        }
        KeyCode::PageUp => Input::Seek { time: time - step },
        KeyCode::PageDown => Input::Seek { time: time + step },
        KeyCode::Home => Input::Seek { time: 0.0 },
        KeyCode::KeyY => Input::Select { what: next_thing(scene, held.shift) },
        KeyCode::Delete => removed(scene)?,
        KeyCode::KeyZ if held.shift => Input::Forget,
        KeyCode::KeyZ => Input::Record { on: !scene.recording },
        KeyCode::Comma => Input::Exposure { stops: Some(ev - 0.25) },
        KeyCode::Period => Input::Exposure { stops: Some(ev + 0.25) },
        KeyCode::Digit0 => Input::Exposure { stops: None },
        KeyCode::BracketLeft => brighter(scene, 0.8)?,
        KeyCode::BracketRight => brighter(scene, 1.25)?,
        KeyCode::Equal | KeyCode::NumpadAdd => Input::Zoom { steps: 1.0 },
        KeyCode::Minus | KeyCode::NumpadSubtract => Input::Zoom { steps: -1.0 },
        _ => return None,
    })
}

/// The name after this one, from the start again after the last.
fn next(names: &[String], now: Option<&String>) -> Option<String> {
    let at = now.and_then(|now| names.iter().position(|name| name == now));
    names.get(at.map_or(0, |at| (at + 1) % names.len().max(1))).cloned()
}

/// After the last plane comes the picture again.
fn next_plane(scene: &SceneState) -> Option<String> {
    let last = scene.plane.is_some() && scene.plane.as_ref() == scene.planes.last();
    if last { None } else { next(&scene.planes, scene.plane.as_ref()) }
}

/// As they are, all diffuse, then the false colours.
fn next_surfaces(scene: &SceneState) -> Input {
    match &scene.surfaces {
        None if !scene.diffuse => Input::Diffuse { on: true },
        now => {
            let at = now.as_ref().and_then(|now| scene.false_colors.iter().position(|c| c.name == now.name));
            match scene.false_colors.get(at.map_or(0, |at| at + 1)) {
                Some(next) => Input::Surfaces { shader: Some(Effect::named(&next.name)) },
                None => Input::Surfaces { shader: None },
            }
        }
    }
}

/// The tone curve or other pixel shader after this one; after the last comes none.
fn next_effect(choices: &[ShaderChoice], curve: bool, now: Option<&Effect>) -> Option<Effect> {
    // The heat map is no curve that one would look at pictures by.
    let is_curve = |choice: &ShaderChoice| choice.for_display && choice.name != "heat";
    let names = choices.iter().filter(|choice| is_curve(choice) == curve).map(|choice| &choice.name);
    let mut rest = names.skip_while(|name| now.is_some_and(|now| now.name != **name));
    let next = if now.is_some() { rest.nth(1) } else { rest.next() };
    next.map(Effect::named)
}

/// The instance of the list after the selected one, or before it; after the last comes none.
fn next_thing(scene: &SceneState, back: bool) -> Option<Selection> {
    let now = match scene.selection {
        Some(Selected::Instance { instance, .. }) => {
            scene.things.iter().position(|thing| thing.id == instance)
        }
        _ => None,
    };
    let next = match (now, back) {
        (None, false) => Some(0),
        (None, true) => scene.things.len().checked_sub(1),
        (Some(now), false) => Some(now + 1),
        (Some(now), true) => now.checked_sub(1),
    };
    let thing = scene.things.get(next?)?;
    Some(Selection::Instance { instance: thing.id, material: None, holders: Vec::new() })
}

/// Without the selected light, or with the selected thing hidden.
fn removed(scene: &SceneState) -> Option<Input> {
    let change = match *scene.selection.as_ref()? {
        Selected::Light { light } => Change::Light { light, name: String::new(), to: None },
        Selected::Instance { instance, .. } => Change::Show { instance, visible: false },
    };
    // Never one with what was done before.
    Some(Input::Change { change, gesture: REMOVED })
}

/// A gesture that no other has; two removals in a row are of different things.
const REMOVED: u64 = (1 << 61) - 1;

/// The selected light, or the glow of the selected thing, times a factor.
fn brighter(scene: &SceneState, factor: f32) -> Option<Input> {
    let change = match scene.selection.as_ref()? {
        Selected::Light { light } => {
            let state = scene.lights.iter().find(|state| state.id == *light)?;
            let to = Some(state.lamp.clone().times(factor));
            Change::Light { light: *light, name: state.name.clone(), to }
        }
        Selected::Instance { material, look, .. } => {
            let mut look = look.clone()?;
            look.emissive = look.emissive.map(|value| value * factor);
            Change::Material { material: (*material)?, look }
        }
    };
    Some(Input::Change { change, gesture: 0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::style::pixel_shaders;

    #[test]
    fn lists_are_gone_through_in_a_circle() {
        let names: Vec<String> = ["a", "b"].map(Into::into).to_vec();
        assert_eq!(next(&names, None).as_deref(), Some("a"));
        assert_eq!(next(&names, Some(&names[1])).as_deref(), Some("a"));
        assert_eq!(next(&[], None), None);
        let choices = pixel_shaders();
        let mut curves = vec![next_effect(&choices, true, None)];
        while let Some(Some(last)) = curves.last() {
            curves.push(next_effect(&choices, true, Some(last)));
        }
        let names: Vec<_> = curves.iter().flatten().map(|effect| effect.name.as_str()).collect();
        assert_eq!(names, ["aces", "agx", "clip", "filmic", "reinhard"]);
        assert_eq!(next_effect(&choices, false, None), Some(Effect::named("edges")));
        assert!(HELP.iter().all(|line| line.is_ascii() && line.len() < 60));
    }
}
