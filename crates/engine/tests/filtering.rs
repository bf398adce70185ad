//! Textures at grazing angles: neither noise nor blur.

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use heliostat_engine::{Engine, EngineOptions};
use heliostat_scene::{
    Backend, Camera, ColorSpace, Environment, Filter, FrameRequest, Image, Material, Mesh, Progress,
    SceneBuilder, Texture, TextureRef, UvTransform,
};

/// A floor of black and white lines, with a line of sight that grazes it.
fn floor() -> (Engine, Camera) {
    let mut scene = SceneBuilder::new();
    let lines = |x: u32| if (x / 16).is_multiple_of(2) { 0 } else { 255 };
    let pixels = (0..64 * 64).flat_map(|i| [lines(i % 64), lines(i % 64), lines(i % 64), 255]).collect();
    let image = Arc::new(Image::rgba8(64, 64, pixels));
    let texture = scene.texture(Texture::new("lines", image, ColorSpace::Linear));
    let transform = UvTransform(glam::Affine2::from_scale(glam::Vec2::splat(500.0)));
    let reference = TextureRef { transform, ..TextureRef::new(texture) };
    let white = Material { base_color_texture: Some(reference), ..Material::diffuse("floor", Vec3::ONE) };
    let white = scene.material(Material { unlit: true, ..white });
    let mesh = scene.mesh(Mesh::quad(Vec3::new(-50.0, 0.0, 50.0), Vec3::X * 100.0, Vec3::Z * -100.0));
    let object = scene.object("floor", [(mesh, white)]);
    scene.instance(object, Affine3A::IDENTITY);
    scene.environment(Environment::Constant(Vec3::splat(0.5)));
    let mut engine = Engine::new(EngineOptions::default()).expect("an engine");
    engine.apply(&scene.finish(), &Progress::new()).expect("a scene");
    let eye = Vec3::new(0.0, 0.6, 6.0);
    (engine, Camera::look_at("", eye, Vec3::new(0.0, 0.0, -4.0), Vec3::Y, 0.1))
}

#[test]
fn lines_that_run_away_from_the_eye_are_seen_as_samples_see_them() {
    let (mut engine, camera) = floor();
    let mut picture = |samples, filter| {
        let request = FrameRequest {
            renderer: "cast".into(),
            samples,
            filter,
            ..FrameRequest::new(camera.clone(), 128, 64)
        };
        engine.render(&request, &Progress::new()).expect("a picture").color
    };
    // One sample in the middle of each pixel: what filters is the texture.
    let filtered = picture(1, Filter::Gaussian(0.0));
    let exact = picture(256, Filter::Box);
    let error = filtered.iter().zip(&exact).map(|(a, b)| (a.x - b.x).powi(2)).sum::<f32>();
    let contrast = exact.iter().map(|c| (c.x - 0.5).powi(2)).sum::<f32>();
    let left = (error / contrast).sqrt();
    assert!(contrast / exact.len() as f32 > 0.01, "there is something to be seen: {contrast}");
    assert!(left < 0.25, "of the contrast {left} is lost");
}
