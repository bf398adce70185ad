//! Pixel shaders by name.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::Vec3;
use heliostat_scene::{ShaderRef, ShaderUse};

use super::{OnLanes, PixelFrame, PixelInfo, PixelShader, curves, effects};
use crate::shader::{ShaderProblem, constants};
use crate::surface::LaneMode;

/// A pixel shader over rows in memory: what the engine calls.
pub trait PixelProgram: Send + Sync + std::fmt::Debug {
    /// Name, parameters and what else there is to know.
    fn info(&self) -> PixelInfo;

    /// The new colours of a row. `values` are in the order of the parameters.
    fn row(&self, mode: LaneMode, frame: &PixelFrame<'_>, row: usize, values: &[Vec3], out: &mut [Vec3]);
}

/// The pixel shaders that a request can name.
#[derive(Clone, Debug, Default)]
pub struct PixelRegistry {
    programs: BTreeMap<String, Arc<dyn PixelProgram>>,
}

/// A pixel shader with the values of its parameters.
#[derive(Clone, Debug)]
pub struct BoundPixelShader {
    program: Arc<dyn PixelProgram>,
    values: Vec<Vec3>,
}

impl BoundPixelShader {
    /// Name, parameters and what else there is to know.
    pub fn info(&self) -> PixelInfo {
        self.program.info()
    }

    /// The new colours of a row.
    pub fn row(&self, mode: LaneMode, frame: &PixelFrame<'_>, row: usize, out: &mut [Vec3]) {
        self.program.row(mode, frame, row, &self.values, out);
    }
}

impl PixelRegistry {
    /// The shaders that come with the engine.
    pub fn built_in() -> Self {
        let mut registry = Self::default();
        curves::register(&mut registry);
        effects::register(&mut registry);
        registry
    }

    /// Adds a shader under its name, in place of one that has it already.
    pub fn register(&mut self, shader: impl PixelShader) {
        self.programs.insert(shader.info().name, Arc::new(OnLanes(shader)));
    }

    /// All shaders by name.
    pub fn programs(&self) -> &BTreeMap<String, Arc<dyn PixelProgram>> {
        &self.programs
    }

    /// The shader that a request names, with its values.
    ///
    /// # Errors
    /// [`ShaderProblem`] if there is no such shader or parameter, it is one of a library, or a value is a texture or not
    /// finite.
    pub fn bind(&self, wanted: &ShaderUse) -> Result<BoundPixelShader, ShaderProblem> {
        let problem = |text: String| Err(ShaderProblem(text));
        let ShaderRef::Named(name) = &wanted.shader else {
            return problem("pixel shaders come from the engine or the program, not from plug-ins".into());
        };
        let Some(program) = self.programs.get(name) else {
            let known: Vec<&str> = self.programs.keys().map(String::as_str).collect();
            return problem(format!("there is no pixel shader `{name}`; there are: {}", known.join(", ")));
        };
        let info = program.info();
        let values = constants(&format!("pixel shader `{name}`"), &info.parameters, wanted)?;
        Ok(BoundPixelShader { program: program.clone(), values })
    }
}
