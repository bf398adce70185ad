//! What users can do: the one language between the faces (page, window) and a session.

use glam::Vec2;
use serde::{Deserialize, Serialize};

use crate::change::Change;
use crate::gizmo::GizmoMode;
use crate::navigator::Mode;
use crate::placed::MAX_NESTING;
use crate::style::Effect;

/// Something that a user did. Points of the picture run from (0, 0) at the top left to (1, 1) at the bottom right.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Input {
    /// The picture has room for so many pixels.
    Size {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// A pointer was pressed, moved while pressed, or let go. A click picks; a drag uses a handle or turns the view.
    Pointer {
        /// Pressed, moved or let go.
        phase: Phase,
        /// Where.
        at: [f32; 2],
        /// Which button, or what stands for it.
        #[serde(default)]
        button: Button,
    },
    /// Shifts the view by shares of the picture's height.
    Pan {
        /// Right and down.
        by: [f32; 2],
    },
    /// Goes nearer (positive) or further.
    Zoom {
        /// By a tenth each.
        steps: f32,
    },
    /// Goes this way until told otherwise: right, up, forward, −1 to 1 each.
    Drive {
        /// All zero stops.
        way: [f32; 3],
        /// Four times as fast.
        #[serde(default)]
        hurry: bool,
    },
    /// Moves another way.
    Mode {
        /// Which.
        mode: Mode,
    },
    /// Goes to a camera of the scene.
    Camera {
        /// Its place in the list of the state.
        index: u32,
    },
    /// Goes back to the view of the beginning.
    Home,
    /// Goes to a view as [`crate::Picture::view`] tells it.
    View {
        /// Eight numbers.
        text: String,
    },
    /// Changes the vertical field of view.
    Field {
        /// Degrees.
        degrees: f32,
    },
    /// Looks at the selected thing, or at what is under a point, and turns around it from now on.
    Focus {
        /// The point, if it is not about the selected thing.
        #[serde(default)]
        at: Option<[f32; 2]>,
    },
    /// Selects something, or nothing.
    Select {
        /// What.
        what: Option<Selection>,
    },
    /// Selects what holds the selected instance: one level further out.
    SelectHolder,
    /// What the handles do.
    Gizmo {
        /// Which.
        mode: GizmoMode,
    },
    /// Changes the scene. Changes of the same gesture are undone together.
    Change {
        /// What.
        change: Change,
        /// A number of the user's choice.
        #[serde(default)]
        gesture: u64,
    },
    /// Adds a point light where the view looks.
    AddLight,
    /// Takes the last change back.
    Undo,
    /// Makes it again.
    Redo,
    /// Plays or pauses.
    Play {
        /// Whether it plays.
        playing: bool,
    },
    /// Goes to a moment of the clip.
    Seek {
        /// Seconds.
        time: f64,
    },
    /// Plays another clip.
    Clip {
        /// Its place in the list of the state.
        index: u32,
    },
    /// How fast the clip plays.
    Rate {
        /// 1 is as it was made.
        rate: f64,
    },
    /// Renders another way.
    Renderer {
        /// A name from the list of the state.
        name: String,
    },
    /// Shows a plane of data instead of the picture.
    Show {
        /// Its name, or nothing for the picture.
        plane: Option<String>,
    },
    /// Shows all surfaces as diffuse.
    Diffuse {
        /// Whether.
        on: bool,
    },
    /// Shows all surfaces by a shader instead of their own (and not as diffuse), such as one that shows a quantity in false colours.
    Surfaces {
        /// Which, or nothing for the surfaces as they are.
        shader: Option<Effect>,
    },
    /// Puts the picture through pixel shaders.
    Effects {
        /// Which, in this order; none for the picture as it is.
        shaders: Vec<Effect>,
    },
    /// Chooses the curve by which radiance becomes colours for a display.
    Tone {
        /// A pixel shader that is one, or nothing for the usual one.
        curve: Option<Effect>,
    },
    /// Shows the picture as it is again: no plane, no false colours, no pixel shaders, the usual curve and exposure.
    Plain,
    /// How bright the picture is.
    Exposure {
        /// Stops, or nothing to let the picture decide.
        stops: Option<f32>,
    },
    /// Frames per second to hold while moving.
    Goal {
        /// Nothing always makes the whole picture.
        frames_per_second: Option<f32>,
    },
    /// Starts recording the camera's path and the changes, in place of what was recorded before, or ends it.
    Record {
        /// Whether.
        on: bool,
    },
    /// Throws the recording away, finished or not.
    Forget,
}

