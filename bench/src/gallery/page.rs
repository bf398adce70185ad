//! The pages of surface, light and pixel shaders, from their registries.

use std::fmt::Write;

use heliostat::shading::pixel::PixelRegistry;
use heliostat::shading::{LightInfo, Parameter, ParameterKind, ShaderRegistry};

const HEAD: &str = "# Surface shaders

The shaders that come with the engine. A material names one and sets what differs from the defaults; the shader starts
from the material as it stands and changes it from point to point. [Light shaders](#light-shaders) come last.

```rust
let shader = ShaderUse::named(\"wood\").with(\"ring_width\", 0.008).with(\"dark\", Vec3::new(0.2, 0.1, 0.05));
let oak = Material { shader: Some(Arc::new(shader)), ..Material::default() };
```

`heliostat render --materials NAME[:PARAMETER=VALUE,…]` shows all surfaces by one shader, above all by those that make a quantity
visible (`show-…`); the viewer does it live. What depends on rays rather than on surfaces, nodes and triangles visited and
shading cost, are planes: `--aov nodes`, see [viewer.md](viewer.md#false-colours-filters-tone-curves). Any parameter can be a texture times a factor, or an
[attribute](#parameters-per-object-primitive-and-vertex) of what the material is on. Lengths in object space grow with the object when an instance is scaled.
Colours are linear Rec. 709. All pictures show a ball of 24 cm on a block of the same material (of 1 m for `brick` and
`checker`), rendered by `path` under the same light. This page and its pictures are written by
`cargo run --release -p heliostat-bench -- gallery`.
";

/// Stands after the head.
const SECTIONS: &str = r#"
## Parameters per object, primitive and vertex

A parameter can be an *attribute*: a named quantity of a geometry, numbers or vectors, times a factor. It holds one value for
the geometry (`AttributeScope::Object`), one for each triangle, sphere or cone (`Primitive`) or one for each vertex (`Vertex`,
interpolated linearly), and is stored as often and no more. Values of a number for a vector count for all components, of a vector
for a number by the first; the product is moved into the parameter's range.

```rust
let quality = ParameterValue::Attribute("quality".into(), Vec3::splat(0.01));
let wood = ShaderUse::named("wood").with("ring_width", quality);
edits.push(Edit::Attribute(geometry, "quality".into(), Attribute::new(AttributeScope::Vertex, values)));
```

Attributes belong to the handle of a geometry, not to its mesh. `Edit::Attribute` changes one later at its own cost: no tree,
mesh or light is touched. They stay when the mesh deforms, and two geometries that share a mesh and a material can differ in them.
Geometries without the attribute keep the shader's default, and `ApplyReport::problems` says so. Values must be finite and as many
as the scope says, or the edit is refused.

glTF files bring attributes whose names begin with `_` (SCALAR and VEC3); a shader in a material's `extras` takes them by
`"parameters": {"size": {"attribute": "_HEAT", "factor": [2, 2, 2]}}`. PLY files bring every scalar property of vertices that means
nothing else under its name, and those of faces as `face_NAME`, with `face_color` from `red green blue`. `heliostat info` lists
what there is, and `heliostat render scan.ply --materials lambert:diffuse=@quality*0.01` shows it. Plug-ins get the values like all
others.

## Shaders of your own

A program registers its shaders in a `ShaderRegistry`, which `Engine::with_shaders` takes: all are small Rust traits over lanes
with named parameters.

| trait | says | registered by | used by |
|---|---|---|---|
| `SurfaceShader` | what a material looks like at a point | `register` | `Material::shader` |
| `LightShader` | how strongly a light shines in a direction | `register_light` | `LightKind::Shader` |
| `EnvironmentShader` | how much light comes from a direction outside the scene | `register_environment` | `Environment::Shader` |
| `CameraShader` | along which ray a point of the picture is seen | `register_camera` | `Camera::shader` |

Points that a light reaches and rays that leave the scene ask the shader itself. Light paths and photons draw directions from a
table of it, 256 by 128 for a light and 512 by 256 for an environment, which changes of its parameters make anew; a light that is
moved, turned or dimmed keeps its table, and lights with the same parameters share one. A camera shader takes the place of the
projection; lens, eyes, place and motion of the camera work as ever. Surface shaders can also come from [plug-ins](plugins.md),
and [pixel shaders](pixel-shaders.md) have a registry of their own.
"#;

/// Stands before the light shaders.
const LIGHT_HEAD: &str = r#"
## Light shaders

What a light without area can be, beside points, spots, measured profiles and projectors: a program says its radiant intensity
by direction. In light space the light aims along −Z, with +Y up.

```rust
let shader = Arc::new(ShaderUse::named("barn-doors").with("top", 0.1).with("left", 0.3));
let (position, scale, range) = (Vec3::new(0.0, 3.0, 4.0), Vec3::splat(120.0), f32::INFINITY);
let kind = LightKind::Shader { position, world_from_light: Mat3::IDENTITY, scale, shader, range };
```

A glTF node names one in its `extras`, `{"heliostat_light": {"name": "blinds", "intensity": [80, 70, 50], "parameters": {"open": 0.3}}}`;
the intensity multiplies the shader's. Pictures show a wall 3 m away.
"#;

const PIXEL_HEAD: &str = "# Pixel shaders

What a finished picture can go through: `--pixel NAME[:PARAMETER=VALUE,…]` on the command line, as often as wanted, and
`FrameRequest::pixel_shaders` in programs. Those that are tone curves end in colours for a display, and `--tone NAME` chooses
one for pictures of 8 bits in place of `filmic`. Colours are linear Rec. 709; on the command line they are written `R/G/B`.

```
heliostat render conference -o plan.png --pixel edges:ink=0/0/0.2,paper=0.7
heliostat render atrium -o atrium.png --tone agx:saturation=1.2
```

Programs add their own: a `PixelShader` is a Rust trait over lanes (`heliostat::shading::pixel`), registered in a
`PixelRegistry` that `Engine::set_pixel_shaders` takes. This page and its pictures are written by
`cargo run --release -p heliostat-bench -- gallery`.
";

/// The whole page of surface and light shaders.
pub(super) fn surfaces(registry: &ShaderRegistry) -> String {
    let mut page = [HEAD, SECTIONS].concat();
    for program in registry.programs().values() {
        let info = program.info();
        section(&mut page, "##", "shaders", (&info.name, &info.about), &info.parameters);
    }
    page.push_str(LIGHT_HEAD);
    for LightInfo { name, about, parameters } in registry.light_infos() {
        section(&mut page, "###", "shaders", (&name, &about), &parameters);
    }
    page
}

/// The whole page of pixel shaders.
pub(super) fn pixels(registry: &PixelRegistry) -> String {
    let mut page = String::from(PIXEL_HEAD);
    for program in registry.programs().values() {
        let info = program.info();
        let about = if info.for_display { format!("{} (for a display)", info.about) } else { info.about };
        section(&mut page, "##", "pixel-shaders", (&info.name, &about), &info.parameters);
    }
    page
}

fn section(
    page: &mut String,
    rank: &str,
    folder: &str,
    (name, about): (&str, &str),
    parameters: &[Parameter],
) {
    // Writing to a string cannot fail.
    let _ = write!(page, "\n{rank} {name}\n\n![{name}]({folder}/{name}.png)\n\n{}.\n", capitalised(about));
    if parameters.is_empty() {
        let _ = write!(page, "\nIt has no parameters.\n");
        return;
    }
    let _ = write!(page, "\n| parameter | default | range | unit | what it does |\n|---|---|---|---|---|\n");
    for parameter in parameters {
        let Parameter { name, unit, about, .. } = parameter;
        let _ =
            writeln!(page, "| `{name}` | {} | {} | {unit} | {about} |", default(parameter), range(parameter));
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

fn default(parameter: &Parameter) -> String {
    let [x, y, z] = parameter.default;
    match parameter.kind {
        ParameterKind::Float => number(x),
        ParameterKind::Color | ParameterKind::Vector => {
            format!("({}, {}, {})", number(x), number(y), number(z))
        }
    }
}

fn range(parameter: &Parameter) -> String {
    let [low, high] = parameter.range;
    let kind = if parameter.kind == ParameterKind::Color { "colour, " } else { "" };
    format!("{kind}{} to {}", number(low), number(high))
}

/// Large and small numbers by their power of ten.
fn number(value: f32) -> String {
    let size = value.abs();
    if value != 0.0 && !(1e-4..1e5).contains(&size) { format!("{value:e}") } else { format!("{value}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_says_what_the_registry_says() {
        let docs = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs");
        let (surface_shaders, pixel_shaders) = (ShaderRegistry::built_in(), PixelRegistry::built_in());
        let lights = surface_shaders.light_infos().map(|info| info.name);
        let names = surface_shaders.programs().keys().cloned().chain(lights).collect();
        let surfaces = ("shaders", surfaces(&surface_shaders), names);
        let names = pixel_shaders.programs().keys().cloned().collect();
        let pixels = ("pixel-shaders", pixels(&pixel_shaders), names);
        for (folder, text, names) in [surfaces, pixels] {
            let names: Vec<String> = names;
            let page = std::fs::read_to_string(format!("{docs}/{folder}.md")).expect("the page");
            assert!(page.replace('\r', "") == text, "run `heliostat-bench gallery`: docs/{folder}.md is old");
            for name in names {
                let size =
                    std::fs::metadata(format!("{docs}/{folder}/{name}.png")).expect("its picture").len();
                assert!(size <= super::super::LARGEST_FILE as u64, "{name}.png has {size} bytes");
            }
        }
    }
}
