//! MTL material libraries as they are written.

use std::sync::Arc;

use glam::Vec3;

use crate::context::Context;
use crate::error::LoadError;
use crate::place::Place;
use crate::text::{Lines, Words};

/// One `newmtl` with all its statements; absent ones are `None`.
#[derive(Clone, Debug)]
pub(super) struct Mtl {
    pub(super) name: String,
    pub(super) place: Place,
    pub(super) diffuse: Option<Vec3>,
    pub(super) specular: Option<Vec3>,
    pub(super) emission: Option<Vec3>,
    pub(super) filter: Option<Vec3>,
    pub(super) exponent: Option<f32>,
    pub(super) ior: Option<f32>,
    pub(super) opacity: Option<f32>,
    pub(super) transparency: Option<f32>,
    pub(super) illumination: Option<f32>,
    pub(super) roughness: Option<f32>,
    pub(super) metallic: Option<f32>,
    pub(super) clearcoat: Option<f32>,
    pub(super) clearcoat_roughness: Option<f32>,
    pub(super) maps: Vec<(MapKind, Map)>,
}

/// What a texture map drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MapKind {
    Diffuse,
    Specular,
    Emission,
    Opacity,
    Bump,
    Normal,
    Roughness,
    Metallic,
}

/// A texture map with its options.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    pub(super) file: String,
    pub(super) place: Place,
    pub(super) scale: [f32; 2],
    pub(super) offset: [f32; 2],
    pub(super) clamp: bool,
    pub(super) bump: f32,
}

impl Mtl {
    fn new(name: String, place: Place) -> Self {
        Self {
            name,
            place,
            diffuse: None,
            specular: None,
            emission: None,
            filter: None,
            exponent: None,
            ior: None,
            opacity: None,
            transparency: None,
            illumination: None,
            roughness: None,
            metallic: None,
            clearcoat: None,
            clearcoat_roughness: None,
            maps: Vec::new(),
        }
    }

    pub(super) fn map(&self, kind: MapKind) -> Option<&Map> {
        self.maps.iter().rev().find(|(k, _)| *k == kind).map(|(_, map)| map)
    }
}

/// Reads a library.
pub(super) fn parse(context: &mut Context<'_>, file: &Arc<str>, bytes: &[u8]) -> Result<Vec<Mtl>, LoadError> {
    let mut materials: Vec<Mtl> = Vec::new();
    let mut ignored: Vec<String> = Vec::new();
    for line in Lines::new(bytes) {
        let mut words = Words::new(file, &line);
        let Some(keyword) = words.word() else { continue };
        let place = words.place();
        if keyword == b"newmtl" {
            context.count_materials(1, &place)?;
            context.charge(size_of::<Mtl>() as u64, &place)?;
            materials.push(Mtl::new(words.rest(), place));
            continue;
        }
        let Some(material) = materials.last_mut() else {
            let hint = "a material library starts with `newmtl NAME`";
            return Err(words.error("a statement before the first `newmtl`", hint));
        };
        if !statement(context, material, keyword, &mut words)? {
            let keyword = String::from_utf8_lossy(keyword).into_owned();
            if ignored.len() < 32 && !ignored.contains(&keyword) {
                context.warn(place, format!("`{keyword}` is not supported and was ignored"), "");
                ignored.push(keyword);
            }
        }
    }
    Ok(materials)
}

/// Reads one statement; false if it is unknown.
fn statement(
    context: &mut Context<'_>,
    material: &mut Mtl,
    keyword: &[u8],
    words: &mut Words<'_>,
) -> Result<bool, LoadError> {
    let keyword = keyword.to_ascii_lowercase();
    match keyword.as_slice() {
        b"kd" => material.diffuse = color(context, words)?,
        b"ks" => material.specular = color(context, words)?,
        b"ke" => material.emission = color(context, words)?,
        b"tf" => material.filter = color(context, words)?,
        b"ns" => material.exponent = Some(words.float("Ns")?),
        b"ni" => material.ior = Some(words.float("Ni")?),
        b"d" => {
            // `d -halo f` fades towards the silhouette; its number is the opacity at the middle.
            if words.peek() == Some(b"-halo") {
                words.word();
            }
            material.opacity = Some(words.float("d")?);
        }
        b"tr" => material.transparency = Some(words.float("Tr")?),
        b"illum" => material.illumination = Some(words.float("illum")?),
        b"pr" => material.roughness = Some(words.float("Pr")?),
        b"pm" => material.metallic = Some(words.float("Pm")?),
        b"pc" => material.clearcoat = Some(words.float("Pc")?),
        b"pcr" => material.clearcoat_roughness = Some(words.float("Pcr")?),
        // The ambient term stands for the light that is computed here.
        b"ka" | b"map_ka" | b"sharpness" => {}
        _ => match map_kind(&keyword) {
            Some(kind) => {
                let map = map(words)?;
                material.maps.push((kind, map));
            }
            None => return Ok(false),
        },
    }
    Ok(true)
}

