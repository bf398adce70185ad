//! Units of the game and of its light compiler against metres and watts.

use std::f32::consts::PI;

use glam::{Affine3A, Mat3A, Vec3, Vec3A};

/// Metres per unit. Players are 56 units tall: 1.75 m.
pub(super) const METRES: f32 = 1.0 / 32.0;
/// What the compiler computes for a surface that is shown as white, against an outgoing radiance of 1.
const FULL: f32 = 255.0;
/// The compiler's strength of a point light over the number of its entity.
const POINT_SCALE: f32 = 7500.0;
/// What a luminous surface that fills the view gives, over the number of its shader.
const SURFACE_SCALE: f32 = 3.0;

/// Metres with +Y up from units with +Z up: a turn, so that front sides stay in front.
pub(super) fn metres(p: Vec3) -> Vec3 {
    direction(p) * METRES
}

/// The same turn for directions.
pub(super) fn direction(d: Vec3) -> Vec3 {
    Vec3::new(d.x, d.z, -d.y)
}

/// Places what is given in metres at an origin in units.
pub(super) fn placement(origin: Vec3) -> Affine3A {
    Affine3A { matrix3: Mat3A::IDENTITY, translation: Vec3A::from(metres(origin)) }
}

/// Radiant intensity, W/sr, of a `light` entity: it gives `7500 light / d²` at `d` units, of which 255 makes white
/// shine with a radiance of 1.
pub(super) fn point_light(light: f32) -> f32 {
    PI * POINT_SCALE * light / FULL * METRES * METRES
}

/// Radiance of a surface with `q3map_surfacelight`.
pub(super) fn surface_light(value: f32) -> f32 {
    SURFACE_SCALE * value / FULL
}

/// Irradiance, W/m², of `q3map_sun`.
pub(super) fn sun(intensity: f32) -> f32 {
    PI * intensity / FULL
}

/// Radiance of white under the worldspawn's `ambient`.
pub(super) fn ambient(value: f32) -> f32 {
    value / FULL
}
