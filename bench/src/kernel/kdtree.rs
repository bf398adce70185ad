//! The 2003 report's own kernel: what packets gain over single rays, and the surface area heuristic over a median split.

use heliostat::kernel::{Isa, KdOptions, KdSplit, KdTree, Mesh, World};

use super::ours::{self, OurRays};
use super::rays::{Item, Kind, Query, RaySet};
use super::results::KdRow;
use super::versus::disagreements;
use crate::measure::{Answers, interleave, time};
use crate::result;

/// The scenes that it is measured on.
pub(super) const SCENES: [&str; 2] = ["conference", "sponza"];
/// The rays that it is measured with: coherent ones, and those that are not.
pub(super) const KINDS: [Kind; 2] = [Kind::Primary, Kind::Diffuse];

/// The two trees of one scene.
pub(super) struct KdTrees<'a> {
    scene: &'a str,
    triangles: usize,
    isa: Isa,
    runs: usize,
    heuristic: World,
    median: World,
}

/// A tree and a way to ask it, by name.
struct Side<'a> {
    name: &'static str,
    rays: OurRays<'a>,
}

impl<'a> KdTrees<'a> {
    /// Builds both trees; every comparison takes so many interleaved `runs`.
    ///
    /// # Errors
    /// When the mesh cannot be built or the instruction set is missing.
    pub(super) fn new(scene: &'a str, mesh: &Mesh, isa: Isa, runs: usize) -> Result<Self, String> {
        let world = |split| {
            let options = KdOptions { split, ..KdOptions::default() };
            let tree = KdTree::build(std::slice::from_ref(mesh), &options).map_err(|e| e.to_string())?;
            ours::world(tree.into(), isa)
        };
        let (heuristic, median) = (world(KdSplit::Sah)?, world(KdSplit::Median)?);
        Ok(Self { scene, triangles: mesh.indices.len(), isa, runs, heuristic, median })
    }

    /// Prints and returns the rows. Packets are measured only for rays with a common origin.
    ///
    /// # Errors
    /// When a measurement fails.
    pub(super) fn measure(&self, set: &RaySet) -> Result<Vec<KdRow>, String> {
        let singly = &single(set);
        let heuristic = || Side { name: "SAH, single rays", rays: rays(&self.heuristic, singly) };
        let median = Side { name: "median, single rays", rays: rays(&self.median, singly) };
        let mut rows = Vec::new();
        if set.items.iter().all(|item| matches!(item, Item::Tile(_))) {
            let packets = || Side { name: "SAH, packets of 16", rays: rays(&self.heuristic, set) };
            let median = Side { name: "median, packets of 16", rays: rays(&self.median, set) };
            rows.push(self.compare(set, packets(), heuristic())?);
            rows.push(self.compare(set, packets(), median)?);
        }
        rows.push(self.compare(set, heuristic(), median)?);
        rows.iter().for_each(|row| result(&line(row)));
        Ok(rows)
    }

    /// On one thread.
    fn compare(&self, set: &RaySet, a: Side<'_>, b: Side<'_>) -> Result<KdRow, String> {
        let closest = set.kind.query() == Query::Closest;
        let [mut answers_a, mut answers_b] = [(); 2].map(|()| Answers::new(set.items.len(), closest));
        let (x, y) = interleave(
            self.runs,
            || Ok(time(&a.rays, &mut answers_a, None)),
            || Ok(time(&b.rays, &mut answers_b, None)),
        )?;
        Ok(KdRow {
            scene: self.scene.into(),
            triangles: self.triangles,
            rays: set.kind.name().into(),
            count: set.count,
            isa: self.isa.to_string(),
            what: a.name.into(),
            rate: set.count as f64 / x * 1e-6,
            over: b.name.into(),
            over_rate: set.count as f64 / y * 1e-6,
            ratio: y / x,
            disagree: disagreements(set, &answers_a, &answers_b),
        })
    }
}

fn rays<'a>(world: &'a World, set: &'a RaySet) -> OurRays<'a> {
    OurRays { world, set }
}

/// The same rays in the same order, without saying that any belong together.
fn single(set: &RaySet) -> RaySet {
    let items = set.items.iter().map(|item| Item::Batch(item.rays())).collect();
    RaySet { kind: set.kind, items, count: set.count }
}

fn line(row: &KdRow) -> String {
    format!(
        "{:10} kd-tree  {:8.2} Mray/s {}   {:8.2} {}   ratio {:5.2}   {} of {} disagree",
        row.rays, row.rate, row.what, row.over_rate, row.over, row.ratio, row.disagree, row.count
    )
}

#[cfg(test)]
mod tests {
    use heliostat::kernel::Tile;
    use heliostat::kernel::glam::Vec3;

    use super::*;

    #[test]
    fn packets_and_single_rays_of_both_trees_agree() {
        let (positions, indices) = super::super::terrain::make(500);
        let middle = positions.iter().sum::<Vec3>() / positions.len() as f32;
        let above = middle + Vec3::Y * 1000.0;
        let mut tile = Tile::new(above);
        for i in 0..Tile::CAPACITY {
            let aim = positions[i * 7 % positions.len()] * 0.99 + middle * 0.01;
            tile.push(aim - above, f32::INFINITY);
        }
        let tiles = RaySet { kind: Kind::Primary, items: vec![Item::Tile(Box::new(tile))], count: 256 };
        let batch =
            RaySet { kind: Kind::Diffuse, items: vec![Item::Batch(tiles.items[0].rays())], count: 256 };
        let mesh = Mesh::new(positions, indices);
        let trees = KdTrees::new("a", &mesh, Isa::best(), 1).expect("trees");
        let names = |set| -> Vec<(String, String)> {
            let rows = trees.measure(set).expect("rows");
            assert!(rows.iter().all(|row| row.disagree == 0 && row.rate > 0.0), "{rows:?}");
            rows.into_iter().map(|row| (row.what, row.over)).collect()
        };
        let name = |a: &str, b: &str| (a.to_string(), b.to_string());
        let singly = name("SAH, single rays", "median, single rays");
        assert_eq!(
            names(&tiles),
            [
                name("SAH, packets of 16", "SAH, single rays"),
                name("SAH, packets of 16", "median, packets of 16"),
                singly.clone(),
            ]
        );
        assert_eq!(names(&batch), [singly]);
    }
}
