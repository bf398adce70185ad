//! What can be changed of the selected thing, or, without one, of the view: a list that is gone through by keys.

use crate::change::{Change, Lamp, Look, Surroundings};
use crate::input::Input;
use crate::state::{SceneState, Selected};

/// A line of the list.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Row {
    pub(super) name: &'static str,
    /// For people.
    pub(super) value: String,
    /// What makes it less, and more.
    pub(super) steps: [Input; 2],
}

/// What a step does to a light, a material or a share: multiplies or adds.
const FACTOR: f32 = 1.15;
const SHARE: f32 = 0.05;

/// The list; a step counts `size` times, and all changes of one gesture are undone together.
pub(super) fn rows(scene: &SceneState, size: f32, gesture: u64) -> Vec<Row> {
    match &scene.selection {
        Some(Selected::Light { light }) => {
            let found = scene.lights.iter().find(|state| state.id == *light);
            found.map_or(Vec::new(), |state| {
                let to =
                    |lamp: Lamp| Change::Light { light: state.id, name: state.name.clone(), to: Some(lamp) };
                light_rows(&state.lamp, size, &|lamp| Input::Change { change: to(lamp), gesture })
            })
        }
        Some(Selected::Instance { instance, visible, material, look, .. }) => {
            let show = |visible| Change::Show { instance: *instance, visible };
            let steps = [false, true].map(|on| Input::Change { change: show(on), gesture });
            let mut rows =
                vec![Row { name: "visible", value: if *visible { "yes" } else { "no" }.into(), steps }];
            if let (Some(material), Some(look)) = (*material, look) {
                let to = |look| Input::Change { change: Change::Material { material, look }, gesture };
                rows.extend(look_rows(look, size, &to));
            }
            rows
        }
        None => view_rows(scene, size, gesture),
    }
}

/// Both directions of a step.
fn both(size: f32, step: impl Fn(f32) -> Input) -> [Input; 2] {
    [step(-size), step(size)]
}

fn light_rows(lamp: &Lamp, size: f32, to: &dyn Fn(Lamp) -> Input) -> Vec<Row> {
    let color = lamp.color();
    let mut rows = vec![Row {
        name: "power",
        value: format!("{:.3}", color.iter().copied().fold(0.0, f32::max)),
        steps: both(size, |by| to(lamp.clone().times((1.5 * by * FACTOR.log2()).exp2()))),
    }];
    rows.extend(["red", "green", "blue"].into_iter().enumerate().map(|(i, name)| Row {
        name,
        value: format!("{:.3}", color[i]),
        steps: both(size, |by| {
            let mut color = color;
            // From nothing no factor leads anywhere.
            let least = 0.01 * color.iter().copied().fold(1e-3, f32::max);
            color[i] = (color[i].max(least) * (by * FACTOR.log2()).exp2()).max(least);
            to(lamp.clone().colored(color))
        }),
    }));
    if let Some(place) = lamp.position() {
        rows.extend(["x", "y", "z"].into_iter().enumerate().map(|(i, name)| Row {
            name,
            value: format!("{:.2} m", place[i]),
            steps: both(size, |by| {
                let mut place = place;
                place[i] += 0.1 * by;
                to(lamp.clone().at(place))
            }),
        }));
    }
    if let Lamp::Directional { direction, irradiance } = *lamp {
        let (height, turn) = sun(direction);
        let sun =
            |height: f32, turn: f32| to(Lamp::Directional { direction: sunlight(height, turn), irradiance });
        rows.push(Row {
            name: "height",
            value: format!("{height:.0} deg"),
            steps: both(size, |by| sun((height + 2.0 * by).clamp(-90.0, 90.0), turn)),
        });
        rows.push(Row {
            name: "direction",
            value: format!("{turn:.0} deg"),
            steps: both(size, |by| sun(height, turn + 5.0 * by)),
        });
    }
    rows
}

