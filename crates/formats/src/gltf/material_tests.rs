//! Tests of glTF materials and textures, on documents made here.

use glam::{Vec2, Vec3, Vec4};
use heliostat_scene::{AlphaMode, Pixels, Texture, Wrap};
use serde_json::{Value, json};

use super::tests::{applied, data_uri, material, read, scene, triangle};
use super::*;

#[test]
fn all_of_the_material_model_is_read() {
    let png = data_uri(&crate::image::encode_png(1, 1, &[1, 2, 3]).unwrap());
    let scene = scene(&triangle(json!({
        "textures": [{"source": 0, "sampler": 0, "name": "t"}],
        "images": [{"uri": png}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}],
        "materials": [{
            "name": "everything",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.6,
                "baseColorTexture": {"index": 0, "texCoord": 1},
                "metallicRoughnessTexture": {"index": 0, "extensions": {
                    "KHR_texture_transform": {"offset": [0.5, 0.25], "scale": [2, 4], "texCoord": 1}}},
            },
            "normalTexture": {"index": 0, "scale": 0.7},
            "occlusionTexture": {"index": 99},
            "emissiveFactor": [1, 0.5, 0],
            "emissiveTexture": {"index": 0},
            "alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": true,
            "extensions": {
                "KHR_materials_emissive_strength": {"emissiveStrength": 10},
                "KHR_materials_ior": {"ior": 1.3},
                "KHR_materials_transmission": {"transmissionFactor": 0.8, "transmissionTexture": {"index": 0}},
                "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0]},
                "KHR_materials_clearcoat": {"clearcoatFactor": 0.9, "clearcoatRoughnessFactor": 0.2,
                    "clearcoatNormalTexture": {"index": 0, "scale": 3}},
                "KHR_materials_specular": {"specularFactor": 0.4, "specularColorFactor": [1, 2, 3]},
                "KHR_materials_unlit": {},
            },
        }],
        "extensionsRequired": ["KHR_materials_clearcoat", "KHR_texture_transform"],
    })));
    let m = material(&scene);
    assert_eq!(m.base_color, Vec4::new(0.1, 0.2, 0.3, 0.4));
    assert_eq!((m.metallic, m.roughness, m.normal_scale, m.ior, m.specular), (0.5, 0.6, 0.7, 1.3, 0.4));
    assert_eq!((m.emissive, m.specular_color), (Vec3::new(10.0, 5.0, 0.0), Vec3::new(1.0, 2.0, 3.0)));
    assert_eq!((m.alpha_mode, m.double_sided, m.unlit), (AlphaMode::Mask { cutoff: 0.3 }, true, true));
    assert_eq!((m.transmission, m.volume.unwrap().attenuation_distance), (0.8, 2.0));
    let coat = m.clearcoat.as_ref().unwrap();
    assert_eq!((coat.factor, coat.roughness, coat.normal_scale), (0.9, 0.2, 3.0));
    assert_eq!(m.base_color_texture.unwrap().uv_set, 1);
    let transformed = m.metallic_roughness_texture.unwrap();
    assert_eq!(transformed.uv_set, 1);
    assert_eq!(transformed.transform.0.transform_point2(Vec2::ONE), Vec2::new(2.5, 4.25));
    // One texture as colour and one as data, with one image between them.
    let textures: Vec<&Arc<Texture>> = scene.textures().values().collect();
    assert_eq!(textures.len(), 2);
    assert!(Arc::ptr_eq(&textures[0].image, &textures[1].image));
    assert_eq!((textures[0].color_space, textures[1].color_space), (ColorSpace::Srgb, ColorSpace::Linear));
    assert!(textures[0].wrap == [Wrap::Clamp, Wrap::Mirror] && textures[0].nearest);
    assert_eq!(textures[0].image.pixels, Pixels::Rgba8(vec![1, 2, 3, 255]));
}

#[test]
fn volumes_without_thickness_are_thin_and_old_materials_are_converted() {
    let scene_of = |extensions: Value| scene(&triangle(json!({"materials": [{"extensions": extensions}]})));
    let thin = json!({"KHR_materials_volume": {}, "KHR_materials_transmission": {"transmissionFactor": 1}});
    assert!(material(&scene_of(thin)).volume.is_none());
    let old = json!({"KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.5, 0.5, 0.5, 1], "specularFactor": [0.04, 0.4, 1], "glossinessFactor": 0.75}});
    let old = scene_of(old);
    let m = material(&old);
    assert_eq!((m.metallic, m.roughness, m.base_color.x), (0.0, 0.25, 0.5));
    assert!((m.specular_color * 0.04 - Vec3::new(0.04, 0.4, 1.0)).length() < 1e-6);
}

#[test]
fn values_out_of_range_are_cut_with_a_warning() {
    let loaded = read(&triangle(json!({"materials": [{
        "pbrMetallicRoughness": {"baseColorFactor": [2, -1, 0.5, 1], "roughnessFactor": 1e39},
        "emissiveFactor": [1e39, -1, 1], "alphaMode": "GLOW",
        "extensions": {"KHR_materials_ior": {"ior": 0.5}},
    }]})))
    .unwrap();
    assert_eq!(loaded.diagnostics.len(), 6, "{:#?}", loaded.diagnostics);
    let scene = applied(&loaded);
    let m = material(&scene);
    assert_eq!((m.base_color, m.roughness, m.ior), (Vec4::new(1.0, 0.0, 0.5, 1.0), 1.0, 1.5));
    assert_eq!(m.emissive, Vec3::new(0.0, 0.0, 1.0));
}

#[test]
fn unreadable_colour_textures_are_checkerboards_and_others_are_left_out() {
    let loaded = read(&triangle(json!({
        "textures": [{"source": 0}, {"source": 1}, {}],
        "images": [{"uri": "no%20such.png"}, {"uri": data_uri(b"\x89PNG\r\n\x1a\nrubbish")}],
        "materials": [{
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}},
            "emissiveTexture": {"index": 2, "texCoord": 5},
        }],
    })))
    .unwrap();
    let messages: Vec<String> = loaded.diagnostics.iter().map(ToString::to_string).collect();
    assert_eq!(messages.len(), 4, "{messages:#?}");
    assert!(
        messages[0].contains("images[0]: image `no such.png`: other files cannot be read"),
        "{messages:#?}"
    );
    let scene = applied(&loaded);
    let m = material(&scene);
    assert!(m.metallic_roughness_texture.is_none());
    let texture = &scene.textures()[&m.base_color_texture.unwrap().texture];
    assert_eq!(*texture.image, Image::placeholder());
    assert_eq!(m.emissive_texture.unwrap().uv_set, 0);
}
