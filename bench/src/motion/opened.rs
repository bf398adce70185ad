//! What opening instances in the tree over them gains and costs: heaps of things of many shapes, opened where the kernel
//! chooses to, against the same heaps kept closed.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use heliostat::kernel::glam::{Affine3A, Quat, Vec3};
use heliostat::kernel::{BuildOptions, Hit, Instance, Mesh, Object, Ray, RayQuery, Tile, TriangleBvh, World};

use crate::measure::{Clock, geometric_mean, interleave};
use crate::result;

/// Things in a heap.
const THINGS: usize = 150;
/// Among so many instances, of which all but the things are nothing, none is opened.
const TOO_MANY: usize = 1025;
/// Pictures are so many tiles wide and high.
const TILES: usize = 24;
/// Unrelated rays per run.
const RAYS: usize = 1 << 15;

pub(super) fn run(runs: usize) -> Result<(), String> {
    result(&format!(
        "heaps of {THINGS} things, opened where it pays against closed, one thread, time over time closed"
    ));
    let mut ratios = [Vec::new(), Vec::new()];
    for (name, mesh) in shapes() {
        let [opened, closed] = heaps(&mesh)?;
        let chosen = if opened.1 == closed.1 { "closed" } else { "opened" };
        let mut line = format!("{name:10} {:6} triangles, {chosen}:", mesh.indices.len());
        for (what, ratios) in ["primary", "unrelated"].into_iter().zip(&mut ratios) {
            let pass = |world: &World| Ok(if what == "primary" { primary(world) } else { unrelated(world) });
            let (a, b) = interleave(runs, || pass(&opened.0), || pass(&closed.0))?;
            line += &format!("  {what} {:5.2}", a / b);
            if chosen == "opened" {
                ratios.push(a / b);
            }
        }
        result(&line);
    }
    let [primary, unrelated] = ratios.each_ref().map(|ratios| geometric_mean(ratios));
    result(&format!("opened ones, geometric means: primary {primary:.2}, unrelated {unrelated:.2}"));
    Ok(())
}

/// The heap, opened where it pays and closed, and the costs of the trees over the instances.
fn heaps(mesh: &Mesh) -> Result<[(World, f32); 2], String> {
    let tree = TriangleBvh::build(std::slice::from_ref(mesh), &BuildOptions::default());
    let thing = Object::new(Some(tree.map_err(|e| e.to_string())?.into()), Vec::new());
    let thing = Arc::new(thing.map_err(|e| e.to_string())?);
    let nothing = Arc::new(Object::new(None, Vec::new()).map_err(|e| e.to_string())?);
    let heap = |count: usize| {
        let mut random = Random(1);
        let instance = |id| {
            let [x, y, z, w] = [(); 4].map(|()| random.signed());
            let turn = Quat::from_xyzw(x, y, z, w).normalize();
            let parent_from_object = Affine3A::from_rotation_translation(turn, random.vec() * 0.8);
            let object = if (id as usize) < THINGS { &thing } else { &nothing };
            Instance { object: object.clone(), parent_from_object, motion: None, id }
        };
        let mut heap =
            Object::new(None, (0..count as u32).map(instance).collect()).map_err(|e| e.to_string())?;
        let sah = heap.update(&mut []).map_err(|e| e.to_string())?.sah;
        Ok::<_, String>((World::new(Arc::new(heap)), sah))
    };
    Ok([heap(THINGS)?, heap(TOO_MANY)?])
}

/// Seconds for the rays of a picture, in tiles.
fn primary(world: &World) -> f64 {
    let eye = Vec3::new(1.5, 1.0, 3.0);
    let (mut tile, mut hits) = (Tile::new(eye), [Hit::MISS; Tile::CAPACITY]);
    let clock = Clock::start(false);
    let pixels = 16 * TILES;
    let at = |i: usize| (i as f32 + 0.5) / pixels as f32 * 2.4 - 1.2;
    for corner in 0..TILES * TILES {
        tile.restart(eye);
        for pixel in 0..256 {
            let (x, y) = (corner % TILES * 16 + pixel % 16, corner / TILES * 16 + pixel / 16);
            tile.push(Vec3::new(at(x), at(y), 0.0) - eye, f32::INFINITY);
        }
        world.intersect_tile(&tile, &mut hits);
    }
    clock.seconds()
}

/// Seconds for rays from anywhere to anywhere in the heap.
fn unrelated(world: &World) -> f64 {
    let mut random = Random(2);
    let rays: Vec<Ray> = (0..RAYS).map(|_| Ray::new(random.vec(), random.vec())).collect();
    let mut hits = vec![Hit::MISS; RAYS];
    let clock = Clock::start(false);
    world.intersect(&rays, &mut hits);
    clock.seconds()
}

