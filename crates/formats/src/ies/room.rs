//! A room that shows what a luminaire does: pools on the floor, scallops on the walls.

use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;

use glam::{Affine3A, Mat3, Vec3};
use heliostat_scene::{Camera, Edit, Light, LightKind, Material, Mesh, Photometry, SceneBuilder};

use super::Luminaire;

/// A lamp that aims down hangs before a wall; one that aims ahead stands before a road with a wall at its end.
pub(super) fn edits(luminaire: &Luminaire) -> Vec<Edit> {
    let mut builder = SceneBuilder::new();
    let ahead = luminaire.profile.photometry != Photometry::C;
    let (half_width, height, depth) = if ahead { (10.0, 6.0, 25.0) } else { (2.5, 3.2, 4.0) };
    let grey = builder.material(Material::diffuse("grey", Vec3::splat(0.5)));
    let corner = Vec3::new(-half_width, 0.0, -depth);
    let (across, up, along) = (Vec3::X * 2.0 * half_width, Vec3::Y * height, Vec3::Z * depth);
    let floor = builder.mesh(Mesh::quad(corner + along, across, -along));
    let wall = builder.mesh(Mesh::quad(corner, across, up));
    let object = builder.object("room", [(floor, grey), (wall, grey)]);
    builder.instance(object, Affine3A::IDENTITY);
    // Down is a quarter turn from ahead; of A and B light space has +X up.
    let (position, world_from_light) = if ahead {
        (Vec3::new(0.0, 0.65, -1.0), Mat3::from_rotation_z(FRAC_PI_2))
    } else {
        (Vec3::new(0.0, 2.6, -depth + 0.8), Mat3::from_rotation_x(-FRAC_PI_2))
    };
    let kind = LightKind::Profile {
        position,
        world_from_light,
        scale: Vec3::ONE,
        profile: Arc::new(luminaire.profile.clone()),
        range: f32::INFINITY,
    };
    builder.light(Light { name: luminaire.name.clone(), kind });
    let (eye, target) = if ahead {
        (Vec3::new(0.0, 3.0, 5.0), Vec3::new(0.0, 0.5, -14.0))
    } else {
        (Vec3::new(0.0, 1.6, 2.6), Vec3::new(0.0, 1.25, -depth))
    };
    builder.camera(Camera::look_at("room", eye, target, Vec3::Y, 0.9));
    builder.finish()
}
