//! All that a measured light, a projector or a shaded light is, for files: its table, picture or shader with how it is turned, so
//! that a replay can bring a light that the scene did not come with.

use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use glam::{Mat3, Vec3};
use heliostat_scene::{Image, LightKind, Photometry, Pixels, Profile};
use serde::{Deserialize, Serialize};

use crate::style::Effect;

/// Most pixels of a projector's picture in a file: those of 4096×2160.
const MAX_PIXELS: u64 = 4096 * 2160;

/// What a light of a measured distribution is beside its place and strength.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Luminaire {
    /// Three columns of the rotation. In light space the light aims along −Z.
    world_from_light: [f32; 9],
    /// Metres; absent for infinity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    range: Option<f32>,
    /// Its table.
    profile: Table,
}

/// What a projector is beside its place and strength.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beam {
    /// Three columns of the rotation. In light space the picture goes along −Z, its top towards +Y.
    world_from_light: [f32; 9],
    /// Full angle over the picture's height, radians.
    vertical_fov: f32,
    /// Metres; absent for infinity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    range: Option<f32>,
    /// What it throws.
    image: Slide,
}

/// What a light by a shader is beside its place and strength.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShadedLamp {
    /// Three columns of the rotation. In light space the light aims along −Z.
    world_from_light: [f32; 9],
    /// Metres; absent for infinity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    range: Option<f32>,
    /// Its shader.
    shader: Effect,
}

impl Luminaire {
    /// That of a light; `None` if it is of another kind.
    pub fn of(kind: &LightKind) -> Option<Self> {
        let LightKind::Profile { world_from_light, profile, range, .. } = kind else { return None };
        let (world_from_light, profile) = (world_from_light.to_cols_array(), Table(profile.clone()));
        Some(Self { world_from_light, range: range.is_finite().then_some(*range), profile })
    }

    /// The light of this make at a place.
    pub(crate) fn light(&self, position: Vec3, scale: Vec3) -> LightKind {
        LightKind::Profile {
            position,
            world_from_light: Mat3::from_cols_array(&self.world_from_light),
            scale,
            profile: self.profile.0.clone(),
            range: self.range.unwrap_or(f32::INFINITY),
        }
    }
}

impl Beam {
    /// That of a light; `None` if it is of another kind.
    pub fn of(kind: &LightKind) -> Option<Self> {
        let LightKind::Projector { world_from_light, vertical_fov, image, range, .. } = kind else {
            return None;
        };
        let (world_from_light, image) = (world_from_light.to_cols_array(), Slide(image.clone()));
        let range = range.is_finite().then_some(*range);
        Some(Self { world_from_light, vertical_fov: *vertical_fov, range, image })
    }

    /// The projector of this make at a place.
    pub(crate) fn light(&self, position: Vec3, intensity: Vec3) -> LightKind {
        LightKind::Projector {
            position,
            world_from_light: Mat3::from_cols_array(&self.world_from_light),
            intensity,
            vertical_fov: self.vertical_fov,
            image: self.image.0.clone(),
            range: self.range.unwrap_or(f32::INFINITY),
        }
    }
}

impl ShadedLamp {
    /// That of a light; `None` if it is of another kind, or its shader is one that no light can have.
    pub fn of(kind: &LightKind) -> Option<Self> {
        let LightKind::Shader { world_from_light, shader, range, .. } = kind else { return None };
        let (world_from_light, shader) = (world_from_light.to_cols_array(), Effect::of(shader)?);
        Some(Self { world_from_light, range: range.is_finite().then_some(*range), shader })
    }

    /// The light of this make at a place.
    pub(crate) fn light(&self, position: Vec3, scale: Vec3) -> LightKind {
        LightKind::Shader {
            position,
            world_from_light: Mat3::from_cols_array(&self.world_from_light),
            scale,
            shader: Arc::new(self.shader.shader()),
            range: self.range.unwrap_or(f32::INFINITY),
        }
    }
}

/// A profile that is shared in memory and whole in a file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(into = "TableForm", try_from = "TableForm")]
struct Table(Arc<Profile>);

impl PartialEq for Table {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || self.0 == other.0
    }
}

/// Fields as in [`Profile`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TableForm {
    /// `A`, `B` or `C`.
    photometry: System,
    polar: Vec<f32>,
    azimuth: Vec<f32>,
    intensity: Vec<f32>,
}

#[derive(Serialize, Deserialize)]
enum System {
    A,
    B,
    C,
}

impl From<Table> for TableForm {
    fn from(Table(profile): Table) -> Self {
        let photometry = match profile.photometry {
            Photometry::A => System::A,
            Photometry::B => System::B,
            Photometry::C => System::C,
        };
        let Profile { polar, azimuth, intensity, .. } = (*profile).clone();
        Self { photometry, polar, azimuth, intensity }
    }
}

impl TryFrom<TableForm> for Table {
    type Error = String;

    fn try_from(form: TableForm) -> Result<Self, String> {
        let TableForm { photometry, polar, azimuth, intensity } = form;
        let photometry = match photometry {
            System::A => Photometry::A,
            System::B => Photometry::B,
            System::C => Photometry::C,
        };
        let profile = Profile { photometry, polar, azimuth, intensity };
        profile.problem().map_or_else(|| Ok(Self(Arc::new(profile))), Err)
    }
}

/// A picture that is shared in memory and whole in a file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(into = "SlideForm", try_from = "SlideForm")]
struct Slide(Arc<Image>);

impl PartialEq for Slide {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || self.0 == other.0
    }
}

/// Rows from the top left corner, four channels per pixel, in base64: bytes, or floats with the lowest byte first.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SlideForm {
    width: u32,
    height: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rgba8: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rgba_f32: Option<String>,
}

