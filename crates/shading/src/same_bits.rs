//! Whatever the lanes: one by one or sixteen at a time, on every instruction set, shading gives the same bits.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};
use heliostat_kernel::Isa;
use heliostat_scene::{
    Clearcoat, ColorSpace, Image, LightKind, Material, MaterialId, ParameterValue, Photometry, Profile,
    ShaderUse, Texture, TextureId, TextureRef, Volume, Wrap,
};

use crate::emission::Source;
use crate::lanes::{Floats, Vectors, WIDTH};
use crate::lobe_set::Selection;
use crate::material::{InterfaceCache, SurfaceMaterial};
use crate::packet::{Scattered, Scattering};
use crate::punctual::PunctualLight;
use crate::receive::{Received, Taking};
use crate::sampler::Sampler;
use crate::sampling::uniform_sphere;
use crate::shader::ShaderRegistry;
use crate::surface::{LaneMode, ShadeScratch, Surfaces, shade};
use crate::texture::MipMap;

/// Low-discrepancy numbers: set `i` of a sequence per purpose.
fn numbers(i: usize, purpose: u32) -> [f32; 4] {
    Sampler::along(i as u32, 7).set(purpose)
}

fn direction(i: usize, purpose: u32) -> Vec3 {
    let [u, v, ..] = numbers(i, purpose);
    uniform_sphere(Vec2::new(u, v))
}

/// Points all over the place, seen from front and back, with textures at every level.
fn fill(scratch: &mut ShadeScratch, packet: usize) {
    let points = &mut scratch.points;
    for lane in 0..WIDTH {
        let i = packet * WIDTH + lane;
        let [a, b, c, d] = numbers(i, 0);
        let ng = direction(i, 1);
        points.position.set(lane, Vec3::new(a, b, c) * 4.0 - 2.0);
        points.object_position.set(lane, Vec3::new(b, c, a));
        points.error.0[lane] = 1e-5;
        points.ng.set(lane, ng);
        points.normal.set(lane, (ng + 0.4 * direction(i, 2)).normalize());
        points.wo.set(lane, direction(i, 3));
        for (set, uv) in points.uv.iter_mut().enumerate() {
            let [u, v, ..] = numbers(i, 4 + set as u32);
            (uv[0].0[lane], uv[1].0[lane]) = (3.0 * u - 1.0, 3.0 * v - 1.0);
        }
        points.lod = [Floats([d * 6.0 - 8.0; WIDTH]); 2];
        points.probes.lod = points.lod;
        points.probes.count.0[lane] = (1.0 + 4.0 * a).floor();
        for along in &mut points.probes.along {
            (along[0].0[lane], along[1].0[lane]) = (0.2 * b, 0.1 * c);
        }
        points.color.set(lane, Vec3::new(d, 1.0, a));
        points.alpha.0[lane] = c;
        points.width.0[lane] = 0.2 * d;
        points.attributes.resize(1, Vectors::default());
        points.attributes[0].set(lane, Vec3::new(0.1 + c, b, a));
        let (x, y) = ng.any_orthonormal_pair();
        for tangents in &mut points.tangents {
            tangents[0].set(lane, x);
            tangents[1].set(lane, y);
        }
    }
}

fn materials() -> Vec<Material> {
    let texture = || Some(TextureRef::new(TextureId(0)));
    let coat = Clearcoat {
        factor: 0.7,
        texture: texture(),
        roughness: 0.3,
        roughness_texture: None,
        normal_texture: texture(),
        normal_scale: 0.5,
    };
    let plastic = Material::plastic("", Vec3::new(0.8, 0.4, 0.1), 0.3);
    let size = ParameterValue::Attribute("size".into(), Vec3::ONE);
    let attributed = ShaderUse::named("checker").with("size", size);
    vec![
        Material::diffuse("", Vec3::new(0.7, 0.2, 0.9)),
        plastic.clone(),
        Material { roughness: 0.0, ..plastic.clone() },
        Material { metallic: 0.6, metallic_roughness_texture: texture(), ..plastic.clone() },
        Material { base_color_texture: texture(), normal_texture: texture(), ..plastic.clone() },
        Material { clearcoat: Some(coat), ..plastic.clone() },
        Material { transmission: 0.8, ..plastic.clone() },
        Material { transmission: 0.5, volume: Some(Volume::default()), roughness: 0.4, ..plastic.clone() },
        Material::glass("", 1.5),
        Material { emissive: Vec3::new(3.0, 2.0, 1.0), emissive_texture: texture(), ..plastic.clone() },
        Material { unlit: true, ..plastic.clone() },
        Material { base_color_texture: Some(TextureRef::new(TextureId(1))), ..plastic.clone() },
        Material { shader: Some(Arc::new(ShaderUse::named("checker").with("size", 0.3))), ..plastic.clone() },
        Material { shader: Some(Arc::new(attributed)), ..plastic.clone() },
        Material { shader: Some(Arc::new(ShaderUse::named("no such shader"))), ..plastic },
    ]
}

fn textures() -> BTreeMap<TextureId, Arc<MipMap>> {
    let pixels = (0..16 * 8 * 4).map(|i| (i * 37 % 101) as f32 / 100.0).collect();
    let texture = Texture {
        name: String::new(),
        image: Arc::new(Image::rgba_f32(16, 8, pixels)),
        color_space: ColorSpace::Linear,
        wrap: [Wrap::Repeat, Wrap::Mirror],
        nearest: false,
    };
    let codes = (0..12 * 20 * 4).map(|i| (i * 37 % 256) as u8).collect();
    let photo = Texture {
        image: Arc::new(Image::rgba8(12, 20, codes)),
        color_space: ColorSpace::Srgb,
        wrap: [Wrap::Clamp, Wrap::Repeat],
        nearest: true,
        ..texture.clone()
    };
    BTreeMap::from([
        (TextureId(0), Arc::new(MipMap::new(&texture))),
        (TextureId(1), Arc::new(MipMap::new(&photo))),
    ])
}

