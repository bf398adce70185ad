//! Luminous intensity against closed forms; where the flux of a lamp goes.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::num::NonZeroUsize;

use glam::{Affine3A, Vec3};
use heliostat_engine::{Engine, EngineOptions, Photometry, PhotometryRequest};
use heliostat_scene::{
    Backend, BackendError, Edit, Light, LightKind, Material, Mesh, Progress, Quadric, SceneBuilder,
};

/// W/(m² sr) of all emitters here; grey, so that luminance is the same number.
const RADIANCE: f32 = 5.0;

fn measured(edits: &[Edit], request: &PhotometryRequest, threads: usize) -> Result<Photometry, BackendError> {
    let options = EngineOptions { threads: NonZeroUsize::new(threads), ..EngineOptions::default() };
    let mut engine = Engine::new(options)?;
    engine.apply(edits, &Progress::new())?;
    engine.photometry(request, &Progress::new())
}

/// A glowing sphere of this radius at the origin.
fn bulb(builder: &mut SceneBuilder, radius: f32) {
    let glow = builder.material(Material::emitter("glow", Vec3::splat(RADIANCE)));
    let sphere = builder.quadrics(vec![Quadric::Sphere { center: Vec3::ZERO, radius }]);
    let object = builder.object("bulb", [(sphere, glow)]);
    builder.instance(object, Affine3A::IDENTITY);
}

/// The two ends of a cylinder about +Y.
fn caps(radius: f32, height: f32, sides: u32) -> Mesh {
    let half = 0.5 * height;
    let mut positions = vec![Vec3::Y * -half, Vec3::Y * half];
    for i in 0..sides {
        let (sin, cos) = (f64::from(i) / f64::from(sides) * TAU).sin_cos();
        let at = radius * Vec3::new(cos as f32, 0.0, -sin as f32);
        positions.extend([at - Vec3::Y * half, at + Vec3::Y * half]);
    }
    let ends = |i: u32| {
        let [a, b] = [2 + 2 * i, 2 + 2 * ((i + 1) % sides)];
        [[0, b, a], [1, a + 1, b + 1]]
    };
    Mesh::new(positions, (0..sides).flat_map(ends).collect())
}

#[test]
fn a_glowing_sphere_shines_alike_in_all_directions() {
    let mut builder = SceneBuilder::new();
    bulb(&mut builder, 0.02);
    // The emptiest bin gets a sixteenth of the particles: its standard deviation is 0.2 %.
    let request = PhotometryRequest { particles: 1 << 22, bins: [4, 3], ..PhotometryRequest::default() };
    let found = measured(&builder.finish(), &request, 2).unwrap();
    // Radiance times projected area.
    let expected = f64::from(RADIANCE) * PI * 0.02f64.powi(2);
    for (i, intensity) in found.intensity.iter().enumerate() {
        assert!((intensity / expected - 1.0).abs() < 0.01, "bin {i}: {intensity} W/sr, not {expected}");
    }
    let flux = 4.0 * PI * expected;
    assert!((found.flux.emitted.x / flux - 1.0).abs() < 1e-3, "{:?}", found.flux);
    assert_eq!(found.flux.left, found.flux.emitted, "nothing is in the way");
}

#[test]
fn a_filament_shines_with_its_projected_area() {
    // Its side is a true cylinder: on triangles a thousand times longer than wide, light from one can meet itself again.
    let (radius, length) = (0.001, 0.006);
    let half = Vec3::Y * 0.5 * length;
    let mut builder = SceneBuilder::new();
    let glow = builder.material(Material::emitter("glow", Vec3::splat(RADIANCE)));
    let side = Quadric::Cone { base: -half, base_radius: radius, apex: half, apex_radius: radius };
    let side = builder.quadrics(vec![side]);
    let caps = builder.mesh(caps(radius, length, 512));
    let object = builder.object("filament", [(side, glow), (caps, glow)]);
    builder.instance(object, Affine3A::IDENTITY);
    // The emptiest row gets a hundredth of the particles: its standard deviation is 0.3 %.
    let request = PhotometryRequest { particles: 1 << 23, bins: [1, 6], ..PhotometryRequest::default() };
    let found = measured(&builder.finish(), &request, 2).unwrap();
    let [r, l] = [f64::from(radius), f64::from(length)];
    for (row, intensity) in (0..).zip(&found.intensity) {
        // Between latitudes a and b: the mean of L (2 r l cos V + π r² |sin V|), weighted by solid angle.
        let [a, b] = [row, row + 1].map(|edge: u32| (f64::from(edge) / 3.0 - 1.0) * FRAC_PI_2);
        let sides = |v: f64| 2.0 * r * l * 0.5 * (v + v.sin() * v.cos());
        let caps = |v: f64| PI * r * r * 0.5 * v.sin().powi(2) * v.signum();
        let mean = (sides(b) - sides(a) + caps(b) - caps(a)) / (b.sin() - a.sin());
        let expected = f64::from(RADIANCE) * mean;
        assert!((intensity / expected - 1.0).abs() < 0.01, "row {row}: {intensity} W/sr, not {expected}");
    }
}

