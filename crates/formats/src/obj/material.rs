//! From MTL's empirical model to a physical one.
//! The rules and their sources stand in the documentation of [`obj`](crate::obj).

use glam::{Vec3, Vec4};
use heliostat_scene::{AlphaMode, Clearcoat, Material, SceneBuilder, Volume};

use super::maps::Maps;
use super::mtl::{MapKind, Mtl};
use crate::context::Context;
use crate::error::LoadError;

/// Reflectance of a dielectric of index 1.5 at normal incidence.
const F0: f32 = 0.04;

/// The material with its textures.
pub(super) fn convert(
    context: &mut Context<'_>,
    builder: &mut SceneBuilder,
    maps: &mut Maps,
    mtl: &Mtl,
) -> Result<Material, LoadError> {
    let mut material = Material { name: mtl.name.clone(), ..Material::default() };
    material.base_color = base_color(context, mtl).extend(1.0);
    material.emissive = mtl.emission.unwrap_or(Vec3::ZERO);
    if mtl.map(MapKind::Emission).is_some() && material.emissive == Vec3::ZERO {
        material.emissive = Vec3::ONE;
    }
    reflection(context, mtl, &mut material);
    transparency(context, mtl, &mut material);
    maps.apply(context, builder, mtl, &mut material)?;
    // The maps multiply factors that such files leave out.
    if mtl.map(MapKind::Roughness).is_some() && mtl.roughness.is_none() {
        material.roughness = 1.0;
    }
    if mtl.map(MapKind::Metallic).is_some() && mtl.metallic.is_none() {
        material.metallic = 1.0;
    }
    Ok(material)
}

fn base_color(context: &mut Context<'_>, mtl: &Mtl) -> Vec3 {
    let textured = mtl.map(MapKind::Diffuse).is_some();
    let color = match mtl.diffuse {
        None if textured => Vec3::ONE,
        // Neither a colour nor what could stand for one.
        None => Vec3::splat(if mtl.emission.is_some() || mtl.specular.is_some() { 0.0 } else { 0.5 }),
        Some(black) if textured && black == Vec3::ZERO => {
            let message = format!("material `{}` has `Kd 0 0 0` with a `map_Kd`", mtl.name);
            context.note(mtl.place.clone(), message, "the map is shown as it is");
            Vec3::ONE
        }
        Some(color) => color,
    };
    if color.max_element() > 1.0 {
        let message = format!("material `{}` has a `Kd` of {color}", mtl.name);
        context.warn(mtl.place.clone(), message, "nothing reflects more than 1, to which it was cut");
    }
    color.min(Vec3::ONE)
}

fn illumination(mtl: &Mtl) -> Option<u32> {
    mtl.illumination.map(|value| value as u32)
}

fn is_glass(mtl: &Mtl) -> bool {
    matches!(illumination(mtl), Some(4 | 6 | 7 | 9))
}

fn reflection(context: &mut Context<'_>, mtl: &Mtl, material: &mut Material) {
    if let Some(ior) = mtl.ior {
        if (1.0..=1e6).contains(&ior) {
            material.ior = if is_glass(mtl) && ior > 1.0 { ior } else { material.ior };
        } else {
            let message = format!("material `{}` has an `Ni` of {ior}", mtl.name);
            context.warn(mtl.place.clone(), message, "1.5 was taken; give an index of at least 1");
        }
    }
    let is_pbr = mtl.map(MapKind::Roughness).or(mtl.map(MapKind::Metallic)).is_some();
    if is_pbr || mtl.roughness.is_some() || mtl.metallic.is_some() {
        material.roughness = unit(mtl.roughness.unwrap_or(0.5));
        material.metallic = unit(mtl.metallic.unwrap_or(0.0));
    } else {
        let specular = mtl.specular.unwrap_or(Vec3::ZERO).min(Vec3::ONE);
        material.specular = (specular.max_element() / F0).min(1.0);
        if material.specular > 0.0 {
            material.specular_color = specular / (F0 * material.specular);
        }
        let mirror = matches!(illumination(mtl), Some(3 | 5 | 8));
        material.roughness = if mirror { 0.0 } else { roughness(mtl.exponent.unwrap_or(10.0)) };
    }
    if let Some(factor) = mtl.clearcoat.filter(|factor| *factor > 0.0) {
        material.clearcoat = Some(Clearcoat {
            factor: factor.min(1.0),
            texture: None,
            roughness: unit(mtl.clearcoat_roughness.unwrap_or(0.0)),
            roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
        });
    }
}

/// Cut to the range 0 to 1; what is no number becomes 1.
fn unit(value: f32) -> f32 {
    if value.is_nan() { 1.0 } else { value.clamp(0.0, 1.0) }
}

/// Perceptual roughness, √α, of a Phong exponent.
fn roughness(exponent: f32) -> f32 {
    let exponent = if exponent.is_nan() { 0.0 } else { exponent.max(0.0) };
    (2.0 / (exponent + 2.0)).sqrt().sqrt()
}

fn transparency(context: &mut Context<'_>, mtl: &Mtl, material: &mut Material) {
    if is_glass(mtl) {
        let filter = mtl.filter.unwrap_or(Vec3::ONE);
        let hue = if filter.max_element() > 0.0 { filter / filter.max_element() } else { Vec3::ONE };
        material.transmission = 1.0;
        material.roughness = mtl.roughness.map_or(0.0, unit);
        material.base_color = hue.extend(1.0);
        material.volume = (mtl.ior.unwrap_or(1.0) > 1.0).then(Volume::default);
        (material.specular, material.specular_color) = (1.0, Vec3::ONE);
        return;
    }
    let stated = mtl.opacity.or(mtl.transparency.map(|t| 1.0 - t)).map(unit);
    let opacity = match (stated, mtl.filter, mtl.illumination) {
        (Some(opacity), _, _) => opacity,
        (None, Some(filter), None) => 1.0 - unit(filter.element_sum() / 3.0),
        _ => 1.0,
    };
    if opacity == 0.0 {
        let message = format!("material `{}` is fully transparent", mtl.name);
        context.note(mtl.place.clone(), message, "`d` is 1 for an opaque surface");
    }
    if opacity < 1.0 {
        material.base_color = Vec4::from((material.base_color.truncate(), opacity));
        material.alpha_mode = AlphaMode::Blend;
    }
}
