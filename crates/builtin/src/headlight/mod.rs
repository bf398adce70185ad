//! A car's head lamp that aims along −Z: a reflector of facets, a bulb with a coiled filament, a fluted lens that light
//! enters and leaves as it does glass. About 800,000 triangles. The report's show-piece of deep reflection and refraction.

mod optics;

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{Camera, Edit, Environment, Material, MaterialId, SceneBuilder, ShaderUse, Volume};

use crate::shape::Shape;
use crate::sky;
use crate::solid::{cap, lathe, loft, sphere, superellipse, tube};

/// Edges of a ray that show white in `headlight-levels`.
const LEVELS: f32 = 25.0;
/// The filament's radiance: a coil of 46 mm² that gives about a thousand lumens, at 683 lm/W.
const FILAMENT: Vec3 = Vec3::new(13_000.0, 9_800.0, 6_400.0);

/// What is shown.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Look {
    /// The lamp, lit, in a photographer's studio.
    Lit,
    /// False colour: where rays end, how many edges it took to get there.
    Levels,
}

pub(crate) fn build(look: Look) -> Vec<Edit> {
    let mut builder = SceneBuilder::new();
    let palette = Palette::new(&mut builder, look);
    let mut put = |name: &str, shape: Shape, material: MaterialId| {
        let mesh = builder.mesh(shape.mesh());
        let object = builder.object(name, [(mesh, material)]);
        builder.place(name, object, None, Affine3A::IDENTITY);
    };
    put("reflector", optics::reflector(), palette.mirror);
    put("lens", optics::lens(), palette.lens);
    put("envelope", optics::envelope(), palette.glass);
    put("filament", optics::filament(), palette.filament);
    put("leads", leads(), palette.metal);
    put("socket", socket(), palette.black);
    put("housing", housing(), palette.black);
    put("bezel", bezel(), palette.metal);
    match look {
        Look::Lit => builder.environment(sky::studio()),
        Look::Levels => {
            // Rays that leave end at a sphere all around.
            let around = sphere(Vec3::ZERO, 4.0, 32);
            let mesh = builder.mesh(around.mesh());
            let object = builder.object("surroundings", [(mesh, palette.black)]);
            builder.place("surroundings", object, None, Affine3A::IDENTITY);
            builder.environment(Environment::None);
        }
    }
    let views = [
        ("front", Vec3::new(0.20, 0.10, -0.52), Vec3::new(0.0, 0.0, -0.09), 0.52),
        ("close", Vec3::new(0.06, 0.03, -0.30), Vec3::new(-0.01, 0.0, -0.05), 0.55),
        ("side", Vec3::new(0.48, 0.16, -0.22), Vec3::new(0.0, 0.0, -0.06), 0.46),
    ];
    for (name, eye, target, fov) in views {
        builder.camera(Camera::look_at(name, eye, target, Vec3::Y, fov));
    }
    builder.finish()
}

/// What things are made of.
struct Palette {
    mirror: MaterialId,
    lens: MaterialId,
    glass: MaterialId,
    filament: MaterialId,
    metal: MaterialId,
    black: MaterialId,
}

impl Palette {
    fn new(builder: &mut SceneBuilder, look: Look) -> Self {
        // In false colour whatever ends a ray shows its level; mirrors and glass send it on as ever.
        let mut end = |material: Material| {
            let shader = ShaderUse::named("show-level").with("levels", LEVELS);
            let shader = (look == Look::Levels).then(|| Arc::new(shader));
            builder.material(Material { shader, ..material })
        };
        let filament = end(Material::emitter("filament", FILAMENT));
        let metal = end(Material::metal("metal", Vec3::new(0.70, 0.70, 0.72), 0.25));
        let black = end(Material::plastic("black", Vec3::splat(0.018), 0.4));
        let clear = Volume { attenuation_distance: 0.5, attenuation_color: Vec3::new(0.90, 0.95, 0.94) };
        let lens = Material { volume: Some(clear), ..Material::glass("lens", 1.52) };
        Self {
            mirror: builder.material(Material::metal("reflector", Vec3::new(0.91, 0.92, 0.92), 0.0)),
            lens: builder.material(lens),
            glass: builder.material(Material::glass("bulb", 1.48)),
            filament,
            metal,
            black,
        }
    }
}

/// Two wires that hold the filament.
fn leads() -> Shape {
    let [from, to] = optics::FILAMENT_ENDS;
    let wire = |points: [Vec3; 3]| tube(&points.map(|p| (p, 0.000_25)), 12, true);
    let coil = Vec3::X * optics::COIL;
    let foot = |x: f32| Vec3::new(x, 0.0, 0.021);
    Shape::union([
        wire([coil + Vec3::Z * from, Vec3::new(0.002, 0.0, from), foot(0.002)]),
        wire([coil + Vec3::Z * to, Vec3::new(-0.0022, 0.0006, to), foot(-0.0022)]),
    ])
}

/// The bulb's foot through the hole of the reflector, and the plate behind it.
fn socket() -> Shape {
    let profile = [
        (0.0, -0.060),
        (0.012, -0.060),
        (0.012, -0.050),
        (0.020, -0.050),
        (0.020, -0.040),
        (0.0062, -0.040),
        (0.0062, -0.0185),
        (0.0, -0.0185),
    ];
    lathe(96, &profile).at(optics::forwards())
}

/// The shell around the reflector, closed behind, open where the lens is.
fn housing() -> Shape {
    let outline = superellipse(Vec2::new(0.148, 0.098), 8.0, 256);
    let (back, inset, wall) = (-0.062, -0.006, -0.003);
    let mut profile = vec![(inset, back), (0.0, back + 0.012)];
    profile.extend((0..=24).map(|k| (0.0006 * ((k % 4) / 2) as f32, -0.045 + 0.008 * k as f32)));
    profile.extend([(wall, 0.147), (wall, back + 0.014), (inset, back + 0.003)]);
    let plates = [cap(&outline, inset, back, false), cap(&outline, inset, back + 0.003, true)];
    Shape::union([loft(&outline, &profile), Shape::union(plates)]).at(optics::forwards())
}

/// A frame of bars before the lens's border.
fn bezel() -> Shape {
    let (half, wide, deep) = (optics::LENS, 0.014, 0.012);
    let z = -0.150;
    let bar = |size: Vec3, at: Vec3| Shape::rounded_block(size, 0.004, 6, 1).moved(at);
    let (x, y) = (half.x + 0.004, half.y + 0.004);
    Shape::union([
        bar(Vec3::new(2.0 * x + wide, wide, deep), Vec3::new(0.0, y, z)),
        bar(Vec3::new(2.0 * x + wide, wide, deep), Vec3::new(0.0, -y, z)),
        bar(Vec3::new(wide, 2.0 * y - wide, deep), Vec3::new(x, 0.0, z)),
        bar(Vec3::new(wide, 2.0 * y - wide, deep), Vec3::new(-x, 0.0, z)),
    ])
}