/// Everything that a packet is asked, as text that tells all bits apart.
fn answers(mode: LaneMode, material: &SurfaceMaterial, packet: usize) -> Vec<String> {
    let mut scratch = ShadeScratch::default();
    fill(&mut scratch, packet);
    let mut surfaces = Surfaces::default();
    shade(mode, material, &mut scratch, WIDTH, &mut surfaces);
    let mut wi = Vectors::default();
    let mut u = [Floats::ZERO; 3];
    for lane in 0..WIDTH {
        let i = packet * WIDTH + lane;
        wi.set(lane, direction(i, 6));
        let [a, b, c, _] = numbers(i, 7);
        (u[0].0[lane], u[1].0[lane], u[2].0[lane]) = (a, b, c);
    }
    let (mut value, mut sample, mut received) =
        (Scattering::default(), Scattered::default(), Received::default());
    let mut texts: Vec<String> = (0..WIDTH).map(|lane| format!("{:?}", surfaces.lane(lane))).collect();
    for which in [Selection::ALL, Selection::up_to(0.25), Selection::above(0.25)] {
        surfaces.evaluate(&wi, which, WIDTH, &mut value);
        surfaces.sample(u.each_ref(), which, WIDTH, &mut sample);
        texts.push(format!("{value:?} {sample:?}"));
    }
    let taking = Taking { bound: 2.0, gloss: Selection::above(0.25), shared: Selection::up_to(0.25) };
    let patch = surfaces.lane(0).bsdf.as_patch(Selection::ALL);
    let glossy = Source::Patch {
        position: Vec3::new(0.2, 0.1, -0.3),
        error: 1e-5,
        normal: Vec3::Z,
        radiance: patch.diffuse.into(),
        rim: patch.rim,
        gloss: patch.gloss.map(|gloss| (Vec3::ONE, gloss)),
        density: 0.0,
    };
    for source in sources().into_iter().chain([glossy]) {
        surfaces.receive(&source, &taking, WIDTH, &mut received);
        texts.push(format!("{received:?}"));
    }
    texts
}

fn sources() -> [Source; 7] {
    let kind = LightKind::Spot {
        position: Vec3::new(0.3, 2.5, 0.1),
        direction: Vec3::NEG_Y,
        intensity: Vec3::new(5.0, 4.0, 3.0),
        inner_angle: 0.4,
        outer_angle: 1.2,
        range: 9.0,
    };
    let patch = Source::Patch {
        position: Vec3::new(0.1, -0.2, 0.3),
        error: 1e-5,
        normal: Vec3::new(0.6, 0.8, 0.0),
        radiance: Vec3::new(0.5, 1.0, 2.0),
        rim: 0.7,
        gloss: None,
        density: 3.0,
    };
    let distant = Source::Distant { wi: Vec3::new(0.0, 0.6, -0.8), irradiance: Vec3::ONE, density: 2.0 };
    let rotation = Mat3::from_rotation_x(-1.4) * Mat3::from_rotation_z(0.3);
    let profile = Profile {
        photometry: Photometry::C,
        polar: vec![0.0, 0.3, 1.2, 2.0],
        azimuth: vec![0.0, 1.0, 3.0, std::f32::consts::TAU],
        intensity: (0..16).map(|i| (i * 7 % 5) as f32).collect(),
    };
    let lamp = LightKind::Profile {
        position: Vec3::new(0.3, 2.5, 0.1),
        world_from_light: rotation,
        scale: Vec3::new(5.0, 4.0, 3.0),
        profile: Arc::new(profile),
        range: 9.0,
    };
    let projector = LightKind::Projector {
        position: Vec3::new(0.3, 2.5, 0.1),
        world_from_light: rotation,
        intensity: Vec3::ONE,
        vertical_fov: 1.4,
        image: Arc::new(Image::rgba8(4, 4, (0..64).map(|i| (i * 37 % 256) as u8).collect())),
        range: f32::INFINITY,
    };
    let light = |kind| Source::Light { light: PunctualLight::new(&kind), factor: 0.25 };
    let shaded = |name: &str| {
        let kind = LightKind::Shader {
            position: Vec3::new(0.3, 2.5, 0.1),
            world_from_light: rotation,
            scale: Vec3::new(5.0, 4.0, 3.0),
            shader: Arc::new(ShaderUse::named(name)),
            range: 9.0,
        };
        let light = ShaderRegistry::built_in().light(&kind).expect("it is built in");
        Source::Light { light, factor: 0.25 }
    };
    let [doors, blinds] = ["barn-doors", "blinds"].map(shaded);
    [patch, light(kind), distant, light(lamp), light(projector), doors, blinds]
}

#[test]
fn lanes_are_independent_of_how_they_run() {
    let (textures, mut cache) = (textures(), InterfaceCache::new());
    let shaders = ShaderRegistry::built_in();
    let levels: Vec<_> = Isa::available().into_iter().filter_map(|isa| Some((isa, isa.level()?))).collect();
    for (i, material) in materials().into_iter().enumerate() {
        let material =
            SurfaceMaterial::new(MaterialId(0), &Arc::new(material), &textures, &mut cache, &shaders);
        for packet in 0..8 {
            let single = answers(LaneMode::Single, &material, packet);
            for &(isa, level) in &levels {
                let packets = answers(LaneMode::Packets(level), &material, packet);
                for (a, b) in single.iter().zip(&packets) {
                    assert_eq!(a, b, "material {i}, packet {packet}, {isa}");
                }
            }
        }
    }
}
