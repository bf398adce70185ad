//! From an edit to a scene that is ready.

use std::sync::Arc;

use heliostat::kernel::glam::{Affine3A, Vec3};
use heliostat::scene::{
    ApplyReport, Backend, Edit, InstanceId, Light, LightId, LightKind, Progress, RebuildKind, Scene,
};

use crate::measure::median;
use crate::result;

pub(super) fn run(name: &str, runs: usize) -> Result<(), String> {
    let moving = super::scene(name)?;
    let (mut engine, built) = super::engine(&moving.edits)?;
    let scene = engine.scene().clone();
    result(&format!("{name}: {} instances, loaded in {:.0} ms", scene.instances().len(), built.milliseconds));
    let mut time = |what: &str, edits: &dyn Fn(usize) -> Vec<Edit>| -> Result<(), String> {
        let mut times = Vec::with_capacity(runs);
        let mut last = ApplyReport::default();
        for run in 0..runs {
            last = engine.apply(&edits(run), &Progress::new()).map_err(|error| error.to_string())?;
            times.push(last.milliseconds);
        }
        result(&format!("{what:28} {:8.3} ms  {}", median(&mut times), rebuilt(&last)));
        Ok(())
    };
    let all: Vec<InstanceId> = scene.placed_in(None).collect();
    let middle = *all.get(all.len() / 2).ok_or("the scene has no instances")?;
    time("one instance moves", &|run| vec![moved(&scene, middle, run)])?;
    time("a thousand move", &|run| all.iter().take(1000).map(|&id| moved(&scene, id, run)).collect())?;
    time("all move", &|run| all.iter().map(|&id| moved(&scene, id, run)).collect())?;
    time("a light changes", &|run| {
        let kind = LightKind::Point { position: Vec3::Y * run as f32, intensity: Vec3::ONE, range: 9.0 };
        vec![Edit::Light(LightId(u32::MAX), Light { name: String::new(), kind })]
    })?;
    if let Some((&id, material)) = scene.materials().iter().next() {
        time("a material changes", &|run| {
            let mut material = (**material).clone();
            material.roughness = 0.2 + 0.5 * (run % 7) as f32 / 7.0;
            vec![Edit::Material(id, Arc::new(material))]
        })?;
    }
    Ok(())
}

/// A small turn, another one in each run.
fn moved(scene: &Scene, id: InstanceId, run: usize) -> Edit {
    let place = scene.instances()[&id].parent_from_object;
    Edit::MoveInstance(id, place * Affine3A::from_rotation_y(0.02 * (run + 1) as f32))
}

fn rebuilt(report: &ApplyReport) -> String {
    let one = |rebuilt: &heliostat::scene::Rebuilt| {
        let how = match rebuilt.kind {
            RebuildKind::Refitted { cost } => format!("refitted, {cost:.3} of its cost"),
            _ => "built".into(),
        };
        format!("{}: {how}, {:.3} ms, as {:?}", rebuilt.what, rebuilt.milliseconds, rebuilt.reason)
    };
    match report.rebuilt.len() {
        0 => "nothing rebuilt".into(),
        _ => report.rebuilt.iter().map(one).collect::<Vec<_>>().join("; "),
    }
}
