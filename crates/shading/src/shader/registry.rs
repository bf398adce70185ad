//! Shaders by name.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use heliostat_scene::{LightKind, ParameterValue, ShadedEnvironment, ShaderRef, ShaderUse, TextureId};

use super::builtin;
use super::{
    Input, InputSource, Inputs, OnLanes, Parameter, ParameterKind, Point, ShaderInfo, SurfaceProgram,
    SurfaceShader, constants,
};
use crate::attribute::AttributeInput;
use crate::camera::{CameraProgram, CameraShader, ShadedCamera, camera_program};
use crate::closure::Closure;
use crate::environment::EnvironmentLight;
use crate::environment_shader::{EnvironmentProgram, EnvironmentShader, ShaderLight, environment_program};
use crate::lanes::{Real, Vector};
use crate::light_shader::{LightInfo, LightProgram, LightShader, ShadedLight, light_program};
use crate::lobe_set::Lobes;
use crate::material::Slot;
use crate::punctual::PunctualLight;
use crate::texture::MipMap;

/// The surface shaders that materials can name, and the light, environment and camera shaders that lights, scenes and cameras
/// can.
#[derive(Clone, Debug, Default)]
pub struct ShaderRegistry {
    programs: BTreeMap<String, Arc<dyn SurfaceProgram>>,
    lights: BTreeMap<String, Arc<dyn LightProgram>>,
    environments: BTreeMap<String, Arc<dyn EnvironmentProgram>>,
    cameras: BTreeMap<String, Arc<dyn CameraProgram>>,
    plugins: Option<Arc<dyn PluginSource>>,
}

/// Where the shaders of shared libraries come from.
pub trait PluginSource: Send + Sync + std::fmt::Debug {
    /// The shader of that name in a library.
    ///
    /// # Errors
    /// Why there is none, who is at fault, and what to do.
    fn shader(&self, file: &Path, shader: &str) -> Result<Arc<dyn SurfaceProgram>, String>;
}

/// Why a material goes without the shader that it names: there is no such shader or parameter, it cannot be loaded, or it
/// refuses its parameters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShaderProblem(pub String);

/// A shader with the values of its parameters.
#[derive(Clone, Debug)]
pub(crate) struct Bound {
    pub(crate) program: Arc<dyn SurfaceProgram>,
    pub(crate) inputs: Vec<Input>,
    pub(crate) info: ShaderInfo,
}

