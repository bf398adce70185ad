//! One scene after the other: rays per second of all engines, interleaved.

use heliostat::kernel::{Isa, RayQuery};
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::builds::Builds;
use super::embree::{self, Embree, EmbreeRays, Packets, Tree, Variant};
use super::kdtree::{self, KdTrees};
use super::obvhs::{self, ObvhsRays};
use super::ours::{self, OurRays, Ours};
use super::rays::{Kind, Query, RaySet, Source};
use super::results::{Results, Row};
use super::scenes::{Flat, Spec, prepare};
use crate::measure::{Answers, ITEM, Tracer, interleave, sample, time};
use crate::{report, result};

/// Hits closer together than this share of their distance are the same.
const TOLERANCE: f32 = 1e-3;
/// Variants of a peer that are timed on all rays after a first choice on some.
const FINALISTS: usize = 4;

/// What is compared and how.
pub(super) struct Versus<'a> {
    pub(super) embree: Option<&'a Embree>,
    pub(super) isa: Isa,
    pub(super) size: u32,
    pub(super) runs: usize,
    /// Runs of each builder; 0 measures none.
    pub(super) build_runs: usize,
    pub(super) most: usize,
    pub(super) threads: Vec<usize>,
    pub(super) kinds: Vec<Kind>,
    /// Whether `obvhs` takes part.
    pub(super) obvhs: bool,
}

/// The trees of one scene.
struct Trees {
    name: String,
    triangles: usize,
    ours: Vec<Ours>,
    embree: Vec<Tree>,
    obvhs: Vec<obvhs::Tree>,
}

