//! Worlds: a root object, an instruction set, and the way back from path ids to transforms.
use std::sync::Arc;

use fearless_simd::Level;
use glam::Affine3A;

use crate::{
    aabb::Aabb,
    error::IsaError,
    isa::Isa,
    object::Object,
    query::RayQuery,
    ray::{Hit, PathId, Ray},
    through::{SeeThrough, Shadows},
    tile::Tile,
    traverse,
};

/// A root object ready to be asked with rays. Cheap to make and to clone: everything below it is shared.
///
/// ```
/// use std::sync::Arc;
/// use glam::Vec3;
/// use heliostat_kernel::{BuildOptions, Hit, Mesh, Object, Ray, RayQuery, TriangleBvh, World};
///
/// let mesh = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
/// let tree = TriangleBvh::build(&[mesh], &BuildOptions::default())?;
/// let world = World::new(Arc::new(Object::new(Some(tree.into()), Vec::new())?));
/// let mut hits = [Hit::MISS];
/// world.intersect(&[Ray::new(Vec3::new(0.25, 0.25, 2.0), Vec3::NEG_Z)], &mut hits);
/// assert_eq!((hits[0].t, hits[0].u, hits[0].v, hits[0].ng), (2.0, 0.25, 0.25, Vec3::Z));
/// # Ok::<(), heliostat_kernel::BuildError>(())
/// ```
#[derive(Clone, Debug)]
pub struct World {
    root: Arc<Object>,
    isa: Isa,
    level: Level,
}

/// Called with (path, world from object, instance tags outermost first, object).
pub type PathVisitor<'a> = dyn FnMut(PathId, &Affine3A, &[u32], &Object) + 'a;

/// What a path id stands for.
#[derive(Clone, Debug)]
pub struct ResolvedPath<'a> {
    /// From the object's space to world space.
    pub world_from_object: Affine3A,
    /// From world space to the object's space.
    pub object_from_world: Affine3A,
    /// The tags of the instances passed through, outermost first; empty for the root.
    pub ids: Vec<u32>,
    /// The object at the end of the path.
    pub object: &'a Arc<Object>,
}

impl World {
    /// A world over `root`, whose space is world space.
    ///
    /// The instruction set is the one that `HELIOSTAT_ISA` forces, otherwise the best. A value that is unknown or
    /// that this machine cannot run is passed over here; a program that wants to report it asks
    /// [`Isa::from_env`] at its start.
    #[must_use]
    pub fn new(root: Arc<Object>) -> Self {
        let forced = Isa::from_env().ok().flatten();
        let isa = forced.unwrap_or_else(Isa::best);
        let level = isa.checked_level().unwrap_or_else(|_| Level::baseline());
        Self { root, isa, level }
    }

    /// A world that runs on one instruction set, whatever the environment says.
    ///
    /// # Errors
    /// [`IsaError::Unavailable`] if this machine cannot run it.
    pub fn with_isa(root: Arc<Object>, isa: Isa) -> Result<Self, IsaError> {
        Ok(Self { root, isa, level: isa.checked_level()? })
    }

    /// A world with nothing in it.
    #[must_use]
    pub fn empty() -> Self {
        Self::new(Arc::new(Object::empty()))
    }

    /// The instruction set in use.
    #[must_use]
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// The root object.
    #[must_use]
    pub fn root(&self) -> &Arc<Object> {
        &self.root
    }

    /// The root object, to be changed: in place where this world alone holds it, else in a copy.
    pub fn root_mut(&mut self) -> &mut Object {
        Arc::make_mut(&mut self.root)
    }

