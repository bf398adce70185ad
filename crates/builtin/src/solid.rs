//! Solids swept from outlines and profiles: surfaces of revolution, mouldings, table tops, tubes.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use crate::shape::Shape;

/// Edges of a profile that bend by less than this are shaded smoothly.
const CREASE_COSINE: f32 = 0.75;

/// A vertex of a closed outline seen from above: (x, −z), counter-clockwise.
#[derive(Clone, Copy)]
pub(crate) struct OutlinePoint {
    at: Vec2,
    /// Where the vertex goes when the outline grows by one metre.
    push: Vec2,
    /// Unit normal for shading.
    normal: Vec2,
}

/// A circle; `radius` 0 makes profiles relative to the axis.
pub(crate) fn circle(radius: f32, segments: u32) -> Vec<OutlinePoint> {
    (0..=segments)
        .map(|i| {
            let n = Vec2::from_angle(i as f32 / segments as f32 * TAU);
            OutlinePoint { at: radius * n, push: n, normal: n }
        })
        .collect()
}

/// A rectangle of half extents `half` with sharp corners.
pub(crate) fn rectangle(half: Vec2) -> Vec<OutlinePoint> {
    let corners = [Vec2::new(1.0, -1.0), Vec2::ONE, Vec2::new(-1.0, 1.0), Vec2::NEG_ONE];
    let normals = [Vec2::X, Vec2::Y, Vec2::NEG_X, Vec2::NEG_Y];
    let point = |i: usize, normal| OutlinePoint { at: corners[i % 4] * half, push: corners[i % 4], normal };
    (0..4).flat_map(|i| [point(i, normals[i]), point(i + 1, normals[i])]).collect()
}

/// |x/a|ⁿ + |y/b|ⁿ = 1: between an ellipse (n = 2) and a rectangle.
pub(crate) fn superellipse(half: Vec2, exponent: f32, segments: u32) -> Vec<OutlinePoint> {
    (0..=segments)
        .map(|i| {
            let d = Vec2::from_angle(i as f32 / segments as f32 * TAU);
            let scale = (d.x.abs().powf(exponent) + d.y.abs().powf(exponent)).powf(-1.0 / exponent);
            let p = d * scale;
            let gradient = p.signum() * p.abs().powf(exponent - 1.0) / half;
            let normal = gradient.normalize();
            OutlinePoint { at: p * half, push: normal, normal }
        })
        .collect()
}

/// An outline swept along a profile of (growth, height) pairs: upwards on the outside, downwards on the inside.
/// Texture coordinates are metres along the outline and along the profile.
pub(crate) fn loft(outline: &[OutlinePoint], profile: &[(f32, f32)]) -> Shape {
    let profile: Vec<Vec2> = profile.iter().map(|&(growth, y)| Vec2::new(growth, y)).collect();
    let widest = profile.iter().map(|p| p.x).fold(0.0, f32::max);
    let mut around = vec![0.0];
    for pair in outline.windows(2) {
        let [a, b] = [pair[0], pair[1]].map(|o| o.at + widest * o.push);
        around.push(around[around.len() - 1] + a.distance(b));
    }
    let slopes: Vec<Vec2> = profile
        .windows(2)
        .map(|w| Vec2::new(w[1].y - w[0].y, w[0].x - w[1].x).try_normalize().unwrap_or(Vec2::X))
        .collect();
    let blended = |a: usize, b: Option<&Vec2>| match b {
        Some(&b) if slopes[a].dot(b) > CREASE_COSINE => (slopes[a] + b).normalize(),
        _ => slopes[a],
    };
    let mut shape = Shape::default();
    let mut height = 0.0;
    for (k, ends) in profile.windows(2).enumerate() {
        let length = ends[0].distance(ends[1]);
        let rings = [
            (ends[0], blended(k, k.checked_sub(1).and_then(|i| slopes.get(i))), height),
            (ends[1], blended(k, slopes.get(k + 1)), height + length),
        ]
        .map(|(end, slope, v)| {
            let ring: Vec<u32> = outline
                .iter()
                .zip(&around)
                .map(|(o, &u)| {
                    let p = o.at + end.x * o.push;
                    let n = slope.x * o.normal;
                    shape.vertex(
                        Vec3::new(p.x, end.y, -p.y),
                        Vec3::new(n.x, slope.y, -n.y).normalize(),
                        Vec2::new(u, -v),
                    )
                })
                .collect();
            ring
        });
        height += length;
        for i in 0..outline.len() - 1 {
            shape.quad_face([rings[0][i], rings[0][i + 1], rings[1][i + 1], rings[1][i]]);
        }
    }
    shape
}