/// A program of some kind by its name, and what to call it.
fn named<T: ?Sized>(
    kind: &str,
    programs: &BTreeMap<String, Arc<T>>,
    wanted: &ShaderUse,
) -> Result<(String, Arc<T>), ShaderProblem> {
    let ShaderRef::Named(name) = &wanted.shader else {
        return Err(ShaderProblem(format!(
            "{kind} shaders come from the program, not from plug-ins; register it and name it"
        )));
    };
    let program = programs.get(name).ok_or_else(|| {
        let known: Vec<&str> = programs.keys().map(String::as_str).collect();
        let known = if known.is_empty() { "none".into() } else { known.join(", ") };
        ShaderProblem(format!("there is no {kind} shader `{name}`; there are: {known}"))
    })?;
    Ok((format!("{kind} shader `{name}`"), program.clone()))
}

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

    /// Adds a light shader under its name, in place of one that has it already.
    pub fn register_light(&mut self, shader: impl LightShader) {
        let name = shader.info().name;
        self.lights.insert(name, light_program(shader));
    }

    /// A light made ready, with the shader that it names if it is of that kind.
    ///
    /// # Errors
    /// [`ShaderProblem`] if there is no such shader or parameter, or a value is out of range or varies.
    pub fn light(&self, kind: &LightKind) -> Result<PunctualLight, ShaderProblem> {
        let LightKind::Shader { shader, .. } = kind else { return Ok(PunctualLight::new(kind)) };
        let (what, program) = named("light", &self.lights, shader)?;
        let values = constants(&what, &program.info().parameters, shader)?;
        Ok(PunctualLight::shaded(kind, ShadedLight::new(program, values)))
    }

    /// What there is to know about the light shaders, by name.
    pub fn light_infos(&self) -> impl Iterator<Item = LightInfo> {
        self.lights.values().map(|program| program.info())
    }

    /// Adds an environment shader under its name, in place of one that has it already.
    pub fn register_environment(&mut self, shader: impl EnvironmentShader) {
        let name = shader.info().name;
        self.environments.insert(name, environment_program(shader));
    }

    /// The environment that a scene names, made ready.
    ///
    /// # Errors
    /// [`ShaderProblem`] if there is no such shader or parameter, or a value is out of range or varies.
    pub fn environment(&self, wanted: &ShadedEnvironment) -> Result<EnvironmentLight, ShaderProblem> {
        let (what, program) = named("environment", &self.environments, &wanted.shader)?;
        let values = constants(&what, &program.info().parameters, &wanted.shader)?;
        Ok(EnvironmentLight::Shader(ShaderLight::new(program, values, wanted)))
    }

    /// Adds a camera shader under its name, in place of one that has it already.
    pub fn register_camera(&mut self, shader: impl CameraShader) {
        let name = shader.info().name;
        self.cameras.insert(name, camera_program(shader));
    }

    /// The camera shader that a camera names, with its values.
    ///
    /// # Errors
    /// [`ShaderProblem`] if there is no such shader or parameter, or a value is out of range or varies.
    pub fn camera(&self, wanted: &ShaderUse) -> Result<ShadedCamera, ShaderProblem> {
        let (what, program) = named("camera", &self.cameras, wanted)?;
        let values = constants(&what, &program.info().parameters, wanted)?;
        Ok(ShadedCamera::new(program, values))
    }

    /// All surface shaders by name.
    pub fn programs(&self) -> &BTreeMap<String, Arc<dyn SurfaceProgram>> {
        &self.programs
    }

    /// Allows materials to name shaders of shared libraries. Whoever may edit the scene can then run code with all the
    /// rights of this program.
    pub fn allow_plugins(&mut self, source: Arc<dyn PluginSource>) {
        self.plugins = Some(source);
    }

    /// The shader that a material names with its values, or one that shows that there is none, and why.
    pub(crate) fn bind(
        &self,
        wanted: &ShaderUse,
        textures: &BTreeMap<TextureId, Arc<MipMap>>,
    ) -> (Bound, Option<ShaderProblem>) {
        let bind = |program: Arc<dyn SurfaceProgram>| {
            let info = program.info();
            let inputs = inputs(&info.parameters, wanted, textures);
            match program.prepared(&inputs) {
                Ok(prepared) => Ok(Bound { program: prepared.unwrap_or(program), inputs, info }),
                Err(problem) => Err(ShaderProblem(problem)),
            }
        };
        self.find(wanted).and_then(bind).map_or_else(
            |problem| {
                let program = Arc::new(OnLanes(Placeholder));
                let info = program.info();
                (Bound { program, inputs: Vec::new(), info }, Some(problem))
            },
            |bound| (bound, None),
        )
    }

    /// The program that a material names.
    ///
    /// # Errors
    /// [`ShaderProblem`] if there is no such shader or parameter; it names what there is. Or if the shader is one of a
    /// library that cannot be loaded or may not.
    pub fn find(&self, wanted: &ShaderUse) -> Result<Arc<dyn SurfaceProgram>, ShaderProblem> {
        let (name, program) = match &wanted.shader {
            ShaderRef::Named(name) => (name, self.named(name)?),
            ShaderRef::Plugin { file, shader } => {
                let source = self.plugins.as_ref().ok_or_else(|| {
                    let file = file.display();
                    ShaderProblem(format!(
                        "shader `{shader}` of {file}: plug-ins run as part of this program and were not allowed; if you \
                         trust this one, allow them (`--allow-plugins`, `ShaderRegistry::allow_plugins`)"
                    ))
                })?;
                (shader, source.shader(file, shader).map_err(ShaderProblem)?)
            }
        };
        let parameters = program.info().parameters;
        for parameter in wanted.parameters.keys() {
            if !parameters.iter().any(|p| p.name == *parameter) {
                let known: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
                let known = known.join(", ");
                return Err(ShaderProblem(format!(
                    "shader `{name}` has no parameter `{parameter}`; it has: {known}"
                )));
            }
        }
        Ok(program)
    }

    fn named(&self, name: &str) -> Result<Arc<dyn SurfaceProgram>, ShaderProblem> {
        self.programs.get(name).cloned().ok_or_else(|| {
            let known: Vec<&str> = self.programs.keys().map(String::as_str).collect();
            ShaderProblem(format!("there is no shader `{name}`; there are: {}", known.join(", ")))
        })
    }
}

/// The inputs of a shader in the order of its parameters.
fn inputs(
    parameters: &[Parameter],
    wanted: &ShaderUse,
    textures: &BTreeMap<TextureId, Arc<MipMap>>,
) -> Vec<Input> {
    let mut slots = 0_usize..;
    let input = |parameter: &Parameter| {
        let constant = InputSource::Constant;
        let (value, source) = match wanted.parameters.get(&parameter.name) {
            None => (parameter.default.into(), constant),
            Some(ParameterValue::Float(value)) => (glam::Vec3::splat(*value), constant),
            Some(ParameterValue::Vector(value)) => (*value, constant),
            Some(ParameterValue::Texture(reference, factor)) => {
                let map = textures.get(&reference.texture).cloned();
                (*factor, map.map_or(constant, |map| InputSource::Texture(Slot::new(map, *reference))))
            }
            Some(ParameterValue::Attribute(name, factor)) => {
                let slot = slots.next().unwrap_or_default();
                let attribute = AttributeInput::new(parameter, name, *factor, slot);
                return Input { factor: *factor, source: InputSource::Attribute(attribute) };
            }
        };
        let value = if parameter.kind == ParameterKind::Float { glam::Vec3::splat(value.x) } else { value };
        let [low, high] = parameter.range.map(glam::Vec3::splat);
        Input { factor: value.max(low).min(high), source }
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
