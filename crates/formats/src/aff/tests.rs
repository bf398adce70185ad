//! Tests of the AFF importer.

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{
    CameraId, Edit, Geometry, GeometryId, Instance, InstanceId, LightId, LightKind, Scene,
};

use super::*;
use crate::{Limits, Loaded, Memory, NoFiles, load_bytes};

const VIEW: &str = "v from 0 0 5 at 0 0 0 up 0 1 0 angle 45 hither 1 resolution 800 600\n";

fn read(text: &str, files: &[(&str, &str)]) -> Result<Loaded, LoadError> {
    let files = files.iter().map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec())).collect();
    load_bytes("test.aff", text.as_bytes(), &Memory(files), &Limits::default())
}

/// A file without diagnostics, as its scene at the start.
fn scene(text: &str, files: &[(&str, &str)]) -> (Scene, Timeline) {
    let loaded = read(&format!("{VIEW}{text}"), files).unwrap();
    assert_eq!(loaded.diagnostics, []);
    let mut scene = Scene::default();
    scene.apply(&loaded.edits).unwrap();
    (scene, loaded.timeline)
}

fn at(scene: &mut Scene, timeline: &mut Timeline, time: f64) -> Vec<Edit> {
    let edits = timeline.edits_at(time);
    scene.apply(&edits).unwrap();
    edits
}

/// Four keys over −1 to 2 of a translation along x: 0, 0, 2, 2, straight by full tension.
fn slide(name: &str) -> String {
    let keys = [(-1, 0), (0, 0), (1, 2), (2, 2)].map(|(time, x)| format!("{time} {x} 0 0 1 0 0\n"));
    format!("k {name} {{ transl 4 {} }}\n", keys.concat())
}

fn instance(scene: &Scene, id: u32) -> &Instance {
    &scene.instances()[&InstanceId(id)]
}

#[test]
fn keyframes_move_one_instance() {
    let (mut scene, mut timeline) =
        scene(&format!("a 0 1 11\nx ball {{ s 0 0 0 1 }}\n{}", slide("ball")), &[]);
    assert_eq!(timeline.duration(), 1.0);
    assert_eq!(timeline.clips()[0].frame_rate, Some(10.0));
    assert_eq!(at(&mut scene, &mut timeline, 0.0).len(), 1);
    // A full tension leaves u² (3 − 2 u).
    for (time, x) in [(0.25, 0.3125), (0.5, 1.0), (1.0, 2.0), (9.0, 2.0)] {
        at(&mut scene, &mut timeline, time);
        let place = instance(&scene, 0).parent_from_object;
        assert!(place.translation.abs_diff_eq(glam::Vec3A::new(x, 0.0, 0.0), 1e-6), "{time}: {place}");
    }
    assert_eq!(at(&mut scene, &mut timeline, 5.0).len(), 0);
}

#[test]
fn scale_comes_before_rotation_and_translation() {
    let keys = "rot 4 0 0 0 2 90 0 0 0 0 0 0 2 90 0 0 0 1 0 0 2 90 0 0 0 1 0 0 2 90 0 0 0
        scale 4 0 2 3 4 0 0 0 0 2 3 4 0 0 0 1 2 3 4 0 0 0 1 2 3 4 0 0 0
        transl 4 0 7 0 0 0 0 0 0 7 0 0 0 0 0 1 7 0 0 0 0 0 1 7 0 0 0 0 0";
    let (scene, _) = scene(&format!("x a {{ s 0 0 0 1 }}\nk a {{ {keys} }}"), &[]);
    let p = instance(&scene, 0).parent_from_object.transform_point3(Vec3::X);
    assert!(p.abs_diff_eq(Vec3::new(7.0, 2.0, 0.0), 1e-5), "{p}");
}

#[test]
fn blocks_that_hold_one_another_are_one_instance_and_others_nest() {
    let text = format!(
        "x outer {{ xs 2 2 2 0 1 0 0 0 1 0 {{ x inner {{
            s 0 0 0 1
            xs 1 1 1 0 1 0 0 5 0 0 {{ c 0 0 0 1 0 1 0 1 }}
            x hand {{ p 3 0 0 0 1 0 0 0 1 0 }}
        }} }} }}\n{}{}{}",
        slide("outer"),
        slide("inner"),
        slide("hand")
    );
    let (mut scene, mut timeline) = scene(&text, &[]);
    // The three outer blocks are one; the cone and the hand stand in it.
    assert_eq!(scene.instances().len(), 3);
    let outer: Vec<_> = scene.instances().values().filter(|i| i.parent.is_none()).collect();
    assert_eq!(outer.len(), 1);
    let arm = outer[0].object;
    assert!(scene.instances().values().filter(|i| i.parent == Some(arm)).count() == 2);
    at(&mut scene, &mut timeline, 1.0);
    let outer = scene.instances().values().find(|i| i.parent.is_none()).unwrap();
    // 2 by the outer slide, up by 1, and 2 · 2 by the inner slide.
    let origin = outer.parent_from_object.transform_point3(Vec3::ZERO);
    assert!(origin.abs_diff_eq(Vec3::new(6.0, 1.0, 0.0), 1e-5), "{origin}");
    let cone = scene
        .instances()
        .values()
        .find(|i| i.parent == Some(arm) && i.parent_from_object == Affine3A::from_translation(5.0 * Vec3::X));
    assert!(cone.is_some());
}

