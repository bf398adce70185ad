//! `heliostat info`: what was read.

use std::collections::BTreeMap;

use heliostat::formats::Severity;
use heliostat::grouping::{GroupingOptions, GroupingSummary, group};
use heliostat::scene::{
    AttributeScope, AttributeValues, Camera, Clip, Environment, LightKind, Projection, Scene, ShaderRef,
    Target,
};
use serde_json::{Value, json};

use super::console;
use super::failure::Failure;
use super::input::{self, Source};
use super::statistics::{Statistics, image_bytes};

#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// A file or the name of a built-in scene
    scene: String,
    #[command(flatten)]
    reading: input::Reading,
    /// Tell what moves and how, and what grouping by motion (`render --group`) merges
    #[arg(long)]
    motion: bool,
    /// Write everything as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let source = input::scene(&arguments.scene, &arguments.reading)?;
    let mut scene = Scene::default();
    scene.apply(&source.edits)?;
    if arguments.motion {
        let summary = group(&scene, &source.timeline, GroupingOptions::default()).summary;
        let text = if arguments.json {
            motion_json(&arguments.scene, &summary).to_string()
        } else {
            motion(&summary)
        };
        return console::result(&text);
    }
    let text = if arguments.json {
        json(&arguments.scene, &scene, &source).to_string()
    } else {
        table(&scene, &source)
    };
    console::result(&text)?;
    Ok(())
}

fn motion_json(name: &str, s: &GroupingSummary) -> Value {
    json!({
        "scene": name,
        "static": {"objects": s.merged_objects, "placements": s.merged_placements, "triangles": s.merged_triangles},
        "shared": {"objects": s.shared_objects},
        "rigid": {"instances": s.rigid_instances},
        "deforming": {"meshes": s.deforming_meshes, "triangles": s.deforming_triangles},
        "instances": {"before": s.instances_before, "after": s.instances_after},
    })
}

fn motion(s: &GroupingSummary) -> String {
    [
        format!(
            "static        {} placements merge into {} objects, {} triangles",
            s.merged_placements, s.merged_objects, s.merged_triangles
        ),
        format!(
            "shared        {} still objects stay instanced: their copies are too large",
            s.shared_objects
        ),
        format!("rigid         {} instances", s.rigid_instances),
        format!("deforming     {} meshes, {} triangles", s.deforming_meshes, s.deforming_triangles),
        format!("instances     {} as modelled, {} grouped", s.instances_before, s.instances_after),
    ]
    .join("\n")
}

fn json(name: &str, scene: &Scene, source: &Source) -> Value {
    let s = Statistics::of(scene);
    let bounds = scene.bounds().map(|b| json!({"min": b.min.to_array(), "max": b.max.to_array()}));
    let textures = scene.textures().values().map(|t| {
        json!({"name": t.name, "width": t.image.width, "height": t.image.height, "bytes": image_bytes(&t.image)})
    });
    let lights =
        scene.lights().values().map(|light| json!({"name": light.name, "kind": light_kind(&light.kind)}));
    let cameras = scene.cameras().values().map(|camera| {
        let eye = camera.world_from_camera.translation.to_array();
        json!({"name": camera.name, "projection": projection(camera), "eye": eye})
    });
    let clips = source.timeline.clips().iter().map(|clip| {
        let [instances, meshes, lights, cameras] = moved(clip);
        let moves = json!({"instances": instances, "meshes": meshes, "lights": lights, "cameras": cameras});
        let (duration, rate) = (clip.motion.duration(), clip.frame_rate);
        json!({"name": clip.name, "seconds": duration, "frames_per_second": rate, "moves": moves})
    });
    let attributes = attributes(scene)
        .into_iter()
        .map(|((name, kind), count)| json!({"name": name, "kind": kind, "geometries": count}));
    let diagnostics = source.diagnostics.iter().map(|d| {
        json!({
            "severity": d.severity.to_string(), "place": d.place.to_string(), "message": d.message, "hint": d.hint,
        })
    });
    json!({
        "scene": name,
        "triangles": s.triangles,
        "instanced_triangles": s.instanced_triangles,
        "vertices": s.vertices,
        "spheres": s.spheres,
        "cones": s.cones,
        "geometries": scene.geometries().len(),
        "attributes": attributes.collect::<Vec<_>>(),
        "objects": scene.objects().len(),
        "instances": scene.instances().len(),
        "depth": s.depth,
        "materials": scene.materials().len(),
        "textures": textures.collect::<Vec<_>>(),
        "texture_bytes": s.texture_bytes,
        "lights": lights.collect::<Vec<_>>(),
        "emissive_triangles": s.emissive_triangles,
        "environment": environment(scene.environment()),
        "bounds": bounds,
        "cameras": cameras.collect::<Vec<_>>(),
        "clips": clips.collect::<Vec<_>>(),
        "diagnostics": diagnostics.collect::<Vec<_>>(),
    })
}

/// What attributes there are by their name, of what kind, and on how many geometries.
fn attributes(scene: &Scene) -> BTreeMap<(&str, &'static str), usize> {
    let mut found = BTreeMap::new();
    for (name, attribute) in scene.attributes().values().flat_map(|named| named.iter()) {
        let kind = match (&attribute.values, attribute.scope) {
            (AttributeValues::Floats(_), AttributeScope::Object) => "a number per geometry",
            (AttributeValues::Floats(_), AttributeScope::Primitive) => "a number per primitive",
            (AttributeValues::Floats(_), AttributeScope::Vertex) => "a number per vertex",
            (AttributeValues::Vectors(_), AttributeScope::Object) => "a vector per geometry",
            (AttributeValues::Vectors(_), AttributeScope::Primitive) => "a vector per primitive",
            (AttributeValues::Vectors(_), AttributeScope::Vertex) => "a vector per vertex",
        };
        *found.entry((name.as_str(), kind)).or_insert(0) += 1;
    }
    found
}

