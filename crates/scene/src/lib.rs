//! The seam of Heliostat: **edits in, frames out**.
//!
//! Everything upstream (file importers, animations, APIs, a user's mouse) produces [`Edit`]s; everything
//! downstream (the CPU engine, a cluster, a GPU) is a [`Backend`] that applies edits and answers
//! [`FrameRequest`]s. This crate holds the plain data both sides share and knows nothing of how any of it is
//! rendered, read or sent.
//!
//! Conventions: linear Rec. 709 RGB; metres; seconds; radians; right-handed, +Y up. Transforms name their
//! direction (`world_from_camera`).
//!
//! ```
//! use heliostat_scene::{Material, Mesh, Scene, SceneBuilder};
//!
//! let mut builder = SceneBuilder::new();
//! let grey = builder.material(Material::diffuse("grey", [0.5; 3].into()));
//! let quad = builder.mesh(Mesh::quad([0.0; 3].into(), [1.0, 0.0, 0.0].into(), [0.0, 1.0, 0.0].into()));
//! let object = builder.object("quad", [(quad, grey)]);
//! builder.instance(object, glam::Affine3A::IDENTITY);
//!
//! let mut scene = Scene::default();
//! scene.apply(&builder.finish())?;
//! assert_eq!(scene.instances().len(), 1);
//! # Ok::<(), heliostat_scene::EditError>(())
//! ```
#![forbid(unsafe_code)]

mod apply;
mod attribute;
mod backend;
mod builder;
mod camera;
mod check;
mod edit;
mod environment;
mod frame;
mod geometry;
mod handle;
mod light;
mod material;
mod object;
mod profile;
mod quadric;
mod scene;
mod shader;
mod texture;
mod timeline;

pub use apply::Applied;
pub use attribute::{Attribute, AttributeScope, AttributeValues, Attributes};
pub use backend::{ApplyReport, Backend, BackendError, Progress, RebuildKind, RebuildReason, Rebuilt};
pub use builder::SceneBuilder;
pub use camera::{Camera, Lens, Projection, Stereo, StereoView};
pub use edit::{Edit, EditError, Target};
pub use environment::{Environment, EnvironmentMap, Gradient, ShadedEnvironment, Sky};
pub use frame::{Filter, Frame, FrameRequest, FrameStats, IgiOptions, MaterialOverride, Plane, PlaneData};
pub use geometry::{Geometry, Mesh};
pub use handle::{CameraId, GeometryId, InstanceId, LightId, MaterialId, ObjectId, TextureId};
pub use light::{Light, LightKind};
pub use material::{AlphaMode, Clearcoat, Material, TextureRef, UvTransform, Volume};
pub use object::{Instance, Object, Part};
pub use profile::{Photometry, Profile, ProfileCell};
pub use quadric::{Quadric, Quadrics};
pub use scene::{Scene, SceneBounds};
pub use shader::{ParameterValue, ShaderRef, ShaderUse};
pub use texture::{ColorSpace, Image, Pixels, Texture, Wrap};
pub use timeline::{Clip, Motion, Pose, Timeline};
