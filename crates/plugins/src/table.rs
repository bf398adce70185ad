//! Reads the table of a plug-in and checks every entry before anything is made of it.

use std::collections::BTreeSet;
use std::ffi::{c_char, c_void};
use std::sync::Arc;

use heliostat_shading::{Lobes, Parameter, ParameterKind, ShaderInfo};

use crate::abi::{
    HELIOSTAT_ADDS_COAT, HELIOSTAT_ADDS_DIFFUSE, HELIOSTAT_ADDS_SPECULAR, HELIOSTAT_COLOR, HELIOSTAT_FLOAT,
    HELIOSTAT_MAX_PARAMETERS, HELIOSTAT_SEE_THROUGH, HELIOSTAT_VECTOR, HeliostatCallbacks, HeliostatClosures,
    HeliostatConstant, HeliostatInputs, HeliostatParameter, HeliostatPoints, HeliostatShader,
};
use crate::error::PluginError;
use crate::library::Loaded;

/// Most shaders of one plug-in.
const MAX_SHADERS: u32 = 1024;
/// Longest name, and longest text about something, in bytes.
const MAX_NAME: usize = 64;
const MAX_TEXT: usize = 1024;

pub(crate) type Create =
    unsafe extern "C" fn(*const HeliostatConstant, u32, *mut *mut c_void, *mut c_char, u32) -> i32;
pub(crate) type Destroy = unsafe extern "C" fn(*mut c_void);
pub(crate) type Shade = unsafe extern "C" fn(
    *const c_void,
    *const HeliostatPoints,
    *const HeliostatInputs,
    *const HeliostatCallbacks,
    *const HeliostatClosures,
    u32,
);

/// A shader of a plug-in: what it says of itself and its functions, which are good as long as the library is loaded.
#[derive(Debug)]
pub(crate) struct Entry {
    pub(crate) library: Arc<Loaded>,
    /// Of the interface that the plug-in was made for.
    pub(crate) version: u32,
    pub(crate) info: ShaderInfo,
    pub(crate) create: Option<Create>,
    pub(crate) destroy: Option<Destroy>,
    pub(crate) shade: Shade,
}

/// The shaders of a plug-in.
pub(crate) fn read(library: &Arc<Loaded>) -> Result<Vec<Entry>, PluginError> {
    let table = library.table()?;
    let sizes = (table.shader_size, table.parameter_size);
    let ours = (size_of::<HeliostatShader>() as u32, size_of::<HeliostatParameter>() as u32);
    if sizes != ours {
        return Err(library.invalid(format!(
            "its structures of shaders and parameters have {sizes:?} bytes instead of {ours:?}; was it compiled with \
             another packing?"
        )));
    }
    if table.shader_count == 0 || table.shader_count > MAX_SHADERS {
        return Err(
            library.invalid(format!("it has {} shaders instead of 1 to {MAX_SHADERS}", table.shader_count))
        );
    }
    if table.shaders.is_null() || !table.shaders.is_aligned() {
        return Err(library.invalid("its table of shaders is null or not aligned"));
    }
    // SAFETY: neither null nor askew; the interface says that there are so many of the size that was checked, which stay as
    // they are while the library is loaded.
    let shaders = unsafe { std::slice::from_raw_parts(table.shaders, table.shader_count as usize) };
    let mut names = BTreeSet::new();
    let mut entries = Vec::new();
    for (index, shader) in shaders.iter().enumerate() {
        let entry = read_shader(library, table.abi_version, shader)
            .map_err(|problem| library.invalid(format!("shader {index}: {problem}")))?;
        if !names.insert(entry.info.name.clone()) {
            return Err(library.invalid(format!("it has two shaders `{}`", entry.info.name)));
        }
        entries.push(entry);
    }
    Ok(entries)
}

