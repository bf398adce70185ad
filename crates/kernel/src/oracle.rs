//! The brute-force oracle: every triangle, every instance, double precision. Too simple to be wrong.
use std::borrow::Cow;

use glam::{DAffine3, DVec3, Vec3};

use crate::{
    aabb::Aabb,
    object::{Object, double},
    query::RayQuery,
    ray::{Hit, PathId, Ray},
    tile::Tile,
    world::World,
};

/// Answers queries by testing each ray against each triangle of the expanded world in double precision.
///
/// Memory and time grow with the number of *expanded* triangles: for tests only.
///
/// # References
/// Möller and Trumbore 1997, "Fast, minimum storage ray/triangle intersection".
#[derive(Clone, Debug)]
pub struct Oracle {
    /// As the shutter opens.
    triangles: Vec<WorldTriangle>,
    /// The world to expand for each ray, if something in it moves.
    moving: Option<World>,
    bounds: Aabb,
}

#[derive(Clone, Copy, Debug)]
struct WorldTriangle {
    corners: [DVec3; 3],
    /// Unit normal by the inverse transpose of the placement.
    ng: Vec3,
    geometry: u32,
    primitive: u32,
    path: PathId,
}

impl Oracle {
    /// Expands `world` into a list of triangles in world space.
    #[must_use]
    pub fn new(world: &World) -> Self {
        let moving = world.has_motion().then(|| world.clone());
        Self { triangles: expanded(world, 0.0), moving, bounds: world.bounds() }
    }

    /// Number of expanded triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Every triangle that `ray` meets, in no order.
    #[must_use]
    pub fn all_hits(&self, ray: &Ray) -> Vec<Hit> {
        if !ray.is_valid() {
            return Vec::new();
        }
        self.at(ray).iter().filter_map(|triangle| triangle.intersect(ray)).collect()
    }

    /// Every triangle that `ray` meets or passes within `slack` (world units, across the ray), in no order, with
    /// how clear the case is. Triangles seen exactly edge-on are left out.
    #[must_use]
    pub fn near(&self, ray: &Ray, slack: f64) -> Vec<NearHit> {
        if !ray.is_valid() {
            return Vec::new();
        }
        self.at(ray).iter().filter_map(|triangle| triangle.near(ray, slack)).collect()
    }

    /// The triangles at the time of `ray`.
    fn at(&self, ray: &Ray) -> Cow<'_, [WorldTriangle]> {
        match &self.moving {
            Some(world) => Cow::Owned(expanded(world, ray.clamped_time())),
            None => Cow::Borrowed(&self.triangles),
        }
    }

    fn closest(&self, ray: &Ray) -> Hit {
        self.all_hits(ray).into_iter().min_by(|a, b| a.t.total_cmp(&b.t)).unwrap_or(Hit::MISS)
    }

    fn any(&self, ray: &Ray) -> bool {
        ray.is_valid() && self.at(ray).iter().any(|triangle| triangle.intersect(ray).is_some())
    }
}

/// A hit with how clear it is: the measure for comparing single with double precision.
#[derive(Clone, Copy, Debug)]
pub struct NearHit {
    /// The intersection with the triangle's plane; barycentrics may lie outside 0..=1.
    pub hit: Hit,
    /// Distance of that point from the nearest edge in the plane, world units; negative outside the triangle.
    pub margin: f64,
    /// |cos| of the angle between ray and normal.
    pub cosine: f64,
}

/// All triangles of the world at a moment in the shutter interval.
fn expanded(world: &World, time: f32) -> Vec<WorldTriangle> {
    let mut triangles = Vec::new();
    expand(world.root(), &DAffine3::IDENTITY, time, 0, &mut triangles);
    triangles
}

fn expand(object: &Object, world_from_object: &DAffine3, time: f32, path: u64, out: &mut Vec<WorldTriangle>) {
    if let Some(tree) = &object.triangles {
        let normal_from_object = world_from_object.matrix3.inverse().transpose();
        tree.for_each(time, |(corners, triangle)| {
            let [a, b, c] = corners.map(|p| Vec3::from_array(p).as_dvec3());
            let (geometry, primitive) = tree.locate(triangle);
            let ng = (normal_from_object * (b - a).cross(c - a).normalize()).normalize().as_vec3();
            let corners = [a, b, c].map(|p| world_from_object.transform_point3(p));
            out.push(WorldTriangle { corners, ng, geometry, primitive, path: PathId(path) });
        });
    }
    for child in &object.instances {
        let world_from_child = *world_from_object * double(&child.instance.parent_from_object_at(time));
        expand(&child.instance.object, &world_from_child, time, path + child.path_offset, out);
    }
}

impl WorldTriangle {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let (t, u, v) = self.plane_hit(ray)?;
        let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        let valid = inside && t > f64::from(ray.t_min.max(0.0)) && t < f64::from(ray.t_max);
        valid.then(|| self.hit(t, u, v))
    }

    fn near(&self, ray: &Ray, slack: f64) -> Option<NearHit> {
        let (t, u, v) = self.plane_hit(ray)?;
        let [p0, p1, p2] = self.corners;
        let normal = (p1 - p0).cross(p2 - p0);
        let direction = ray.direction.as_dvec3();
        let cosine = (normal.dot(direction) / (normal.length() * direction.length())).abs();
        // A barycentric weight times the height over its edge is the distance from that edge.
        let heights = [p2 - p1, p0 - p2, p1 - p0].map(|edge| normal.length() / edge.length());
        let weights = [1.0 - u - v, u, v];
        let margin = (0..3).map(|i| weights[i] * heights[i]).fold(f64::INFINITY, f64::min);
        let reach = slack / cosine;
        let along = reach / direction.length();
        let valid =
            margin >= -reach && t + along > f64::from(ray.t_min.max(0.0)) && t - along < f64::from(ray.t_max);
        valid.then(|| NearHit { hit: self.hit(t, u, v), margin, cosine })
    }

    fn hit(&self, t: f64, u: f64, v: f64) -> Hit {
        let (geometry, primitive, path) = (self.geometry, self.primitive, self.path);
        Hit { t: t as f32, u: u as f32, v: v as f32, ng: self.ng, geometry, primitive, path }
    }

    /// Where the ray meets the triangle's plane: (t, u, v), or `None` if it runs along it.
    fn plane_hit(&self, ray: &Ray) -> Option<(f64, f64, f64)> {
        let [p0, p1, p2] = self.corners;
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let (e1, e2) = (p1 - p0, p2 - p0);
        let p = direction.cross(e2);
        let determinant = e1.dot(p);
        if determinant == 0.0 {
            return None;
        }
        let s = origin - p0;
        let u = s.dot(p) / determinant;
        let q = s.cross(e1);
        let v = direction.dot(q) / determinant;
        let t = e2.dot(q) / determinant;
        Some((t, u, v))
    }
}

impl RayQuery for Oracle {
    fn intersect_tile(&self, tile: &Tile, hits: &mut [Hit]) {
        for (i, hit) in hits.iter_mut().enumerate().take(tile.len()) {
            *hit = tile.ray(i).map_or(Hit::MISS, |ray| self.closest(&ray));
        }
    }

    fn occluded_tile(&self, tile: &Tile, occluded: &mut [bool]) {
        for (i, out) in occluded.iter_mut().enumerate().take(tile.len()) {
            *out = tile.ray(i).is_some_and(|ray| self.any(&ray));
        }
    }

    fn intersect(&self, rays: &[Ray], hits: &mut [Hit]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.closest(ray);
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        for (ray, out) in rays.iter().zip(occluded) {
            *out = self.any(ray);
        }
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }
}
