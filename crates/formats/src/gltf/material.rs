//! Materials: the core model and its extensions.

use std::sync::Arc;

use glam::{Vec3, Vec4};
use heliostat_scene::{AlphaMode, Clearcoat, ColorSpace, Material, MaterialId, Volume};

use super::Loader;
use super::json;
use crate::error::LoadError;

use ColorSpace::{Linear, Srgb};

impl Loader<'_, '_> {
    /// The material of that number, or the specification's default; made when it is first used.
    pub(super) fn material(&mut self, index: Option<usize>, user: &str) -> Result<MaterialId, LoadError> {
        if let Some(&known) = self.materials.get(&index) {
            return Ok(known);
        }
        let default = json::Material::default();
        let (definition, path) = match index {
            Some(index) => {
                let user = format!("{user}.material");
                (self.item(&self.root.materials, "materials", index, &user)?, format!("materials[{index}]"))
            }
            None => (&default, "materials".to_owned()),
        };
        self.context.count_materials(1, &self.place(&path))?;
        let material = self.convert(definition, &path)?;
        let id = self.builder.material(material);
        self.materials.insert(index, id);
        Ok(id)
    }

    fn convert(&mut self, definition: &json::Material, path: &str) -> Result<Material, LoadError> {
        let pbr = &definition.pbr_metallic_roughness;
        let mut material = Material {
            name: definition.name.clone().unwrap_or_else(|| path.to_owned()),
            base_color: self.unit4(pbr.base_color_factor, path, "baseColorFactor"),
            base_color_texture: self.texture(pbr.base_color_texture.as_ref(), Srgb, path)?,
            metallic: self.unit(pbr.metallic_factor, path, "metallicFactor"),
            roughness: self.unit(pbr.roughness_factor, path, "roughnessFactor"),
            metallic_roughness_texture: self.texture(
                pbr.metallic_roughness_texture.as_ref(),
                Linear,
                path,
            )?,
            normal_texture: self.texture(definition.normal_texture.as_ref(), Linear, path)?,
            normal_scale: normal_scale(definition.normal_texture.as_ref()),
            emissive: self.positive(definition.emissive_factor, path, "emissiveFactor"),
            emissive_texture: self.texture(definition.emissive_texture.as_ref(), Srgb, path)?,
            double_sided: definition.double_sided,
            alpha_mode: self.alpha_mode(definition, path),
            ..Material::default()
        };
        if let Some(extensions) = &definition.extensions {
            self.surface_extensions(extensions, path, &mut material)?;
            self.transmission_extensions(extensions, path, &mut material)?;
            if let Some(clearcoat) = &extensions.clearcoat {
                material.clearcoat = self.clearcoat(clearcoat, path)?;
            }
        }
        if let Some(json::MaterialExtras::Ours { heliostat_shader }) = definition.extras.as_deref() {
            material.shader = self.shader(heliostat_shader, path)?.map(Arc::new);
        }
        Ok(material)
    }

    fn alpha_mode(&mut self, definition: &json::Material, path: &str) -> AlphaMode {
        match definition.alpha_mode.as_deref() {
            None | Some("OPAQUE") => AlphaMode::Opaque,
            Some("BLEND") => AlphaMode::Blend,
            Some("MASK") => {
                let cutoff = definition.alpha_cutoff.filter(|c| c.is_finite()).unwrap_or(0.5);
                AlphaMode::Mask { cutoff }
            }
            Some(other) => {
                let message = format!("`alphaMode` is `{other}`");
                self.context.warn(self.place(path), message, "the material is opaque");
                AlphaMode::Opaque
            }
        }
    }

    /// What changes the reflection and the emission.
    fn surface_extensions(
        &mut self,
        extensions: &json::MaterialExtensions,
        path: &str,
        material: &mut Material,
    ) -> Result<(), LoadError> {
        if let Some(strength) = &extensions.emissive_strength {
            let emissive = material.emissive * strength.emissive_strength;
            material.emissive = self.positive(emissive.to_array(), path, "emissiveStrength");
        }
        material.unlit = extensions.unlit.is_some();
        if let Some(ior) = &extensions.ior {
            if ior.ior == 0.0 || (1.0..=1e6).contains(&ior.ior) {
                material.ior = ior.ior;
            } else {
                let message = format!("`ior` is {}", ior.ior);
                self.context.warn(
                    self.place(path),
                    message,
                    "1.5 was taken; give 0 or a value of at least 1",
                );
            }
        }
        if let Some(old) = &extensions.specular_glossiness {
            self.specular_glossiness(old, path, material)?;
        }
        if let Some(specular) = &extensions.specular {
            material.specular = self.unit(specular.specular_factor, path, "specularFactor");
            material.specular_texture = self.texture(specular.specular_texture.as_ref(), Linear, path)?;
            material.specular_color =
                self.positive(specular.specular_color_factor, path, "specularColorFactor");
            material.specular_color_texture =
                self.texture(specular.specular_color_texture.as_ref(), Srgb, path)?;
        }
        Ok(())
    }

