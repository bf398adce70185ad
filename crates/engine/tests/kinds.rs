//! Kinds of lights, environments, cameras and pixel shaders in whole renders.

use std::f32::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use glam::{Affine3A, Mat3, Vec3};
use heliostat_engine::{Engine, EngineOptions};
use heliostat_scene::{
    Backend, BackendError, Camera, Edit, Environment, Frame, FrameRequest, Gradient, Image, Light, LightId,
    LightKind, Material, Mesh, Photometry, Plane, Profile, Progress, Projection, SceneBuilder,
    ShadedEnvironment, ShaderUse, Sky,
};
use heliostat_shading::lanes::{Real, Vector};
use heliostat_shading::{
    CameraInfo, CameraShader, Constants, EnvironmentInfo, EnvironmentShader, LightInfo, LightShader,
    Parameter, PicturePlace, ShaderRegistry,
};

const ALBEDO: f32 = 0.5;

/// A grey floor of 8 m, and what else there is.
fn floor(light: Option<LightKind>, environment: Environment) -> Engine {
    let mut scene = SceneBuilder::new();
    let grey = scene.material(Material::diffuse("grey", Vec3::splat(ALBEDO)));
    let (corner, across, along) = (Vec3::new(-4.0, 0.0, 4.0), Vec3::X * 8.0, Vec3::NEG_Z * 8.0);
    let mesh = scene.mesh(Mesh::quad(corner, across, along));
    let object = scene.object("floor", [(mesh, grey)]);
    scene.instance(object, Affine3A::IDENTITY);
    if let Some(kind) = light {
        scene.light(Light { name: "lamp".into(), kind });
    }
    scene.environment(environment);
    engine(&scene.finish())
}

fn engine(edits: &[Edit]) -> Engine {
    let mut engine = Engine::new(EngineOptions::default()).unwrap();
    engine.apply(edits, &Progress::new()).unwrap();
    engine
}

/// Looks at the middle of the floor, 2 m of it over 32 pixels, from above: +X is right, −Z is up.
fn from_above(renderer: &str, samples: u32) -> FrameRequest {
    let mut camera = Camera::look_at("", Vec3::Y * 5.0, Vec3::ZERO, Vec3::NEG_Z, 1.0);
    camera.projection = Projection::Orthographic { height: 2.0 };
    FrameRequest { renderer: renderer.into(), samples, ..FrameRequest::new(camera, 32, 32) }
}

fn render(engine: &mut Engine, request: &FrameRequest) -> Frame {
    engine.render(request, &Progress::new()).unwrap()
}

/// Aims down from 2 m above the floor.
fn down() -> (Vec3, Mat3) {
    (Vec3::Y * 2.0, Mat3::from_rotation_x(-FRAC_PI_2))
}

fn profile_light() -> LightKind {
    let (position, world_from_light) = down();
    // Ten candela straight down, falling linearly to none at 45 degrees.
    let profile = Profile {
        photometry: Photometry::C,
        polar: vec![0.0, PI / 4.0],
        azimuth: vec![0.0],
        intensity: vec![10.0, 0.0],
    };
    let (scale, range) = (Vec3::new(1.0, 2.0, 0.5), f32::INFINITY);
    LightKind::Profile { position, world_from_light, scale, profile: Arc::new(profile), range }
}

fn projector() -> LightKind {
    let (position, world_from_light) = down();
    // White on the left, green on the right; 1.6 m wide and high on the floor.
    let image = Arc::new(Image::rgba_f32(2, 2, [[1.0; 4], [0.0, 1.0, 0.0, 1.0]].repeat(2).concat()));
    LightKind::Projector {
        position,
        world_from_light,
        intensity: Vec3::splat(12.0),
        vertical_fov: 2.0 * 0.4_f32.atan(),
        image,
        range: f32::INFINITY,
    }
}

