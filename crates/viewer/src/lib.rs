//! Looks at scenes and changes them, over any [`Backend`](heliostat_scene::Backend).
//!
//! A [`Session`] holds a scene and a view of it. Faces send [`Input`]s and show what comes out: the latest [`Picture`]
//! and the latest [`State`]. Pictures are made on a thread of their own: inputs never wait, the latest view wins, and
//! pictures that are late are left out, not queued. While something moves, a governor holds the frame time; when all
//! stands still, frames add up to a picture without noise.
//!
//! Of scenes and files this crate knows nothing: a [`Host`] opens them.
#![forbid(unsafe_code)]

mod change;
mod document;
mod geometry;
mod gizmo;
mod governor;
mod hand;
mod host;
mod input;
mod lent;
mod luminaire;
mod navigator;
mod pick;
mod picture;
mod placed;
mod refine;
mod replay;
mod session;
#[cfg(test)]
mod session_tests;
mod stage;
mod state;
mod stats;
mod style;
mod web;
mod window;
mod worker;

pub use change::{Change, Lamp, Look, Own, Surroundings};
pub use document::Refusal;
pub use gizmo::{GizmoMode, Line, LineKind};
pub use host::{Host, Opened, Source};
pub use input::{Button, Input, Phase, Selection};
pub use luminaire::{Beam, Luminaire, ShadedLamp};
pub use navigator::Mode;
pub use picture::{PackError, Picture, plane_bytes, plane_colors};
pub use replay::{Key, KeyLens, KeyStereo, KeyView, Replay, Timed};
pub use session::{News, Session, SessionOptions};
pub use state::{LightState, Loading, Message, SceneState, Selected, State, Thing};
pub use stats::Stats;
pub use style::{Effect, ParameterChoice, Setting, ShaderChoice, false_colors, pixel_shaders};
pub use web::{Limits, ServeOptions, Server};
pub use window::{WindowError, WindowOptions, show_window};
