//! What every built-in scene promises.

use std::collections::HashMap;

use glam::{Affine3A, Vec3};
use heliostat_scene::{Edit, Geometry, Instance, Mesh, ObjectId, Pixels, Scene};

fn scene(name: &str) -> Scene {
    let mut scene = Scene::default();
    scene.apply(&crate::build(name).unwrap()).unwrap_or_else(|error| panic!("{name}: {error}"));
    scene
}

/// Calls `visit` with every placed mesh, its placement and whether it emits.
fn placed(scene: &Scene, mut visit: impl FnMut(&Mesh, Affine3A, bool)) {
    type Children<'a> = HashMap<Option<ObjectId>, Vec<&'a Instance>>;
    fn descend(
        scene: &Scene,
        children: &Children<'_>,
        parent: Option<ObjectId>,
        frame: Affine3A,
        visit: &mut impl FnMut(&Mesh, Affine3A, bool),
    ) {
        for instance in children.get(&parent).into_iter().flatten() {
            let frame = frame * instance.parent_from_object;
            for part in &scene.objects()[&instance.object].parts {
                let Some(mesh) = scene.geometries()[&part.geometry].as_mesh() else { continue };
                visit(mesh, frame, scene.materials()[&part.material].is_emissive());
            }
            descend(scene, children, Some(instance.object), frame, visit);
        }
    }
    let mut children = Children::new();
    for instance in scene.instances().values() {
        children.entry(instance.parent).or_default().push(instance);
    }
    descend(scene, &children, None, Affine3A::IDENTITY, &mut visit);
}

fn triangles(scene: &Scene) -> usize {
    let mut count = 0;
    placed(scene, |mesh, _, _| count += mesh.indices.len());
    count
}

#[test]
fn sizes_are_as_advertised() {
    let count = |name| triangles(&scene(name));
    assert_eq!(count("cornell"), 12 + 20);
    for (name, range) in
        [("atrium", 50_000..300_000), ("conference", 270_000..290_000), ("conference-1", 270_000..290_000)]
    {
        let triangles = count(name);
        assert!(range.contains(&triangles), "{name} has {triangles} triangles");
    }
}

/// Lights that a user would count: those without area, and every placed part that emits.
fn lamps(scene: &Scene) -> usize {
    let mut count = scene.lights().len();
    placed(scene, |_, _, emits| count += usize::from(emits));
    count
}

/// Triangles as they are stored, each mesh once.
fn unique(scene: &Scene) -> usize {
    scene.geometries().values().filter_map(|g| g.as_mesh()).map(|mesh| mesh.indices.len()).sum()
}

#[test]
fn scenes_of_many_lights_have_as_many_as_they_say() {
    for (name, sizes, lights) in [
        ("erw6", 900..1_000, 6..7),
        ("erw10", 60_000..90_000, 100..101),
        ("conference-220", 290_000..310_000, 220..221),
        ("ellipse", 100_000..150_000, 1_164..1_165),
        ("building", 2_400_000..2_700_000, 22_000..24_000),
    ] {
        let scene = scene(name);
        let (size, count) = (triangles(&scene), lamps(&scene));
        assert!(sizes.contains(&size), "{name} has {size} triangles");
        assert!(lights.contains(&count), "{name} has {count} lamps");
    }
}

#[test]
fn the_power_plant_has_twelve_and_a_half_million_triangles_of_which_five_are_unique() {
    let scene = scene("powerplant");
    let (size, unique) = (triangles(&scene), unique(&scene));
    assert!((12_400_000..12_700_000).contains(&size), "{size}");
    assert!((4_900_000..5_200_000).contains(&unique), "{unique}");
}

#[test]
fn the_head_lamp_has_its_triangles_and_its_glass_is_closed() {
    let scene = scene("headlight");
    assert!((780_000..830_000).contains(&triangles(&scene)), "{}", triangles(&scene));
    for object in scene.objects().values().filter(|o| ["lens", "envelope"].contains(&o.name.as_str())) {
        for part in &object.parts {
            check_closed(scene.geometries()[&part.geometry].as_mesh().unwrap(), &object.name);
        }
    }
}

