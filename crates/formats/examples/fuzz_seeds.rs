//! Writes small well-formed files for every fuzz target into `fuzz/corpus/`.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use exr::prelude::{
    Compression, Encoding, Image, Layer, LayerAttributes, SpecificChannels, WritableImage, f16,
};
use image::{DynamicImage, ImageFormat, RgbImage};

#[path = "../src/bsp/sample.rs"]
mod sample;

/// Writes a file: target, name, bytes.
type Put = dyn Fn(&str, &str, &[u8]) -> std::io::Result<()>;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let put = |target: &str, name: &str, bytes: &[u8]| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(target);
        fs::create_dir_all(&folder).and_then(|()| fs::write(folder.join(name), bytes))
    };
    for (number, text) in OBJ.iter().enumerate() {
        put("obj", &format!("seed{number}"), text.as_bytes())?;
    }
    for (number, text) in MTL.iter().enumerate() {
        put("mtl", &format!("seed{number}"), text.as_bytes())?;
    }
    for (number, text) in AFF.iter().enumerate() {
        put("aff", &format!("seed{number}"), text.as_bytes())?;
    }
    for (number, text) in IES.iter().enumerate() {
        // The first byte chooses the kind.
        put("ies", &format!("seed{number}"), text.as_bytes())?;
    }
    for (name, script) in [("scripted", sample::Sample::SCRIPT), ("plain", "")] {
        let mut bytes = (script.len() as u16).to_le_bytes().to_vec();
        bytes.extend(script.as_bytes());
        bytes.extend(sample::Sample::everything().bytes());
        put("bsp", name, &bytes)?;
    }
    let floats = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    for (number, text) in PLY.iter().enumerate() {
        put("ply", &format!("ascii{number}"), text.as_bytes())?;
        for (encoding, big) in [("binary_little_endian", false), ("binary_big_endian", true)] {
            let (header, _) = text.split_once("end_header\n").unwrap();
            let mut bytes = format!("{}end_header\n", header.replace("ascii", encoding)).into_bytes();
            bytes.extend(floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]));
            bytes.push(4);
            for index in 0..4i32 {
                bytes.extend(if big { index.to_be_bytes() } else { index.to_le_bytes() });
            }
            put("ply", &format!("{encoding}{number}"), &bytes)?;
        }
    }
    for (number, text) in GLTF.iter().enumerate() {
        put("gltf", &format!("text{number}"), text.as_bytes())?;
        let mut bytes = text.as_bytes().to_vec();
        bytes.push(0);
        bytes.extend(floats(&[
            0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.5, 0.25, 0.0, 0.0, 0.5, 1.0, 1.0,
        ]));
        bytes.extend([0, 1, 2, 0, 1, 0, 2, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
        bytes.extend(floats(&[1.0; 64]));
        put("gltf", &format!("binary{number}"), &bytes)?;
    }
    images(&put)
}

fn images(put: &Put) -> Result<(), Box<dyn std::error::Error>> {
    let picture = RgbImage::from_fn(20, 17, |x, y| image::Rgb([x as u8 * 12, y as u8 * 15, (x * y) as u8]));
    let rgb = DynamicImage::ImageRgb8(picture);
    let kinds = [rgb.clone(), rgb.to_rgba8().into(), rgb.to_luma8().into(), rgb.to_rgb16().into()];
    for (number, kind) in kinds.iter().enumerate() {
        for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Tga] {
            let mut bytes = Cursor::new(Vec::new());
            // Not every format holds every kind.
            if kind.write_to(&mut bytes, format).is_ok() {
                put("image", &format!("{format:?}{number}"), &bytes.into_inner())?;
            }
        }
    }
    let mut bytes = Cursor::new(Vec::new());
    rgb.to_rgb32f().write_to(&mut bytes, ImageFormat::Hdr)?;
    put("image", "Hdr", &bytes.into_inner())?;
    let channels = || {
        SpecificChannels::rgb(|at: exr::prelude::Vec2<usize>| {
            (f16::from_f32(at.x() as f32), at.y() as f32 * 0.1, 0.5f32)
        })
    };
    for compression in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
    ] {
        let encoding = Encoding { compression, ..Encoding::default() };
        let layer = Layer::new((20, 17), LayerAttributes::default(), encoding, channels());
        let mut bytes = Cursor::new(Vec::new());
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes)?;
        put("image", &format!("Exr{compression}"), &bytes.into_inner())?;
    }
    Ok(())
}

const OBJ: [&str; 3] = [
    "# a\nmtllib a.mtl b.mtl\no x\ng y z\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nvn 0 0 1\nusemtl \"a b\"\ns 1\nf 1/1/1 2/2/1 3/1/1 4/2/1\n",
    "v 0 0 0 1 0.5 0\nv 4 0 0 1 1 1\nv 4 4 0\nv 1 1 0 1\nv 0 4 0\ns 2\nf -1 -5 \\\n-4 -3 -2\ns off\nf 1//1 2//1 3//1\nvn 0 0 1\nl 1 2\np 1\n",
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1/ 2/ 3/\nf 1// 2// 3//\ncurv 1 2\n",
];

