//! The C interface between the engine and plug-ins: `include/heliostat_shader.h` is made from this file, documentation
//! included, which therefore speaks to authors of plug-ins.

#![allow(missing_copy_implementations, reason = "tables that are passed by pointer")]

use std::ffi::{c_char, c_void};

/// Points in a packet.
pub const HELIOSTAT_WIDTH: usize = 16;

/// The version of this interface. Versions grow at the end of the tables that plug-ins are given: the engine takes plug-ins of
/// this version and of those before, and refuses later ones.
pub const HELIOSTAT_ABI_VERSION: u32 = 2;

/// Most parameters of one shader.
pub const HELIOSTAT_MAX_PARAMETERS: usize = 32;

/// A parameter that is a number.
pub const HELIOSTAT_FLOAT: u32 = 0;

/// A parameter that is a linear Rec. 709 RGB colour.
pub const HELIOSTAT_COLOR: u32 = 1;

/// A parameter that is a vector.
pub const HELIOSTAT_VECTOR: u32 = 2;

/// The shader may give diffuse reflection to materials that have none, such as metals.
pub const HELIOSTAT_ADDS_DIFFUSE: u32 = 1;

/// The shader may give gloss to materials that have none: those with neither metal nor specular strength.
pub const HELIOSTAT_ADDS_SPECULAR: u32 = 2;

/// The shader may give a clear coat to materials that have none.
pub const HELIOSTAT_ADDS_COAT: u32 = 4;

/// The shader may make holes in opaque materials: it writes an opacity below 1.
pub const HELIOSTAT_SEE_THROUGH: u32 = 8;

/// One number for each point of a packet.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HeliostatFloats {
    /// Point by point.
    pub lane: [f32; HELIOSTAT_WIDTH],
}

/// One vector or colour for each point of a packet.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HeliostatVectors {
    /// First components.
    pub x: HeliostatFloats,
    /// Second components.
    pub y: HeliostatFloats,
    /// Third components.
    pub z: HeliostatFloats,
}

/// Where light is asked for: points of surfaces of one material. All pointers are valid, aligned to 64 bytes, and
/// for reading only. Lanes from `count` on hold anything; to compute them with the others does no harm.
#[repr(C)]
#[derive(Debug)]
pub struct HeliostatPoints {
    /// World space, metres.
    pub position: *const HeliostatVectors,
    /// Object space.
    pub object_position: *const HeliostatVectors,
    /// Unit geometric normal in world space, on the front side.
    pub geometric_normal: *const HeliostatVectors,
    /// Unit normal interpolated between the vertices, in world space, on the front side.
    pub normal: *const HeliostatVectors,
    /// Unit vector towards the viewer, world space. The viewer sees the front where its product with the geometric
    /// normal is positive.
    pub to_viewer: *const HeliostatVectors,
    /// Three columns of the matrix that takes directions from world to object space.
    pub object_from_world: *const HeliostatVectors,
    /// The mesh's linear colour; 1 where it has none.
    pub color: *const HeliostatVectors,
    /// The mesh's alpha; 1 where it has none.
    pub alpha: *const HeliostatFloats,
    /// First set of texture coordinates, along the width of the picture.
    pub u: *const HeliostatFloats,
    /// First set of texture coordinates, along the height of the picture, from its top.
    pub v: *const HeliostatFloats,
    /// log2 of the width of the footprint in those coordinates; 0 where the mesh has none.
    pub uv_lod: *const HeliostatFloats,
    /// Width of the footprint across the ray, metres: detail finer than this should fade out.
    pub width: *const HeliostatFloats,
    /// Distance along the ray that arrived, metres.
    pub distance: *const HeliostatFloats,
    /// Edges between the camera and this point, from 1.
    pub level: *const HeliostatFloats,
    /// Unit vector towards the camera of the frame, world space, whatever ray arrived: the same for light and in mirrors.
    /// Where there is no frame, as when lamps are measured, it is `to_viewer`. Since version 2: a plug-in that says it is of
    /// version 1 must not read it, since engines of that version do not give it.
    pub to_camera: *const HeliostatVectors,
}

