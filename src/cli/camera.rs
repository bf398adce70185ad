//! Chooses the point of view: as named, as placed by hand, the scene's own, or one that shows it well.

use std::f32::consts::PI;

use glam::Vec3;
use heliostat::engine::Engine;
use heliostat::framing::frame_scene;
use heliostat::scene::{Camera, Projection, Scene, Stereo, StereoView};

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
    /// Vertical field of view in degrees, also for the scene's own cameras; above 179 for fisheyes alone
    #[arg(long, value_name = "DEGREES", value_parser = values::wide_angle)]
    fov: Option<f32>,
    /// How directions map to the picture, also for the scene's own cameras
    #[arg(long, value_name = "NAME")]
    projection: Option<ProjectionName>,
    /// Height of the picture of `--projection orthographic`, metres
    #[arg(long, value_name = "METRES", default_value_t = 5.0)]
    ortho_height: f32,
    /// Two eyes beside each other, or one of them; of a panorama on a circle, for viewing all around
    #[arg(long, value_name = "VIEW")]
    stereo: Option<StereoName>,
    /// Distance between the eyes, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.065)]
    eye_distance: f32,
    /// Where the eyes' pictures coincide, metres; `inf` for parallel axes
    #[arg(long, value_name = "METRES", default_value_t = f32::INFINITY)]
    convergence: f32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum ProjectionName {
    /// Straight lines stay straight
    Perspective,
    /// Parallel rays
    Orthographic,
    /// The whole sphere: longitude over the width, latitude over the height
    Panoramic,
    /// The angle grows with the distance from the centre; 180° unless --fov says otherwise
    FisheyeEquidistant,
    /// Equal areas show equal solid angles; 180° unless --fov says otherwise
    FisheyeEquisolid,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum StereoName {
    /// The left eye alone
    Left,
    /// The right eye alone
    Right,
    /// Left eye in the left half, right eye in the right half
    SideBySide,
    /// Left eye above right eye
    OverUnder,
}

impl Arguments {
    /// Whether a fisheye is asked for.
    fn is_fisheye(&self) -> bool {
        matches!(self.projection, Some(ProjectionName::FisheyeEquidistant | ProjectionName::FisheyeEquisolid))
    }

    /// Checks what the camera cannot be asked for.
    fn check(&self) -> Result<(), Failure> {
        let degrees = self.fov.map_or(0.0, f32::to_degrees);
        if degrees > 179.01 && !self.is_fisheye() {
            return Err(Failure::usage(format!("a field of view of {degrees:.1}° needs a fisheye"))
                .with_help("give --projection fisheye-equidistant, or at most 179"));
        }
        Ok(())
    }

    /// The camera with what the arguments say of its projection and eyes.
    fn applied(&self, mut camera: Camera) -> Result<Camera, Failure> {
        let fov = self.fov;
        camera.projection = match (self.projection, camera.projection) {
            (None, Projection::Perspective { vertical_fov }) => {
                Projection::Perspective { vertical_fov: fov.unwrap_or(vertical_fov) }
            }
            (None, other) => other,
            (Some(ProjectionName::Perspective), Projection::Perspective { vertical_fov }) => {
                Projection::Perspective { vertical_fov: fov.unwrap_or(vertical_fov) }
            }
            (Some(ProjectionName::Perspective), _) => {
                Projection::Perspective { vertical_fov: fov.unwrap_or(DEFAULT_FOV) }
            }
            (Some(ProjectionName::Orthographic), _) => Projection::Orthographic { height: self.ortho_height },
            (Some(ProjectionName::Panoramic), _) => Projection::Panoramic,
            (Some(ProjectionName::FisheyeEquidistant), _) => {
                Projection::FisheyeEquidistant { fov: fov.unwrap_or(PI) }
            }
            (Some(ProjectionName::FisheyeEquisolid), _) => {
                Projection::FisheyeEquisolid { fov: fov.unwrap_or(PI) }
            }
        };
        if let Some(view) = self.stereo {
            let view = match view {
                StereoName::Left => StereoView::Left,
                StereoName::Right => StereoView::Right,
                StereoName::SideBySide => StereoView::SideBySide,
                StereoName::OverUnder => StereoView::OverUnder,
            };
            let (separation, convergence) = (self.eye_distance, self.convergence);
            camera.stereo = Some(Stereo { separation, convergence, view });
        }
        match camera.problem() {
            Some(problem) => Err(Failure::usage(format!("the camera: {problem}"))),
            None => Ok(camera),
        }
    }
}

/// The camera that the arguments ask for; without any, the scene's first; `None` if there is none and [`framed`] must
/// find one once there are rays to find it with.
///
/// # Errors
/// When the scene has no such camera, the one placed by hand sees in no direction, or there is nothing to frame.
pub(super) fn choose(arguments: &Arguments, scene: &Scene) -> Result<Option<Camera>, Failure> {
    arguments.check()?;
    let camera = match (&arguments.camera, arguments.eye, arguments.target) {
        (Some(wanted), ..) => named(wanted, scene)?,
        (None, Some(eye), Some(target)) => placed(arguments, eye, target)?,
        _ => match scene.cameras().values().next() {
            Some(camera) => camera.clone(),
            None if scene.bounds().is_some() => return Ok(None),
            None => return Err(empty()),
        },
    };
    arguments.applied(camera).map(Some)
}

/// A camera that shows the whole scene, or the inside of a room, in a picture of the given aspect ratio.
///
/// # Errors
/// When there is nothing to look at.
pub(super) fn framed(arguments: &Arguments, engine: &Engine, aspect: f32) -> Result<Camera, Failure> {
    let bounds = engine.scene().bounds().ok_or_else(empty)?;
    let fov = arguments.fov.filter(|_| !arguments.is_fisheye());
    arguments.applied(frame_scene(engine.rays(), &bounds, aspect, fov))
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
    Ok(Camera::look_at("", eye, target, up, DEFAULT_FOV))
}
