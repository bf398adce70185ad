//! An office building of seven storeys around a hall, by night with every lamp on: more than 20,000 lights, nearly all of
//! them behind closed doors. The class of the report's Soda Hall, to our own plan.

mod hall;
mod storey;

use glam::{Affine3A, Vec3};
use heliostat_scene::{Camera, Edit, SceneBuilder};

use crate::interior::Palette;

/// Storeys, their pitch, and the clear height of rooms, metres.
const STOREYS: usize = 7;
const PITCH: f32 = 3.6;
const CLEAR: f32 = 3.0;
/// Half the length of the building along X, metres.
const HALF_LENGTH: f32 = 54.0;
/// Half the hall's extent along X and Z; its X sides open on the cross corridors.
const HALL: [f32; 2] = [12.5, 7.75];
const CORRIDOR: f32 = 2.5;
/// Depth of the rooms, metres.
const DEPTH: f32 = 6.5;

pub(crate) fn build() -> Vec<Edit> {
    let mut builder = SceneBuilder::new();
    let palette = Palette::new(&mut builder, Vec3::new(17.0, 16.2, 14.6));
    let kit = storey::Kit::new(&mut builder, &palette);
    for level in 0..STOREYS {
        storey::build(&mut builder, &palette, &kit, level);
    }
    hall::build(&mut builder, &palette);
    let up = |level: usize| Vec3::Y * (level as f32 * PITCH);
    let office = kit.row_of_the_office().rooms().nth(4).map_or(Affine3A::IDENTITY, |room| room.0);
    let inside = |p: Vec3| office.transform_point3(p) + up(OFFICE_LEVEL);
    let views = [
        ("hall", Vec3::new(11.8, 1.7, 3.4), Vec3::new(-8.0, 6.4, -1.8), 1.15),
        ("gallery", Vec3::new(13.4, 1.65, 2.8) + up(4), Vec3::new(-9.0, -3.0, -2.6) + up(4), 1.05),
        ("office", inside(Vec3::new(1.6, 1.62, 0.7)), inside(Vec3::new(-0.5, 0.95, 4.2)), 1.05),
        ("corridor", Vec3::new(40.0, 1.65, 15.5) + up(2), Vec3::new(10.0, 1.3, 15.5) + up(2), 0.95),
        ("bridge", Vec3::new(-11.8, 1.65, 0.0) + up(1), Vec3::new(8.0, 2.0, 0.4) + up(1), 1.05),
    ];
    for (name, eye, target, fov) in views {
        builder.camera(Camera::look_at(name, eye, target, Vec3::Y, fov));
    }
    builder.finish()
}

/// The storey of the camera `office`.
const OFFICE_LEVEL: usize = 3;
