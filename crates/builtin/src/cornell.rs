//! The Cornell box with its measured dimensions.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::{Affine3A, Quat, Vec3};
use heliostat_scene::{Camera, Clip, Edit, InstanceId, Material, Mesh, Motion, Pose, SceneBuilder, Timeline};

/// Corners (x, z) of the blocks' bases, clockwise seen from above, millimetres.
const SHORT: [[f32; 2]; 4] = [[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]];
const TALL: [[f32; 2]; 4] = [[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]];

/// The measured box in metres. Reflectances are the usual RGB fits of the measured spectra; the lamp is as yellowish as
/// the measured one, and as bright as suits an exposure of 0.
///
/// # References
/// Goral, Torrance, Greenberg, Battaile, "Modeling the interaction of light between diffuse surfaces", 1984; Cornell
/// University Program of Computer Graphics, "The Cornell Box", data of 1998.
pub(crate) fn build() -> Vec<Edit> {
    make().0
}

/// The blocks turn once, against each other; at the start they stand as measured.
pub(crate) fn timeline() -> Timeline {
    let motion = Arc::new(Turn(make().1));
    Timeline::new(vec![Clip { name: "turn".into(), frame_rate: None, motion }])
}

/// The short block and the tall block turn about their middles.
#[derive(Debug)]
struct Turn([InstanceId; 2]);

impl Motion for Turn {
    fn duration(&self) -> f64 {
        4.0
    }

    fn sample(&self, time: f64, pose: &mut Pose) {
        for (id, (footprint, sign)) in self.0.into_iter().zip([(SHORT, 1.0), (TALL, -1.0)]) {
            let [x, z] = [0, 1].map(|axis| footprint.iter().map(|corner| corner[axis]).sum::<f32>() / 4.0);
            let middle = Affine3A::from_translation(millimetres([x, 0.0, z]));
            // Whole turns are exact: the blocks end as they began.
            let angle = (time / self.duration()).fract() * TAU * sign;
            let turned = Affine3A::from_quat(Quat::from_rotation_y(angle as f32));
            pose.instance(
                id,
                if angle == 0.0 { Affine3A::IDENTITY } else { middle * turned * middle.inverse() },
            );
        }
    }
}

/// The scene, and its short and tall block.
fn make() -> (Vec<Edit>, [InstanceId; 2]) {
    let mut builder = SceneBuilder::new();
    let white = builder.material(Material::diffuse("white", Vec3::new(0.725, 0.71, 0.68)));
    let red = builder.material(Material::diffuse("red", Vec3::new(0.63, 0.065, 0.05)));
    let green = builder.material(Material::diffuse("green", Vec3::new(0.14, 0.45, 0.091)));
    let lamp = builder.material(Material::emitter("lamp", Vec3::new(36.0, 28.0, 14.0)));

    let walls = [
        ("floor", [[552.8, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]], white),
        (
            "ceiling",
            [[556.0, 548.8, 0.0], [556.0, 548.8, 559.2], [0.0, 548.8, 559.2], [0.0, 548.8, 0.0]],
            white,
        ),
        (
            "back wall",
            [[549.6, 0.0, 559.2], [0.0, 0.0, 559.2], [0.0, 548.8, 559.2], [556.0, 548.8, 559.2]],
            white,
        ),
        ("right wall", [[0.0, 0.0, 559.2], [0.0, 0.0, 0.0], [0.0, 548.8, 0.0], [0.0, 548.8, 559.2]], green),
        (
            "left wall",
            [[552.8, 0.0, 0.0], [549.6, 0.0, 559.2], [556.0, 548.8, 559.2], [556.0, 548.8, 0.0]],
            red,
        ),
        // Half a millimetre below the ceiling, which has no hole here.
        (
            "lamp",
            [[343.0, 548.3, 227.0], [343.0, 548.3, 332.0], [213.0, 548.3, 332.0], [213.0, 548.3, 227.0]],
            lamp,
        ),
    ];
    for (name, corners, material) in walls {
        let mesh = builder.mesh(Mesh::new(corners.map(millimetres).into(), vec![[0, 1, 2], [0, 2, 3]]));
        let object = builder.object(name, [(mesh, material)]);
        builder.place(name, object, None, Affine3A::IDENTITY);
    }

    let blocks = [("short block", SHORT, 165.0), ("tall block", TALL, 330.0)];
    let blocks = blocks.map(|(name, footprint, height)| {
        let mesh = builder.mesh(block(footprint, height));
        let object = builder.object(name, [(mesh, white)]);
        builder.place(name, object, None, Affine3A::IDENTITY)
    });

    // A lens of 35 mm focal length before a square film of 25 mm.
    let fov = 2.0 * (0.0125f32 / 0.035).atan();
    let eye = millimetres([278.0, 273.0, -800.0]);
    builder.camera(Camera::look_at("front", eye, eye + Vec3::Z, Vec3::Y, fov));
    let corner = millimetres([470.0, 430.0, -120.0]);
    builder.camera(Camera::look_at("inside", corner, millimetres([230.0, 160.0, 330.0]), Vec3::Y, 0.95));
    (builder.finish(), blocks)
}

fn millimetres(p: [f32; 3]) -> Vec3 {
    Vec3::from(p) * 1e-3
}

/// A prism without its bottom over a footprint of (x, z) corners, clockwise seen from above.
fn block(footprint: [[f32; 2]; 4], height: f32) -> Mesh {
    let mut positions = Vec::new();
    let mut face = |corners: [Vec3; 4]| positions.extend(corners);
    let [bottom, top] = [0.0, height].map(|y| footprint.map(|[x, z]| millimetres([x, y, z])));
    face(top);
    for i in 0..4 {
        let next = (i + 1) % 4;
        face([bottom[next], top[next], top[i], bottom[i]]);
    }
    let indices =
        (0..5).flat_map(|f| [[4 * f, 4 * f + 1, 4 * f + 2], [4 * f, 4 * f + 2, 4 * f + 3]]).collect();
    Mesh::new(positions, indices)
}
