//! Rays and hits: the vocabulary of every query.
use glam::Vec3;

/// A half-line with a valid interval: a hit counts if `t_min < t < t_max`.
///
/// Space: that of the [`World`](crate::World) asked. `t` is measured in lengths of `direction`, which need not
/// be a unit vector. A negative `t_min` counts as zero. A ray with a NaN or infinite origin or direction, a zero
/// direction, or a NaN interval hits nothing; neither does one that starts beyond ±1e10 or whose direction's largest
/// component lies outside 1e-12..=1e12, where single-precision products would overflow or vanish. A time outside 0..=1
/// is moved to the nearer end; NaN counts as 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start point.
    pub origin: Vec3,
    /// Smallest parameter, excluded.
    pub t_min: f32,
    /// Direction, of any length but zero.
    pub direction: Vec3,
    /// Largest parameter, excluded; may be infinite.
    pub t_max: f32,
    /// The moment in the shutter interval at which the ray sees the world: 0 when the shutter opens, 1 when it closes.
    pub time: f32,
}

impl Ray {
    /// A ray over `0 < t < ∞`, at time 0.
    #[must_use]
    pub const fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, t_min: 0.0, direction, t_max: f32::INFINITY, time: 0.0 }
    }

    /// The ray over the open segment from `from` to `to`: `t` runs from 0 to 1; at time 0.
    #[must_use]
    pub fn segment(from: Vec3, to: Vec3) -> Self {
        Self { origin: from, t_min: 0.0, direction: to - from, t_max: 1.0, time: 0.0 }
    }

    /// The same ray at another moment in the shutter interval, 0 to 1.
    #[must_use]
    pub const fn at_time(self, time: f32) -> Self {
        Self { time, ..self }
    }

    /// The time that counts: in 0..=1.
    #[inline(always)]
    pub(crate) const fn clamped_time(&self) -> f32 {
        // In this order, so that NaN becomes 0.
        self.time.max(0.0).min(1.0)
    }

    /// The point `origin + t · direction`.
    #[must_use]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }

    /// True if the ray can hit anything at all; see the type's documentation.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.origin.is_finite()
            && self.direction.is_finite()
            && self.direction != Vec3::ZERO
            && self.t_min.max(0.0) < self.t_max
            && !self.t_min.is_nan()
    }
}

/// The way from the root object through nested instances to the object that was hit, in eight bytes.
///
/// It is the index of that object in the depth-first preorder of the fully expanded instance tree, which is
/// never built: on the way down into child `k` the id grows by 1 plus the sizes of the subtrees of the earlier
/// siblings. [`World::resolve`](crate::World::resolve) walks it back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PathId(pub u64);

impl PathId {
    /// The root object itself.
    pub const ROOT: Self = Self(0);
}

/// What a ray met first, or [`Hit::MISS`].
///
/// Where surfaces coincide, that is the least in the order (`t`, `path`, `geometry`, `primitive`), `t` as it stands here,
/// which is a function of ray, path and triangle alone. It does not depend on how a tree was built, refitted or updated,
/// nor on which rays were asked together. (Within one object, or a part of it at which its instance is entered, the
/// triangles are first compared by a coarser distance; of those that are equal in it, bit for bit, the least number
/// counts. Two that coincide without being equal may so be taken for each other as far as rounding goes, as may
/// neighbours by a ray through their edge.)
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter, in lengths of the ray's direction; `+∞` for a miss.
    pub t: f32,
    /// Barycentric weight of vertex 1, in 0..=1: `p = (1−u−v) p0 + u p1 + v p2`.
    pub u: f32,
    /// Barycentric weight of vertex 2, in 0..=1.
    pub v: f32,
    /// Unit geometric normal in world space, on the side from which the vertices are seen counter-clockwise in
    /// object space: a mirrored instance keeps its physical front side. Zero for a miss.
    pub ng: Vec3,
    /// Index of the mesh inside its object; `u32::MAX` for a miss.
    pub geometry: u32,
    /// Index of the triangle inside that mesh; `u32::MAX` for a miss.
    pub primitive: u32,
    /// The instance path to the object.
    pub path: PathId,
}

impl Hit {
    /// The answer of a ray that hits nothing.
    pub const MISS: Self = Self {
        t: f32::INFINITY,
        u: 0.0,
        v: 0.0,
        ng: Vec3::ZERO,
        geometry: u32::MAX,
        primitive: u32::MAX,
        path: PathId::ROOT,
    };

    /// Whether this hit is the one to keep of two on one ray: the nearer; of two equally near, the one with the lesser
    /// (path, geometry, primitive). So the closest hit is one and the same in whatever order a tree is walked.
    #[inline(always)]
    pub(crate) fn precedes(&self, other: &Self) -> bool {
        if self.t != other.t {
            return self.t < other.t;
        }
        (self.path, self.geometry, self.primitive) < (other.path, other.geometry, other.primitive)
    }

    /// True if something was hit.
    #[must_use]
    pub const fn is_hit(&self) -> bool {
        self.geometry != u32::MAX
    }

    /// Whether both are on one mesh of one object at one place, or both misses.
    #[must_use]
    pub fn is_on_part_of(&self, other: &Self) -> bool {
        (self.path, self.geometry) == (other.path, other.geometry)
    }
}

impl Default for Hit {
    fn default() -> Self {
        Self::MISS
    }
}
