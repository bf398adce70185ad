//! What a hit looks like: surfaces, lights, cameras, environments, textures and samplers.
//!
//! This crate turns the kernel's hits into [`Surface`]s with scattering functions ([`Bsdf`]) and samples the scene's
//! [`Lights`]. It knows nothing of accelerators, tiles or files. Directions point away from surfaces; `wo` towards the
//! viewer, `wi` towards the light; densities are per steradian unless said otherwise.
#![forbid(unsafe_code)]

mod adjoint;
pub mod albedo;
mod attribute;
mod basis;
mod bsdf;
mod camera;
mod closure;
pub mod color;
mod emission;
mod environment;
mod environment_shader;
mod filter;
pub mod fresnel;
#[cfg(test)]
mod furnace;
mod gather;
mod lamp;
mod lamps;
pub mod lanes;
mod light;
mod light_shader;
mod lobe_set;
mod lobes;
mod material;
pub mod microfacet;
mod packet;
pub mod pixel;
mod placement;
mod point;
mod punctual;
mod quadric;
mod receive;
mod reflectors;
#[cfg(test)]
mod same_bits;
mod sampler;
pub mod sampling;
mod scene;
mod shader;
mod sky;
mod sort;
mod surface;
mod texture;
pub mod tone;

pub use adjoint::{PatchGloss, PatchReflectance};
pub use basis::Basis;
pub use bsdf::{Bsdf, BsdfSample, BsdfValue};
pub use camera::{
    CameraInfo, CameraRay, CameraRays, CameraShader, Cone, PicturePlace, PicturePoints, RayPacket,
    ShadedCamera, Viewer,
};
pub use closure::{Closure, Closures};
pub use emission::{EmittedRay, Source};
pub use environment::EnvironmentLight;
pub use environment_shader::{EnvironmentInfo, EnvironmentShader, ShaderLight};
pub use filter::PixelFilter;
pub use lamps::Lamps;
pub use light::{LightSample, Lights};
pub use light_shader::{LightInfo, LightShader};
pub use lobe_set::{Lobes, Selection};
pub use material::{InterfaceCache, SurfaceMaterial};
pub use packet::{Illumination, Scattered, Scattering};
pub use placement::{Placement, ShadedPart, Sweep};
pub use point::{Arrival, Points, Probes};
pub use punctual::PunctualLight;
pub use quadric::kernel_quadric;
pub use receive::{PointLight, Received, Receivers, Taking};
pub use reflectors::Reflector;
pub use sampler::{SamplePoints, Sampler, Samplers, halves};
pub use scene::{EmitterPdf, ShadingScene};
pub use shader::{
    Constants, Input, Inputs, OnLanes, Parameter, ParameterKind, PluginSource, Point, ShaderInfo,
    ShaderProblem, ShaderRegistry, SurfaceProgram, SurfaceShader, heat_color,
};
pub use sort::{HitPacket, HitSorter};
pub use surface::{LaneMode, ShadeScratch, Surface, Surfaces};
pub use texture::MipMap;
