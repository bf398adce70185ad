//! Fill colours and shading parameters, and the materials they become.
//! The rules stand in the documentation of [`nff`](crate::nff).

use glam::Vec3;
use heliostat_scene::{Material, Volume};

use super::tokens::Tokens;
use crate::error::LoadError;
use crate::image::pixels::srgb_to_linear;

/// Tells fills apart.
pub(crate) type FillKey = [u32; 15];

/// The current fill: what `f` and AFF's `fm` say, in common terms and as on the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fill {
    /// Shown whether lit or not, under ambient light of 1.
    pub(crate) ambient: Vec3,
    pub(crate) diffuse: Vec3,
    pub(crate) specular: Vec3,
    /// Phong exponent.
    pub(crate) shine: f32,
    /// Share of light that passes, and its colour.
    pub(crate) transmittance: f32,
    pub(crate) tint: Vec3,
    pub(crate) ior: f32,
}

impl Fill {
    /// Before the first fill statement.
    pub(crate) const NEUTRAL: Self = Self {
        ambient: Vec3::ZERO,
        diffuse: Vec3::splat(0.5),
        specular: Vec3::ZERO,
        shine: 0.0,
        transmittance: 0.0,
        tint: Vec3::ONE,
        ior: 1.0,
    };

    /// `f` after the keyword: `red green blue Kd Ks Shine T index_of_refraction`.
    pub(crate) fn parse(tokens: &mut Tokens<'_>) -> Result<Self, LoadError> {
        let color = tokens.color("the fill colour")?;
        let (kd, ks) = (share(tokens, "Kd")?, share(tokens, "Ks")?);
        Ok(Self {
            ambient: Vec3::ZERO,
            diffuse: color * kd,
            specular: Vec3::splat(ks),
            shine: tokens.float("Shine")?,
            transmittance: share(tokens, "T")?,
            tint: color.min(Vec3::ONE),
            ior: tokens.float("the index of refraction")?,
        })
    }

    /// All numbers as bits: fills that agree here are the same material.
    pub(crate) fn key(&self) -> FillKey {
        let colors =
            [self.ambient, self.diffuse, self.specular, self.tint].map(|v| v.to_array().map(f32::to_bits));
        let rest = [self.shine, self.transmittance, self.ior].map(f32::to_bits);
        let mut key = [0; 15];
        for (to, from) in key.iter_mut().zip(colors.into_iter().flatten().chain(rest)) {
            *to = from;
        }
        key
    }

    /// The scene's material.
    pub(crate) fn material(&self, name: String) -> Material {
        let [diffuse, specular] = [self.diffuse, self.specular].map(|color| linear(color.min(Vec3::ONE)));
        let mut material = Material { ambient: linear(self.ambient), ..Material::diffuse(name, diffuse) };
        if specular.max_element() > 0.0 {
            // The strength is the reflectance at grazing angles; the colour raises that at normal incidence to it.
            const F0: f32 = 0.04;
            material.specular = specular.max_element();
            material.specular_color = specular / (F0 * material.specular);
            material.roughness = roughness(self.shine);
        }
        if self.transmittance > 0.0 {
            // A mix of `diffuse` scattered and `tint · T` passed, under one colour.
            let passed = linear(self.tint * self.transmittance.min(1.0));
            let sum = diffuse + passed;
            material.transmission = passed.element_sum() / sum.element_sum().max(f32::MIN_POSITIVE);
            material.transmission = material.transmission.min(1.0);
            material.base_color = sum.min(Vec3::ONE).extend(1.0);
            material.roughness = 0.0;
            (material.specular, material.specular_color) = (1.0, Vec3::ONE);
            let bends = self.ior > 1.0 && self.ior <= 1e6;
            material.ior = if bends { self.ior } else { 1.5 };
            material.volume = bends.then(Volume::default);
        }
        material
    }
}

/// A colour as written in linear values, at most `f32::MAX`. Classical renderers showed what they computed as it was: their
/// colours are those of the screen.
pub(crate) fn linear(color: Vec3) -> Vec3 {
    color.map(|channel| srgb_to_linear(channel).min(f32::MAX))
}

/// A number of at least 0, at most 1 of which counts.
fn share(tokens: &mut Tokens<'_>, what: &str) -> Result<f32, LoadError> {
    let value = tokens.float(what)?;
    if value >= 0.0 {
        return Ok(value.min(1.0));
    }
    Err(tokens.error(format!("{what} is {value}"), "give a value from 0 to 1"))
}

/// AFF's `fm` after the keyword: ambient, diffuse and specular colour, `Shine T index_of_refraction`.
pub(crate) fn extended(tokens: &mut Tokens<'_>) -> Result<Fill, LoadError> {
    Ok(Fill {
        ambient: tokens.color("the ambient colour")?,
        diffuse: tokens.color("the diffuse colour")?,
        specular: tokens.color("the specular colour")?,
        shine: tokens.float("Shine")?,
        transmittance: share(tokens, "T")?,
        tint: Vec3::ONE,
        ior: tokens.float("the index of refraction")?,
    })
}

/// Perceptual roughness. Reflections are sharp in these formats, and only highlights have a width.
fn roughness(shine: f32) -> f32 {
    const SHARP: f32 = 0.1;
    let shine = if shine.is_nan() { 0.0 } else { shine.max(0.0) };
    (2.0 / (shine + 2.0)).sqrt().sqrt().min(SHARP)
}
