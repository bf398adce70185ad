//! Skies: six far images or layers of clouds, as a picture around the scene.

use std::f32::consts::{PI, TAU};
use std::sync::{Arc, LazyLock};

use glam::{Mat3, Vec2, Vec3};
use heliostat_scene::{Environment, EnvironmentMap, Image, Pixels};

use super::images::Images;
use super::script::{Blend, Map, Shader, Sky, Stage};
use crate::context::Context;
use crate::error::LoadError;
use crate::image::pixels::srgb_to_linear;
use crate::place::Place;

/// Pixels of the picture.
const SIZE: [u32; 2] = [512, 256];
/// Radius of the world under the clouds, units.
const WORLD_RADIUS: f32 = 4096.0;
/// Sides of the far box, in the order of [`side`].
const SIDES: [&str; 6] = ["rt", "lf", "bk", "ft", "up", "dn"];

/// Linear light of the values of 8-bit images.
static LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|value| srgb_to_linear(value as f32 / 255.0)));

/// A layer of clouds, read.
struct Layer<'a> {
    stage: &'a Stage,
    image: Arc<Image>,
}

/// The environment that a sky shader stands for: its picture, as bright as on the screen; none without any image.
///
/// # Errors
/// When images exceed the limits.
pub(super) fn environment(
    context: &mut Context<'_>,
    images: &mut Images,
    place: &Place,
    shader: &Shader,
) -> Result<Environment, LoadError> {
    let sky = shader.sky.clone().unwrap_or_default();
    let mut far = Vec::new();
    if let Some(name) = &sky.far_box {
        for side in SIDES {
            far.push(images.read(context, place, &format!("{name}_{side}"))?);
        }
    }
    let mut layers = Vec::new();
    for stage in &shader.stages {
        if let Map::Image { name, .. } = &stage.map
            && let Some(image) = images.read(context, place, name)?
        {
            layers.push(Layer { stage, image });
        }
    }
    if layers.is_empty() && far.iter().all(Option::is_none) {
        return Ok(Environment::None);
    }
    let [width, height] = SIZE;
    context.charge(16 * u64::from(width) * u64::from(height), place)?;
    let mut values = Vec::with_capacity(4 * width as usize * height as usize);
    for y in 0..height {
        for x in 0..width {
            let at = (Vec2::new(x as f32, y as f32) + 0.5) / Vec2::new(width as f32, height as f32);
            let color = radiance(to_game(at), &far, &layers, &sky);
            values.extend([color.x, color.y, color.z, 1.0]);
        }
    }
    let image = Image::rgba_f32(width, height, values);
    Ok(Environment::Map(EnvironmentMap {
        image: Arc::new(image),
        scale: Vec3::ONE,
        world_from_environment: Mat3::IDENTITY,
    }))
}

/// The direction in the game's axes of a point of the picture.
fn to_game(at: Vec2) -> Vec3 {
    let (longitude, polar) = (TAU * (at.x - 0.5), PI * at.y);
    Vec3::new(polar.sin() * longitude.sin(), polar.sin() * longitude.cos(), polar.cos())
}

