//! From shaders of the game to physical materials. The rules stand in the documentation of [`bsp`](crate::bsp).

use glam::{Vec3, Vec4};
use heliostat_scene::{AlphaMode, Material, SceneBuilder, TextureRef};

use super::images::{Images, linear, mean, transformed};
use super::look::{Cover, Look};
use super::script::{ColorSource, Map, Shader, Stage};
use super::units;
use crate::context::Context;
use crate::error::LoadError;
use crate::place::Place;

/// Reflectance of what mirrors a picture of its surroundings, in its brightest channel.
const MIRROR_REFLECTANCE: f32 = 0.8;
/// Perceptual roughness of such a mirror: the pictures are blurred.
const MIRROR_ROUGHNESS: f32 = 0.2;
/// Index of what mirrors on top of its own colour: reflects 11 % at normal incidence.
const GLOSS_IOR: f32 = 2.0;
/// Index of water.
const WATER_IOR: f32 = 1.33;
/// The most an image is brightened by to give the light that its shader states.
const MOST_GAIN: f32 = 1e4;

/// The most that a channel is brightened by over the brightest one, to give a light its hue.
const MOST_TINT: f32 = 8.0;

/// Makes the materials of one map.
pub(super) struct Materials<'m> {
    pub(super) images: &'m mut Images,
    /// Whether light comes from the light maps.
    pub(super) baked: bool,
    /// Radiance of the worldspawn's ambient light on white.
    pub(super) ambient: Vec3,
    /// Stages of shaders that could not be shown.
    pub(super) left_out: usize,
    /// Shaders whose coordinates or vertices move in the game.
    pub(super) moving: usize,
}

/// What to make one material of.
struct Making<'a, 'c, 'x> {
    context: &'c mut Context<'x>,
    builder: &'c mut SceneBuilder,
    place: &'a Place,
}

