//! Shaders of plug-ins as the engine sees them: packets go out and come back by pointer, without a copy.

use std::ffi::{c_char, c_void};
use std::fmt;
use std::ptr::{from_mut, from_ref, null, null_mut};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use heliostat_shading::lanes::{Vectors, WIDTH};
use heliostat_shading::{Closures, Input, LaneMode, Points, ShaderInfo, SurfaceProgram};

use crate::abi::{
    HELIOSTAT_MAX_PARAMETERS, HeliostatClosures, HeliostatConstant, HeliostatInputs, HeliostatPoints,
    HeliostatVectors,
};
use crate::callbacks::{self, Given};
use crate::table::Entry;

/// Room for what a constructor has to say.
const MESSAGE: usize = 512;

/// A shader that materials can be made of.
#[derive(Debug)]
struct Shader {
    entry: Entry,
    /// Set once an answer made no sense.
    reported: AtomicBool,
    /// What is wrong with it, until somebody asks.
    problem: Mutex<Option<String>>,
}

/// The program of a shader, without a material so far.
pub(crate) fn program(entry: Entry) -> Arc<dyn SurfaceProgram> {
    let (reported, problem) = (AtomicBool::new(false), Mutex::new(None));
    Arc::new(Unprepared(Arc::new(Shader { entry, reported, problem })))
}

#[derive(Debug)]
struct Unprepared(Arc<Shader>);

impl SurfaceProgram for Unprepared {
    fn info(&self) -> ShaderInfo {
        self.0.entry.info.clone()
    }

    /// The engine prepares programs; for others this makes an instance for every packet.
    fn run(&self, mode: LaneMode, count: usize, points: &Points, inputs: &[Input], closures: &mut Closures) {
        match Instance::new(&self.0, inputs) {
            Ok(instance) => instance.run(mode, count, points, inputs, closures),
            Err(problem) => self.0.report(problem),
        }
    }

    fn prepared(&self, inputs: &[Input]) -> Result<Option<Arc<dyn SurfaceProgram>>, String> {
        Ok(Some(Arc::new(Instance::new(&self.0, inputs)?)))
    }

    fn take_problem(&self) -> Option<String> {
        self.0.take_problem()
    }
}

impl Shader {
    /// Keeps the first problem.
    fn report(&self, problem: String) {
        if !self.reported.swap(true, Ordering::Relaxed) {
            *self.problem.lock().unwrap_or_else(PoisonError::into_inner) = Some(problem);
        }
    }

    fn take_problem(&self) -> Option<String> {
        self.problem.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Names the shader before a problem.
    fn named(&self, problem: &str) -> String {
        format!("shader `{}` of {}: {problem}", self.entry.info.name, self.entry.library.file.display())
    }
}

/// A shader with what it prepared for one material.
struct Instance {
    shader: Arc<Shader>,
    /// The plug-in's own.
    handle: *mut c_void,
    /// The values of all parameters, those aside that vary from point to point.
    constants: Box<[Vectors]>,
    /// Whether some parameter varies from point to point.
    varies: bool,
}

// SAFETY: the engine never looks behind `handle`; the interface demands that the plug-in's functions can be called on any
// thread, and `shade` on several at once.
unsafe impl Send for Instance {}
// SAFETY: as above.
unsafe impl Sync for Instance {}

impl fmt::Debug for Instance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Instance").field("shader", &self.shader).finish_non_exhaustive()
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if let Some(destroy) = self.shader.entry.destroy {
            // SAFETY: the handle is the one that `create` gave, it is destroyed once, and the library is still loaded.
            unsafe { destroy(self.handle) };
        }
    }
}

impl Instance {
    fn new(shader: &Arc<Shader>, inputs: &[Input]) -> Result<Self, String> {
        if inputs.len() != shader.entry.info.parameters.len() {
            let wanted = shader.entry.info.parameters.len();
            return Err(shader.named(&format!("it takes {wanted} inputs and was given {}", inputs.len())));
        }
        let handle = create(&shader.entry, inputs).map_err(|problem| shader.named(&problem))?;
        let splat = |input: &Input| {
            let mut lanes = Vectors::default();
            (0..WIDTH).for_each(|lane| lanes.set(lane, input.factor()));
            lanes
        };
        let constants = inputs.iter().map(splat).collect();
        let varies = inputs.iter().any(Input::varies);
        Ok(Self { shader: shader.clone(), handle, constants, varies })
    }