const MTL: [&str; 2] = [
    "newmtl a\nKa 1 1 1\nKd 0.5 0.6 0.7\nKs 0.1\nKe 1 2 3\nTf 0.5 0.5 0.5\nNs 100\nNi 1.5\nd 0.5\nillum 2\nmap_Kd -s 2 2 2 -o 0.1 0.2 -clamp on i.png\nmap_d g.png\nbump -bm 0.5 g.png\nmap_Ks i.png\nmap_Ke i.png\nnewmtl b\nillum 7\nTr 0.2\nd -halo 0.5\nPr 0.3\nPm 1\nPc 0.5\nPcr 0.1\nPs 1\nmap_Pr g.png\nmap_Pm i.png\nnorm i.png\nnewmtl c c\nillum 5\nmap_Ns x.png\n",
    "newmtl a\nmap_Kd missing.png\nmap_d i.png\nmap_Bump i.png\nnewmtl b\nKd spectral a.rfl 1\nKs xyz 1 1 1\nTf 0.9 0.9 0.9\nnewmtl c c\nKd 2 -1 nan\nNi 0\nNs -5\nmap_d g.png\n",
];

const AFF: [&str; 3] = [
    "b 0.1 0.2 0.3\nv\nfrom 0 -5 1\nat 0 0 0\nup 0 0 1\nangle 45\nhither 1\nresolution 9 9\nl 1 2 3\nl 4 5 6 1 0 0\nf 1 0.5 0.25 0.5 0.5 3 0.1 1.5\ns 0 0 0 -1\nc 0 0 0 1 0 0 1 0.5\np 4 0 0 0 1 0 0 1 1 0 0 1 0\npp 3 0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1\n",
    "a -1 2 30 am 1 1 1 d 1 i 0 part.aff la lamp 0 0 1 1 1 1 xs 1 2 1 0 1 0 90 1 0 0 { x spin { i 1 part.aff s 0 0 0 1 } }\nk spin { rot 5 -1 0 1 0 0 0 0 0 0 0 1 0 90 0.5 0 0 1 0 1 0 180 0 0.5 0 2 1 0 0 300 0 0 0.5 3 0 0 1 7 0 0 0 visibility 2 0 0 1 1 }\nk lamp { transl 4 0 0 0 0 0 0 0 0 1 0 0 0 0 0 1 2 0 0 0 0 0 2 2 0 0 0 0 0 scale 4 0 1 1 1 0 0 0 0 1 1 1 0 0 0 1 2 2 2 0 0 0 1 1 1 1 0 0 0 }\n",
    "fm 1 1 1 1 1 1 1 1 1 20 0 0 m vertices 3 0 0 0 1 0 0 0 1 0 normals 1 0 0 1 texturecoords 2 t.ppm 0 0 1 1 triangles 1 0 1 2 0 0 0 0 1 0\ntt t.ppm 0 0 0 0 0 1 0 0 1 0 0 1 0 0 1\nttp none.ppm 0 0 0 0 0 1 0 0 1 0 0 0 0 1 1 0 0 1 0 0 0 1 0 1\ntpa 2 0 0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1 1 0 0 1 0 0 1 1 0 1 0 0 1 0 1 1 0 0 1\n",
];

const IES: [&str; 5] = [
    "0IESNA:LM-63-2002\n[LUMINAIRE] a\nTILT=NONE\n1 1000 2 2 3 1 2 0.1 0.1 0\n0.5 1 60\n0 90\n0 45 90\n1 2 3 4 5 6\n",
    "0IESNA91\nTILT=INCLUDE\n1\n3\n-90 0 90\n.9 .8 .7\n1,1,1,2,1,1,1,0,0,0\n1,1,60\n0,180\n0\n10,20\n",
    "0label\nTILT=tilt.dat\n1 1 1 3 3 2 2 0 0 0\n1 1 1\n-10 0 10\n-20 0 20\n1 2 3 4 5 6 7 8 9\n",
    "0IES:LM-63-2019\nTILT=NONE\n1 -1 1 2 2 3 2 0 0 0\n1 1 1\n-90 90\n0 90\n1 2 3 4\n",
    "12\n-30 30 3 # h\n0 0 2\n-5 5\n1 2 3 4 5 6\n",
];

const PLY: [&str; 2] = [
    "ply\nformat ascii 1.0\ncomment a\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
    "ply\nformat ascii 1.0\ncomment TextureFile a.png\nobj_info b\nelement vertex 4\nproperty double x\nproperty int y\nproperty short z\nproperty uchar red\nproperty ushort green\nproperty float blue\nproperty float s\nproperty float t\nproperty float nx\nproperty float ny\nproperty float nz\nelement other 1\nproperty list char float l\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0 1 2 3 0 0 0 0 1\n1 0 0 1 2 3 0 0 0 0 1\n1 1 0 1 2 3 0 0 0 0 1\n0 1 0 1 2 3 0 0 0 0 1\n2 1 2\n6 0 1 2 -1 3 2\n",
];