/// The flat inside of an outline at a height, facing up or down; texture coordinates are (x, z) in metres.
pub(crate) fn cap(outline: &[OutlinePoint], growth: f32, y: f32, up: bool) -> Shape {
    let mut shape = Shape::default();
    let normal = if up { Vec3::Y } else { Vec3::NEG_Y };
    let center = shape.vertex(Vec3::Y * y, normal, Vec2::ZERO);
    let rim: Vec<u32> = outline
        .iter()
        .map(|o| {
            let p = o.at + growth * o.push;
            shape.vertex(Vec3::new(p.x, y, -p.y), normal, Vec2::new(p.x, -p.y))
        })
        .collect();
    for pair in rim.windows(2) {
        shape.triangle(if up { [center, pair[0], pair[1]] } else { [center, pair[1], pair[0]] });
    }
    shape
}

/// [`loft`] with both ends closed by [`cap`]s.
pub(crate) fn solid(outline: &[OutlinePoint], profile: &[(f32, f32)]) -> Shape {
    let mut shape = loft(outline, profile);
    if let (Some(&first), Some(&last)) = (profile.first(), profile.last()) {
        shape.add(&cap(outline, first.0, first.1, false));
        shape.add(&cap(outline, last.0, last.1, true));
    }
    shape
}

/// A surface of revolution about the Y axis; the profile is (radius, height).
pub(crate) fn lathe(segments: u32, profile: &[(f32, f32)]) -> Shape {
    loft(&circle(0.0, segments), profile)
}

/// A closed cylinder standing at `foot`.
pub(crate) fn cylinder(foot: Vec3, radius: f32, height: f32, segments: u32) -> Shape {
    lathe(segments, &[(0.0, 0.0), (radius, 0.0), (radius, height), (0.0, height)]).moved(foot)
}

/// A sphere cut into `segments × segments / 2` pieces.
pub(crate) fn sphere(center: Vec3, radius: f32, segments: u32) -> Shape {
    Shape::patch(segments, segments / 2, Vec2::ONE, |u, v| {
        let (sin_polar, cos_polar) = (std::f32::consts::PI * v).sin_cos();
        let (sin, cos) = (TAU * u).sin_cos();
        center + radius * Vec3::new(sin_polar * cos, -cos_polar, -sin_polar * sin)
    })
}

/// A ring about the Y axis at `center`.
pub(crate) fn torus(center: Vec3, ring: f32, tube: f32, segments: [u32; 2]) -> Shape {
    Shape::patch(segments[0], segments[1], TAU * Vec2::new(ring, tube), |u, v| {
        let ((sin, cos), (lift, out)) = ((TAU * u).sin_cos(), (TAU * v).sin_cos());
        let r = ring + tube * out;
        center + Vec3::new(r * cos, tube * lift, -r * sin)
    })
}

/// A tube through `points`, each with its radius; round ends where `closed_ends`.
pub(crate) fn tube(points: &[(Vec3, f32)], sides: u32, closed_ends: bool) -> Shape {
    let mut shape = Shape::default();
    let mut rings: Vec<Vec<u32>> = Vec::new();
    let mut along = 0.0;
    let mut side = Vec3::ZERO;
    let last = points.len() - 1;
    for (k, &(center, radius)) in points.iter().enumerate() {
        let axis = (points[(k + 1).min(last)].0 - points[k.saturating_sub(1)].0).normalize();
        // Parallel transport: drop the part of the previous side that lies along the new axis.
        side =
            (side - axis * side.dot(axis)).try_normalize().unwrap_or_else(|| axis.any_orthonormal_vector());
        let up = axis.cross(side);
        along += if k > 0 { center.distance(points[k - 1].0) } else { 0.0 };
        let ring = (0..=sides)
            .map(|i| {
                let t = i as f32 / sides as f32;
                let (sin, cos) = (TAU * t).sin_cos();
                let normal = side * cos + up * sin;
                shape.vertex(center + radius * normal, normal, Vec2::new(t * TAU * radius, -along))
            })
            .collect();
        rings.push(ring);
    }
    for pair in rings.windows(2) {
        for i in 0..sides as usize {
            shape.quad_face([pair[0][i], pair[0][i + 1], pair[1][i + 1], pair[1][i]]);
        }
    }
    if closed_ends {
        for (center, radius) in [points[0], points[last]] {
            shape.add(&sphere(center, radius, sides.next_multiple_of(2)));
        }
    }
    shape
}
