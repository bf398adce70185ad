//! What becomes of small maps, and of broken ones.

use std::collections::BTreeMap;

use glam::{Vec2, Vec3, Vec4};
use heliostat_scene::{AlphaMode, Environment, Geometry, LightKind, Material, Mesh, Scene};

use super::lumps::HEADER;
use super::patch::{Piece, Point, TOLERANCE, pieces};
use super::sample::Sample;
use crate::{Limits, Loaded, Memory, NoFiles, load_bytes};

/// Uncompressed TGA of 2×1 pixels, orange and blue.
const IMAGE: [u8; 24] = [0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, 24, 0, 0, 128, 255, 255, 0, 0];

fn files(script: &str) -> Memory {
    let mut files = BTreeMap::new();
    files.insert("../scripts/a.shader".to_owned(), script.as_bytes().to_vec());
    files.insert("../textures/a/stone.tga".to_owned(), IMAGE.to_vec());
    Memory(files)
}

fn read_with(map: &Sample, script: &str, limits: &Limits) -> (Loaded, Scene) {
    let loaded = load_bytes("game/maps/a.bsp", &map.bytes(), &files(script), limits).unwrap();
    let mut scene = Scene::default();
    scene.apply(&loaded.edits).unwrap();
    (loaded, scene)
}

fn read(map: &Sample, script: &str) -> (Loaded, Scene) {
    read_with(map, script, &Limits::default())
}

fn material<'a>(scene: &'a Scene, name: &str) -> &'a Material {
    scene.materials().values().find(|material| material.name == name).unwrap()
}

fn meshes(scene: &Scene) -> Vec<&Mesh> {
    scene.geometries().values().filter_map(Geometry::as_mesh).map(AsRef::as_ref).collect()
}

#[test]
fn every_kind_of_face_and_entity() {
    let (loaded, scene) = read(&Sample::everything(), Sample::SCRIPT);
    assert_eq!(scene.objects().values().map(|o| o.name.as_str()).collect::<Vec<_>>(), ["world", "model 1"]);
    assert_eq!(
        scene.instances().values().map(|i| i.name.as_str()).collect::<Vec<_>>(),
        ["world", "func_door"]
    );
    let kinds: Vec<_> = scene.lights().values().map(|light| light.kind.clone()).collect();
    assert!(
        matches!(kinds[..], [LightKind::Directional { .. }, LightKind::Spot { .. }, LightKind::Point { .. }]),
        "{kinds:?}"
    );
    assert_eq!(scene.cameras().len(), 1);
    assert_eq!(scene.textures().len(), 2, "repeated and clamped");
    let told: Vec<_> = loaded.diagnostics.iter().map(|d| d.message.as_str()).collect();
    let faces = "shown: 2 polygons, 1 patches, 1 meshes; left out: 1 flares, 1 faces that are not drawn, \
        1 of the sky";
    assert!(told.contains(&faces), "{told:#?}");
    assert!(told.contains(&"1 images found, 0 missing"), "{told:#?}");
    assert!(told.contains(&"1 of `func_door` stand still where the map has them"), "{told:#?}");
    // The floor's square, in metres and facing up.
    let floor = meshes(&scene)[0];
    let [a, b, c] = floor.indices[0].map(|i| floor.positions[i as usize]);
    assert!((b - a).cross(c - a).normalize().abs_diff_eq(Vec3::Y, 1e-6));
    assert_eq!(floor.normals[0], Vec3::Y);
    assert!(floor.positions[..4].contains(&Vec3::new(2.0, 0.0, -2.0)));
    // The ambient light of the world, times what the stone reflects.
    assert!(material(&scene, "textures/a/stone").ambient.abs_diff_eq(Vec3::splat(10.0 / 255.0), 1e-6));
}

