//! One flat tree against the same triangles as many placed objects, in our kernel and in Embree.

use std::sync::Arc;

use heliostat::kernel::glam::{Affine3A, Quat, Vec3};
use heliostat::kernel::{Aabb, BuildOptions, Instance, Isa, Mesh, Object, RayQuery, TriangleBvh, World};

use super::embree::{self, Embree, EmbreeRays, Packets, Tree, Way};
use super::ours::{self, OurRays};
use super::rays::{Kind, Query, RaySet, Source};
use super::scenes::{Spec, prepare};
use super::split;
use super::versus::disagreements;
use crate::measure::{Answers, interleave, sample, time};
use crate::{report, result};

/// What is compared and how.
pub(super) struct Instanced<'a> {
    pub(super) embree: Option<&'a Embree>,
    pub(super) isa: Isa,
    pub(super) size: u32,
    pub(super) runs: usize,
    pub(super) most: usize,
    pub(super) kinds: &'a [Kind],
    /// About how many objects.
    pub(super) count: usize,
    /// Whether they are turned as well as moved.
    pub(super) turned: bool,
}

/// A mesh about its own origin, and where it stands.
struct Placed {
    mesh: Mesh,
    world_from_object: Affine3A,
}

impl Instanced<'_> {
    /// Measures one scene on one thread and prints a line for each kind of rays.
    ///
    /// # Errors
    /// When the scene cannot be read or built.
    pub(super) fn scene(&self, spec: &Spec) -> Result<(), String> {
        let flat = prepare(spec)?;
        let placed = place(split::objects(&flat.mesh, self.count), self.turned);
        let name = &flat.name;
        result(&format!("\n{name}: {} triangles in {} objects", flat.mesh.indices.len(), placed.len()));
        let worlds = [flat_world(&flat.mesh, self.isa)?, instanced_world(&placed, self.isa)?];
        let mut trees = [Vec::new(), Vec::new()];
        if let Some(embree) = self.embree {
            let device = embree.device(super::all_threads())?;
            for build in [embree::Build::MEDIUM, embree::Build::HIGH] {
                let mut tree = Tree::new(&device, &flat.mesh, build)?;
                tree.build()?;
                trees[0].push(tree);
                let objects = placed.iter().map(|object| (&object.mesh, object.world_from_object));
                trees[1].push(Tree::instanced(&device, objects, build)?);
            }
        }
        let source = Source::new(&worlds[0], flat.view(&worlds[0]), flat.light, self.size, self.most);
        for &kind in self.kinds {
            let set = source.rays(kind);
            if set.count == 0 {
                report(&format!("note: {name}: there are no {} rays", kind.name()));
                continue;
            }
            self.kind(&worlds, &trees, &set)?;
        }
        Ok(())
    }

    fn kind(&self, worlds: &[World; 2], trees: &[Vec<Tree>; 2], set: &RaySet) -> Result<(), String> {
        let closest = set.kind.query() == Query::Closest;
        let [mut a, mut b] = [(); 2].map(|()| Answers::new(set.items.len(), closest));
        let ours = worlds.each_ref().map(|world| OurRays { world: world as &dyn RayQuery, set });
        let (x, y) =
            interleave(self.runs, || Ok(time(&ours[0], &mut a, None)), || Ok(time(&ours[1], &mut b, None)))?;
        let differ = disagreements(set, &a, &b);
        let mega = |seconds: f64| set.count as f64 / seconds * 1e-6;
        let mut line = format!(
            "{:10} flat {:7.2} Mray/s, instanced {:7.2}: {:5.2} times the time, {differ} of {} disagree",
            set.kind.name(),
            mega(x),
            mega(y),
            y / x,
            set.count
        );
        if let Some(embree) = self.embree {
            let packets = Packets::new(set, false);
            let ways = embree.ways(false);
            let rays = |(tree, way)| EmbreeRays { tree, packets: &packets, way };
            let [flat, instanced] = trees.each_ref().map(|trees| fastest(trees, &ways, &packets, &mut a));
            let (Some(flat), Some(instanced)) = (flat, instanced) else { return Err("no tree".into()) };
            let (x, y) = interleave(
                self.runs,
                || Ok(time(&rays(flat), &mut a, None)),
                || Ok(time(&rays(instanced), &mut b, None)),
            )?;
            line += &format!(
                "   {}: flat {:7.2}, instanced {:7.2}: {:5.2} times",
                embree.name(),
                mega(x),
                mega(y),
                y / x
            );
        }
        result(&line);
        Ok(())
    }
}

/// The tree and the way to ask it that take the least time on some of the rays.
fn fastest<'t>(
    trees: &'t [Tree],
    ways: &[Way],
    packets: &Packets,
    answers: &mut Answers,
) -> Option<(&'t Tree, Way)> {
    let pairs = trees.iter().flat_map(|tree| ways.iter().map(move |&way| (tree, way)));
    let timed = pairs.map(|(tree, way)| (sample(&EmbreeRays { tree, packets, way }, answers), (tree, way)));
    timed.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, pair)| pair)
}

/// Moves each mesh to its own origin, and turns it about the vertical by an angle of its own if told so.
fn place(meshes: Vec<Mesh>, turned: bool) -> Vec<Placed> {
    let one = |(index, mesh): (usize, Mesh)| {
        let center = Aabb::from_points(mesh.positions.iter().copied().filter(|p| p.is_finite())).center();
        let angle = if turned { 0.1 + index as f32 } else { 0.0 };
        let turn = Quat::from_rotation_y(angle);
        let positions: Vec<Vec3> = mesh.positions.iter().map(|&p| turn.inverse() * (p - center)).collect();
        Placed {
            mesh: Mesh { positions: positions.into(), ..mesh },
            world_from_object: Affine3A::from_rotation_translation(turn, center),
        }
    };
    meshes.into_iter().enumerate().map(one).collect()
}

fn tree(mesh: &Mesh) -> Result<TriangleBvh, String> {
    TriangleBvh::build(std::slice::from_ref(mesh), &BuildOptions::default()).map_err(|e| e.to_string())
}

fn flat_world(mesh: &Mesh, isa: Isa) -> Result<World, String> {
    ours::world(tree(mesh)?.into(), isa)
}

fn instanced_world(placed: &[Placed], isa: Isa) -> Result<World, String> {
    let instance = |(id, object): (u32, &Placed)| {
        let built = Object::new(Some(tree(&object.mesh)?.into()), Vec::new()).map_err(|e| e.to_string())?;
        Ok(Instance {
            object: Arc::new(built),
            parent_from_object: object.world_from_object,
            motion: None,
            id,
        })
    };
    let instances = (0..).zip(placed).map(instance).collect::<Result<_, String>>()?;
    let root = Object::new(None, instances).map_err(|e| e.to_string())?;
    World::with_isa(Arc::new(root), isa).map_err(|e| e.to_string())
}