fn radiance(direction: Vec3, far: &[Option<Arc<Image>>], layers: &[Layer<'_>], sky: &Sky) -> Vec3 {
    let (index, at) = side(direction);
    let far = far.get(index).and_then(Option::as_deref);
    let mut color = far.map_or(Vec3::ZERO, |image| sample(image, at, true).0);
    let at = clouds(direction, sky.cloud_height);
    for Layer { stage, image } in layers {
        let (layer, alpha) = sample(image, stage.transform.transform_point2(at), false);
        color = match stage.blend {
            // Over a far box, the first layer of clouds covers it where it is opaque.
            None => layer,
            Some(Blend::Add) => color + layer,
            Some(Blend::Over) => color.lerp(layer, alpha),
            Some(Blend::Filter) => color * layer,
            Some(Blend::Other) => color,
        };
    }
    color
}

/// Which side of the far box a direction meets, and where on its image.
fn side(d: Vec3) -> (usize, Vec2) {
    let a = d.abs();
    let (index, s, t, depth) = if a.z >= a.x && a.z >= a.y {
        if d.z > 0.0 { (4, -d.y, -d.x, a.z) } else { (5, -d.y, d.x, a.z) }
    } else if a.x >= a.y {
        if d.x > 0.0 { (0, -d.y, d.z, a.x) } else { (1, d.y, d.z, a.x) }
    } else if d.y > 0.0 {
        (2, d.x, d.z, a.y)
    } else {
        (3, -d.x, d.z, a.y)
    };
    let at = Vec2::new(s, -t) / depth.max(f32::MIN_POSITIVE);
    (index, 0.5 + 0.5 * at)
}

/// Texture coordinates of clouds at `height` over a round world: the angles of the point above which they stand against
/// the axes, as the game has them. Below the horizon the sky is mirrored.
fn clouds(direction: Vec3, height: f32) -> Vec2 {
    let up = direction.z.abs();
    // Where the ray from the top of the world meets the sphere of clouds.
    let b = up * WORLD_RADIUS;
    let distance = (b * b + 2.0 * WORLD_RADIUS * height + height * height).sqrt() - b;
    let point = Vec3::new(direction.x, direction.y, up) * distance + Vec3::Z * WORLD_RADIUS;
    let point = point.normalize_or(Vec3::Z);
    Vec2::new(point.x.clamp(-1.0, 1.0).acos(), point.y.clamp(-1.0, 1.0).acos())
}

/// Linear colour and alpha between texels.
fn sample(image: &Image, at: Vec2, clamp: bool) -> (Vec3, f32) {
    let size = [image.width, image.height];
    let at = if clamp { at.clamp(Vec2::ZERO, Vec2::ONE) } else { at - at.floor() };
    let at = if at.is_finite() { at } else { Vec2::ZERO };
    let at = at * Vec2::new(size[0] as f32, size[1] as f32) - 0.5;
    let (low, f) = (at.floor(), at - at.floor());
    let wrap = |value: f32, size: u32| match clamp {
        true => (value.max(0.0) as u32).min(size - 1),
        false => (value as i64).rem_euclid(i64::from(size)) as u32,
    };
    let mut sum = ([0.0; 4], 0.0);
    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let weight = (if dx > 0.0 { f.x } else { 1.0 - f.x }) * (if dy > 0.0 { f.y } else { 1.0 - f.y });
        let (x, y) = (wrap(low.x + dx, size[0]), wrap(low.y + dy, size[1]));
        let first = 4 * (y as usize * size[0] as usize + x as usize);
        let pixel: [f32; 4] = match &image.pixels {
            Pixels::Rgba8(p) => [0, 1, 2, 3].map(|lane| {
                let value = p[first + lane];
                if lane < 3 { LINEAR[usize::from(value)] } else { f32::from(value) / 255.0 }
            }),
            Pixels::RgbaF32(p) => [0, 1, 2, 3].map(|lane| p[first + lane]),
        };
        for (lane, value) in sum.0.iter_mut().zip(pixel) {
            *lane += weight * value;
        }
        sum.1 += weight;
    }
    let [r, g, b, a] = sum.0;
    (Vec3::new(r, g, b), a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_of_the_far_box_meet_at_their_edges() {
        // Where two sides meet, both images are looked up on their rim, at the same height.
        for (d, expected) in [
            (Vec3::new(1.0, 0.0, 0.0), (0, Vec2::new(0.5, 0.5))),
            (Vec3::new(0.0, 1.0, 0.5), (2, Vec2::new(0.5, 0.25))),
            (Vec3::new(1.0, -0.999, 0.0), (0, Vec2::new(0.9995, 0.5))),
            (Vec3::new(0.999, -1.0, 0.0), (3, Vec2::new(0.0005, 0.5))),
            (Vec3::new(0.0, 0.0, 1.0), (4, Vec2::new(0.5, 0.5))),
        ] {
            let (index, at) = side(d);
            assert_eq!(index, expected.0, "{d}");
            assert!(at.abs_diff_eq(expected.1, 1e-5), "{d}: {at}");
        }
    }

    #[test]
    fn clouds_stand_overhead_at_the_middle_and_spread_to_the_horizon() {
        let right = PI / 2.0;
        assert!(clouds(Vec3::Z, 512.0).abs_diff_eq(Vec2::splat(right), 1e-5));
        let horizon = clouds(Vec3::X, 512.0);
        // A level ray from the top of the world leaves it: cos of the angle = R / (R + h).
        let angle = (WORLD_RADIUS / (WORLD_RADIUS + 512.0)).acos();
        assert!(horizon.abs_diff_eq(Vec2::new(right - angle, right), 1e-4), "{horizon}");
    }

    #[test]
    fn the_picture_is_the_right_way_round() {
        // The middle column is −Z, which is +Y of the game; further right turns towards +X.
        assert!(to_game(Vec2::splat(0.5)).abs_diff_eq(Vec3::Y, 1e-6));
        assert!(to_game(Vec2::new(0.75, 0.5)).abs_diff_eq(Vec3::X, 1e-6));
        assert!(to_game(Vec2::new(0.3, 0.0)).abs_diff_eq(Vec3::Z, 1e-6));
    }
}
