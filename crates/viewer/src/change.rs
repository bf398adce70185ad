//! What a user can change in a scene, small enough to be stored, sent and taken back.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Affine3A, Mat3, Vec3};
use heliostat_scene::{
    Edit, Environment, EnvironmentMap, Gradient, InstanceId, Light, LightId, LightKind, Material, MaterialId,
    Scene, ShadedEnvironment, Sky,
};
use serde::{Deserialize, Serialize};

use crate::luminaire::{Beam, Luminaire, ShadedLamp};

/// One change. Handles are the numbers that the scene's loader gave out; the same file gives the same numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Change {
    /// Moves an instance.
    Place {
        /// Which.
        instance: u32,
        /// Three columns of the matrix, then the translation.
        parent_from_object: [f32; 12],
    },
    /// Shows or hides an instance.
    Show {
        /// Which.
        instance: u32,
        /// Whether it is seen.
        visible: bool,
    },
    /// Sets the factors of a material; its textures and shaders stay.
    Material {
        /// Which.
        material: u32,
        /// The factors.
        look: Look,
    },
    /// Defines, replaces or (without `to`) removes a light.
    Light {
        /// Which.
        light: u32,
        /// For people.
        #[serde(default)]
        name: String,
        /// What it becomes.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        to: Option<Lamp>,
    },
    /// Replaces what surrounds the scene.
    Environment {
        /// What it becomes.
        to: Surroundings,
    },
}

/// The factors of a material that can be set; fields as in [`Material`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the fields are those of `Material`")]
pub struct Look {
    pub base_color: [f32; 4],
    pub metallic: f32,
    pub roughness: f32,
    pub emissive: [f32; 3],
    pub transmission: f32,
    pub ior: f32,
    pub specular: f32,
}

/// A light; fields as in [`LightKind`], where `range` is absent for infinity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
#[expect(missing_docs, reason = "the fields are those of `LightKind`")]
pub enum Lamp {
    Point {
        position: [f32; 3],
        intensity: [f32; 3],
        #[serde(default, skip_serializing_if = "Option::is_none")]
        range: Option<f32>,
    },
    Spot {
        position: [f32; 3],
        direction: [f32; 3],
        intensity: [f32; 3],
        inner_angle: f32,
        outer_angle: f32,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        range: Option<f32>,
    },
    ConstantPoint {
        position: [f32; 3],
        irradiance: [f32; 3],
    },
    Directional {
        direction: [f32; 3],
        irradiance: [f32; 3],
    },
    /// A measured light: of this make, or else the one that is there or came with the scene, elsewhere or brighter.
    Profile {
        position: [f32; 3],
        scale: [f32; 3],
        #[serde(default, skip_serializing_if = "Option::is_none")]
        make: Option<Luminaire>,
    },
    /// A projector: of this make, or else the one that is there or came with the scene, elsewhere or brighter.
    Projector {
        position: [f32; 3],
        intensity: [f32; 3],
        #[serde(default, skip_serializing_if = "Option::is_none")]
        make: Option<Beam>,
    },
    /// A light by a shader: of this make, or else the one that is there or came with the scene, elsewhere or brighter.
    Shader {
        position: [f32; 3],
        scale: [f32; 3],
        #[serde(default, skip_serializing_if = "Option::is_none")]
        make: Option<ShadedLamp>,
    },
}

/// What a scene came with and small changes cannot say: they refer to it.
#[derive(Clone, Debug, Default)]
pub struct Own {
    pub(crate) environment: Environment,
    /// Lights that hold measurements, pictures or shaders.
    lights: BTreeMap<LightId, LightKind>,
}

impl Own {
    /// Of a scene before any change.
    pub fn of(scene: &Scene) -> Self {
        let holds = |kind: &LightKind| Lamp::of(kind).is_short();
        let lights = scene.lights().iter().filter(|(_, light)| holds(&light.kind));
        Self {
            environment: scene.environment().clone(),
            lights: lights.map(|(id, light)| (*id, light.kind.clone())).collect(),
        }
    }

