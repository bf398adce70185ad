//! Lights and points of view from entities.

use std::collections::HashMap;

use glam::Vec3;
use heliostat_scene::{Camera, Light, LightKind};

use super::entities::Entity;
use super::script::Sun;
use super::units;

/// What a `light` shines with that does not say.
const DEFAULT_LIGHT: f32 = 300.0;
/// Radius of a spot's cone at its target, units, where the entity does not say.
const DEFAULT_RADIUS: f32 = 64.0;
/// Half of the width over which the rim of the cone fades, units at the target.
const RIM: f32 = 16.0;
/// The eye above the origin of a player, who stands 24 units below it.
const EYE_HEIGHT: f32 = 26.0;
/// 90° over the width of a 4:3 picture, as in the game: 2 atan(3/4) over its height.
const VERTICAL_FOV: f32 = 1.287_002_2;
/// Bit of `spawnflags`: the light falls off linearly.
const LINEAR: f32 = 1.0;

/// The lights of a map with what there is to tell of them.
#[derive(Default)]
pub(super) struct Lights {
    pub(super) lights: Vec<Light>,
    /// Entities that take light away, or have none.
    pub(super) dark: usize,
    /// Entities whose light falls off linearly.
    pub(super) linear: usize,
}

/// Whose name another entity's `target` can be.
pub(super) fn targets(entities: &[Entity]) -> HashMap<&str, &Entity> {
    entities.iter().rev().filter_map(|entity| Some((entity.get("targetname")?, entity))).collect()
}

/// A colour with a maximum of 1; white if there is none.
fn color(entity: &Entity) -> Vec3 {
    let color = entity.vector("_color").or(entity.vector("color")).unwrap_or(Vec3::ONE).max(Vec3::ZERO);
    if color.max_element() > 0.0 { (color / color.max_element()).min(Vec3::ONE) } else { Vec3::ONE }
}

/// The worldspawn's ambient light: radiance of white.
pub(super) fn ambient(world: Option<&Entity>) -> Vec3 {
    let value = |world: &Entity| {
        let value = world.number("ambient").or(world.number("_ambient"))?.max(0.0);
        Some(units::ambient(value) * color(world)).filter(|radiance| radiance.is_finite())
    };
    world.and_then(value).unwrap_or(Vec3::ZERO)
}

/// All `light` entities.
pub(super) fn lights(entities: &[Entity]) -> Lights {
    let targets = targets(entities);
    let mut found = Lights::default();
    for (index, entity) in entities.iter().filter(|e| e.class() == "light").enumerate() {
        let strength = entity.number("light").or(entity.number("_light")).unwrap_or(DEFAULT_LIGHT);
        let strength = units::point_light(strength * entity.number("scale").unwrap_or(1.0));
        let origin = entity.vector("origin").unwrap_or(Vec3::ZERO);
        let intensity = strength.max(0.0) * color(entity);
        if strength <= 0.0 || !intensity.is_finite() || !units::metres(origin).is_finite() {
            found.dark += 1;
            continue;
        }
        let flags = entity.number("spawnflags").unwrap_or(0.0);
        found.linear += usize::from(flags % 2.0 == LINEAR);
        let name = entity.get("targetname").map_or_else(|| format!("light {index}"), str::to_owned);
        let target = entity.get("target").and_then(|name| targets.get(name)?.vector("origin"));
        let kind = target.and_then(|target| spot(entity, origin, target, intensity));
        let point = LightKind::Point { position: units::metres(origin), intensity, range: f32::INFINITY };
        found.lights.push(Light { name, kind: kind.unwrap_or(point) });
    }
    found
}

/// A cone towards a target; `None` if that is where the light is.
fn spot(entity: &Entity, origin: Vec3, target: Vec3, intensity: Vec3) -> Option<LightKind> {
    let axis = target - origin;
    let distance = Some(axis.length()).filter(|length| length.is_normal())?;
    let radius = entity.number("radius").filter(|radius| *radius > 0.0).unwrap_or(DEFAULT_RADIUS);
    let outer_angle = ((radius + RIM) / distance).atan();
    Some(LightKind::Spot {
        position: units::metres(origin),
        direction: units::direction(axis / distance),
        intensity,
        inner_angle: ((radius - RIM) / distance).atan().clamp(0.0, outer_angle),
        outer_angle,
        range: f32::INFINITY,
    })
}

/// The sun of a sky; `None` without light.
pub(super) fn sun(sun: &Sun) -> Option<Light> {
    let (azimuth, elevation) = (sun.azimuth.to_radians(), sun.elevation.to_radians());
    let towards =
        Vec3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin());
    let irradiance = units::sun(sun.intensity) * sun.color;
    let direction = units::direction(-towards);
    let usable = irradiance.is_finite() && irradiance.max_element() > 0.0 && direction.is_finite();
    usable.then(|| Light { name: "sun".into(), kind: LightKind::Directional { direction, irradiance } })
}