/// Degrees above the horizon and from −Z towards +X at which the light comes in.
fn sun(direction: [f32; 3]) -> (f32, f32) {
    let [x, y, z] = direction;
    let length = glam::Vec3::from(direction).length().max(1e-9);
    ((-y / length).clamp(-1.0, 1.0).asin().to_degrees(), (-x).atan2(z).to_degrees())
}

/// The other way round.
fn sunlight(height: f32, turn: f32) -> [f32; 3] {
    let ((up, along), (right, back)) = (height.to_radians().sin_cos(), turn.to_radians().sin_cos());
    [-along * right, -up, along * back]
}

fn look_rows(look: &Look, size: f32, to: &dyn Fn(Look) -> Input) -> Vec<Row> {
    let share = |name, value: f32, set: &dyn Fn(&mut Look, f32)| Row {
        name,
        value: format!("{value:.2}"),
        steps: both(size, |by| {
            let mut look = look.clone();
            set(&mut look, (value + SHARE * by).clamp(0.0, 1.0));
            to(look)
        }),
    };
    let glow = look.emissive.iter().copied().fold(0.0, f32::max);
    let glows = |by: f32| {
        let mut look = look.clone();
        // From the dark it begins white and dim, and ends there.
        let next = if glow > 0.0 { glow * (1.5 * by * FACTOR.log2()).exp2() } else { by.max(0.0) * 0.1 };
        look.emissive = match glow {
            _ if next < 0.02 => [0.0; 3],
            0.0 => [next; 3],
            _ => look.emissive.map(|value| value * next / glow),
        };
        to(look)
    };
    let color = look.base_color;
    vec![
        share("red", color[0], &|look, value| look.base_color[0] = value),
        share("green", color[1], &|look, value| look.base_color[1] = value),
        share("blue", color[2], &|look, value| look.base_color[2] = value),
        share("metallic", look.metallic, &|look, value| look.metallic = value),
        share("roughness", look.roughness, &|look, value| look.roughness = value),
        share("glass", look.transmission, &|look, value| look.transmission = value),
        Row { name: "glow", value: format!("{glow:.2}"), steps: both(size, glows) },
    ]
}

fn view_rows(scene: &SceneState, size: f32, gesture: u64) -> Vec<Row> {
    let goal = scene.goal;
    let mut rows = vec![
        Row {
            name: "field of view",
            value: format!("{:.0} deg", scene.field),
            steps: both(size, |by| Input::Field { degrees: (scene.field + 2.0 * by).clamp(5.0, 150.0) }),
        },
        Row {
            name: "frames per second",
            value: goal.map_or("full size".into(), |goal| format!("{goal:.0}")),
            steps: both(size, |by| {
                // Less than nothing asked for is the highest rate, more than that nothing.
                let rate = goal.unwrap_or(65.0) + 5.0 * by;
                Input::Goal { frames_per_second: (rate <= 60.0).then_some(rate.max(5.0)) }
            }),
        },
    ];
    if !scene.clips.is_empty() {
        rows.push(Row {
            name: "speed of time",
            value: format!("{:.2}", scene.rate),
            steps: both(size, |by| Input::Rate { rate: scene.rate + 0.25 * f64::from(by) }),
        });
    }
    let to = |to: Surroundings| Input::Change { change: Change::Environment { to }, gesture };
    let around = &scene.surroundings;
    let kinds = kinds(scene.has_surroundings);
    let at = kinds.iter().position(|(name, _)| *name == kind(around)).unwrap_or(0);
    let next = |by: usize| to(kinds[(at + by) % kinds.len()].1.clone());
    rows.push(Row {
        name: "surroundings",
        value: kind(around).into(),
        steps: [next(kinds.len() - 1), next(1)],
    });
    if let Some(light) = around.light() {
        rows.push(Row {
            name: "brightness",
            value: format!("{:.2}", light.iter().copied().fold(0.0, f32::max)),
            steps: both(size, |by| to(around.clone().times((1.5 * by * FACTOR.log2()).exp2()))),
        });
    }
    match *around {
        Surroundings::Own { scale, turn } => rows.push(Row {
            name: "turn",
            value: format!("{:.0} deg", turn.to_degrees()),
            steps: both(size, |by| to(Surroundings::Own { scale, turn: turn + 5.0_f32.to_radians() * by })),
        }),
        Surroundings::Sky { turbidity, elevation, azimuth, scale } => {
            let sky = |elevation: f32, azimuth: f32, turbidity: f32| {
                to(Surroundings::Sky { turbidity, elevation, azimuth, scale })
            };
            let (up, side) = (2.0_f32.to_radians(), 5.0_f32.to_radians());
            rows.push(Row {
                name: "sun's height",
                value: format!("{:.0} deg", elevation.to_degrees()),
                steps: both(size, |by| {
                    sky((elevation + up * by).clamp(0.0, std::f32::consts::FRAC_PI_2), azimuth, turbidity)
                }),
            });
            rows.push(Row {
                name: "sun's direction",
                value: format!("{:.0} deg", azimuth.to_degrees()),
                steps: both(size, |by| sky(elevation, azimuth + side * by, turbidity)),
            });
            rows.push(Row {
                name: "haze",
                value: format!("{turbidity:.1}"),
                steps: both(size, |by| sky(elevation, azimuth, (turbidity + 0.25 * by).clamp(1.7, 10.0))),
            });
        }
        Surroundings::Dark | Surroundings::Constant { .. } => {}
    }
    rows
}

