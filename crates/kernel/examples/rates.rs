//! Measures the kernel on a generated room of about 280,000 triangles: build and ray rates of one thread.
//!
//! `cargo run --release -p heliostat-kernel --example rates [-- ISA…]`; `ONLY=primary` measures what begins so,
//! `BUILD=quality`, `fast` or `compact` another hierarchy, `ACCEL=kdtree` the kd-tree and `ACCEL=kdtree-median` the one
//! with planes in the middle. `TRIANGLES=10000,1000000` measures only builds instead, over terrains of such sizes on one
//! thread.
#![allow(clippy::print_stdout, reason = "a measuring program speaks on stdout")]
use std::{error::Error, f32::consts::TAU, hint::black_box, sync::Arc, time::Instant};

use heliostat_kernel::{
    BuildOptions, Hit, Instance, Isa, KdOptions, KdSplit, KdTree, Layout, Mesh, Object, Ray, RayQuery, Tile,
    TriangleBvh, Triangles, World,
    glam::{Affine3A, Quat, Vec3},
};

const SIZE: usize = 1024;
const TILE: usize = 16;

fn main() -> Result<(), Box<dyn Error>> {
    if let Ok(sizes) = std::env::var("TRIANGLES") {
        return sizes.split(',').try_for_each(|size| measure_build(size.parse()?));
    }
    let mesh = room();
    let count = mesh.indices.len();
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let start = Instant::now();
        black_box(build(std::slice::from_ref(&mesh))?);
        best = best.min(start.elapsed().as_secs_f64());
    }
    let tree = build(&[mesh])?;
    println!("triangles {count}, build {:.0} ms, {:.2} Mtri/s", best * 1e3, count as f64 / best * 1e-6);
    println!("{tree:?}");

    let plain = Arc::new(Object::new(Some(tree), Vec::new())?);
    let turned = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.3), Vec3::new(1.0, 0.0, 2.0));
    let instance = Instance { object: plain.clone(), parent_from_object: turned, motion: None, id: 0 };
    let placed = Arc::new(Object::new(None, vec![instance])?);

    let names: Vec<String> = std::env::args().skip(1).collect();
    let isas = if names.is_empty() {
        vec![Isa::best()]
    } else {
        names.iter().map(|name| name.parse()).collect::<Result<_, _>>()?
    };
    for isa in isas {
        println!("{isa}:");
        measure(&World::with_isa(plain.clone(), isa)?, Affine3A::IDENTITY, "plain");
        measure(&World::with_isa(placed.clone(), isa)?, turned, "placed");
    }
    Ok(())
}

/// The tree that `ACCEL` and `BUILD` name.
fn build(meshes: &[Mesh]) -> Result<Triangles, Box<dyn Error>> {
    let options = match std::env::var("BUILD").as_deref() {
        Err(_) | Ok("default") => BuildOptions::default(),
        Ok("quality") => BuildOptions::quality(),
        Ok("fast") => BuildOptions::fast(),
        Ok("compact") => BuildOptions { layout: Layout::Compact, ..BuildOptions::default() },
        Ok(other) => return Err(format!("BUILD={other} is none of default, quality, fast, compact").into()),
    };
    let kd = |split| KdTree::build(meshes, &KdOptions { split, ..KdOptions::default() });
    Ok(match std::env::var("ACCEL").as_deref() {
        Err(_) | Ok("bvh") => TriangleBvh::build(meshes, &options)?.into(),
        Ok("kdtree") => kd(KdSplit::Sah)?.into(),
        Ok("kdtree-median") => kd(KdSplit::Median)?.into(),
        Ok(other) => return Err(format!("ACCEL={other} is none of bvh, kdtree, kdtree-median").into()),
    })
}

