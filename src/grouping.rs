//! Grouping by motion: what never moves becomes one object, whatever it was made of; what moves stays apart.
//!
//! A scene as modelled has many small objects, and their boxes overlap: a ray enters several of them one after the
//! other. What stands still relative to each other can as well be one tree.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use heliostat_scene::{
    Attributes, Edit, Geometry, GeometryId, Instance, InstanceId, Mesh, Object, ObjectId, Part, Scene,
    Target, Timeline,
};

/// How far [`group`] goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroupingOptions {
    /// Most triangles of all copies of an object that is placed several times and yet merged. Beyond that, sharing one
    /// object between its instances saves more memory than it costs time: a triangle takes some 150 bytes. Default 4,096.
    pub max_copied_triangles: u64,
}

impl Default for GroupingOptions {
    fn default() -> Self {
        Self { max_copied_triangles: 4096 }
    }
}

/// A scene whose parts are grouped by how they move.
#[derive(Clone, Debug)]
pub struct Grouped {
    /// What makes it from an empty scene. The timeline of the original fits: everything that moves keeps its handle.
    pub edits: Vec<Edit>,
    /// What was found and done.
    pub summary: GroupingSummary,
}

/// What [`group`] found and did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GroupingSummary {
    /// Instances before.
    pub instances_before: usize,
    /// Instances after.
    pub instances_after: usize,
    /// Objects that hold what was merged: one for the world, and one for each object in which something else stands.
    pub merged_objects: usize,
    /// Placements that were merged into them.
    pub merged_placements: usize,
    /// Triangles of these placements.
    pub merged_triangles: u64,
    /// Objects that stand still but are placed so often that they stay shared.
    pub shared_objects: usize,
    /// Instances that the timeline moves, or shows and hides.
    pub rigid_instances: usize,
    /// Meshes that the timeline deforms.
    pub deforming_meshes: usize,
    /// Their triangles.
    pub deforming_triangles: u64,
}

/// Merges all instances of `scene` that `timeline` never changes into one object per frame of reference: the world, and
/// every object that moves or stays shared. The picture stays the same, up to rounding.
///
/// An object that is placed several times in its frame is merged only if all its copies together have at most
/// [`GroupingOptions::max_copied_triangles`]. What the timeline moves, shows or hides, what deforms, and what contains a moving
/// thing stays an instance of its own, with its handle; so do hidden and singular instances. Materials, lights and
/// cameras stay as they are. Merged instances, objects and geometries lose their handles and names: identifier planes
/// differ.
pub fn group(scene: &Scene, timeline: &Timeline, options: GroupingOptions) -> Grouped {
    let mut pass = Pass::new(scene, timeline, options);
    // What is placed nowhere stays as it is, too.
    let unplaced = |id: &ObjectId| scene.placements_of(*id).next().is_none();
    let mut seen: BTreeSet<ObjectId> = scene.objects().keys().copied().filter(unplaced).collect();
    let mut frames: Vec<Option<ObjectId>> = seen.iter().copied().map(Some).chain([None]).collect();
    while let Some(frame) = frames.pop() {
        let kept = pass.frame(frame);
        frames.extend(kept.into_iter().filter(|object| seen.insert(*object)).map(Some));
    }
    pass.finish()
}

/// The pass over one scene.
struct Pass<'a> {
    scene: &'a Scene,
    options: GroupingOptions,
    /// Instances and meshes that change.
    moving: BTreeSet<InstanceId>,
    deforming: BTreeSet<GeometryId>,
    /// Each object's place in an order from the top down.
    rank: BTreeMap<ObjectId, usize>,
    order: Vec<ObjectId>,
    /// Objects in which something moves, at any depth.
    restless: BTreeSet<ObjectId>,
    /// Triangles of an object with everything in it.
    triangles: BTreeMap<ObjectId, u64>,
    next_geometry: u32,
    next_object: u32,
    next_instance: u32,
    geometries: BTreeMap<GeometryId, Geometry>,
    /// Of `geometries`.
    attributes: BTreeMap<GeometryId, Arc<Attributes>>,
    objects: BTreeMap<ObjectId, Object>,
    instances: BTreeMap<InstanceId, Instance>,
    summary: GroupingSummary,
}

/// A handle after all of those in use.
fn after<K: Copy, V>(map: &BTreeMap<K, V>, number: impl Fn(K) -> u32) -> u32 {
    map.keys().next_back().map_or(0, |&last| number(last).saturating_add(1))
}

