//! What more instances cost.

use std::path::Path;

use heliostat::scene::{Backend, Edit, MaterialOverride, Progress};

use crate::chart::Chart;
use crate::measure::median;
use crate::result;

/// Numbers of plants.
const COUNTS: [usize; 10] = [1, 3, 10, 30, 100, 300, 1_000, 3_000, 10_000, 28_000];

pub(super) fn run(plot: Option<&Path>, runs: usize) -> Result<(), String> {
    let all = super::scene("sunflowers")?.edits;
    let mut lines = [("primary rays", Vec::new()), ("with the sun's shadows", Vec::new())];
    result("plants     build ms   primary ms   direct ms   Mray/s");
    for count in COUNTS {
        let (mut engine, built) = super::engine(&first_plants(&all, count))?;
        let camera = engine.scene().cameras().values().next().cloned().ok_or("no camera")?;
        let mut frame = |depth: u32| -> Result<(f64, f64), String> {
            let mut request = super::request(camera.clone(), "direct");
            request.max_depth = Some(depth);
            request.materials = MaterialOverride::None;
            let (mut times, mut rates) = (Vec::new(), Vec::new());
            for _ in 0..runs {
                let frame = engine.render(&request, &Progress::new()).map_err(|error| error.to_string())?;
                times.push(frame.stats.milliseconds);
                rates.push(frame.stats.rays as f64 * 1e-3 / frame.stats.milliseconds);
            }
            Ok((median(&mut times), median(&mut rates)))
        };
        let (primary, _) = frame(1)?;
        let (direct, rate) = frame(2)?;
        result(&format!(
            "{count:6}   {:10.1}   {primary:10.1}  {direct:10.1}   {rate:6.2}",
            built.milliseconds
        ));
        lines[0].1.push((count as f64, primary));
        lines[1].1.push((count as f64, direct));
    }
    if let Some(path) = plot {
        let chart = Chart {
            title: "A field of sunflowers, 640×480, one sample per pixel",
            x: "plants",
            logarithmic: true,
            y: "ms per frame",
            lines: lines.into_iter().map(|(name, points)| (name.to_owned(), points)).collect(),
        };
        super::write(path, &chart.svg())?;
    }
    Ok(())
}

/// The scene with `count` of its plants, spread over the field; ground and trees stay.
fn first_plants(edits: &[Edit], count: usize) -> Vec<Edit> {
    let kind = |edit: &Edit| match edit {
        Edit::Object(id, object) if object.name.starts_with("sunflower") => Some(*id),
        _ => None,
    };
    let kinds: Vec<_> = edits.iter().filter_map(kind).collect();
    let is_plant =
        |edit: &Edit| matches!(edit, Edit::Instance(_, instance) if kinds.contains(&instance.object));
    let plants = edits.iter().filter(|edit| is_plant(edit)).count();
    let mut number = 0;
    let keep = |edit: &&Edit| {
        if !is_plant(edit) {
            return true;
        }
        number += 1;
        // Evenly spread, and the middle one when there is but one.
        (2 * number - 1) * count / (2 * plants) != (2 * number + 1) * count / (2 * plants) || count >= plants
    };
    edits.iter().filter(keep).cloned().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_plants_stay_as_asked_for() {
        let all = super::super::scene("sunflowers").unwrap().edits;
        let instances = |edits: &[Edit]| edits.iter().filter(|e| matches!(e, Edit::Instance(..))).count();
        let others = instances(&all) - 28_000;
        for count in COUNTS {
            assert_eq!(instances(&first_plants(&all, count)) - others, count);
        }
    }
}