    /// Lets the plug-in shade with these values of its parameters.
    fn call(
        &self,
        (mode, count): (LaneMode, usize),
        points: &Points,
        inputs: &[Input],
        values: &[Vectors],
        closures: &mut Closures,
    ) {
        let mut table = [null(); HELIOSTAT_MAX_PARAMETERS];
        for (value, to) in values.iter().zip(&mut table) {
            *to = vectors(value);
        }
        let handed = HeliostatInputs { values: table.as_ptr(), count: values.len() as u32 };
        let given = Given { inputs, points };
        let callbacks = callbacks::table(&given);
        // Plug-ins of version 1 do not look for it.
        let to_camera = (self.shader.entry.version > 1).then(|| points.eye(mode, count));
        let points = points_table(points, to_camera.as_ref().unwrap_or(&points.wo));
        let closures = closures_table(closures);
        // SAFETY: the handle is the one that `create` gave, the library is loaded, and all tables and what they point to
        // outlive the call; the plug-in may write the closures alone, which are borrowed mutably.
        unsafe {
            (self.shader.entry.shade)(self.handle, &points, &handed, &callbacks, &closures, count as u32);
        }
    }
}

impl SurfaceProgram for Instance {
    fn info(&self) -> ShaderInfo {
        self.shader.entry.info.clone()
    }

    fn run(&self, mode: LaneMode, count: usize, points: &Points, inputs: &[Input], closures: &mut Closures) {
        if self.varies {
            let mut values = self.constants.clone();
            for (input, value) in inputs.iter().zip(&mut values).filter(|(input, _)| input.varies()) {
                input.values(points, count, value);
            }
            self.call((mode, count), points, inputs, &values, closures);
        } else {
            self.call((mode, count), points, inputs, &self.constants, closures);
        }
        if let Some(field) = closures.mark_faults(mode, count, points) {
            let problem = format!(
                "it answers with a `{field}` that is not finite or out of range; such points glow in magenta"
            );
            self.shader.report(self.shader.named(&problem));
        }
    }

    fn take_problem(&self) -> Option<String> {
        self.shader.take_problem()
    }
}

/// Calls the plug-in's constructor, if there is one.
fn create(entry: &Entry, inputs: &[Input]) -> Result<*mut c_void, String> {
    let mut handle = null_mut();
    let Some(create) = entry.create else { return Ok(handle) };
    let constant = |input: &Input| HeliostatConstant {
        value: input.factor().to_array(),
        textured: input.varies().into(),
    };
    let constants: Vec<HeliostatConstant> = inputs.iter().map(constant).collect();
    let mut message = [0_u8; MESSAGE];
    let to: *mut c_char = message.as_mut_ptr().cast();
    // SAFETY: the library is loaded, and there are as many constants and bytes as it is told.
    let status =
        unsafe { create(constants.as_ptr(), constants.len() as u32, &mut handle, to, MESSAGE as u32) };
    if status == 0 {
        return Ok(handle);
    }
    let end = message.iter().position(|byte| *byte == 0).unwrap_or(MESSAGE);
    let said = String::from_utf8_lossy(&message[..end]);
    let said = if said.is_empty() { "it does not say why" } else { &said };
    Err(format!("it refuses its parameters ({said}); change them or ask its author"))
}

fn vectors(from: &Vectors) -> *const HeliostatVectors {
    from_ref(from).cast()
}

fn points_table(points: &Points, to_camera: &Vectors) -> HeliostatPoints {
    let [u, v] = &points.uv[0];
    HeliostatPoints {
        position: vectors(&points.position),
        object_position: vectors(&points.object_position),
        geometric_normal: vectors(&points.ng),
        normal: vectors(&points.normal),
        to_viewer: vectors(&points.wo),
        object_from_world: points.object_from_world.as_ptr().cast(),
        color: vectors(&points.color),
        alpha: from_ref(&points.alpha).cast(),
        u: from_ref(u).cast(),
        v: from_ref(v).cast(),
        uv_lod: from_ref(&points.lod[0]).cast(),
        width: from_ref(&points.width).cast(),
        distance: from_ref(&points.distance).cast(),
        level: from_ref(&points.level).cast(),
        to_camera: vectors(to_camera),
    }
}

fn closures_table(closures: &mut Closures) -> HeliostatClosures {
    HeliostatClosures {
        base_color: from_mut(&mut closures.base_color).cast(),
        opacity: from_mut(&mut closures.opacity).cast(),
        metallic: from_mut(&mut closures.metallic).cast(),
        roughness: from_mut(&mut closures.roughness).cast(),
        specular: from_mut(&mut closures.specular).cast(),
        specular_color: from_mut(&mut closures.specular_color).cast(),
        transmission: from_mut(&mut closures.transmission).cast(),
        coat: from_mut(&mut closures.coat).cast(),
        coat_roughness: from_mut(&mut closures.coat_roughness).cast(),
        emission: from_mut(&mut closures.emission).cast(),
        ambient: from_mut(&mut closures.ambient).cast(),
        normal: from_mut(&mut closures.normal).cast(),
        coat_normal: from_mut(&mut closures.coat_normal).cast(),
    }
}
