//! Each version, type and symmetry of photometric files, and what is wrong with broken ones.

use heliostat_scene::{LightKind, Photometry, Profile, Scene};

use super::{Luminaire, read};
use crate::source::{Memory, NoFiles};
use crate::{Limits, load_bytes};

fn parse(text: &str) -> Luminaire {
    read("lamp.ies", text.as_bytes(), &NoFiles, &Limits::default()).unwrap()
}

fn error(name: &str, text: &str) -> String {
    read(name, text.as_bytes(), &NoFiles, &Limits::default()).unwrap_err().to_string()
}

/// A file of version 2002 with these counts, type, angles and candela.
fn file(kind: u32, vertical: &[f32], horizontal: &[f32], candela: &str) -> String {
    let (v, h) = (vertical.len(), horizontal.len());
    let list = |angles: &[f32]| angles.iter().map(f32::to_string).collect::<Vec<_>>().join(" ");
    format!(
        "IESNA:LM-63-2002\n[TEST] none\n[LUMINAIRE] A lamp\nTILT=NONE\n1 1000 2 {v} {h} {kind} 2 0.1 0.1 0\n0.5 1 60\n{}\n{}\n{candela}\n",
        list(vertical),
        list(horizontal)
    )
}

/// Intensity at angles in degrees as the file counts them.
fn at(profile: &Profile, vertical: f32, horizontal: f32) -> f32 {
    let (polar, azimuth) = match profile.photometry {
        Photometry::C => (vertical, horizontal),
        Photometry::A => (90.0 - vertical, horizontal),
        Photometry::B => (90.0 - horizontal, vertical),
    };
    profile.at(polar.to_radians(), azimuth.to_radians())
}

#[test]
fn factors_and_rotational_symmetry() {
    let lamp = parse(&file(1, &[0.0, 90.0], &[0.0], "100 50"));
    assert_eq!(lamp.name, "A lamp");
    // Multiplier 2, ballast factor 0.5.
    assert_eq!(at(&lamp.profile, 0.0, 33.0), 100.0);
    assert!((at(&lamp.profile, 45.0, 200.0) - 75.0).abs() < 1e-3);
    assert_eq!(at(&lamp.profile, 91.0, 0.0), 0.0);
    // ∫ (100 − 50 θ / (π/2)) sin θ dθ from 0 to π/2 is 100 − 100/π.
    let flux = std::f64::consts::TAU * (100.0 - 100.0 / std::f64::consts::PI);
    assert!((lamp.profile.flux() / flux - 1.0).abs() < 1e-6);
}

#[test]
fn symmetries_of_type_c_are_completed() {
    let quadrant = parse(&file(1, &[0.0, 90.0], &[0.0, 45.0, 90.0], "1 1 2 2 3 3")).profile;
    for (angle, expected) in [(0.0, 1.0), (45.0, 2.0), (90.0, 3.0), (135.0, 2.0), (180.0, 1.0), (225.0, 2.0)]
    {
        assert!((at(&quadrant, 30.0, angle) - expected).abs() < 1e-4, "{angle}");
        assert!((at(&quadrant, 30.0, -angle) - expected).abs() < 1e-4, "-{angle}");
    }
    let half = parse(&file(1, &[0.0, 90.0], &[0.0, 90.0, 180.0], "1 1 2 2 4 4")).profile;
    assert!((at(&half, 30.0, 270.0) - 2.0).abs() < 1e-4 && (at(&half, 30.0, 179.9) - 4.0).abs() < 0.01);
    let other_half = parse(&file(1, &[0.0, 90.0], &[90.0, 180.0, 270.0], "1 1 2 2 4 4")).profile;
    assert!((at(&other_half, 30.0, 0.0) - 2.0).abs() < 1e-4);
    assert!((at(&other_half, 30.0, 89.9) - 1.0).abs() < 0.01);
    let whole =
        parse(&file(1, &[0.0, 90.0], &[0.0, 90.0, 180.0, 270.0, 360.0], "1 1 2 2 3 3 4 4 1 1")).profile;
    assert!((at(&whole, 30.0, -90.0) - 4.0).abs() < 1e-4 && (at(&whole, 30.0, 315.0) - 2.5).abs() < 1e-4);
    let open = parse(&file(1, &[0.0, 90.0], &[0.0, 90.0, 180.0, 270.0], "1 1 2 2 3 3 4 4")).profile;
    assert!((at(&open, 30.0, 315.0) - 2.5).abs() < 1e-4);
}

