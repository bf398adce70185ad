//! The page of surface shaders, from the registry.

use std::fmt::Write;

use heliostat::shading::{Parameter, ParameterKind, ShaderInfo, ShaderRegistry};

const HEAD: &str = "# Surface shaders

The shaders that come with the engine. A material names one and sets what differs from the defaults; the shader starts
from the material as it stands and changes it from point to point.

```rust
let shader = ShaderUse::named(\"wood\").with(\"ring_width\", 0.008).with(\"dark\", Vec3::new(0.2, 0.1, 0.05));
let oak = Material { shader: Some(Arc::new(shader)), ..Material::default() };
```

Any parameter can be a texture times a factor. Lengths in object space grow with the object when an instance is scaled.
Colours are linear Rec. 709. All pictures show a ball of 24 cm on a block of the same material (of 1 m for `brick` and
`checker`), rendered by `path` under the same light. This page and its pictures are written by
`cargo run --release -p heliostat-bench -- gallery`.
";

/// The whole page.
pub(super) fn markdown(registry: &ShaderRegistry) -> String {
    let mut page = String::from(HEAD);
    for program in registry.programs().values() {
        section(&mut page, &program.info());
    }
    page
}

fn section(page: &mut String, info: &ShaderInfo) {
    let (name, about) = (&info.name, &info.about);
    // Writing to a string cannot fail.
    let _ = write!(page, "\n## {name}\n\n![{name}](shaders/{name}.png)\n\n{}.\n", capitalised(about));
    if info.parameters.is_empty() {
        let _ = write!(page, "\nIt has no parameters.\n");
        return;
    }
    let _ = write!(page, "\n| parameter | default | range | unit | what it does |\n|---|---|---|---|---|\n");
    for parameter in &info.parameters {
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
        let page = std::fs::read_to_string(format!("{docs}/shaders.md")).expect("docs/shaders.md");
        let registry = ShaderRegistry::built_in();
        assert!(
            page.replace('\r', "") == markdown(&registry),
            "run `heliostat-bench gallery`: docs/shaders.md is old"
        );
        for name in registry.programs().keys() {
            let size = std::fs::metadata(format!("{docs}/shaders/{name}.png")).expect("its picture").len();
            assert!(size <= super::super::LARGEST_FILE as u64, "{name}.png has {size} bytes");
        }
    }
}
