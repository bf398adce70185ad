//! What every built-in shader promises: all parameters count, nothing leaves its range, lanes do not matter.

use std::sync::Arc;

use glam::Vec3;
use heliostat_kernel::Isa;

use crate::closure::Closures;
use crate::lanes::WIDTH;
use crate::point::Points;
use crate::shader::testing::{Random, defaults, grey_plastic, numbers};
use crate::shader::{Input, Parameter, ParameterKind, ShaderRegistry, SurfaceProgram};
use crate::surface::LaneMode;

const PACKETS: u32 = 24;

fn programs() -> Vec<(String, Arc<dyn SurfaceProgram>)> {
    ShaderRegistry::built_in()
        .programs()
        .iter()
        .map(|(name, program)| (name.clone(), program.clone()))
        .collect()
}

fn run(program: &dyn SurfaceProgram, mode: LaneMode, points: &Points, inputs: &[Input]) -> Closures {
    let mut closures = grey_plastic(points);
    program.run(mode, WIDTH, points, inputs, &mut closures);
    closures
}

fn packets() -> Vec<Points> {
    (0..PACKETS).map(|seed| Random::new(seed).points()).collect()
}

#[test]
fn descriptions_are_complete() {
    for (name, program) in programs() {
        let info = program.info();
        assert_eq!(info.name, name);
        assert!(!info.about.is_empty() && !info.about.ends_with('.'), "{name}");
        for p in info.parameters {
            let what = format!("{name}, {}", p.name);
            assert!(!p.about.is_empty() && !p.about.ends_with('.'), "{what}");
            assert!(p.name.chars().all(|c| c.is_ascii_lowercase() || c == '_'), "{what}");
            assert!(p.range[0] < p.range[1], "{what}");
            assert!(p.default.iter().all(|v| (p.range[0]..=p.range[1]).contains(v)), "{what}");
        }
    }
}

/// Values of a parameter besides its default.
fn others(parameter: &Parameter) -> Vec<f32> {
    let [low, high] = parameter.range;
    let default = parameter.default[0];
    let candidates = [default * 0.5, default * 2.0, default + 0.3, low, high];
    let mut others: Vec<f32> = candidates.map(|value| value.clamp(low, high)).to_vec();
    others.retain(|&value| value != default);
    others
}

#[test]
fn every_parameter_does_something() {
    let packets = packets();
    let mut idle = Vec::new();
    for (name, program) in programs() {
        let parameters = program.info().parameters;
        let inputs = defaults(&parameters);
        for (i, parameter) in parameters.iter().enumerate() {
            // For colours, each of the channels.
            let channels = if parameter.kind == ParameterKind::Float { 0..1 } else { 0..3 };
            for channel in channels {
                let counts = others(parameter).into_iter().any(|value| {
                    let mut changed = inputs.clone();
                    match parameter.kind {
                        ParameterKind::Float => changed[i].factor = Vec3::splat(value),
                        _ => changed[i].factor[channel] = value,
                    }
                    packets.iter().any(|points| {
                        let [a, b] = [&inputs, &changed]
                            .map(|inputs| run(&*program, LaneMode::default(), points, inputs));
                        (0..WIDTH).any(|lane| numbers(&a, lane) != numbers(&b, lane))
                    })
                });
                if !counts {
                    idle.push(format!("{name}: {} (channel {channel})", parameter.name));
                }
            }
        }
    }
    assert!(idle.is_empty(), "parameters that change nothing:\n{}", idle.join("\n"));
}

/// Every program with random parameters at random points, ordinary and not.
fn stress(mut check: impl FnMut(&str, &dyn SurfaceProgram, &Points, &[Input])) {
    for (index, (name, program)) in programs().into_iter().enumerate() {
        let parameters = program.info().parameters;
        for round in 0..40 {
            let mut random = Random::new(1000 * index as u32 + round);
            let points = if round % 2 == 0 { random.points() } else { random.extreme_points() };
            let inputs: Vec<Input> = match round {
                0 | 1 => defaults(&parameters),
                _ => parameters.iter().map(|p| Input::constant(random.value(p))).collect(),
            };
            check(&name, &*program, &points, &inputs);
        }
    }
}