#[test]
fn types_a_and_b_have_their_own_poles() {
    for kind in [2, 3] {
        let profile =
            parse(&file(kind, &[-10.0, 0.0, 10.0], &[-20.0, 0.0, 20.0], "1 2 3 4 5 6 7 8 9")).profile;
        for (h, row) in [(-20.0, 1.0), (0.0, 4.0), (20.0, 7.0)] {
            for (v, more) in [(-9.999, 0.0), (0.0, 1.0), (9.999, 2.0)] {
                let value = at(&profile, v, h * 0.99999);
                assert!((value - row - more).abs() < 2e-3, "type {kind}, {v}, {h}: {value}");
            }
        }
        assert_eq!((at(&profile, 11.0, 0.0), at(&profile, 0.0, -21.0)), (0.0, 0.0));
        let mirrored = parse(&file(kind, &[-10.0, 10.0], &[0.0, 20.0], "1 2 3 4")).profile;
        assert!((at(&mirrored, 0.0, -10.0) - at(&mirrored, 0.0, 10.0)).abs() < 1e-4);
    }
}

#[test]
fn old_versions_commas_and_tilt() {
    // 1986: no first line, labels that are free text.
    let old = "A LUMINAIRE\nOF LONG AGO\nTILT=INCLUDE\n1\n3\n-90 0 90\n.9 .8 .7\n1,1000,1.0,2,1,1,1,0,0,0\n1,1,60\n0,180\n0\n10,20\n";
    let lamp = read("a/old.ies", old.as_bytes(), &NoFiles, &Limits::default()).unwrap();
    assert_eq!(lamp.name, "old");
    assert!((at(&lamp.profile, 0.0, 0.0) - 8.0).abs() < 1e-5);
    let files = Memory([("tilt.dat".into(), b"1 2 0 90 0.5 0.1".to_vec())].into());
    let text = file(1, &[0.0, 90.0], &[0.0], "100 50").replace("TILT=NONE", "TILT=tilt.dat");
    let lamp = read("lamp.ies", text.as_bytes(), &files, &Limits::default()).unwrap();
    assert_eq!(at(&lamp.profile, 0.0, 0.0), 50.0);
    let loaded = load_bytes("lamp.ies", text.as_bytes(), &NoFiles, &Limits::default()).unwrap();
    assert!(loaded.diagnostics[0].message.contains("tilt.dat"), "{:?}", loaded.diagnostics);
}

#[test]
fn broken_files_say_where() {
    let good = file(1, &[0.0, 90.0], &[0.0], "100 50");
    assert!(error("a.ies", "IESNA:LM-63-2002\n1 2 3").contains("TILT="));
    assert!(error("a.ies", &good.replace("100 50", "100")).contains("a candela value is missing"));
    let text = error("a.ies", &good.replace("100 50", "100 x"));
    assert!(text.starts_with("a.ies:9:5: a candela value is `x`"), "{text}");
    assert!(error("a.ies", &good.replace("100 50", "-1 50")).contains("at least 0"));
    assert!(error("a.ies", &good.replace("0 90\n", "90 0\n")).contains("must rise"));
    assert!(error("a.ies", &good.replace(" 2 1 1 ", " 2 1 7 ")).contains("photometric type is 7"));
    assert!(error("a.ies", &good.replace(" 2 1 1 ", " 60000 60000 1 ")).contains("the limit is"));
    assert!(error("a.ies", &file(1, &[0.0, 90.0], &[10.0, 50.0], "1 1 1 1")).contains("10° to 50°"));
    assert!(error("a.ies", &file(2, &[0.0, 90.0], &[0.0], "1 1")).contains("at least two"));
    assert!(error("a.ies", &file(3, &[0.0, 95.0], &[0.0, 1.0], "1 1 1 1")).contains("±90"));
    assert!(error("a.dat", "3 0 1 2").contains("number of dimensions"));
    assert!(error("a.dat", "1 0 180 2 1").contains("a value is missing"));
    let limits = Limits { memory_bytes: 1000, ..Limits::default() };
    let text = good.replace(" 2 1 1 ", " 2000 2000 1 ");
    assert!(read("a.ies", text.as_bytes(), &NoFiles, &limits).is_err());
}

