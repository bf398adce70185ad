//! What the engine does for shaders while they shade.

use std::ptr::{from_ref, null};

use glam::{Vec2, Vec3};
use heliostat_shading::lanes::noise::gradient_noise;
use heliostat_shading::lanes::{Vector, WIDTH};
use heliostat_shading::{Input, Points};

use crate::abi::{HeliostatCallbacks, HeliostatFloats, HeliostatVectors};

/// What a shader was called with.
pub(crate) struct Given<'a> {
    pub(crate) inputs: &'a [Input],
    pub(crate) points: &'a Points,
}

/// The callbacks of one call: good as long as the place of `given` is.
pub(crate) fn table(given: &Given<'_>) -> HeliostatCallbacks {
    HeliostatCallbacks {
        context: from_ref(given).cast(),
        sample: Some(sample),
        noise: Some(noise),
        reserved: [null(); 5],
    }
}

/// See [`HeliostatCallbacks::sample`].
unsafe extern "C" fn sample(
    callbacks: *const HeliostatCallbacks,
    parameter: u32,
    u: *const HeliostatFloats,
    v: *const HeliostatFloats,
    width: *const HeliostatFloats,
    count: u32,
    rgb: *mut HeliostatVectors,
    alpha: *mut HeliostatFloats,
) -> i32 {
    let count = count as usize;
    if callbacks.is_null() || u.is_null() || v.is_null() || width.is_null() || rgb.is_null() || count > WIDTH
    {
        return 1;
    }
    // SAFETY: the plug-in passes the callbacks that it was given, whose context is what it was called with,
    // while it shades.
    let given: &Given<'_> = unsafe { &*(*callbacks).context.cast() };
    let Some(input) = given.inputs.get(parameter as usize) else { return 2 };
    for lane in 0..count {
        // SAFETY: not null, of 16 numbers each, and `lane` is one of them. Through pointers all the way, so that the plug-in
        // may have its results where its coordinates were.
        unsafe {
            let uv = Vec2::new((*u).lane[lane], (*v).lane[lane]);
            let texel = input.sample(given.points, lane, uv, (*width).lane[lane]);
            (*rgb).x.lane[lane] = texel.x;
            (*rgb).y.lane[lane] = texel.y;
            (*rgb).z.lane[lane] = texel.z;
            if !alpha.is_null() {
                (*alpha).lane[lane] = texel.w;
            }
        }
    }
    0
}

/// See [`HeliostatCallbacks::noise`].
unsafe extern "C" fn noise(
    position: *const HeliostatVectors,
    seed: u32,
    count: u32,
    value: *mut HeliostatFloats,
    gradient: *mut HeliostatVectors,
) -> i32 {
    let count = count as usize;
    if position.is_null() || value.is_null() || count > WIDTH {
        return 1;
    }
    for lane in 0..count {
        // SAFETY: not null, of 16 numbers each, and `lane` is one of them.
        unsafe {
            let at = Vec3::new((*position).x.lane[lane], (*position).y.lane[lane], (*position).z.lane[lane]);
            let noise = gradient_noise::<f32>(Vector::from(at), seed);
            (*value).lane[lane] = noise.value;
            if !gradient.is_null() {
                (*gradient).x.lane[lane] = noise.gradient.x;
                (*gradient).y.lane[lane] = noise.gradient.y;
                (*gradient).z.lane[lane] = noise.gradient.z;
            }
        }
    }
    0
}
