//! What a run finds out: the rows that go into JSON and tables, the bars, and the means held against them.

use serde::{Deserialize, Serialize};

use crate::measure::geometric_mean;

/// Everything of one run or several.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Results {
    pub(super) machine: Machine,
    pub(super) rows: Vec<Row>,
    pub(super) builds: Vec<BuildRow>,
    /// Missing in older files.
    #[serde(default)]
    pub(super) kd_trees: Vec<KdRow>,
}

/// Where and with what it was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Machine {
    /// Model of the processor.
    pub(super) cpu: String,
    /// Hardware threads that the program may use.
    pub(super) threads: usize,
    pub(super) system: String,
    pub(super) heliostat: String,
    /// Names and versions.
    pub(super) peers: Vec<String>,
}

impl Machine {
    pub(super) fn here(peers: Vec<String>) -> Self {
        let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let field = |name: &str| {
            let line = info.lines().find(|line| line.starts_with(name));
            line.and_then(|line| line.split_once(':')).map_or("", |(_, value)| value.trim()).to_string()
        };
        let numbers = ["cpu family", "model\t", "stepping"].map(field).join("/");
        Self {
            cpu: format!("{} (family/model/stepping {numbers})", field("model name")),
            threads: super::all_threads(),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            heliostat: env!("CARGO_PKG_VERSION").into(),
            peers,
        }
    }
}

/// Rates of one kind of rays on one scene, millions per second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Row {
    pub(super) scene: String,
    pub(super) triangles: usize,
    pub(super) rays: String,
    /// Number of rays.
    pub(super) count: usize,
    pub(super) threads: usize,
    pub(super) isa: String,
    pub(super) ours: f64,
    /// Which of our builds was traced.
    pub(super) our_variant: String,
    pub(super) peer: Option<f64>,
    pub(super) peer_name: Option<String>,
    pub(super) peer_variant: Option<String>,
    /// Ours over the peer's.
    pub(super) ratio: Option<f64>,
    /// Rays with another answer.
    pub(super) disagree: Option<usize>,
}

/// Speed and size of one builder on one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct BuildRow {
    pub(super) scene: String,
    pub(super) triangles: usize,
    pub(super) builder: String,
    pub(super) threads: usize,
    /// Million triangles per second.
    pub(super) mtris_per_s: f64,
    pub(super) sah: f64,
    /// All that tracing needs.
    pub(super) bytes_per_tri: f64,
    /// The peer's million triangles per second.
    pub(super) peer: Option<f64>,
    pub(super) peer_name: Option<String>,
    pub(super) peer_variant: Option<String>,
    pub(super) peer_bytes_per_tri: Option<f64>,
    pub(super) ratio: Option<f64>,
}

/// Two ways through kd-trees on the same rays, one thread, million rays per second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct KdRow {
    pub(super) scene: String,
    pub(super) triangles: usize,
    pub(super) rays: String,
    /// Number of rays.
    pub(super) count: usize,
    pub(super) isa: String,
    /// One tree and way to ask it …
    pub(super) what: String,
    pub(super) rate: f64,
    /// … and the one that it is held against.
    pub(super) over: String,
    pub(super) over_rate: f64,
    pub(super) ratio: f64,
    /// Rays with another answer.
    pub(super) disagree: usize,
}

/// What is to be reached against Embree on one thread.
pub(super) struct Bar {
    pub(super) what: &'static str,
    pub(super) rays: &'static [&'static str],
    /// The geometric mean over the scenes.
    pub(super) mean: f64,
    /// Every scene.
    pub(super) least: f64,
}

/// The bars of an instruction set, in the order of the tables.
pub(super) fn bars(isa: &str) -> &'static [Bar] {
    if isa == "avx512" { &WIDEST } else { &NARROWER }
}

const NARROWER: [Bar; 1] = [Bar { what: "primary, closest hit", rays: &["primary"], mean: 1.5, least: 1.5 }];