impl Versus<'_> {
    /// Measures one scene, prints it and returns the rows.
    ///
    /// # Errors
    /// When it cannot be read or built.
    pub(super) fn scene(&self, spec: &Spec) -> Result<Results, String> {
        let flat = prepare(spec)?;
        result(&format!("\n{}: {} triangles", flat.name, flat.mesh.indices.len()));
        let mut results = Results::default();
        if self.build_runs > 0 {
            let (scene, mesh) = (&flat.name, &flat.mesh);
            let builds =
                Builds { scene, mesh, embree: self.embree, runs: self.build_runs, obvhs: self.obvhs };
            for &threads in &self.threads {
                results.builds.extend(builds.measure(threads)?);
            }
        }
        if self.kinds.is_empty() {
            return Ok(results);
        }
        let trees = self.trees(&flat)?;
        let world = &trees.ours[0].world;
        let source = Source::new(world, flat.view(world), flat.light, self.size, self.most);
        report(&format!("{}: {:.0} % of the pixels see something", flat.name, 100.0 * source.coverage()));
        let kd_trees = kdtree::SCENES
            .contains(&&*flat.name)
            .then(|| KdTrees::new(&flat.name, &flat.mesh, self.isa, self.runs))
            .transpose()?;
        for &kind in &self.kinds {
            let set = source.rays(kind);
            results.rows.extend(self.kind(&trees, &set)?);
            if let Some(kd_trees) = kd_trees.as_ref().filter(|_| kdtree::KINDS.contains(&kind)) {
                results.kd_trees.extend(kd_trees.measure(&set)?);
            }
        }
        Ok(results)
    }

    fn trees(&self, flat: &Flat) -> Result<Trees, String> {
        let ours = ours::builds();
        let ours =
            ours.iter().filter(|build| build.traced).map(|build| Ours::new(&flat.mesh, build, self.isa));
        let mut trees = Trees {
            name: flat.name.clone(),
            triangles: flat.mesh.indices.len(),
            ours: ours.collect::<Result<_, _>>()?,
            embree: Vec::new(),
            obvhs: Vec::new(),
        };
        if let Some(embree) = self.embree {
            let device = embree.device(super::all_threads())?;
            for build in embree::Build::TRACED {
                let mut tree = Tree::new(&device, &flat.mesh, build)?;
                tree.build()?;
                trees.embree.push(tree);
            }
        }
        if self.obvhs && self.kinds.iter().any(|kind| obvhs::KINDS.contains(kind)) {
            if obvhs::takes(&flat.mesh) {
                let triangles = obvhs::triangles(&flat.mesh);
                trees.obvhs =
                    obvhs::presets()[1..].iter().map(|&p| obvhs::Tree::new(&triangles, p)).collect();
            } else {
                report(&format!("note: {}: too large or not finite for {}", flat.name, obvhs::NAME));
            }
        }
        Ok(trees)
    }

    fn kind(&self, trees: &Trees, set: &RaySet) -> Result<Vec<Row>, String> {
        if set.count == 0 {
            report(&format!("note: {}: there are no {} rays", trees.name, set.kind.name()));
            return Ok(Vec::new());
        }
        let mut answers = Answers::new(set.items.len(), set.kind.query() == Query::Closest);
        let ours =
            fastest(&trees.ours, |ours| time(&our_rays(ours, set), &mut answers, None)).ok_or("no build")?;
        let best = self.best_variant(&trees.embree, set, &mut answers);
        let mut rows = Vec::new();
        for &threads in &self.threads {
            let mut row = self.row(trees, ours, set, threads);
            let embree = best.as_ref().zip(self.embree);
            let Some(((tree, variant), embree)) = embree else {
                self.compare(&mut row, ours, None, set)?;
                rows.push(row);
                continue;
            };
            let packets = Packets::new(set, variant.way.reversed);
            let peer = EmbreeRays { tree, packets: &packets, way: variant.way };
            row.peer_name = Some(embree.name());
            row.peer_variant = Some(variant.to_string());
            self.compare(&mut row, ours, Some(&peer), set)?;
            rows.push(row);
        }
        if obvhs::KINDS.contains(&set.kind) && !trees.obvhs.is_empty() {
            rows.push(self.versus_obvhs(trees, ours, set, &mut answers)?);
        }
        rows.iter().for_each(|row| result(&line(row)));
        Ok(rows)
    }

    /// On one thread: it has no packets to feed them.
    fn versus_obvhs(
        &self,
        trees: &Trees,
        ours: &Ours,
        set: &RaySet,
        answers: &mut Answers,
    ) -> Result<Row, String> {
        let rays = &obvhs::Rays::new(set);
        let tree =
            fastest(&trees.obvhs, |tree| sample(&ObvhsRays { tree, rays }, answers)).ok_or("no tree")?;
        let mut row = self.row(trees, ours, set, 1);
        row.peer_name = Some(obvhs::NAME.into());
        row.peer_variant = Some(format!("CWBVH, single rays, {}", tree.preset));
        self.compare(&mut row, ours, Some(&ObvhsRays { tree, rays }), set)?;
        Ok(row)
    }

    /// A row without figures.
    fn row(&self, trees: &Trees, ours: &Ours, set: &RaySet, threads: usize) -> Row {
        Row {
            scene: trees.name.clone(),
            triangles: trees.triangles,
            rays: set.kind.name().into(),
            count: set.count,
            threads,
            isa: self.isa.to_string(),
            ours: f64::NAN,
            our_variant: ours.build.into(),
            peer: None,
            peer_name: None,
            peer_variant: None,
            ratio: None,
            disagree: None,
        }
    }

    /// Fills in rates and disagreements.
    fn compare(
        &self,
        row: &mut Row,
        ours: &Ours,
        peer: Option<&dyn Tracer>,
        set: &RaySet,
    ) -> Result<(), String> {
        let pool = pool(row.threads)?;
        let pool = pool.as_ref();
        let closest = set.kind.query() == Query::Closest;
        let [mut a, mut b] = [(); 2].map(|()| Answers::new(set.items.len(), closest));
        let ours = our_rays(ours, set);
        let (x, y) = interleave(
            self.runs,
            || Ok(time(&ours, &mut a, pool)),
            || Ok(peer.map_or(f64::NAN, |peer| time(peer, &mut b, pool))),
        )?;
        let mega = |seconds: f64| set.count as f64 / seconds * 1e-6;
        row.ours = mega(x);
        if peer.is_some() {
            (row.peer, row.ratio) = (Some(mega(y)), Some(y / x));
            row.disagree = Some(disagreements(set, &a, &b));
        }
        Ok(())
    }

    /// Embree's fastest way on these rays and the tree for it: all on some of the rays, then the best few on all.
    fn best_variant<'t>(
        &self,
        trees: &'t [Tree],
        set: &RaySet,
        answers: &mut Answers,
    ) -> Option<(&'t Tree, Variant)> {
        let directed = embree::directed(set);
        let forward = Packets::new(set, false);
        let backward = directed.then(|| Packets::new(set, true));
        let rays = |tree: &'t Tree, variant: &Variant| {
            let packets = if variant.way.reversed { backward.as_ref() } else { None };
            EmbreeRays { tree, packets: packets.unwrap_or(&forward), way: variant.way }
        };
        let ways = self.embree?.ways(directed);
        let mut timed = Vec::new();
        for tree in trees {
            for &way in &ways {
                let variant = Variant { build: tree.build, way, query: set.kind.query(), directed };
                timed.push((sample(&rays(tree, &variant), answers), tree, variant));
            }
        }
        timed.sort_by(|a, b| a.0.total_cmp(&b.0));
        timed.truncate(FINALISTS);
        for (seconds, tree, variant) in &mut timed {
            let mut once = || time(&rays(tree, variant), answers, None);
            *seconds = once().min(once());
        }
        timed.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, tree, variant)| (tree, variant))
    }
}