/// Prints processor time for a terrain of about `triangles`, the best of three builds on one thread.
fn measure_build(triangles: u32) -> Result<(), Box<dyn Error>> {
    let mut terrain = Scene::default();
    let side = (triangles / 2).isqrt();
    terrain.grid(side, side, |u, v| {
        let wave = |f: f32| (u * f).sin() * (v * f * 1.3).cos() / f;
        Vec3::new(u, wave(5.0) + wave(23.0) + wave(111.0), v)
    });
    let meshes = [Mesh::new(terrain.positions, terrain.indices)];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut best = f64::INFINITY;
    let mut text = String::new();
    for _ in 0..3 {
        let (seconds, tree) = pool.install(|| {
            let start = Clock::now();
            let tree = build(&meshes).map(|tree| format!("{tree:?}")).map_err(|error| error.to_string());
            (start.elapsed(), tree)
        });
        best = best.min(seconds);
        text = tree?;
    }
    let count = meshes[0].indices.len() as f64;
    println!("{count} triangles: {best:.3} s, {:.3} Mtri/s, {text}", count / best * 1e-6);
    Ok(())
}

/// Prints rates in million rays per second of this thread's processor time, the best of some runs each.
fn measure(world: &World, place: Affine3A, what: &str) {
    let only = std::env::var("ONLY").unwrap_or_default();
    let rate = |what: &str, name: &str, rays: usize, run: &mut dyn FnMut()| {
        if name.starts_with(&only) { rate(what, name, rays, run) } else { run() }
    };
    let eye = place.transform_point3(Vec3::new(-4.3, 1.7, 3.6));
    let forward = place.transform_vector3(Vec3::new(0.8, -0.18, -0.62)).normalize();
    let tiles = primary_tiles(eye, forward);
    let mut hits = vec![Hit::MISS; SIZE * SIZE];
    rate(what, "primary tiles, closest", hits.len(), &mut || {
        for (tile, hits) in tiles.iter().zip(hits.chunks_mut(Tile::CAPACITY)) {
            world.intersect_tile(tile, hits);
        }
    });
    let rays: Vec<Ray> = tiles.iter().flat_map(|t| (0..t.len()).filter_map(|i| t.ray(i))).collect();
    let mut single = vec![Hit::MISS; rays.len()];
    rate(what, "primary rays, closest", rays.len(), &mut || world.intersect(&rays, &mut single));
    let differ = hits.iter().zip(&single).filter(|(a, b)| {
        (a.primitive, a.path) != (b.primitive, b.path) && (a.t - b.t).abs() > 1e-3 * b.t.min(a.t)
    });
    println!("    tile and single disagree on {} of {} rays", differ.count(), rays.len());

    let lights = [Vec3::new(0.0, 2.8, 0.0), Vec3::new(-4.0, 1.0, 3.9), Vec3::new(4.5, 0.4, -3.0)]
        .map(|p| place.transform_point3(p));
    let shadow = shadow_tiles(&tiles, &hits, &lights);
    let total = shadow.iter().map(Tile::len).sum();
    let mut occluded = [false; Tile::CAPACITY];
    let mut dark = 0;
    rate(what, "shadow tiles, any", total, &mut || {
        dark = 0;
        for tile in &shadow {
            world.occluded_tile(tile, &mut occluded[..tile.len()]);
            dark += occluded[..tile.len()].iter().filter(|&&o| o).count();
        }
    });
    let rays: Vec<Ray> = shadow.iter().flat_map(|t| (0..t.len()).filter_map(|i| t.ray(i))).collect();
    let mut out = vec![false; rays.len()];
    rate(what, "shadow rays, any", rays.len(), &mut || world.occluded(&rays, &mut out));
    let lit = out.iter().filter(|&&o| o).count();
    println!("    occluded: {dark} by tiles, {lit} by single rays, of {total}");

    let bounce = bounce_rays(&tiles, &hits);
    let mut answers = vec![Hit::MISS; bounce.len()];
    rate(what, "diffuse rays, closest", bounce.len(), &mut || world.intersect(&bounce, &mut answers));
    let mut answers = vec![false; bounce.len()];
    rate(what, "diffuse rays, any", bounce.len(), &mut || world.occluded(&bounce, &mut answers));
}