#[test]
fn a_profile_lights_the_floor_by_its_table() {
    for renderer in ["direct", "path", "igi", "cast"] {
        let frame = render(&mut floor(Some(profile_light()), Environment::None), &from_above(renderer, 1));
        for (x, y) in [(16, 16), (4, 16), (28, 5)] {
            let color = frame.color[y * 32 + x];
            let at = Vec3::new((x as f32 + 0.5) / 16.0 - 1.0, 0.0, (y as f32 + 0.5) / 16.0 - 1.0);
            let to_light = Vec3::Y * 2.0 - at;
            let (distance2, cos) = (to_light.length_squared(), to_light.normalize().y);
            let candela = 10.0 * (1.0 - cos.acos() / (PI / 4.0)).max(0.0);
            let expected = ALBEDO / PI * candela * cos / distance2 * Vec3::new(1.0, 2.0, 0.5);
            // A sample may lie anywhere in its pixel.
            assert!(color.distance(expected) < 0.08 * expected.length(), "{renderer}: {color}, {expected}");
        }
    }
}

#[test]
fn a_projector_throws_its_picture() {
    for renderer in ["direct", "path", "igi", "cast"] {
        let frame = render(&mut floor(Some(projector()), Environment::None), &from_above(renderer, 1));
        let at = |x: usize, y: usize| frame.color[y * 32 + x];
        // Even all over: 12 / 2² W/m² times albedo over π.
        let even = ALBEDO / PI * 3.0;
        for (x, y) in [(5, 16), (6, 5), (5, 27)] {
            assert!(at(x, y).distance(Vec3::splat(even)) < 0.01 * even, "{renderer}: {}", at(x, y));
        }
        assert!(at(26, 16).distance(Vec3::Y * even) < 0.01 * even, "{renderer}: {}", at(26, 16));
        assert_eq!((at(1, 16), at(16, 1)), (Vec3::ZERO, Vec3::ZERO), "{renderer}: beside the picture");
    }
}

#[test]
fn a_gradient_lights_the_floor_in_closed_form() {
    let (zenith, horizon) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.5, 0.4, 0.1));
    let environment = Environment::Gradient(Gradient { zenith, horizon, nadir: Vec3::ONE });
    // ∫ (h + (z − h) sin e) cos θ dω over the upper half is π (h + 2/3 (z − h)).
    let expected = ALBEDO * horizon.lerp(zenith, 2.0 / 3.0);
    let frame = render(&mut floor(None, environment), &from_above("path", 64));
    let mean = frame.color.iter().sum::<Vec3>() / frame.color.len() as f32;
    assert!((mean / expected - 1.0).abs().max_element() < 5e-3, "{mean} instead of {expected}");
}

#[test]
fn the_sun_of_a_sky_lights_and_is_seen() {
    // Straight above: a mirror-like path is not needed, the floor's irradiance is sun plus sky.
    let sky = Sky::new(2.5, FRAC_PI_2, 0.0);
    let radiance = |sky: Sky, samples| {
        let frame = render(&mut floor(None, Environment::Sky(sky)), &from_above("path", samples));
        frame.color.iter().sum::<Vec3>() / frame.color.len() as f32
    };
    let (with, without) = (radiance(sky, 32), radiance(Sky { sun: false, ..sky }, 32));
    // 133 klx above the air lose a fifth or so on the way through it.
    let sun = (with - without) * PI / ALBEDO;
    assert!((90.0..125.0).contains(&sun.y) && sun.x > sun.z, "{sun}");
    // A camera that looks up sees a disk of its size: 0.2667 degrees in radius.
    let camera = Camera::look_at("", Vec3::Y, Vec3::Y * 2.0, Vec3::Z, 1.0_f32.to_radians());
    let request = FrameRequest { samples: 4, ..FrameRequest::new(camera, 64, 64) };
    let frame = render(&mut floor(None, Environment::Sky(sky)), &request);
    let seen = frame.color.iter().filter(|color| color.y > 1e5).count() as f32;
    let expected = PI * (0.2667_f32 * 64.0).powi(2);
    assert!((seen / expected - 1.0).abs() < 0.12, "{seen} pixels instead of {expected}");
}