fn our_rays<'a>(ours: &'a Ours, set: &'a RaySet) -> OurRays<'a> {
    let world: &dyn RayQuery = &ours.world;
    OurRays { world, set }
}

/// The candidate that takes the least time, the better of two runs each; a single one is not timed.
fn fastest<T>(candidates: &[T], mut seconds: impl FnMut(&T) -> f64) -> Option<&T> {
    if candidates.len() < 2 {
        return candidates.first();
    }
    let timed = candidates.iter().map(|candidate| (seconds(candidate).min(seconds(candidate)), candidate));
    timed.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, candidate)| candidate)
}

/// A pool for more than one thread.
fn pool(threads: usize) -> Result<Option<ThreadPool>, String> {
    let pool = || ThreadPoolBuilder::new().num_threads(threads).build().map_err(|error| error.to_string());
    (threads > 1).then(pool).transpose()
}

/// Rays on which two engines differ: hit or miss, or the place of the hit.
pub(super) fn disagreements(set: &RaySet, a: &Answers, b: &Answers) -> usize {
    let same = |x: f32, y: f32| x == y || (x - y).abs() <= TOLERANCE * x.abs().max(y.abs());
    let differ = |slot: usize| match set.kind.query() {
        Query::Closest => !same(a.t[slot], b.t[slot]),
        Query::Any => a.occluded[slot] != b.occluded[slot],
    };
    let slots = set.items.iter().enumerate().flat_map(|(i, item)| i * ITEM..i * ITEM + item.len());
    slots.filter(|&slot| differ(slot)).count()
}

fn line(row: &Row) -> String {
    let ours = format!("{:10} {}T  {:8.2} Mray/s {}", row.rays, row.threads, row.ours, row.our_variant);
    let peer = row.peer.zip(row.ratio).map(|(peer, ratio)| {
        format!(
            "   {peer:8.2} {} ({})   ratio {ratio:5.2}   {} of {} disagree",
            row.peer_name.as_deref().unwrap_or_default(),
            row.peer_variant.as_deref().unwrap_or_default(),
            row.disagree.unwrap_or(0),
            row.count,
        )
    });
    ours + &peer.unwrap_or_default()
}
