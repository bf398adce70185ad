//! Chooses the point of view: as named, as placed by hand, the scene's own, or one that shows it well.

use glam::Vec3;
use heliostat::engine::Engine;
use heliostat::framing::frame_scene;
use heliostat::scene::{Camera, Projection, Scene};

use super::failure::Failure;
use super::values;

/// Vertical field of view of cameras placed by hand, radians.
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

/// The camera that the arguments ask for; without any, the scene's first; `None` if there is none and [`framed`] must
/// find one once there are rays to find it with.
///
/// # Errors
/// When the scene has no such camera, the one placed by hand sees in no direction, or there is nothing to frame.
pub(super) fn choose(arguments: &Arguments, scene: &Scene) -> Result<Option<Camera>, Failure> {
    let mut camera = match (&arguments.camera, arguments.eye, arguments.target) {
        (Some(wanted), ..) => named(wanted, scene)?,
        (None, Some(eye), Some(target)) => placed(arguments, eye, target)?,
        _ => match scene.cameras().values().next() {
            Some(camera) => camera.clone(),
            None if scene.bounds().is_some() => return Ok(None),
            None => return Err(empty()),
        },
    };
    if let (Some(fov), Projection::Perspective { vertical_fov }) = (arguments.fov, &mut camera.projection) {
        *vertical_fov = fov;
    }
    Ok(Some(camera))
}

/// A camera that shows the whole scene, or the inside of a room, in a picture of the given aspect ratio.
///
/// # Errors
/// When there is nothing to look at.
pub(super) fn framed(arguments: &Arguments, engine: &Engine, aspect: f32) -> Result<Camera, Failure> {
    let bounds = engine.scene().bounds().ok_or_else(empty)?;
    Ok(frame_scene(engine.rays(), &bounds, aspect, arguments.fov))
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
