//! An animation frame by frame: what the motion asks for, what the update takes, what the picture takes.

use std::path::Path;

use heliostat::engine::Engine;
use heliostat::framing;
use heliostat::lighting;
use heliostat::scene::{Backend, Camera, Progress};

use crate::chart::Chart;
use crate::measure::median;
use crate::result;

pub(super) fn run(name: &str, frames: u32, renderer: &str, plot: Option<&Path>) -> Result<(), String> {
    let mut moving = super::scene(name)?;
    if moving.timeline.is_empty() {
        return Err(format!("nothing moves in `{name}`"));
    }
    let (mut engine, built) = super::engine(&moving.edits)?;
    if !engine.scene().has_light() {
        let light = lighting::default_light(engine.scene());
        engine.apply(&light, &Progress::new()).map_err(|error| error.to_string())?;
    }
    let duration = moving.timeline.duration();
    result(&format!("{name}: built in {:.0} ms, plays {duration:.2} s", built.milliseconds));
    let mut series = [("motion to edits", vec![]), ("update", vec![]), ("picture", vec![])];
    let mut rebuilt = 0;
    // A camera found by looking at the scene must not jump from frame to frame.
    let still = engine.scene().cameras().is_empty().then(|| camera(&engine)).transpose()?;
    for number in 0..frames {
        let time = duration * f64::from(number) / f64::from(frames.max(2) - 1);
        let (evaluate, edits) = super::milliseconds(|| Ok(moving.timeline.edits_at(time)))?;
        let report = engine.apply(&edits, &Progress::new()).map_err(|error| error.to_string())?;
        rebuilt += report.rebuilt.len();
        let camera = match &still {
            Some(camera) => camera.clone(),
            None => camera(&engine)?,
        };
        let mut request = super::request(camera, renderer);
        request.frame = number;
        let frame = engine.render(&request, &Progress::new()).map_err(|error| error.to_string())?;
        let values = [evaluate, report.milliseconds, frame.stats.milliseconds];
        for ((_, line), value) in series.iter_mut().zip(values) {
            line.push((f64::from(number), value));
        }
    }
    for (what, line) in &series {
        let mut values: Vec<f64> = line.iter().map(|point| point.1).collect();
        let worst = values.iter().copied().fold(0.0, f64::max);
        result(&format!("{what:16} median {:8.3} ms, worst {worst:8.3} ms", median(&mut values)));
    }
    result(&format!("{:.1} structures brought up to date per frame", rebuilt as f64 / f64::from(frames)));
    if let Some(path) = plot {
        let chart = Chart {
            title: &format!("{} at 640×480, one sample per pixel, {renderer}", stem(name)),
            x: "frame",
            logarithmic: false,
            y: "ms",
            lines: series.into_iter().map(|(name, points)| (name.to_owned(), points)).collect(),
        };
        super::write(path, &chart.svg())?;
    }
    Ok(())
}

/// The scene's first camera as it stands now, else one that shows everything.
pub(crate) fn camera(engine: &Engine) -> Result<Camera, String> {
    if let Some(camera) = engine.scene().cameras().values().next() {
        return Ok(camera.clone());
    }
    let bounds = engine.scene().bounds().ok_or("there is nothing to see")?;
    Ok(framing::frame_scene(engine.rays(), &bounds, 4.0 / 3.0, None))
}

fn stem(name: &str) -> &str {
    Path::new(name).file_stem().and_then(|stem| stem.to_str()).unwrap_or(name)
}
