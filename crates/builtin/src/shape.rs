//! Meshes under construction: vertices with normals and texture coordinates, put together from pieces.

use glam::{Affine3A, Mat3A, Vec2, Vec3};
use heliostat_scene::Mesh;

/// A triangle mesh whose every vertex has a normal and texture coordinates (usually in metres, so that a
/// material's scale says how large a texture is on the surface).
#[derive(Clone, Default)]
pub(crate) struct Shape {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// The finished mesh.
    pub(crate) fn mesh(self) -> Mesh {
        let mut mesh = Mesh::new(self.positions, self.triangles);
        mesh.normals = self.normals;
        mesh.uvs[0] = self.uvs;
        mesh
    }

    /// The union of shapes.
    pub(crate) fn union(shapes: impl IntoIterator<Item = Self>) -> Self {
        shapes.into_iter().fold(Self::default(), |mut all, shape| {
            all.add(&shape);
            all
        })
    }

    /// Appends another shape.
    pub(crate) fn add(&mut self, other: &Self) {
        let base = self.positions.len() as u32;
        self.positions.extend_from_slice(&other.positions);
        self.normals.extend_from_slice(&other.normals);
        self.uvs.extend_from_slice(&other.uvs);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + base)));
    }

    /// Adds a vertex and returns its index.
    pub(crate) fn vertex(&mut self, position: Vec3, normal: Vec3, uv: Vec2) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        self.uvs.push(uv);
        self.positions.len() as u32 - 1
    }

    /// Adds a counter-clockwise triangle, unless it has no area worth speaking of (at poles and collapsed edges).
    pub(crate) fn triangle(&mut self, corners: [u32; 3]) {
        let [a, b, c] = corners.map(|i| self.positions[i as usize]);
        let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
        if (b - a).cross(c - a).length() > 1e-5 * longest && longest > 1e-12 {
            self.triangles.push(corners);
        }
    }

    /// Adds two triangles for a counter-clockwise quadrilateral.
    pub(crate) fn quad_face(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangle([a, b, c]);
        self.triangle([a, c, d]);
    }

    /// The shape moved by `transform`; mirroring keeps the outside outside.
    pub(crate) fn at(mut self, transform: Affine3A) -> Self {
        let normal_transform = transform.matrix3.inverse().transpose();
        for p in &mut self.positions {
            *p = transform.transform_point3(*p);
        }
        for n in &mut self.normals {
            *n = (normal_transform * *n).normalize();
        }
        if transform.matrix3.determinant() < 0.0 {
            self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        self
    }

    /// The shape moved by `offset`.
    pub(crate) fn moved(self, offset: Vec3) -> Self {
        self.at(Affine3A::from_translation(offset))
    }

    /// The shape bent by a smooth map that keeps orientation; normals follow its derivative.
    pub(crate) fn warped(mut self, map: impl Fn(Vec3) -> Vec3) -> Self {
        const STEP: f32 = 1e-3;
        for (p, n) in self.positions.iter_mut().zip(&mut self.normals) {
            let (t, b) = n.any_orthonormal_pair();
            let along = |d: Vec3| map(*p + STEP * d) - map(*p - STEP * d);
            // glam's pair satisfies t × b = n up to sign; compare instead of relying on it.
            let turned = along(t).cross(along(b)).try_normalize().unwrap_or(*n);
            *n = if t.cross(b).dot(*n) > 0.0 { turned } else { -turned };
            *p = map(*p);
        }
        self
    }

    /// Texture coordinates mapped by `map`.
    pub(crate) fn with_uvs(mut self, map: impl Fn(Vec2) -> Vec2) -> Self {
        self.uvs.iter_mut().for_each(|uv| *uv = map(*uv));
        self
    }

    /// Texture coordinates (x, z) in metres, for what lies flat.
    pub(crate) fn planar_uvs(mut self) -> Self {
        self.uvs.iter_mut().zip(&self.positions).for_each(|(uv, p)| *uv = Vec2::new(p.x, p.z));
        self
    }

    /// A curved patch `point(u, v)`, u and v from 0 to 1, cut into `nu × nv` quadrilaterals; it faces ∂u × ∂v.
    /// Texture coordinates run to `extent`, v downwards as in images. `point` is also evaluated a little outside
    /// the unit square.
    pub(crate) fn patch(nu: u32, nv: u32, extent: Vec2, point: impl Fn(f32, f32) -> Vec3) -> Self {
        let mut shape = Self::default();
        for j in 0..=nv {
            for i in 0..=nu {
                let (u, v) = (i as f32 / nu as f32, j as f32 / nv as f32);
                shape.vertex(point(u, v), patch_normal(&point, u, v), extent * Vec2::new(u, 1.0 - v));
            }
        }
        let index = |i: u32, j: u32| j * (nu + 1) + i;
        for j in 0..nv {
            for i in 0..nu {
                shape.quad_face([index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)]);
            }
        }
        shape
    }

    /// A flat parallelogram facing `edge_u × edge_v`, texture coordinates in metres.
    pub(crate) fn quad(corner: Vec3, edge_u: Vec3, edge_v: Vec3) -> Self {
        let extent = Vec2::new(edge_u.length(), edge_v.length());
        Self::patch(1, 1, extent, |u, v| corner + u * edge_u + v * edge_v)
    }

    /// A box between two corners; texture coordinates in metres, u horizontal.
    pub(crate) fn block(min: Vec3, max: Vec3) -> Self {
        let (x, y, z) = (Vec3::X * (max.x - min.x), Vec3::Y * (max.y - min.y), Vec3::Z * (max.z - min.z));
        Self::union([
            Self::quad(min + z, x, y),
            Self::quad(max - y, -z, y),
            Self::quad(min + x, -x, y),
            Self::quad(min, z, y),
            Self::quad(min + y + z, x, -z),
            Self::quad(min, x, z),
        ])
    }

    /// A box of `size` standing on the middle of its lower face at `foot`.
    pub(crate) fn block_on(foot: Vec3, size: Vec3) -> Self {
        let half = Vec3::new(0.5 * size.x, 0.0, 0.5 * size.z);
        Self::block(foot - half, foot + half + Vec3::Y * size.y)
    }

    /// A box of `size` around the origin with edges rounded by `radius`: `round` steps per quarter turn and `flat`
    /// steps across the flat parts (more than one where the shape will be warped).
    pub(crate) fn rounded_block(size: Vec3, radius: f32, round: u32, flat: u32) -> Self {
        let inner = (0.5 * size - Vec3::splat(radius)).max(Vec3::ZERO);
        // Along each axis of a face: the slope of the sphere's direction, and the sign times the inner extent.
        let quarter = |i: u32| (i as f32 / round as f32 * std::f32::consts::FRAC_PI_4).tan();
        let mut steps: Vec<(f32, f32)> = (0..round).rev().map(|i| (-quarter(i + 1), -1.0)).collect();
        steps.extend((0..=flat).map(|i| (0.0, 2.0 * i as f32 / flat as f32 - 1.0)));
        steps.extend((0..round).map(|i| (quarter(i + 1), 1.0)));
        let n = steps.len() as u32;
        let mut shape = Self::default();
        // Columns are the face's u, v and outward axes.
        for axes in faces() {
            let base = shape.positions.len() as u32;
            for &(slope_v, side_v) in &steps {
                for &(slope_u, side_u) in &steps {
                    let normal: Vec3 = (axes * glam::Vec3A::new(slope_u, slope_v, 1.0)).normalize().into();
                    let core = Vec3::from(axes * glam::Vec3A::new(side_u, side_v, 1.0)) * inner;
                    let position = core + radius * normal;
                    let uv = Vec2::new(position.dot(axes.x_axis.into()), -position.dot(axes.y_axis.into()));
                    shape.vertex(position, normal, uv);
                }
            }
            let index = |i: u32, j: u32| base + j * n + i;
            for j in 0..n - 1 {
                for i in 0..n - 1 {
                    shape.quad_face([index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)]);
                }
            }
        }
        shape
    }
}