#[test]
fn pixel_shaders_change_the_picture_and_leave_the_planes() {
    let mut engine = floor(Some(projector()), Environment::None);
    let plain = from_above("direct", 1);
    let named = |name: &str| ShaderUse::named(name);
    let shaded = |engine: &mut Engine, shaders: Vec<ShaderUse>, planes: Vec<Plane>| {
        render(engine, &FrameRequest { pixel_shaders: shaders, planes, ..plain.clone() })
    };
    let before = render(&mut engine, &plain);
    let brighter = shaded(&mut engine, vec![named("exposure"), named("exposure")], Vec::new());
    let close = |(a, b): (&Vec3, &Vec3)| a.distance(*b * 4.0) <= 1e-6 * a.length();
    assert!(brighter.color.iter().zip(&before.color).all(close));
    // Edges look at planes that nobody asked for, or that somebody did.
    let lines = shaded(&mut engine, vec![named("edges").with("paper", 1.0)], Vec::new());
    assert!(lines.planes.is_empty() && lines.color.iter().all(|&color| color == Vec3::ONE));
    let lines = shaded(&mut engine, vec![named("edges")], vec![Plane::Albedo, Plane::Depth]);
    let kinds: Vec<Plane> = lines.planes.iter().map(|data| data.plane).collect();
    assert_eq!((kinds, lines.color), (vec![Plane::Albedo, Plane::Depth], before.color));
    let unknown = FrameRequest { pixel_shaders: vec![named("sepia")], ..plain.clone() };
    let refused = engine.render(&unknown, &Progress::new());
    assert!(matches!(refused, Err(BackendError::Request(text)) if text.contains("`sepia`")));
}

#[test]
fn toon_bands_follow_the_camera_in_mirrors_too() {
    let mut scene = SceneBuilder::new();
    let shaded =
        |name: &str| Material { shader: Some(Arc::new(ShaderUse::named(name))), ..Material::default() };
    let toon = scene.material(shaded("toon"));
    let mirror = scene.material(Material {
        shader: Some(Arc::new(ShaderUse::named("mirror").with("tint", Vec3::ONE))),
        ..Material::default()
    });
    let wall = scene.mesh(Mesh::quad(Vec3::new(-4.0, -4.0, 0.0), Vec3::X * 8.0, Vec3::Y * 8.0));
    let side = scene.mesh(Mesh::quad(Vec3::new(1.0, -3.0, 0.0), Vec3::Z * 4.0, Vec3::Y * 6.0));
    let object = scene.object("corner", [(wall, toon), (side, mirror)]);
    scene.instance(object, Affine3A::IDENTITY);
    // Straight onto the wall, along the mirror: the wall shines as its colour.
    let kind = LightKind::Directional { direction: Vec3::NEG_Z, irradiance: Vec3::splat(PI) };
    scene.light(Light { name: "sun".into(), kind });
    let mut engine = engine(&scene.finish());
    let eye = Vec3::new(-0.5, 0.2, 1.5);
    let camera = Camera::look_at("", eye, Vec3::new(0.8, 0.0, 0.0), Vec3::Y, 1.6);
    let planes = vec![Plane::Position, Plane::MaterialId];
    let request = FrameRequest { samples: 1, planes, ..FrameRequest::new(camera, 64, 48) };
    let frame = render(&mut engine, &FrameRequest { renderer: "direct".into(), ..request });
    // The default bands, and how far the nearest border between them is.
    let (lit, shade) = (Vec3::new(0.95, 0.55, 0.12), Vec3::new(0.32, 0.06, 0.10));
    let bands = |at: Vec3, from: Vec3| {
        let facing = (from - at).normalize().z.abs();
        let border = ((4.0 * facing).round() - 4.0 * facing).abs().min((facing - 0.3).abs());
        let band = (4.0 * facing).floor().min(3.0) / 3.0;
        (if facing < 0.3 { Vec3::new(0.01, 0.01, 0.015) } else { shade.lerp(lit, band) }, border)
    };
    let (mut direct, mut mirrored, mut other) = (0, 0, 0);
    for (i, color) in frame.color.iter().enumerate() {
        let at = Vec3::from_slice(&frame.planes[0].values[3 * i..]);
        let material = frame.planes[1].values[i];
        if material == 0.0 {
            continue;
        }
        let (mut on_wall, image) = (at, Vec3::new(2.0 - eye.x, eye.y, eye.z));
        if material == 2.0 {
            let way = (at - eye) * Vec3::new(-1.0, 1.0, 1.0);
            on_wall = at - way * (at.z / way.z);
            if way.z >= 0.0 || on_wall.abs().max_element() > 3.9 {
                continue;
            }
        }
        let (expected, border) = bands(on_wall, eye);
        let (as_mirrored, _) = bands(on_wall, image);
        if border > 1e-3 {
            assert!(color.distance(expected) < 2e-3, "pixel {i}: {color} instead of {expected}");
            *(if material == 2.0 { &mut mirrored } else { &mut direct }) += 1;
            other += usize::from(material == 2.0 && as_mirrored != expected);
        }
    }
    let enough = direct > 300 && mirrored > 300 && other > 100;
    assert!(enough, "{direct} pixels of the wall, {mirrored} in the mirror, {other} unlike the image's");
}

