//! Light for scenes that bring none.

use heliostat_builtin as builtin;
use heliostat_scene::{Edit, Scene, SceneBuilder};

/// Edits that add a clear sky and a sun.
pub fn default_light(scene: &Scene) -> Vec<Edit> {
    let mut builder = SceneBuilder::continuing(scene);
    builtin::default_light(&mut builder);
    builder.finish()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;
    use heliostat_scene::{ColorSpace, Image, Material, Mesh, Texture, TextureRef};

    use super::*;

    #[test]
    fn lamps_are_light_and_glowing_labels_are_not() {
        let scene_of = |label: bool| {
            let mut builder = SceneBuilder::new();
            let image = Arc::new(Image::placeholder());
            let texture = builder.texture(Texture::new("label", image, ColorSpace::Srgb));
            let emissive_texture = label.then(|| TextureRef::new(texture));
            let material =
                builder.material(Material { emissive_texture, ..Material::emitter("glow", Vec3::ONE) });
            let quad = builder.mesh(Mesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y));
            builder.object("quad", [(quad, material)]);
            let mut scene = Scene::default();
            scene.apply(&builder.finish()).unwrap();
            scene
        };
        assert!(scene_of(false).has_light());
        let mut scene = scene_of(true);
        assert!(!scene.has_light());
        scene.apply(&default_light(&scene)).unwrap();
        assert!(scene.has_light());
        assert!(!Scene::default().has_light());
    }
}
