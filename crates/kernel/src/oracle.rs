//! The brute-force oracle: every triangle, every instance, double precision. Too simple to be wrong.
use std::borrow::Cow;

use glam::{DAffine3, DMat3, DVec3, Vec3};

use crate::{
    aabb::Aabb,
    object::{Object, double},
    quadric::Quadric,
    query::RayQuery,
    ray::{Hit, PathId, Ray},
    through::{Panes, SeeThrough},
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
    still: Expanded,
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
        Self { still: Expanded::new(world, 0.0), moving, bounds: world.bounds() }
    }

    /// Number of expanded triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.still.triangles.len()
    }

    /// Every triangle that `ray` meets, and every crossing with a sphere or cone, in no order.
    #[must_use]
    pub fn all_hits(&self, ray: &Ray) -> Vec<Hit> {
        if !ray.is_valid() {
            return Vec::new();
        }
        let shapes = self.at(ray);
        let quadrics = shapes.quadrics.iter().flat_map(|quadric| quadric.intersect(ray));
        shapes.triangles.iter().filter_map(|triangle| triangle.intersect(ray)).chain(quadrics).collect()
    }

    /// Every triangle that `ray` meets or passes within `slack` (world units, across the ray), in no order, with
    /// how clear the case is. Triangles seen exactly edge-on are left out.
    #[must_use]
    pub fn near(&self, ray: &Ray, slack: f64) -> Vec<NearHit> {
        if !ray.is_valid() {
            return Vec::new();
        }
        self.at(ray).triangles.iter().filter_map(|triangle| triangle.near(ray, slack)).collect()
    }

    /// The triangles at the time of `ray`.
    fn at(&self, ray: &Ray) -> Cow<'_, Expanded> {
        match &self.moving {
            Some(world) => Cow::Owned(Expanded::new(world, ray.clamped_time())),
            None => Cow::Borrowed(&self.still),
        }
    }

    fn closest(&self, ray: &Ray) -> Hit {
        self.all_hits(ray)
            .into_iter()
            .fold(Hit::MISS, |best, hit| if hit.precedes(&best) { hit } else { best })
    }

    fn any(&self, ray: &Ray) -> bool {
        !self.all_hits(ray).is_empty()
    }

    /// Whether something stops a ray, and whether else something does not that it meets.
    fn any_through(&self, ray: &Ray, through: &dyn SeeThrough) -> (bool, bool) {
        let hits = self.all_hits(ray);
        let lets_through = |hit: &Hit| Panes::of(Some(through), hit.path).has(hit.geometry);
        let occluded = !hits.iter().all(lets_through);
        (occluded, !occluded && !hits.is_empty())
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

/// All shapes of the world at a moment in the shutter interval.
#[derive(Clone, Debug, Default)]
struct Expanded {
    triangles: Vec<WorldTriangle>,
    quadrics: Vec<WorldQuadric>,
}

impl Expanded {
    fn new(world: &World, time: f32) -> Self {
        let mut expanded = Self::default();
        expanded.add(world.root(), &DAffine3::IDENTITY, time, 0);
        expanded
    }

    fn add(&mut self, object: &Object, world_from_object: &DAffine3, time: f32, path: u64) {
        let normal_from_object = world_from_object.matrix3.inverse().transpose();
        let place = PathId(path);
        if let Some(tree) = &object.triangles {
            tree.for_each(time, |(corners, triangle)| {
                let [a, b, c] = corners.map(|p| Vec3::from_array(p).as_dvec3());
                let (geometry, primitive) = tree.locate(triangle);
                let ng = (normal_from_object * (b - a).cross(c - a).normalize()).normalize().as_vec3();
                let corners = [a, b, c].map(|p| world_from_object.transform_point3(p));
                self.triangles.push(WorldTriangle { corners, ng, geometry, primitive, path: place });
            });
        }
        if let Some(tree) = &object.quadrics {
            let object_from_world = world_from_object.inverse();
            let shapes = tree.shapes.iter().zip(&tree.names);
            let shapes = shapes.filter(|(shape, _)| !shape.bounds().is_empty());
            self.quadrics.extend(shapes.map(|(&shape, &name)| WorldQuadric {
                shape,
                object_from_world,
                normal_from_object,
                name,
                path: place,
            }));
        }
        for child in &object.instances {
            let world_from_child = *world_from_object * double(&child.instance.parent_from_object_at(time));
            self.add(&child.instance.object, &world_from_child, time, path + child.path_offset);
        }
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

/// A quadric as it lies in its object; rays are brought there.
#[derive(Clone, Copy, Debug)]
struct WorldQuadric {
    shape: Quadric,
    object_from_world: DAffine3,
    normal_from_object: DMat3,
    /// (geometry, primitive).
    name: (u32, u32),
    path: PathId,
}

impl WorldQuadric {
    /// The implicit function, negative inside: distances from the centre, or from the axis, less the radius, squared.
    fn value(&self, p: DVec3) -> f64 {
        match self.shape {
            Quadric::Sphere { center, radius } => {
                (p - center.as_dvec3()).length_squared() - f64::from(radius).powi(2)
            }
            Quadric::Cone { .. } => {
                let (height, radius) = self.on_axis(p);
                let (base, axis) = self.axis();
                (p - base - axis * height).length_squared() - radius * radius
            }
        }
    }

    /// Base and unit axis of a cone.
    fn axis(&self) -> (DVec3, DVec3) {
        let Quadric::Cone { base, apex, .. } = self.shape else { return (DVec3::ZERO, DVec3::ZERO) };
        (base.as_dvec3(), (apex.as_dvec3() - base.as_dvec3()).normalize())
    }

    /// Height of a point over a cone's base, and the cone's radius there.
    fn on_axis(&self, p: DVec3) -> (f64, f64) {
        let Quadric::Cone { base, base_radius, apex, apex_radius } = self.shape else { return (0.0, 0.0) };
        let (from, axis) = self.axis();
        let height = (p - from).dot(axis);
        let length = (apex.as_dvec3() - base.as_dvec3()).length();
        let radius = |r: f32| f64::from(r.abs());
        (height, radius(base_radius) + (radius(apex_radius) - radius(base_radius)) * height / length)
    }

    /// The crossings in the ray's interval. The quadratic is read off three values of the implicit function.
    fn intersect(&self, ray: &Ray) -> Vec<Hit> {
        let origin = self.object_from_world.transform_point3(ray.origin.as_dvec3());
        let direction = self.object_from_world.transform_vector3(ray.direction.as_dvec3());
        // Steps of the size of the distance: the values then differ in their leading digits.
        let Aabb { min, max } = self.shape.bounds();
        let middle = 0.5 * (min.as_dvec3() + max.as_dvec3());
        let nearest = (middle - origin).dot(direction) / direction.length_squared();
        let step = (max - min).as_dvec3().length() / direction.length();
        let at = |s: f64| self.value(origin + direction * (nearest + s * step));
        let (below, mid, above) = (at(-1.0), at(0.0), at(1.0));
        let (a, b) = (0.5 * (above + below) - mid, 0.5 * (above - below));
        let root = (b * b - 4.0 * a * mid).sqrt();
        let hit = |s: f64| {
            let t = nearest + s * step;
            let p = origin + direction * t;
            let inside = match self.shape {
                Quadric::Sphere { .. } => true,
                Quadric::Cone { base, apex, .. } => {
                    let length = (apex.as_dvec3() - base.as_dvec3()).length();
                    (0.0..=length).contains(&self.on_axis(p).0)
                }
            };
            let valid = inside && t > f64::from(ray.t_min.max(0.0)) && t < f64::from(ray.t_max);
            valid.then(|| self.hit(t, p))
        };
        [(-b - root) / (2.0 * a), (-b + root) / (2.0 * a)].into_iter().filter_map(hit).collect()
    }

    fn hit(&self, t: f64, p: DVec3) -> Hit {
        // The gradient, by differences that are exact for quadratic functions.
        let h = 0.25 * f64::from((self.shape.bounds().size()).max_element());
        let slope = |axis: DVec3| self.value(p + axis * h) - self.value(p - axis * h);
        let gradient = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
        let outwards = match self.shape {
            Quadric::Sphere { radius, .. } => radius > 0.0,
            Quadric::Cone { base_radius, apex_radius, .. } => base_radius + apex_radius > 0.0,
        };
        let ng = (self.normal_from_object * if outwards { gradient } else { -gradient }).normalize();
        let (geometry, primitive) = self.name;
        let [u, v] = self.shape.coordinates(p - self.shape.middle());
        Hit { t: t as f32, u, v, ng: ng.as_vec3(), geometry, primitive, path: self.path }
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

    fn occluded_tile_through(
        &self,
        tile: &Tile,
        through: &dyn SeeThrough,
        occluded: &mut [bool],
        filtered: &mut [bool],
    ) {
        let rays: Vec<Ray> = (0..tile.len()).filter_map(|i| tile.ray(i)).collect();
        self.occluded_through(&rays, through, occluded, filtered);
    }

    fn occluded_through(
        &self,
        rays: &[Ray],
        through: &dyn SeeThrough,
        occluded: &mut [bool],
        filtered: &mut [bool],
    ) {
        for (ray, answer) in rays.iter().zip(occluded.iter_mut().zip(filtered)) {
            (*answer.0, *answer.1) = self.any_through(ray, through);
        }
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }
}
