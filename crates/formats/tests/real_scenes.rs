//! Loads every real scene of the supported formats. The files lie where `HELIOSTAT_SCENES` points; without it these
//! tests pass and say what did not run.
#![expect(clippy::print_stdout, reason = "tests say what they found")]

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use glam::Vec3;
use heliostat_formats::image::decode;
use heliostat_formats::{Limits, Loaded, NoFiles, Severity, ies, load};
use heliostat_scene::{CameraId, Edit, Geometry, Instance, ObjectId, Pixels, Scene};

/// The folder of real scenes, or a line on stderr.
fn scenes(test: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("HELIOSTAT_SCENES").map(PathBuf::from);
    if folder.is_none() {
        // Past the test harness, which keeps what passing tests print to itself.
        _ = writeln!(std::io::stderr(), "{test} did not run: HELIOSTAT_SCENES is not set");
    }
    folder
}

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files(&path, found);
        } else if [".gltf", ".glb", ".obj", ".ply", ".ply.gz", ".nff", ".bsp"]
            .iter()
            .any(|e| path.to_string_lossy().ends_with(e))
        {
            found.push(path);
        }
    }
}

fn applied(path: &Path) -> (Loaded, Scene) {
    let loaded = load(path, &Limits::default()).unwrap_or_else(|error| panic!("{error}"));
    let mut scene = Scene::default();
    scene.apply(&loaded.edits).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    (loaded, scene)
}

/// Triangles that the scene shows: those of each object as often as it is instanced.
fn shown_triangles(scene: &Scene) -> usize {
    let mut below: BTreeMap<ObjectId, usize> = BTreeMap::new();
    let sum = |parent: Option<ObjectId>, below: &BTreeMap<ObjectId, usize>| -> usize {
        scene.placed_in(parent).map(|id| below[&scene.instances()[&id].object]).sum()
    };
    for id in scene.bottom_up() {
        let own = scene.objects()[&id]
            .parts
            .iter()
            .map(|part| scene.geometries()[&part.geometry].as_mesh().map_or(0, |mesh| mesh.indices.len()));
        let total = own.sum::<usize>() + sum(Some(id), &below);
        below.insert(id, total);
    }
    sum(None, &below)
}

#[test]
fn every_scene_loads_and_is_accepted() {
    let Some(folder) = scenes("every_scene_loads_and_is_accepted") else { return };
    let mut paths = Vec::new();
    files(&folder, &mut paths);
    assert!(paths.len() > 500, "only {} files below {}", paths.len(), folder.display());
    for path in paths {
        let (loaded, scene) = applied(&path);
        assert!(shown_triangles(&scene) > 0, "{} shows nothing", path.display());
        let bounds = scene.bounds().unwrap();
        assert!(bounds.min.is_finite() && bounds.max.is_finite());
        for diagnostic in loaded.diagnostics.iter().filter(|d| d.severity == Severity::Warning) {
            println!("{diagnostic}");
        }
    }
}