#[test]
fn light_of_surfaces_is_that_of_their_script_in_the_mean() {
    let (_, scene) = read(&Sample::everything(), Sample::SCRIPT);
    let lamp = material(&scene, "textures/a/lamp");
    // The image's mean is (1, 0.5², …)/2; its brightest channel is to give 3 · 100 / 255.
    let orange = 0.215_86; // 128/255, decoded from sRGB
    let image =
        super::images::mean(&heliostat_scene::Image::rgba8(2, 1, vec![255, 128, 0, 255, 0, 0, 255, 255]));
    assert!(image.abs_diff_eq(Vec3::new(0.5, 0.5 * orange, 0.5), 1e-4), "{image}");
    let mean = lamp.emissive * image;
    let hue = Vec3::new(1.0, orange.powf(1.0 / 2.2), 1.0);
    assert!(mean.abs_diff_eq(300.0 / 255.0 * hue, 1e-3), "{mean}");
    assert!(lamp.double_sided);
    let transform = lamp.emissive_texture.unwrap().transform;
    assert_eq!(transform.0.transform_point2(Vec2::ONE), Vec2::splat(2.0));
    // `rgbGen wave` at its mean, decoded.
    assert!(lamp.base_color.abs_diff_eq(Vec4::new(0.214, 0.214, 0.214, 1.0), 1e-3));
    let Environment::Map(_) = scene.environment() else { panic!() };
    let veil = material(&scene, "textures/a/sky");
    assert!(veil.emissive.abs_diff_eq(300.0 / 255.0 * hue, 1e-3) && veil.transmission == 1.0);
}

#[test]
fn scripts_become_materials() {
    let shader = |body: &str| {
        let (_, scene) = read(&Sample::everything(), &format!("textures/a/lamp {{ {body} }}"));
        material(&scene, "textures/a/lamp").clone()
    };
    let lightmap = "{ map $lightmap\n blendfunc filter }";
    let stone = "map textures/a/stone.tga\n";
    let grate = shader(&format!("{{ {stone} alphafunc GE128 }} {lightmap}"));
    assert_eq!(grate.alpha_mode, AlphaMode::Mask { cutoff: 0.5 });
    assert!(!grate.is_emissive());
    let fire = shader(&format!("cull none\n{{ {stone} blendfunc add }}"));
    assert!(fire.transmission == 1.0 && fire.volume.is_none() && fire.emissive == Vec3::ONE);
    let window = shader(&format!("{{ {stone} blendfunc filter }}"));
    assert!(window.transmission == 1.0 && window.base_color_texture.is_some() && !window.is_emissive());
    let water = shader(&format!(
        "surfaceparm water\n{{ {stone} blendfunc blend\n rgbgen vertex\n alphagen const 0.5 }}"
    ));
    assert_eq!((water.alpha_mode, water.base_color.w, water.specular), (AlphaMode::Blend, 0.5, 1.0));
    let chrome = shader(&format!("{{ {stone} tcgen environment }} {lightmap}"));
    assert!(chrome.metallic == 1.0 && chrome.base_color_texture.is_none());
    assert!((chrome.base_color.truncate().max_element() - 0.8).abs() < 1e-6);
    let screen = shader(&format!("{{ {stone} }}"));
    assert_eq!((screen.emissive, screen.base_color), (Vec3::ONE, Vec4::W));
    let unknown = shader("{ map textures/a/none.tga\n rgbgen vertex }");
    assert!(unknown.base_color_texture.is_some(), "a checkerboard");
}

#[test]
fn names_do_not_lead_out_of_the_folder() {
    let mut map = Sample::everything();
    map.texture("textures/../../secret", 0);
    map.floor(4, -1, [0.0; 3], 8.0);
    map.model();
    let mut files = files("").0;
    files.insert("../textures/../../secret.tga".to_owned(), IMAGE.to_vec());
    let loaded = load_bytes("game/maps/a.bsp", &map.bytes(), &Memory(files), &Limits::default()).unwrap();
    let told: Vec<_> = loaded.diagnostics.iter().map(|d| d.message.as_str()).collect();
    assert!(told.iter().any(|t| t.contains("1 names of images lead out")), "{told:#?}");
}

#[test]
fn the_folder_of_the_game_is_above_that_of_maps_or_the_maps_own() {
    let map = Sample::everything().bytes();
    let found = |name: &str, root: &str| {
        let image = format!("{root}TEXTURES/a/Stone.tga");
        let files = Memory([(image, IMAGE.to_vec())].into());
        let loaded = load_bytes(name, &map, &files, &Limits::default()).unwrap();
        loaded.diagnostics.iter().any(|d| d.message.starts_with("1 images found"))
    };
    assert!(found("game/Maps/a.bsp", "../") && found("a.bsp", "../"));
    assert!(found("game/a.bsp", "") && !found("game/a.bsp", "../"));
}

