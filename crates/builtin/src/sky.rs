//! Skies without a sun, and the light that stands in when a file brings none.

use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};
use heliostat_scene::{Environment, EnvironmentMap, Image, Light, LightKind, SceneBuilder};

use crate::random::fbm;

/// A latitude-longitude map of `radiance(direction, (u, v))`.
fn map(width: u32, radiance: impl Fn(Vec3, Vec2) -> Vec3) -> Environment {
    let height = width / 2;
    let mut pixels = Vec::with_capacity((width * height * 4) as usize);
    for y in 0..height {
        for x in 0..width {
            let uv = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            let (sin_polar, cos_polar) = (uv.y * std::f32::consts::PI).sin_cos();
            let (sin, cos) = ((uv.x - 0.5) * std::f32::consts::TAU).sin_cos();
            let color = radiance(Vec3::new(sin_polar * sin, cos_polar, -sin_polar * cos), uv);
            pixels.extend([color.x, color.y, color.z, 1.0]);
        }
    }
    Environment::Map(EnvironmentMap {
        image: Arc::new(Image::rgba_f32(width, height, pixels)),
        scale: Vec3::ONE,
        world_from_environment: Mat3::IDENTITY,
    })
}

/// A clear sky: blue overhead, pale towards the horizon, with a few thin clouds; warm ground below.
pub(crate) fn clear(scale: f32) -> Environment {
    let zenith = Vec3::new(0.18, 0.36, 0.85);
    let horizon = Vec3::new(0.80, 0.92, 1.05);
    let ground = Vec3::new(0.30, 0.26, 0.21);
    map(256, |direction, uv| {
        let up = direction.y;
        let sky = horizon + (zenith - horizon) * up.max(0.0).powf(0.55);
        // The clouds' noise has four periods around, so that the map closes; they thin out towards the horizon.
        let cloud = fbm(uv * Vec2::new(8.0, 8.0), 8, 5, 11);
        let cover = ((cloud - 0.52) * 3.5).clamp(0.0, 1.0) * (up * 3.0).clamp(0.0, 1.0);
        let above = sky + (Vec3::new(1.25, 1.22, 1.18) - sky) * cover * 0.8;
        let t = ((up + 0.03) / 0.06).clamp(0.0, 1.0);
        (ground + (above - ground) * t) * scale
    })
}

/// A photographer's studio: dim grey all round, a large soft box overhead and a strip on either side.
pub(crate) fn studio() -> Environment {
    map(256, |d, _| {
        let panel = |center: Vec3, cosine: f32, radiance: f32| {
            let c = d.dot(center.normalize());
            Vec3::splat(radiance * ((c - cosine) * 24.0).clamp(0.0, 1.0))
        };
        Vec3::new(0.20, 0.22, 0.25) * (0.8 + 0.4 * d.y)
            + panel(Vec3::new(-0.4, 1.0, 0.5), 0.90, 3.2) * Vec3::new(1.0, 0.97, 0.92)
            + panel(Vec3::new(1.0, 0.45, 0.6), 0.955, 3.0) * Vec3::new(0.85, 0.93, 1.0)
            + panel(Vec3::new(-1.0, 0.3, -0.35), 0.965, 2.5) * Vec3::new(1.0, 0.85, 0.7)
    })
}

/// The environment and sun that light a scene whose file has no light of its own: a clear sky with the sun high
/// behind the left shoulder of a viewer who looks along −Z.
pub fn default_light(builder: &mut SceneBuilder) {
    builder.environment(clear(0.8));
    builder.light(sun(Vec3::new(0.45, -1.0, -0.55), 3.0));
}

/// Warm sunlight travelling along `direction`.
pub(crate) fn sun(direction: Vec3, irradiance: f32) -> Light {
    let irradiance = Vec3::new(1.0, 0.90, 0.75) * irradiance;
    Light { name: "sun".into(), kind: LightKind::Directional { direction, irradiance } }
}