fn kind(around: &Surroundings) -> &'static str {
    match around {
        Surroundings::Dark => "dark",
        Surroundings::Constant { .. } => "one colour",
        Surroundings::Sky { .. } => "sky with sun",
        Surroundings::Own { .. } => "the scene's own",
    }
}

/// What can surround a scene, in the order in which keys go through it.
fn kinds(own: bool) -> Vec<(&'static str, Surroundings)> {
    let sky = Surroundings::Sky { turbidity: 3.0, elevation: 0.7, azimuth: 0.0, scale: [1.0; 3] };
    let mut kinds = vec![Surroundings::Dark, Surroundings::Constant { radiance: [1.0; 3] }, sky];
    if own {
        kinds.insert(0, Surroundings::default());
    }
    kinds.into_iter().map(|around| (kind(&around), around)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suns_come_from_where_they_are_said_to() {
        for (height, turn) in [(0.0, 0.0), (40.0, 90.0), (80.0, -120.0)] {
            let (h, t) = sun(sunlight(height, turn));
            assert!((h - height).abs() < 1e-3 && (t - turn).abs() < 1e-3, "{h} {t}");
        }
        // From −Z: the light goes towards +Z.
        assert!(sunlight(0.0, 0.0)[2] > 0.99 && sunlight(90.0, 0.0)[1] < -0.99);
    }

    #[test]
    fn steps_of_lights_and_materials_stay_in_range() {
        let lamp = Lamp::Point { position: [0.0; 3], intensity: [0.0, 2.0, 1.0], range: None };
        let to = |lamp: Lamp| Input::View { text: format!("{lamp:?}") };
        let rows = light_rows(&lamp, 1.0, &to);
        let names: Vec<_> = rows.iter().map(|row| row.name).collect();
        assert_eq!(names, ["power", "red", "green", "blue", "x", "y", "z"]);
        let Input::View { text } = &rows[1].steps[1] else { panic!("as `to` made it") };
        assert!(!text.contains("intensity: [0.0,"), "red grows from nothing: {text}");
        let material = heliostat_scene::Material::diffuse("", glam::Vec3::ONE);
        let look = std::cell::RefCell::new(Look::of(&material));
        for _ in 0..60 {
            let now = look.borrow().clone();
            let to = |next: Look| {
                *look.borrow_mut() = next;
                Input::Home
            };
            // Both directions are made, the second last.
            _ = look_rows(&now, 4.0, &to);
        }
        let look = look.into_inner();
        assert!(look.base_color[0] <= 1.0 && look.emissive[0] > 0.0, "{look:?}");
    }
}
