//! Points of spheres and cones as shading sees them.

use std::f32::consts::PI;

use glam::{Affine3A, Mat3A, Vec2, Vec3, Vec3A, Vec4};
use heliostat_kernel as kernel;
use heliostat_scene::Quadric;

use crate::material::{Slot, SurfaceMaterial, TextureCoordinates};
use crate::placement::Placement;

/// The kernel's form of an analytic shape.
pub fn kernel_quadric(shape: &Quadric) -> kernel::Quadric {
    match *shape {
        Quadric::Sphere { center, radius } => kernel::Quadric::Sphere { center, radius },
        Quadric::Cone { base, base_radius, apex, apex_radius } => {
            kernel::Quadric::Cone { base, base_radius, apex, apex_radius }
        }
    }
}

/// A point of a shape: the counterpart of [`Corners`](crate::point::Corners).
pub(crate) struct Spot {
    shape: kernel::Quadric,
    uv: Vec2,
    point: kernel::QuadricPoint,
}

impl Spot {
    pub(crate) fn new(shape: &Quadric, uv: Vec2) -> Self {
        let shape = kernel_quadric(shape);
        Self { shape, uv, point: shape.at(uv.x, uv.y) }
    }

    pub(crate) fn object_position(&self) -> Vec3 {
        self.point.position
    }

    /// World-space point and a bound on its rounding error.
    pub(crate) fn point(&self, placement: &Placement) -> (Vec3, f32) {
        let bounds = self.shape.bounds();
        let largest = bounds.min.abs().max(bounds.max.abs());
        // The point is the sum of a centre and a rounded multiple of a unit vector: as many roundings as a triangle's.
        (placement.world_from_object.transform_point3(self.point.position), placement.rounding(largest))
    }

    /// How many times larger areas are in the world than in the object, here.
    fn area_scale(&self, world_from_object: &Affine3A) -> f32 {
        let [u, v] = self.point.tangents.map(|t| world_from_object.transform_vector3(t));
        u.cross(v).length()
    }

    /// Density per square metre of the world of [`sample`].
    pub(crate) fn area_pdf(&self, world_from_object: &Affine3A) -> f32 {
        1.0 / (self.shape.area() * self.area_scale(world_from_object)).max(f32::MIN_POSITIVE)
    }

    /// World-space normal on the front side; not unit length.
    pub(crate) fn normal(&self, placement: &Placement) -> Vec3 {
        let [u, v] = self.point.tangents;
        let inside_out = match self.shape {
            kernel::Quadric::Sphere { radius, .. } => radius < 0.0,
            kernel::Quadric::Cone { base_radius, apex_radius, .. } => base_radius + apex_radius < 0.0,
        };
        let normal = if inside_out { v.cross(u) } else { u.cross(v) };
        (placement.world_from_object_normal * Vec3A::from(normal)).into()
    }

    /// As for triangles; both coordinate sets are (u, v).
    pub(crate) fn coordinates(
        &self,
        material: &SurfaceMaterial,
        world_from_object: &Affine3A,
        width: f32,
    ) -> TextureCoordinates<f32> {
        let color = Vec4::ONE.into();
        if !material.is_textured() {
            return TextureCoordinates::square([[0.0; 2]; 2], [0.0; 2], color);
        }
        let world_area = self.point.density * self.area_scale(world_from_object);
        let lod = 0.5 * (width * width / world_area.max(f32::MIN_POSITIVE)).max(1e-30).log2();
        TextureCoordinates::square([self.uv.to_array(); 2], [lod; 2], color)
    }

    /// As for triangles.
    pub(crate) fn tangent_basis(
        &self,
        world_from_object: &Affine3A,
        normal: Vec3,
        slot: &Slot,
    ) -> Option<[Vec3; 2]> {
        // A texture transform turns and mirrors the directions in which its coordinates grow.
        let [u, v] = self.point.tangents.map(|t| world_from_object.transform_vector3(t));
        let matrix = slot.reference.transform.0.matrix2;
        let inverse = (matrix.determinant() != 0.0).then(|| matrix.inverse())?;
        let along = |direction: Vec2| u * direction.x + v * direction.y;
        let x = along(inverse.x_axis).reject_from_normalized(normal).try_normalize()?;
        let y = normal.cross(x);
        Some([x, if y.dot(along(inverse.y_axis)) > 0.0 { -y } else { y }])
    }
}

impl Placement {
    /// How much of its magnitude the sum of a point's products may be wrong by. Each coordinate is a sum of at most four
    /// rounded products, and the kernel's own intersection of the next ray rounds as often again (Higham 2002, γ_n ≈ nε);
    /// 16 covers both.
    pub(crate) const ROUNDING: f32 = 16.0 * 0.5 * f32::EPSILON;

