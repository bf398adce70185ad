//! Light transport against exact solutions, end to end through the backend.

use std::f32::consts::PI;
use std::sync::Arc;

use glam::{Affine3A, Vec3};
use heliostat_engine::{Engine, EngineOptions};
use heliostat_scene::{
    AlphaMode, Backend, Camera, ColorSpace, Environment, Frame, FrameRequest, Image, Light, LightKind,
    Material, Mesh, Progress, Projection, Quadric, SceneBuilder, Texture, TextureRef, Volume,
};

fn render(scene: SceneBuilder, request: &FrameRequest) -> Frame {
    let mut engine = Engine::new(EngineOptions::default()).expect("an engine");
    engine.apply(&scene.finish(), &Progress::new()).expect("valid edits");
    engine.render(request, &Progress::new()).expect("a frame")
}

fn mean(frame: &Frame) -> Vec3 {
    frame.color.iter().sum::<Vec3>() / frame.color.len() as f32
}

fn add(scene: &mut SceneBuilder, mesh: Mesh, material: Material) {
    let material = scene.material(material);
    let mesh = scene.mesh(mesh);
    let object = scene.object("", [(mesh, material)]);
    scene.instance(object, Affine3A::IDENTITY);
}

/// The square of half width `half` around `center`, facing along `normal` (an axis).
fn square(center: Vec3, normal: Vec3, half: f32) -> Mesh {
    let (x, y) = normal.any_orthonormal_pair();
    let (u, v) = if x.cross(y).dot(normal) > 0.0 { (x, y) } else { (y, x) };
    Mesh::quad(center - half * (u + v), 2.0 * half * u, 2.0 * half * v)
}

/// A sphere of latitude-longitude quads whose volume equals the true sphere's to within 1/segments².
fn sphere(center: Vec3, radius: f32, segments: u32) -> Mesh {
    let (rows, columns) = (segments, 2 * segments);
    let vertex = |i: u32| {
        let (row, column) = (i / (columns + 1), i % (columns + 1));
        let (theta, phi) = (PI * row as f32 / rows as f32, 2.0 * PI * column as f32 / columns as f32);
        // Vertices stand outside by as much as the middles of the facets would stand inside.
        let bulge = 1.0 + (PI / segments as f32).powi(2) / 12.0;
        center + radius * bulge * Vec3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos())
    };
    let positions = (0..(rows + 1) * (columns + 1)).map(vertex).collect();
    let quads = (0..rows).flat_map(|r| (0..columns).map(move |c| r * (columns + 1) + c));
    let indices = quads
        .flat_map(|i| [[i, i + columns + 1, i + 1], [i + 1, i + columns + 1, i + columns + 2]])
        .collect();
    Mesh::new(positions, indices)
}

fn look_down(height: f32, extent: f32) -> Camera {
    let mut camera = Camera::look_at("", Vec3::new(0.0, height, 0.0), Vec3::ZERO, Vec3::Z, 1.0);
    camera.projection = Projection::Orthographic { height: extent };
    camera
}

fn assert_close(actual: Vec3, expected: Vec3, relative: f32, what: &str) {
    let error = ((actual - expected) / expected.max(Vec3::splat(1e-6))).abs().max_element();
    assert!(error < relative, "{what}: {actual}, exact {expected}, off by {error}");
}

#[test]
fn sphere_light_on_a_plane() {
    // Under the centre of a sphere of radius r at height d the irradiance is π L (r/d)²; the plane returns ρ/π of it.
    let (radius, height, radiance, reflectance) = (0.5, 1.5, Vec3::new(3.0, 2.0, 1.0), 0.6);
    for renderer in ["path", "direct"] {
        let mut scene = SceneBuilder::new();
        add(&mut scene, square(Vec3::ZERO, Vec3::Y, 2.0), Material::diffuse("", Vec3::splat(reflectance)));
        add(&mut scene, sphere(Vec3::Y * height, radius, 48), Material::emitter("", radiance));
        let mut request = FrameRequest::new(look_down(0.9, 0.02), 8, 8);
        request.renderer = renderer.into();
        request.samples = 1024;
        let exact = radiance * reflectance * (radius / height).powi(2);
        assert_close(mean(&render(scene, &request)), exact, 0.005, renderer);
    }
}

