//! The CPU backend: compiles edits into worlds and shader tables, renders tiles on all cores, and tone maps.
//!
//! ```
//! use heliostat_engine::{Engine, EngineOptions};
//! use heliostat_scene::{Backend, Camera, FrameRequest, Light, LightKind, Material, Mesh, Progress, SceneBuilder};
//!
//! let mut scene = SceneBuilder::new();
//! let grey = scene.material(Material::diffuse("grey", [0.5; 3].into()));
//! let floor = scene.mesh(Mesh::quad([-1.0, 0.0, 1.0].into(), [2.0, 0.0, 0.0].into(), [0.0, 0.0, -2.0].into()));
//! let object = scene.object("floor", [(floor, grey)]);
//! scene.instance(object, glam::Affine3A::IDENTITY);
//! let sun = LightKind::Directional { direction: [0.0, -1.0, 0.0].into(), irradiance: [2.0; 3].into() };
//! scene.light(Light { name: "sun".into(), kind: sun });
//!
//! let mut engine = Engine::new(EngineOptions::default())?;
//! engine.apply(&scene.finish(), &Progress::new())?;
//! let camera = Camera::look_at("", [0.0, 3.0, 0.1].into(), [0.0; 3].into(), [0.0, 0.0, -1.0].into(), 0.5);
//! let frame = engine.render(&FrameRequest::new(camera, 8, 8), &Progress::new())?;
//! // Lambert: 0.5 / π · 2.
//! assert!((frame.color[27].x - 1.0 / std::f32::consts::PI).abs() < 1e-4);
//! # Ok::<(), heliostat_scene::BackendError>(())
//! ```
#![forbid(unsafe_code)]

mod compile;
mod engine;
mod film;
mod igi;
mod meter;
mod photometry;
mod post;
mod queue;

pub use engine::{Accelerator, Engine, EngineOptions};
pub use heliostat_shading::{LaneMode, ShaderRegistry, tone};
pub use photometry::{FluxBalance, Photometry, PhotometryRequest};
