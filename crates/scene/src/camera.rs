//! Points of view.

use std::sync::Arc;

use glam::{Affine3A, Mat3A, Vec3, Vec3A};

use crate::ShaderUse;

/// A view of the world. In camera space it looks along −Z with +Y up and +X to the right.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// For people and the command line; need not be unique.
    pub name: String,
    /// Placement; scale is ignored where it does not matter.
    pub world_from_camera: Affine3A,
    /// `world_from_camera` when the shutter closes; in between its entries change linearly. `None` stands still.
    pub motion: Option<Affine3A>,
    /// How directions map to the picture.
    pub projection: Projection,
    /// `None` is a pinhole: everything is in focus.
    pub lens: Option<Lens>,
    /// `None` is a single eye.
    pub stereo: Option<Stereo>,
    /// A camera shader in place of the projection, by a name that the program has registered.
    pub shader: Option<Arc<ShaderUse>>,
}

/// How directions map to the picture. Width follows from the picture's aspect ratio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Straight lines stay straight.
    Perspective {
        /// Full angle over the picture's height, radians, below π.
        vertical_fov: f32,
    },
    /// Parallel rays.
    Orthographic {
        /// Extent of the picture's height, metres.
        height: f32,
    },
    /// The whole sphere of directions: longitude over the width, latitude over the height.
    Panoramic,
    /// Equidistant fisheye: the angle from the view axis grows with the distance from the picture's centre. Beyond a
    /// half turn it stays there.
    FisheyeEquidistant {
        /// Full angle over the picture's height, radians, at most 2π.
        fov: f32,
    },
    /// Equisolid-angle fisheye, as most real ones: equal areas of the picture show equal solid angles. Beyond a half turn
    /// the angle stays there.
    FisheyeEquisolid {
        /// Full angle over the picture's height, radians, at most 2π.
        fov: f32,
    },
}

/// Two eyes beside each other, along the camera's X.
///
/// A panorama has its eyes on a circle, always beside each other as seen along the ray, and takes no account of
/// `convergence`.
///
/// # References
/// Ishiguro, Yamamoto, Tsuji, "Omni-Directional Stereo", 1992 (panoramas).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stereo {
    /// Between the eyes, metres.
    pub separation: f32,
    /// Where both eyes' pictures coincide: distance along the view axis (of a fisheye: along the ray), metres; infinity
    /// makes them look along parallel axes.
    pub convergence: f32,
    /// What of it the picture shows.
    pub view: StereoView,
}

/// What a picture shows of two eyes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StereoView {
    /// The left eye's picture.
    Left,
    /// The right eye's picture.
    Right,
    /// The left eye's picture in the left half, the right eye's in the right half.
    SideBySide,
    /// The left eye's picture above the right eye's.
    OverUnder,
}

/// A thin lens: depth of field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Of the aperture, metres.
    pub radius: f32,
    /// Distance of the plane in focus along the view axis, metres.
    pub focus_distance: f32,
}

impl Camera {
    /// A pinhole camera at `eye` that looks at `target`. When `up` is parallel to the view, another axis takes its
    /// place, so the result is always usable.
    pub fn look_at(name: impl Into<String>, eye: Vec3, target: Vec3, up: Vec3, vertical_fov: f32) -> Self {
        let back = (eye - target).try_normalize().unwrap_or(Vec3::Z);
        let right = up.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
        let axes = Mat3A::from_cols(right.into(), back.cross(right).into(), back.into());
        Self {
            name: name.into(),
            world_from_camera: Affine3A { matrix3: axes, translation: Vec3A::from(eye) },
            motion: None,
            projection: Projection::Perspective { vertical_fov },
            lens: None,
            stereo: None,
            shader: None,
        }
    }

    /// What is out of range, if anything.
    pub fn problem(&self) -> Option<String> {
        let places = [("world_from_camera", Some(self.world_from_camera)), ("motion", self.motion)];
        for (name, place) in places {
            if place.is_some_and(|place| !place.is_finite() || place.matrix3.determinant() == 0.0) {
                return Some(format!("`{name}` is singular or not finite; give an invertible transform"));
            }
        }
        match self.projection {
            Projection::Perspective { vertical_fov }
                if !(1e-4..std::f32::consts::PI).contains(&vertical_fov) =>
            {
                return Some(format!("`vertical_fov` is {vertical_fov} rad; give a value between 0 and π"));
            }
            Projection::Orthographic { height } if !(height.is_finite() && height > 0.0) => {
                return Some(format!("orthographic `height` is {height}; give a positive value"));
            }
            Projection::FisheyeEquidistant { fov } | Projection::FisheyeEquisolid { fov }
                if !(1e-3..=std::f32::consts::TAU + 1e-4).contains(&fov) =>
            {
                return Some(format!("`fov` is {fov} rad; give a value from 0.001 to 2π"));
            }
            _ => {}
        }
        if let Some(Stereo { separation, convergence, .. }) = self.stereo
            && !((0.0..f32::INFINITY).contains(&separation) && convergence > 0.0)
        {
            return Some(format!(
                "eyes {separation} m apart that converge at {convergence} m; give at least 0, and a positive distance or infinity"
            ));
        }
        let lens = self.lens?;
        (!(lens.radius >= 0.0
            && lens.radius.is_finite()
            && lens.focus_distance > 0.0
            && lens.focus_distance.is_finite()))
        .then(|| {
            format!(
                "lens radius {} and focus distance {} must be positive and finite",
                lens.radius, lens.focus_distance
            )
        })
    }
}
