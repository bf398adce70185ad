//! Heliostat: real-time ray tracing and interactive global illumination.
//!
//! **Edits in, frames out.** Whatever makes a scene ([`builtin`], [`formats`], your program) produces
//! [`scene::Edit`]s; a [`scene::Backend`] such as [`engine::Engine`] applies them and answers
//! [`scene::FrameRequest`]s. This crate gathers the rooms and adds what their users share: a point of view
//! ([`framing`]) and light ([`lighting`]) for scenes that bring none, [`grouping`], which merges what never moves, and
//! [`compare`], which measures how far two pictures are apart.
//!
//! ```
//! use heliostat::engine::{Engine, EngineOptions, tone};
//! use heliostat::scene::{Backend, FrameRequest, Progress};
//!
//! let edits = heliostat::builtin::build("cornell").expect("a built-in scene");
//! let mut engine = Engine::new(EngineOptions::default())?;
//! engine.apply(&edits, &Progress::new())?;
//!
//! let camera = engine.scene().cameras().values().next().expect("it has cameras").clone();
//! let request = FrameRequest { samples: 4, ..FrameRequest::new(camera, 32, 32) };
//! let frame = engine.render(&request, &Progress::new())?;
//! let rgb8 = tone::tone_map(&frame.color, tone::auto_exposure(&frame.color));
//! assert_eq!(rgb8.len(), 32 * 32 * 3);
//! # Ok::<(), heliostat::scene::BackendError>(())
//! ```
#![forbid(unsafe_code)]

pub mod compare;
pub mod framing;
pub mod grouping;
pub mod lighting;

pub use heliostat_builtin as builtin;
pub use heliostat_engine as engine;
pub use heliostat_formats as formats;
pub use heliostat_kernel as kernel;
pub use heliostat_plugins as plugins;
pub use heliostat_scene as scene;
pub use heliostat_shading as shading;
pub use heliostat_transport as transport;
