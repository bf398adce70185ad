//! Builders side by side: million triangles per second and bytes per triangle.
//!
//! Bytes are all that tracing needs. Ours: nodes and leaves, which hold their own copy of the vertices, or else the mesh
//! as well. Embree's: what its device holds after the commit, that is the tree with the vertex and index buffers.
//! `obvhs`: nodes, indices and the triangles in their order.

use std::hint::black_box;

use heliostat::kernel::{Mesh, TriangleBvh};
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::embree::{self, Embree};
use super::obvhs;
use super::ours::{self, NamedBuild};
use super::results::BuildRow;
use crate::measure::{Clock, interleave, median};
use crate::result;

/// Measures all builders on one mesh.
pub(super) struct Builds<'a> {
    pub(super) scene: &'a str,
    pub(super) mesh: &'a Mesh,
    pub(super) embree: Option<&'a Embree>,
    pub(super) runs: usize,
    /// Whether `obvhs` takes part.
    pub(super) obvhs: bool,
}

impl Builds<'_> {
    /// Prints and returns the rows for one number of threads.
    ///
    /// # Errors
    /// When a build fails.
    pub(super) fn measure(&self, threads: usize) -> Result<Vec<BuildRow>, String> {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| e.to_string())?;
        let mut rows = Vec::new();
        for build in ours::builds() {
            rows.push(self.versus_embree(&build, &pool)?);
        }
        if self.obvhs && obvhs::takes(self.mesh) {
            rows.extend(self.versus_obvhs(&pool)?);
        }
        rows.iter().for_each(|row| result(&line(row)));
        Ok(rows)
    }

    fn versus_embree(&self, build: &NamedBuild, pool: &ThreadPool) -> Result<BuildRow, String> {
        let mut row = self.row(build, pool)?;
        let Some(embree) = self.embree else {
            let mut times = (0..self.runs).map(|_| self.ours(build, pool)).collect::<Result<Vec<_>, _>>()?;
            row.mtris_per_s = self.rate(median(&mut times));
            return Ok(row);
        };
        let mut bytes = 0;
        let (a, b) = interleave(
            self.runs,
            || self.ours(build, pool),
            || self.embrees(embree, build.counterpart, pool, &mut bytes),
        )?;
        row.mtris_per_s = self.rate(a);
        row.peer = Some(self.rate(b));
        row.peer_name = Some(embree.name());
        row.peer_variant = Some(build.counterpart.to_string());
        row.peer_bytes_per_tri = Some(bytes as f64 / self.mesh.indices.len() as f64);
        row.ratio = Some(b / a);
        Ok(row)
    }

    /// Our default against each of its presets.
    fn versus_obvhs(&self, pool: &ThreadPool) -> Result<Vec<BuildRow>, String> {
        let triangles = obvhs::triangles(self.mesh);
        let ours = &ours::builds()[0];
        let mut rows = Vec::new();
        for (name, preset) in obvhs::presets() {
            let mut row = self.row(ours, pool)?;
            let mut bytes = 0;
            let (a, b) = interleave(
                self.runs,
                || self.ours(ours, pool),
                || {
                    let (seconds, tree) = timed(pool, || obvhs::build(&triangles, preset));
                    bytes = obvhs::bytes(&tree);
                    Ok(seconds)
                },
            )?;
            row.mtris_per_s = self.rate(a);
            row.peer = Some(self.rate(b));
            row.peer_name = Some(obvhs::NAME.into());
            row.peer_variant = Some(name.into());
            row.peer_bytes_per_tri = Some(bytes as f64 / self.mesh.indices.len() as f64);
            row.ratio = Some(b / a);
            rows.push(row);
        }
        Ok(rows)
    }

    /// A row with the tree's figures and no times yet.
    fn row(&self, build: &NamedBuild, pool: &ThreadPool) -> Result<BuildRow, String> {
        let tree = pool.install(|| build.build(self.mesh))?;
        let (stats, triangles) = (tree.stats(), self.mesh.indices.len());
        let mesh = size_of_val(&self.mesh.positions[..]) + size_of_val(&self.mesh.indices[..]);
        let bytes = stats.bytes + if build.shares_mesh { mesh } else { 0 };
        Ok(BuildRow {
            scene: self.scene.into(),
            triangles,
            builder: build.name.into(),
            threads: pool.current_num_threads(),
            mtris_per_s: f64::NAN,
            sah: f64::from(stats.sah),
            bytes_per_tri: bytes as f64 / triangles as f64,
            peer: None,
            peer_name: None,
            peer_variant: None,
            peer_bytes_per_tri: None,
            ratio: None,
        })
    }

    fn rate(&self, seconds: f64) -> f64 {
        self.mesh.indices.len() as f64 / seconds * 1e-6
    }

    fn ours(&self, build: &NamedBuild, pool: &ThreadPool) -> Result<f64, String> {
        let (seconds, tree): (f64, Result<TriangleBvh, String>) = timed(pool, || build.build(self.mesh));
        black_box(tree)?;
        Ok(seconds)
    }

    /// A device of its own for each build: memory is taken anew, as it is on our side.
    fn embrees(
        &self,
        embree: &Embree,
        build: embree::Build,
        pool: &ThreadPool,
        bytes: &mut usize,
    ) -> Result<f64, String> {
        let threads = pool.current_num_threads();
        let device = embree.device(threads)?;
        let mut tree = embree::Tree::new(&device, self.mesh, build)?;
        let clock = Clock::start(threads > 1);
        tree.build()?;
        let seconds = clock.seconds();
        *bytes = device.bytes();
        Ok(seconds)
    }
}

/// Runs something on a pool: processor time of its only thread, or wall time.
pub(super) fn timed<T: Send>(pool: &ThreadPool, work: impl FnOnce() -> T + Send) -> (f64, T) {
    let wall = pool.current_num_threads() > 1;
    pool.install(|| {
        let clock = Clock::start(wall);
        let done = work();
        (clock.seconds(), done)
    })
}

fn line(row: &BuildRow) -> String {
    let ours = format!(
        "build      {}T  {:8.2} Mtri/s {} (SAH {:.1}, {:.1} B/tri)",
        row.threads, row.mtris_per_s, row.builder, row.sah, row.bytes_per_tri
    );
    let peer = row.peer.zip(row.ratio).map(|(peer, ratio)| {
        format!(
            "   {peer:8.2} {} {} ({:.1} B/tri)   ratio {ratio:5.2}",
            row.peer_name.as_deref().unwrap_or_default(),
            row.peer_variant.as_deref().unwrap_or_default(),
            row.peer_bytes_per_tri.unwrap_or(f64::NAN),
        )
    });
    ours + &peer.unwrap_or_default()
}
