//! How a user moves: around a point, through the air, or on the ground.

use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use glam::{Affine3A, EulerRot, Mat3, Mat3A, Quat, Vec2, Vec3};
use heliostat_scene::{Camera, Lens, Projection, SceneBounds, ShaderUse, Stereo};
use serde::{Deserialize, Serialize};

/// Furthest that the view tilts up or down, radians: short of the poles, where turning would spin.
const MAX_PITCH: f32 = FRAC_PI_2 - 0.01;
/// Turn for a drag over the whole height of the picture, radians.
const TURN_PER_HEIGHT: f32 = PI;
/// Eye height while walking where the scene does not say otherwise, metres.
const EYE_HEIGHT: f32 = 1.7;
/// Free fall, m/s².
const GRAVITY: f32 = 9.81;
/// Highest step that is walked up, as a share of the eye height.
const STEP: f32 = 0.45;

/// Ways to move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Around a point.
    #[default]
    Orbit,
    /// Through the air, wherever one looks.
    Fly,
    /// On the ground, with gravity and walls.
    Walk,
}

/// Looks along a ray, world space: the distance to what it meets.
pub(crate) type Probe<'a> = dyn FnMut(Vec3, Vec3) -> Option<f32> + 'a;

/// A point of view and the way it moves.
#[derive(Clone, Debug)]
pub(crate) struct Navigator {
    mode: Mode,
    eye: Vec3,
    /// Turn about +Y, tilt, and roll about the view axis, radians; all zero looks along −Z.
    yaw: f32,
    pitch: f32,
    roll: f32,
    projection: Projection,
    lens: Option<Lens>,
    stereo: Option<Stereo>,
    shader: Option<Arc<ShaderUse>>,
    /// From the eye to the point that [`Mode::Orbit`] turns around, metres.
    distance: f32,
    /// Right, up, forward; −1 to 1 each: which way the user wants to go.
    drive: Vec3,
    hurry: bool,
    /// Metres per second.
    speed: f32,
    falling: f32,
    eye_height: f32,
}

impl Navigator {
    /// Starts at a camera in a scene of this size.
    pub(crate) fn new(camera: &Camera, bounds: Option<&SceneBounds>) -> Self {
        let mut navigator = Self {
            mode: Mode::Orbit,
            eye: Vec3::ZERO,
            yaw: 0.0,
            pitch: 0.0,
            roll: 0.0,
            projection: camera.projection,
            lens: None,
            stereo: None,
            shader: None,
            distance: 1.0,
            drive: Vec3::ZERO,
            hurry: false,
            speed: 1.0,
            falling: 0.0,
            eye_height: EYE_HEIGHT,
        };
        if let Some(bounds) = bounds {
            let radius = bounds.radius().max(1e-6);
            navigator.speed = (0.25 * radius).min(radius.sqrt());
            navigator.eye_height = EYE_HEIGHT.min(0.35 * (bounds.max.y - bounds.min.y)).max(1e-3 * radius);
        }
        navigator.jump(camera);
        if let Some(bounds) = bounds {
            let to_center = (bounds.center() - navigator.eye).dot(navigator.forward());
            navigator.distance = to_center.max(0.1 * bounds.radius()).max(1e-4);
        }
        navigator
    }

