//! Surface shaders that a material names in its `extras`.

use std::collections::BTreeMap;

use glam::Vec3;
use heliostat_scene::{ColorSpace, ParameterValue, ShaderRef, ShaderUse};
use serde::Deserialize;
use serde_json::Value;

use super::Loader;
use super::container::file_name;
use super::json::{MaterialShader, ShaderParameter};
use crate::error::LoadError;

impl Loader<'_, '_> {
    /// The shader that a material asks for. Where what is written makes no sense, a warning says that there is none.
    pub(super) fn shader(&mut self, written: &Value, path: &str) -> Result<Option<ShaderUse>, LoadError> {
        let path = format!("{path}.extras.heliostat_shader");
        let described = MaterialShader::deserialize(written)
            .map_err(|error| error.to_string())
            .and_then(|described| Ok((self.shader_ref(&described)?, described.parameters)));
        let (shader, written) = match described {
            Ok(described) => described,
            Err(problem) => {
                let hint = "the material goes without a shader; write {\"name\": …} or {\"plugin\": …, \"shader\": …}";
                self.context.warn(self.place(&path), problem, hint);
                return Ok(None);
            }
        };
        let mut parameters = BTreeMap::new();
        for (name, value) in &written {
            if let Some(value) = self.shader_parameter(value, &format!("{path}.parameters.{name}"))? {
                parameters.insert(name.clone(), value);
            }
        }
        Ok(Some(ShaderUse { shader, parameters }))
    }

    fn shader_ref(&self, described: &MaterialShader) -> Result<ShaderRef, String> {
        match (&described.name, &described.plugin, &described.shader) {
            (Some(name), None, None) => Ok(ShaderRef::Named(name.clone())),
            (None, Some(plugin), Some(shader)) => {
                let located = self.context.locate(&file_name(plugin));
                let file = located.map_err(|error| format!("plug-in `{plugin}`: {error}"))?;
                Ok(ShaderRef::Plugin { file, shader: shader.clone() })
            }
            _ => Err("the shader has neither `name` alone nor `plugin` with `shader`".into()),
        }
    }

    fn shader_parameter(
        &mut self,
        value: &ShaderParameter,
        path: &str,
    ) -> Result<Option<ParameterValue>, LoadError> {
        let (value, finite) = match value {
            ShaderParameter::Float(value) => (ParameterValue::Float(*value), value.is_finite()),
            ShaderParameter::Vector(value) => {
                let value = Vec3::from_array(*value);
                (ParameterValue::Vector(value), value.is_finite())
            }
            ShaderParameter::Attribute(attribute) => {
                let factor = Vec3::from_array(attribute.factor);
                (ParameterValue::Attribute(attribute.attribute.clone(), factor), factor.is_finite())
            }
            ShaderParameter::Texture(texture) => {
                let color_space = if texture.linear { ColorSpace::Linear } else { ColorSpace::Srgb };
                let factor = Vec3::from_array(texture.factor);
                let Some(reference) = self.texture(Some(&texture.info), color_space, path)? else {
                    return Ok(None);
                };
                (ParameterValue::Texture(reference, factor), factor.is_finite())
            }
        };
        if !finite {
            let hint = "the shader's own value was taken";
            self.context.warn(self.place(path), "the parameter is not finite", hint);
        }
        Ok(finite.then_some(value))
    }
}