impl From<Slide> for SlideForm {
    fn from(Slide(image): Slide) -> Self {
        let (width, height) = (image.width, image.height);
        let (rgba8, rgba_f32) = match &image.pixels {
            Pixels::Rgba8(bytes) => (Some(STANDARD.encode(bytes)), None),
            Pixels::RgbaF32(values) => {
                let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
                (None, Some(STANDARD.encode(bytes)))
            }
        };
        Self { width, height, rgba8, rgba_f32 }
    }
}

impl TryFrom<SlideForm> for Slide {
    type Error = String;

    fn try_from(form: SlideForm) -> Result<Self, String> {
        let SlideForm { width, height, rgba8, rgba_f32 } = form;
        let pixels = u64::from(width) * u64::from(height);
        if pixels == 0 || pixels > MAX_PIXELS {
            return Err(format!("a picture of {width}×{height} pixels; give 1 to {MAX_PIXELS}"));
        }
        let (text, size) = match (&rgba8, &rgba_f32) {
            (Some(text), None) => (text, 4),
            (None, Some(text)) => (text, 16),
            _ => return Err("a picture has either `rgba8` or `rgba_f32`".into()),
        };
        let bytes = STANDARD.decode(text).map_err(|error| format!("a picture's base64: {error}"))?;
        if bytes.len() as u64 != pixels * size {
            let (found, needed) = (bytes.len(), pixels * size);
            return Err(format!(
                "a picture of {width}×{height} pixels has {found} bytes instead of {needed}"
            ));
        }
        let image = match rgba8 {
            Some(_) => Image::rgba8(width, height, bytes),
            None => {
                let values = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
                Image::rgba_f32(width, height, values.collect())
            }
        };
        Ok(Self(Arc::new(image)))
    }
}

#[cfg(test)]
mod tests {
    use heliostat_scene::ShaderUse;

    use super::*;

    #[test]
    fn lights_come_back_as_they_were() {
        let profile = Profile {
            photometry: Photometry::B,
            polar: vec![0.5, 1.0, 2.0],
            azimuth: vec![-0.5, 0.5],
            intensity: vec![1.0, 2.5, 3.0, 4.0, 5.0, 6.0],
        };
        let kind = LightKind::Profile {
            position: Vec3::ONE,
            world_from_light: Mat3::from_rotation_x(0.3),
            scale: Vec3::splat(2.0),
            profile: Arc::new(profile),
            range: f32::INFINITY,
        };
        let text = serde_json::to_string(&Luminaire::of(&kind)).expect("JSON");
        let read: Luminaire = serde_json::from_str(&text).expect("it is whole");
        assert_eq!(read.light(Vec3::ONE, Vec3::splat(2.0)), kind);
        for image in [Image::rgba8(2, 1, (0..8).collect()), Image::rgba_f32(1, 1, vec![0.1, 7.0, 0.3, 1.0])] {
            let kind = LightKind::Projector {
                position: Vec3::X,
                world_from_light: Mat3::from_rotation_y(0.7),
                intensity: Vec3::splat(3.0),
                vertical_fov: 0.6,
                image: Arc::new(image),
                range: 7.0,
            };
            let text = serde_json::to_string(&Beam::of(&kind)).expect("JSON");
            let read: Beam = serde_json::from_str(&text).expect("it is whole");
            assert_eq!(read.light(Vec3::X, Vec3::splat(3.0)), kind);
            assert_eq!(Luminaire::of(&kind), None);
        }
        let shader = ShaderUse::named("blinds").with("slats", 7.0).with("color", Vec3::X);
        let kind = LightKind::Shader {
            position: Vec3::Z,
            world_from_light: Mat3::from_rotation_y(0.7),
            scale: Vec3::ONE,
            shader: Arc::new(shader),
            range: 3.0,
        };
        let text = serde_json::to_string(&ShadedLamp::of(&kind)).expect("JSON");
        let read: ShadedLamp = serde_json::from_str(&text).expect("it is whole");
        assert_eq!(read.light(Vec3::Z, Vec3::ONE), kind);
    }

    #[test]
    fn broken_tables_and_pictures_are_refused() {
        let table = |text: &str| serde_json::from_str::<Table>(text).map_err(|error| error.to_string());
        assert!(table(r#"{"photometry":"C","polar":[0,1],"azimuth":[0],"intensity":[1,2]}"#).is_ok());
        let short = table(r#"{"photometry":"C","polar":[0,1],"azimuth":[0],"intensity":[1]}"#).unwrap_err();
        assert!(short.contains("intensities"), "{short}");
        assert!(table(r#"{"photometry":"D","polar":[0,1],"azimuth":[0],"intensity":[1,2]}"#).is_err());
        let slide = |text: &str| serde_json::from_str::<Slide>(text).map_err(|error| error.to_string());
        assert!(slide(r#"{"width":1,"height":1,"rgba8":"AQID/w=="}"#).is_ok());
        for (broken, why) in [
            (r#"{"width":2,"height":1,"rgba8":"AQID/w=="}"#, "4 bytes instead of 8"),
            (r#"{"width":1,"height":1}"#, "either"),
            (r#"{"width":1,"height":1,"rgba8":"AQID/w==","rgba_f32":""}"#, "either"),
            (r#"{"width":1,"height":1,"rgba8":"?"}"#, "base64"),
            (r#"{"width":100000,"height":100000,"rgba8":""}"#, "give 1 to"),
        ] {
            let problem = slide(broken).unwrap_err();
            assert!(problem.contains(why), "{problem}");
        }
    }
}