impl<'a> Pass<'a> {
    fn new(scene: &'a Scene, timeline: &Timeline, options: GroupingOptions) -> Self {
        let targets = timeline.targets();
        let swept = scene.instances().iter().filter(|(_, instance)| instance.motion.is_some());
        let mut moving: BTreeSet<InstanceId> = swept.map(|(&id, _)| id).collect();
        let sweeping = scene
            .geometries()
            .iter()
            .filter(|(_, geometry)| geometry.as_mesh().is_some_and(|mesh| !mesh.motion.is_empty()));
        let mut deforming: BTreeSet<GeometryId> = sweeping.map(|(&id, _)| id).collect();
        for target in targets {
            match target {
                Target::Instance(id) => _ = moving.insert(id),
                Target::Geometry(id) => _ = deforming.insert(id),
                _ => {}
            }
        }
        let mut order = scene.bottom_up();
        let (mut restless, mut triangles) = (BTreeSet::new(), BTreeMap::new());
        for &id in &order {
            let mut sum: u64 =
                scene.objects()[&id].parts.iter().map(|part| count(scene, part.geometry)).sum();
            for placed in scene.placed_in(Some(id)) {
                let object = scene.instances()[&placed].object;
                sum = sum.saturating_add(triangles.get(&object).copied().unwrap_or(0));
                if moving.contains(&placed) || restless.contains(&object) {
                    restless.insert(id);
                }
            }
            triangles.insert(id, sum);
        }
        order.reverse();
        let deforming_triangles = deforming
            .iter()
            .filter(|id| scene.geometries().contains_key(id))
            .map(|&id| count(scene, id))
            .sum();
        let summary = GroupingSummary {
            instances_before: scene.instances().len(),
            rigid_instances: moving.len(),
            deforming_meshes: deforming.len(),
            deforming_triangles,
            ..GroupingSummary::default()
        };
        Self {
            scene,
            options,
            rank: order.iter().copied().zip(0..).collect(),
            order,
            restless,
            triangles,
            next_geometry: after(scene.geometries(), |id| id.0),
            next_object: after(scene.objects(), |id| id.0),
            next_instance: after(scene.instances(), |id| id.0),
            geometries: BTreeMap::new(),
            attributes: BTreeMap::new(),
            objects: BTreeMap::new(),
            instances: BTreeMap::new(),
            moving,
            deforming,
            summary,
        }
    }

    /// Whether an instance may be merged away, as far as it alone is concerned.
    fn is_still(&self, id: InstanceId) -> bool {
        let instance = &self.scene.instances()[&id];
        let determinant = instance.parent_from_object.matrix3.determinant();
        instance.visible && !self.moving.contains(&id) && determinant != 0.0 && determinant.is_finite()
    }

    fn deforms(&self, object: ObjectId) -> bool {
        self.scene.objects()[&object].parts.iter().any(|part| self.deforming.contains(&part.geometry))
    }

    /// Whether an object's parts can be moved by moving vertices, once: spheres and cones stay what they are.
    fn can_bake(&self, object: ObjectId) -> bool {
        let parts = &self.scene.objects()[&object].parts;
        let meshes = parts.iter().all(|part| self.scene.geometries()[&part.geometry].as_mesh().is_some());
        meshes && !self.deforms(object)
    }

    /// The objects below a frame that can be dissolved into it.
    fn dissolved(&mut self, frame: Option<ObjectId>) -> BTreeSet<ObjectId> {
        // Placements in the frame by the object's rank: parents are counted before what stands in them.
        let mut waiting: BTreeMap<usize, u64> = BTreeMap::new();
        let mut dissolved = BTreeSet::new();
        let mut leaves = 0u64;
        let scene = self.scene;
        let place = |pass: &Self, parent, times: u64, waiting: &mut BTreeMap<usize, u64>| {
            for id in scene.placed_in(parent).filter(|&id| pass.is_still(id)) {
                let placed = waiting.entry(pass.rank[&scene.instances()[&id].object]).or_insert(0);
                *placed = placed.saturating_add(times);
            }
        };
        place(self, frame, 1, &mut waiting);
        let mut shared = 0;
        while let Some((rank, times)) = waiting.pop_first() {
            let object = self.order[rank];
            let copied = times.saturating_mul(self.triangles[&object]);
            if copied == 0 || self.restless.contains(&object) || !self.can_bake(object) {
                continue;
            }
            if times > 1 && copied > self.options.max_copied_triangles {
                shared += 1;
                continue;
            }
            dissolved.insert(object);
            leaves += if scene.objects()[&object].parts.is_empty() { 0 } else { times };
            place(self, Some(object), times, &mut waiting);
        }
        self.summary.shared_objects += shared;
        // One thing alone in the world, or in a group, is as good as it is.
        let lonely = frame.is_none_or(|id| scene.objects()[&id].parts.is_empty());
        if lonely && leaves < 2 { BTreeSet::new() } else { dissolved }
    }