#[test]
fn baked_light_is_that_of_the_light_map() {
    let limits = Limits { lightmaps: true, ..Limits::default() };
    let (_, scene) = read_with(&Sample::everything(), Sample::SCRIPT, &limits);
    assert!(scene.lights().is_empty());
    assert!(material(&scene, "textures/a/stone").unlit);
    // (64, 96, 200) twice as bright, scaled back to white at most, decoded.
    let expected = (Vec3::new(128.0, 192.0, 400.0) / 400.0).map(crate::image::pixels::srgb_to_linear);
    let floor = meshes(&scene)[0];
    assert!(floor.colors.iter().all(|c| c.truncate().abs_diff_eq(expected, 1e-3)), "{:?}", floor.colors[0]);
    for triangle in floor.indices.iter() {
        let [a, b, c] = triangle.map(|i| floor.positions[i as usize]);
        let longest = (a - b).length().max((b - c).length()).max((c - a).length());
        assert!(longest <= 0.5 + 1e-5, "edges of half a metre, 16 units: {longest}");
    }
    // The square of 2 m and the arch over a square of 4 m.
    assert!((area(floor) - (4.0 + 16.0 * PARABOLA)).abs() < 0.01, "{}", area(floor));
}

/// Length of the parabola over a chord of 4 with a middle control point 2 above it, per metre of chord:
/// (√2 + asinh 1) / 2.
const PARABOLA: f32 = 1.147_793_6;

fn area(mesh: &Mesh) -> f32 {
    let triangle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        0.5 * (b - a).cross(c - a).length()
    };
    mesh.indices.iter().map(triangle).sum()
}

/// Three rows of control points at these heights over a grid of `spacing`.
fn control(heights: [[f32; 3]; 3], spacing: f32) -> Vec<Point> {
    let point = |row: usize, column: usize| Point {
        position: Vec3::new(column as f32 * spacing, row as f32 * spacing, heights[row][column]),
        normal: Vec3::Z,
        uvs: [Vec2::new(column as f32, row as f32) / 2.0; 2],
        color: Vec4::ONE,
    };
    (0..9).map(|i| point(i / 3, i % 3)).collect()
}

fn piece(points: &[Point]) -> Piece {
    pieces(points, [3, 3]).next().unwrap()
}

/// The biquadratic surface by repeated linear interpolation.
fn de_casteljau(points: &[Point], u: f32, v: f32) -> Vec3 {
    let curve = |a: Vec3, b: Vec3, c: Vec3, t: f32| a.lerp(b, t).lerp(b.lerp(c, t), t);
    let rows = [0, 1, 2].map(|row| {
        let p = |column: usize| points[3 * row + column].position;
        curve(p(0), p(1), p(2), u)
    });
    curve(rows[0], rows[1], rows[2], v)
}

#[test]
fn patches_are_as_close_to_the_surface_as_promised() {
    for heights in [
        [[0.0; 3]; 3],
        [[0.0, 64.0, 0.0]; 3],
        [[0.0, 0.5, 1.0], [0.0, 0.0, 0.0], [1.0, 0.5, 0.0]],
        [[0.0, 0.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, 0.0]],
        [[0.0, 90.0, -30.0], [10.0, 80.0, 20.0], [-40.0, 5.0, 60.0]],
    ] {
        let points = control(heights, 64.0);
        let piece = piece(&points);
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        piece.triangulate(&mut vertices, &mut triangles);
        assert!(vertices.len() == piece.vertices() && triangles.len() <= piece.triangles());
        // The control points are spaced evenly: x and y are u and v. So are texture coordinates.
        let mut area = 0.0;
        for triangle in &triangles {
            let [a, b, c] = triangle.map(|i| vertices[i as usize]);
            let (p, q) = (b.position - a.position, c.position - a.position);
            area -= 0.5 * p.truncate().perp_dot(q.truncate());
            for w in (0..=6).flat_map(|i| (0..=6 - i).map(move |j| Vec2::new(i as f32, j as f32) / 6.0)) {
                let at = a.position * (1.0 - w.x - w.y) + b.position * w.x + c.position * w.y;
                let exact = de_casteljau(&points, at.x / 128.0, at.y / 128.0);
                assert!((at - exact).length() <= TOLERANCE, "{heights:?}: {at} is not {exact}");
            }
            assert!((a.uvs[0] - a.position.truncate() / 128.0).length() < 1e-4);
        }
        // Nothing is covered twice or left open.
        assert!((area - 128.0 * 128.0).abs() < 1.0, "{heights:?}: {area}");
    }
}