#[test]
fn an_analytic_sphere_lights_a_plane() {
    // Irradiance below a sphere of radius r at distance d: π L (r/d)², wherever it is squeezed from: the placement
    // makes it of a smaller one, stretched evenly.
    let (radius, distance) = (0.5, 2.0);
    for renderer in ["path", "direct"] {
        let mut scene = SceneBuilder::new();
        add(&mut scene, square(Vec3::ZERO, Vec3::Y, 0.01), Material::diffuse("floor", Vec3::splat(0.5)));
        let material = scene.material(Material::emitter("lamp", Vec3::splat(3.0)));
        let shape = scene.quadrics(vec![Quadric::Sphere { center: Vec3::Y, radius: 0.25 }]);
        let object = scene.object("lamp", [(shape, material)]);
        scene.instance(object, Affine3A::from_scale(Vec3::splat(2.0)));
        // Below the lamp, from the side: the lamp does not stand in the way.
        let eye = Vec3::new(0.5, 0.5, 0.0);
        let camera = Camera::look_at("", eye, Vec3::ZERO, Vec3::Y, 0.004);
        let request =
            FrameRequest { samples: 256, renderer: renderer.into(), ..FrameRequest::new(camera, 16, 16) };
        let expected = 0.5 * 3.0 * (radius / distance) * (radius / distance);
        // 65,536 samples of a smooth integrand.
        assert_close(mean(&render(scene, &request)), Vec3::splat(expected), 0.01, renderer);
    }
}

#[test]
fn lights_without_fall_off_light_alike_at_any_distance() {
    for height in [0.5, 50.0] {
        let mut scene = SceneBuilder::new();
        add(&mut scene, square(Vec3::ZERO, Vec3::Y, 1.0), Material::diffuse("floor", Vec3::splat(0.5)));
        let kind =
            LightKind::ConstantPoint { position: Vec3::new(0.0, height, 0.0), irradiance: Vec3::splat(PI) };
        scene.light(Light { name: String::new(), kind });
        let request = FrameRequest { samples: 1, ..FrameRequest::new(look_down(0.25, 0.002), 4, 4) };
        assert_close(mean(&render(scene, &request)), Vec3::splat(0.5), 1e-4, "below the light");
    }
}

#[test]
fn ambient_terms_are_shown_by_the_classical_renderer_alone() {
    // A texel of 0.5 times an ambient radiance, on a surface that no light reaches.
    let ambient = Vec3::new(0.75, 0.5, 4.0);
    for (renderer, expected) in [("direct", 0.5 * ambient), ("path", Vec3::ZERO)] {
        let mut scene = SceneBuilder::new();
        let image = Arc::new(Image::rgba_f32(1, 1, vec![0.5, 0.5, 0.5, 1.0]));
        let texture = scene.texture(Texture::new("half", image, ColorSpace::Linear));
        let material = Material {
            ambient,
            base_color_texture: Some(TextureRef::new(texture)),
            ..Material::diffuse("floor", Vec3::splat(0.25))
        };
        add(&mut scene, square(Vec3::ZERO, Vec3::Y, 1.0), material);
        let request = FrameRequest {
            samples: 1,
            renderer: renderer.into(),
            ..FrameRequest::new(look_down(0.25, 0.002), 4, 4)
        };
        assert_eq!(mean(&render(scene, &request)), expected, "{renderer}");
    }
}

#[test]
fn what_is_unlit_is_seen_and_lights_nothing() {
    // Under an unlit ceiling dull floors are black, mirrors show it, and it looks as it is from below.
    for renderer in ["path", "direct", "igi", "path-filtered"] {
        for (material, expected) in [
            (Material::diffuse("", Vec3::splat(0.5)), 0.0),
            (Material::metal("", Vec3::ONE, 0.0), 0.6),
            (Material { unlit: true, ..Material::diffuse("", Vec3::splat(0.3)) }, 0.3),
        ] {
            let mut scene = SceneBuilder::new();
            add(&mut scene, square(Vec3::ZERO, Vec3::Y, 1.0), material);
            let ceiling = Material { unlit: true, ..Material::diffuse("", Vec3::splat(0.6)) };
            add(&mut scene, square(Vec3::Y * 3.0, Vec3::NEG_Y, 3.0), ceiling);
            let mut request = FrameRequest::new(look_down(1.0, 0.1), 8, 8);
            (request.renderer, request.samples) = (renderer.into(), 16);
            let frame = render(scene, &request);
            assert!((mean(&frame).y - expected).abs() < 1e-3, "{renderer}, {expected}: {}", mean(&frame));
        }
    }
}

