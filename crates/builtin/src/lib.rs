//! The built-in procedural scenes: a name in, edits out.
//!
//! Everything is made by formula, deterministically, most in well under a second, the largest in a few; no file is read. Units are metres,
//! +Y is up. Area lights face the room.
//!
//! ```
//! use heliostat_scene::Scene;
//!
//! let mut scene = Scene::default();
//! scene.apply(&heliostat_builtin::build("cornell").expect("a built-in scene"))?;
//! assert_eq!(scene.cameras().len(), 2);
//! # Ok::<(), heliostat_scene::EditError>(())
//! ```
#![forbid(unsafe_code)]

use heliostat_scene::{Edit, Timeline};

mod atrium;
mod building;
mod car;
mod conference;
mod cornell;
mod ellipse;
mod erw;
mod headlight;
mod interior;
mod office;
mod paint;
mod pattern;
mod plant;
mod powerplant;
mod random;
mod shape;
mod sky;
mod solid;
mod spheres;
mod stand;
mod sunflowers;
#[cfg(test)]
mod tests;

pub use sky::default_light;
pub use stand::stand;

/// The scenes by name, each with one line that says what it shows.
pub fn names() -> &'static [(&'static str, &'static str)] {
    &[
        (
            "atrium",
            "a sunlit two-storey courtyard: colonnades, banners, a fountain, plants under an open sky",
        ),
        ("atrium-evening", "the atrium under the last of the sky; a lamp wanders through the court"),
        (
            "carpaint",
            "a car in a studio: flakes and flip-flop colour under a clear coat; a second one in petrol",
        ),
        (
            "building",
            "seven storeys of furnished rooms around a hall: 2.5 million triangles, more than 20,000 lamps",
        ),
        ("conference", "a furnished conference room of about 280,000 triangles under eight ceiling lamps"),
        ("conference-1", "the conference room lit by one rectangular lamp"),
        ("conference-220", "the conference room under 220 small lamps, each a light of its own"),
        ("cornell", "the Cornell box by its measured dimensions; its blocks can turn"),
        ("ellipse", "an elliptic hall with an ambulatory under 1,164 lamps"),
        ("erw6", "a small office by night under six ceiling lamps, of fewer than 1,000 triangles"),
        ("erw10", "ten offices along a corridor under a hundred lamps, some behind closed doors"),
        (
            "headlight",
            "a car's head lamp of 800,000 triangles: faceted reflector, coiled filament, fluted lens",
        ),
        ("headlight-levels", "the head lamp in false colour: how many edges rays have where they end"),
        (
            "office",
            "a wooden desk on marble before a brick wall, all of procedural shaders, with a wavy mirror",
        ),
        (
            "powerplant",
            "a boiler house of 12.5 million triangles: steelwork, gratings, stairs, pipes, turbines",
        ),
        (
            "sunflowers",
            "a field of 28,000 sunflowers among trees, a billion triangles by instancing; the sun can move",
        ),
        ("spheres", "the material model: metals, plastics, lacquers and glass over roughness"),
    ]
}

/// The edits that make the scene `name` in an empty [`Scene`](heliostat_scene::Scene), or `None` when there is no
/// such scene. The same name always gives the same edits.
pub fn build(name: &str) -> Option<Vec<Edit>> {
    Some(match name {
        "atrium" => atrium::build(),
        "atrium-evening" => atrium::build_evening(),
        "carpaint" => car::build(),
        "building" => building::build(),
        "conference" => conference::build(conference::Lighting::Ceiling),
        "conference-220" => conference::build(conference::Lighting::ManyLamps),
        "conference-1" => conference::build(conference::Lighting::OneLamp),
        "cornell" => cornell::build(),
        "ellipse" => ellipse::build(),
        "erw6" => erw::build_room(),
        "erw10" => erw::build_ten(),
        "headlight" => headlight::build(headlight::Look::Lit),
        "headlight-levels" => headlight::build(headlight::Look::Levels),
        "office" => office::build(),
        "powerplant" => powerplant::build(),
        "spheres" => spheres::build(),
        "sunflowers" => sunflowers::build(),
        _ => return None,
    })
}

/// How the scene `name` moves; empty for those that stand still. At time 0 it stands as [`build`] makes it.
pub fn timeline(name: &str) -> Timeline {
    match name {
        "atrium-evening" => atrium::evening_timeline(),
        "cornell" => cornell::timeline(),
        "sunflowers" => sunflowers::timeline(),
        _ => Timeline::default(),
    }
}