fn table(scene: &Scene, source: &Source) -> String {
    let s = Statistics::of(scene);
    let mut lines = vec![
        format!("triangles     {} ({} with instances)", s.triangles, s.instanced_triangles),
        format!("vertices      {}", s.vertices),
        format!("quadrics      {} spheres, {} cones", s.spheres, s.cones),
        format!("objects       {}", scene.objects().len()),
        format!("instances     {}, {} deep", scene.instances().len(), s.depth),
        format!("materials     {}", scene.materials().len()),
        format!("textures      {} ({:.1} MB)", scene.textures().len(), s.texture_bytes as f64 * 1e-6),
        format!("lights        {} and {} emissive triangles", scene.lights().len(), s.emissive_triangles),
        format!("environment   {}", environment(scene.environment())),
    ];
    let point = |p: glam::Vec3| format!("{:.3} {:.3} {:.3}", p.x, p.y, p.z);
    lines.push(match scene.bounds() {
        Some(b) => format!("bounds        {}  to  {}", point(b.min), point(b.max)),
        None => "bounds        none: nothing is visible".into(),
    });
    for ((name, kind), count) in attributes(scene) {
        lines.push(format!("attribute     {}, {kind}; geometries: {count}", quoted(name)));
    }
    for (i, camera) in scene.cameras().values().enumerate() {
        let eye = point(camera.world_from_camera.translation.into());
        lines.push(format!("camera {i:<6} {}, {}, at {eye}", quoted(&camera.name), projection(camera)));
    }
    for light in scene.lights().values() {
        lines.push(format!("light         {}, {}", quoted(&light.name), light_kind(&light.kind)));
    }
    for (i, clip) in source.timeline.clips().iter().enumerate() {
        let rate = clip.frame_rate.map_or(String::new(), |rate| format!(", {rate} frames per second"));
        let seconds = clip.motion.duration();
        lines.push(format!(
            "clip {i:<8} {}, {seconds:.3} s{rate}, moves {}",
            quoted(&clip.name),
            moves(clip)
        ));
    }
    let diagnostics = &source.diagnostics;
    let warnings = diagnostics.iter().filter(|d| d.severity >= Severity::Warning).count();
    lines.push(format!("remarks       {warnings} warnings, {} notes", diagnostics.len() - warnings));
    lines.extend(diagnostics.iter().map(|d| format!("  {d}")));
    lines.join("\n")
}

/// How many instances, meshes, lights and cameras a clip moves.
fn moved(clip: &Clip) -> [usize; 4] {
    let mut counts = [0; 4];
    for target in clip.motion.moves() {
        match target {
            Target::Instance(_) => counts[0] += 1,
            Target::Geometry(_) => counts[1] += 1,
            Target::Light(_) => counts[2] += 1,
            Target::Camera(_) => counts[3] += 1,
            Target::Texture(_) | Target::Material(_) | Target::Object(_) | Target::Environment => {}
        }
    }
    counts
}

fn moves(clip: &Clip) -> String {
    let names = [("instance", "instances"), ("mesh", "meshes"), ("light", "lights"), ("camera", "cameras")];
    let counts = moved(clip).into_iter().zip(names).filter(|(count, _)| *count > 0);
    let words = counts.map(|(count, (one, many))| format!("{count} {}", if count == 1 { one } else { many }));
    let words: Vec<_> = words.collect();
    if words.is_empty() { "nothing that is shown".into() } else { words.join(", ") }
}

fn quoted(name: &str) -> String {
    if name.is_empty() { "(no name)".into() } else { format!("`{name}`") }
}

fn light_kind(kind: &LightKind) -> &'static str {
    match kind {
        LightKind::Point { .. } => "point",
        LightKind::Spot { .. } => "spot",
        LightKind::ConstantPoint { .. } => "point without fall-off",
        LightKind::Directional { .. } => "directional",
        LightKind::Profile { .. } => "measured profile",
        LightKind::Projector { .. } => "projector",
        LightKind::Shader { .. } => "shader",
    }
}

fn projection(camera: &Camera) -> String {
    match camera.projection {
        Projection::Perspective { vertical_fov } => format!("perspective {:.1}°", vertical_fov.to_degrees()),
        Projection::Orthographic { height } => format!("orthographic {height} m"),
        Projection::Panoramic => "panoramic".into(),
        Projection::FisheyeEquidistant { fov } => format!("equidistant fisheye {:.1}°", fov.to_degrees()),
        Projection::FisheyeEquisolid { fov } => format!("equisolid fisheye {:.1}°", fov.to_degrees()),
    }
}

fn environment(environment: &Environment) -> String {
    match environment {
        Environment::None => "none".into(),
        Environment::Constant(radiance) => format!("constant {radiance}"),
        Environment::Gradient(_) => "gradient".into(),
        Environment::Sky(sky) => format!("clear sky of turbidity {}", sky.turbidity),
        Environment::Map(map) => format!("map {}×{}", map.image.width, map.image.height),
        Environment::Shader(shaded) => match &shaded.shader.shader {
            ShaderRef::Named(name) => format!("shader {}", quoted(name)),
            ShaderRef::Plugin { shader, .. } => format!("shader {} of a plug-in", quoted(shader)),
        },
    }
}