/// Every edge has a triangle on either side; vertices count as one within a nanometre or so.
fn check_closed(mesh: &Mesh, what: &str) {
    let place = |i: u32| (mesh.positions[i as usize].as_dvec3() * 1e7).round().as_i64vec3().to_array();
    let mut open: HashMap<[[i64; 3]; 2], i32> = HashMap::new();
    for triangle in mesh.indices.iter() {
        for k in 0..3 {
            let [a, b] = [triangle[k], triangle[(k + 1) % 3]].map(place);
            // One way counts up, the other way down.
            *open.entry(if a < b { [a, b] } else { [b, a] }).or_default() += if a < b { 1 } else { -1 };
        }
    }
    let open = open.iter().filter(|(edge, count)| edge[0] != edge[1] && **count != 0).count();
    assert_eq!(open, 0, "{what}: edges without a neighbour");
}

#[test]
fn rooms_are_closed_around_their_cameras() {
    for name in ["erw6", "erw10", "ellipse", "building"] {
        let scene = scene(name);
        let mut soup = Vec::new();
        placed(&scene, |mesh, frame, _| {
            let corner = |i: u32| frame.transform_point3(mesh.positions[i as usize]);
            soup.extend(mesh.indices.iter().map(|t| t.map(corner)));
        });
        // Brute force: as many rays as are quick.
        let rays = (40_000_000 / soup.len()).clamp(8, 100);
        for camera in scene.cameras().values() {
            let eye = Vec3::from(camera.world_from_camera.translation);
            for i in 0..rays {
                let direction = spiral(i, rays);
                let hit = soup.iter().filter_map(|t| hit(eye, direction, t)).fold(f32::INFINITY, f32::min);
                assert!(hit.is_finite(), "{name}, {}: nothing towards {direction}", camera.name);
                assert!(hit > 0.1, "{name}, {}: something at {hit} m", camera.name);
            }
        }
    }
}

/// The `i`-th of `count` directions spread over the sphere.
fn spiral(i: usize, count: usize) -> Vec3 {
    let y = 1.0 - 2.0 * (i as f32 + 0.5) / count as f32;
    let (sin, cos) = (2.399_963 * i as f32).sin_cos();
    Vec3::new((1.0 - y * y).sqrt() * cos, y, (1.0 - y * y).sqrt() * sin)
}

