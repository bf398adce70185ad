//! Chooses the point of view: as named, as placed by hand, the scene's own, or one that shows all of it.

use glam::Vec3;
use heliostat::scene::{Camera, Projection, Scene, SceneBounds};

use super::failure::Failure;
use super::values;

/// Vertical field of view of cameras that the scene does not bring, radians.
const DEFAULT_FOV: f32 = 0.7;

#[derive(Debug, clap::Args)]
#[group(skip)]
pub(super) struct Arguments {
    /// One of the scene's cameras, by name or by number from 0
    #[arg(long, value_name = "NAME|INDEX", conflicts_with_all = ["eye", "target"])]
    camera: Option<String>,
    /// Where to look from
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, requires = "target", allow_hyphen_values = true)]
    eye: Option<Vec3>,
    /// What to look at
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, requires = "eye", allow_hyphen_values = true)]
    target: Option<Vec3>,
    /// Which way is up [default: 0,1,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, requires = "eye", allow_hyphen_values = true)]
    up: Option<Vec3>,
    /// Vertical field of view in degrees, also for the scene's own cameras
    #[arg(long, value_name = "DEGREES", value_parser = values::angle)]
    fov: Option<f32>,
}

/// A camera and, when the user should know how it came about, a note.
pub(super) struct Choice {
    pub(super) camera: Camera,
    pub(super) note: Option<String>,
}

/// The camera that the arguments ask for; without any, the scene's first, else one that frames everything in a picture
/// of the given aspect ratio (width over height).
///
/// # Errors
/// When the scene has no such camera, or the one placed by hand sees in no direction.
pub(super) fn choose(arguments: &Arguments, scene: &Scene, aspect: f32) -> Result<Choice, Failure> {
    let mut choice = match (&arguments.camera, arguments.eye, arguments.target) {
        (Some(wanted), ..) => Choice { camera: named(wanted, scene)?, note: None },
        (None, Some(eye), Some(target)) => Choice { camera: placed(arguments, eye, target)?, note: None },
        _ => match (scene.cameras().values().next(), scene.bounds()) {
            (Some(camera), _) => Choice { camera: camera.clone(), note: None },
            (None, Some(bounds)) => Choice {
                camera: framing(&bounds, aspect, arguments.fov.unwrap_or(DEFAULT_FOV)),
                note: Some("the scene has no camera; this one shows all of it".into()),
            },
            (None, None) => return Err(empty()),
        },
    };
    if let (Some(fov), Projection::Perspective { vertical_fov }) =
        (arguments.fov, &mut choice.camera.projection)
    {
        *vertical_fov = fov;
    }
    Ok(choice)
}

fn empty() -> Failure {
    Failure::new("the scene has no camera and nothing to look at").with_help("give --eye and --target")
}

fn named(wanted: &str, scene: &Scene) -> Result<Camera, Failure> {
    let cameras = scene.cameras();
    let by_name = cameras.values().find(|camera| camera.name == wanted);
    let by_index = || wanted.parse().ok().and_then(|index| cameras.values().nth(index));
    by_name.or_else(by_index).cloned().ok_or_else(|| {
        let list: Vec<_> = cameras.values().enumerate().map(|(i, c)| format!("{i} `{}`", c.name)).collect();
        let list = if list.is_empty() { "it has none".into() } else { format!("it has {}", list.join(", ")) };
        Failure::usage(format!("the scene has no camera `{wanted}`")).with_help(list)
    })
}

fn placed(arguments: &Arguments, eye: Vec3, target: Vec3) -> Result<Camera, Failure> {
    if eye == target {
        return Err(Failure::usage("--eye and --target are the same point").with_help("move one of them"));
    }
    let up = arguments.up.unwrap_or(Vec3::Y);
    Ok(Camera::look_at("", eye, target, up, arguments.fov.unwrap_or(DEFAULT_FOV)))
}

/// A three-quarter view from above, as near as it can be while every corner of the bounds stays in the picture.
fn framing(bounds: &SceneBounds, aspect: f32, vertical_fov: f32) -> Camera {
    const MARGIN: f32 = 1.06;
    let center = bounds.center();
    let toward_eye = Vec3::new(0.62, 0.42, 1.0).normalize();
    let axes =
        Camera::look_at("", center + toward_eye, center, Vec3::Y, vertical_fov).world_from_camera.matrix3;
    let slope = (0.5 * vertical_fov).tan();
    let half = 0.5 * (bounds.max - bounds.min);
    // A corner at (x, y, z) in camera axes around the centre needs |x| ≤ (d − z) · slope · aspect, and |y| likewise.
    let distance = (0..8)
        .map(|i| {
            Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { -half[axis] } else { half[axis] }))
        })
        .map(|corner| axes.transpose() * corner)
        .map(|p| p.z + (p.x.abs() / aspect).max(p.y.abs()) / slope)
        .fold(0.0, f32::max);
    // A scene that is a single point still gets a camera outside it.
    let distance = (MARGIN * distance).max(1e-3);
    Camera::look_at("framing", center + distance * toward_eye, center, Vec3::Y, vertical_fov)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn framing_fits_the_bounds_tightly() {
        for aspect in [0.5, 1.0, 2.0] {
            let bounds = SceneBounds { min: Vec3::new(-1.0, 0.0, 2.0), max: Vec3::new(5.0, 1.0, 3.0) };
            let camera = framing(&bounds, aspect, 0.7);
            let camera_from_world = camera.world_from_camera.inverse();
            let mut extent = 0.0f32;
            for i in 0..8 {
                let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
                let p = camera_from_world.transform_point3(Vec3::new(pick(0), pick(1), pick(2)));
                let edge = -p.z * 0.35f32.tan();
                assert!(p.z < 0.0);
                extent = extent.max(p.x.abs() / (edge * aspect)).max(p.y.abs() / edge);
            }
            assert!((0.85..=1.0).contains(&extent), "{aspect}: {extent}");
        }
    }
}