const WIDEST: [Bar; 5] = [
    Bar { what: "primary, closest hit", rays: &["primary"], mean: 3.5, least: 2.0 },
    Bar { what: "point light and 16 VPLs, dense, any hit", rays: &["light", "vpl16"], mean: 1.7, least: 1.1 },
    Bar { what: "16 VPLs, 3×3 interleaved, any hit", rays: &["vpl16-3x3"], mean: 1.5, least: 1.0 },
    Bar { what: "diffuse bounce, closest hit", rays: &["diffuse"], mean: 1.25, least: 1.0 },
    Bar { what: "ambient occlusion, any hit", rays: &["ao"], mean: 1.2, least: 1.0 },
];

/// Our builders and what they are to reach over their counterparts of Embree's, geometric mean over the scenes.
pub(super) const BUILD_BARS: [(&str, f64); 2] = [("default", 1.3), ("fast", 1.0)];

/// Whether a row's peer is Embree.
pub(super) fn is_embree(name: Option<&str>) -> bool {
    name.is_some_and(|name| name.starts_with("Embree"))
}

/// How the rows stand to one bar.
pub(super) struct Standing {
    pub(super) mean: f64,
    /// The least ratio and its scene.
    pub(super) least: (f64, String),
}

impl Results {
    /// Rows of one thread against Embree with some instruction set.
    pub(super) fn versus_embree<'a>(&'a self, isa: &'a str, threads: usize) -> impl Iterator<Item = &'a Row> {
        self.rows.iter().filter(move |row| {
            row.isa == isa && row.threads == threads && is_embree(row.peer_name.as_deref())
        })
    }

    /// The instruction sets, in order of appearance.
    pub(super) fn isas(&self) -> Vec<&str> {
        let mut isas: Vec<&str> = Vec::new();
        for row in &self.rows {
            if !isas.contains(&row.isa.as_str()) {
                isas.push(&row.isa);
            }
        }
        isas
    }

    /// The mean and the least ratio over the rows of some kinds of rays; `None` without rows.
    pub(super) fn standing(&self, isa: &str, rays: &[&str]) -> Option<Standing> {
        let rows = self.versus_embree(isa, 1).filter(|row| rays.contains(&row.rays.as_str()));
        let ratios: Vec<(f64, &Row)> = rows.filter_map(|row| row.ratio.map(|ratio| (ratio, row))).collect();
        let (least, row) = ratios.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        let mean = geometric_mean(&ratios.iter().map(|(ratio, _)| *ratio).collect::<Vec<_>>());
        Some(Standing { mean, least: (*least, row.scene.clone()) })
    }

    /// The same for a builder on so many threads.
    pub(super) fn build_standing(&self, builder: &str, threads: usize) -> Option<Standing> {
        let rows = self.builds.iter().filter(|row| {
            row.builder == builder && row.threads == threads && is_embree(row.peer_name.as_deref())
        });
        let ratios: Vec<(f64, &BuildRow)> = rows.filter_map(|row| Some((row.ratio?, row))).collect();
        let (least, row) = ratios.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        let mean = geometric_mean(&ratios.iter().map(|(ratio, _)| *ratio).collect::<Vec<_>>());
        Some(Standing { mean, least: (*least, row.scene.clone()) })
    }

    /// Numbers of threads that trees were built on, rising.
    pub(super) fn build_threads(&self) -> Vec<usize> {
        let mut threads: Vec<usize> = self.builds.iter().map(|row| row.threads).collect();
        threads.sort_unstable();
        threads.dedup();
        threads
    }

    /// How many times faster all threads are than one, geometric mean over the rows against Embree or alone; ours and
    /// the peer's.
    pub(super) fn scaling(&self) -> Option<(usize, f64, Option<f64>)> {
        let many = self.rows.iter().map(|row| row.threads).max().filter(|&threads| threads > 1)?;
        let same = |a: &Row, b: &Row| {
            (&a.scene, &a.rays, &a.isa, &a.peer_name) == (&b.scene, &b.rays, &b.isa, &b.peer_name)
        };
        let pairs: Vec<(&Row, &Row)> = (self.rows.iter().filter(|row| row.threads == many))
            .filter_map(|row| Some((row, self.rows.iter().find(|one| one.threads == 1 && same(one, row))?)))
            .collect();
        let ours: Vec<f64> = pairs.iter().map(|(n, one)| n.ours / one.ours).collect();
        let peer: Vec<f64> = pairs.iter().filter_map(|(n, one)| Some(n.peer? / one.peer?)).collect();
        let mean = |values: &[f64]| (!values.is_empty()).then(|| geometric_mean(values));
        mean(&ours).map(|ours| (many, ours, mean(&peer)))
    }

