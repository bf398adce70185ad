//! What the C interface costs: the checkerboard of `examples/shaders/c` against the built-in one, packet by packet.
//!
//! `cargo run --release -p heliostat-plugins --example overhead -- checker.so`, after compiling the plug-in as
//! `docs/plugins.md` says. Processor time of the thread, interleaved, median of the rounds.
#![allow(clippy::print_stdout, reason = "a measuring program speaks on stdout")]
use std::{error::Error, hint::black_box, path::PathBuf, sync::Arc};

use glam::Vec3;
use heliostat_plugins::Plugins;
use heliostat_scene::ShaderUse;
use heliostat_shading::lanes::{Floats, WIDTH};
use heliostat_shading::{Closures, Input, LaneMode, Points, ShaderRegistry, SurfaceProgram};

const ROUNDS: usize = 61;
const PACKETS: usize = 40_000;

fn main() -> Result<(), Box<dyn Error>> {
    let file = PathBuf::from(std::env::args().nth(1).ok_or("name the compiled plug-in")?);
    let built_in = ShaderRegistry::built_in();
    let built_in = built_in.find(&ShaderUse::named("checker")).map_err(|problem| problem.0)?;
    let inputs = [Vec3::splat(0.8), Vec3::splat(0.1), Vec3::splat(0.25)].map(Input::constant);
    let plugin = Plugins::default().load(&file)?.remove(0);
    let plugin = plugin.prepared(&inputs)?.ok_or("the plug-in prepares nothing")?;
    let ways: [(&str, &Arc<dyn SurfaceProgram>, LaneMode); 3] = [
        ("built in, packets", &built_in, LaneMode::default()),
        ("plug-in in C", &plugin, LaneMode::default()),
        ("built in, one by one", &built_in, LaneMode::Single),
    ];
    let points = points();
    let mut times = [const { Vec::new() }; 3];
    for _ in 0..ROUNDS {
        for ((_, program, mode), times) in ways.iter().zip(&mut times) {
            times.push(measure(&***program, *mode, &points, &inputs));
        }
    }
    let medians = times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    });
    for ((name, ..), time) in ways.iter().zip(medians) {
        println!("{name:20}: {:6.1} ns per packet of {WIDTH}, {:.2}×", time * 1e9, time / medians[0]);
    }
    Ok(())
}

/// Packets of points on a slanted wall.
fn points() -> Vec<Points> {
    let packet = |i: usize| {
        let mut points = Points::default();
        for lane in 0..WIDTH {
            let at = Vec3::new((i * WIDTH + lane) as f32 * 0.01, i as f32 * 0.02, lane as f32 * 0.03);
            points.position.set(lane, at);
            points.object_position.set(lane, at);
            let normal = Vec3::new(0.1, 0.2, 1.0 + lane as f32 * 0.01).normalize();
            points.ng.set(lane, normal);
            points.normal.set(lane, normal);
            points.wo.set(lane, Vec3::Z);
            for (axis, column) in points.object_from_world.iter_mut().enumerate() {
                column.set(lane, Vec3::AXES[axis]);
            }
        }
        points.width = Floats::splat(0.004);
        points
    };
    (0..64).map(packet).collect()
}

/// Seconds per packet.
fn measure(program: &dyn SurfaceProgram, mode: LaneMode, points: &[Points], inputs: &[Input]) -> f64 {
    let mut closures = Closures::default();
    closures.normal.z = Floats::splat(1.0);
    closures.coat_normal.z = Floats::splat(1.0);
    let start = seconds();
    for points in points.iter().cycle().take(PACKETS) {
        program.run(mode, WIDTH, black_box(points), inputs, &mut closures);
        black_box(&closures);
    }
    (seconds() - start) / PACKETS as f64
}

/// Processor time of this thread.
fn seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
