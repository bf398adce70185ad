//! Our side of the comparison: the named builds, and rays through the kernel's interface.

use std::sync::Arc;

use heliostat::kernel::{
    BuildOptions, Hit, Isa, Layout, Mesh, Object, RayQuery, TriangleBvh, Triangles, World,
};

use super::embree;
use super::rays::{Item, Query, RaySet};
use crate::measure::{ITEM, Slots, Tracer};

/// A builder's preset.
pub(super) struct NamedBuild {
    pub(super) name: &'static str,
    options: BuildOptions,
    /// Whether rays are traced through it: the fastest of these counts.
    pub(super) traced: bool,
    /// Whether the tree reads the vertices from the mesh, whose bytes then count as well.
    pub(super) shares_mesh: bool,
    /// The peer's build that it is held against.
    pub(super) counterpart: embree::Build,
}

/// All builds that are measured; the first is the default.
pub(super) fn builds() -> Vec<NamedBuild> {
    let compact = BuildOptions { layout: Layout::Compact, ..BuildOptions::default() };
    vec![
        NamedBuild {
            name: "default",
            options: BuildOptions::default(),
            traced: true,
            shares_mesh: false,
            counterpart: embree::Build::MEDIUM,
        },
        NamedBuild {
            name: "quality",
            options: BuildOptions::quality(),
            traced: true,
            shares_mesh: false,
            counterpart: embree::Build::HIGH,
        },
        NamedBuild {
            name: "fast",
            options: BuildOptions::fast(),
            traced: false,
            shares_mesh: false,
            counterpart: embree::Build::LOW,
        },
        NamedBuild {
            name: "compact",
            options: compact,
            traced: false,
            shares_mesh: true,
            counterpart: embree::Build::MEDIUM_COMPACT,
        },
    ]
}

impl NamedBuild {
    /// Builds a tree on the current pool: the part that is timed.
    ///
    /// # Errors
    /// When the mesh cannot be built.
    pub(super) fn build(&self, mesh: &Mesh) -> Result<TriangleBvh, String> {
        TriangleBvh::build(std::slice::from_ref(mesh), &self.options).map_err(|error| error.to_string())
    }
}

/// A built tree that can be asked.
pub(super) struct Ours {
    pub(super) build: &'static str,
    pub(super) world: World,
}

impl Ours {
    /// # Errors
    /// When the mesh cannot be built or the instruction set is missing.
    pub(super) fn new(mesh: &Mesh, build: &NamedBuild, isa: Isa) -> Result<Self, String> {
        Ok(Self { build: build.name, world: world(build.build(mesh)?.into(), isa)? })
    }
}

/// A world of one tree.
///
/// # Errors
/// When the instruction set is missing.
pub(super) fn world(tree: Triangles, isa: Isa) -> Result<World, String> {
    let object = Object::new(Some(tree), Vec::new()).map_err(|e| e.to_string())?;
    World::with_isa(Arc::new(object), isa).map_err(|e| e.to_string())
}

/// A world and the rays to ask it with.
pub(super) struct OurRays<'a> {
    pub(super) world: &'a dyn RayQuery,
    pub(super) set: &'a RaySet,
}

impl Tracer for OurRays<'_> {
    fn items(&self) -> usize {
        self.set.items.len()
    }

    fn trace(&self, first: usize, count: usize, out: Slots<'_>) {
        let items = &self.set.items[first..first + count];
        match self.set.kind.query() {
            Query::Closest => {
                let mut hits = [Hit::MISS; ITEM];
                let slots = out.t.chunks_mut(ITEM).zip(out.primitive.chunks_mut(ITEM));
                for (item, (t, primitive)) in items.iter().zip(slots) {
                    let hits = &mut hits[..item.len()];
                    match item {
                        Item::Tile(tile) => self.world.intersect_tile(tile, hits),
                        Item::Batch(rays) => self.world.intersect(rays, hits),
                    }
                    for ((hit, t), primitive) in hits.iter().zip(t).zip(primitive) {
                        (*t, *primitive) = (hit.t, hit.primitive);
                    }
                }
            }
            Query::Any => {
                for (item, out) in items.iter().zip(out.occluded.chunks_mut(ITEM)) {
                    match item {
                        Item::Tile(tile) => self.world.occluded_tile(tile, &mut out[..item.len()]),
                        Item::Batch(rays) => self.world.occluded(rays, &mut out[..item.len()]),
                    }
                }
            }
        }
    }
}