    /// Bound on the rounding error of a point whose object-space coordinates are at most `largest`, metres.
    pub(crate) fn rounding(&self, largest: Vec3) -> f32 {
        let m = self.world_from_object.matrix3;
        let abs = Mat3A::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
        let magnitude = abs * Vec3A::from(largest) + self.world_from_object.translation.abs();
        Self::ROUNDING * (magnitude.max_element() + self.detour)
    }
}

/// (u, v) of a point distributed evenly over the shape's area.
pub(crate) fn sample(shape: &Quadric, u: Vec2) -> Vec2 {
    let v = match *shape {
        // Archimedes: heights are distributed evenly.
        Quadric::Sphere { .. } => (1.0 - 2.0 * u.y).clamp(-1.0, 1.0).acos() / PI,
        Quadric::Cone { base_radius, apex_radius, .. } => {
            let (r0, r1) = (base_radius.abs(), apex_radius.abs());
            // The radius at v has a density in proportion to itself; with both radii alike the limit is u itself.
            let radius = (r0 * r0 * (1.0 - u.y) + r1 * r1 * u.y).sqrt();
            if r0 + radius > 0.0 { u.y * (r0 + r1) / (r0 + radius) } else { 0.0 }
        }
    };
    Vec2::new(u.x, v)
}

/// Surface area in object space; 0 for a shape that is never hit.
pub(crate) fn area(shape: &Quadric) -> f32 {
    let shape = kernel_quadric(shape);
    if shape.bounds().is_empty() { 0.0 } else { shape.area() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_even_over_the_area() {
        let shapes = [
            Quadric::Sphere { center: Vec3::ONE, radius: -2.0 },
            Quadric::Cone { base: Vec3::ZERO, base_radius: 1.0, apex: Vec3::Y, apex_radius: 1.0 },
            Quadric::Cone { base: Vec3::ZERO, base_radius: 0.0, apex: Vec3::Y, apex_radius: 3.0 },
            Quadric::Cone { base: Vec3::ZERO, base_radius: 3.0, apex: Vec3::Y, apex_radius: 1.0 },
        ];
        let n = 1000;
        for shape in shapes {
            let surface = kernel_quadric(&shape);
            // The share of samples below v must be the share of the area below v.
            for step in 1..8 {
                let v = step as f32 / 8.0;
                let below =
                    (0..n).filter(|i| sample(&shape, Vec2::new(0.3, (*i as f32 + 0.5) / n as f32)).y < v);
                let area: f32 = (0..n)
                    .map(|i| surface.at(0.0, v * (i as f32 + 0.5) / n as f32).density * v / n as f32)
                    .sum();
                let share = below.count() as f32 / n as f32;
                assert!((share - area / surface.area()).abs() < 2e-3, "{shape:?} {v}: {share}");
            }
        }
    }

    #[test]
    fn normals_are_those_of_hits() {
        let placement = Placement::new(
            Affine3A::from_scale(Vec3::new(-1.0, 2.0, 0.5)),
            0.0,
            heliostat_scene::ObjectId(0),
            heliostat_scene::InstanceId(0),
            0,
        );
        let cone = |sign: f32| Quadric::Cone {
            base: Vec3::X,
            base_radius: sign,
            apex: 2.0 * Vec3::X,
            apex_radius: 0.5 * sign,
        };
        let sphere = |radius: f32| Quadric::Sphere { center: Vec3::ZERO, radius };
        for shape in [sphere(1.0), sphere(-1.0), cone(1.0), cone(-1.0)] {
            let quadrics = kernel::Quadrics::build([(0, &[kernel_quadric(&shape)][..])]).unwrap();
            let mut inner = kernel::Object::empty();
            inner.set_quadrics(Some(std::sync::Arc::new(quadrics)));
            let instance = kernel::Instance {
                object: std::sync::Arc::new(inner),
                parent_from_object: placement.world_from_object,
                motion: None,
                id: 0,
            };
            let world =
                kernel::World::new(std::sync::Arc::new(kernel::Object::new(None, vec![instance]).unwrap()));
            let mut hits = [kernel::Hit::MISS];
            let ray = kernel::Ray::new(Vec3::new(-1.3, 9.0, 0.1), Vec3::NEG_Y);
            kernel::RayQuery::intersect(&world, &[ray], &mut hits);
            let hit = hits[0];
            if hit.is_hit() {
                let spot = Spot::new(&shape, Vec2::new(hit.u, hit.v));
                let normal = spot.normal(&placement).normalize();
                assert!(normal.abs_diff_eq(hit.ng, 1e-4), "{shape:?}: {normal} {hit:?}");
                assert!(spot.point(&placement).0.abs_diff_eq(ray.at(hit.t), 1e-4));
            } else {
                assert!(matches!(shape, Quadric::Sphere { .. }), "{shape:?}");
            }
        }
    }
}
