//! What the engine does for shaders while they shade.

use std::ptr::{from_ref, null};

use glam::{Vec2, Vec3};
use heliostat_shading::Input;
use heliostat_shading::lanes::noise::gradient_noise;
use heliostat_shading::lanes::{Vector, WIDTH};

use crate::abi::{HeliostatCallbacks, HeliostatFloats, HeliostatVectors};

/// The callbacks of one call: good as long as the place of `inputs` is.
pub(crate) fn table(inputs: &&[Input]) -> HeliostatCallbacks {
    HeliostatCallbacks {
        context: from_ref(inputs).cast(),
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
    // SAFETY: the plug-in passes the callbacks that it was given, whose context is the slice of inputs, while it shades.
    let inputs: &[Input] = unsafe { *(*callbacks).context.cast::<&[Input]>() };
    let Some(input) = inputs.get(parameter as usize) else { return 2 };
    for lane in 0..count {
        // SAFETY: not null, of 16 numbers each, and `lane` is one of them. Through pointers all the way, so that the plug-in
        // may have its results where its coordinates were.
        unsafe {
            let uv = Vec2::new((*u).lane[lane], (*v).lane[lane]);
            let texel = input.sample(uv, (*width).lane[lane]);
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