#[test]
fn clear_glass_loses_nothing_and_a_black_box_takes_all() {
    let mut builder = SceneBuilder::new();
    bulb(&mut builder, 0.02);
    let glass = builder.material(Material::glass("glass", 1.5));
    let ball = builder.quadrics(vec![Quadric::Sphere { center: Vec3::ZERO, radius: 0.05 }]);
    let object = builder.object("ball", [(ball, glass)]);
    builder.instance(object, Affine3A::from_translation(Vec3::X * 0.1));
    let request = PhotometryRequest { particles: 1 << 17, bins: [4, 2], ..PhotometryRequest::default() };
    let clear = measured(&builder.clone().finish(), &request, 2).unwrap().flux;
    // What hits the bulb again is absorbed, a few per cent; roulette moves flux between particles.
    let kept = (clear.left + clear.absorbed + clear.given_up).x / clear.emitted.x;
    assert!((kept - 1.0).abs() < 0.01, "{clear:?}");
    assert!(clear.left.x > 0.95 * clear.emitted.x, "{clear:?}");

    let black = builder.material(Material::diffuse("black", Vec3::ZERO));
    let walls = builder.quadrics(vec![Quadric::Sphere { center: Vec3::ZERO, radius: 1.0 }]);
    let walls = builder.object("box", [(walls, black)]);
    builder.instance(walls, Affine3A::IDENTITY);
    let boxed = measured(&builder.finish(), &request, 2).unwrap();
    assert_eq!(boxed.flux.left.x, 0.0);
    assert!((boxed.flux.absorbed.x / boxed.flux.emitted.x - 1.0).abs() < 0.01, "{:?}", boxed.flux);
    assert!(boxed.intensity.iter().all(|&intensity| intensity == 0.0));
}

#[test]
fn a_mirror_sends_the_light_of_a_spot_where_it_should() {
    // A spot shines up on a mirror at 45° that turns its beam to −Z: H = V = 0.
    let mut builder = SceneBuilder::new();
    let kind = LightKind::Spot {
        position: Vec3::NEG_Y,
        direction: Vec3::Y,
        intensity: Vec3::splat(10.0),
        inner_angle: 0.05,
        outer_angle: 0.05,
        range: f32::INFINITY,
    };
    builder.light(Light { name: "spot".into(), kind });
    let mirror = builder.material(Material::metal("mirror", Vec3::ONE, 0.0));
    let corner = Vec3::new(-1.0, -1.0, 1.0);
    let mesh = builder.mesh(Mesh::quad(corner, Vec3::X * 2.0, Vec3::new(0.0, 2.0, -2.0)));
    let object = builder.object("mirror", [(mesh, mirror)]);
    builder.instance(object, Affine3A::IDENTITY);
    let request = PhotometryRequest {
        particles: 1 << 16,
        bins: [9, 9],
        window: [0.045, 0.045],
        ..PhotometryRequest::default()
    };
    let found = measured(&builder.finish(), &request, 1).unwrap();
    let ahead = found.intensity[40];
    assert!((ahead / 10.0 - 1.0).abs() < 0.05, "{ahead} W/sr straight ahead");
}

#[test]
fn threads_change_nothing_and_bad_requests_are_refused() {
    let mut builder = SceneBuilder::new();
    builder.light(Light {
        name: "sun".into(),
        kind: LightKind::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE },
    });
    let request = PhotometryRequest { particles: 100_000, bins: [8, 4], ..PhotometryRequest::default() };
    let error = measured(&builder.clone().finish(), &request, 1).unwrap_err().to_string();
    assert!(error.contains("no light to measure"), "{error}");
    bulb(&mut builder, 0.1);
    let edits = builder.finish();
    let [one, three] = [1, 3].map(|threads| measured(&edits, &request, threads).unwrap());
    assert_eq!(one, three);
    assert!(one.flux.from_afar.x > 0.0, "the sun is told apart");
    for bad in [
        PhotometryRequest { bins: [0, 4], ..request.clone() },
        PhotometryRequest { bins: [1 << 12, 1 << 12], ..request.clone() },
        PhotometryRequest { particles: 0, ..request.clone() },
        PhotometryRequest { window: [4.0, 1.0], ..request.clone() },
        PhotometryRequest { max_edges: 0, ..request },
    ] {
        assert!(matches!(measured(&edits, &bad, 1), Err(BackendError::Request(_))), "{bad:?}");
    }
}
