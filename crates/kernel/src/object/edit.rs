//! Changes to an object that is already there, other than moving its instances.
use std::sync::{Arc, LazyLock};

use super::{Instance, Object};
use crate::{
    build::{Refit, RefitPolicy},
    error::BuildError,
    mesh::Mesh,
    quadric::Quadrics,
    triangles::Triangles,
};

/// Stands in for released children.
static EMPTY: LazyLock<Arc<Object>> = LazyLock::new(|| Arc::new(Object::empty()));

impl Object {
    /// Instance `index` in the order given.
    #[must_use]
    pub fn instance(&self, index: usize) -> Option<&Instance> {
        self.instances.get(index).map(|placed| &placed.instance)
    }

    /// What the path id grows by on the way down into instance `index`.
    #[must_use]
    pub fn path_offset(&self, index: usize) -> Option<u64> {
        self.instances.get(index).map(|placed| placed.path_offset)
    }

    /// Replaces the object's own triangles; its instances stay.
    pub fn set_triangles(&mut self, triangles: Option<Triangles>) {
        self.triangles = triangles;
        self.unite_bounds();
        self.look_for_motion();
    }

    /// Replaces the object's own spheres and cones; all else stays.
    pub fn set_quadrics(&mut self, quadrics: Option<Arc<Quadrics>>) {
        self.quadrics = quadrics;
        self.unite_bounds();
    }

    /// Moves the vertices of the object's own triangles, as [`TriangleBvh::follow`](crate::TriangleBvh::follow): in
    /// place where no other object shares the tree, else in a copy. `None` if the object has no [`Triangles::Bvh`].
    ///
    /// # Errors
    /// Those of `TriangleBvh::follow`; the object is then as it was.
    pub fn follow(&mut self, meshes: &[Mesh], policy: &RefitPolicy) -> Result<Option<Refit>, BuildError> {
        let Some(Triangles::Bvh(tree)) = &mut self.triangles else { return Ok(None) };
        let refit = Arc::make_mut(tree).follow(meshes, policy)?;
        self.unite_bounds();
        self.look_for_motion();
        Ok(Some(refit))
    }

    /// Hands out the object that instance `index` places and leaves an empty one in its place, so that whoever else
    /// holds it can change it without a copy. The way back is [`Object::update`]; until then the instance's box stands
    /// in the tree with nothing to hit in it.
    pub fn release(&mut self, index: usize) -> Option<Arc<Self>> {
        let placed = self.instances.get_mut(index)?;
        Some(std::mem::replace(&mut placed.instance.object, EMPTY.clone()))
    }
}
