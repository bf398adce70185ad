//! The surface and light shaders that come with the engine: one file for each family.

mod brick;
mod bumps;
mod carpaint;
mod checker;
mod classic;
mod false_color;
mod foliage;
mod lights;
mod marble;
mod noise;
mod optics;
mod relief;
#[cfg(test)]
mod tests;
mod toon;
mod wood;

pub(crate) use false_color::cube_helix;
pub use false_color::heat_color;

use super::{Parameter, ShaderInfo, ShaderRegistry};
use crate::closure::Closure;
use crate::lanes::{Real, Vector};
use crate::lobe_set::Lobes;

/// Adds them all.
pub(super) fn register(registry: &mut ShaderRegistry) {
    registry.register(brick::Brick);
    registry.register(bumps::Bump);
    registry.register(bumps::Dents);
    registry.register(bumps::Ripples);
    registry.register(carpaint::CarPaint);
    registry.register(checker::Checker);
    registry.register(classic::Lambert);
    registry.register(classic::Phong);
    registry.register(false_color::ShowDepth);
    registry.register(false_color::ShowFacing);
    registry.register(false_color::ShowLevel);
    registry.register(false_color::ShowNormal);
    registry.register(false_color::ShowUv);
    registry.register(foliage::Foliage);
    registry.register(marble::Marble);
    registry.register(noise::Clouds);
    registry.register(noise::Granite);
    registry.register(noise::Noise);
    registry.register(optics::Glass);
    registry.register(optics::Mirror);
    registry.register(toon::Toon);
    registry.register(wood::Wood);
    registry.register_light(lights::BarnDoors);
    registry.register_light(lights::Blinds);
}

/// An opaque shader whose lobes are those of plastic: a reflection over a diffuse base.
fn plastic(name: &str, about: &str, parameters: Vec<Parameter>) -> ShaderInfo {
    let lobes = Lobes::DIFFUSE.union(Lobes::SPECULAR);
    ShaderInfo { name: name.into(), about: about.into(), parameters, lobes, see_through: false }
}

/// An opaque shader that scatters diffusely alone.
fn matte(name: &str, about: &str, parameters: Vec<Parameter>) -> ShaderInfo {
    ShaderInfo { lobes: Lobes::DIFFUSE, ..plastic(name, about, parameters) }
}

/// Makes a closure that of plastic: no metal, coat or transmission, the usual reflection.
#[inline(always)]
fn make_plastic<F: Real>(closure: &mut Closure<F>, base_color: Vector<F>, roughness: F) {
    let (zero, one) = (roughness.splat(0.0), roughness.splat(1.0));
    closure.base_color = base_color;
    closure.roughness = roughness.clamp(0.0, 1.0);
    closure.specular = one;
    closure.specular_color = Vector::grey(one);
    closure.metallic = zero;
    closure.coat = zero;
    closure.transmission = zero;
}

/// Makes a closure scatter diffusely alone.
#[inline(always)]
fn make_matte<F: Real>(closure: &mut Closure<F>, base_color: Vector<F>) {
    let one = closure.roughness.splat(1.0);
    make_plastic(closure, base_color, one);
    closure.specular = one.splat(0.0);
}