/// Things about a metre in size.
fn shapes() -> Vec<(&'static str, Mesh)> {
    let rod = |from: Vec3, to: Vec3| tube(24, 8, 0.01, move |t| from.lerp(to, t));
    let star = |i: u32| {
        let (s, c) = (i as f32 * TAU / 7.0).sin_cos();
        rod(Vec3::ZERO, Vec3::new(0.5 * c, 0.5 * s, 0.3 * (i as f32 * 2.4).sin()))
    };
    let bar = |i: u32| {
        let (at, side) = ((i % 8) as f32 / 7.0 - 0.5, i / 8);
        let end = |x: f32| if side == 0 { Vec3::new(at, x, 0.0) } else { Vec3::new(x, at, 0.0) };
        rod(end(-0.5), end(0.5))
    };
    let rung = |i: u32| {
        let y = i as f32 / 10.0 - 0.5;
        rod(Vec3::new(-0.1, y, 0.0), Vec3::new(0.1, y, 0.0))
    };
    let rail = |x: f32| rod(Vec3::new(x, -0.55, 0.0), Vec3::new(x, 0.55, 0.0));
    let helix = |t: f32| {
        let (s, c) = (t * 8.0 * TAU).sin_cos();
        Vec3::new(0.12 * c, t - 0.5, 0.12 * s)
    };
    let bow = |t: f32| Vec3::new(0.5 * (t * PI).cos(), 0.5 * (t * PI).sin() - 0.25, 0.0);
    let leaf = |u: f32, v: f32| Vec3::new(u - 0.5, 0.08 * (u * PI).sin(), 0.3 * (v - 0.5) * (u * PI).sin());
    let wave = |u: f32, v: f32| Vec3::new(u - 0.5, 0.1 * (u * 9.0).sin(), v - 0.5);
    let boulder = |u: f32, v: f32| {
        let ((s, c), (ring, height)) = ((u * TAU).sin_cos(), (v * PI).sin_cos());
        Vec3::new(c * ring, height, s * ring) * (0.3 + 0.05 * (u * 31.0).sin() * ring)
    };
    vec![
        ("springs", tube(400, 8, 0.015, helix)),
        ("bows", tube(100, 8, 0.02, bow)),
        ("needles", tube(60, 6, 0.003, |t| Vec3::new(1.2 * t - 0.6, 0.0, 0.0))),
        ("logs", tube(40, 16, 0.1, |t| Vec3::new(t - 0.5, 0.0, 0.0))),
        ("stars", together((0..7).map(star))),
        ("grids", together((0..16).map(bar))),
        ("ladders", together((0..11).map(rung).chain([rail(-0.1), rail(0.1)]))),
        ("leaves", sheet(60, 20, leaf)),
        ("waves", sheet(60, 60, wave)),
        ("boulders", sheet(60, 40, boulder)),
    ]
}

/// A tube along a curve.
fn tube(along: u32, around: u32, radius: f32, curve: impl Fn(f32) -> Vec3) -> Mesh {
    let point = |u: f32, v: f32| {
        let tangent = (curve(v + 1.0e-3) - curve(v - 1.0e-3)).normalize();
        let across = tangent.any_orthonormal_vector();
        let (s, c) = (u * TAU).sin_cos();
        curve(v) + (across * c + tangent.cross(across) * s) * radius
    };
    sheet(around, along, point)
}

/// A grid of quads over (u, v) in 0..=1.
fn sheet(columns: u32, rows: u32, point: impl Fn(f32, f32) -> Vec3) -> Mesh {
    let at =
        |i: u32| point((i % (columns + 1)) as f32 / columns as f32, (i / (columns + 1)) as f32 / rows as f32);
    let positions: Vec<Vec3> = (0..(columns + 1) * (rows + 1)).map(at).collect();
    let quads = (0..columns * rows).map(|q| q / columns * (columns + 1) + q % columns);
    let indices: Vec<[u32; 3]> =
        quads.flat_map(|a| [[a, a + 1, a + columns + 2], [a, a + columns + 2, a + columns + 1]]).collect();
    Mesh::new(positions, indices)
}

fn together(meshes: impl Iterator<Item = Mesh>) -> Mesh {
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    for mesh in meshes {
        let first = positions.len() as u32;
        positions.extend_from_slice(&mesh.positions);
        indices.extend(mesh.indices.iter().map(|triangle| triangle.map(|corner| first + corner)));
    }
    Mesh::new(positions, indices)
}

/// A small deterministic generator: Steele, Lea and Flood 2014, "Fast splittable pseudorandom number generators".
struct Random(u64);

impl Random {
    fn signed(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn vec(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
}