fn map_kind(keyword: &[u8]) -> Option<MapKind> {
    Some(match keyword {
        b"map_kd" => MapKind::Diffuse,
        b"map_ks" => MapKind::Specular,
        b"map_ke" => MapKind::Emission,
        b"map_d" | b"map_tr" | b"map_opacity" => MapKind::Opacity,
        b"map_bump" | b"bump" => MapKind::Bump,
        b"norm" | b"map_kn" | b"map_norm" => MapKind::Normal,
        b"map_pr" => MapKind::Roughness,
        b"map_pm" => MapKind::Metallic,
        _ => return None,
    })
}

/// One number stands for all three; spectral curves and CIE colours are ignored with a warning.
fn color(context: &mut Context<'_>, words: &mut Words<'_>) -> Result<Option<Vec3>, LoadError> {
    if let Some(kind @ (b"spectral" | b"xyz")) = words.peek() {
        words.word();
        let message =
            format!("`{}` colours are not supported; this one was ignored", String::from_utf8_lossy(kind));
        context.warn(words.place(), message, "give red, green and blue");
        return Ok(None);
    }
    let red = words.float("red")?;
    let color = match words.float_if_any() {
        Some(green) => Vec3::new(red, green, words.float("blue")?),
        None => Vec3::splat(red),
    };
    if color.is_finite() && color.min_element() >= 0.0 {
        return Ok(Some(color));
    }
    context.warn(words.place(), format!("the colour is {color}"), "negative parts were set to 0");
    let clean = |v: f32| if v.is_finite() { v.max(0.0) } else { 0.0 };
    Ok(Some(Vec3::new(clean(color.x), clean(color.y), clean(color.z))))
}

fn map(words: &mut Words<'_>) -> Result<Map, LoadError> {
    let mut map = Map {
        file: String::new(),
        place: words.place(),
        scale: [1.0; 2],
        offset: [0.0; 2],
        clamp: false,
        bump: 1.0,
    };
    while let Some(option) = words.peek() {
        match option {
            b"-s" => map.scale = pair(words, 1.0)?,
            b"-o" => map.offset = pair(words, 0.0)?,
            b"-t" => _ = pair(words, 0.0)?,
            b"-mm" => {
                words.word();
                words.float("-mm")?;
                words.float("-mm")?;
            }
            b"-bm" => {
                words.word();
                map.bump = words.float("-bm")?;
            }
            b"-boost" | b"-texres" => {
                words.word();
                words.float("the option's value")?;
            }
            b"-clamp" => {
                words.word();
                map.clamp = words.word() == Some(b"on");
            }
            b"-blendu" | b"-blendv" | b"-cc" | b"-imfchan" | b"-type" => {
                words.word();
                words.word();
            }
            _ => break,
        }
    }
    // Larger ones say nothing about a texture and overflow further on.
    let finite = |values: [f32; 2], default| values.map(|v| if v.abs() < 1e9 { v } else { default });
    map.scale = finite(map.scale, 1.0);
    map.offset = finite(map.offset, 0.0);
    map.bump = if map.bump.is_finite() { map.bump } else { 1.0 };
    map.file = words.rest().replace('\\', "/");
    if map.file.is_empty() {
        return Err(words.error("the map has no file name", "write for example `map_Kd wood.png`"));
    }
    Ok(map)
}

/// One to three numbers, of which the first two count.
fn pair(words: &mut Words<'_>, default: f32) -> Result<[f32; 2], LoadError> {
    words.word();
    let first = words.float("the option's value")?;
    let second = words.float_if_any().unwrap_or(default);
    words.float_if_any();
    Ok([first, second])
}