    /// A change that stands for itself: one of a light with a make that the scene did not come with says all of what that
    /// is, as it is in the scene of now.
    pub(crate) fn complete(&self, mut change: Change, scene: &Scene) -> Change {
        if let Change::Light { light, to: Some(lamp), .. } = &mut change
            && lamp.kind(self.lights.get(&LightId(*light))).is_none()
            && let Some(now) = scene.lights().get(&LightId(*light))
        {
            match lamp {
                Lamp::Profile { make, .. } => *make = Luminaire::of(&now.kind),
                Lamp::Projector { make, .. } => *make = Beam::of(&now.kind),
                Lamp::Shader { make, .. } => *make = ShadedLamp::of(&now.kind),
                _ => {}
            }
        }
        change
    }
}

/// What surrounds a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Surroundings {
    /// Nothing: black.
    Dark,
    /// The same radiance from everywhere.
    Constant {
        /// Linear Rec. 709 radiance.
        radiance: [f32; 3],
    },
    /// A clear sky with its sun.
    Sky {
        /// Haze, 1.7 to 10.
        turbidity: f32,
        /// Of the sun above the horizon, radians.
        elevation: f32,
        /// Of the sun, from −Z towards +X, radians.
        azimuth: f32,
        /// Multiplies the radiance.
        scale: [f32; 3],
    },
    /// What the scene brings, brighter or dimmer and turned.
    Own {
        /// Multiplies the radiance.
        scale: [f32; 3],
        /// Turn about +Y, radians.
        turn: f32,
    },
}

impl Default for Surroundings {
    /// What the scene brings, as it is.
    fn default() -> Self {
        Self::Own { scale: [1.0; 3], turn: 0.0 }
    }
}

impl Change {
    /// Where an instance shall stand.
    pub fn place(instance: InstanceId, parent_from_object: Affine3A) -> Self {
        Self::Place { instance: instance.0, parent_from_object: parent_from_object.to_cols_array() }
    }

    /// The edit that makes this change; `own` is of the scene as it came.
    ///
    /// # Errors
    /// When the scene has no such thing. Values out of range are refused when the edit is applied.
    pub fn edit(&self, scene: &Scene, own: &Own) -> Result<Edit, String> {
        Ok(match self {
            Self::Place { instance, parent_from_object } => {
                Edit::MoveInstance(InstanceId(*instance), Affine3A::from_cols_array(parent_from_object))
            }
            &Self::Show { instance, visible } => Edit::ShowInstance(InstanceId(instance), visible),
            Self::Material { material, look } => {
                let id = MaterialId(*material);
                let old = scene.materials().get(&id).ok_or_else(|| format!("there is no {id}"))?;
                Edit::Material(id, Arc::new(look.onto(old)))
            }
            Self::Light { light, to: None, .. } => Edit::RemoveLight(LightId(*light)),
            Self::Light { light, name, to: Some(lamp) } => {
                let id = LightId(*light);
                let missing = || format!("{id} did not come with the scene as one of this kind");
                let now = scene.lights().get(&id).map(|light| &light.kind);
                let kind = lamp.kind(now).or_else(|| lamp.kind(own.lights.get(&id)));
                let kind = kind.ok_or_else(missing)?;
                Edit::Light(id, Light { name: name.clone(), kind })
            }
            Self::Environment { to } => Edit::Environment(to.around(&own.environment)),
        })
    }

    /// The change that takes this one back; `surroundings` are those of now.
    ///
    /// # Errors
    /// When the scene has no such thing.
    pub fn inverse(&self, scene: &Scene, surroundings: &Surroundings) -> Result<Self, String> {
        let instance = |number: u32| {
            let id = InstanceId(number);
            scene.instances().get(&id).ok_or_else(|| format!("there is no {id}"))
        };
        Ok(match *self {
            Self::Place { instance: id, .. } => Self::place(InstanceId(id), instance(id)?.parent_from_object),
            Self::Show { instance: id, .. } => Self::Show { instance: id, visible: instance(id)?.visible },
            Self::Material { material, .. } => {
                let id = MaterialId(material);
                let old = scene.materials().get(&id).ok_or_else(|| format!("there is no {id}"))?;
                Self::Material { material, look: Look::of(old) }
            }
            Self::Light { light, .. } => {
                let old = scene.lights().get(&LightId(light));
                let name = old.map_or(String::new(), |old| old.name.clone());
                Self::Light { light, name, to: old.map(|old| Lamp::of(&old.kind)) }
            }
            Self::Environment { .. } => Self::Environment { to: surroundings.clone() },
        })
    }