#[test]
fn tables_of_radiance() {
    let text = "2\n-30 30 3 # horizontal\n0 0 2\n -5 5\n 1 2\n 3 4\n 5 6\n";
    let table = read("beam.dat", text.as_bytes(), &NoFiles, &Limits::default()).unwrap();
    assert_eq!((table.name.as_str(), table.profile.photometry), ("beam", Photometry::B));
    assert!((at(&table.profile, 4.9999, 0.0) - 4.0 * 179.0).abs() < 0.1);
    assert!((at(&table.profile, 0.0, 15.0) - 4.5 * 179.0).abs() < 0.1);
    let round = read("round.dat", b"1 0 180 3 1 2 3", &NoFiles, &Limits::default()).unwrap();
    assert!((at(&round.profile, 90.0, 77.0) - 358.0).abs() < 0.1);
}

#[test]
fn a_file_alone_is_shown_in_a_room() {
    for (name, text) in [
        ("down.ies", file(1, &[0.0, 90.0], &[0.0], "100 50")),
        ("upload", file(1, &[0.0, 90.0], &[0.0], "100 50")),
        ("ahead.dat", "2\n-30 30 3\n-5 5 2\n1 2 3 4 5 6".into()),
    ] {
        let loaded = load_bytes(name, text.as_bytes(), &NoFiles, &Limits::default()).unwrap();
        assert!(loaded.diagnostics[0].message.contains(" lm, at most "), "{:?}", loaded.diagnostics);
        let mut scene = Scene::default();
        scene.apply(&loaded.edits).unwrap();
        let light = scene.lights().values().next().unwrap();
        assert!(matches!(light.kind, LightKind::Profile { .. }));
    }
}

#[test]
fn mutilated_files_give_a_scene_or_an_error() {
    let seeds = [
        file(1, &[0.0, 45.0, 90.0], &[0.0, 90.0], "1 2 3 4 5 6"),
        file(2, &[-10.0, 0.0, 10.0], &[-20.0, 0.0, 20.0], "1 2 3 4 5 6 7 8 9"),
        "A\nTILT=INCLUDE\n1\n2\n0 90\n1 .5\n1 1 1 2 1 1 1 0 0 0\n1 1 1\n0 180\n0\n1 2\n".into(),
        "2\n-30 30 3\n0 0 2\n-5 5\n1 2 3 4 5 6\n".into(),
    ];
    let pieces = ["-1", "1e38", "nan", "0", "99999", "TILT=", "\n", " ", "1e-40", ",", "#", "360"];
    let limits = Limits { memory_bytes: 1 << 20, ..Limits::default() };
    let mut state = 7_u32;
    let mut next = |below: usize| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize % below
    };
    for round in 0..4000 {
        let seed = round % seeds.len();
        let mut text = seeds[seed].clone().into_bytes();
        for _ in 0..=next(4) {
            let at = next(text.len());
            let end = (at + next(6)).min(text.len());
            text.splice(at..end, pieces[next(pieces.len())].bytes());
        }
        let name = if seed == 3 { "a.dat" } else { "a.ies" };
        if let Ok(loaded) = load_bytes(name, &text, &NoFiles, &limits) {
            let scene = Scene::default().apply(&loaded.edits);
            assert!(scene.is_ok(), "{}: {scene:?}", String::from_utf8_lossy(&text));
        }
    }
}