/// The values of the shader's parameters at the points.
#[repr(C)]
#[derive(Debug)]
pub struct HeliostatInputs {
    /// One packet for each parameter, in the order of the shader's table, textures included. Numbers are in `x`.
    pub values: *const *const HeliostatVectors,
    /// How many there are.
    pub count: u32,
}

/// How the surface looks at the points, in the terms of the metallic-roughness model of glTF 2.0. A shader finds the
/// material's own values here and changes what it wants. Values that are not finite or clearly out of range make the
/// point glow in magenta, and the user is told once.
#[repr(C)]
#[derive(Debug)]
pub struct HeliostatClosures {
    /// Linear reflectance, 0 to 1.
    pub base_color: *mut HeliostatVectors,
    /// Share of light that meets the surface, 0 to 1; the rest passes straight through (see HELIOSTAT_SEE_THROUGH).
    pub opacity: *mut HeliostatFloats,
    /// 0 = dielectric, 1 = metal.
    pub metallic: *mut HeliostatFloats,
    /// Perceptual roughness, 0 to 1.
    pub roughness: *mut HeliostatFloats,
    /// Strength of the dielectric reflection, 0 to 1.
    pub specular: *mut HeliostatFloats,
    /// Tint of the dielectric reflection at normal incidence, from 0.
    pub specular_color: *mut HeliostatVectors,
    /// Share of the dielectric's base that transmits, 0 to 1; counts where the material transmits at all.
    pub transmission: *mut HeliostatFloats,
    /// Coverage of the clear coat, 0 to 1.
    pub coat: *mut HeliostatFloats,
    /// Its perceptual roughness, 0 to 1.
    pub coat_roughness: *mut HeliostatFloats,
    /// Emitted radiance towards the viewer, from 0. It shines on others where paths find it by chance.
    pub emission: *mut HeliostatVectors,
    /// Radiance of the classical ambient term, from 0.
    pub ambient: *mut HeliostatVectors,
    /// Unit shading normal in world space, on the front side.
    pub normal: *mut HeliostatVectors,
    /// The clear coat's.
    pub coat_normal: *mut HeliostatVectors,
}

/// What the engine does for a shader while it shades, and not after.
#[repr(C)]
#[derive(Debug)]
pub struct HeliostatCallbacks {
    /// The engine's own.
    pub context: *const c_void,
    /// Samples a parameter at texture coordinates of the shader's own making: `rgb` gets the value times the texture for
    /// the first `count` lanes, and `alpha`, unless it is NULL, the texture's alpha. Each is filtered over `width` of the
    /// coordinates; 0 is the sharpest. Parameters without a texture give their value. Returns 0, or another number if
    /// nothing was written, since an argument was NULL, `count` above 16, or there is no such parameter.
    pub sample: Option<
        unsafe extern "C" fn(
            callbacks: *const HeliostatCallbacks,
            parameter: u32,
            u: *const HeliostatFloats,
            v: *const HeliostatFloats,
            width: *const HeliostatFloats,
            count: u32,
            rgb: *mut HeliostatVectors,
            alpha: *mut HeliostatFloats,
        ) -> i32,
    >,
    /// Gradient noise (Perlin, "Improving Noise", 2002) of about one feature per unit, the same as the engine's own
    /// shaders use: `value` gets -1 to 1 with mean 0 for the first `count` positions, and `gradient`, unless it is NULL, its
    /// derivatives. Another seed gives other noise. Returns 0, or another number if nothing was written, since an argument
    /// was NULL or `count` above 16.
    pub noise: Option<
        unsafe extern "C" fn(
            position: *const HeliostatVectors,
            seed: u32,
            count: u32,
            value: *mut HeliostatFloats,
            gradient: *mut HeliostatVectors,
        ) -> i32,
    >,
    /// NULL. Kept for what there is not yet: rays of the shader's own and loops over lights.
    pub reserved: [*const c_void; 5],
}

/// A parameter of a shader. Strings are UTF-8 and end with a zero.
#[repr(C)]
#[derive(Debug)]
pub struct HeliostatParameter {
    /// Small letters, digits and `_`, a letter first.
    pub name: *const c_char,
    /// HELIOSTAT_FLOAT, HELIOSTAT_COLOR or HELIOSTAT_VECTOR.
    pub kind: u32,
    /// The value unless set; numbers take the first component.
    pub default_value: [f32; 3],
    /// Smallest and largest value that makes sense; values beyond are moved to the nearer end.
    pub range: [f32; 2],
    /// Such as `m` or `1/m`; empty for pure numbers.
    pub unit: *const c_char,
    /// One line on what it does.
    pub about: *const c_char,
}