impl Materials<'_> {
    /// The material of a shader; without a script it is the image of its name, with light on it. Says, too, whether
    /// light falls on it in the game.
    ///
    /// # Errors
    /// When the images exceed the limits.
    pub(super) fn material(
        &mut self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        place: &Place,
        (name, shader): (&str, Option<&Shader>),
    ) -> Result<(Material, bool), LoadError> {
        let image = Map::Image { name: super::script::normalised(name), clamp: false };
        let plain = Stage { map: image, ..Stage::default() };
        let unscripted = Shader::default();
        let shader = shader.unwrap_or(&unscripted);
        let mut look = Look::new(shader);
        if look.base.is_none() && look.mirror.is_none() && look.glow.is_empty() {
            (look.base, look.lit) = (Some(&plain), true);
        }
        self.left_out += look.left_out;
        let moves = shader.deforms || shader.stages.iter().any(|stage| stage.moves);
        self.moving += usize::from(moves);
        let mut making = Making { context, builder, place };
        let material = Material {
            name: name.to_owned(),
            specular: 0.0,
            double_sided: shader.two_sided,
            ..Material::default()
        };
        let material = self.dress(&mut making, material, shader, &look)?;
        Ok((material, look.lit))
    }

    fn dress(
        &mut self,
        making: &mut Making<'_, '_, '_>,
        mut material: Material,
        shader: &Shader,
        look: &Look<'_>,
    ) -> Result<Material, LoadError> {
        if let Some(base) = look.base {
            material.base_color = tint(base).extend(base.alpha.unwrap_or(1.0));
            material.base_color_texture = self.texture(making, base)?;
        }
        cover(&mut material, look.cover);
        if self.baked {
            material.unlit = matches!(look.cover, Cover::Opaque | Cover::Holes(_) | Cover::Alpha);
            return Ok(material);
        }
        if let Some(mirror) = look.mirror {
            self.mirror(making, &mut material, mirror, look)?;
        }
        if look.cover != Cover::Opaque && (shader.has("water") || shader.has("slime")) {
            (material.specular, material.ior) = (1.0, WATER_IOR);
            material.roughness = material.roughness.min(0.05);
        }
        self.emission(making, &mut material, shader, look)?;
        if look.lit {
            material.ambient = self.ambient * material.base_color.truncate();
        } else if look.mirror.is_none() && look.cover != Cover::Filter {
            // Shown as it is: what it looks like is what it emits. Alpha stays.
            material.base_color = Vec4::from((Vec3::ZERO, material.base_color.w));
            if look.cover == Cover::Glow {
                material.base_color = Vec4::ONE;
            }
        }
        Ok(material)
    }

    fn texture(
        &mut self,
        making: &mut Making<'_, '_, '_>,
        stage: &Stage,
    ) -> Result<Option<TextureRef>, LoadError> {
        let Map::Image { name, clamp } = &stage.map else { return Ok(None) };
        let texture = self.images.texture(making.context, making.builder, making.place, (name, *clamp))?;
        Ok(Some(transformed(texture, stage.transform)))
    }

    /// Mean colour of a stage's image; `None` if there is none.
    fn mean(&mut self, making: &mut Making<'_, '_, '_>, stage: &Stage) -> Result<Option<Vec3>, LoadError> {
        match &stage.map {
            Map::Image { name, .. } => {
                let image = self.images.read(making.context, making.place, name)?;
                Ok(image.map(|image| mean(&image)))
            }
            _ => Ok(Some(Vec3::ONE)),
        }
    }

    fn mirror(
        &mut self,
        making: &mut Making<'_, '_, '_>,
        material: &mut Material,
        mirror: &Stage,
        look: &Look<'_>,
    ) -> Result<(), LoadError> {
        let over = mirror.blend.is_some();
        material.roughness = if look.cover == Cover::Glow { 0.0 } else { MIRROR_ROUGHNESS };
        if over {
            (material.specular, material.ior) = (1.0, GLOSS_IOR);
            return Ok(());
        }
        let mean = self.mean(making, mirror)?.unwrap_or(Vec3::ONE);
        let hue = if mean.max_element() > 0.0 { mean / mean.max_element() } else { Vec3::ONE };
        material.metallic = 1.0;
        material.base_color = (MIRROR_REFLECTANCE * hue * tint(mirror)).extend(material.base_color.w);
        Ok(())
    }

    /// The even light of a sky's faces, through which it is seen; `None` without light.
    ///
    /// # Errors
    /// When the images exceed the limits.
    pub(super) fn veil(
        &mut self,
        context: &mut Context<'_>,
        place: &Place,
        shader: &Shader,
    ) -> Result<Option<Material>, LoadError> {
        let picture = shader.stages.iter().find_map(|stage| match &stage.map {
            Map::Image { name, .. } => Some(name),
            _ => None,
        });
        let image = match shader.light_image.as_ref().or(picture) {
            Some(name) => self.images.read(context, place, name)?,
            None => None,
        };
        let hue = image.map_or(Vec3::ONE, |image| hue(mean(&image)));
        let emissive = units::surface_light(shader.surface_light) * hue;
        let shines = emissive.is_finite() && emissive.max_element() > 0.0;
        let sheet = Material { name: shader.name.clone(), specular: 0.0, emissive, ..Material::default() };
        Ok(shines.then_some(Material { transmission: 1.0, roughness: 0.0, ..sheet }))
    }

    /// What shines: images added on top, surfaces without light on them, and light that the compiler was told of.
    fn emission(
        &mut self,
        making: &mut Making<'_, '_, '_>,
        material: &mut Material,
        shader: &Shader,
        look: &Look<'_>,
    ) -> Result<(), LoadError> {
        let reflects = look.lit || look.mirror.is_some() || look.cover == Cover::Filter;
        let as_shown = if reflects { None } else { look.base };
        let first = as_shown.or(look.glow.first().copied());
        let stage = match first {
            Some(stage) => stage.clone(),
            None if shader.surface_light > 0.0 => match (&shader.light_image, look.base) {
                (Some(name), _) => {
                    Stage { map: Map::Image { name: name.clone(), clamp: false }, ..Stage::default() }
                }
                (None, Some(base)) => base.clone(),
                (None, None) => Stage { map: Map::White, ..Stage::default() },
            },
            None => return Ok(()),
        };
        // One image for all: others are left out.
        let same = look.glow.iter().filter(|other| other.map == stage.map);
        let times = same.clone().count() + usize::from(as_shown.is_some());
        self.left_out += look.glow.len() - same.count();
        let mean = self.mean(making, &stage)?;
        if shader.surface_light > 0.0 {
            let color = mean.filter(|mean| mean.max_element() > 0.0);
            let gain = color.map_or(Vec3::ONE, |mean| {
                let least = (1.0 / mean.max_element()).min(MOST_GAIN);
                (hue(mean) / mean.max(Vec3::splat(1e-6))).min(Vec3::splat(MOST_TINT * least))
            });
            material.emissive = units::surface_light(shader.surface_light) * gain;
            // The light is there even where its picture is not.
            material.emissive_texture = if color.is_some() { self.texture(making, &stage)? } else { None };
        } else if mean.is_some() || as_shown.is_some() {
            material.emissive = tint(&stage) * times.max(1) as f32;
            material.emissive_texture = self.texture(making, &stage)?;
        }
        if !material.emissive.is_finite() {
            material.emissive = Vec3::ZERO;
        }
        Ok(())
    }
}

/// The hue of light from a mean linear colour, with a maximum of 1: the compiler took values on the screen for light.
fn hue(mean: Vec3) -> Vec3 {
    let screen = mean.map(|value| value.max(0.0).powf(1.0 / 2.2));
    if screen.max_element() > 0.0 { screen / screen.max_element() } else { Vec3::ONE }
}

/// The constant linear colour that multiplies a stage's image.
fn tint(stage: &Stage) -> Vec3 {
    match stage.color {
        ColorSource::Constant(color) => linear(color),
        ColorSource::Unstated | ColorSource::Identity | ColorSource::Vertex => Vec3::ONE,
    }
}

fn cover(material: &mut Material, cover: Cover) {
    match cover {
        Cover::Opaque => {}
        Cover::Holes(cutoff) => material.alpha_mode = AlphaMode::Mask { cutoff },
        Cover::Alpha => material.alpha_mode = AlphaMode::Blend,
        Cover::Glow | Cover::Filter => (material.transmission, material.roughness) = (1.0, 0.0),
    }
}