#[test]
fn parallel_plate_view_factor() {
    // Aligned unit squares at distance 1 (Howell, catalogue of view factors, C-11).
    let x: f32 = 1.0;
    let view_factor = 2.0 / (PI * x * x)
        * (((1.0 + x * x).powi(2) / (1.0 + 2.0 * x * x)).sqrt().ln()
            + 2.0 * x * (1.0 + x * x).sqrt() * (x / (1.0 + x * x).sqrt()).atan()
            - 2.0 * x * x.atan());
    assert!((view_factor - 0.199_825).abs() < 1e-5);
    let mut scene = SceneBuilder::new();
    add(&mut scene, square(Vec3::ZERO, Vec3::Y, 0.5), Material::diffuse("", Vec3::splat(0.8)));
    add(&mut scene, square(Vec3::Y, Vec3::NEG_Y, 0.5), Material::emitter("", Vec3::splat(5.0)));
    let mut request = FrameRequest::new(look_down(0.5, 1.0), 32, 32);
    request.samples = 256;
    // The camera sees exactly the lower plate, so the mean over pixels is the mean over the plate.
    assert_close(mean(&render(scene, &request)), Vec3::splat(5.0 * 0.8 * view_factor), 0.003, "view factor");
}

#[test]
fn closed_diffuse_box() {
    // In a closed box whose walls emit Le and reflect ρ, radiance is Le / (1 − ρ) everywhere.
    let (emitted, reflectance) = (Vec3::new(1.0, 0.5, 0.25), Vec3::new(0.5, 0.3, 0.7));
    let mut scene = SceneBuilder::new();
    for normal in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
        let wall = Material { emissive: emitted, ..Material::diffuse("wall", reflectance) };
        add(&mut scene, square(-normal, normal, 1.0), wall);
    }
    let camera = Camera::look_at("", Vec3::new(0.5, 0.2, 0.1), Vec3::new(-1.0, -0.4, -0.8), Vec3::Y, 1.2);
    let mut request = FrameRequest::new(camera, 32, 32);
    request.samples = 256;
    let exact = emitted / (Vec3::ONE - reflectance);
    assert_close(mean(&render(scene, &request)), exact, 0.003, "mean");
}

#[test]
fn depth_counts_edges() {
    // A box that emits 1 and reflects one half: 1, 1 + ½, 1 + ½ + ¼, … by path length.
    for (depth, exact) in [(1, 1.0), (2, 1.5), (3, 1.75)] {
        let mut scene = SceneBuilder::new();
        let wall = Material { emissive: Vec3::ONE, ..Material::diffuse("wall", Vec3::splat(0.5)) };
        for normal in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            add(&mut scene, square(-normal, normal, 1.0), wall.clone());
        }
        let camera = Camera::look_at("", Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, 1.0);
        let mut request = FrameRequest::new(camera, 16, 16);
        request.samples = 256;
        request.max_depth = Some(depth);
        assert_close(mean(&render(scene, &request)), Vec3::splat(exact), 0.003, "depth");
    }
}