    /// Writes everything that stands in a frame; returns the objects of the instances that are left in it.
    fn frame(&mut self, frame: Option<ObjectId>) -> BTreeSet<ObjectId> {
        let scene = self.scene;
        let dissolved = self.dissolved(frame);
        let mut own = frame.map(|id| scene.objects()[&id].clone()).unwrap_or_default();
        let mut merged = Vec::new();
        let mut kept = BTreeSet::new();
        let mut stack: Vec<(InstanceId, Affine3A)> =
            scene.placed_in(frame).map(|id| (id, Affine3A::IDENTITY)).collect();
        stack.reverse();
        while let Some((id, frame_from_parent)) = stack.pop() {
            let instance = &scene.instances()[&id];
            let frame_from_object = frame_from_parent * instance.parent_from_object;
            if !self.is_still(id) || !dissolved.contains(&instance.object) {
                kept.insert(instance.object);
                self.keep(id, frame, frame_from_object);
                continue;
            }
            let object = &scene.objects()[&instance.object];
            self.summary.merged_placements += usize::from(!object.parts.is_empty());
            for part in &object.parts {
                let geometry = self.bake(part.geometry, &frame_from_object);
                merged.push(Part { geometry, material: part.material });
            }
            let first = stack.len();
            stack.extend(scene.placed_in(Some(instance.object)).map(|id| (id, frame_from_object)));
            stack[first..].reverse();
        }
        self.summary.merged_objects += usize::from(!merged.is_empty());
        for part in &own.parts {
            self.put(part.geometry, part.geometry, scene.geometries()[&part.geometry].clone());
        }
        match frame {
            // What deforms is rebuilt often: it does not take the rest along.
            Some(id) if !self.deforms(id) => {
                own.parts.append(&mut merged);
                self.objects.insert(id, own);
            }
            Some(id) => _ = self.objects.insert(id, own),
            None => {}
        }
        if !merged.is_empty() {
            self.place_merged(frame, merged);
        }
        kept
    }

    /// An object of merged parts, placed in its frame.
    fn place_merged(&mut self, frame: Option<ObjectId>, parts: Vec<Part>) {
        let object = ObjectId(take(&mut self.next_object));
        self.objects.insert(object, Object { name: "static".into(), parts });
        let id = InstanceId(take(&mut self.next_instance));
        let parent_from_object = Affine3A::IDENTITY;
        let name = "static".into();
        let instance =
            Instance { name, object, parent: frame, parent_from_object, motion: None, visible: true };
        self.instances.insert(id, instance);
    }

    /// Leaves an instance in a frame. Further copies of one, from groups that were merged, get new handles.
    fn keep(&mut self, id: InstanceId, frame: Option<ObjectId>, frame_from_object: Affine3A) {
        let original = &self.scene.instances()[&id];
        let instance = if original.parent == frame {
            original.clone()
        } else {
            Instance { parent: frame, parent_from_object: frame_from_object, ..original.clone() }
        };
        let id =
            if self.instances.contains_key(&id) { InstanceId(take(&mut self.next_instance)) } else { id };
        self.instances.insert(id, instance);
    }

    /// A geometry as it stands in a frame.
    fn bake(&mut self, id: GeometryId, frame_from_object: &Affine3A) -> GeometryId {
        let geometry = &self.scene.geometries()[&id];
        // Only meshes are dissolved.
        let Some(mesh) = geometry.as_mesh() else { return id };
        self.summary.merged_triangles += mesh.indices.len() as u64;
        if *frame_from_object == Affine3A::IDENTITY {
            self.put(id, id, geometry.clone());
            return id;
        }
        let baked = GeometryId(take(&mut self.next_geometry));
        self.put(baked, id, Geometry::Mesh(Arc::new(transformed(mesh, frame_from_object))));
        baked
    }

