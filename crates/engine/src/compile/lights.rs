//! Lights without area made ready: only those whose table or shader changed are prepared anew.

use std::collections::BTreeMap;
use std::time::Instant;

use heliostat_scene::{ApplyReport, Light, LightId, RebuildKind, RebuildReason, Scene, Target};
use heliostat_shading::PunctualLight;

use super::{Compiled, note};

impl Compiled {
    /// The scene's lights. What was prepared stays while it holds, and lights of one make share it.
    pub(super) fn stage_lights(
        &self,
        scene: &Scene,
        report: &mut ApplyReport,
    ) -> BTreeMap<LightId, PunctualLight> {
        let mut prepared: Vec<_> =
            self.lights.values().filter(|light| light.is_prepared()).cloned().collect();
        let mut ready = |(&id, light): (&LightId, &Light)| {
            let unchanged = self.lights.get(&id).and_then(|before| before.like(&light.kind));
            let shared = || prepared.iter().find_map(|other| other.like(&light.kind));
            let made = unchanged.or_else(shared).unwrap_or_else(|| {
                let made = self.light((id, light), report);
                prepared.extend(made.is_prepared().then(|| made.clone()));
                made
            });
            (id, made)
        };
        scene.lights().iter().map(&mut ready).collect()
    }

    /// A light made ready; a placeholder, and a problem, for a shader that there is not.
    fn light(&self, (id, light): (LightId, &Light), report: &mut ApplyReport) -> PunctualLight {
        let start = Instant::now();
        let made = self.shaders.light(&light.kind).unwrap_or_else(|problem| {
            let name = &light.name;
            report.problems.push(format!("light `{name}`: {}; a placeholder takes its place", problem.0));
            PunctualLight::new(&light.kind)
        });
        if made.is_prepared() {
            let cause = (Target::Light(id), RebuildReason::Changed);
            note(report, "light sampling table".into(), cause, RebuildKind::Built, 1, start);
        }
        made
    }
}
