//! Rays in, hits out: accelerators, SIMD traversal and multi-level worlds.
//!
//! Build a [`TriangleBvh`] (or a [`KdTree`]) over the meshes of an object, put it (and placed copies of other objects) into an
//! [`Object`], and ask a [`World`] over the root object through [`RayQuery`]: tiles of rays with a common origin,
//! or any rays. [`Oracle`] answers the same questions by brute force, to check the rest against.
//!
//! Results are watertight within an object: no ray slips between triangles that share an edge or a vertex. Input
//! that is NaN, infinite or degenerate has a defined answer, stated with each type.
#![deny(unsafe_code)]

mod aabb;
mod build;
mod compact;
mod error;
mod isa;
mod kdtree;
mod layout;
mod mesh;
mod object;
mod oracle;
mod prefetch;
mod quadric;
mod query;
mod ray;
mod through;
mod tile;
mod traverse;
mod triangle_bvh;
mod triangles;
mod visits;
mod world;

pub use aabb::Aabb;
pub use build::{BuildOptions, Builder, Layout, Refit, RefitPolicy, TreeStats, watch::BuildProgress};
pub use error::{BuildError, IsaError};
pub use glam;
pub use isa::Isa;
pub use kdtree::{KdNode, KdNodeKind, KdOptions, KdSplit, KdStats, KdTree};
pub use mesh::Mesh;
pub use object::{Instance, InstanceChange, MAX_INSTANCE_DEPTH, Object, Update, UpdateKind};
pub use oracle::{NearHit, Oracle};
pub use quadric::{Quadric, QuadricPoint, Quadrics};
pub use query::RayQuery;
pub use ray::{Hit, PathId, Ray};
pub use through::SeeThrough;
pub use tile::Tile;
pub use triangle_bvh::TriangleBvh;
pub use triangles::Triangles;
pub use visits::Visits;
pub use world::{PathVisitor, ResolvedPath, World};