    /// Puts a geometry that is made of another, with the attributes of that.
    fn put(&mut self, id: GeometryId, of: GeometryId, geometry: Geometry) {
        self.geometries.insert(id, geometry);
        if let Some(attributes) = self.scene.attributes().get(&of) {
            self.attributes.insert(id, attributes.clone());
        }
    }

    fn finish(mut self) -> Grouped {
        self.summary.instances_after = self.instances.len();
        let keep = |edit: &Edit| {
            let shape = matches!(edit, Edit::Geometry(..) | Edit::Attribute(..));
            !shape && !matches!(edit, Edit::Object(..) | Edit::Instance(..))
        };
        let mut edits: Vec<Edit> = self.scene.to_edits().into_iter().filter(keep).collect();
        edits.extend(self.geometries.into_iter().map(|(id, geometry)| Edit::Geometry(id, geometry)));
        for (id, attributes) in self.attributes {
            let named = attributes.iter().map(|(name, it)| Edit::Attribute(id, name.clone(), it.clone()));
            edits.extend(named);
        }
        edits.extend(self.objects.into_iter().map(|(id, object)| Edit::Object(id, object)));
        edits.extend(self.instances.into_iter().map(|(id, instance)| Edit::Instance(id, instance)));
        Grouped { edits, summary: self.summary }
    }
}

/// The next free handle number.
fn take(next: &mut u32) -> u32 {
    let number = *next;
    *next = next.saturating_add(1);
    number
}

fn count(scene: &Scene, geometry: GeometryId) -> u64 {
    match &scene.geometries()[&geometry] {
        Geometry::Mesh(mesh) => mesh.indices.len() as u64,
        Geometry::Quadrics(quadrics) => quadrics.shapes.len() as u64,
    }
}