/// Light from above that grows with the square of the height.
#[derive(Debug)]
struct Zenith;

impl EnvironmentShader for Zenith {
    fn info(&self) -> EnvironmentInfo {
        let tint = Parameter::color("tint", [1.0; 3], "straight up");
        EnvironmentInfo { name: "zenith".into(), about: String::new(), parameters: vec![tint] }
    }

    #[inline(always)]
    fn radiance<F: Real>(&self, direction: Vector<F>, values: &Constants<'_, F>) -> Vector<F> {
        let up = direction.y.max(direction.y.splat(0.0));
        values.vector(0) * (up * up)
    }
}

/// Parallel rays that are pressed together downwards: nothing that projections can do.
#[derive(Debug)]
struct Squeeze;

impl CameraShader for Squeeze {
    fn info(&self) -> CameraInfo {
        let height = Parameter::float("height", 1.0, [0.01, 100.0], "m", "of the picture's upper half");
        CameraInfo { name: "squeeze".into(), about: String::new(), parameters: vec![height] }
    }

    #[inline(always)]
    fn ray<F: Real>(&self, at: &PicturePlace<F>, values: &Constants<'_, F>) -> [Vector<F>; 2] {
        let (zero, two) = (at.x.splat(0.0), at.x.splat(2.0));
        let scale = values.float(0) * two.where_or(at.y.lt(zero), at.x.splat(1.0));
        [Vector::new(at.x * values.float(0), at.y * scale, zero), Vector::new(zero, zero, -two)]
    }
}