    /// Leaves out what an earlier change of the same light says already, up to which nothing else has happened to it.
    pub(crate) fn shorten(&mut self, earlier: &Self) {
        let (Self::Light { to: Some(lamp), .. }, Self::Light { to: Some(before), .. }) = (self, earlier)
        else {
            return;
        };
        match (lamp, before) {
            (Lamp::Profile { make, .. }, Lamp::Profile { make: known, .. }) if make == known => *make = None,
            (Lamp::Projector { make, .. }, Lamp::Projector { make: known, .. }) if make == known => {
                *make = None;
            }
            (Lamp::Shader { make, .. }, Lamp::Shader { make: known, .. }) if make == known => *make = None,
            _ => {}
        }
    }

    /// Whether it leaves out what the light is made of.
    pub(crate) fn is_short(&self) -> bool {
        matches!(self, Self::Light { to: Some(lamp), .. } if lamp.is_short())
    }

    /// Takes over what only an earlier change of the same light says, which this one replaces.
    pub(crate) fn lengthen(&mut self, earlier: &Self) {
        let (Self::Light { to: Some(lamp), .. }, Self::Light { to: Some(before), .. }) = (self, earlier)
        else {
            return;
        };
        match (lamp, before) {
            (Lamp::Profile { make: make @ None, .. }, Lamp::Profile { make: known, .. }) => {
                make.clone_from(known);
            }
            (Lamp::Projector { make: make @ None, .. }, Lamp::Projector { make: known, .. }) => {
                make.clone_from(known);
            }
            (Lamp::Shader { make: make @ None, .. }, Lamp::Shader { make: known, .. }) => {
                make.clone_from(known);
            }
            _ => {}
        }
    }

    /// For menus: what this does.
    pub fn label(&self) -> &'static str {
        match self {
            Self::Place { .. } => "move object",
            Self::Show { visible: true, .. } => "show object",
            Self::Show { visible: false, .. } => "hide object",
            Self::Material { .. } => "material",
            Self::Light { to: None, .. } => "remove light",
            Self::Light { .. } => "light",
            Self::Environment { .. } => "environment",
        }
    }

    /// Whether both change the same thing in the same respect, so that the later one stands for both.
    pub fn same_target(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Place { instance: a, .. }, Self::Place { instance: b, .. })
            | (Self::Show { instance: a, .. }, Self::Show { instance: b, .. })
            | (Self::Material { material: a, .. }, Self::Material { material: b, .. })
            | (Self::Light { light: a, .. }, Self::Light { light: b, .. }) => a == b,
            (Self::Environment { .. }, Self::Environment { .. }) => true,
            _ => false,
        }
    }
}

impl Look {
    /// The factors of a material.
    pub fn of(material: &Material) -> Self {
        Self {
            base_color: material.base_color.to_array(),
            metallic: material.metallic,
            roughness: material.roughness,
            emissive: material.emissive.to_array(),
            transmission: material.transmission,
            ior: material.ior,
            specular: material.specular,
        }
    }

    fn onto(&self, material: &Material) -> Material {
        Material {
            base_color: self.base_color.into(),
            metallic: self.metallic,
            roughness: self.roughness,
            emissive: self.emissive.into(),
            transmission: self.transmission,
            ior: self.ior,
            specular: self.specular,
            ..material.clone()
        }
    }
}

