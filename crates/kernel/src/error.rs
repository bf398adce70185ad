//! The errors of the kernel: who is at fault, where, and the limit that was passed.
use thiserror::Error;

use crate::isa::Isa;

/// Why a tree or an object could not be built. Nothing is left half built.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum BuildError {
    /// A triangle names a vertex that does not exist.
    #[error(
        "mesh {mesh}, triangle {triangle}: vertex index {index} is out of range (the mesh has {vertices} vertices)"
    )]
    IndexOutOfRange {
        /// Index of the mesh in the list given.
        mesh: usize,
        /// Index of the triangle in that mesh.
        triangle: usize,
        /// The offending vertex index.
        index: u32,
        /// Number of vertices of that mesh.
        vertices: usize,
    },
    /// More triangles than a tree can number.
    #[error(
        "{count} triangles are too many for one object (the limit is {limit}); split it into several objects"
    )]
    TooManyTriangles {
        /// Triangles given, over all meshes.
        count: u64,
        /// Largest number allowed.
        limit: u64,
    },
    /// More instances than an object can number.
    #[error(
        "{count} instances are too many for one object (the limit is {limit}); group them into nested objects"
    )]
    TooManyInstances {
        /// Instances given.
        count: u64,
        /// Largest number allowed.
        limit: u64,
    },
    /// More spheres and cones in one object than a tree can number.
    #[error("{count} spheres and cones in one object (the limit is {limit}); split it")]
    TooManyQuadrics {
        /// Shapes given.
        count: u64,
        /// Largest number allowed.
        limit: u64,
    },
    /// A transform with NaN or infinite entries, or whose inverse has some.
    #[error("instance {instance}: the transform or its inverse is not finite")]
    NonFiniteTransform {
        /// Index of the instance in the list given.
        instance: usize,
    },
    /// A transform that flattens space and so has no inverse.
    #[error(
        "instance {instance}: the transform is singular (it flattens space), rays cannot be carried through it"
    )]
    SingularTransform {
        /// Index of the instance in the list given.
        instance: usize,
    },
    /// Instances nested too deeply.
    #[error("instance {instance}: nested {depth} levels deep (the limit is {limit}); flatten some levels")]
    TooDeep {
        /// Index of the instance in the list given.
        instance: usize,
        /// Depth that the new object would have.
        depth: usize,
        /// Largest depth allowed.
        limit: usize,
    },
    /// The expanded instance tree has more nodes than a path id can number.
    #[error(
        "instance {instance}: the expanded instance tree has 2^64 or more paths; share less or flatten some levels"
    )]
    TooManyPaths {
        /// Index of the instance in the list given at which the count overflowed.
        instance: usize,
    },
    /// A refit with another number of meshes than the tree was built over.
    #[error("{given} meshes given for a tree built over {built}; build a new tree when meshes come or go")]
    MeshCountChanged {
        /// Meshes that the tree was built over.
        built: usize,
        /// Meshes given.
        given: usize,
    },
    /// A refit with another number of triangles than the tree was built over.
    #[error(
        "mesh {mesh}: {given} triangles given for a tree built over {built}; build a new tree when triangles come or go"
    )]
    TriangleCountChanged {
        /// Index of the mesh in the list given.
        mesh: usize,
        /// Triangles of it that the tree was built over.
        built: usize,
        /// Triangles given.
        given: usize,
    },
    /// An update of an instance that the object does not have.
    #[error("change {change}: there is no instance {instance} (the object has {count})")]
    NoSuchInstance {
        /// Index of the change in the list given.
        change: usize,
        /// The instance named.
        instance: usize,
        /// Number of instances of the object.
        count: usize,
    },
    /// An update whose changes do not name their instances in rising order, each once.
    #[error("change {change}: instances must be named in rising order, each once; sort the changes")]
    UnorderedChanges {
        /// Index of the first change that is out of order.
        change: usize,
    },
    /// A moving mesh whose two lists of positions differ in length.
    #[error(
        "mesh {mesh}: {motion} positions when the shutter closes for {positions} when it opens; give as many"
    )]
    MotionLength {
        /// Index of the mesh in the list given.
        mesh: usize,
        /// Positions when the shutter opens.
        positions: usize,
        /// Positions when it closes.
        motion: usize,
    },
    /// A moving mesh for a tree that cannot hold one.
    #[error("mesh {mesh} moves, which {tree} cannot hold; build a `TriangleBvh` in the full layout")]
    MotionUnsupported {
        /// Index of the mesh in the list given.
        mesh: usize,
        /// The kind of tree.
        tree: &'static str,
    },
    /// The caller stopped the build.
    #[error("the build was cancelled")]
    Cancelled,
}

/// Why an instruction set could not be chosen.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum IsaError {
    /// The name is not one that exists.
    #[error("unknown instruction set \"{name}\" (known: avx512, avx2, sse4.2, neon, wasm128, scalar)")]
    Unknown {
        /// The name given.
        name: String,
    },
    /// The name exists, but this machine cannot run it.
    #[error("instruction set {isa} is not available on this machine (available: {available})")]
    Unavailable {
        /// The one asked for.
        isa: Isa,
        /// What there is, best first, separated by commas.
        available: String,
    },
}
