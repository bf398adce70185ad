//! Lights whose intensity depends on direction: measured profiles (EXT_lights_ies), and the projectors and light shaders that a
//! node names in its `extras`.

use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;

use glam::{Mat3, Vec3};
use heliostat_scene::{Light, LightKind, ParameterValue, Profile, ShaderUse};
use serde::Deserialize;
use serde_json::Value;

use super::Loader;
use super::container;
use super::json::{LightParameter, LightProfileReference, Projector, ShadedLight};
use super::nodes::Forest;
use super::punctual::place_light;
use crate::error::LoadError;
use crate::ies;

impl Loader<'_, '_> {
    /// The measured light of a node.
    pub(super) fn profile_light(
        &mut self,
        reference: &LightProfileReference,
        name: Option<&str>,
        place: (usize, &Forest),
        user: &str,
    ) -> Result<(), LoadError> {
        let path = format!("{user}.extensions.EXT_lights_ies");
        let Some(profile) = self.profile(reference.light, &path)? else { return Ok(()) };
        let color = Vec3::from_array(reference.color);
        let kind = LightKind::Profile {
            position: Vec3::ZERO,
            world_from_light: Mat3::IDENTITY,
            scale: color.clamp(Vec3::ZERO, Vec3::ONE) * reference.multiplier,
            profile,
            range: f32::INFINITY,
        };
        let name = name.map_or_else(|| format!("light profile {}", reference.light), str::to_owned);
        let usable = color.is_finite() && (0.0..f32::INFINITY).contains(&reference.multiplier);
        self.stand(usable.then_some(kind), name, place, &path);
        Ok(())
    }

    /// The profile of that number; `None` after a warning, once per profile, when it cannot be read.
    fn profile(&mut self, index: usize, user: &str) -> Result<Option<Arc<Profile>>, LoadError> {
        if let Some(known) = self.profiles.get(&index) {
            return Ok(known.clone());
        }
        let profiles = &self.root.extensions.light_profiles.lights;
        let definition = self.item(profiles, "EXT_lights_ies.lights", index, user)?;
        let path = format!("extensions.EXT_lights_ies.lights[{index}]");
        let place = self.place(&path);
        let external = definition.uri.as_deref().filter(|uri| !uri.starts_with("data:"));
        let file: Arc<str> = external.map_or(path.clone(), container::file_name).as_str().into();
        let read = match (&definition.uri, definition.buffer_view) {
            (Some(uri), _) => {
                container::read_uri(self.context, &place, uri).and_then(|bytes| self.luminaire(&file, &bytes))
            }
            (None, Some(view)) => {
                let (bytes, _) = self.view(view, &format!("{path}.bufferView"))?;
                self.luminaire(&file, bytes)
            }
            (None, None) => Err("the profile has neither `uri` nor `bufferView`".into()),
        };
        let profile = read.map_or_else(
            |problem| {
                self.context.warn(place, format!("light profile {problem}"), "its lights are left out");
                None
            },
            |profile| Some(Arc::new(profile)),
        );
        self.profiles.insert(index, profile.clone());
        Ok(profile)
    }

    fn luminaire(&mut self, file: &Arc<str>, bytes: &[u8]) -> Result<Profile, String> {
        ies::luminaire(self.context, file, bytes)
            .map(|luminaire| luminaire.profile)
            .map_err(|error| error.to_string())
    }

    /// The projector that a node asks for in its `extras`.
    pub(super) fn projector(
        &mut self,
        written: &Value,
        name: Option<&str>,
        place: (usize, &Forest),
        user: &str,
    ) -> Result<(), LoadError> {
        let path = format!("{user}.extras.heliostat_projector");
        let projector = match Projector::deserialize(written) {
            Ok(projector) => projector,
            Err(error) => {
                let hint = "write {\"image\": 0, \"intensity\": [r, g, b], \"vertical_fov\": radians}";
                self.context.warn(self.place(&path), format!("the projector was left out: {error}"), hint);
                return Ok(());
            }
        };
        let Some(image) = self.image(projector.image, &path)? else { return Ok(()) };
        let intensity = Vec3::from_array(projector.intensity);
        let vertical_fov = projector.vertical_fov;
        let usable = intensity.is_finite() && intensity.min_element() >= 0.0;
        let usable = usable && (1e-3..3.1).contains(&vertical_fov);
        let kind = LightKind::Projector {
            position: Vec3::ZERO,
            world_from_light: Mat3::IDENTITY,
            intensity,
            vertical_fov,
            image,
            range: f32::INFINITY,
        };
        let name = name.map_or_else(|| "projector".into(), str::to_owned);
        self.stand(usable.then_some(kind), name, place, &path);
        Ok(())
    }

    /// The light by a shader that a node asks for in its `extras`. Which shaders there are is not known here.
    pub(super) fn shaded_light(
        &mut self,
        written: &Value,
        name: Option<&str>,
        place: (usize, &Forest),
        user: &str,
    ) {
        let path = format!("{user}.extras.heliostat_light");
        let light = match ShadedLight::deserialize(written) {
            Ok(light) => light,
            Err(error) => {
                let hint = "write {\"name\": …, \"intensity\": [r, g, b], \"parameters\": {…}}";
                self.context.warn(self.place(&path), format!("the light was left out: {error}"), hint);
                return;
            }
        };
        let value = |value| match value {
            LightParameter::Float(value) => ParameterValue::Float(value),
            LightParameter::Vector(value) => ParameterValue::Vector(value.into()),
        };
        let mut shader = ShaderUse::named(light.name);
        shader.parameters.extend(light.parameters.into_iter().map(|(name, written)| (name, value(written))));
        let scale = Vec3::from_array(light.intensity);
        let kind = LightKind::Shader {
            position: Vec3::ZERO,
            world_from_light: Mat3::IDENTITY,
            scale,
            shader: Arc::new(shader),
            range: f32::INFINITY,
        };
        let name = name.map_or_else(|| "light".into(), str::to_owned);
        let usable = scale.is_finite() && scale.min_element() >= 0.0;
        self.stand(usable.then_some(kind), name, place, &path);
    }

    /// Puts a light at its node, unless its values or the node's transform make no sense.
    fn stand(
        &mut self,
        at_node: Option<LightKind>,
        name: String,
        (node, forest): (usize, &Forest),
        path: &str,
    ) {
        let placed = at_node.and_then(|at_node| {
            let kind = place_light(&at_node, &forest.world[node], forest.visible[node])?;
            Some((at_node, Light { name, kind }))
        });
        match placed {
            Some((at_node, light)) => {
                self.stage.lights.push((self.builder.light(light.clone()), light, at_node, node));
            }
            None => {
                let message = "the light has values out of range or a degenerate transform and was left out";
                let hint = "give finite values of at least 0 and a node that can be turned";
                self.context.warn(self.place(path), message, hint);
            }
        }
    }
}

/// Half a right angle: the field of view of projectors that state none.
pub(super) fn default_fov() -> f32 {
    0.5 * FRAC_PI_2
}
