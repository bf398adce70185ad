//! Analytic shapes: spheres and truncated cones, exact at any distance.

use glam::Vec3;

/// Analytic shapes of one geometry, in object space; a hit's primitive is the index into the list.
///
/// Shapes with a value that is not finite or without extent are never hit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Quadrics {
    /// The shapes.
    pub shapes: Vec<Quadric>,
}

/// An analytic shape, metres, object space. Front sides face outwards; where the radii are negative, inwards.
///
/// Texture coordinates: u runs around the axis (+Y of a sphere, base to apex of a cone), v along it, from the top of a
/// sphere (0 at +Y) down, and from the base of a cone (0) to its apex (1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quadric {
    /// All points at a distance from the centre.
    Sphere {
        /// The centre.
        center: Vec3,
        /// The distance.
        radius: f32,
    },
    /// A truncated cone without caps; a cylinder where the radii are equal, a full cone where one of them is zero.
    Cone {
        /// Centre of one end.
        base: Vec3,
        /// Radius there.
        base_radius: f32,
        /// Centre of the other end.
        apex: Vec3,
        /// Radius there; not of the other sign than `base_radius`.
        apex_radius: f32,
    },
}

impl Quadric {
    /// The smallest and largest coordinates.
    pub fn bounds(&self) -> [Vec3; 2] {
        match *self {
            Self::Sphere { center, radius } => [center - radius.abs(), center + radius.abs()],
            Self::Cone { base, base_radius, apex, apex_radius } => {
                let axis = (apex - base).normalize_or_zero();
                // How far a unit circle around the axis reaches along each coordinate axis.
                let reach = (Vec3::ONE - axis * axis).max(Vec3::ZERO).map(f32::sqrt);
                let (a, b) = (reach * base_radius.abs(), reach * apex_radius.abs());
                [(base - a).min(apex - b), (base + a).max(apex + b)]
            }
        }
    }
}

impl Quadrics {
    /// What makes the list inconsistent, if anything.
    pub(crate) fn inconsistency(&self) -> Option<String> {
        if u32::try_from(self.shapes.len()).is_err() {
            return Some("more than 2^32 shapes; split the geometry".into());
        }
        let opposed = |shape: &Quadric| matches!(shape, Quadric::Cone { base_radius, apex_radius, .. } if base_radius * apex_radius < 0.0);
        let bad = self.shapes.iter().position(opposed)?;
        Some(format!("the radii of cone {bad} have opposite signs; give both the same"))
    }
}