/// Distance to a triangle along a ray, from either side.
///
/// # References
/// Möller, Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection", 1997.
fn hit(origin: Vec3, direction: Vec3, &[a, b, c]: &[Vec3; 3]) -> Option<f32> {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    let s = origin - a;
    let u = s.dot(p) / determinant;
    let q = s.cross(ab);
    let v = direction.dot(q) / determinant;
    let t = ac.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

#[test]
fn sunflowers_are_a_billion_triangles_of_which_few_are_unique() {
    let scene = scene("sunflowers");
    assert!(triangles(&scene) > 1_000_000_000);
    let mut kinds = 0;
    for (id, object) in scene.objects() {
        let own = |part: &heliostat_scene::Part| {
            scene.geometries()[&part.geometry].as_mesh().unwrap().indices.len()
        };
        let own: usize = object.parts.iter().map(own).sum();
        let placed = scene.placements_of(*id).count();
        match object.name.split(' ').next() {
            Some("sunflower") => {
                kinds += 1;
                assert!((33_000..39_000).contains(&own), "{}: {own}", object.name);
                assert!(placed > 2500);
            }
            Some("tree") => assert!((900_000..1_100_000).contains(&own), "{}: {own}", object.name),
            _ => assert_eq!(placed, 1),
        }
    }
    assert_eq!(kinds, 10);
    assert_eq!(scene.instances().len(), crate::sunflowers::PLANTS + 26 + 1);
}

#[test]
fn unknown_names_make_nothing_and_known_ones_something() {
    assert!(crate::build("teapot").is_none());
    for (name, description) in crate::names() {
        assert!(!description.is_empty());
        let scene = scene(name);
        assert!(scene.has_light(), "{name} is dark");
        assert!(!scene.cameras().is_empty(), "{name} has no camera");
    }
}

#[test]
fn meshes_are_clean() {
    for (name, _) in crate::names() {
        for (id, geometry) in scene(name).geometries() {
            let Some(mesh) = geometry.as_mesh() else { continue };
            check_mesh(mesh, &format!("{name}, {id}"));
        }
    }
}

/// No NaN, no triangle without area, unit normals that agree with the winding.
fn check_mesh(mesh: &Mesh, what: &str) {
    assert!(!mesh.indices.is_empty(), "{what} has no triangles");
    assert!(mesh.positions.iter().all(|p| p.is_finite()), "{what}: positions");
    assert!(mesh.uvs[0].iter().all(|uv| uv.is_finite()), "{what}: texture coordinates");
    for (i, n) in mesh.normals.iter().enumerate() {
        assert!((n.length() - 1.0).abs() < 1e-3, "{what}: normal {i} is {n}");
    }
    for triangle in mesh.indices.iter() {
        let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
        let face = (b - a).cross(c - a);
        assert!(face.length() > 0.0, "{what}: {triangle:?} {a} {b} {c} has no area");
        let normals = triangle.map(|i| mesh.normals.get(i as usize).copied().unwrap_or(face.normalize()));
        let mean: Vec3 = normals.iter().sum();
        assert!(mean.dot(face) > 0.0, "{what}: {triangle:?} at {a} faces {face}, its normals {normals:?}");
    }
}

#[test]
fn lamps_face_the_room() {
    // Every emitting triangle shines towards the middle of the scene's lower half.
    for name in ["cornell", "conference", "conference-1", "conference-220", "erw6"] {
        let scene = scene(name);
        let bounds = scene.bounds().unwrap();
        let room = bounds.center() - Vec3::Y * 0.25 * (bounds.max.y - bounds.min.y);
        let mut emitters = 0;
        placed(&scene, |mesh, frame, emits| {
            for triangle in mesh.indices.iter().filter(|_| emits) {
                let [a, b, c] = triangle.map(|i| frame.transform_point3(mesh.positions[i as usize]));
                assert!((b - a).cross(c - a).dot(room - a) > 0.0, "{name}: lamp at {a} faces away");
                emitters += 1;
            }
        });
        assert!(emitters >= 2, "{name} has {emitters} emitting triangles");
    }
    let mut one = 0;
    placed(&scene("conference-1"), |mesh, _, emits| one += if emits { mesh.indices.len() } else { 0 });
    assert_eq!(one, 2, "one rectangle");
}

#[test]
fn motions_start_at_rest_and_stay_inside() {
    let mut moving = 0;
    for (name, _) in crate::names() {
        let (mut scene, mut timeline) = (scene(name), crate::timeline(name));
        let (instances, bounds) = (scene.instances().clone(), scene.bounds().unwrap());
        moving += timeline.clips().len();
        for step in 0..=16 {
            let edits = timeline.edits_at(timeline.duration() * f64::from(step) / 16.0);
            scene.apply(&edits).unwrap_or_else(|error| panic!("{name}: {error}"));
            if step % 16 == 0 {
                assert_eq!(*scene.instances(), instances, "{name}");
            }
            let now = scene.bounds().unwrap();
            assert!(now.min.cmpge(bounds.min).all() && now.max.cmple(bounds.max).all(), "{name}: {now:?}");
        }
    }
    assert_eq!(moving, 3);
}

#[test]
fn the_same_name_gives_the_same_bytes() {
    for (name, _) in crate::names() {
        let [a, b] = [(), ()].map(|()| crate::build(name).unwrap());
        assert_eq!(a.len(), b.len());
        for (a, b) in a.iter().zip(&b) {
            assert!(fingerprint(a) == fingerprint(b), "{name} differs from itself");
        }
    }
}

/// All numbers of an edit: large arrays as bytes, the rest as text.
fn fingerprint(edit: &Edit) -> (String, Vec<u8>) {
    match edit {
        Edit::Geometry(id, Geometry::Mesh(mesh)) => {
            let floats = mesh.positions.iter().chain(&mesh.normals).flat_map(|v| v.to_array());
            let floats = floats.chain(mesh.uvs[0].iter().flat_map(|uv| uv.to_array()));
            let indices = mesh.indices.iter().flatten().flat_map(|i| i.to_le_bytes());
            (id.to_string(), floats.flat_map(f32::to_le_bytes).chain(indices).collect())
        }
        Edit::Texture(id, texture) => match &texture.image.pixels {
            Pixels::Rgba8(pixels) => (id.to_string(), pixels.clone()),
            Pixels::RgbaF32(pixels) => {
                (id.to_string(), pixels.iter().flat_map(|v| v.to_le_bytes()).collect())
            }
        },
        other => (format!("{other:?}"), Vec::new()),
    }
}
