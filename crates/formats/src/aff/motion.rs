//! What an AFF file says about time, as a motion of the scene.

use std::sync::Arc;

use glam::{Affine3A, DAffine3, Vec3};
use heliostat_scene::{
    Camera, CameraId, GeometryId, InstanceId, Light, LightId, LightKind, Mesh, Motion, Pose,
};

use super::keyframes::Animation;

/// A step on the way from an instance to what holds it.
#[derive(Clone, Debug)]
pub(super) enum Step {
    Fixed(DAffine3),
    Animated(Arc<Animation>),
}

/// The product of several transforms, outermost first.
#[derive(Clone, Debug)]
pub(super) struct Chain(pub(super) Vec<Step>);

impl Chain {
    pub(super) fn is_fixed(&self) -> bool {
        self.0.iter().all(|step| matches!(step, Step::Fixed(_)))
    }

    /// `None` where the numbers overflow.
    pub(super) fn at(&self, time: f64) -> Option<Affine3A> {
        let mut product = DAffine3::IDENTITY;
        for step in &self.0 {
            product *= match step {
                Step::Fixed(transform) => *transform,
                Step::Animated(animation) => animation.matrix(time)?,
            };
        }
        let single = Affine3A {
            matrix3: product.matrix3.as_mat3().into(),
            translation: product.translation.as_vec3a(),
        };
        single.is_finite().then_some(single)
    }

    fn animations(&self) -> impl Iterator<Item = &Animation> {
        self.0.iter().filter_map(|step| match step {
            Step::Animated(animation) => Some(&**animation),
            Step::Fixed(_) => None,
        })
    }

    pub(super) fn has_visibility(&self) -> bool {
        self.animations().any(Animation::has_visibility)
    }

    pub(super) fn visible(&self, time: f64) -> bool {
        self.animations().all(|animation| animation.visible(time))
    }
}

/// A mesh with keys.
#[derive(Clone, Debug)]
pub(super) struct DeformingMesh {
    pub(super) geometry: GeometryId,
    pub(super) times: Vec<f32>,
    /// Per time; they share their indices.
    pub(super) frames: Vec<Arc<Mesh>>,
}

impl DeformingMesh {
    /// Linear between keys; at rest before the first and after the last.
    pub(super) fn at(&self, time: f64) -> Option<Arc<Mesh>> {
        let next = self.times.partition_point(|&key| f64::from(key) <= time);
        let (Some(before), Some(after)) = (next.checked_sub(1), self.frames.get(next)) else {
            return self.frames.get(next.saturating_sub(1)).cloned();
        };
        let (a, b) = (f64::from(self.times[before]), f64::from(self.times[next]));
        let u = if b > a { ((time - a) / (b - a)) as f32 } else { 0.0 };
        let before = &self.frames[before];
        if u == 0.0 {
            return Some(before.clone());
        }
        let mix =
            |a: &[Vec3], b: &[Vec3]| -> Vec<Vec3> { a.iter().zip(b).map(|(a, b)| a.lerp(*b, u)).collect() };
        Some(Arc::new(Mesh {
            positions: mix(&before.positions, &after.positions).into(),
            normals: mix(&before.normals, &after.normals),
            indices: before.indices.clone(),
            ..Mesh::default()
        }))
    }
}

/// Everything that moves in a file.
#[derive(Clone, Debug, Default)]
pub(super) struct AffMotion {
    /// The file's times, of which the first is 0 for the timeline.
    pub(super) start: f64,
    pub(super) end: f64,
    pub(super) instances: Vec<(InstanceId, Chain)>,
    pub(super) meshes: Vec<DeformingMesh>,
    pub(super) lights: Vec<(LightId, Light, Arc<Animation>)>,
    pub(super) camera: Option<(CameraId, Camera, Arc<Animation>)>,
}

impl AffMotion {
    pub(super) fn is_empty(&self) -> bool {
        self.instances.is_empty() && self.meshes.is_empty() && self.lights.is_empty() && self.camera.is_none()
    }
}

/// A light where its animation puts it.
pub(super) fn moved_light(light: &Light, animation: &Animation, time: f64) -> Light {
    let mut moved = light.clone();
    if let LightKind::ConstantPoint { position, .. } = &mut moved.kind
        && let Some(place) = animation.translation.as_ref().and_then(|path| path.at(time))
        && place.as_vec3().is_finite()
    {
        *position = place.as_vec3();
    }
    moved
}

/// A camera where its animation puts it.
pub(super) fn moved_camera(camera: &Camera, animation: &Animation, time: f64) -> Camera {
    let rest = camera.world_from_camera;
    let rest = DAffine3 {
        matrix3: glam::Mat3::from(rest.matrix3).as_dmat3(),
        translation: Vec3::from(rest.translation).as_dvec3(),
    };
    let Some(place) = animation.camera(time, rest) else { return camera.clone() };
    let world_from_camera =
        Affine3A { matrix3: place.matrix3.as_mat3().into(), translation: place.translation.as_vec3a() };
    let moved = Camera { world_from_camera, ..camera.clone() };
    if moved.problem().is_none() { moved } else { camera.clone() }
}

impl Motion for AffMotion {
    fn duration(&self) -> f64 {
        self.end - self.start
    }

    fn sample(&self, time: f64, pose: &mut Pose) {
        let time = self.start + time;
        for (id, chain) in &self.instances {
            if let Some(transform) = chain.at(time) {
                pose.instance(*id, transform);
            }
            if chain.has_visibility() {
                pose.show(*id, chain.visible(time));
            }
        }
        for mesh in &self.meshes {
            if let Some(shape) = mesh.at(time) {
                pose.mesh(mesh.geometry, shape);
            }
        }
        for (id, light, animation) in &self.lights {
            pose.light(*id, moved_light(light, animation, time));
        }
        if let Some((id, camera, animation)) = &self.camera {
            pose.camera(*id, moved_camera(camera, animation, time));
        }
    }
}
