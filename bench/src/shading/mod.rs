//! What shading costs: against tracing alone, with many shaders at once, on lanes and off them, in a plug-in.
//!
//! # References
//! Wald, Purcell, Schmittler, Benthin, Slusallek, "Realtime Ray Tracing and its use for Interactive Global Illumination",
//! 2003, table 1 and section 2.1.2.

mod mosaic;
mod plain;
mod plugin;

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Arc;

use heliostat::engine::{Engine, EngineOptions, LaneMode};
use heliostat::plugins::Plugins;
use heliostat::scene::{Backend, Edit, FrameRequest, Progress};
use heliostat::shading::ShaderRegistry;
use serde_json::{Value, json};

use crate::measure::{median, process_seconds};
use crate::result;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Scenes by name or file, to be shaded simply
    #[arg(long, value_name = "NAME|FILE", num_args = 1.., value_delimiter = ',', default_value = "conference-1")]
    scene: Vec<String>,
    /// Edge of the pictures, pixels
    #[arg(long, default_value_t = 1024)]
    size: u32,
    /// Frames; medians are printed
    #[arg(long, default_value_t = 7)]
    runs: usize,
    /// Tables to be measured
    #[arg(long, value_enum, num_args = 1.., value_delimiter = ',', default_values_t = Table::ALL)]
    table: Vec<Table>,
    /// Writes all figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Table {
    /// Simple shading against tracing alone
    Simple,
    /// 32 shaders at random
    Mosaics,
    /// A plug-in in C
    Plugin,
}

impl Table {
    const ALL: [Self; 3] = [Self::Simple, Self::Mosaics, Self::Plugin];
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let mut all = json!({});
    for table in Table::ALL.into_iter().filter(|table| arguments.table.contains(table)) {
        match table {
            Table::Simple => all["simple"] = plain::run(arguments)?.into(),
            Table::Mosaics => all["mosaics"] = mosaic::run(arguments)?.into(),
            Table::Plugin => all["plugin"] = plugin::run(arguments)?.into(),
        }
    }
    let Some(file) = &arguments.json else { return Ok(()) };
    std::fs::write(file, all.to_string()).map_err(|error| format!("cannot write {}: {error}", file.display()))
}

/// An engine of one thread, and what it is to render.
struct Setup {
    engine: Engine,
    request: FrameRequest,
}

impl Setup {
    /// An engine with these edits; plug-ins are allowed.
    fn new(edits: &[Edit], lanes: LaneMode, request: FrameRequest) -> Result<Self, String> {
        let mut shaders = ShaderRegistry::built_in();
        shaders.allow_plugins(Arc::new(Plugins::default()));
        let options = EngineOptions { threads: NonZeroUsize::new(1), lanes, ..EngineOptions::default() };
        let mut engine = Engine::with_shaders(options, shaders).map_err(|error| error.to_string())?;
        let report = engine.apply(edits, &Progress::new()).map_err(|error| error.to_string())?;
        match report.problems.first() {
            Some(problem) => Err(problem.to_string()),
            None => Ok(Self { engine, request }),
        }
    }
}

/// What a setup took.
#[derive(Clone, Copy, Debug, Default)]
struct Time {
    /// Processor time of a frame.
    milliseconds: f64,
    /// Share of it in ray queries.
    queries: f64,
}

/// Medians of frames of all setups, rendered in turn so that a busy machine disturbs all alike.
fn measure(setups: &mut [Setup], runs: usize) -> Result<Vec<Time>, String> {
    let mut times = vec![(Vec::new(), Vec::new()); setups.len()];
    // The first round warms up.
    for round in 0..=runs.max(1) {
        for (setup, (times, queries)) in setups.iter_mut().zip(&mut times) {
            let start = process_seconds();
            let frame =
                setup.engine.render(&setup.request, &Progress::new()).map_err(|error| error.to_string())?;
            let seconds = process_seconds() - start;
            if round > 0 {
                times.push(1e3 * seconds);
                queries.push(frame.stats.query_milliseconds / frame.stats.milliseconds);
            }
        }
    }
    let time = |(times, queries): &mut (Vec<f64>, Vec<f64>)| Time {
        milliseconds: median(times),
        queries: median(queries),
    };
    Ok(times.iter_mut().map(time).collect())
}

/// Prints a table as Markdown.
fn table(title: &str, columns: &[&str], rows: &[Vec<String>]) {
    result(&format!("\n{title}\n\n| {} |\n|{}", columns.join(" | "), "---|".repeat(columns.len())));
    for row in rows {
        result(&format!("| {} |", row.join(" | ")));
    }
}

/// A frame's time in a table.
fn ms(time: Time) -> String {
    format!("{:.1}", time.milliseconds)
}

/// A share in a table.
fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

fn value(name: &str, time: Time) -> Value {
    json!({ "setup": name, "milliseconds": time.milliseconds, "query_share": time.queries })
}