/// What a parameter is set to in one material.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HeliostatConstant {
    /// The value, or what the texture or the attribute is multiplied by; three equal components for numbers.
    pub value: [f32; 3],
    /// 1 if a texture or an attribute makes it vary from point to point, else 0.
    pub textured: u32,
}

/// A shader. Its functions are called on several threads at once, for one instance too.
#[repr(C)]
#[derive(Debug)]
pub struct HeliostatShader {
    /// Small letters, digits, `-` and `_`, a letter first.
    pub name: *const c_char,
    /// One line on what it looks like.
    pub about: *const c_char,
    /// The sum of HELIOSTAT_ADDS_DIFFUSE and the like.
    pub flags: u32,
    /// At most HELIOSTAT_MAX_PARAMETERS.
    pub parameter_count: u32,
    /// May be NULL if there are none.
    pub parameters: *const HeliostatParameter,
    /// Prepares the shader for one material and sets `*instance` to whatever it likes. Returns 0, or another number if it
    /// cannot; it may then explain itself in `message`, which has room for `size` bytes with the final zero. NULL if
    /// there is nothing to prepare: instances are then NULL.
    pub create: Option<
        unsafe extern "C" fn(
            constants: *const HeliostatConstant,
            count: u32,
            instance: *mut *mut c_void,
            message: *mut c_char,
            size: u32,
        ) -> i32,
    >,
    /// Frees what `create` made, after the last `shade`. NULL if there is nothing to free.
    pub destroy: Option<unsafe extern "C" fn(instance: *mut c_void)>,
    /// Changes the first `count` closures (1 to 16). Must be there. The same arguments must always give the same result,
    /// and no lane may depend on another: pictures do not depend on which points share a packet.
    pub shade: Option<
        unsafe extern "C" fn(
            instance: *const c_void,
            points: *const HeliostatPoints,
            inputs: *const HeliostatInputs,
            callbacks: *const HeliostatCallbacks,
            closures: *const HeliostatClosures,
            count: u32,
        ),
    >,
}

/// What a plug-in consists of. It stays where it is, unchanged, for as long as the library is loaded.
#[repr(C)]
#[derive(Debug)]
pub struct HeliostatPlugin {
    /// HELIOSTAT_ABI_VERSION, or an earlier version of which the plug-in needs no more.
    pub abi_version: u32,
    /// sizeof(HeliostatShader).
    pub shader_size: u32,
    /// sizeof(HeliostatParameter).
    pub parameter_size: u32,
    /// How many shaders there are, at least 1.
    pub shader_count: u32,
    /// The shaders, one after the other.
    pub shaders: *const HeliostatShader,
}

/// The function that every plug-in exports under the name `heliostat_plugin`. The engine calls it with its own version and,
/// while it returns NULL, which says that the plug-in does not know that version, with earlier ones.
pub type HeliostatEntry = Option<unsafe extern "C" fn(abi_version: u32) -> *const HeliostatPlugin>;

// The header asserts the same for the author's compiler.
const _: () = assert!(size_of::<HeliostatFloats>() == 64 && size_of::<HeliostatVectors>() == 192);
const _: () = assert!(size_of::<HeliostatPoints>() == 15 * size_of::<*const c_void>());
const _: () = assert!(size_of::<HeliostatClosures>() == 13 * size_of::<*const c_void>());
const _: () = assert!(size_of::<HeliostatInputs>() == 2 * size_of::<*const c_void>());
const _: () = assert!(size_of::<HeliostatCallbacks>() == 8 * size_of::<*const c_void>());
const _: () = assert!(size_of::<HeliostatConstant>() == 16);
// And the engine's packets are laid out alike.
const _: () = assert!(size_of::<heliostat_shading::lanes::Floats>() == 64);
const _: () = assert!(size_of::<heliostat_shading::lanes::Vectors>() == 192);
const _: () = assert!(heliostat_shading::lanes::WIDTH == HELIOSTAT_WIDTH);