/// Points of view: first the one for the break between games, which shows most, then those where players appear.
pub(super) fn cameras(entities: &[Entity]) -> Vec<Camera> {
    const CLASSES: [&str; 5] = [
        "info_player_intermission",
        "info_player_start",
        "info_player_deathmatch",
        "team_ctf_redspawn",
        "team_ctf_bluespawn",
    ];
    let targets = targets(entities);
    let mut cameras = Vec::new();
    for class in CLASSES {
        for (index, entity) in entities.iter().filter(|entity| entity.class() == class).enumerate() {
            let origin = entity.vector("origin").unwrap_or(Vec3::ZERO);
            let eye = units::metres(origin + Vec3::Z * EYE_HEIGHT);
            let target = entity.get("target").and_then(|name| targets.get(name)?.vector("origin"));
            let target = target.map_or_else(|| eye + units::direction(gaze(entity)), units::metres);
            if eye.is_finite() && target.is_finite() {
                let name = format!("{class} {index}");
                cameras.push(Camera::look_at(name, eye, target, Vec3::Y, VERTICAL_FOV));
            }
        }
    }
    cameras.retain(|camera| camera.problem().is_none());
    cameras
}

/// Where a player looks: `angles` (pitch downwards, yaw from +X towards +Y, degrees) or `angle` (yaw).
fn gaze(entity: &Entity) -> Vec3 {
    let yaw = entity.number("angle").unwrap_or(0.0);
    let angles = entity.vector("angles").unwrap_or(Vec3::new(0.0, yaw, 0.0));
    let (pitch, yaw) = (angles.x.to_radians(), angles.y.to_radians());
    Vec3::new(pitch.cos() * yaw.cos(), pitch.cos() * yaw.sin(), -pitch.sin())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::context::Context;
    use crate::limits::Limits;
    use crate::source::NoFiles;

    fn entities(text: &str) -> Vec<Entity> {
        let limits = Limits::default();
        let mut context = Context::new(&limits, &NoFiles);
        super::super::entities::parse(&mut context, &"a.bsp".into(), text.as_bytes()).unwrap()
    }

    #[test]
    fn a_light_gives_what_the_compiler_computes() {
        let found = lights(&entities(
            "{ classname light origin \"32 64 96\" light 100 _color \"2 1 0\" } { classname light light -5 }",
        ));
        assert_eq!((found.lights.len(), found.dark), (1, 1));
        let LightKind::Point { position, intensity, .. } = found.lights[0].kind else { panic!() };
        assert_eq!(position, Vec3::new(1.0, 3.0, -2.0));
        // At 64 units, 2 m, the compiler computes 7500 · 100 / 64² of 255; white reflects E/π.
        let radiance = intensity / 4.0 / std::f32::consts::PI;
        let expected = 7500.0 * 100.0 / 4096.0 / 255.0 * Vec3::new(1.0, 0.5, 0.0);
        assert!(radiance.abs_diff_eq(expected, 1e-6), "{radiance} {expected}");
    }

    #[test]
    fn a_target_makes_a_spot() {
        let found = lights(&entities(
            "{ classname light origin \"0 0 100\" target t radius 84 } { classname info_null targetname t origin \"0 0 0\" }",
        ));
        let LightKind::Spot { direction, inner_angle, outer_angle, .. } = found.lights[0].kind else {
            panic!()
        };
        assert_eq!(direction, Vec3::NEG_Y);
        assert!((outer_angle.tan() - 1.0).abs() < 1e-6 && (inner_angle.tan() - 0.68).abs() < 1e-6);
    }

    #[test]
    fn a_sun_stands_where_its_angles_say() {
        let north = Sun { color: Vec3::ONE, intensity: 255.0, azimuth: 90.0, elevation: 0.0 };
        let LightKind::Directional { direction, irradiance } = sun(&north).unwrap().kind else { panic!() };
        // +Y of the game is −Z here; the light goes the other way.
        assert!(direction.abs_diff_eq(Vec3::Z, 1e-6), "{direction}");
        assert!((irradiance.x - std::f32::consts::PI).abs() < 1e-6);
        assert!(sun(&Sun { intensity: 0.0, ..north }).is_none());
    }

    #[test]
    fn players_see_from_their_eyes() {
        let cameras = cameras(&entities(
            "{ classname info_player_deathmatch origin \"32 0 -26\" angle 90 } \
             { classname info_player_intermission origin \"0 0 0\" target t } { targetname t origin \"0 0 320\" }",
        ));
        let names: Vec<_> = cameras.iter().map(|camera| camera.name.as_str()).collect();
        assert_eq!(names, ["info_player_intermission 0", "info_player_deathmatch 0"]);
        let view = cameras[1].world_from_camera;
        assert!(view.translation.abs_diff_eq(glam::Vec3A::new(1.0, 0.0, 0.0), 1e-6));
        assert!(view.transform_vector3(Vec3::NEG_Z).abs_diff_eq(Vec3::NEG_Z, 1e-6));
        assert!(cameras[0].world_from_camera.transform_vector3(Vec3::NEG_Z).abs_diff_eq(Vec3::Y, 1e-3));
    }
}
