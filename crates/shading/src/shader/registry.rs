//! Shaders by name.

use std::collections::BTreeMap;
use std::sync::Arc;

use heliostat_scene::{ParameterValue, ShaderRef, ShaderUse, TextureId};

use super::builtin;
use super::{
    Input, Inputs, OnLanes, Parameter, ParameterKind, Point, ShaderInfo, SurfaceProgram, SurfaceShader,
};
use crate::bsdf::Lobes;
use crate::closure::Closure;
use crate::lanes::{Real, Vector};
use crate::material::Slot;
use crate::texture::MipMap;

/// The surface shaders that materials can name.
#[derive(Clone, Debug, Default)]
pub struct ShaderRegistry {
    programs: BTreeMap<String, Arc<dyn SurfaceProgram>>,
}

/// A material names a shader or a parameter that there is not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownShader(pub String);

impl ShaderRegistry {
    /// The shaders that come with the engine.
    pub fn built_in() -> Self {
        let mut registry = Self::default();
        builtin::register(&mut registry);
        registry
    }

    /// Adds a shader under its name, in place of one that has it already.
    pub fn register(&mut self, shader: impl SurfaceShader) {
        self.register_program(Arc::new(OnLanes(shader)));
    }

    /// Adds a program under its name, in place of one that has it already.
    pub fn register_program(&mut self, program: Arc<dyn SurfaceProgram>) {
        self.programs.insert(program.info().name, program);
    }

    /// All shaders by name.
    pub fn programs(&self) -> &BTreeMap<String, Arc<dyn SurfaceProgram>> {
        &self.programs
    }

    /// The program that a material names, or one that shows that there is none.
    pub(crate) fn find_or_placeholder(&self, wanted: &ShaderUse) -> Arc<dyn SurfaceProgram> {
        self.find(wanted).cloned().unwrap_or_else(|_| Arc::new(OnLanes(Placeholder)))
    }

    /// The program that a material names.
    ///
    /// # Errors
    /// [`UnknownShader`] if there is no such shader or parameter; it names what there is.
    pub fn find(&self, wanted: &ShaderUse) -> Result<&Arc<dyn SurfaceProgram>, UnknownShader> {
        let name = match &wanted.shader {
            ShaderRef::Named(name) => name,
            ShaderRef::Plugin { file, shader } => {
                let file = file.display();
                return Err(UnknownShader(format!("shader `{shader}` of {file}: plug-ins are not loaded")));
            }
        };
        let program = self.programs.get(name).ok_or_else(|| {
            let known: Vec<&str> = self.programs.keys().map(String::as_str).collect();
            UnknownShader(format!("there is no shader `{name}`; there are: {}", known.join(", ")))
        })?;
        let parameters = program.info().parameters;
        for parameter in wanted.parameters.keys() {
            if !parameters.iter().any(|p| p.name == *parameter) {
                let known: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
                let known = known.join(", ");
                return Err(UnknownShader(format!(
                    "shader `{name}` has no parameter `{parameter}`; it has: {known}"
                )));
            }
        }
        Ok(program)
    }
}

/// The inputs of a shader in the order of its parameters.
pub(crate) fn inputs(
    parameters: &[Parameter],
    wanted: &ShaderUse,
    textures: &BTreeMap<TextureId, Arc<MipMap>>,
) -> Vec<Input> {
    let input = |parameter: &Parameter| {
        let (value, texture) = match wanted.parameters.get(&parameter.name) {
            None => (parameter.default.into(), None),
            Some(ParameterValue::Float(value)) => (glam::Vec3::splat(*value), None),
            Some(ParameterValue::Vector(value)) => (*value, None),
            Some(ParameterValue::Texture(reference, factor)) => {
                let map = textures.get(&reference.texture).cloned();
                (*factor, map.map(|map| Slot::new(map, *reference)))
            }
        };
        let value = if parameter.kind == ParameterKind::Float { glam::Vec3::splat(value.x) } else { value };
        let [low, high] = parameter.range.map(glam::Vec3::splat);
        Input { factor: value.max(low).min(high), texture }
    };
    parameters.iter().map(input).collect()
}

/// Stands for a shader that is not there: magenta and black squares that glow, seen from afar.
#[derive(Debug)]
struct Placeholder;

impl SurfaceShader for Placeholder {
    fn info(&self) -> ShaderInfo {
        let about = "stands for a shader that is missing".into();
        ShaderInfo {
            name: "placeholder".into(),
            about,
            parameters: Vec::new(),
            lobes: Lobes::NONE,
            see_through: false,
        }
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, _: &Inputs<'_, F>, closure: &mut Closure<F>) {
        // Squares of 10 cm in the world.
        let p = at.position.scaled(5.0);
        let cells = p.x.floor() + p.y.floor() + p.z.floor();
        let odd = (cells * 0.5 - (cells * 0.5).floor()).gt(cells.splat(0.25));
        let magenta = Vector::new(cells.splat(1.0), cells.splat(0.0), cells.splat(1.0)).only(odd);
        closure.base_color = Vector::grey(cells.splat(0.0));
        closure.emission = magenta;
    }
}
