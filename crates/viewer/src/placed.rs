//! Which placement of a thing is meant, where the group that holds it is placed several times.

use glam::{Affine3A, Vec3};
use heliostat_scene::{Geometry, InstanceId, ObjectId, Scene, SceneBounds};

use crate::geometry::{PictureRay, corners};

/// Deepest nesting that is followed from an instance up to the world.
pub(crate) const MAX_NESTING: usize = 64;
/// Most placements that are looked through: where there are more, the first of them are.
const MAX_PLACEMENTS: usize = 1 << 18;

/// The instances around a thing, from the one that places the object in which it lies to one in the world. What is
/// missing at the end, or no longer true, is the first placement that there is.
pub(crate) type Holders = Vec<u32>;

/// The instances around `id` as `wanted` has them, as far as they are there.
pub(crate) fn holders(scene: &Scene, id: InstanceId, wanted: &[u32]) -> Vec<InstanceId> {
    let mut found = Vec::new();
    let mut parent = scene.instances().get(&id).and_then(|instance| instance.parent);
    while let Some(object) = parent.filter(|_| found.len() < MAX_NESTING) {
        let given = wanted.get(found.len()).map(|&id| InstanceId(id));
        let right = |id: &InstanceId| scene.instances().get(id).is_some_and(|i| i.object == object);
        let Some(above) = given.filter(right).or_else(|| scene.placements_of(object).next()) else { break };
        found.push(above);
        parent = scene.instances()[&above].parent;
    }
    found
}

/// From the space in which an instance is placed to the world, through these holders.
pub(crate) fn world_from_parent(scene: &Scene, id: InstanceId, wanted: &[u32]) -> Affine3A {
    let around = holders(scene, id, wanted);
    around.iter().fold(Affine3A::IDENTITY, |place, above| scene.instances()[above].parent_from_object * place)
}

/// The holders through which a ray met the instance `id`, `distance` along it.
pub(crate) fn holders_hit(scene: &Scene, id: InstanceId, ray: &PictureRay, distance: f32) -> Holders {
    let Some(instance) = scene.instances().get(&id) else { return Vec::new() };
    let hit = ray.origin + distance * ray.direction;
    let bounds = own_bounds(scene, instance.object);
    let mut search = Search { scene, found: Vec::new(), way: Vec::new(), count: 0, hit, bounds };
    search.climb(id, Affine3A::IDENTITY);
    let mut found = search.found;
    if found.len() > 1 {
        // Several boxes hold the point: the surface that the ray meets there decides.
        let miss = |place: &Affine3A| {
            let local = place.inverse();
            let (origin, way) = (local.transform_point3(ray.origin), local.transform_vector3(ray.direction));
            nearest_miss(scene, instance.object, origin, way, distance)
        };
        let best = found.iter().map(|(_, place)| miss(place)).enumerate();
        let best = best.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index);
        found.swap(0, best);
    }
    found.into_iter().next().map_or(Vec::new(), |(way, _)| way)
}

/// The placements of an instance whose box holds a point.
struct Search<'a> {
    scene: &'a Scene,
    /// Holders, and from the object's space to the world.
    found: Vec<(Holders, Affine3A)>,
    way: Holders,
    count: usize,
    hit: Vec3,
    bounds: Option<SceneBounds>,
}

impl Search<'_> {
    /// Goes on outwards from `id`, through every placement; `place` leads from the innermost object to its inside.
    fn climb(&mut self, id: InstanceId, place: Affine3A) {
        let instance = &self.scene.instances()[&id];
        if !instance.visible || self.count >= MAX_PLACEMENTS || self.way.len() > MAX_NESTING {
            return;
        }
        let place = instance.parent_from_object * place;
        let Some(parent) = instance.parent else {
            self.count += 1;
            if self.holds(&place) {
                self.found.push((self.way.clone(), place));
            }
            return;
        };
        let scene = self.scene;
        for above in scene.placements_of(parent) {
            self.way.push(above.0);
            self.climb(above, place);
            self.way.pop();
        }
    }

    fn holds(&self, place: &Affine3A) -> bool {
        let Some(bounds) = &self.bounds else { return true };
        let local = place.inverse().transform_point3(self.hit);
        // Flat things have flat boxes.
        let margin = Vec3::splat(1e-3 * (bounds.max - bounds.min).max_element() + 1e-6);
        local.cmpge(bounds.min - margin).all() && local.cmple(bounds.max + margin).all()
    }
}

/// The box around what an object holds itself.
fn own_bounds(scene: &Scene, object: ObjectId) -> Option<SceneBounds> {
    let mut bounds: Option<SceneBounds> = None;
    let mut grow = |p: Vec3| {
        let old = bounds.unwrap_or(SceneBounds { min: p, max: p });
        bounds = Some(SceneBounds { min: old.min.min(p), max: old.max.max(p) });
    };
    for part in &scene.objects().get(&object)?.parts {
        match &scene.geometries()[&part.geometry] {
            Geometry::Mesh(mesh) => {
                mesh.positions.iter().copied().filter(|p| p.is_finite()).for_each(&mut grow);
            }
            Geometry::Quadrics(list) => {
                list.shapes.iter().flat_map(heliostat_scene::Quadric::bounds).for_each(&mut grow);
            }
        }
    }
    bounds.filter(|bounds| corners(bounds).all(|corner| corner.is_finite()))
}