#[test]
fn triangle_counts_are_those_of_the_index() {
    let Some(folder) = scenes("triangle_counts_are_those_of_the_index") else { return };
    for (file, triangles) in [
        ("cornell-mcguire/CornellBox-Glossy.obj", 1_112),
        ("cornell-mcguire/CornellBox-Mirror.obj", 36),
        ("cornell-mcguire/CornellBox-Original.obj", 36),
        ("cornell-mcguire/CornellBox-Sphere.obj", 2_188),
        ("gltf/2CylinderEngine/2CylinderEngine.glb", 121_496),
        ("gltf/AnimatedMorphCube/AnimatedMorphCube.gltf", 12),
        ("gltf/BoxTextured/BoxTextured.gltf", 12),
        ("gltf/CesiumMan/CesiumMan.glb", 4_672),
        ("gltf/ClearCoat-glTF/ClearCoatTest.gltf", 37_116),
        ("gltf/CornellBox-bevy/CornellBox.glb", 36),
        ("gltf/DamagedHelmet/DamagedHelmet.glb", 15_452),
        ("gltf/FlightHelmet/FlightHelmet.gltf", 94_722),
        ("gltf/Fox/Fox.glb", 576),
        ("gltf/MorphStressTest/MorphStressTest.gltf", 2_412),
        ("gltf/NormalTangentTest/NormalTangentTest.glb", 7_774),
        ("gltf/PalmTree/PalmTree.gltf", 10_124),
        ("gltf/SimpleSkin/SimpleSkin.gltf", 8),
        ("gltf/TransmissionRoughnessTest/TransmissionRoughnessTest.glb", 77_792),
        ("gltf/cameras/Cameras.gltf", 2),
        ("gltf/punctual_lights-castle/test_lights.glb", 1_730),
        ("gltf/punctual_lights-castle/test_lights.gltf", 1_730),
        ("gltf/textureTransform/TextureTransformTest.gltf", 24),
        ("meshes/cow.obj", 5_804),
        ("meshes/fandisk.obj", 12_946),
        ("meshes/spot/spot_triangulated.obj", 5_856),
        ("meshes/stanford-bunny.obj", 69_451),
        ("meshes/suzanne.obj", 968),
        ("meshes/teapot.obj", 6_320),
        ("office-mgf/office.obj", 51_544),
        ("sponza-dabrovic/sponza.obj", 66_450),
        ("stanford-dragon/dragon_vrip.ply.gz", 871_414),
        ("stanford-dragon/dragon_vrip_res2.ply.gz", 202_520),
        ("stanford-dragon/dragon_vrip_res3.ply.gz", 47_794),
        ("stanford-dragon/dragon_vrip_res4.ply.gz", 11_102),
    ] {
        let start = std::time::Instant::now();
        let (_, scene) = applied(&folder.join(file));
        println!("{file}: {} ms", start.elapsed().as_millis());
        assert_eq!(shown_triangles(&scene), triangles, "{file}");
    }
}

/// Spheres and cones of all geometries, each once.
fn quadrics(scene: &Scene) -> usize {
    let shapes = scene.geometries().values().filter(|geometry| geometry.as_mesh().is_none());
    shapes.map(Geometry::primitives).sum()
}

#[test]
fn shapes_of_the_standard_databases_are_those_of_the_index() {
    let Some(folder) = scenes("shapes_of_the_standard_databases_are_those_of_the_index") else { return };
    for (file, triangles, shapes) in [
        ("balls3", 2, 820),
        ("gears2", 4_578, 0),
        ("mount5", 2_048, 4),
        ("rings3", 2, 840),
        ("teapot8", 4_160, 0),
        ("tetra5", 1_024, 0),
        ("tree7", 2, 510),
    ] {
        let (loaded, scene) = applied(&folder.join("spd-nff").join(file).with_extension("nff"));
        assert_eq!(loaded.diagnostics, [], "{file}");
        assert_eq!((shown_triangles(&scene), quadrics(&scene)), (triangles, shapes), "{file}");
        assert_eq!(scene.cameras().len(), 1, "{file}");
    }
}

/// Warnings and the count of notes.
fn warnings(loaded: &Loaded) -> Vec<String> {
    let all = loaded.diagnostics.iter().filter(|d| d.severity == Severity::Warning);
    all.map(ToString::to_string).collect()
}