#[test]
fn glass_slab_transmits_and_absorbs() {
    // Through a slab at normal incidence, all internal reflections included: T = (1 − R)² a / (1 − R² a²), and it
    // reflects none of the black surroundings. a is the transmittance of one pass: 0.5 per metre over 0.4 m.
    let reflectance: f32 = 0.04;
    let pass = 0.5_f32.powf(0.4);
    let exact = (1.0 - reflectance).powi(2) * pass / (1.0 - (reflectance * pass).powi(2));
    let absorbing = Volume { attenuation_color: Vec3::splat(0.5), attenuation_distance: 1.0 };
    for (renderer, tolerance) in [("path", 0.004), ("direct", 0.004)] {
        let mut scene = SceneBuilder::new();
        let glass = Material { volume: Some(absorbing), ..Material::glass("", 1.5) };
        add(&mut scene, square(Vec3::Y, Vec3::Y, 1.0), glass.clone());
        add(&mut scene, square(Vec3::Y * 0.6, Vec3::NEG_Y, 1.0), glass);
        add(&mut scene, square(Vec3::ZERO, Vec3::Y, 1.0), Material::emitter("", Vec3::splat(2.0)));
        let mut request = FrameRequest::new(look_down(3.0, 0.1), 16, 16);
        request.renderer = renderer.into();
        request.samples = 256;
        assert_close(mean(&render(scene, &request)), Vec3::splat(2.0 * exact), tolerance, renderer);
    }
}

#[test]
fn coverage_shows_and_shades_in_proportion() {
    // A black sheet of coverage ¼ between a sun and a white floor, seen through a second one like it.
    for renderer in ["path", "direct"] {
        let mut scene = SceneBuilder::new();
        let mut sheet = Material::diffuse("sheet", Vec3::ZERO);
        sheet.base_color.w = 0.25;
        sheet.alpha_mode = AlphaMode::Blend;
        add(&mut scene, square(Vec3::ZERO, Vec3::Y, 1.0), Material::diffuse("floor", Vec3::splat(0.9)));
        add(&mut scene, square(Vec3::Y, Vec3::Y, 1.0), sheet);
        let sun = LightKind::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::splat(PI) };
        scene.light(Light { name: String::new(), kind: sun });
        let mut request = FrameRequest::new(look_down(3.0, 0.5), 16, 16);
        request.renderer = renderer.into();
        request.samples = 256;
        assert_close(mean(&render(scene, &request)), Vec3::splat(0.9 * 0.75 * 0.75), 0.01, renderer);
    }
}

#[test]
fn point_and_spot_lights_obey_the_inverse_square() {
    let floor = || {
        let mut scene = SceneBuilder::new();
        add(&mut scene, square(Vec3::ZERO, Vec3::Y, 1.0), Material::diffuse("floor", Vec3::ONE));
        scene
    };
    let position = Vec3::Y * 2.0;
    let intensity = Vec3::splat(4.0 * PI);
    let kinds = [
        LightKind::Point { position, intensity, range: f32::INFINITY },
        LightKind::Spot {
            position,
            direction: Vec3::NEG_Y,
            intensity,
            inner_angle: 0.3,
            outer_angle: 0.5,
            range: f32::INFINITY,
        },
    ];
    for kind in kinds {
        let mut scene = floor();
        scene.light(Light { name: String::new(), kind });
        let mut request = FrameRequest::new(look_down(1.0, 0.02), 4, 4);
        request.samples = 16;
        assert_close(mean(&render(scene, &request)), Vec3::ONE, 1e-3, "4π W/sr from 2 m");
    }
}

#[test]
fn white_objects_vanish_in_a_white_furnace() {
    let coat = heliostat_scene::Clearcoat {
        factor: 1.0,
        texture: None,
        roughness: 0.3,
        roughness_texture: None,
        normal_texture: None,
        normal_scale: 1.0,
    };
    let materials = [
        Material::diffuse("diffuse", Vec3::ONE),
        Material::metal("metal", Vec3::ONE, 0.5),
        Material::plastic("plastic", Vec3::ONE, 0.3),
        Material::glass("glass", 1.5),
        Material { roughness: 0.6, ..Material::glass("rough glass", 1.5) },
        Material { transmission: 1.0, roughness: 0.0, ..Material::default() },
        Material { clearcoat: Some(coat), ..Material::diffuse("coated", Vec3::ONE) },
    ];
    for material in materials {
        let name = material.name.clone();
        let mut scene = SceneBuilder::new();
        add(&mut scene, sphere(Vec3::ZERO, 1.0, 24), material);
        scene.environment(Environment::Constant(Vec3::ONE));
        let camera = Camera::look_at("", Vec3::Z * 4.0, Vec3::ZERO, Vec3::Y, 0.4);
        let mut request = FrameRequest::new(camera, 16, 16);
        request.samples = 512;
        assert_close(mean(&render(scene, &request)), Vec3::ONE, 0.005, &name);
    }
}