    /// The box around everything, world space; empty for an empty world.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.root.bounds()
    }

    /// Number of nodes of the expanded instance tree: path ids are smaller.
    #[must_use]
    pub fn path_count(&self) -> u64 {
        self.root.path_count()
    }

    /// Whether anything moves while the shutter is open, so that the times of rays count.
    #[must_use]
    pub fn has_motion(&self) -> bool {
        self.root.has_motion()
    }

    /// Walks from the root down to the object that `path` names, as placed when the shutter opens; `None` if there is no
    /// such path. Costs one binary search per level.
    #[must_use]
    pub fn resolve(&self, path: PathId) -> Option<ResolvedPath<'_>> {
        self.resolve_at(path, 0.0)
    }

    /// As [`World::resolve`], at a moment in the shutter interval from 0 to 1. A placement that has no inverse then is
    /// inverted as when the shutter opens: no ray passes it.
    #[must_use]
    pub fn resolve_at(&self, path: PathId, time: f32) -> Option<ResolvedPath<'_>> {
        if path.0 >= self.path_count() {
            return None;
        }
        let mut resolved = ResolvedPath {
            world_from_object: Affine3A::IDENTITY,
            object_from_world: Affine3A::IDENTITY,
            ids: Vec::new(),
            object: &self.root,
        };
        let mut rest = path.0;
        while rest > 0 {
            let children = &resolved.object.instances;
            let index = children.partition_point(|c| c.path_offset <= rest).checked_sub(1)?;
            let child = &children[index];
            rest -= child.path_offset;
            let moved = child.instance.motion.and_then(|_| child.at(time));
            let object_from_parent = moved.map_or(child.object_from_parent, |(inverse, _)| inverse);
            resolved.world_from_object *= child.instance.parent_from_object_at(time);
            resolved.object_from_world = object_from_parent * resolved.object_from_world;
            resolved.ids.push(child.instance.id);
            resolved.object = &child.instance.object;
        }
        Some(resolved)
    }

    /// Calls `visit` for every node of the expanded instance tree, in the order of path ids. The number of calls is [`World::path_count`], which
    /// sharing can make astronomic: look first.
    pub fn for_each_path(&self, visit: &mut PathVisitor<'_>) {
        visit_below(&self.root, PathId::ROOT, &Affine3A::IDENTITY, &mut Vec::new(), visit);
    }
}

fn visit_below(
    object: &Object,
    path: PathId,
    world_from_object: &Affine3A,
    ids: &mut Vec<u32>,
    visit: &mut PathVisitor<'_>,
) {
    visit(path, world_from_object, ids, object);
    for child in &object.instances {
        let world_from_child = *world_from_object * child.instance.parent_from_object;
        ids.push(child.instance.id);
        let below = PathId(path.0 + child.path_offset);
        visit_below(&child.instance.object, below, &world_from_child, ids, visit);
        ids.pop();
    }
}

impl RayQuery for World {
    fn intersect_tile(&self, tile: &Tile, hits: &mut [Hit]) {
        traverse::intersect_tile(self.level, &self.root, tile, hits);
    }

    fn occluded_tile(&self, tile: &Tile, occluded: &mut [bool]) {
        let shadows = Shadows { through: None, occluded, filtered: &mut [] };
        traverse::occluded_tile(self.level, &self.root, tile, shadows);
    }

    fn intersect(&self, rays: &[Ray], hits: &mut [Hit]) {
        traverse::intersect(self.level, &self.root, rays, hits);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        let shadows = Shadows { through: None, occluded, filtered: &mut [] };
        traverse::occluded(self.level, &self.root, rays, shadows);
    }

    fn occluded_tile_through(
        &self,
        tile: &Tile,
        through: &dyn SeeThrough,
        occluded: &mut [bool],
        filtered: &mut [bool],
    ) {
        let shadows = Shadows::past(through, occluded, filtered);
        traverse::occluded_tile(self.level, &self.root, tile, shadows);
    }

    fn occluded_through(
        &self,
        rays: &[Ray],
        through: &dyn SeeThrough,
        occluded: &mut [bool],
        filtered: &mut [bool],
    ) {
        let shadows = Shadows::past(through, occluded, filtered);
        traverse::occluded(self.level, &self.root, rays, shadows);
    }

    fn bounds(&self) -> Aabb {
        self.root.bounds()
    }
}