#[test]
fn cameras_can_be_shaders_of_the_program() {
    let mut shaders = ShaderRegistry::built_in();
    shaders.register_camera(Squeeze);
    let mut seen = Engine::with_shaders(EngineOptions::default(), shaders).unwrap();
    let mut scene = SceneBuilder::new();
    let grey = scene.material(Material::diffuse("grey", Vec3::splat(ALBEDO)));
    let mesh = scene.mesh(Mesh::quad(Vec3::new(-4.0, 0.0, 4.0), Vec3::X * 8.0, Vec3::NEG_Z * 8.0));
    let object = scene.object("floor", [(mesh, grey)]);
    scene.instance(object, Affine3A::IDENTITY);
    seen.apply(&scene.finish(), &Progress::new()).unwrap();
    let squeezed = |height: f32| {
        let mut request = from_above("cast", 1);
        request.camera.shader = Some(Arc::new(ShaderUse::named("squeeze").with("height", height)));
        request.planes = vec![Plane::Position];
        request
    };
    for renderer in ["cast", "path", "igi"] {
        let request = FrameRequest { renderer: renderer.into(), ..squeezed(2.0) };
        let frame = render(&mut seen, &request);
        let places = &frame.planes[0].values;
        // Rows of the lower half are twice as far apart; samples lie anywhere in a pixel.
        for (row, z) in [(0, -0.97), (15, -0.03), (16, 0.06), (31, 1.94)] {
            let found = places[(row * 32 + 16) * 3 + 2];
            assert!((found - z).abs() < 0.07, "{renderer}, row {row}: {found}, expected {z}");
        }
    }
    let refused = seen.render(&squeezed(0.0), &Progress::new());
    assert!(matches!(refused, Err(BackendError::Request(problem)) if problem.contains("`height`")));
    let mut unknown = engine(&[]);
    let refused = unknown.render(&squeezed(1.0), &Progress::new());
    assert!(matches!(refused, Err(BackendError::Request(problem)) if problem.contains("there are: none")));
}

#[test]
fn environments_can_be_shaders_of_the_program() {
    let mut shaders = ShaderRegistry::built_in();
    shaders.register_environment(Zenith);
    let mut lit = Engine::with_shaders(EngineOptions::default(), shaders).unwrap();
    lit.apply(&floor(None, Environment::None).scene().to_edits(), &Progress::new()).unwrap();
    let around = |shader: ShaderUse| Edit::Environment(Environment::Shader(ShadedEnvironment::new(shader)));
    for tint in [Vec3::ONE, Vec3::new(0.5, 0.25, 1.0)] {
        let edit = around(ShaderUse::named("zenith").with("tint", tint));
        let report = lit.apply(&[edit], &Progress::new()).unwrap();
        let rebuilt: Vec<&str> = report.rebuilt.iter().map(|rebuilt| rebuilt.what.as_str()).collect();
        assert_eq!((rebuilt, report.problems), (vec!["environment sampling table"], Vec::new()));
        // ∫ cos² θ cos θ dω over the upper half is π/2.
        let expected = tint * ALBEDO * 0.5;
        for (renderer, samples) in [("path", 64), ("direct", 64), ("igi", 64)] {
            let frame = render(&mut lit, &from_above(renderer, samples));
            let mean = frame.color.iter().sum::<Vec3>() / frame.color.len() as f32;
            // Sixty-five thousand samples, and those of igi are shared.
            let error = mean.distance(expected) / expected.length();
            assert!(error < 0.01, "{renderer}: {mean} instead of {expected}");
        }
        // Seen past the floor, it is as the shader says.
        let mut up = Camera::look_at("", Vec3::Y, Vec3::Y * 2.0, Vec3::Z, 1.0);
        up.projection = Projection::Orthographic { height: 1.0 };
        let sky = render(&mut lit, &FrameRequest { samples: 1, ..FrameRequest::new(up, 4, 4) });
        assert!(sky.color.iter().all(|color| color.distance(tint) < 1e-6), "{:?}", sky.color[0]);
    }
    let report = lit.apply(&[around(ShaderUse::named("nadir"))], &Progress::new()).unwrap();
    let [problem] = &report.problems[..] else { panic!("one problem: {:?}", report.problems) };
    assert!(problem.contains("no environment shader `nadir`; there are: zenith"), "{problem}");
}

/// The square of the cosine to the axis, on the right alone.
#[derive(Debug)]
struct HalfLobe;

impl LightShader for HalfLobe {
    fn info(&self) -> LightInfo {
        let tint = Parameter::color("tint", [1.0; 3], "W/sr along the axis");
        LightInfo { name: "half-lobe".into(), about: String::new(), parameters: vec![tint] }
    }