const GLTF: [&str; 3] = [
    r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"children":[1,2],"rotation":[0,0,1,0]},{"mesh":0,"scale":[1,2,3]},{"mesh":0,"translation":[1,0,0]}],"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"indices":2,"material":0}]}],"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":0,"byteOffset":36,"componentType":5126,"count":3,"type":"VEC2"},{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],"bufferViews":[{"buffer":0,"byteLength":64},{"buffer":0,"byteOffset":64,"byteLength":18}],"buffers":[{"byteLength":82}],"materials":[{"name":"m","pbrMetallicRoughness":{"baseColorFactor":[1,0.5,0,1],"baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":{"offset":[0,1],"scale":[2,2],"rotation":1,"texCoord":1}}},"metallicFactor":0.5},"normalTexture":{"index":0,"scale":0.5},"emissiveFactor":[1,1,1],"alphaMode":"MASK","doubleSided":true,"extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":5},"KHR_materials_ior":{"ior":1.4},"KHR_materials_transmission":{"transmissionFactor":1},"KHR_materials_volume":{"thicknessFactor":1,"attenuationDistance":2},"KHR_materials_clearcoat":{"clearcoatFactor":1},"KHR_materials_specular":{"specularFactor":0.5},"KHR_materials_unlit":{}}}],"textures":[{"source":0,"sampler":0}],"images":[{"uri":"a.png"}],"samplers":[{"wrapS":33071,"magFilter":9728}]}"#,
    r#"{"asset":{"version":"2.0"},"extensionsUsed":["KHR_lights_punctual"],"extensions":{"KHR_lights_punctual":{"lights":[{"type":"spot","intensity":3,"spot":{"outerConeAngle":0.5}},{"type":"point","range":2}]}},"nodes":[{"mesh":0,"skin":0},{"children":[2],"extensions":{"KHR_lights_punctual":{"light":0}}},{"camera":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]},{"camera":1,"extensions":{"KHR_lights_punctual":{"light":1}}}],"cameras":[{"type":"perspective","perspective":{"yfov":1,"aspectRatio":1.5,"znear":1}},{"type":"orthographic","orthographic":{"xmag":1,"ymag":1,"znear":0,"zfar":1}}],"skins":[{"joints":[1,2],"inverseBindMatrices":3}],"meshes":[{"weights":[0.5],"primitives":[{"mode":5,"attributes":{"POSITION":0,"NORMAL":0,"JOINTS_0":1,"WEIGHTS_0":2},"targets":[{"POSITION":0,"NORMAL":0}]}]}],"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"componentType":5121,"count":3,"type":"VEC4"},{"bufferView":0,"componentType":5126,"count":3,"type":"VEC4"},{"bufferView":1,"componentType":5126,"count":2,"type":"MAT4"},{"bufferView":2,"byteOffset":8,"componentType":5126,"count":2,"type":"SCALAR"},{"bufferView":1,"componentType":5126,"count":2,"type":"VEC4"},{"bufferView":1,"componentType":5126,"count":2,"type":"VEC3"},{"bufferView":1,"componentType":5126,"count":6,"type":"VEC3"}],"bufferViews":[{"buffer":0,"byteLength":64,"byteStride":12},{"buffer":0,"byteOffset":82,"byteLength":256},{"buffer":0,"byteLength":64}],"buffers":[{"byteLength":338}],"animations":[{},{"name":"a","samplers":[{"input":4,"output":5},{"input":4,"output":6,"interpolation":"STEP"},{"input":4,"output":7,"interpolation":"CUBICSPLINE"},{"input":4,"output":4}],"channels":[{"sampler":0,"target":{"node":1,"path":"rotation"}},{"sampler":1,"target":{"node":1,"path":"scale"}},{"sampler":2,"target":{"node":3,"path":"translation"}},{"sampler":3,"target":{"node":0,"path":"weights"}},{"sampler":3,"target":{"path":"pointer","extensions":{"KHR_animation_pointer":{"pointer":"/nodes/1/extensions/KHR_node_visibility/visible"}}}}]},{"samplers":[{"input":4,"output":4}],"channels":[{"sampler":0,"target":{"node":0,"path":"weights"}}]}]}"#,
    r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"weights":[1]}],"meshes":[{"primitives":[{"mode":6,"attributes":{"POSITION":0,"COLOR_0":1},"targets":[{"POSITION":0}]},{"mode":1,"attributes":{}}]}],"accessors":[{"componentType":5126,"count":4,"type":"VEC3","sparse":{"count":3,"indices":{"bufferView":1,"componentType":5123},"values":{"bufferView":0}}},{"bufferView":0,"componentType":5121,"normalized":true,"count":4,"type":"VEC3","byteOffset":1}],"bufferViews":[{"buffer":0,"byteLength":64},{"buffer":0,"byteOffset":64,"byteLength":18}],"buffers":[{"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAPwAAgD4AAAAAAAAAAAAAAD8AAIA/AACAPwAAAQACAAAAAQAAAAIAAAA=","byteLength":82},{"uri":"a.bin","byteLength":1024}],"materials":[{"extensions":{"KHR_materials_pbrSpecularGlossiness":{"specularFactor":[1,1,1]}}}]}"#,
];