fn read_shader(library: &Arc<Loaded>, version: u32, shader: &HeliostatShader) -> Result<Entry, String> {
    let name = name(shader.name, "its name", true)?;
    let inside = |problem: String| format!("`{name}`: {problem}");
    let about = text(shader.about, "`about`", MAX_TEXT).map_err(inside)?;
    let shade = shader.shade.ok_or_else(|| inside("it has no function `shade`".into()))?;
    let known =
        HELIOSTAT_ADDS_DIFFUSE | HELIOSTAT_ADDS_SPECULAR | HELIOSTAT_ADDS_COAT | HELIOSTAT_SEE_THROUGH;
    if shader.flags & !known != 0 {
        return Err(inside(format!("its flags {:#x} have unknown ones", shader.flags)));
    }
    let parameters = read_parameters(shader).map_err(inside)?;
    let lobes = [
        (HELIOSTAT_ADDS_DIFFUSE, Lobes::DIFFUSE),
        (HELIOSTAT_ADDS_SPECULAR, Lobes::SPECULAR),
        (HELIOSTAT_ADDS_COAT, Lobes::COAT),
    ];
    let lobes = lobes.into_iter().filter(|(flag, _)| shader.flags & flag != 0);
    let lobes = lobes.fold(Lobes::NONE, |set, (_, lobe)| set.union(lobe));
    let see_through = shader.flags & HELIOSTAT_SEE_THROUGH != 0;
    let info = ShaderInfo { name, about, parameters, lobes, see_through };
    let HeliostatShader { create, destroy, .. } = *shader;
    Ok(Entry { library: library.clone(), version, info, create, destroy, shade })
}

fn read_parameters(shader: &HeliostatShader) -> Result<Vec<Parameter>, String> {
    let count = shader.parameter_count as usize;
    if count == 0 {
        return Ok(Vec::new());
    }
    if count > HELIOSTAT_MAX_PARAMETERS {
        return Err(format!("it has {count} parameters; the limit is {HELIOSTAT_MAX_PARAMETERS}"));
    }
    if shader.parameters.is_null() || !shader.parameters.is_aligned() {
        return Err("its table of parameters is null or not aligned".into());
    }
    // SAFETY: as for the table of shaders.
    let entries = unsafe { std::slice::from_raw_parts(shader.parameters, count) };
    let mut parameters: Vec<Parameter> = Vec::new();
    for (index, entry) in entries.iter().enumerate() {
        let parameter = read_parameter(entry).map_err(|problem| format!("parameter {index}: {problem}"))?;
        if parameters.iter().any(|p| p.name == parameter.name) {
            return Err(format!("it has two parameters `{}`", parameter.name));
        }
        parameters.push(parameter);
    }
    Ok(parameters)
}

fn read_parameter(entry: &HeliostatParameter) -> Result<Parameter, String> {
    let name = name(entry.name, "its name", false)?;
    let kind = match entry.kind {
        HELIOSTAT_FLOAT => ParameterKind::Float,
        HELIOSTAT_COLOR => ParameterKind::Color,
        HELIOSTAT_VECTOR => ParameterKind::Vector,
        other => return Err(format!("`{name}` is of the unknown kind {other}")),
    };
    let [low, high] = entry.range;
    if !(low.is_finite() && high.is_finite() && low <= high) {
        return Err(format!("`{name}` has the range {low} to {high}"));
    }
    let used =
        if kind == ParameterKind::Float { &entry.default_value[..1] } else { &entry.default_value[..] };
    if let Some(value) = used.iter().find(|value| !(low..=high).contains(*value)) {
        return Err(format!("the default {value} of `{name}` is not in its range {low} to {high}"));
    }
    Ok(Parameter {
        kind,
        default: entry.default_value,
        range: entry.range,
        unit: text(entry.unit, "`unit`", MAX_NAME)?,
        about: text(entry.about, "`about`", MAX_TEXT)?,
        name,
    })
}

/// A name as users write it.
fn name(from: *const c_char, what: &str, dashes: bool) -> Result<String, String> {
    let name = text(from, what, MAX_NAME)?;
    let fits = |c: u8| c.is_ascii_lowercase() || c.is_ascii_digit() || c == b'_' || (dashes && c == b'-');
    match name.bytes().next() {
        Some(b'a'..=b'z') if name.bytes().all(fits) => Ok(name),
        _ => {
            let dashes = if dashes { ", `-`" } else { "" };
            Err(format!(
                "{what} is {name:?}; names have small letters, digits{dashes} and `_`, a letter first"
            ))
        }
    }
}

/// A string of at most `limit` bytes.
fn text(from: *const c_char, what: &str, limit: usize) -> Result<String, String> {
    if from.is_null() {
        return Err(format!("{what} is null; an empty string is fine where there is nothing to say"));
    }
    let mut bytes = Vec::new();
    for at in 0..=limit {
        // SAFETY: not null, and every byte up to the final zero, beyond which this does not look, belongs to the string.
        match unsafe { from.add(at).cast::<u8>().read() } {
            0 => return String::from_utf8(bytes).map_err(|_| format!("{what} is not UTF-8")),
            byte => bytes.push(byte),
        }
    }
    Err(format!("{what} has more than {limit} bytes"))
}