#[test]
fn fixed_plain_blocks_join_what_holds_them() {
    let (scene, timeline) =
        scene("xs 1 1 1 0 0 1 0 0 0 0 { s 0 0 0 1 xs 1 1 1 0 0 1 0 0 0 0 { s 1 0 0 1 } }", &[]);
    assert_eq!((scene.objects().len(), scene.instances().len()), (1, 1));
    assert!(timeline.is_empty());
}

#[test]
fn a_file_included_twice_is_one_object() {
    let part = "fm 0 0 0 0.5 0.5 0.5 0 0 0 1 0 0\np 3 0 0 0 1 0 0 0 1 0\nx spin { s 0 0 0 1 }\n";
    let text = format!(
        "fm 0 0 0 1 0 0 0 0 0 1 0 0 i 0 part.aff
        xs 1 1 1 0 1 0 0 3 0 0 {{ i 0 part.aff }} xs 1 1 1 0 1 0 0 6 0 0 {{ i 0 part.aff s 0 0 0 2 }}\n{}",
        slide("spin")
    );
    let (mut scene, mut timeline) = scene(&text, &[("part.aff", part)]);
    let triangles = scene.geometries().values().filter(|g| g.as_mesh().is_some()).count();
    // The fill before the first inclusion is another one than before the others.
    assert_eq!(triangles, 2);
    assert_eq!(scene.bounds().unwrap().max.x, 8.0);
    // The part that is shared moves once for all its places.
    let moved = at(&mut scene, &mut timeline, 1.0).len();
    assert_eq!(moved, 2);
    // The fill of an included file holds on.
    let half = crate::nff::fill::linear(Vec3::splat(0.5)).x;
    let grey = scene.materials().values().filter(|m| m.base_color.x == half).count();
    assert_eq!((grey, scene.materials().len()), (1, 1));
}

#[test]
fn detail_levels_leave_files_out() {
    let files = [("fine.aff", "s 0 0 0 1")];
    let shown = |text: &str, level: Option<u32>| {
        let limits = Limits { detail_level: level, ..Limits::default() };
        let files = Memory(files.iter().map(|(n, t)| ((*n).to_owned(), t.as_bytes().to_vec())).collect());
        let text = format!("{VIEW}{text}");
        let loaded = load_bytes("a.aff", text.as_bytes(), &files, &limits).unwrap();
        let quadrics = |edit: &&Edit| matches!(edit, Edit::Geometry(..));
        (loaded.edits.iter().filter(quadrics).count(), loaded.diagnostics.len())
    };
    assert_eq!(shown("i 0 fine.aff", None), (1, 0));
    // Notes on the level and on what was left out, one warning that nothing is shown.
    assert_eq!(shown("i 2 fine.aff", None), (0, 3));
    assert_eq!(shown("d 2 i 2 fine.aff", None), (1, 1));
    assert_eq!(shown("i 2 fine.aff", Some(2)), (1, 1));
    assert_eq!(shown("d 2 i 2 fine.aff", Some(1)), (0, 3));
    let told = read(&format!("{VIEW}i 2 fine.aff"), &[]).unwrap().diagnostics;
    let level = "detail level 0 is read, and the file goes up to 2";
    assert!(told.iter().any(|told| told.to_string().contains(level)), "{told:?}");
}

#[test]
fn files_that_cannot_be_included_are_told_of() {
    let loaded = read(&format!("{VIEW}s 0 0 0 1\ni 0 none.aff"), &[]).unwrap();
    let told = loaded.diagnostics[0].to_string();
    assert!(told.contains("test.aff:3:5: included file `none.aff`: there is no such file"), "{told}");
    let error = read("i 0 a.aff", &[("a.aff", "\ni 0 b.aff"), ("b.aff", "i 0 a.aff")]).unwrap_err();
    assert!(error.to_string().starts_with("b.aff:1:5: `a.aff` includes itself"), "{error}");
    let error = read("i 0 a.aff", &[("a.aff", "s 1 2 3")]).unwrap_err();
    assert!(error.to_string().starts_with("a.aff:1:8: the radius is missing"), "{error}");
}

