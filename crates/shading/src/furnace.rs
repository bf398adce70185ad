//! White furnace: in uniform light of radiance one, a surface that absorbs nothing must be invisible.

use std::collections::BTreeMap;
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};
use heliostat_scene::{Clearcoat, Material, MaterialId, ShaderUse, Volume};

use crate::bsdf::Bsdf;
use crate::lanes::{Vector, WIDTH};
use crate::lobe_set::{Lobes, Selection};
use crate::lobes::{Appearance, LobeGeometry, appearance};
use crate::material::{InterfaceCache, SurfaceMaterial, TextureCoordinates};
use crate::microfacet::SMOOTH_ALPHA;
use crate::sampler::Sampler;
use crate::sampling::uniform_sphere;
use crate::shader::testing::Random;
use crate::shader::{ParameterKind, ShaderRegistry};
use crate::surface::{LaneMode, ShadeScratch, Surfaces, shade};

const ROUGHNESSES: [f32; 8] = [0.0, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0];
const COSINES: [f32; 6] = [0.05, 0.15, 0.3, 0.5, 0.8, 1.0];
/// Energy may be off by this much: interpolation of the albedo tables, and sampling noise.
const TOLERANCE: f32 = 0.005;

fn bsdf(material: &Material, cos: f32, front: bool, cache: &mut InterfaceCache) -> Bsdf<f32> {
    appear(material, cos, front, cache).bsdf
}

fn appear(material: &Material, cos: f32, front: bool, cache: &mut InterfaceCache) -> Appearance<f32> {
    let material = SurfaceMaterial::new(
        MaterialId(0),
        &Arc::new(material.clone()),
        &BTreeMap::new(),
        cache,
        &ShaderRegistry::default(),
    );
    let normal = Vector::from(Vec3::Z);
    let wo = Vector::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let at = TextureCoordinates::square([[0.0; 2]; 2], [0.0; 2], Vec4::ONE.into());
    let closure = material.closure(&at, (normal, normal), front);
    appearance((&material, material.lobes()), &closure, &LobeGeometry { ng: normal, wo, front })
}

/// Low-discrepancy points of the unit cube.
fn points(n: u32) -> impl Iterator<Item = (f32, Vec2)> {
    (0..n).map(|i| {
        let [a, b, c, _] = Sampler::along(i % (1 << 16), i >> 16).set(0);
        (a, Vec2::new(b, c))
    })
}

/// Radiance scattered towards `wo` in the furnace, by sampling. Refraction squeezes radiance by η²; a furnace inside
/// the solid would be brighter by as much, so it is taken out.
fn furnace_by_sampling(bsdf: &Bsdf<f32>, n: u32) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for (u_lobe, u) in points(n) {
        let sample = bsdf.sample(u_lobe, u.into(), Selection::ALL);
        if sample.valid {
            let eta = if sample.transmitted { bsdf.transmitted_eta() } else { 1.0 };
            sum += Vec3::from(sample.weight) * (eta * eta);
        }
    }
    sum / n as f32
}

/// The same by evaluating the scattering function at uniform directions; not for smooth lobes.
fn furnace_by_quadrature(bsdf: &Bsdf<f32>, n: u32) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for (_, u) in points(n) {
        let wi = uniform_sphere(u);
        let eta = if wi.z < 0.0 { bsdf.transmitted_eta() } else { 1.0 };
        sum += Vec3::from(bsdf.evaluate(wi.into(), Selection::ALL).f_cos) * (eta * eta);
    }
    sum * (4.0 * PI / n as f32)
}

/// White materials that absorb nothing, at a roughness.
fn white_materials(roughness: f32) -> Vec<(&'static str, Material, bool)> {
    let plastic = Material::plastic("", Vec3::ONE, roughness);
    let glass = Material { roughness, ..Material::glass("", 1.5) };
    let dense = Material { roughness, ..Material::glass("", 2.4) };
    let thin = Material { transmission: 1.0, ..plastic.clone() };
    let coat = Clearcoat {
        factor: 1.0,
        texture: None,
        roughness,
        roughness_texture: None,
        normal_texture: None,
        normal_scale: 1.0,
    };
    let coated = Material { clearcoat: Some(coat.clone()), ..Material::diffuse("", Vec3::ONE) };
    let mixed = Material {
        metallic: 0.3,
        transmission: 0.4,
        volume: Some(Volume::default()),
        clearcoat: Some(Clearcoat { factor: 0.5, roughness: 0.6, ..coat }),
        ..plastic.clone()
    };
    vec![
        ("diffuse", Material::diffuse("", Vec3::ONE), true),
        ("metal", Material::metal("", Vec3::ONE, roughness), true),
        ("plastic", plastic, true),
        ("glass from outside", glass.clone(), true),
        ("glass from inside", glass, false),
        ("diamond from outside", dense.clone(), true),
        ("diamond from inside", dense, false),
        ("thin sheet", thin, true),
        ("clear coat", coated, true),
        ("all mixed", mixed, true),
    ]
}