/// A mesh moved into the space that its instance stands in. Fronts stay fronts, also where the transform mirrors.
fn transformed(mesh: &Mesh, to: &Affine3A) -> Mesh {
    let mirrors = to.matrix3.determinant() < 0.0;
    let normals: Mat3A = to.matrix3.inverse().transpose();
    let indices = match mirrors {
        false => mesh.indices.clone(),
        true => mesh.indices.iter().map(|&[a, b, c]| [a, c, b]).collect(),
    };
    let sign = if mirrors { -1.0 } else { 1.0 };
    Mesh {
        positions: mesh.positions.iter().map(|&p| to.transform_point3(p)).collect(),
        motion: mesh.motion.iter().map(|&p| to.transform_point3(p)).collect(),
        indices,
        // Lengths are kept: they weigh in interpolation.
        normals: mesh.normals.iter().map(|&n| Vec3::from(normals * Vec3A::from(n))).collect(),
        tangents: mesh
            .tangents
            .iter()
            .map(|t| to.transform_vector3(t.truncate()).extend(t.w * sign))
            .collect(),
        uvs: mesh.uvs.clone(),
        colors: mesh.colors.clone(),
    }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec2, Vec4};
    use heliostat_engine::{Engine, EngineOptions};
    use heliostat_scene::{
        Attribute, AttributeScope, Backend, Camera, Clip, FrameRequest, Material, Motion, ParameterValue,
        Plane, PlaneData, Pose, Progress, SceneBuilder, ShaderUse,
    };

    use super::*;

    /// A tetrahedron-like cap with normals, coordinates and tangents, none of them symmetrical.
    fn shard() -> Mesh {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::new(0.2, 0.9, 0.0), Vec3::new(0.3, 0.3, 0.8)];
        let mut mesh = Mesh::new(positions, vec![[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1]]);
        mesh.normals = vec![Vec3::new(-1.0, -1.0, 0.3), Vec3::X, Vec3::Y * 2.0, Vec3::Z];
        mesh.tangents = vec![Vec4::new(1.0, 0.2, 0.0, -1.0); 4];
        mesh.uvs[0] = vec![Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE];
        mesh
    }

    fn flat() -> Mesh {
        Mesh { normals: Vec::new(), tangents: Vec::new(), ..shard() }
    }

    fn at(x: f32, y: f32) -> Affine3A {
        Affine3A::from_translation(Vec3::new(x, y, 0.0))
    }

    /// Handles of what moves in [`sample`].
    #[derive(Debug)]
    struct Moves {
        arm: InstanceId,
        blob: GeometryId,
    }

    impl Motion for Moves {
        fn duration(&self) -> f64 {
            1.0
        }

        fn sample(&self, time: f64, pose: &mut Pose) {
            let time = time as f32;
            pose.instance(self.arm, at(-2.0, 1.0) * Affine3A::from_quat(Quat::from_rotation_z(time)));
            let mut blob = shard();
            blob.positions = blob.positions.iter().map(|p| *p * (1.0 + time)).collect();
            pose.mesh(self.blob, Arc::new(blob));
        }
    }

    /// Still things nested, mirrored and sheared; an arm that moves with two things in it; a mesh that deforms in a
    /// still group; something hidden; and `copies` of a larger object.
    fn sample(copies: u32) -> (Scene, Timeline) {
        let mut builder = SceneBuilder::new();
        let tint = ParameterValue::Attribute("tint".into(), Vec3::ONE);
        let shader = Some(Arc::new(ShaderUse::named("lambert").with("diffuse", tint)));
        let red = builder.material(Material { shader, ..Material::diffuse("red", Vec3::X) });
        let blue = builder.material(Material { double_sided: false, ..Material::diffuse("blue", Vec3::Z) });
        let (round, sharp) = (builder.mesh(shard()), builder.mesh(flat()));
        let colors = vec![Vec3::X, Vec3::Y, Vec3::new(0.2, 0.4, 0.6), Vec3::ONE];
        builder.attribute(round, "tint", Attribute::new(AttributeScope::Primitive, colors));
        let thing = builder.object("thing", [(round, red), (sharp, blue)]);
        let group = builder.object("group", []);
        let shear = Affine3A::from_mat3(glam::Mat3::from_cols(Vec3::X, Vec3::new(0.5, 1.0, 0.0), Vec3::Z));
        builder.child(group, thing, at(0.0, 1.0) * shear);
        builder.child(group, thing, at(1.2, 0.0) * Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.3)));
        builder.instance(group, at(0.5, 0.0));
        builder.instance(thing, Affine3A::IDENTITY);
        let blob = builder.mesh(shard());
        let soft = builder.object("soft", [(blob, blue)]);
        builder.child(group, soft, at(1.0, 1.2));
        let arm_object = builder.object("arm", []);
        builder.child(arm_object, thing, at(0.0, 0.0));
        builder.child(arm_object, thing, at(0.8, 0.2));
        let arm = builder.instance(arm_object, at(-2.0, 1.0));
        let hidden = builder.instance(thing, at(0.0, 0.0));
        builder.show(hidden, false);
        let large = Mesh::new(shard().positions.to_vec(), vec![[0, 1, 3]; 3000]);
        let large = builder.mesh(large);
        builder.attribute(large, "tint", Attribute::vector(Vec3::X));
        let tree = builder.object("tree", [(large, red)]);
        for i in 0..copies {
            builder.place(format!("tree {i}"), tree, None, at(i as f32 - 1.0, -1.3));
        }
        let mut scene = Scene::default();
        scene.apply(&builder.finish()).expect("a valid scene");
        let motion = Arc::new(Moves { arm, blob });
        (scene, Timeline::new(vec![Clip { name: String::new(), frame_rate: None, motion }]))
    }

    /// What is seen at some times: positions, normals, colours, materials.
    fn seen(edits: &[Edit], mut timeline: Timeline) -> Vec<Vec<PlaneData>> {
        let mut engine = Engine::new(EngineOptions::default()).expect("an engine");
        engine.apply(edits, &Progress::new()).expect("valid edits");
        let camera = Camera::look_at("", Vec3::new(0.3, 1.0, 7.0), Vec3::new(0.2, 0.5, 0.0), Vec3::Y, 0.8);
        let planes = vec![Plane::Position, Plane::Normal, Plane::Albedo, Plane::MaterialId];
        let request = FrameRequest { samples: 1, planes, ..FrameRequest::new(camera, 96, 72) };
        [0.0, 0.4, 1.0]
            .map(|time| {
                engine.apply(&timeline.edits_at(time), &Progress::new()).expect("the timeline fits");
                engine.render(&request, &Progress::new()).expect("a frame").planes
            })
            .to_vec()
    }

    #[test]
    fn the_picture_stays_the_same_while_things_move() {
        let (scene, timeline) = sample(3);
        let grouped = group(&scene, &timeline, GroupingOptions::default());
        let (before, after) = (seen(&scene.to_edits(), timeline.clone()), seen(&grouped.edits, timeline));
        assert_ne!(before[0], before[1]);
        for (a, b) in before.iter().flatten().zip(after.iter().flatten()) {
            assert!(a.values.iter().any(|v| *v != 0.0));
            let differs = |(a, b): (&f32, &f32)| (a - b).abs() > 2e-5 * (1.0 + a.abs());
            let pixels = a.values.iter().zip(&b.values).filter(|&pair| differs(pair)).count();
            // Where a ray meets an edge, rounding decides which side it hits.
            assert!(pixels <= 12, "{:?}: {pixels} of {} values differ", a.plane, a.values.len());
        }
    }

    #[test]
    fn still_things_become_one_and_others_keep_their_handles() {
        let (scene, timeline) = sample(3);
        let Grouped { edits, summary } = group(&scene, &timeline, GroupingOptions::default());
        let expected = GroupingSummary {
            instances_before: 12,
            // In the world the arm, the soft and the hidden thing, three trees and what was merged; in the arm nothing.
            instances_after: 7,
            // Three things in the world, two in the arm.
            merged_objects: 2,
            merged_placements: 5,
            merged_triangles: 5 * 8,
            shared_objects: 1,
            rigid_instances: 1,
            deforming_meshes: 1,
            deforming_triangles: 4,
        };
        assert_eq!(summary, expected);
        let mut after = Scene::default();
        after.apply(&edits).expect("valid edits");
        assert_eq!(after.instances().len(), 7);
        assert_eq!((after.materials().len(), after.bounds()), (scene.materials().len(), scene.bounds()));
        let names: Vec<&str> = after.instances().values().map(|instance| instance.name.as_str()).collect();
        assert!(
            ["tree 0", "tree 1", "tree 2", "static"].iter().all(|name| names.contains(name)),
            "{names:?}"
        );
        // Grouping what is grouped changes nothing.
        let again = group(&after, &timeline, GroupingOptions::default()).summary;
        assert_eq!((again.merged_placements, again.instances_after), (0, 7));
    }

    #[test]
    fn a_single_copy_is_merged_and_a_lone_object_is_left_alone() {
        let (scene, timeline) = sample(1);
        let summary = group(&scene, &timeline, GroupingOptions::default()).summary;
        assert_eq!((summary.shared_objects, summary.merged_triangles), (0, 5 * 8 + 3000));
        let mut builder = SceneBuilder::new();
        let grey = builder.material(Material::diffuse("", Vec3::ONE));
        let mesh = builder.mesh(shard());
        let object = builder.object("", [(mesh, grey)]);
        builder.instance(object, at(1.0, 2.0));
        let mut scene = Scene::default();
        scene.apply(&builder.finish()).expect("a valid scene");
        let alone = group(&scene, &Timeline::default(), GroupingOptions::default());
        assert_eq!((alone.summary.merged_placements, alone.summary.instances_after), (0, 1));
        assert_eq!(
            group(&Scene::default(), &Timeline::default(), GroupingOptions::default()).summary,
            GroupingSummary::default()
        );
    }

    #[test]
    fn doubling_hierarchies_stay_shared() {
        // 2^40 copies of one triangle pair: nothing is expanded.
        let mut builder = SceneBuilder::new();
        let grey = builder.material(Material::diffuse("", Vec3::ONE));
        let quad = builder.mesh(Mesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y));
        let mut object = builder.object("", [(quad, grey)]);
        for _ in 0..40 {
            let pair = builder.object("", []);
            builder.child(pair, object, at(1.0, 0.0));
            builder.child(pair, object, at(0.0, 1.0));
            object = pair;
        }
        builder.instance(object, Affine3A::IDENTITY);
        let mut scene = Scene::default();
        scene.apply(&builder.finish()).expect("a valid scene");
        let grouped = group(&scene, &Timeline::default(), GroupingOptions::default());
        assert!(grouped.summary.merged_triangles < 100_000, "{:?}", grouped.summary);
        let mut after = Scene::default();
        after.apply(&grouped.edits).expect("valid edits");
        assert_eq!(after.bounds(), scene.bounds());
    }
}