#[test]
fn answers_are_finite_and_in_range_whatever_is_asked() {
    let mut failures = Vec::new();
    stress(|name, program, points, inputs| {
        let closures = run(program, LaneMode::default(), points, inputs);
        for lane in 0..WIDTH {
            let finite = numbers(&closures, lane).iter().all(|v| v.is_finite());
            let normals = [closures.normal.get(lane), closures.coat_normal.get(lane)];
            let unit = normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-4);
            let colors = [closures.base_color.get(lane), closures.specular_color.get(lane)];
            let positive = colors.iter().all(|color| color.min_element() >= 0.0);
            if !(finite && unit && positive) {
                failures.push(format!("{name}, lane {lane}: {normals:?} {colors:?}"));
            }
        }
    });
    failures.truncate(40);
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn lanes_agree_with_single_values_on_every_instruction_set() {
    let modes: Vec<(Isa, LaneMode)> =
        Isa::available().into_iter().filter_map(|isa| Some((isa, LaneMode::Packets(isa.level()?)))).collect();
    let bits = |closures: &Closures| -> Vec<u32> {
        (0..WIDTH).flat_map(|lane| numbers(closures, lane)).map(f32::to_bits).collect()
    };
    stress(|name, program, points, inputs| {
        let single = bits(&run(program, LaneMode::Single, points, inputs));
        for (isa, mode) in &modes {
            let lanes = bits(&run(program, *mode, points, inputs));
            assert!(lanes == single, "{name} on {isa} with {inputs:?}");
        }
    });
}

/// Seen from so far away that the footprint covers every detail, patterns are plain.
#[test]
fn patterns_fade_with_distance() {
    for name in ["brick", "checker", "clouds", "granite", "marble", "noise", "wood"] {
        let registry = ShaderRegistry::built_in();
        let program = &registry.programs()[name];
        let inputs = defaults(&program.info().parameters);
        let spread = |width: f32| {
            let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
            for mut points in packets() {
                points.width.0 = [width; WIDTH];
                let closures = run(&**program, LaneMode::default(), &points, &inputs);
                for lane in 0..WIDTH {
                    let color = closures.base_color.get(lane);
                    (low, high) = (low.min(color), high.max(color));
                }
            }
            (high - low).max_element()
        };
        let (near, far) = (spread(1e-5), spread(1e3));
        assert!(near > 0.08, "{name} varies by {near} from nearby");
        // Bricks and crystals keep a trace of their own colour where they are counted, one by one.
        assert!(far < 0.25 * near, "{name} varies by {far} from afar, {near} from nearby");
    }
}

/// Straight on, the relief of a slope is that slope.
#[test]
fn relief_bends_normals_by_its_slope() {
    use super::relief::{Relief, raised};
    use crate::lanes::Vector;
    struct Slope;
    impl Relief<f32> for Slope {
        fn height(&self, p: Vector<f32>) -> f32 {
            p.x * 0.5
        }
    }
    let points = Random::new(5).points();
    for lane in 0..WIDTH {
        let at = points.point::<f32>((), lane);
        let normal = points.normal.get(lane);
        let bent = Vec3::from(raised(&at, &Slope, 0.01, normal.into()));
        // The surface's gradient in the world: the object's x axis, in the tangent plane.
        let columns = points.object_from_world.each_ref().map(|column| column.get(lane));
        let scale = columns[0].length();
        let x = Vec3::new(columns[0].x, columns[1].x, columns[2].x) / scale;
        let expected = (normal - 0.5 * x.reject_from_normalized(normal)).normalize();
        assert!(bent.distance(expected) < 2e-2, "lane {lane}: {bent} instead of {expected}");
    }
}

/// A face that lies on a border between cubes shows the cubes behind it, however wide the footprint across.
#[test]
fn checkers_are_sharp_on_faces_along_their_borders() {
    let registry = ShaderRegistry::built_in();
    let program = &registry.programs()["checker"];
    let inputs = defaults(&program.info().parameters);
    let [first, second] = [0, 1].map(|i| inputs[i].factor());
    let mut points = Random::new(3).points();
    for lane in 0..WIDTH {
        // The edge of a cube is 0.25: every other lane has the same border from the other side.
        let side = if lane % 2 == 0 { 1.0 } else { -1.0 };
        points.object_position.set(lane, Vec3::new(0.25 * (lane / 2) as f32, 0.1, 0.6));
        points.normal.set(lane, Vec3::X * side);
        points.width.0[lane] = 0.05;
        for (axis, to) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().zip(&mut points.object_from_world) {
            to.set(lane, axis);
        }
    }
    let closures = run(&**program, LaneMode::default(), &points, &inputs);
    for lane in 0..WIDTH {
        // Cubes around the middle of this face's cells are odd or even by the cube behind it.
        let behind = (lane / 2 + lane % 2) % 2 == 1;
        let expected = if behind { first } else { second };
        let color = closures.base_color.get(lane);
        assert!(color.distance(expected) < 2e-3, "lane {lane}: {color} instead of {expected}");
    }
}
