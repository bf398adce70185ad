//! What keys do in the window.

use glam::Vec3;
use winit::keyboard::KeyCode;

use crate::change::Change;
use crate::gizmo::GizmoMode;
use crate::input::Input;
use crate::navigator::Mode;
use crate::state::{SceneState, Selected, State};

/// For the help on the screen.
pub(super) const HELP: [&str; 17] = [
    "drag              turn the view, pull a handle",
    "right/shift drag  shift the view",
    "wheel             nearer, further",
    "click, F          select; look at it",
    "W A S D Q E       move (shift: faster)",
    "1 2 3             orbit, fly, walk",
    "H  C              start view, next camera",
    "G R X             handles: move, turn, scale",
    "B  Esc            whole group, nothing",
    "[ ]  L            selected light's power; add a lamp",
    ", .  0            exposure; automatic",
    "space  T  V       play; next renderer, next plane",
    "Ctrl+Z, Ctrl+Y    undo, redo",
    "P  I  K           save PNG, EXR, replay",
    "O  F11            figures, full screen",
    "drop a file       open it",
    "?                 this help",
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

/// What a key asks of the session. `control` is held; `camera` counts the cameras gone through; `ev` is the exposure now.
pub(super) fn input(key: KeyCode, control: bool, state: &State, camera: &mut u32, ev: f32) -> Option<Input> {
    let scene = state.scene.as_ref()?;
    if control {
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

    #[test]
    fn lists_are_gone_through_in_a_circle() {
        let names: Vec<String> = ["a", "b"].map(Into::into).to_vec();
        assert_eq!(next(&names, None).as_deref(), Some("a"));
        assert_eq!(next(&names, Some(&names[1])).as_deref(), Some("a"));
        assert_eq!(next(&[], None), None);
        assert!(HELP.iter().all(|line| line.is_ascii() && line.len() < 60));
    }
}