#[test]
fn meshes_have_indices_for_each_attribute() {
    let text = "m vertices 3 0 0 0 1 0 0 0 1 0 normals 2 0 0 1 0 1 0
        texturecoords 2 t.ppm 0 0 1 1 triangles 2 0 1 2 0 0 1 0 1 1 2 1 0 0 0 0 0 0 0";
    let picture = b"P6 1 1 255\n\xFF\x80\x00".to_vec();
    let files = Memory([("TextureFiles/T.ppm".to_owned(), picture)].into());
    let text = format!("{VIEW}{text}");
    let loaded = load_bytes("a.aff", text.as_bytes(), &files, &Limits::default()).unwrap();
    assert_eq!(loaded.diagnostics, []);
    let mut scene = Scene::default();
    scene.apply(&loaded.edits).unwrap();
    let mesh = scene.geometries()[&GeometryId(0)].as_mesh().unwrap();
    // Corners (0, 0, 0), (1, 0, 1), (2, 1, 1), and (2, 0, 0), (1, 0, 0), (0, 0, 0) again.
    assert_eq!(mesh.positions.len(), 5);
    assert_eq!(*mesh.indices, [[0, 1, 2], [3, 4, 0]]);
    assert_eq!((mesh.normals[2], mesh.normals[3]), (Vec3::Y, Vec3::Z));
    assert_eq!((mesh.uvs[0][1], mesh.uvs[0][4]), (Vec2::ONE, Vec2::ZERO));
    let material = scene.materials().values().next().unwrap();
    assert!(material.base_color_texture.is_some());
    assert_eq!(scene.textures().values().next().unwrap().image.width, 1);
}

#[test]
fn animated_triangles_deform_linearly_and_share_their_indices() {
    let key = |time: f32, x: f32| format!("{time} {x} 0 0 0 0 1 {} 0 0 0 0 1 {x} 1 0 0 0 1 ", x + 1.0);
    let triangle = format!("tpa 3 {}{}{}", key(0.0, 0.0), key(1.0, 4.0), key(3.0, 0.0));
    let (mut scene, mut timeline) = scene(&format!("a -1 5 61\n{triangle}{triangle}s 9 9 9 1"), &[]);
    assert_eq!(scene.objects().len(), 2, "what deforms is apart from what does not");
    let x =
        |scene: &Scene| scene.geometries().values().find_map(|g| Some(g.as_mesh()?.positions[0].x)).unwrap();
    for (time, expected) in [(0.0, 0.0), (1.5, 2.0), (2.0, 4.0), (3.0, 2.0), (5.0, 0.0)] {
        at(&mut scene, &mut timeline, time);
        assert_eq!(x(&scene), expected, "{time}");
    }
    let indices = |edits: Vec<Edit>| {
        edits.into_iter().find_map(|edit| match edit {
            Edit::Geometry(_, Geometry::Mesh(mesh)) => Some(mesh.indices.clone()),
            _ => None,
        })
    };
    let (a, b) = (indices(timeline.edits_at(1.5)).unwrap(), indices(timeline.edits_at(1.7)).unwrap());
    assert!(Arc::ptr_eq(&a, &b) && a.len() == 2);
}

#[test]
fn cameras_lights_and_visibility_follow_their_keys() {
    let text = format!(
        "la lamp 0 0 9 1 0 0\nl 1 2 3 1 1 1\nx ball {{ s 0 0 0 1 }}\nk ball {{ visibility 2 0.25 0 0.75 1 }}\na 0 1 2\n{}{}",
        slide("lamp"),
        slide("camera")
    );
    let (mut scene, mut timeline) = scene(&text, &[]);
    at(&mut scene, &mut timeline, 1.0);
    let camera = scene.cameras()[&CameraId(0)].world_from_camera;
    assert!(camera.translation.abs_diff_eq(glam::Vec3A::new(2.0, 0.0, 0.0), 1e-6), "{camera}");
    assert!(camera.matrix3.abs_diff_eq(glam::Mat3A::IDENTITY, 1e-6), "not animated, so kept");
    let LightKind::ConstantPoint { position, .. } = scene.lights()[&LightId(0)].kind else {
        panic!("another kind");
    };
    assert_eq!(position, Vec3::new(2.0, 0.0, 0.0));
    assert_eq!(scene.lights()[&LightId(1)].name, "light 1");
    for (time, visible) in [(0.0, true), (0.25, false), (0.5, false), (0.75, true), (1.0, true)] {
        at(&mut scene, &mut timeline, time);
        assert_eq!(instance(&scene, 0).visible, visible, "{time}");
    }
}