impl Lamp {
    /// The form of a light.
    pub fn of(kind: &LightKind) -> Self {
        let finite = |range: &f32| range.is_finite().then_some(*range);
        match kind {
            LightKind::Point { position, intensity, range } => Self::Point {
                position: position.to_array(),
                intensity: intensity.to_array(),
                range: finite(range),
            },
            LightKind::Spot { position, direction, intensity, inner_angle, outer_angle, range } => {
                Self::Spot {
                    position: position.to_array(),
                    direction: direction.to_array(),
                    intensity: intensity.to_array(),
                    inner_angle: *inner_angle,
                    outer_angle: *outer_angle,
                    range: finite(range),
                }
            }
            LightKind::ConstantPoint { position, irradiance } => {
                Self::ConstantPoint { position: position.to_array(), irradiance: irradiance.to_array() }
            }
            LightKind::Directional { direction, irradiance } => {
                Self::Directional { direction: direction.to_array(), irradiance: irradiance.to_array() }
            }
            LightKind::Profile { position, scale, .. } => {
                Self::Profile { position: position.to_array(), scale: scale.to_array(), make: None }
            }
            LightKind::Projector { position, intensity, .. } => {
                Self::Projector { position: position.to_array(), intensity: intensity.to_array(), make: None }
            }
            LightKind::Shader { position, scale, .. } => {
                Self::Shader { position: position.to_array(), scale: scale.to_array(), make: None }
            }
        }
    }

    /// The light; `own` is one that has what this form does not say. `None` if that is one of another kind.
    fn kind(&self, own: Option<&LightKind>) -> Option<LightKind> {
        let far = |range: Option<f32>| range.unwrap_or(f32::INFINITY);
        Some(match (self, own) {
            (&Self::Point { position, intensity, range }, _) => {
                LightKind::Point { position: position.into(), intensity: intensity.into(), range: far(range) }
            }
            (&Self::Spot { position, direction, intensity, inner_angle, outer_angle, range }, _) => {
                LightKind::Spot {
                    position: position.into(),
                    direction: direction.into(),
                    intensity: intensity.into(),
                    inner_angle,
                    outer_angle,
                    range: far(range),
                }
            }
            (&Self::ConstantPoint { position, irradiance }, _) => {
                LightKind::ConstantPoint { position: position.into(), irradiance: irradiance.into() }
            }
            (&Self::Directional { direction, irradiance }, _) => {
                LightKind::Directional { direction: direction.into(), irradiance: irradiance.into() }
            }
            (Self::Profile { position, scale, make: Some(make) }, _) => {
                make.light((*position).into(), (*scale).into())
            }
            (Self::Projector { position, intensity, make: Some(make) }, _) => {
                make.light((*position).into(), (*intensity).into())
            }
            (Self::Shader { position, scale, make: Some(make) }, _) => {
                make.light((*position).into(), (*scale).into())
            }
            (
                Self::Profile { position, scale, .. },
                Some(LightKind::Profile { world_from_light, profile, range, .. }),
            ) => LightKind::Profile {
                position: (*position).into(),
                world_from_light: *world_from_light,
                scale: (*scale).into(),
                profile: profile.clone(),
                range: *range,
            },
            (
                Self::Projector { position, intensity, .. },
                Some(LightKind::Projector { world_from_light, vertical_fov, image, range, .. }),
            ) => LightKind::Projector {
                position: (*position).into(),
                world_from_light: *world_from_light,
                intensity: (*intensity).into(),
                vertical_fov: *vertical_fov,
                image: image.clone(),
                range: *range,
            },
            (
                Self::Shader { position, scale, .. },
                Some(LightKind::Shader { world_from_light, shader, range, .. }),
            ) => LightKind::Shader {
                position: (*position).into(),
                world_from_light: *world_from_light,
                scale: (*scale).into(),
                shader: shader.clone(),
                range: *range,
            },
            (Self::Profile { .. } | Self::Projector { .. } | Self::Shader { .. }, _) => return None,
        })
    }

    /// Whether it leaves out what the light is made of.
    fn is_short(&self) -> bool {
        matches!(
            self,
            Self::Profile { make: None, .. }
                | Self::Projector { make: None, .. }
                | Self::Shader { make: None, .. }
        )
    }

    /// Where it stands; lights at infinity stand nowhere.
    pub fn position(&self) -> Option<Vec3> {
        match *self {
            Self::Point { position, .. }
            | Self::Spot { position, .. }
            | Self::ConstantPoint { position, .. }
            | Self::Profile { position, .. }
            | Self::Shader { position, .. }
            | Self::Projector { position, .. } => Some(position.into()),
            Self::Directional { .. } => None,
        }
    }