#[test]
fn holes_of_an_emitter_emit_nothing() {
    // A lamp of coverage ¼ gives a quarter of the light, however it is found.
    let radiance_on_floor = |coverage: f32, renderer: &str| {
        let mut scene = SceneBuilder::new();
        add(&mut scene, square(Vec3::ZERO, Vec3::Y, 0.5), Material::diffuse("", Vec3::splat(0.8)));
        let mut lamp = Material::emitter("lamp", Vec3::splat(5.0));
        lamp.base_color.w = coverage;
        lamp.alpha_mode = AlphaMode::Blend;
        add(&mut scene, square(Vec3::Y, Vec3::NEG_Y, 0.5), lamp);
        let mut request = FrameRequest::new(look_down(0.5, 1.0), 16, 16);
        request.renderer = renderer.into();
        request.samples = 256;
        mean(&render(scene, &request))
    };
    for renderer in ["path", "direct"] {
        let whole = radiance_on_floor(1.0, renderer);
        assert_close(radiance_on_floor(0.25, renderer), whole * 0.25, 0.01, renderer);
    }
}

#[test]
fn holes_cost_no_depth_and_are_no_first_hit() {
    for renderer in ["path", "direct"] {
        let mut scene = SceneBuilder::new();
        add(&mut scene, square(Vec3::ZERO, Vec3::Y, 1.0), Material::diffuse("floor", Vec3::splat(0.9)));
        for layer in 1..20 {
            let mut hole = Material::diffuse("hole", Vec3::ONE);
            hole.base_color.w = 0.2;
            hole.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
            add(&mut scene, square(Vec3::Y * 0.1 * layer as f32, Vec3::Y, 1.0), hole);
        }
        let sun = LightKind::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::splat(PI) };
        scene.light(Light { name: String::new(), kind: sun });
        let mut request = FrameRequest::new(look_down(3.0, 0.5), 4, 4);
        request.renderer = renderer.into();
        request.samples = 2;
        request.max_depth = Some(2);
        request.planes = vec![heliostat_scene::Plane::Depth, heliostat_scene::Plane::ObjectId];
        let frame = render(scene, &request);
        assert_close(mean(&frame), Vec3::splat(0.9), 1e-3, renderer);
        assert!((frame.planes[0].values[5] - 3.0).abs() < 1e-4, "{renderer}: {}", frame.planes[0].values[5]);
        assert_eq!(frame.planes[1].values[5], 1.0, "{renderer}: the floor is object 0, plus one");
    }
}

#[test]
fn offsets_that_cancel_leave_no_acne() {
    // A lit floor inside an instance a kilometre away, inside one that brings it back: rounding must not shade it.
    for renderer in ["path", "direct"] {
        let mut scene = SceneBuilder::new();
        let floor = scene.material(Material::diffuse("floor", Vec3::splat(0.9)));
        let mesh = scene.mesh(square(Vec3::ZERO, Vec3::Y, 1.0));
        let object = scene.object("floor", [(mesh, floor)]);
        let group = scene.object("far away", []);
        scene.child(group, object, Affine3A::from_translation(Vec3::new(-1000.3, -700.1, 300.7)));
        let tilt = Affine3A::from_rotation_x(0.7) * Affine3A::from_rotation_z(0.4);
        scene.instance(group, tilt * Affine3A::from_translation(Vec3::new(1000.3, 700.1, -300.7)));
        scene.environment(Environment::Constant(Vec3::ONE));
        let camera = Camera::look_at("", tilt.transform_point3(Vec3::Y), Vec3::ZERO, Vec3::Z, 0.6);
        let mut request = FrameRequest::new(camera, 32, 32);
        request.renderer = renderer.into();
        request.samples = 64;
        assert_close(mean(&render(scene, &request)), Vec3::splat(0.9), 0.005, renderer);
    }
}
