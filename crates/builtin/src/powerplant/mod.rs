//! A boiler house in the open, with turbines, silos and a chimney: 12.5 million triangles of thin things behind thin
//! things. The class of the report's Power Plant, to our own plan. Pipes and the boiler are unique, made on all threads;
//! gratings, valves, rails, stairs and steelwork are instances.

mod boiler;
mod pipes;
mod steel;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{Camera, Edit, Material, MaterialId, ObjectId, SceneBuilder};

use crate::shape::Shape;
use crate::{paint, pattern, sky};

/// Bays of the steelwork along X and Z, and storeys; half extents and pitches follow. Metres.
const BAYS: [i32; 2] = [6, 4];
const BAY: f32 = 10.0;
const LEVELS: i32 = 9;
const PITCH: f32 = 6.0;
/// The boiler hangs in the middle: half its edge, its lower and upper end, metres.
const BOILER: f32 = 8.0;
const BOILER_ENDS: [f32; 2] = [7.0, 50.0];

/// What things are made of.
struct Palette {
    steel: MaterialId,
    zinc: MaterialId,
    concrete: MaterialId,
    boiler: MaterialId,
    cladding: MaterialId,
    enamel: MaterialId,
    yellow: MaterialId,
    red: MaterialId,
    brick: MaterialId,
    /// Pipes are marked by what flows in them.
    pipes: [MaterialId; 6],
}

impl Palette {
    fn new(builder: &mut SceneBuilder) -> Self {
        let concrete = paint::texture(builder, "concrete", 512, |uv| {
            pattern::slabs(uv, 4, [Vec3::new(0.36, 0.35, 0.33), Vec3::new(0.33, 0.32, 0.31)], 8)
        });
        let brick = paint::texture(builder, "chimney", 512, |uv| {
            pattern::ashlar(uv, 16, Vec3::new(0.42, 0.20, 0.13), 4)
        });
        let concrete = paint::textured(builder, "concrete", concrete, Vec2::splat(12.0), 0.9);
        let brick = paint::textured(builder, "chimney", brick, Vec2::splat(6.0), 0.9);
        let mut painted = |name: &str, color: [f32; 3], roughness: f32| {
            builder.material(Material::plastic(name, color.into(), roughness))
        };
        let steel = painted("painted steel", [0.12, 0.20, 0.27], 0.45);
        let boiler = painted("boiler", [0.20, 0.13, 0.10], 0.6);
        let enamel = painted("enamel", [0.06, 0.24, 0.22], 0.25);
        let yellow = painted("handrail", [0.72, 0.47, 0.03], 0.4);
        let red = painted("handwheel", [0.50, 0.035, 0.02], 0.4);
        let marked = [
            painted("water", [0.05, 0.28, 0.09], 0.35),
            painted("steam", [0.50, 0.055, 0.03], 0.35),
            painted("gas", [0.68, 0.46, 0.05], 0.35),
            painted("insulation", [0.62, 0.60, 0.56], 0.8),
        ];
        let mut metal = |name: &str, color: Vec3, roughness: f32| {
            builder.material(Material::metal(name, color, roughness))
        };
        let zinc = metal("zinc", Vec3::new(0.50, 0.52, 0.54), 0.5);
        let cladding = metal("cladding", Vec3::new(0.80, 0.81, 0.82), 0.32);
        let copper = metal("copper", Vec3::new(0.72, 0.42, 0.28), 0.3);
        let [water, steam, gas, insulation] = marked;
        Self {
            steel,
            zinc,
            concrete,
            boiler,
            cladding,
            enamel,
            yellow,
            red,
            brick,
            pipes: [cladding, water, steam, gas, insulation, copper],
        }
    }
}

pub(crate) fn build() -> Vec<Edit> {
    let mut builder = SceneBuilder::new();
    let palette = Palette::new(&mut builder);
    steel::build(&mut builder, &palette);
    pipes::build(&mut builder, &palette);
    boiler::build(&mut builder, &palette);
    builder.environment(sky::clear(0.8));
    builder.light(sky::sun(Vec3::new(-0.55, -0.75, -0.62), 3.4));
    let views = [
        ("overview", Vec3::new(66.0, 34.0, 78.0), Vec3::new(4.0, 24.0, 0.0), 0.85),
        ("gangway", Vec3::new(24.5, 25.7, 15.5), Vec3::new(-8.0, 25.0, 9.5), 1.1),
        ("stairs", Vec3::new(27.5, 1.7, 24.5), Vec3::new(8.0, 14.0, 6.0), 1.15),
        ("turbines", Vec3::new(37.0, 12.0, 16.0), Vec3::new(58.0, 8.0, -3.0), 0.95),
        ("boiler", Vec3::new(-13.5, 19.7, 14.0), Vec3::new(4.0, 30.0, 4.0), 1.2),
    ];
    for (name, eye, target, fov) in views {
        builder.camera(Camera::look_at(name, eye, target, Vec3::Y, fov));
    }
    builder.finish()
}

/// An object of shapes with their materials.
fn object(
    builder: &mut SceneBuilder,
    name: &str,
    parts: impl IntoIterator<Item = (Shape, MaterialId)>,
) -> ObjectId {
    let parts: Vec<_> =
        parts.into_iter().map(|(shape, material)| (builder.mesh(shape.mesh()), material)).collect();
    builder.object(name, parts)
}

/// An object that stands once in the world as modelled.
fn fixed(builder: &mut SceneBuilder, name: &str, parts: impl IntoIterator<Item = (Shape, MaterialId)>) {
    let object = object(builder, name, parts);
    builder.place(name, object, None, Affine3A::IDENTITY);
}

/// `make(0) … make(count − 1)`, in order, made on all threads.
fn parallel<T: Send>(count: usize, make: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::with_capacity(count)));
    let work = || {
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            if i >= count {
                break;
            }
            let made = make(i);
            done.lock().unwrap_or_else(PoisonError::into_inner).push((i, made));
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get).min(count);
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(work);
        }
        work();
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(i, _)| *i);
    done.into_iter().map(|(_, made)| made).collect()
}

/// Whether the box between two corners touches the boiler or its walkway.
fn meets_boiler(a: Vec3, b: Vec3) -> bool {
    let (min, max) = (a.min(b), a.max(b));
    let reach = BOILER + 1.2;
    min.x < reach
        && max.x > -reach
        && min.z < reach
        && max.z > -reach
        && min.y < BOILER_ENDS[1] + 1.5
        && max.y > BOILER_ENDS[0] - 1.5
}