fn rate(what: &str, name: &str, rays: usize, mut run: impl FnMut()) {
    let mut best = f64::INFINITY;
    let begin = Instant::now();
    while begin.elapsed().as_secs_f64() < 0.6 {
        let start = Clock::now();
        run();
        best = best.min(start.elapsed());
    }
    println!("  {what:7} {name:24} {:7.2} Mray/s", rays as f64 / best * 1e-6);
}

/// Processor time of this thread where the system tells it (Linux), wall time elsewhere: other work on the machine
/// then disturbs less.
struct Clock {
    wall: Instant,
    processor: Option<u64>,
}

impl Clock {
    fn now() -> Self {
        Self { wall: Instant::now(), processor: processor_nanoseconds() }
    }

    /// Seconds since.
    fn elapsed(&self) -> f64 {
        match (self.processor, processor_nanoseconds()) {
            (Some(start), Some(end)) => (end - start) as f64 * 1.0e-9,
            _ => self.wall.elapsed().as_secs_f64(),
        }
    }
}

fn processor_nanoseconds() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    text.split_whitespace().next()?.parse().ok()
}

/// 16×16 pixels per tile, pushed in blocks of 4×4.
fn primary_tiles(eye: Vec3, forward: Vec3) -> Vec<Tile> {
    let right = forward.cross(Vec3::Y).normalize() * 0.6;
    let up = right.cross(forward).normalize() * 0.6;
    let mut tiles = Vec::new();
    for index in 0..(SIZE / TILE).pow(2) {
        let (tx, ty) = (index % (SIZE / TILE) * TILE, index / (SIZE / TILE) * TILE);
        let mut tile = Tile::new(eye);
        for i in 0..TILE * TILE {
            let (group, pixel) = (i / 16, i % 16);
            let (x, y) = (tx + group % 4 * 4 + pixel % 4, ty + group / 4 * 4 + pixel / 4);
            let at = |k: usize| (2 * k + 1) as f32 / SIZE as f32 - 1.0;
            tile.push(forward + right * at(x) - up * at(y), f32::INFINITY);
        }
        tiles.push(tile);
    }
    tiles
}

/// For each light, tiles of rays from it to the points that a primary tile saw, where they face it.
fn shadow_tiles(primary: &[Tile], hits: &[Hit], lights: &[Vec3]) -> Vec<Tile> {
    let mut shadow = Vec::new();
    for &light in lights {
        for (tile, hits) in primary.iter().zip(hits.chunks(Tile::CAPACITY)) {
            let mut out = Tile::new(light);
            for (i, hit) in hits.iter().enumerate().filter(|(_, hit)| hit.is_hit()) {
                let ray = tile.ray(i).expect("in range");
                let ng = hit.ng * -hit.ng.dot(ray.direction).signum();
                let point = ray.at(hit.t) + ng * 1.0e-3;
                if ng.dot(light - point) > 0.0 {
                    out.push(point - light, 0.9999);
                }
            }
            if !out.is_empty() {
                shadow.push(out);
            }
        }
    }
    shadow
}

/// One ray per hit into the hemisphere.
fn bounce_rays(primary: &[Tile], hits: &[Hit]) -> Vec<Ray> {
    let mut seed = 1_u32;
    let mut random = || {
        seed = seed.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (((seed >> 16) ^ seed) & 0xff_ffff) as f32 / (1 << 24) as f32
    };
    let mut rays = Vec::new();
    for (tile, hits) in primary.iter().zip(hits.chunks(Tile::CAPACITY)) {
        for (i, hit) in hits.iter().enumerate().filter(|(_, hit)| hit.is_hit()) {
            let ray = tile.ray(i).expect("in range");
            let ng = hit.ng * -hit.ng.dot(ray.direction).signum();
            let (z, phi) = (random() * 2.0 - 1.0, random() * TAU);
            let r = (1.0 - z * z).max(0.0).sqrt();
            let direction = ng + Vec3::new(r * phi.cos(), r * phi.sin(), z) * 0.999;
            rays.push(Ray::new(ray.at(hit.t) + ng * 1.0e-3, direction));
        }
    }
    rays
}