#[test]
fn the_robots_march_through_their_city() {
    let Some(folder) = scenes("the_robots_march_through_their_city") else { return };
    let (mut loaded, mut scene) = applied(&folder.join("bart-robots/aff/Robot.aff"));
    // The gun of the first robot is wound back.
    let warnings = warnings(&loaded);
    assert!(
        warnings.len() == 1 && warnings[0].contains("Robot1.aff:364:1: the time 42 lies before"),
        "{warnings:?}"
    );
    assert_eq!((shown_triangles(&scene), scene.lights().len()), (71_708, 1));
    assert!(scene.textures().values().all(|texture| texture.image.width > 2), "no placeholders");
    let rate = loaded.timeline.clips()[0].frame_rate.unwrap();
    assert_eq!((loaded.timeline.duration(), rate), (50.0, 799.0 / 50.0));
    // The city stands; ten robots move in the world, and their limbs in them.
    let world = |scene: &Scene| -> Vec<Instance> {
        scene.instances().values().filter(|instance| instance.parent.is_none()).cloned().collect()
    };
    assert_eq!(world(&scene).len(), 11);
    // Keys of the first robot: `robot_transl1`, while `step_transl1` is at rest between two steps.
    for (time, expected) in [(0.0, [-5.0, 0.0, -236.0]), (16.8, [-8.0, 0.0, -152.0])] {
        scene.apply(&loaded.timeline.edits_at(time)).unwrap();
        let robot = &world(&scene)[1].parent_from_object;
        assert!((Vec3::from(robot.translation) - Vec3::from(expected)).length() < 0.1, "{time}: {robot}");
        // `xs 2 2 2` is part of the way.
        assert!((robot.matrix3.determinant() - 8.0).abs() < 1e-3);
    }
    let camera = |scene: &Scene| Vec3::from(scene.cameras()[&CameraId(0)].world_from_camera.translation);
    scene.apply(&loaded.timeline.edits_at(33.0)).unwrap();
    assert!(camera(&scene).abs_diff_eq(Vec3::new(0.0, 23.0, 106.0), 1e-3), "{}", camera(&scene));
    // Between two frames the robots move, and nothing else than instances and the camera.
    let edits = loaded.timeline.edits_at(33.0 + 1.0 / rate);
    let moves = |edit: &Edit| matches!(edit, Edit::MoveInstance(..) | Edit::Camera(..));
    assert!(edits.len() > 100 && edits.iter().all(moves), "{} edits", edits.len());
}

#[test]
fn the_museum_shows_its_art() {
    let Some(folder) = scenes("the_museum_shows_its_art") else { return };
    let (mut loaded, mut scene) = applied(&folder.join("bart-museum/aff/museum5.aff"));
    assert_eq!(warnings(&loaded), [""; 0]);
    assert_eq!((shown_triangles(&scene), quadrics(&scene)), (10_284 + 1_024, 8));
    assert_eq!((scene.lights().len(), scene.textures().len()), (2, 5));
    assert_eq!((loaded.timeline.duration(), loaded.timeline.clips()[0].frame_rate), (6.0, Some(299.0 / 6.0)));
    let art = |scene: &Scene| {
        let objects = scene.objects().values().filter(|object| object.name == "animated triangles");
        let geometry = objects.map(|object| object.parts[0].geometry).next().unwrap();
        scene.geometries()[&geometry].as_mesh().unwrap().clone()
    };
    // Keys lie at 0 to 4 of the file's time, which begins at −1; halfway the mean of two.
    let mut at = |time: f64| {
        scene.apply(&loaded.timeline.edits_at(time)).unwrap();
        let mesh = art(&scene);
        assert_eq!(mesh.indices.len(), 1_024);
        mesh.positions[0]
    };
    let (first, second) = (Vec3::new(-0.4474, 1.549333, 0.085189), Vec3::new(-0.12107, 3.370914, 0.157006));
    assert_eq!((at(0.0), at(1.0), at(2.0)), (first, first, second));
    assert!(at(1.5).abs_diff_eq(first.midpoint(second), 1e-6));
}