    /// The older model: its specular colour is the reflectance at normal incidence, which index 1.5 (0.04) and a
    /// specular colour reproduce exactly. Its combined texture has no counterpart.
    fn specular_glossiness(
        &mut self,
        old: &json::SpecularGlossiness,
        path: &str,
        material: &mut Material,
    ) -> Result<(), LoadError> {
        material.base_color = self.unit4(old.diffuse_factor, path, "diffuseFactor");
        material.base_color_texture = self.texture(old.diffuse_texture.as_ref(), Srgb, path)?;
        material.metallic = 0.0;
        material.roughness = 1.0 - self.unit(old.glossiness_factor, path, "glossinessFactor");
        material.metallic_roughness_texture = None;
        material.specular_color = self.positive(old.specular_factor, path, "specularFactor") / 0.04;
        if old.specular_glossiness_texture.is_some() {
            let message = "`specularGlossinessTexture` is not supported and was ignored";
            self.context.warn(self.place(path), message, "convert the material to metallic-roughness");
        }
        Ok(())
    }

    fn transmission_extensions(
        &mut self,
        extensions: &json::MaterialExtensions,
        path: &str,
        material: &mut Material,
    ) -> Result<(), LoadError> {
        if let Some(transmission) = &extensions.transmission {
            material.transmission = self.unit(transmission.transmission_factor, path, "transmissionFactor");
            material.transmission_texture =
                self.texture(transmission.transmission_texture.as_ref(), Linear, path)?;
        }
        if let Some(volume) = extensions.volume.as_ref().filter(|volume| volume.thickness_factor > 0.0) {
            let distance = volume.attenuation_distance.filter(|d| *d > 0.0).unwrap_or(f32::INFINITY);
            let color = volume.attenuation_color.map(|c| self.unit(c, path, "attenuationColor"));
            let attenuation_color = Vec3::from_array(color);
            material.volume = Some(Volume { attenuation_color, attenuation_distance: distance });
        }
        Ok(())
    }

    fn clearcoat(&mut self, coat: &json::Clearcoat, path: &str) -> Result<Option<Clearcoat>, LoadError> {
        if coat.clearcoat_factor == 0.0 {
            return Ok(None);
        }
        Ok(Some(Clearcoat {
            factor: self.unit(coat.clearcoat_factor, path, "clearcoatFactor"),
            texture: self.texture(coat.clearcoat_texture.as_ref(), Linear, path)?,
            roughness: self.unit(coat.clearcoat_roughness_factor, path, "clearcoatRoughnessFactor"),
            roughness_texture: self.texture(coat.clearcoat_roughness_texture.as_ref(), Linear, path)?,
            normal_texture: self.texture(coat.clearcoat_normal_texture.as_ref(), Linear, path)?,
            normal_scale: normal_scale(coat.clearcoat_normal_texture.as_ref()),
        }))
    }

    /// A number from 0 to 1; others are cut with a warning.
    fn unit(&mut self, value: f32, path: &str, name: &str) -> f32 {
        let cut = if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) };
        if cut != value {
            let message = format!("`{name}` is {value}");
            self.context.warn(self.place(path), message, "it was cut to the range 0 to 1");
        }
        cut
    }

    fn unit4(&mut self, values: [f32; 4], path: &str, name: &str) -> Vec4 {
        Vec4::from_array(values.map(|value| self.unit(value, path, name)))
    }

    /// Finite numbers of at least 0; others become 0 with a warning.
    fn positive(&mut self, values: [f32; 3], path: &str, name: &str) -> Vec3 {
        let vector = Vec3::from_array(values);
        if vector.is_finite() && vector.min_element() >= 0.0 {
            return vector;
        }
        self.context.warn(
            self.place(path),
            format!("`{name}` is {vector}"),
            "0 was taken where it is negative",
        );
        Vec3::from_array(values.map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 }))
    }
}

fn normal_scale(info: Option<&json::TextureInfo>) -> f32 {
    info.map(|info| info.scale).filter(|scale| scale.is_finite()).unwrap_or(1.0)
}