/// Phases of a drag.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(missing_docs, reason = "the names say it")]
pub enum Phase {
    Down,
    Move,
    Up,
}

/// What a drag does where there is no handle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Button {
    /// Turns the view.
    #[default]
    Turn,
    /// Shifts it.
    Pan,
}

/// What can be selected, by the numbers of handles.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Selection {
    /// An instance, and the material by which it was picked.
    Instance {
        /// The instance.
        instance: u32,
        /// The material; without one, the first of its object.
        #[serde(default)]
        material: Option<u32>,
        /// Where the group that holds it is placed several times: the instances around it, from the innermost to one in the
        /// world. What is missing is the first placement that there is.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        holders: Vec<u32>,
    },
    /// A light without surface.
    Light {
        /// The light.
        light: u32,
    },
}

/// Longest text in an input, bytes.
const MAX_TEXT: usize = 1000;
/// Largest number that means anything as a length, a share or a rate.
const MAX_NUMBER: f64 = 1e9;

impl Input {
    /// What is out of range, if anything; numbers in changes are checked by the scene itself.
    pub fn problem(&self) -> Option<String> {
        let number = |n: f64| (n.is_nan() || n.abs() > MAX_NUMBER).then(|| format!("{n} is out of range"));
        let numbers = |list: &[f32]| list.iter().find_map(|&n| number(n.into()));
        let text = |text: &str| (text.len() > MAX_TEXT).then(|| format!("a text of {} bytes", text.len()));
        match self {
            Self::Pointer { at, .. } | Self::Focus { at: Some(at) } | Self::Pan { by: at } => numbers(at),
            Self::Zoom { steps } | Self::Exposure { stops: Some(steps) } => numbers(&[*steps]),
            Self::Field { degrees } => numbers(&[*degrees]),
            Self::Drive { way, .. } => numbers(way),
            Self::Seek { time } | Self::Rate { rate: time } => number(*time),
            Self::View { text: given } | Self::Renderer { name: given } => text(given),
            Self::Show { plane: Some(name) } => text(name),
            Self::Surfaces { shader } | Self::Tone { curve: shader } => {
                shader.as_ref().and_then(Effect::problem)
            }
            Self::Effects { shaders } => shaders.iter().find_map(Effect::problem),
            Self::Change { change: Change::Light { name, .. }, .. } => text(name),
            Self::Select { what: Some(Selection::Instance { holders, .. }) } => {
                (holders.len() > MAX_NESTING).then(|| format!("{} levels of groups", holders.len()))
            }
            Self::Goal { frames_per_second: Some(rate) } if !(0.1..=1000.0).contains(rate) => {
                Some(format!("{rate} frames per second; give 0.1 to 1000"))
            }
            _ => None,
        }
    }

    /// Whether it can change what is seen: then a picture that is only being refined is given up for it.
    pub(crate) fn is_urgent(&self) -> bool {
        !matches!(self, Self::Record { .. } | Self::Forget | Self::Gizmo { .. })
    }
}

/// The point of an input as a vector.
pub(crate) fn point(at: [f32; 2]) -> Vec2 {
    at.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_have_a_form_on_the_wire() {
        let parse = |text: &str| serde_json::from_str::<Input>(text);
        let pointer = r#"{"do":"pointer","phase":"down","at":[0.5,0.25],"button":"pan"}"#;
        let expected = Input::Pointer { phase: Phase::Down, at: [0.5, 0.25], button: Button::Pan };
        assert_eq!(parse(pointer).unwrap(), expected);
        assert_eq!(parse(r#"{"do":"undo"}"#).unwrap(), Input::Undo);
        let light = r#"{"do":"change","gesture":3,"change":{"kind":"light","light":0,"name":"a",
            "to":{"type":"point","position":[0,1,2],"intensity":[1,1,1]}}}"#;
        assert!(matches!(parse(light).unwrap(), Input::Change { gesture: 3, .. }));
        for bad in [r#"{"do":"explode"}"#, r#"{"do":"zoom"}"#, r#"{"do":"zoom","steps":1,"x":2}"#, "[]", "1"]
        {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn numbers_out_of_range_are_told() {
        assert!(Input::Zoom { steps: f32::INFINITY }.problem().is_some());
        assert!(Input::Pan { by: [f32::NAN, 0.0] }.problem().is_some());
        assert!(Input::View { text: "1".repeat(5000) }.problem().is_some());
        assert!(Input::Goal { frames_per_second: Some(0.0) }.problem().is_some());
        assert!(Input::Zoom { steps: 1.0 }.problem().is_none());
    }
}
