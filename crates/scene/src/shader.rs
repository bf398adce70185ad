//! Shaders by name, and values for their parameters.

use std::collections::BTreeMap;
use std::path::PathBuf;

use glam::Vec3;

use crate::TextureRef;

/// A surface shader and what its parameters are set to. Parameters that are not named keep the shader's defaults.
#[derive(Clone, Debug, PartialEq)]
pub struct ShaderUse {
    /// Which one.
    pub shader: ShaderRef,
    /// Values by the parameter's name.
    pub parameters: BTreeMap<String, ParameterValue>,
}

impl ShaderUse {
    /// A shader that comes with the engine, all parameters at their defaults.
    pub fn named(name: impl Into<String>) -> Self {
        Self { shader: ShaderRef::Named(name.into()), parameters: BTreeMap::new() }
    }

    /// The same with a parameter set.
    #[must_use]
    pub fn with(mut self, parameter: impl Into<String>, value: impl Into<ParameterValue>) -> Self {
        self.parameters.insert(parameter.into(), value.into());
        self
    }

    /// Every texture it refers to, with the parameter's name.
    pub fn textures(&self) -> impl Iterator<Item = (&str, &TextureRef)> {
        self.parameters.iter().filter_map(|(name, value)| match value {
            ParameterValue::Texture(texture, _) => Some((name.as_str(), texture)),
            _ => None,
        })
    }
}

/// Which shader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ShaderRef {
    /// One that comes with the engine, or that the program registered.
    Named(String),
    /// One in a shared library.
    Plugin {
        /// The library's file.
        file: PathBuf,
        /// The shader's name in it.
        shader: String,
    },
}

/// What a parameter is set to.
#[derive(Clone, Debug, PartialEq)]
pub enum ParameterValue {
    /// A number, in the parameter's unit. Vectors and colours take it for all components.
    Float(f32),
    /// A vector, or a linear Rec. 709 RGB colour. Numbers take the first component.
    Vector(Vec3),
    /// A texture times a factor.
    Texture(TextureRef, Vec3),
    /// The attribute of that name of whatever geometry the shader is used on, times a factor. Where a geometry has none, the
    /// shader's default.
    Attribute(String, Vec3),
}

impl From<f32> for ParameterValue {
    fn from(value: f32) -> Self {
        Self::Float(value)
    }
}

impl From<Vec3> for ParameterValue {
    fn from(value: Vec3) -> Self {
        Self::Vector(value)
    }
}