#[test]
fn ambient_light_shows_ambient_colours_wherever_it_stands() {
    let ambient = |text: &str| {
        let (scene, _) = scene(text, &[]);
        scene.materials().values().map(|material| material.ambient).collect::<Vec<_>>()
    };
    let fill = "fm 0.5 0.2 0 0 0 0 0 0 0 1 0 0 s 0 0 0 1\n";
    let shown = crate::nff::fill::linear(Vec3::new(0.5, 0.2, 0.0));
    assert_eq!(ambient(fill), [shown], "1 where the file does not say");
    let light = Vec3::new(0.5, 1.0, 2.0);
    assert_eq!(ambient(&format!("am 0.5 1 2 {fill}")), [shown * light]);
    assert_eq!(ambient(&format!("{fill}am 0.5 1 2")), [shown * light]);
    assert_eq!(ambient("f 1 1 1 1 0 0 0 0 s 0 0 0 1"), [Vec3::ZERO], "`f` has none");
    // Fills that differ in it alone are two.
    assert_eq!(ambient(&format!("{fill}{}", fill.replace("0.5", "0.7"))).len(), 2);
}

#[test]
fn what_is_missing_is_told_of() {
    let told = |text: &str| {
        let loaded = read(&format!("{VIEW}s 0 0 0 1\n{text}"), &[]).unwrap();
        loaded.diagnostics.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    assert!(told("x a { s 0 0 0 1 } x a { s 0 0 0 1 }").contains("`a` has no keyframes"));
    assert!(told("}").contains("`}` without its `{`"));
    assert!(told("x a { s 0 0 0 1").contains("1 blocks are still open"));
    assert!(
        told("tt t.ppm 0 0 0 0 0 1 0 0 0 0 0 1 0 0 0").contains("texture `t.ppm`: there is no such file")
    );
    let error = |text: &str| read(text, &[]).unwrap_err().to_string();
    assert!(error("k a { transl 3").contains("the number of keys is 3; give a whole number of at least 4"));
    assert!(error("k a { spin 4").contains("`spin` is no kind of keys"));
    assert!(error("x a s").contains("`{` should follow"));
    assert!(error("m vertices 1 0 0 0 triangles 1 0 0 1").contains("the index 1 is not among 1 values"));
    assert!(error("a 1 0 5").contains("runs from 1 to 0"));
    assert!(error("% nothing").contains("no view and no shapes"));
}

#[test]
fn limits_hold() {
    let load = |text: &str, limits: Limits| {
        load_bytes("a.aff", text.as_bytes(), &NoFiles, &limits).unwrap_err().to_string()
    };
    let deep = "xs 1 1 1 0 1 0 0 0 0 0 { ".repeat(50);
    assert!(load(&deep, Limits { nesting: 40, ..Limits::default() }).contains("the limit is 40"));
    assert!(load(&deep, Limits { nodes: 20, ..Limits::default() }).contains("the limit is 20"));
    // Chains are one instance; these levels have shapes of their own.
    let deep = "xs 1 1 1 0 1 0 0 1 0 0 { s 0 0 0 1 ".repeat(60);
    assert!(load(&deep, Limits::default()).contains("more than 48 levels"));
}

#[test]
fn cut_and_damaged_files_never_panic() {
    let text = format!(
        "{VIEW}am 1 1 1 a 0 1 4 d 1 i 0 a.aff la l 0 0 0 fm 1 1 1 1 1 1 1 1 1 9 0.5 1.2 xs 1 1 1 0 1 0 9 0 0 0 {{ x b {{
        m vertices 1 0 0 0 normals 1 0 0 1 texturecoords 1 t 0 0 triangles 1 0 0 0 0 0 0 0 0 0
        tt t 0 0 0 0 0 1 0 0 1 0 0 1 0 0 1 ttp t 0 0 0 0 0 1 0 0 1 0 0 0 0 1 0 0 0 1 0 0 0 1 0 1 }} }}
        tpa 2 0 0 0 0 0 0 1 0 0 0 0 0 1 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 0 1 0 0 0 0 0 1
        k b {{ rot 4 0 0 0 1 9 0 0 0 0 0 0 1 9 0 0 0 1 0 0 1 9 0 0 0 1 0 0 1 9 0 0 0 visibility 1 0 1 }}\n{}{}",
        slide("l"),
        slide("camera")
    );
    let files = Memory([("a.aff".to_owned(), b"s 0 0 0 1 i 0 a.aff x q {".to_vec())].into());
    let try_out = |bytes: &[u8]| {
        if let Ok(mut loaded) = load_bytes("a.aff", bytes, &files, &Limits::default()) {
            let mut scene = Scene::default();
            scene.apply(&loaded.edits).unwrap();
            for time in [0.0, 0.3, 1e9] {
                scene.apply(&loaded.timeline.edits_at(time)).unwrap();
            }
        }
    };
    for cut in 0..text.len() {
        try_out(&text.as_bytes()[..cut]);
        for byte in [b'-', b'9', b'e', b'.', b' ', b'{', b'}', 0xFF] {
            let mut damaged = text.clone().into_bytes();
            damaged[cut] = byte;
            try_out(&damaged);
        }
    }
}
