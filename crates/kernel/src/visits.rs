//! How much of its trees a ray has to look at: a diagnosis for heat maps and statistics, not a fast path.
use fearless_simd::Fallback;
use glam::{DVec3, Vec3};

use crate::{
    aabb::Aabb,
    build::wide::WideTree,
    kdtree::{KdNodeKind, KdTree},
    layout::{Block, Child, Node},
    object::{Object, PlacedInstance, double},
    query::RayQuery,
    ray::{Hit, Ray},
    triangles::Triangles,
    world::World,
};

/// Rounding errors of the fast path: boxes count so much farther than to its hit.
const REACH: f64 = 1.0 + 1.0e-5;

/// What a ray meets on the way to its first hit, or to its end: see [`World::visits`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Visits {
    /// Nodes of trees over triangles, spheres, cones and instances: 8-wide ones, or those of a kd-tree with its leaves.
    pub nodes: u32,
    /// Triangles, and spheres and cones, in the leaves that the ray passes; one that lies in several leaves counts in
    /// each.
    pub primitives: u32,
    /// Instances entered; one that is opened counts for each of its parts.
    pub instances: u32,
}

impl World {
    /// Counts the nodes whose boxes `ray` passes before its first hit, the primitives in their leaves and the instances on
    /// the way: what no walk through these trees can do without, and what one from front to back comes close to.
    ///
    /// The count does not depend on the order of a walk, on the instruction set or on what rays are asked together. It
    /// takes some ten times as long as the hit itself.
    #[must_use]
    pub fn visits(&self, ray: &Ray) -> Visits {
        let mut hit = [Hit::MISS];
        self.intersect(std::slice::from_ref(ray), &mut hit);
        let end = f64::from(ray.t_max.min(hit[0].t)) * REACH;
        let begin = f64::from(ray.t_min.max(0.0));
        let mut walk = Walk { begin, end, time: ray.clamped_time(), visits: Visits::default() };
        if ray.is_valid() {
            let way = Way { origin: ray.origin.as_dvec3(), direction: ray.direction.as_dvec3() };
            walk.object(self.root(), Child::ROOT, &way);
        }
        walk.visits
    }
}

/// A ray in the space of the object at hand; parameters are the same in all of them.
struct Way {
    origin: DVec3,
    direction: DVec3,
}

impl Way {
    /// The part of `span` in which the ray lies between two planes across an axis; empty where it never does.
    fn between(&self, axis: usize, [low, high]: [f64; 2], [begin, end]: [f64; 2]) -> [f64; 2] {
        let (o, d) = (self.origin[axis], self.direction[axis]);
        if d == 0.0 {
            return if low <= o && o <= high { [begin, end] } else { [f64::INFINITY, f64::NEG_INFINITY] };
        }
        let (a, b) = ((low - o) / d, (high - o) / d);
        [begin.max(a.min(b)), end.min(a.max(b))]
    }

    /// The part of `span` in which the ray lies in a box, wider by the rounding of its planes.
    fn within(&self, bounds: &Aabb, span: [f64; 2]) -> [f64; 2] {
        let pad = |v: Vec3| v.abs().as_dvec3() * f64::from(4.0 * f32::EPSILON);
        let low = bounds.min.as_dvec3() - pad(bounds.min);
        let high = bounds.max.as_dvec3() + pad(bounds.max);
        (0..3).fold(span, |span, axis| self.between(axis, [low[axis], high[axis]], span))
    }
}

struct Walk {
    begin: f64,
    end: f64,
    time: f32,
    visits: Visits,
}

impl Walk {
    fn span(&self) -> [f64; 2] {
        [self.begin, self.end]
    }

    /// All that lies in an object whose triangle tree is entered at `start`.
    fn object(&mut self, object: &Object, start: Child, way: &Way) {
        match &object.triangles {
            Some(Triangles::Bvh(bvh)) => self.wide(&bvh.tree, start, way, &mut |walk, leaf| {
                let (first, end) = leaf.block_range();
                for block in first..end {
                    let mut place = None;
                    let numbers = &bvh.blocks().get(block, &mut place).triangle;
                    let count = numbers.iter().filter(|&&number| number != Block::NO_TRIANGLE).count();
                    walk.visits.primitives += count as u32;
                }
            }),
            Some(Triangles::KdTree(tree)) => self.binary(tree, way),
            None => {}
        }
        if let Some(quadrics) = &object.quadrics {
            self.wide(&quadrics.tree, Child::ROOT, way, &mut |walk, _| walk.visits.primitives += 1);
        }
        self.wide(&object.instance_tree.wide, Child::ROOT, way, &mut |walk, leaf| {
            let (placed, start) = object.behind(leaf);
            walk.instance(placed, start, way);
        });
    }

    fn instance(&mut self, placed: &PlacedInstance, start: Child, way: &Way) {
        let moved = placed.instance.motion.map(|_| placed.at(self.time));
        let object_from_parent = match moved {
            None => placed.object_from_parent,
            Some(Some((object_from_parent, _))) => object_from_parent,
            // Without an inverse at this moment no ray passes.
            Some(None) => return,
        };
        self.visits.instances += 1;
        let map = double(&object_from_parent);
        let local =
            Way { origin: map.transform_point3(way.origin), direction: map.transform_vector3(way.direction) };
        self.object(&placed.instance.object, start, &local);
    }

    /// The nodes of an 8-wide tree from `start` on; `enter` is called for each leaf that the ray passes.
    fn wide(&mut self, tree: &WideTree, start: Child, way: &Way, enter: &mut dyn FnMut(&mut Self, Child)) {
        if tree.is_empty() {
            return;
        }
        let mut waiting = vec![start];
        while let Some(next) = waiting.pop() {
            if next.is_leaf() {
                enter(self, next);
                continue;
            }
            self.visits.nodes += 1;
            let mut place = None;
            let node = tree.view().get(Fallback::new(), next.payload() as usize, &mut place);
            for (lane, &child) in
                node.child.iter().enumerate().take_while(|(_, child)| **child != Child::NONE)
            {
                let [begin, end] = way.within(&lane_box(node, lane), self.span());
                if begin <= end {
                    waiting.push(child);
                }
            }
        }
    }

    /// The nodes and leaves of a kd-tree.
    fn binary(&mut self, tree: &KdTree, way: &Way) {
        let mut waiting = vec![(0, way.within(&tree.bounds(), self.span()))];
        while let Some((node, span)) = waiting.pop() {
            let Some(node) = tree.nodes().get(node as usize).filter(|_| span[0] <= span[1]) else { continue };
            self.visits.nodes += 1;
            match node.kind() {
                KdNodeKind::Leaf { count, .. } => self.visits.primitives += count,
                KdNodeKind::Inner { axis, split, children } => {
                    let (split, all) = (f64::from(split), f64::INFINITY);
                    waiting.push((children, way.between(axis, [-all, split], span)));
                    waiting.push((children + 1, way.between(axis, [split, all], span)));
                }
            }
        }
    }
}

fn lane_box(node: &Node, lane: usize) -> Aabb {
    let [a, b, c, d, e, f] = node.bounds.map(|row| row[lane]);
    Aabb::new(Vec3::new(a, b, c), Vec3::new(d, e, f))
}