#[test]
fn straight_patches_have_no_more_triangles_than_they_need() {
    assert_eq!(piece(&control([[0.0; 3]; 3], 64.0)).triangles(), 2);
    let arch = piece(&control([[0.0, 64.0, 0.0]; 3], 64.0));
    assert_eq!(arch.triangles(), arch.vertices() - 2, "one strip");
}

/// Positions along the border of a piece, at y = 0, bit by bit.
fn border(points: &[Point]) -> Vec<[u32; 3]> {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    piece(points).triangulate(&mut vertices, &mut triangles);
    let used = triangles.into_iter().flatten().map(|i| vertices[i as usize].position);
    let mut border: Vec<_> =
        used.filter(|p| p.y.abs() < 1e-6).map(|p| (p + Vec3::ZERO).to_array().map(f32::to_bits)).collect();
    border.sort_unstable();
    border.dedup();
    border
}

#[test]
fn pieces_that_share_a_border_share_its_vertices() {
    // One border, and on the other side something far more or less curved, read from all sides.
    let shared = [[0.1, 37.3, 5.7], [0.0, -33.3, 71.1], [3.0; 3]];
    let first = border(&control(shared, 21.7));
    assert!(first.len() > 4);
    for other in [[[0.0; 3]; 2], [[3.0, 500.0, 1.0], [0.0, -80.0, 0.0]]] {
        let points = control([shared[0], other[0], other[1]], 21.7);
        let turned = |at: fn(usize, usize) -> usize| -> Vec<Point> {
            (0..9).map(|i| points[at(i / 3, i % 3)]).collect()
        };
        let ways: [fn(usize, usize) -> usize; 4] =
            [|r, c| 3 * r + c, |r, c| 3 * (2 - r) + c, |r, c| 3 * r + 2 - c, |r, c| 3 * (2 - c) + r];
        for way in ways {
            assert_eq!(border(&turned(way)), first);
        }
    }
}

#[test]
fn a_patch_of_several_pieces_is_closed() {
    // 5×5 control points: every edge of its triangles is shared by two, but for those of the rim.
    let height = |i: usize| ((i * 37) % 23) as f32 * 4.0;
    let points: Vec<Point> = (0..25)
        .map(|i| Point {
            position: Vec3::new((i % 5) as f32 * 32.0, (i / 5) as f32 * 32.0, height(i)),
            ..Point::default()
        })
        .collect();
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for piece in pieces(&points, [5, 5]) {
        piece.triangulate(&mut vertices, &mut triangles);
    }
    let mut edges: BTreeMap<_, i32> = BTreeMap::new();
    for t in triangles {
        let p = t.map(|i| vertices[i as usize].position.to_array().map(f32::to_bits));
        for (a, b) in [(p[0], p[1]), (p[1], p[2]), (p[2], p[0])] {
            *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
        }
    }
    let on_rim = |p: &[u32; 3]| {
        let [x, y] = [0, 1].map(|axis| f32::from_bits(p[axis]));
        x == 0.0 || y == 0.0 || x == 128.0 || y == 128.0
    };
    for ((a, b), open) in edges {
        assert!(open == 0 || (on_rim(&a) && on_rim(&b)), "an open edge inside");
    }
}

/// A file with a number replaced.
fn with(mut bytes: Vec<u8>, at: usize, value: i32) -> Vec<u8> {
    bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    bytes
}

fn error(bytes: &[u8]) -> String {
    let loaded = load_bytes("a.bsp", bytes, &NoFiles, &Limits::default());
    loaded.map_or_else(|error| error.to_string(), |_| "no error".to_owned())
}