#[test]
fn white_furnace_of_every_lobe_and_roughness() {
    let mut cache = InterfaceCache::new();
    let mut failures = Vec::new();
    for roughness in ROUGHNESSES {
        for (name, material, front) in white_materials(roughness) {
            for cos in COSINES {
                let bsdf = bsdf(&material, cos, front, &mut cache);
                let mut energy = furnace_by_sampling(&bsdf, 1 << 14);
                // A smooth clear sheet is no lobe: its light passes straight through.
                if name == "thin sheet" && roughness * roughness <= SMOOTH_ALPHA {
                    let reflected = crate::fresnel::schlick_weight(cos);
                    energy += 1.0 - (0.04 + 0.96 * reflected);
                }
                if (energy - 1.0).abs().max_element() > TOLERANCE {
                    failures.push(format!("{name}, roughness {roughness}, cos {cos}: {energy}"));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn albedos_are_what_the_furnace_finds() {
    let mut cache = InterfaceCache::new();
    for roughness in ROUGHNESSES {
        for (name, material, front) in white_materials(roughness) {
            for cos in COSINES {
                let albedo = Vec3::from(appear(&material, cos, front, &mut cache).albedo);
                let error = (albedo - 1.0).abs().max_element();
                assert!(error < TOLERANCE, "{name}, roughness {roughness}, cos {cos}: {albedo}");
            }
        }
    }
}

#[test]
fn evaluation_agrees_with_sampling() {
    let mut cache = InterfaceCache::new();
    for roughness in [0.4, 0.7, 1.0] {
        for (name, material, front) in white_materials(roughness) {
            for cos in [0.3, 0.9] {
                let bsdf = bsdf(&material, cos, front, &mut cache);
                let sampled = furnace_by_sampling(&bsdf, 1 << 15);
                let integrated = furnace_by_quadrature(&bsdf, 1 << 17);
                // Uniform directions meet the narrowest lobe here about a thousand times.
                let error = (sampled - integrated).abs().max_element();
                assert!(
                    error < 0.02,
                    "{name}, roughness {roughness}, cos {cos}: {sampled} against {integrated}"
                );
            }
        }
    }
}

/// Materials whose layers keep light from a diffuse lobe.
fn layered_materials(roughness: f32) -> Vec<(&'static str, Material)> {
    let color = Vec3::new(0.8, 0.5, 0.2);
    let plastic = Material::plastic("", color, roughness);
    let coat = |material: Material| {
        let coated = white_materials(roughness).into_iter().find_map(|(_, m, _)| m.clearcoat);
        Material { clearcoat: coated, ..material }
    };
    vec![
        ("diffuse", Material::diffuse("", color)),
        ("coated", coat(Material::diffuse("", color))),
        ("coated plastic", coat(plastic.clone())),
        ("plastic", plastic),
    ]
}

#[test]
fn diffuse_light_is_the_same_from_either_end() {
    let mut cache = InterfaceCache::new();
    for roughness in ROUGHNESSES {
        for (name, material) in layered_materials(roughness) {
            for cos in COSINES {
                let lit = bsdf(&material, cos, true, &mut cache);
                for towards in COSINES {
                    let seen = Vec3::from(bsdf(&material, towards, true, &mut cache).diffuse);
                    let sent = Vec3::from(lit.diffuse_at(towards));
                    let error = (sent - seen).abs().max_element();
                    assert!(error < 0.01, "{name}, {roughness}, from {cos} to {towards}: {sent} for {seen}");
                }
            }
        }
    }
}

#[test]
fn gloss_is_the_same_from_either_end() {
    let mut cache = InterfaceCache::new();
    let gloss = Selection::ALL.among(Lobes::ALL.without(Lobes::DIFFUSE));
    for roughness in [0.55, 0.7, 0.85, 1.0] {
        let gold = ("gold", Material::metal("", Vec3::new(1.0, 0.71, 0.29), roughness));
        // What a coat keeps from gloss below goes by the viewer too.
        let plain = layered_materials(roughness).into_iter().filter(|(name, _)| *name != "coated plastic");
        for (name, material) in plain.chain([gold]) {
            for cos in COSINES {
                let lit = bsdf(&material, cos, true, &mut cache);
                let Some(sent) = lit.as_patch(Selection::ALL).gloss else { continue };
                for (towards, side) in COSINES.into_iter().flat_map(|cos| [(cos, -1.0), (cos, 1.0)]) {
                    let seen = bsdf(&material, towards, true, &mut cache);
                    let turned = |w: Vector<f32>| Vector::new(side * w.x, w.y, w.z);
                    let value = Vec3::from(seen.evaluate(turned(lit.wo), gloss).f_cos) / cos;
                    let patch = Vec3::from(sent.towards((), turned(seen.wo)));
                    let error = ((patch - value).abs() / (value + 0.01)).max_element();
                    assert!(
                        error < 0.03,
                        "{name}, {roughness}, from {cos} to {towards}: {patch} for {value}"
                    );
                }
            }
        }
    }
}

#[test]
fn light_paths_send_on_what_viewers_see() {
    let mut cache = InterfaceCache::new();
    let cosine_weighted = |f: &mut dyn FnMut(f32) -> Vec3| {
        let n = 200;
        (0..n).map(|i| f(((i as f32 + 0.5) / n as f32).sqrt())).sum::<Vec3>() / n as f32
    };
    for roughness in [0.3, 0.6, 1.0] {
        for (name, material) in layered_materials(roughness) {
            for cos in [0.2, 0.5, 1.0] {
                let lit = bsdf(&material, cos, true, &mut cache);
                let diffuse = Selection::ALL.among(Lobes::DIFFUSE);
                let seen = cosine_weighted(&mut |cos| bsdf(&material, cos, true, &mut cache).diffuse.into());
                let onward = points(1 << 14).map(|(u_lobe, u)| lit.sample_onward(u_lobe, u.into(), diffuse));
                let sent = onward.map(|sample| Vec3::from(sample.weight)).sum::<Vec3>() / (1 << 14) as f32;
                let patch = lit.as_patch(diffuse);
                let patch = cosine_weighted(&mut |cos| {
                    Vec3::from(patch.diffuse) * (1.0 - patch.rim * crate::fresnel::schlick_weight(cos))
                });
                for (what, found) in [("sampled", sent), ("patch", patch)] {
                    let error = (found - seen).abs().max_element();
                    assert!(error < 0.01, "{name}, {roughness}, from {cos}, {what}: {found} for {seen}");
                }
            }
        }
    }
}

#[test]
fn sampled_directions_follow_their_density() {
    const BINS: usize = 8;
    let mut cache = InterfaceCache::new();
    let bin = |w: Vec3| {
        let z = ((0.5 * (w.z + 1.0) * BINS as f32) as usize).min(BINS - 1);
        let phi = (((w.y.atan2(w.x) / TAU + 1.0).fract() * BINS as f32) as usize).min(BINS - 1);
        z * BINS + phi
    };
    for (name, material, front) in white_materials(0.6) {
        let bsdf = bsdf(&material, 0.6, front, &mut cache);
        let mut sampled = [0.0; BINS * BINS];
        let mut expected = [0.0; BINS * BINS];
        let n = 1 << 16;
        for (u_lobe, u) in points(n) {
            let sample = bsdf.sample(u_lobe, u.into(), Selection::ALL);
            if sample.valid {
                sampled[bin(sample.wi.into())] += 1.0 / n as f32;
            }
        }
        let quadrature = 4 * n;
        for (_, u) in points(quadrature) {
            let wi = uniform_sphere(u);
            expected[bin(wi)] += bsdf.evaluate(wi.into(), Selection::ALL).pdf * 4.0 * PI / quadrature as f32;
        }
        for i in 0..BINS * BINS {
            let (s, e) = (sampled[i], expected[i]);
            assert!((s - e).abs() < 0.003 + 0.02 * e, "{name}, bin {i}: sampled {s}, density {e}");
        }
    }
}

/// A shader with its colours white and its numbers anywhere in their ranges.
fn white_shader(shaders: &ShaderRegistry, name: &str, random: &mut Random) -> ShaderUse {
    let parameters = shaders.programs()[name].info().parameters;
    parameters.iter().fold(ShaderUse::named(name), |shader, parameter| match parameter.kind {
        ParameterKind::Float => shader.with(parameter.name.clone(), random.value(parameter).x),
        ParameterKind::Color | ParameterKind::Vector => shader.with(parameter.name.clone(), Vec3::ONE),
    })
}

#[test]
fn no_shader_gives_more_than_it_gets() {
    let shaders = ShaderRegistry::built_in();
    let mut cache = InterfaceCache::new();
    let (mut scratch, mut surfaces) = (ShadeScratch::default(), Surfaces::default());
    let mut failures = Vec::new();
    for (index, name) in shaders.programs().keys().enumerate() {
        for round in 0..6 {
            let mut random = Random::new(500 + 10 * index as u32 + round);
            let solid = Material::glass("", 1.5);
            let plain = Material { roughness: 0.4, ..Material::default() };
            let shader = Some(Arc::new(white_shader(&shaders, name, &mut random)));
            let material = Arc::new(Material { shader, ..if round % 3 == 2 { solid } else { plain } });
            let material =
                SurfaceMaterial::new(MaterialId(0), &material, &BTreeMap::new(), &mut cache, &shaders);
            scratch.points = random.points();
            shade(LaneMode::default(), &material, &mut scratch, WIDTH, &mut surfaces);
            for lane in 0..WIDTH {
                let bsdf = surfaces.bsdf::<f32>((), lane);
                let energy = furnace_by_sampling(&bsdf, 1 << 11).max_element();
                if energy > 1.0 + 4.0 * TOLERANCE {
                    failures.push(format!("{name}, round {round}, lane {lane}: {energy}"));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n"));
}