#[test]
fn environment_maps_are_read() {
    let Some(folder) = scenes("environment_maps_are_read") else { return };
    // The two EXR files have DWAB compression.
    for (name, size) in [
        ("royal_esplanade_256.hdr", [256, 128]),
        ("interior.exr", [1024, 512]),
        ("courtyard.exr", [1024, 512]),
    ] {
        let bytes = std::fs::read(folder.join("envmaps").join(name)).unwrap();
        let image = decode(name, &bytes, &Limits::default()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!([image.width, image.height], size, "{name}");
        let Pixels::RgbaF32(values) = image.pixels else { panic!("{name} has 8 bits") };
        // Lossy compression may leave black a little below 0.
        let lowest = values.iter().copied().fold(f32::INFINITY, f32::min);
        assert!(values.iter().all(|v| v.is_finite()) && lowest > -0.01, "{name}: {lowest}");
        assert!(values.iter().any(|v| *v > 1.5), "{name} has nothing bright in it");
    }
}

#[test]
fn maps_have_the_faces_lights_and_images_of_their_files() {
    let Some(folder) = scenes("maps_have_the_faces_lights_and_images_of_their_files") else { return };
    for (file, faces, images, lights, suns, cameras, objects) in [
        (
            "quake3-aggressor/maps/aggressor.bsp",
            "shown: 1206 polygons, 0 patches, 0 meshes; left out: 74 flares, 0 faces that are not drawn, 3 of the sky",
            "26 images found, 0 missing",
            84,
            1,
            7,
            1,
        ),
        (
            "quake3-kaos/maps/kaos.bsp",
            "shown: 3421 polygons, 193 patches, 0 meshes; left out: 502 flares, 0 faces that are not drawn, 36 of the sky",
            "60 images found, 0 missing",
            30,
            1,
            13,
            6,
        ),
    ] {
        let (loaded, scene) = applied(&folder.join(file));
        let told: Vec<_> = loaded.diagnostics.iter().map(|d| d.message.as_str()).collect();
        assert!(told.iter().any(|t| t.starts_with(faces)), "{file}: {told:#?}");
        assert!(told.iter().any(|t| t.starts_with(images)), "{file}: {told:#?}");
        let is_sun = |light: &&heliostat_scene::Light| {
            matches!(light.kind, heliostat_scene::LightKind::Directional { .. })
        };
        assert_eq!(scene.lights().values().filter(is_sun).count(), suns, "{file}");
        assert_eq!(scene.lights().len() - suns, lights, "{file}");
        assert_eq!((scene.cameras().len(), scene.objects().len()), (cameras, objects), "{file}");
        fronts_agree_with_normals(file, &scene);
        let limits = Limits { lightmaps: true, ..Limits::default() };
        let baked = load(&folder.join(file), &limits).unwrap();
        let mut scene = Scene::default();
        scene.apply(&baked.edits).unwrap();
        println!("{file}: {} triangles with baked light", shown_triangles(&scene));
        assert!(scene.lights().is_empty() && shown_triangles(&scene) < 2_000_000, "{file}");
    }
}

#[test]
fn headlamps_have_the_beams_of_their_tables() {
    let Some(folder) = scenes("headlamps_have_the_beams_of_their_tables") else { return };
    // Candela by 179 lm/W where the beam is brightest, degrees to the right and up; lumens by the midpoint rule over the
    // table, apart from this crate.
    for (file, h, v, candela, lumens) in [
        ("highbeam.dat", 0.0_f32, 0.0_f32, 25_114.95, 385.81),
        ("lowbeam.dat", 5.0, -2.5, 12_711.29, 257.25),
        ("syl2a.dat", 2.5, -1.5, 2_576.01, 21.499),
    ] {
        let bytes = std::fs::read(folder.join("radiance-headlamp").join(file)).unwrap();
        let profile = ies::read(file, &bytes, &NoFiles, &Limits::default()).unwrap().profile;
        println!("{file}: {:.1} lm, at most {:.0} cd", profile.flux(), profile.peak());
        let brightest = profile.at((90.0 - h).to_radians(), v.to_radians());
        assert!((brightest / candela - 1.0).abs() < 1e-3 && (profile.peak() / candela - 1.0).abs() < 1e-3);
        assert!((profile.flux() / lumens - 1.0).abs() < 1e-3, "{file}: {} lm", profile.flux());
    }
}

/// The front of each triangle is the side of its vertices' normals, but for slivers.
fn fronts_agree_with_normals(file: &str, scene: &Scene) {
    let (mut agree, mut all) = (0, 0);
    for mesh in scene.geometries().values().filter_map(Geometry::as_mesh) {
        for triangle in mesh.indices.iter() {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            let normal: Vec3 = triangle.iter().map(|&i| mesh.normals[i as usize]).sum();
            let cross = (b - a).cross(c - a);
            let is_sliver = cross.length() < 1e-4 * (b - a).length_squared().max((c - b).length_squared());
            agree += usize::from(is_sliver || cross.dot(normal) > 0.0);
            all += 1;
        }
    }
    println!("{file}: {agree} of {all} triangles");
    // At creases of patches, narrow triangles lean against the mean of their vertices' normals.
    assert!(agree * 1000 >= all * 999, "{file}: {agree} of {all}");
}