    #[inline(always)]
    fn intensity<F: Real>(&self, direction: Vector<F>, values: &Constants<'_, F>) -> Vector<F> {
        let zero = direction.z.splat(0.0);
        let lit = direction.z.lt(zero) & direction.x.gt(zero);
        (values.vector(0) * (direction.z * direction.z)).only(lit)
    }
}

fn half_lobe(shader: ShaderUse) -> Light {
    let (position, world_from_light) = down();
    let (scale, range) = (Vec3::new(8.0, 4.0, 2.0), f32::INFINITY);
    let shader = Arc::new(shader);
    Light {
        name: "lamp".into(),
        kind: LightKind::Shader { position, world_from_light, scale, shader, range },
    }
}

#[test]
fn lights_can_be_shaders_of_the_program() {
    let mut shaders = ShaderRegistry::built_in();
    shaders.register_light(HalfLobe);
    let mut lit = Engine::with_shaders(EngineOptions::default(), shaders).unwrap();
    lit.apply(&floor(None, Environment::None).scene().to_edits(), &Progress::new()).unwrap();
    for tint in [Vec3::ONE, Vec3::new(0.5, 0.25, 1.0)] {
        let light = half_lobe(ShaderUse::named("half-lobe").with("tint", tint));
        let report = lit.apply(&[Edit::Light(LightId(0), light.clone())], &Progress::new()).unwrap();
        let rebuilt: Vec<&str> = report.rebuilt.iter().map(|rebuilt| rebuilt.what.as_str()).collect();
        assert_eq!((rebuilt, report.problems), (vec!["light sampling table"], Vec::new()));
        for renderer in ["direct", "path", "igi", "cast"] {
            let frame = render(&mut lit, &from_above(renderer, 1));
            // Away from the border: in a corner the neighbours of `igi` are centred one pixel further in, where this light is a
            // tenth brighter.
            for (x, y) in [(19, 16), (28, 5), (26, 26)] {
                let color = frame.color[y * 32 + x];
                let at = Vec3::new((x as f32 + 0.5) / 16.0 - 1.0, 0.0, (y as f32 + 0.5) / 16.0 - 1.0);
                let to_light = Vec3::Y * 2.0 - at;
                let (distance2, cos) = (to_light.length_squared(), to_light.normalize().y);
                let expected = Vec3::new(8.0, 4.0, 2.0) * tint * (ALBEDO / PI * cos.powi(3) / distance2);
                // A sample may lie anywhere in its pixel.
                assert!(
                    color.distance(expected) < 0.08 * expected.length(),
                    "{renderer}: {color}, {expected}"
                );
            }
            assert_eq!(frame.color[16 * 32 + 8], Vec3::ZERO, "{renderer}: its dark side");
        }
        // Elsewhere or brighter, it keeps its table; others of its make share it.
        let mut moved = light.clone();
        if let LightKind::Shader { position, scale, .. } = &mut moved.kind {
            (*position, *scale) = (Vec3::Y, Vec3::ONE);
        }
        let edits = [Edit::Light(LightId(0), moved), Edit::Light(LightId(1), light)];
        assert_eq!(lit.apply(&edits, &Progress::new()).unwrap().rebuilt, []);
        lit.apply(&[Edit::RemoveLight(LightId(1))], &Progress::new()).unwrap();
    }
}

