//! Deforming meshes: how fast a tree is refitted, and what it is worth after a hundred frames of twisting.

use std::f32::consts::TAU;
use std::sync::Arc;

use heliostat::kernel::glam::{Quat, Vec3};
use heliostat::kernel::{Aabb, BuildOptions, Isa, Mesh, RayQuery, RefitPolicy, TriangleBvh};
use rayon::ThreadPoolBuilder;

use super::builds::timed;
use super::ours::{self, OurRays};
use super::rays::{Kind, Source};
use super::scenes::{Spec, prepare};
use crate::measure::{Answers, interleave, median, time};
use crate::result;

const FRAMES: usize = 100;

/// What is measured and how.
pub(super) struct Twist {
    pub(super) isa: Isa,
    pub(super) size: u32,
    pub(super) runs: usize,
    pub(super) most: usize,
    pub(super) threads: usize,
    /// Turns between the lower and the upper end after all frames.
    pub(super) turns: f32,
}

impl Twist {
    /// Measures one scene and prints what comes out.
    ///
    /// # Errors
    /// When the scene cannot be read or built.
    pub(super) fn scene(&self, spec: &Spec) -> Result<(), String> {
        let flat = prepare(spec)?;
        let triangles = flat.mesh.indices.len();
        result(&format!("\n{}: {triangles} triangles, {} threads", flat.name, self.threads));
        let pool = ThreadPoolBuilder::new().num_threads(self.threads).build().map_err(|e| e.to_string())?;
        let build = |mesh: &Mesh| {
            let meshes = std::slice::from_ref(mesh);
            pool.install(|| TriangleBvh::build(meshes, &BuildOptions::default())).map_err(|e| e.to_string())
        };
        let (mut plain, mut followed) = (build(&flat.mesh)?, build(&flat.mesh)?);
        let (mut refits, mut repairs) = (Vec::new(), Vec::new());
        let mut mesh = flat.mesh.clone();
        for frame in 1..=FRAMES {
            mesh = twisted(&flat.mesh, self.turns * frame as f32 / FRAMES as f32);
            let meshes = std::slice::from_ref(&mesh);
            let (seconds, done) = timed(&pool, || plain.refit(meshes));
            done.map_err(|e| e.to_string())?;
            refits.push(seconds);
            let (seconds, done) = timed(&pool, || followed.follow(meshes, &RefitPolicy::default()));
            if done.map_err(|e| e.to_string())?.repaired {
                repairs.push(seconds);
            }
        }
        let rate = |seconds: f64| triangles as f64 / seconds * 1e-6;
        let count = repairs.len();
        refits.sort_by(f64::total_cmp);
        result(&format!(
            "refit      best {:7.2} Mtri/s, median {:7.2}; {count} frames of {FRAMES} with a repair, {:7.2} Mtri/s each",
            rate(refits[0]),
            rate(median(&mut refits)),
            rate(median(&mut repairs)),
        ));
        let fresh = build(&mesh)?;
        result(&format!(
            "SAH        built {:.2}; after {FRAMES} frames refitted {:.2}, followed {:.2}, fresh {:.2}",
            plain.stats().sah_at_build,
            plain.stats().sah,
            followed.stats().sah,
            fresh.stats().sah
        ));
        let [fresh, plain, followed] =
            [fresh, plain, followed].map(|tree| ours::world(Arc::new(tree).into(), self.isa));
        let (fresh, plain, followed) = (fresh?, plain?, followed?);
        let source = Source::new(&fresh, flat.view(&fresh), flat.light, self.size, self.most);
        for kind in [Kind::Primary, Kind::Diffuse] {
            let set = source.rays(kind);
            let [mut a, mut b] = [(); 2].map(|()| Answers::new(set.items.len(), true));
            for (name, world) in [("refitted", &plain), ("followed", &followed)] {
                let [x, y] =
                    [&fresh, world].map(|world| OurRays { world: world as &dyn RayQuery, set: &set });
                let (x, y) =
                    interleave(self.runs, || Ok(time(&x, &mut a, None)), || Ok(time(&y, &mut b, None)))?;
                let mega = |seconds: f64| set.count as f64 / seconds * 1e-6;
                result(&format!(
                    "{:10} fresh {:7.2} Mray/s, {name} {:7.2}: {:5.2} times the time",
                    kind.name(),
                    mega(x),
                    mega(y),
                    y / x
                ));
            }
        }
        Ok(())
    }
}

/// Turned about the vertical through the middle, by the height.
fn twisted(mesh: &Mesh, turns: f32) -> Mesh {
    let bounds = Aabb::from_points(mesh.positions.iter().copied().filter(|p| p.is_finite()));
    let (center, height) = (bounds.center(), bounds.size().y.max(f32::MIN_POSITIVE));
    let turn = |&p: &Vec3| {
        let angle = TAU * turns * (p.y - bounds.min.y) / height;
        center + Quat::from_rotation_y(angle) * (p - center)
    };
    Mesh { positions: mesh.positions.iter().map(turn).collect(), ..mesh.clone() }
}
