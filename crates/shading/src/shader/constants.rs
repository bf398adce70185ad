//! Parameters that are the same everywhere: those of pixel and environment shaders.

use glam::Vec3;
use heliostat_scene::{ParameterValue, ShaderUse};

use super::{Parameter, ParameterKind, ShaderProblem};
use crate::lanes::{Real, Vector};

/// The values of a shader's parameters: the same for all lanes.
#[derive(Clone, Copy, Debug)]
pub struct Constants<'a, F: Real> {
    pub(crate) token: F::Token,
    pub(crate) values: &'a [Vec3],
}

impl<F: Real> Constants<'_, F> {
    /// The parameter at a place of the shader's list, as a vector or colour.
    #[inline(always)]
    pub fn vector(&self, parameter: usize) -> Vector<F> {
        Vector::constant(self.token, self.values[parameter])
    }

    /// The parameter as a number.
    #[inline(always)]
    pub fn float(&self, parameter: usize) -> F {
        F::constant(self.token, self.values[parameter].x)
    }
}

/// The values of a shader's parameters in their order; `what` names the shader in errors.
///
/// # Errors
/// If there is no such parameter, or a value varies, is out of range or not finite.
pub(crate) fn constants(
    what: &str,
    parameters: &[Parameter],
    wanted: &ShaderUse,
) -> Result<Vec<Vec3>, ShaderProblem> {
    let problem = |text: String| Err(ShaderProblem(text));
    let mut values: Vec<Vec3> = parameters.iter().map(|p| p.default.into()).collect();
    for (parameter, value) in &wanted.parameters {
        let Some(place) = parameters.iter().position(|p| p.name == *parameter) else {
            let known: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
            let known = if known.is_empty() { "none".into() } else { known.join(", ") };
            return problem(format!("{what} has no parameter `{parameter}`; it has: {known}"));
        };
        let value = match value {
            ParameterValue::Float(value) => Vec3::splat(*value),
            ParameterValue::Vector(value) => *value,
            ParameterValue::Texture(..) | ParameterValue::Attribute(..) => {
                return problem(format!("`{parameter}` of {what} cannot be a texture or an attribute"));
            }
        };
        let described = &parameters[place];
        let value = if described.kind == ParameterKind::Float { Vec3::splat(value.x) } else { value };
        let [low, high] = described.range;
        let inside = value.cmpge(Vec3::splat(low)).all() && value.cmple(Vec3::splat(high)).all();
        if !inside {
            return problem(format!("`{parameter}` of {what} is {value}; give values from {low} to {high}"));
        }
        values[place] = value;
    }
    Ok(values)
}