#[test]
fn broken_files_are_errors_that_say_what() {
    let good = Sample::everything().bytes();
    let lump = |index: usize| 8 + 8 * index;
    let start = |index: usize| i32::from_le_bytes(*good[lump(index)..].first_chunk().unwrap()) as usize;
    let faces = start(13);
    let cases = [
        (good[..HEADER - 1].to_vec(), "the header alone takes 144"),
        (with(good.clone(), 4, 47), "version 47"),
        (with(good.clone(), lump(2), -1), "lump 2 is said to have"),
        (with(good.clone(), lump(13) + 4, i32::MAX), "lump 13 is said to have"),
        (with(good.clone(), lump(16) + 4, -4), "lump 16 is said to have -4 bytes"),
        (with(good.clone(), lump(10) + 4, 45), "the lump of vertices has 45 bytes"),
        (with(good.clone(), lump(1) + 4, 71), "the lump of textures has 71 bytes"),
        (with(good.clone(), lump(7) + 4, 0), "there is no model"),
        (with(good.clone(), start(7) + 28, 100), "model 0 has 100 faces"),
        (with(with(good.clone(), start(7) + 64, 0), start(7) + 68, 2), "the models share faces"),
        (with(good.clone(), faces, 4), "face 0 has texture 4 of 4"),
        (with(good.clone(), faces, -1), "face 0 has texture -1 of 4"),
        (with(good.clone(), faces + 8, 5), "face 0 is of kind 5"),
        (with(good.clone(), faces + 12, -1), "face 0 has 4 vertices from -1"),
        (with(good.clone(), faces + 16, i32::MAX), "face 0 has 2147483647 vertices"),
        (with(good.clone(), faces + 24, 5), "face 0 has 5 mesh vertices, which are no whole"),
        (with(good.clone(), faces + 20, 1 << 30), "face 0 has 6 mesh vertices from 1073741824"),
        (with(good.clone(), faces + 3 * 104 + 96, 4), "a patch of 4×3"),
        (with(good.clone(), faces + 3 * 104 + 100, 1), "a patch of 3×1"),
        (with(good.clone(), faces + 3 * 104 + 100, 5), "a patch of 3×5 control points but has 9"),
        (with(good.clone(), faces + 3 * 104 + 96, 0x7FFF_FFFF), "a patch of 2147483647×3"),
        (with(good.clone(), start(11), 4), "mesh vertex 0 is vertex 4 of a face of 4"),
        (with(good.clone(), start(11) + 4, -7), "mesh vertex 1 is vertex -7"),
        (with(good.clone(), start(0), i32::from_le_bytes(*b"} { ")), "`}` outside of an entity"),
    ];
    for (bytes, problem) in cases {
        let error = error(&bytes);
        assert!(error.contains(problem), "{error}, not: {problem}");
    }
}

#[test]
fn limits_hold() {
    let map = Sample::everything().bytes();
    for limits in [
        Limits { vertices: 20, ..Limits::default() },
        Limits { triangles: 10, ..Limits::default() },
        Limits { materials: 2, ..Limits::default() },
        Limits { memory_bytes: map.len() as u64 + 1000, ..Limits::default() },
    ] {
        let result = load_bytes("game/maps/a.bsp", &map, &files(Sample::SCRIPT), &limits);
        assert!(matches!(result, Err(crate::LoadError::Limit(_))), "{limits:?}");
    }
}

/// Steele, Lea, Flood, 2014: the same numbers in every run.
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[test]
fn damage_anywhere_gives_an_error_or_a_valid_scene() {
    let good = Sample::everything().bytes();
    let limits = Limits { memory_bytes: 1 << 24, vertices: 1 << 16, triangles: 1 << 16, ..Limits::default() };
    let (lamp, _) = Sample::SCRIPT.split_once("textures/a/sky").unwrap();
    let mut state = 1;
    let (mut loads, mut errors) = (0, 0);
    for round in 0..1500 {
        let mut bytes = good.clone();
        if round % 4 == 0 {
            bytes.truncate(next(&mut state) as usize % bytes.len());
        }
        // Not in the pages of the light map, where nothing can break.
        let reach = bytes.len().min(good.len() - 3 * 128 * 128);
        for _ in 0..=round % 3 {
            let at = next(&mut state) as usize % reach.max(1);
            let value = [0, 0x7F, 0x80, 0xFF, next(&mut state) as u8][next(&mut state) as usize % 5];
            if let Some(byte) = bytes.get_mut(at) {
                *byte = value;
            }
        }
        let limits = Limits { lightmaps: round % 2 == 0, ..limits.clone() };
        // The picture of a sky takes time.
        let script = if round % 32 == 0 { Sample::SCRIPT } else { lamp };
        match load_bytes("game/maps/a.bsp", &bytes, &files(script), &limits) {
            Ok(loaded) => {
                Scene::default().apply(&loaded.edits).unwrap();
                loads += 1;
            }
            Err(error) => {
                assert!(!error.problem().is_empty());
                errors += 1;
            }
        }
    }
    assert!(loads > 100 && errors > 100, "{loads} loads, {errors} errors");
}