/// Right-handed (u, v, outward) axes of the six faces of a box, v upwards on the sides.
fn faces() -> [Mat3A; 6] {
    let face = |u: Vec3, v: Vec3| Mat3A::from_cols(u.into(), v.into(), u.cross(v).into());
    [
        face(Vec3::X, Vec3::Y),
        face(Vec3::NEG_X, Vec3::Y),
        face(Vec3::Z, Vec3::Y),
        face(Vec3::NEG_Z, Vec3::Y),
        face(Vec3::X, Vec3::NEG_Z),
        face(Vec3::X, Vec3::Z),
    ]
}

/// ∂u × ∂v by central differences; where one vanishes (a pole) it is taken a little further inside.
fn patch_normal(point: &impl Fn(f32, f32) -> Vec3, u: f32, v: f32) -> Vec3 {
    const STEP: f32 = 1e-3;
    for inward in [0.0, 0.01, 0.03] {
        let (u, v) = (u + (0.5 - u) * inward * 0.1, v + (0.5 - v) * inward);
        let du = point(u + STEP, v) - point(u - STEP, v);
        let dv = point(u, v + STEP) - point(u, v - STEP);
        let normal = du.cross(dv);
        if normal.length() > 1e-3 * du.length().max(dv.length()).powi(2) {
            return normal.normalize();
        }
    }
    Vec3::Y
}

/// A frame at `position` whose −Z looks along `yaw` turned about +Y (radians, counter-clockwise from above).
pub(crate) fn place(position: Vec3, yaw: f32) -> Affine3A {
    Affine3A::from_translation(position) * Affine3A::from_rotation_y(yaw)
}