/// By how much the surface of an object that a ray meets nearest to `distance` misses it; infinity for none.
fn nearest_miss(scene: &Scene, object: ObjectId, origin: Vec3, way: Vec3, distance: f32) -> f32 {
    let mut least = f32::INFINITY;
    for part in scene.objects().get(&object).map_or(&[][..], |object| &object.parts) {
        let Geometry::Mesh(mesh) = &scene.geometries()[&part.geometry] else { continue };
        for triangle in mesh.indices.iter() {
            let [a, b, c] = triangle.map(|i| mesh.positions.get(i as usize).copied().unwrap_or(Vec3::NAN));
            if let Some(t) = meets(origin, way, [a, b - a, c - a]) {
                least = least.min((t - distance).abs());
            }
        }
    }
    least
}

/// Where a ray meets a triangle (a corner and two edges), if it does (Möller, Trumbore, "Fast, Minimum Storage
/// Ray/Triangle Intersection", 1997); a little beyond its borders too.
fn meets(origin: Vec3, way: Vec3, [corner, u, v]: [Vec3; 3]) -> Option<f32> {
    const BORDER: f32 = 1e-3;
    let p = way.cross(v);
    let determinant = u.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let from = origin - corner;
    let q = from.cross(u);
    let (s, t) = (from.dot(p) / determinant, way.dot(q) / determinant);
    let inside = s >= -BORDER && t >= -BORDER && s + t <= 1.0 + BORDER;
    inside.then_some(v.dot(q) / determinant)
}

#[cfg(test)]
mod tests {
    use heliostat_scene::{Material, Mesh, SceneBuilder};

    use super::*;

    #[test]
    fn the_placement_that_was_hit_is_found() {
        let mut builder = SceneBuilder::new();
        let grey = builder.material(Material::default());
        let quad = builder.mesh(Mesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y));
        let slope =
            builder.mesh(Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::new(0.0, 1.0, 1.0)], vec![[0, 1, 2]]));
        let leaf = builder.object("leaf", [(quad, grey)]);
        let ramp = builder.object("ramp", [(slope, grey)]);
        let twig = builder.object("twig", []);
        let tree = builder.object("tree", []);
        let at = |x: f32, y: f32, z: f32| Affine3A::from_translation(Vec3::new(x, y, z));
        let inner = builder.child(twig, leaf, at(0.0, 0.0, 0.0));
        let sloping = builder.child(twig, ramp, at(0.0, 0.0, 0.0));
        let twigs =
            [builder.child(tree, twig, at(0.0, 0.0, 0.0)), builder.child(tree, twig, at(0.0, 2.0, 0.0))];
        let trees = [builder.instance(tree, at(0.0, 0.0, 0.0)), builder.instance(tree, at(5.0, 0.0, 0.2))];
        let mut scene = Scene::default();
        scene.apply(&builder.finish()).expect("valid");
        let look = |id, x: f32, y: f32, z: f32| {
            let ray = PictureRay { origin: Vec3::new(x, y, 9.0), direction: Vec3::NEG_Z };
            holders_hit(&scene, id, &ray, 9.0 - z)
        };
        for (t, tree_at) in [(0, Vec3::ZERO), (1, Vec3::new(5.0, 0.0, 0.2))] {
            for (k, y) in [(0, 0.5), (1, 2.5)] {
                let way = look(inner, tree_at.x + 0.5, y, tree_at.z);
                assert_eq!(way, [twigs[k].0, trees[t].0]);
                let place = world_from_parent(&scene, inner, &way);
                assert!(place.translation.abs_diff_eq((tree_at + Vec3::Y * (y - 0.5)).into(), 1e-6));
            }
        }
        // Boxes that overlap: the surface decides.
        let mut edits = vec![heliostat_scene::Edit::MoveInstance(trees[1], at(0.0, 0.0, 0.4))];
        scene.apply(&edits).expect("valid");
        let look = |z: f32| {
            let ray = PictureRay { origin: Vec3::new(0.1, 0.5, 9.0), direction: Vec3::NEG_Z };
            holders_hit(&scene, sloping, &ray, 9.0 - z)
        };
        assert_eq!((look(0.5)[1], look(0.9)[1]), (trees[0].0, trees[1].0));
        // What is not true is the first that there is.
        assert_eq!(holders(&scene, inner, &[999]), [twigs[0], trees[0]]);
        edits = vec![heliostat_scene::Edit::ShowInstance(trees[1], false)];
        scene.apply(&edits).expect("valid");
        let ray = PictureRay { origin: Vec3::new(0.1, 0.5, 9.0), direction: Vec3::NEG_Z };
        assert_eq!(holders_hit(&scene, sloping, &ray, 8.1)[1], trees[0].0, "hidden ones are not hit");
    }
}