#[test]
fn missing_light_shaders_are_told_and_shown() {
    let mut engine = floor(None, Environment::None);
    let add = |engine: &mut Engine, shader: ShaderUse| {
        engine.apply(&[Edit::Light(LightId(0), half_lobe(shader))], &Progress::new()).unwrap().problems
    };
    let problems = add(&mut engine, ShaderUse::named("half-lobe"));
    let text = "light `lamp`: there is no light shader `half-lobe`; there are: barn-doors, blinds; a placeholder \
                takes its place";
    assert_eq!(problems, [text]);
    let color = render(&mut engine, &from_above("direct", 1)).color[16 * 32 + 16];
    assert!(color.x > 0.1 && color.y == 0.0 && color.z > 0.01, "magenta: {color}");
    assert!(add(&mut engine, ShaderUse::named("half-lobe")).is_empty(), "told once");
    let problems = add(&mut engine, ShaderUse::named("blinds").with("slats", 0.0));
    assert!(problems[0].contains("`slats` of light shader `blinds` is [0, 0, 0]; give values from 1"));
    assert!(add(&mut engine, ShaderUse::named("blinds")).is_empty());
    let mut skewed = half_lobe(ShaderUse::named("blinds"));
    if let LightKind::Shader { world_from_light, .. } = &mut skewed.kind {
        *world_from_light = Mat3::from_diagonal(Vec3::new(1.0, 2.0, 1.0));
    }
    let refused = engine.apply(&[Edit::Light(LightId(0), skewed)], &Progress::new());
    assert!(
        matches!(refused, Err(BackendError::Edit(problem)) if problem.to_string().contains("no rotation"))
    );
}

#[test]
fn bounced_light_is_that_of_the_light_shader() {
    // A lamp that shines at a wall alone: all light of the floor comes from there.
    let lit_by = |kind: LightKind, renderer: &str| {
        let mut scene = SceneBuilder::new();
        let white = scene.material(Material::diffuse("white", Vec3::splat(0.8)));
        let quad = |corner: Vec3, across: Vec3, along: Vec3| Mesh::quad(corner, across, along);
        let ground = scene.mesh(quad(Vec3::new(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::NEG_Z * 4.0));
        let wall = scene.mesh(quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::X * 4.0, Vec3::Y * 4.0));
        let object = scene.object("corner", [(ground, white), (wall, white)]);
        scene.instance(object, Affine3A::IDENTITY);
        scene.light(Light { name: "lamp".into(), kind });
        let mut engine = engine(&scene.finish());
        let frame = render(&mut engine, &from_above(renderer, 64));
        frame.color.iter().sum::<Vec3>() / frame.color.len() as f32
    };
    // The same square of light, thrown at the wall by a projector and by a shader.
    let position = Vec3::new(0.0, 2.0, 0.0);
    let blinds = ShaderUse::named("blinds").with("open", 1.0).with("width", 1.0).with("slats", 200.0);
    let shaded = LightKind::Shader {
        position,
        world_from_light: Mat3::IDENTITY,
        scale: Vec3::splat(50.0),
        shader: Arc::new(blinds.with("softness", 0.001)),
        range: f32::INFINITY,
    };
    let size = 64_u32;
    let even = |i: u32| {
        let at = |i: u32| (i as f32 + 0.5) / size as f32 - 0.5;
        let (x, y) = (at(i % size), at(i / size));
        // Projectors make up for the screen.
        [(1.0 + x * x + y * y).powf(-1.5); 4]
    };
    let image = Image::rgba_f32(size, size, (0..size * size).flat_map(even).collect());
    let projected = LightKind::Projector {
        position,
        world_from_light: Mat3::IDENTITY,
        intensity: Vec3::splat(50.0),
        vertical_fov: 2.0 * 0.5_f32.atan(),
        image: Arc::new(image),
        range: f32::INFINITY,
    };
    let expected = lit_by(projected.clone(), "path");
    for renderer in ["path", "igi"] {
        let [found, other] = [&shaded, &projected].map(|kind| lit_by(kind.clone(), renderer));
        assert!((found.x / other.x - 1.0).abs() < 0.02, "{renderer}: {found}, of the projector {other}");
        assert!((found.x / expected.x - 1.0).abs() < 0.05, "{renderer}: {found} instead of {expected}");
    }
}