    /// Takes the place, direction and lens of a camera.
    pub(crate) fn jump(&mut self, camera: &Camera) {
        let axes = camera.world_from_camera.matrix3;
        // Scale means nothing to a view; a mirrored one is shown unmirrored.
        let back = Vec3::from(axes.z_axis).normalize_or(Vec3::Z);
        let up = Vec3::from(axes.y_axis);
        let right = up.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
        let rotation = Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back));
        (self.yaw, self.pitch, self.roll) = rotation.to_euler(EulerRot::YXZ);
        self.pitch = self.pitch.clamp(-MAX_PITCH, MAX_PITCH);
        self.eye = camera.world_from_camera.translation.into();
        (self.projection, self.lens, self.stereo) = (camera.projection, camera.lens, camera.stereo);
        self.shader.clone_from(&camera.shader);
        self.falling = 0.0;
    }

    /// The camera as it is now.
    pub(crate) fn camera(&self) -> Camera {
        let rotation = Quat::from_euler(EulerRot::YXZ, self.yaw, self.pitch, self.roll);
        Camera {
            name: "view".into(),
            world_from_camera: Affine3A { matrix3: Mat3A::from_quat(rotation), translation: self.eye.into() },
            motion: None,
            projection: self.projection,
            lens: self.lens,
            stereo: self.stereo,
            shader: self.shader.clone(),
        }
    }

    /// The way it moves.
    pub(crate) fn mode(&self) -> Mode {
        self.mode
    }

    /// Moves another way from now on. Orbiting goes on around the point ahead.
    pub(crate) fn set_mode(&mut self, mode: Mode) {
        self.mode = mode;
        self.falling = 0.0;
        if mode == Mode::Walk {
            self.roll = 0.0;
        }
    }

    /// Where the user wants to go: right, up, forward, −1 to 1 each. Stays until the next call.
    pub(crate) fn drive(&mut self, way: Vec3, hurry: bool) {
        self.drive = way.clamp(Vec3::NEG_ONE, Vec3::ONE);
        self.hurry = hurry;
    }

    /// Whether it moves by itself: driven or falling.
    pub(crate) fn is_moving(&self) -> bool {
        self.drive != Vec3::ZERO || self.falling != 0.0
    }

    /// Unit vector along the view.
    pub(crate) fn forward(&self) -> Vec3 {
        self.rotation() * Vec3::NEG_Z
    }

    fn rotation(&self) -> Quat {
        Quat::from_euler(EulerRot::YXZ, self.yaw, self.pitch, self.roll)
    }

    /// A drag by this share of the picture's height: turns around the pivot, or turns the head.
    pub(crate) fn turn(&mut self, drag: Vec2) {
        let pivot = self.eye + self.distance * self.forward();
        let (sign, amount) = match self.mode {
            Mode::Orbit => (-1.0, TURN_PER_HEIGHT),
            // The world follows the finger.
            Mode::Fly | Mode::Walk => (1.0, self.field().min(TURN_PER_HEIGHT)),
        };
        self.yaw = (self.yaw + sign * amount * drag.x + PI).rem_euclid(TAU) - PI;
        self.pitch = (self.pitch + sign * amount * drag.y).clamp(-MAX_PITCH, MAX_PITCH);
        if self.mode == Mode::Orbit {
            self.eye = pivot - self.distance * self.forward();
        }
    }

    /// Vertical field of view, radians.
    fn field(&self) -> f32 {
        match self.projection {
            Projection::Perspective { vertical_fov } => vertical_fov,
            _ => 0.7,
        }
    }

    /// Shifts the view sideways, as if the picture was dragged by this share of its height.
    pub(crate) fn pan(&mut self, drag: Vec2) {
        let height = match self.projection {
            Projection::Orthographic { height } => height,
            _ => 2.0 * self.distance * (0.5 * self.field()).tan(),
        };
        self.eye += self.rotation() * Vec3::new(-drag.x, drag.y, 0.0) * height;
    }

    /// Goes nearer (`steps` > 0) or further; each step by a tenth.
    pub(crate) fn zoom(&mut self, steps: f32) {
        let factor = 0.9f32.powf(steps.clamp(-50.0, 50.0));
        if let Projection::Orthographic { height } = &mut self.projection {
            *height = (*height * factor).clamp(1e-6, 1e9);
            return;
        }
        match self.mode {
            Mode::Orbit => {
                let distance = (self.distance * factor).clamp(1e-5, 1e9);
                self.eye += (self.distance - distance) * self.forward();
                self.distance = distance;
            }
            Mode::Fly | Mode::Walk => self.speed = (self.speed / factor).clamp(1e-4, 1e6),
        }
    }

    /// Looks at a point and turns around it from now on; comes near enough for a thing of this radius to fill the picture.
    pub(crate) fn focus(&mut self, point: Vec3, radius: Option<f32>) {
        let away = (self.eye - point).try_normalize().unwrap_or(-self.forward());
        let mut distance = (self.eye - point).length().max(1e-4);
        if let Some(radius) = radius {
            let fitting = radius.max(1e-4) / (0.5 * self.field()).sin();
            distance = distance.min(2.0 * fitting).max(1.05 * fitting);
        }
        self.eye = point + distance * away;
        self.distance = distance;
        self.yaw = away.x.atan2(away.z);
        self.pitch = (-away.y).clamp(-1.0, 1.0).asin().clamp(-MAX_PITCH, MAX_PITCH);
        self.roll = 0.0;
        if let Some(lens) = &mut self.lens {
            lens.focus_distance = distance;
        }
    }

    /// Sets the vertical field of view, radians; parallel projections have none.
    pub(crate) fn set_field(&mut self, angle: f32) {
        if let Projection::Perspective { vertical_fov } = &mut self.projection {
            *vertical_fov = angle.clamp(0.02, 2.9);
        }
    }

    /// Moves on by `seconds`; `probe` tells what is in the way.
    pub(crate) fn advance(&mut self, seconds: f32, probe: &mut Probe<'_>) {
        let pace = self.speed * if self.hurry { 4.0 } else { 1.0 };
        match self.mode {
            Mode::Walk => self.walk(seconds, pace, probe),
            Mode::Orbit | Mode::Fly => {
                let way =
                    self.rotation() * Vec3::new(self.drive.x, 0.0, -self.drive.z) + self.drive.y * Vec3::Y;
                self.eye += seconds * pace * way;
            }
        }
    }

    /// One step on the ground: stops before walls, climbs steps, falls where there is nothing below.
    fn walk(&mut self, seconds: f32, pace: f32, probe: &mut Probe<'_>) {
        let level = Quat::from_rotation_y(self.yaw) * Vec3::new(self.drive.x, 0.0, -self.drive.z);
        // Nobody walks faster than a brisk run, whatever the size of the scene, measured in their own height.
        let pace = pace.min(2.0 * self.eye_height * if self.hurry { 3.0 } else { 1.0 });
        let mut step = seconds * pace * level;
        let length = step.length();
        if length > 0.0 {
            let (way, margin) = (step / length, 0.2 * self.eye_height);
            // At the knees: what is lower is climbed.
            let knees = self.eye - (1.0 - STEP) * self.eye_height * Vec3::Y;
            let free =
                [self.eye, knees].into_iter().filter_map(|from| probe(from, way)).fold(f32::MAX, f32::min);
            step = way * length.min((free - margin).max(0.0));
        }
        self.eye += step;
        let Some(ground) = probe(self.eye, Vec3::NEG_Y) else {
            // Nothing below at all: stay, rather than fall for ever.
            self.falling = 0.0;
            return;
        };
        let above = ground - self.eye_height;
        if above > 0.02 * self.eye_height {
            self.falling += GRAVITY * (self.eye_height / EYE_HEIGHT) * seconds;
            self.eye.y -= (self.falling * seconds).min(above);
        } else {
            self.falling = 0.0;
            // Up a step within a fifth of a second, so that stairs do not jerk.
            self.eye.y -= above * (seconds / 0.2).min(1.0);
        }
    }

    /// The view as text, for addresses of pages: `x,y,z,yaw,pitch,roll,field,distance`, metres and degrees. Projections
    /// other than perspective ones keep their kind only within a session.
    pub(crate) fn to_text(&self) -> String {
        let [x, y, z] = self.eye.to_array();
        let [yaw, pitch, roll, field] =
            [self.yaw, self.pitch, self.roll, self.field()].map(|angle| angle.to_degrees());
        format!("{x:.4},{y:.4},{z:.4},{yaw:.3},{pitch:.3},{roll:.3},{field:.2},{:.4}", self.distance)
    }

    /// Restores what [`Self::to_text`] wrote; `false` if the text is not of that form.
    pub(crate) fn restore(&mut self, text: &str) -> bool {
        let numbers: Vec<f32> = text.split(',').filter_map(|n| n.trim().parse().ok()).collect();
        let &[x, y, z, yaw, pitch, roll, field, distance] = &numbers[..] else { return false };
        let sensible = numbers.iter().all(|n| n.is_finite() && n.abs() < 1e9);
        if !sensible || text.split(',').count() != 8 || !(1.0..=170.0).contains(&field) || distance <= 0.0 {
            return false;
        }
        self.eye = Vec3::new(x, y, z);
        self.yaw = yaw.to_radians();
        self.pitch = pitch.to_radians().clamp(-MAX_PITCH, MAX_PITCH);
        self.roll = roll.to_radians();
        self.projection = Projection::Perspective { vertical_fov: field.to_radians() };
        self.distance = distance;
        self.falling = 0.0;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn navigator() -> Navigator {
        let camera = Camera::look_at("", Vec3::new(3.0, 2.0, 5.0), Vec3::ZERO, Vec3::Y, 0.8);
        let bounds = SceneBounds { min: Vec3::splat(-2.0), max: Vec3::splat(2.0) };
        Navigator::new(&camera, Some(&bounds))
    }

    #[test]
    fn a_camera_goes_in_and_comes_out() {
        let camera = Camera::look_at("", Vec3::new(3.0, 2.0, 5.0), Vec3::ZERO, Vec3::new(0.3, 1.0, 0.0), 0.8);
        let mut navigator = navigator();
        navigator.jump(&camera);
        assert!(navigator.camera().world_from_camera.abs_diff_eq(camera.world_from_camera, 1e-5));
        let text = navigator.to_text();
        let mut other = Navigator::new(&camera, None);
        assert!(other.restore(&text));
        assert!(other.camera().world_from_camera.abs_diff_eq(camera.world_from_camera, 1e-3));
        for bad in
            ["", "1,2,3", "a,b,c,d,e,f,g,h", "1,2,3,4,5,6,400,1", "1,2,nan,4,5,6,40,1", "1,2,3,4,5,6,40,1,9"]
        {
            assert!(!other.restore(bad), "{bad}");
        }
    }

    #[test]
    fn orbiting_keeps_the_pivot_in_the_middle() {
        let mut navigator = navigator();
        navigator.focus(Vec3::ZERO, None);
        let distance = navigator.eye.length();
        navigator.turn(Vec2::new(0.3, -0.2));
        assert!((navigator.eye.length() - distance).abs() < 1e-4);
        assert!(navigator.eye.normalize().dot(navigator.forward()) < -0.9999);
        navigator.zoom(1.0);
        assert!((navigator.eye.length() - 0.9 * distance).abs() < 1e-4);
        navigator.turn(Vec2::new(0.0, 9.0));
        assert!(navigator.camera().problem().is_none() && navigator.pitch >= -MAX_PITCH);
    }

    #[test]
    fn flying_goes_where_one_looks() {
        let mut navigator = navigator();
        navigator.set_mode(Mode::Fly);
        let (from, way) = (navigator.eye, navigator.forward());
        navigator.drive(Vec3::Z, false);
        navigator.advance(0.5, &mut |_, _| None);
        let step = navigator.eye - from;
        assert!(step.length() > 0.0 && step.normalize().dot(way) > 0.9999);
    }

    #[test]
    fn walking_falls_to_the_ground_stops_at_walls_and_climbs_steps() {
        let mut navigator = navigator();
        navigator.set_mode(Mode::Walk);
        (navigator.eye, navigator.yaw, navigator.pitch) = (Vec3::new(0.0, 4.0, 0.0), 0.0, 0.0);
        navigator.eye_height = 1.0;
        // Ground at 0, a step of 0.3 beyond z = −2, a wall at z = −5.
        let mut world = |origin: Vec3, way: Vec3| {
            if way.y < -0.9 {
                let ground = if origin.z < -2.0 { 0.3 } else { 0.0 };
                Some(origin.y - ground)
            } else {
                (way.z < -0.9).then_some(origin.z + 5.0)
            }
        };
        for _ in 0..100 {
            navigator.advance(0.02, &mut world);
        }
        assert!((navigator.eye.y - 1.0).abs() < 0.03, "{}", navigator.eye);
        navigator.drive(Vec3::Z, true);
        for _ in 0..400 {
            navigator.advance(0.02, &mut world);
        }
        assert!((navigator.eye.z + 4.8).abs() < 0.02, "before the wall: {}", navigator.eye);
        assert!((navigator.eye.y - 1.3).abs() < 0.03, "on the step: {}", navigator.eye);
        navigator.advance(1.0, &mut |_, _| None);
        assert!(!navigator.eye.is_nan() && navigator.falling == 0.0);
    }
}