    /// The last lines of a run: means and least ratios against the bars.
    pub(super) fn summary(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for isa in self.isas() {
            for bar in bars(isa) {
                let Some(Standing { mean, least }) = self.standing(isa, bar.rays) else { continue };
                let met = |yes| if yes { "met" } else { "NOT met" };
                lines.push(format!(
                    "{isa:7} {:40} mean {mean:5.2} (bar {:.2} {})   least {:5.2} on {} (bar {:.2} {})",
                    bar.what,
                    bar.mean,
                    met(mean >= bar.mean),
                    least.0,
                    least.1,
                    bar.least,
                    met(least.0 >= bar.least),
                ));
            }
            if let Some(Standing { mean, least }) = self.standing(isa, &["mirror"]) {
                lines.push(format!(
                    "{isa:7} {:40} mean {mean:5.2} (no bar)   least {:5.2} on {}",
                    "mirror rays, closest hit", least.0, least.1
                ));
            }
        }
        if let Some((threads, ours, peer)) = self.scaling() {
            let peer = peer.map(|peer| format!("; the peer's {peer:.2}")).unwrap_or_default();
            lines.push(format!("{threads} threads over one: {ours:.2}{peer}"));
        }
        lines
    }

    /// Adds another run's findings; rows measured again are replaced.
    pub(super) fn merge(&mut self, other: Self) {
        let same = |a: &Row, b: &Row| {
            (&a.scene, &a.rays, a.threads, &a.isa, &a.peer_name)
                == (&b.scene, &b.rays, b.threads, &b.isa, &b.peer_name)
        };
        self.rows.retain(|row| !other.rows.iter().any(|new| same(row, new)));
        let same = |a: &BuildRow, b: &BuildRow| {
            (&a.scene, &a.builder, a.threads, &a.peer_name, &a.peer_variant)
                == (&b.scene, &b.builder, b.threads, &b.peer_name, &b.peer_variant)
        };
        self.builds.retain(|row| !other.builds.iter().any(|new| same(row, new)));
        let same = |a: &KdRow, b: &KdRow| {
            (&a.scene, &a.rays, &a.isa, &a.what, &a.over) == (&b.scene, &b.rays, &b.isa, &b.what, &b.over)
        };
        self.kd_trees.retain(|row| !other.kd_trees.iter().any(|new| same(row, new)));
        self.rows.extend(other.rows);
        self.kd_trees.extend(other.kd_trees);
        self.builds.extend(other.builds);
        if !other.machine.cpu.is_empty() {
            self.machine = other.machine;
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::kernel) fn row(scene: &str, rays: &str, threads: usize, ours: f64, peer: f64) -> Row {
        Row {
            scene: scene.into(),
            triangles: 1000,
            rays: rays.into(),
            count: 4096,
            threads,
            isa: "avx2".into(),
            ours,
            our_variant: "default".into(),
            peer: Some(peer),
            peer_name: Some("Embree 4.4.0".into()),
            peer_variant: Some("intersect16 coherent HIGH".into()),
            ratio: Some(ours / peer),
            disagree: Some(3),
        }
    }

    fn kd_row(rate: f64) -> KdRow {
        KdRow {
            scene: "a".into(),
            triangles: 1000,
            rays: "primary".into(),
            count: 4096,
            isa: "avx2".into(),
            what: "SAH, packets of 16".into(),
            rate,
            over: "SAH, single rays".into(),
            over_rate: 5.0,
            ratio: rate / 5.0,
            disagree: 1,
        }
    }

    pub(in crate::kernel) fn some() -> Results {
        let rows = vec![
            row("a", "primary", 1, 40.0, 10.0),
            row("b", "primary", 1, 10.0, 10.0),
            row("a", "primary", 2, 76.0, 20.0),
            row("a", "light", 1, 20.0, 10.0),
            row("a", "vpl16", 1, 8.0, 10.0),
        ];
        let builds = vec![BuildRow {
            scene: "a".into(),
            triangles: 1000,
            builder: "default".into(),
            threads: 1,
            mtris_per_s: 3.0,
            sah: 12.0,
            bytes_per_tri: 54.0,
            peer: Some(2.0),
            peer_name: Some("Embree 4.4.0".into()),
            peer_variant: Some("MEDIUM".into()),
            peer_bytes_per_tri: Some(90.0),
            ratio: Some(1.5),
        }];
        let kd_trees = vec![kd_row(16.0)];
        Results { machine: Machine { threads: 2, ..Machine::default() }, rows, builds, kd_trees }
    }

    #[test]
    fn means_and_least_ratios_are_over_one_thread() {
        let results = some();
        let primary = results.standing("avx2", &["primary"]).expect("rows");
        assert!((primary.mean - 2.0).abs() < 1e-12, "√(4 · 1)");
        assert_eq!(primary.least, (1.0, "b".into()));
        let dense = results.standing("avx2", WIDEST[1].rays).expect("rows");
        assert!((dense.mean - 1.6_f64.sqrt()).abs() < 1e-12);
        assert!(
            results.standing("avx2", &["ao"]).is_none() && results.standing("avx512", &["primary"]).is_none()
        );
        let (threads, ours, peer) = results.scaling().expect("two threads");
        assert!(threads == 2 && (ours - 1.9).abs() < 1e-12 && (peer.expect("a peer") - 2.0).abs() < 1e-12);
        let summary = results.summary().join("\n");
        assert!(
            summary.contains("mean  2.00 (bar 1.50 met)   least  1.00 on b (bar 1.50 NOT met)"),
            "{summary}"
        );
    }

    #[test]
    fn builders_are_held_against_their_bars() {
        let results = some();
        let Standing { mean, least } = results.build_standing("default", 1).expect("a row");
        assert!((mean - 1.5).abs() < 1e-12 && least == (1.5, "a".into()));
        assert!(
            results.build_standing("fast", 1).is_none() && results.build_standing("default", 2).is_none()
        );
        assert_eq!(results.build_threads(), [1]);
    }

    #[test]
    fn json_has_the_promised_names() {
        let json = serde_json::to_value(some()).expect("JSON");
        assert!(json["machine"].is_object());
        let keys = |value: &serde_json::Value, names: &[&str]| {
            for name in names {
                assert!(value.get(name).is_some_and(|v| !v.is_null()), "{name} in {value}");
            }
        };
        let row = [
            "scene",
            "rays",
            "threads",
            "isa",
            "ours",
            "peer",
            "peer_name",
            "peer_variant",
            "ratio",
            "disagree",
        ];
        keys(&json["rows"][0], &row);
        let build = ["scene", "builder", "threads", "mtris_per_s", "sah", "bytes_per_tri", "peer", "ratio"];
        keys(&json["builds"][0], &build);
        let back: Results = serde_json::from_value(json).expect("results");
        assert_eq!(back, some());
    }

    #[test]
    fn rows_measured_again_are_replaced() {
        let mut results = some();
        let again = Results {
            rows: vec![row("b", "primary", 1, 30.0, 10.0)],
            kd_trees: vec![kd_row(15.0)],
            ..Results::default()
        };
        results.merge(again);
        assert_eq!(results.rows.len(), 5);
        assert_eq!(results.kd_trees, [kd_row(15.0)]);
        assert_eq!(results.standing("avx2", &["primary"]).expect("rows").least.0, 3.0);
        assert_eq!(results.machine.threads, 2, "an empty machine replaces none");
    }
}