/// A room with tables, spheres, tori, shelves and a cloud of leaves.
fn room() -> Mesh {
    let mut scene = Scene::default();
    scene.cuboid(Vec3::new(0.0, 1.5, 0.0), Vec3::new(5.0, 1.5, 4.0));
    for i in 0..12 {
        let p = Vec3::new(-3.8 + (i % 4) as f32 * 2.4, 0.0, -2.6 + (i / 4) as f32 * 2.4);
        scene.cuboid(p + Vec3::Y * 0.75, Vec3::new(0.7, 0.03, 0.45));
        for (x, z) in [(-0.6, -0.4), (0.6, -0.4), (-0.6, 0.4), (0.6, 0.4)] {
            scene.cuboid(p + Vec3::new(x, 0.37, z), Vec3::new(0.03, 0.36, 0.03));
        }
        scene.grid(60, 70, |u, v| sphere(p + Vec3::new(-0.3, 1.0, 0.0), 0.22, u, v));
        scene.grid(80, 50, |u, v| torus(p + Vec3::new(0.3, 0.85, 0.1), 0.2, 0.07, u, v));
    }
    for i in 0..1500 {
        let (row, at) = (i / 150, i % 150);
        let height = 0.1 + 0.03 * ((i * 37) % 11) as f32 / 11.0;
        let p = Vec3::new(-4.8 + at as f32 * 0.064, 0.2 + row as f32 * 0.27, -3.85);
        scene.cuboid(p + Vec3::Y * height, Vec3::new(0.028, height, 0.1));
    }
    let mut seed = 7_u32;
    let mut random = || {
        seed = seed.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (seed >> 8) as f32 / (1 << 24) as f32 - 0.5
    };
    for _ in 0..64_000 {
        let p = Vec3::new(3.6, 1.4, 2.6) + Vec3::new(random(), random(), random()) * Vec3::new(1.6, 2.2, 1.6);
        let (a, b) = (Vec3::new(random(), random(), random()), Vec3::new(random(), random(), random()));
        scene.triangle(p, p + a * 0.06, p + b * 0.06);
    }
    Mesh::new(scene.positions, scene.indices)
}

fn sphere(center: Vec3, radius: f32, u: f32, v: f32) -> Vec3 {
    let (theta, phi) = (v * TAU * 0.5, u * TAU);
    center + Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()) * radius
}

fn torus(center: Vec3, ring: f32, tube: f32, u: f32, v: f32) -> Vec3 {
    let (a, b) = (u * TAU, v * TAU);
    let r = ring + tube * b.cos();
    center + Vec3::new(r * a.cos(), tube * b.sin(), r * a.sin())
}

#[derive(Default)]
struct Scene {
    positions: Vec<Vec3>,
    indices: Vec<[u32; 3]>,
}

impl Scene {
    fn triangle(&mut self, a: Vec3, b: Vec3, c: Vec3) {
        let n = self.positions.len() as u32;
        self.positions.extend([a, b, c]);
        self.indices.push([n, n + 1, n + 2]);
    }

    fn grid(&mut self, columns: u32, rows: u32, point: impl Fn(f32, f32) -> Vec3) {
        let start = self.positions.len() as u32;
        for j in 0..=rows {
            for i in 0..=columns {
                self.positions.push(point(i as f32 / columns as f32, j as f32 / rows as f32));
            }
        }
        for j in 0..rows {
            for i in 0..columns {
                let a = start + j * (columns + 1) + i;
                let (b, c, d) = (a + 1, a + columns + 1, a + columns + 2);
                self.indices.extend([[a, b, d], [a, d, c]]);
            }
        }
    }

    fn cuboid(&mut self, center: Vec3, half: Vec3) {
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                self.grid(1, 1, |u, v| {
                    let mut p = Vec3::ZERO;
                    p[axis] = side;
                    p[(axis + 1) % 3] = 2.0 * u - 1.0;
                    p[(axis + 2) % 3] = 2.0 * v - 1.0;
                    center + p * half
                });
            }
        }
    }
}
