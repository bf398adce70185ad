//! Changes to a scene: the one language between everything that makes scenes and everything that renders them.

use std::sync::Arc;

use glam::Affine3A;

use crate::{
    Attribute, Camera, CameraId, Environment, Geometry, GeometryId, Instance, InstanceId, Light, LightId,
    Material, MaterialId, Object, ObjectId, Texture, TextureId,
};

/// One change. The variants named after a thing define it, or replace what had the handle before.
///
/// A list of edits is applied as a whole: references may point forward within the list.
#[derive(Clone, Debug)]
pub enum Edit {
    /// Defines or replaces a geometry. Its attributes stay, and must fit.
    Geometry(GeometryId, Geometry),
    /// Removes a geometry no object uses, with its attributes.
    RemoveGeometry(GeometryId),
    /// Defines or replaces an attribute of a geometry, by its name. Touches nothing else.
    Attribute(GeometryId, String, Attribute),
    /// Removes an attribute of a geometry.
    RemoveAttribute(GeometryId, String),
    /// Defines or replaces a texture.
    Texture(TextureId, Arc<Texture>),
    /// Removes a texture no material uses.
    RemoveTexture(TextureId),
    /// Defines or replaces a material.
    Material(MaterialId, Arc<Material>),
    /// Removes a material no object uses.
    RemoveMaterial(MaterialId),
    /// Defines or replaces an object's parts; instances placed in it stay.
    Object(ObjectId, Object),
    /// Removes an object that no instance places or is placed in.
    RemoveObject(ObjectId),
    /// Defines or replaces an instance.
    Instance(InstanceId, Instance),
    /// Changes where an instance stands, at rest, and nothing else.
    MoveInstance(InstanceId, Affine3A),
    /// Changes where an instance stands when the shutter opens and when it closes, and nothing else.
    SweepInstance(InstanceId, Affine3A, Affine3A),
    /// Shows or hides an instance and changes nothing else.
    ShowInstance(InstanceId, bool),
    /// Removes an instance.
    RemoveInstance(InstanceId),
    /// Defines or replaces a light.
    Light(LightId, Light),
    /// Removes a light.
    RemoveLight(LightId),
    /// Defines or replaces a camera.
    Camera(CameraId, Camera),
    /// Removes a camera.
    RemoveCamera(CameraId),
    /// Replaces the environment.
    Environment(Environment),
}

/// What an edit or an error is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[expect(missing_docs, reason = "each variant is the handle it holds")]
pub enum Target {
    Geometry(GeometryId),
    Texture(TextureId),
    Material(MaterialId),
    Object(ObjectId),
    Instance(InstanceId),
    Light(LightId),
    Camera(CameraId),
    Environment,
}

impl std::fmt::Display for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Geometry(id) => id.fmt(f),
            Self::Texture(id) => id.fmt(f),
            Self::Material(id) => id.fmt(f),
            Self::Object(id) => id.fmt(f),
            Self::Instance(id) => id.fmt(f),
            Self::Light(id) => id.fmt(f),
            Self::Camera(id) => id.fmt(f),
            Self::Environment => f.write_str("the environment"),
        }
    }
}

/// Why a list of edits was refused. The scene is then as it was before.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EditError {
    /// The data contradicts itself or is out of range.
    #[error("{target}: {problem}")]
    Invalid {
        /// What the edit defines.
        target: Target,
        /// What is wrong, with the value and the fix.
        problem: String,
    },
    /// The edit refers to something that is not there.
    #[error(
        "{target} refers to {missing}, which does not exist; define it in the same or an earlier list of edits"
    )]
    Dangling {
        /// What the edit defines.
        target: Target,
        /// What it needs.
        missing: Target,
    },
    /// The edit changes or removes something that is not there.
    #[error("{target} cannot be changed or removed: it does not exist")]
    Unknown {
        /// What the edit names.
        target: Target,
    },
    /// The edit removes something still in use.
    #[error("{target} cannot be removed: {user} uses it; remove or change {user} first")]
    InUse {
        /// What the edit removes.
        target: Target,
        /// One of those that use it.
        user: Target,
    },
    /// The instances would contain themselves.
    #[error("{target} would contain itself through its instances; break the cycle")]
    Cycle {
        /// An object on the cycle.
        target: Target,
    },
}
