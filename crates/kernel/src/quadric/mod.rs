//! Analytic shapes: spheres and truncated cones, met exactly instead of through triangles.
mod intersect;
mod tree;

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use crate::{aabb::Aabb, triangle_bvh::MAX_COORDINATE};

pub(crate) use intersect::Crossing;
pub use tree::Quadrics;

/// A sphere, or a truncated cone without caps, in object space. Front sides face outwards; where the radii are
/// negative, inwards.
///
/// Shapes with a value that is NaN or beyond ±1e10, without extent (radius zero, cones without height), or with radii
/// of opposite signs are kept in the numbering but never hit.
///
/// [`Hit::u`](crate::Hit::u) and [`Hit::v`](crate::Hit::v) are coordinates on the shape, in 0..=1:
///
/// | shape | u | v |
/// |---|---|---|
/// | sphere | azimuth around +Y, from +X towards +Z | angle from +Y, over π |
/// | cone | azimuth around the axis, from a direction that depends on the axis alone | from base (0) to apex (1) |
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quadric {
    /// All points at a distance from the centre.
    Sphere {
        /// The centre.
        center: Vec3,
        /// The distance.
        radius: f32,
    },
    /// The lateral surface between two parallel circles around one axis.
    Cone {
        /// Centre of one circle.
        base: Vec3,
        /// Its radius.
        base_radius: f32,
        /// Centre of the other circle.
        apex: Vec3,
        /// Its radius.
        apex_radius: f32,
    },
}

/// A point of a [`Quadric`], object space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadricPoint {
    /// On the shape up to a few roundings of its largest coordinate.
    pub position: Vec3,
    /// Unit vectors along increasing u and v, orthogonal to each other.
    pub tangents: [Vec3; 2],
    /// Area per unit of u and v.
    pub density: f32,
}

/// A cone's unit axis and two vectors that span the plane across it, from base to apex.
fn cone_axes(base: Vec3, apex: Vec3) -> Option<[DVec3; 3]> {
    let axis = (apex.as_dvec3() - base.as_dvec3()).try_normalize()?;
    let (x, y) = axis.any_orthonormal_pair();
    Some([axis, x, y])
}

impl Quadric {
    /// The point at coordinates (u, v), and what the surface is like there. All zero for a cone without height.
    #[must_use]
    pub fn at(&self, u: f32, v: f32) -> QuadricPoint {
        let (sin, cos) = (TAU * u).sin_cos();
        match *self {
            Self::Sphere { center, radius } => {
                let (sin_polar, cos_polar) = (PI * v).sin_cos();
                let normal = Vec3::new(sin_polar * cos, cos_polar, sin_polar * sin);
                QuadricPoint {
                    position: center + normal * radius.abs(),
                    tangents: [
                        Vec3::new(-sin, 0.0, cos),
                        Vec3::new(cos_polar * cos, -sin_polar, cos_polar * sin),
                    ],
                    density: TAU * PI * radius * radius * sin_polar.abs(),
                }
            }
            Self::Cone { base, base_radius, apex, apex_radius } => {
                let Some(axes) = cone_axes(base, apex) else {
                    return QuadricPoint { position: base, tangents: [Vec3::ZERO; 2], density: 0.0 };
                };
                let [_, x, y] = axes.map(|axis| axis.as_vec3());
                let outwards = x * cos + y * sin;
                let (r0, r1) = (base_radius.abs(), apex_radius.abs());
                let radius = r0 + (r1 - r0) * v;
                let slant = apex - base + outwards * (r1 - r0);
                QuadricPoint {
                    position: base.lerp(apex, v) + outwards * radius,
                    tangents: [y * cos - x * sin, slant.normalize_or_zero()],
                    density: TAU * radius * slant.length(),
                }
            }
        }
    }

    /// Surface area.
    #[must_use]
    pub fn area(&self) -> f32 {
        match *self {
            Self::Sphere { radius, .. } => 4.0 * PI * radius * radius,
            Self::Cone { base, base_radius, apex, apex_radius } => {
                let slant = (apex - base).length().hypot(apex_radius - base_radius);
                PI * (base_radius + apex_radius).abs() * slant
            }
        }
    }

    /// The box around the shape, widened by a few roundings; empty for a shape that is never hit.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        let bounds = match *self {
            Self::Sphere { radius: 0.0, .. } => return Aabb::EMPTY,
            Self::Sphere { center, radius } => Aabb::new(center - radius.abs(), center + radius.abs()),
            Self::Cone { base, base_radius, apex, apex_radius } => {
                let Some([axis, ..]) = cone_axes(base, apex) else { return Aabb::EMPTY };
                let no_extent = base_radius == 0.0 && apex_radius == 0.0;
                if no_extent || base_radius * apex_radius < 0.0 {
                    return Aabb::EMPTY;
                }
                // How far a unit circle around the axis reaches along each coordinate axis.
                let reach = (DVec3::ONE - axis * axis).max(DVec3::ZERO).map(f64::sqrt).as_vec3();
                let (a, b) = (reach * base_radius.abs(), reach * apex_radius.abs());
                Aabb::new((base - a).min(apex - b), (base + a).max(apex + b))
            }
        };
        let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
        // False for NaN, too.
        let proper = bounds.min.is_finite() && bounds.max.is_finite() && largest <= MAX_COORDINATE;
        let slack = 4.0 * f32::EPSILON * largest;
        if proper { Aabb::new(bounds.min - slack, bounds.max + slack) } else { Aabb::EMPTY }
    }
}
