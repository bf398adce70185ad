//! Woven cloth in Rust: threads over and under each other, in texture coordinates. The first part of the file
//! says again in Rust what `heliostat_shader.h` says in C, as far as this shader needs it.

use std::ffi::{c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The first version has all that this shader needs, and every engine speaks it.
const ABI_VERSION: u32 = 1;
const WIDTH: usize = 16;
const FLOAT: u32 = 0;
const COLOR: u32 = 1;

#[repr(C)]
struct Floats([f32; WIDTH]);

#[repr(C)]
struct Vectors {
    x: Floats,
    y: Floats,
    z: Floats,
}

#[repr(C)]
struct Points {
    position: *const Vectors,
    object_position: *const Vectors,
    geometric_normal: *const Vectors,
    normal: *const Vectors,
    to_viewer: *const Vectors,
    object_from_world: *const Vectors,
    color: *const Vectors,
    alpha: *const Floats,
    u: *const Floats,
    v: *const Floats,
    uv_lod: *const Floats,
    width: *const Floats,
    distance: *const Floats,
    level: *const Floats,
}

#[repr(C)]
struct Inputs {
    values: *const *const Vectors,
    count: u32,
}

#[repr(C)]
struct Closures {
    base_color: *mut Vectors,
    opacity: *mut Floats,
    metallic: *mut Floats,
    roughness: *mut Floats,
    specular: *mut Floats,
    specular_color: *mut Vectors,
    transmission: *mut Floats,
    coat: *mut Floats,
    coat_roughness: *mut Floats,
    emission: *mut Vectors,
    ambient: *mut Vectors,
    normal: *mut Vectors,
    coat_normal: *mut Vectors,
}

#[repr(C)]
struct Parameter {
    name: *const c_char,
    kind: u32,
    default_value: [f32; 3],
    range: [f32; 2],
    unit: *const c_char,
    about: *const c_char,
}

type Shade = unsafe extern "C" fn(
    instance: *const c_void,
    points: *const Points,
    inputs: *const Inputs,
    callbacks: *const c_void,
    closures: *const Closures,
    count: u32,
);

#[repr(C)]
struct Shader {
    name: *const c_char,
    about: *const c_char,
    flags: u32,
    parameter_count: u32,
    parameters: *const Parameter,
    /// Functions that this shader does without.
    create: *const c_void,
    destroy: *const c_void,
    shade: Shade,
}

#[repr(C)]
pub struct Plugin {
    abi_version: u32,
    shader_size: u32,
    parameter_size: u32,
    shader_count: u32,
    shaders: *const Shader,
}

/// Tables of constants that several threads may read.
struct Shared<T>(T);

// SAFETY: the tables hold nothing but constants and pointers to constants.
unsafe impl<T> Sync for Shared<T> {}

const WARP: usize = 0;
const WEFT: usize = 1;
const THREADS: usize = 2;

static PARAMETERS: Shared<[Parameter; 3]> = Shared([
    Parameter {
        name: c"warp".as_ptr(),
        kind: COLOR,
        default_value: [0.7, 0.15, 0.1],
        range: [0.0, 1.0],
        unit: c"".as_ptr(),
        about: c"colour of the threads along v".as_ptr(),
    },
    Parameter {
        name: c"weft".as_ptr(),
        kind: COLOR,
        default_value: [0.8, 0.7, 0.5],
        range: [0.0, 1.0],
        unit: c"".as_ptr(),
        about: c"colour of the threads along u".as_ptr(),
    },
    Parameter {
        name: c"threads".as_ptr(),
        kind: FLOAT,
        default_value: [40.0; 3],
        range: [1.0, 1e5],
        unit: c"".as_ptr(),
        about: c"threads along a unit of the texture coordinates".as_ptr(),
    },
]);

static SHADER: Shared<Shader> = Shared(Shader {
    name: c"weave".as_ptr(),
    about: c"woven cloth in texture coordinates".as_ptr(),
    flags: 0,
    parameter_count: 3,
    parameters: PARAMETERS.0.as_ptr(),
    create: std::ptr::null(),
    destroy: std::ptr::null(),
    shade,
});

static PLUGIN: Shared<Plugin> = Shared(Plugin {
    abi_version: ABI_VERSION,
    shader_size: size_of::<Shader>() as u32,
    parameter_size: size_of::<Parameter>() as u32,
    shader_count: 1,
    shaders: &raw const SHADER.0,
});

/// What the engine asks for first.
#[unsafe(no_mangle)]
pub extern "C" fn heliostat_plugin(abi_version: u32) -> *const Plugin {
    if abi_version == ABI_VERSION { &raw const PLUGIN.0 } else { std::ptr::null() }
}

/// The mean over a thread of the light that `shade` gives it: 0.4 + 0.6 · 2/3 · (1/2 + 1/2 · 2/3).
const MEAN_LIGHT: f32 = 0.733_333_3;

/// A panic must not leave the plug-in: it becomes values that are no numbers, which the engine shows and reports.
unsafe extern "C" fn shade(
    _instance: *const c_void,
    points: *const Points,
    inputs: *const Inputs,
    _callbacks: *const c_void,
    closures: *const Closures,
    count: u32,
) {
    // SAFETY: the engine passes tables whose pointers are all valid, and closures that nobody else looks at.
    let (points, values, closures) = unsafe {
        (&*points, std::slice::from_raw_parts((*inputs).values, (*inputs).count as usize), &*closures)
    };
    // SAFETY: as above.
    let (u, v, lod, color) = unsafe { (&*points.u, &*points.v, &*points.uv_lod, &mut *closures.base_color) };
    let work = AssertUnwindSafe(|| {
        // SAFETY: as above.
        let [warp, weft, threads] = [WARP, WEFT, THREADS].map(|parameter| unsafe { &*values[parameter] });
        for lane in 0..count as usize {
            let [a, b] = [u, v].map(|coordinate| coordinate.0[lane] * threads.x.0[lane]);
            let over = (a.floor() + b.floor()).rem_euclid(2.0) < 0.5;
            let from = if over { warp } else { weft };
            // Darker where a thread dives under the next.
            let along = if over { b } else { a };
            let across = if over { a } else { b };
            let round = |x: f32| 1.0 - (2.0 * (x - x.floor()) - 1.0).powi(2);
            let light = 0.4 + 0.6 * round(along) * (0.5 + 0.5 * round(across));
            // Threads finer than the footprint fade into the mean of the cloth.
            let sharp = (2.0 - 2.0 * lod.0[lane].exp2() * threads.x.0[lane]).clamp(0.0, 1.0);
            let blend = |from: f32, warp: f32, weft: f32| {
                let mean = 0.5 * (warp + weft) * MEAN_LIGHT;
                mean + (from * light - mean) * sharp
            };
            color.x.0[lane] = blend(from.x.0[lane], warp.x.0[lane], weft.x.0[lane]);
            color.y.0[lane] = blend(from.y.0[lane], warp.y.0[lane], weft.y.0[lane]);
            color.z.0[lane] = blend(from.z.0[lane], warp.z.0[lane], weft.z.0[lane]);
        }
    });
    if catch_unwind(work).is_err() {
        color.x.0 = [f32::NAN; WIDTH];
    }
}
