//! One scene after the other: rays per second of both engines, interleaved.

use heliostat::kernel::Isa;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::embree::{self, Embree, EmbreeRays, Packets, Tree, Variant};
use super::measure::{Answers, ITEM, interleave, pass, sample, time};
use super::ours::{self, OurRays, Ours};
use super::rays::{Kind, Query, RaySet, Source};
use super::scenes::{Flat, Spec, prepare};
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
    pub(super) most: usize,
    pub(super) threads: Vec<usize>,
    pub(super) kinds: Vec<Kind>,
}

impl Versus<'_> {
    /// Measures one scene and prints it.
    ///
    /// # Errors
    /// When it cannot be read or built.
    pub(super) fn scene(&self, spec: &Spec) -> Result<(), String> {
        let flat = prepare(spec)?;
        result(&format!("\n{}: {} triangles", flat.name, flat.mesh.indices.len()));
        let ours = ours::builds()
            .iter()
            .filter(|build| build.traced)
            .map(|build| Ours::new(&flat.mesh, build, self.isa))
            .collect::<Result<Vec<_>, _>>()?;
        let trees = self.trees(&flat)?;
        let source = Source::new(&ours[0].world, flat.view(&ours[0].world), flat.light, self.size, self.most);
        report(&format!("{}: {:.0} % of the pixels see something", flat.name, 100.0 * source.coverage()));
        for &kind in &self.kinds {
            self.kind(&ours, &trees, &source.rays(kind))?;
        }
        Ok(())
    }

    /// All of Embree's trees that are traced.
    fn trees(&self, flat: &Flat) -> Result<Vec<Tree>, String> {
        let Some(embree) = self.embree else { return Ok(Vec::new()) };
        let device = embree.device(super::all_threads())?;
        let build = |&build| {
            let mut tree = Tree::new(&device, &flat.mesh, build)?;
            tree.build().map(|()| tree)
        };
        embree::Build::TRACED.iter().map(build).collect()
    }

    fn kind(&self, ours: &[Ours], trees: &[Tree], set: &RaySet) -> Result<(), String> {
        if set.count == 0 {
            return Ok(());
        }
        let closest = set.kind.query() == Query::Closest;
        let mut a = Answers::new(set.items.len(), closest);
        let mut b = Answers::new(set.items.len(), closest);
        let timed = |ours: &Ours| {
            time(&OurRays { world: &ours.world, set }, &mut Answers::new(set.items.len(), closest), None)
        };
        let ours = ours.iter().min_by(|x, y| timed(x).total_cmp(&timed(y))).ok_or("no build")?;
        let our_rays = OurRays { world: &ours.world, set };
        let best = self.best_variant(trees, set, &mut b);
        let packets = best.map(|variant| Packets::new(set, variant.way.reversed));
        let peer = best.zip(packets.as_ref()).and_then(|(variant, packets)| {
            let tree = trees.iter().find(|tree| tree.build == variant.build)?;
            Some(EmbreeRays { tree, packets, way: variant.way })
        });
        let mut disagree = 0;
        for &threads in &self.threads {
            let pool = pool(threads)?;
            let pool = pool.as_ref();
            let mega = |seconds: f64| set.count as f64 / seconds * 1e-6;
            let name = set.kind.name();
            let Some(peer) = &peer else {
                let (seconds, _) = interleave(self.runs, || time(&our_rays, &mut a, pool), || 0.0);
                result(&format!("{name:10} {threads}T  {:8.2} Mray/s", mega(seconds)));
                continue;
            };
            let (x, y) = interleave(self.runs, || time(&our_rays, &mut a, pool), || time(peer, &mut b, pool));
            pass(peer, &mut b, pool);
            disagree = disagreements(set, &a, &b);
            let variant = best.map(|v| v.to_string()).unwrap_or_default();
            result(&format!(
                "{name:10} {threads}T  {:8.2} ours   {:8.2} Embree   ratio {:5.2}   {disagree} of {} disagree   ({variant})",
                mega(x),
                mega(y),
                y / x,
                set.count
            ));
        }
        let _ = disagree;
        Ok(())
    }

    /// Embree's fastest way on these rays: all on some of them, then the best few on all of them.
    fn best_variant(&self, trees: &[Tree], set: &RaySet, answers: &mut Answers) -> Option<Variant> {
        let directed = embree::directed(set);
        let both = [
            Packets::new(set, false),
            if directed { Packets::new(set, true) } else { Packets::new(set, false) },
        ];
        let rays = |v: &Variant| {
            let tree = trees.iter().find(|tree| tree.build == v.build)?;
            Some(EmbreeRays { tree, packets: &both[usize::from(v.way.reversed)], way: v.way })
        };
        let ways = self.embree?.ways(directed);
        let variants = trees.iter().flat_map(|tree| {
            ways.iter().map(|&way| Variant { build: tree.build, way, query: set.kind.query(), directed })
        });
        let mut timed: Vec<(f64, Variant)> = variants
            .filter_map(|variant| rays(&variant).map(|rays| (sample(&rays, answers), variant)))
            .collect();
        timed.sort_by(|a, b| a.0.total_cmp(&b.0));
        timed.truncate(FINALISTS);
        for (seconds, variant) in &mut timed {
            if let Some(rays) = rays(variant) {
                *seconds = time(&rays, answers, None).min(time(&rays, answers, None));
            }
        }
        timed.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, variant)| variant)
    }
}

/// A pool for more than one thread.
pub(super) fn pool(threads: usize) -> Result<Option<ThreadPool>, String> {
    let pool = || ThreadPoolBuilder::new().num_threads(threads).build().map_err(|error| error.to_string());
    (threads > 1).then(pool).transpose()
}

/// Rays on which two engines differ: hit or miss, or the place of the hit.
fn disagreements(set: &RaySet, a: &Answers, b: &Answers) -> usize {
    let same = |x: f32, y: f32| x == y || (x - y).abs() <= TOLERANCE * x.abs().max(y.abs());
    let differ = |slot: usize| match set.kind.query() {
        Query::Closest => !same(a.t[slot], b.t[slot]),
        Query::Any => a.occluded[slot] != b.occluded[slot],
    };
    let slots = set.items.iter().enumerate().flat_map(|(i, item)| i * ITEM..i * ITEM + item.len());
    slots.filter(|&slot| differ(slot)).count()
}