    /// Its intensity, irradiance or factor.
    pub fn color(&self) -> [f32; 3] {
        match *self {
            Self::Point { intensity: power, .. }
            | Self::Spot { intensity: power, .. }
            | Self::ConstantPoint { irradiance: power, .. }
            | Self::Directional { irradiance: power, .. }
            | Self::Profile { scale: power, .. }
            | Self::Shader { scale: power, .. }
            | Self::Projector { intensity: power, .. } => power,
        }
    }

    /// The same light, so many times as bright.
    #[must_use]
    pub fn times(self, factor: f32) -> Self {
        let color = self.color().map(|value| value * factor);
        self.colored(color)
    }

    /// The same light of another intensity, irradiance or factor.
    #[must_use]
    pub fn colored(mut self, color: [f32; 3]) -> Self {
        match &mut self {
            Self::Point { intensity: power, .. }
            | Self::Spot { intensity: power, .. }
            | Self::ConstantPoint { irradiance: power, .. }
            | Self::Directional { irradiance: power, .. }
            | Self::Profile { scale: power, .. }
            | Self::Shader { scale: power, .. }
            | Self::Projector { intensity: power, .. } => *power = color,
        }
        self
    }

    /// The same light elsewhere; lights at infinity stay.
    pub fn at(mut self, place: Vec3) -> Self {
        match &mut self {
            Self::Point { position, .. }
            | Self::Spot { position, .. }
            | Self::ConstantPoint { position, .. }
            | Self::Profile { position, .. }
            | Self::Shader { position, .. }
            | Self::Projector { position, .. } => {
                *position = place.to_array();
            }
            Self::Directional { .. } => {}
        }
        self
    }
}

impl Surroundings {
    /// Its radiance or factor; `None` in the dark.
    pub fn light(&self) -> Option<[f32; 3]> {
        match *self {
            Self::Dark => None,
            Self::Constant { radiance } => Some(radiance),
            Self::Sky { scale, .. } | Self::Own { scale, .. } => Some(scale),
        }
    }

    /// The same, so many times as bright.
    #[must_use]
    pub fn times(mut self, factor: f32) -> Self {
        match &mut self {
            Self::Dark => {}
            Self::Constant { radiance: light }
            | Self::Sky { scale: light, .. }
            | Self::Own { scale: light, .. } => {
                *light = light.map(|value| value * factor);
            }
        }
        self
    }

    /// The environment; `own` is what the scene brings.
    fn around(&self, own: &Environment) -> Environment {
        match *self {
            Self::Dark => Environment::None,
            Self::Constant { radiance } => Environment::Constant(radiance.into()),
            Self::Sky { turbidity, elevation, azimuth, scale } => {
                Environment::Sky(Sky { scale: scale.into(), ..Sky::new(turbidity, elevation, azimuth) })
            }
            Self::Own { scale, turn } => match own {
                Environment::None => Environment::None,
                Environment::Constant(radiance) => Environment::Constant(*radiance * Vec3::from(scale)),
                Environment::Gradient(bands) => Environment::Gradient(Gradient {
                    zenith: bands.zenith * Vec3::from(scale),
                    horizon: bands.horizon * Vec3::from(scale),
                    nadir: bands.nadir * Vec3::from(scale),
                }),
                Environment::Sky(sky) => Environment::Sky(Sky {
                    to_sun: Mat3::from_rotation_y(turn) * sky.to_sun,
                    scale: sky.scale * Vec3::from(scale),
                    ..*sky
                }),
                Environment::Map(map) => Environment::Map(EnvironmentMap {
                    scale: map.scale * Vec3::from(scale),
                    world_from_environment: Mat3::from_rotation_y(turn) * map.world_from_environment,
                    ..map.clone()
                }),
                Environment::Shader(shaded) => Environment::Shader(ShadedEnvironment {
                    scale: shaded.scale * Vec3::from(scale),
                    world_from_environment: Mat3::from_rotation_y(turn) * shaded.world_from_environment,
                    ..shaded.clone()
                }),
            },
        }
    }
}
