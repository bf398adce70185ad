//! Measures what moving instances costs: 28,000 of them in one object, one, some or all of which change their places.
//!
//! `cargo run --release -p heliostat-kernel --example moving [-- COUNT]`
#![allow(clippy::print_stdout, reason = "a measuring program speaks on stdout")]
use std::{error::Error, f32::consts::TAU, sync::Arc, time::Instant};

use heliostat_kernel::{
    BuildOptions, Instance, InstanceChange, Mesh, Object, TriangleBvh,
    glam::{Affine3A, Quat, Vec3},
};

/// Of how many each time is the best and the median.
const RUNS: usize = 41;

fn main() -> Result<(), Box<dyn Error>> {
    let count = std::env::args().nth(1).map_or(Ok(28_000), |text| text.parse())?;
    let tree = TriangleBvh::build(&[spike()], &BuildOptions::default())?;
    let plant = Arc::new(Object::new(Some(tree.into()), Vec::new())?);
    let planted: Vec<Instance> = (0..count).map(|index| place(&plant, index, count, 0.0)).collect();
    let mut times = Vec::new();
    for _ in 0..RUNS {
        let instances = planted.clone();
        let start = Instant::now();
        let object = Object::new(None, instances)?;
        times.push(start.elapsed().as_secs_f64());
        drop(object);
    }
    report("new object", times, "");
    for (what, step) in [("one moves", count), ("1 in 100", 100), ("1 in 10", 10), ("all", 1)] {
        let mut object = Object::new(None, planted.clone())?;
        let mut times = Vec::new();
        let mut last = String::new();
        for frame in 1..=RUNS {
            let moved = |index| place(&plant, index, count, frame as f32 / 25.0);
            let chosen = (count / 3 % step..count).step_by(step);
            let mut changes: Vec<_> =
                chosen.map(|index| InstanceChange { index, instance: moved(index) }).collect();
            let start = Instant::now();
            let update = object.update(&mut changes)?;
            times.push(start.elapsed().as_secs_f64());
            last = format!("{update:?}");
        }
        report(what, times, &last);
    }
    Ok(())
}

fn report(what: &str, mut times: Vec<f64>, last: &str) {
    times.sort_by(f64::total_cmp);
    println!(
        "{what:12} best {:9.1} µs, median {:9.1} µs  {last}",
        times[0] * 1e6,
        times[times.len() / 2] * 1e6
    );
}

/// A plant of a field that the wind sways.
fn place(plant: &Arc<Object>, index: usize, count: usize, time: f32) -> Instance {
    let side = (count as f32).sqrt();
    let random = |salt: u32| {
        let bits = (index as u32 ^ salt).wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (((bits >> 16) ^ bits) & 0xffff) as f32 / 65536.0
    };
    let (x, z) = (random(1) * side, random(2) * side);
    let sway = (time * 2.0 + 0.3 * x).sin() * 0.3;
    let turn = Quat::from_rotation_z(sway) * Quat::from_rotation_y(random(3) * TAU);
    let size = Vec3::splat(0.7 + 0.6 * random(4));
    let parent_from_object = Affine3A::from_scale_rotation_translation(size, turn, Vec3::new(x, 0.0, z));
    Instance { object: Arc::clone(plant), parent_from_object, motion: None, id: index as u32 }
}

/// A tetrahedron, higher than wide.
fn spike() -> Mesh {
    let foot = |angle: f32| Vec3::new(angle.cos() * 0.4, 0.0, angle.sin() * 0.4);
    let corners = [foot(0.0), foot(TAU / 3.0), foot(TAU / 1.5), Vec3::Y * 2.0];
    Mesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
}
