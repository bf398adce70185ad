//! Instant Global Illumination against its ancestor and path tracing: error and time of single frames from scratch.

use std::fmt::Write as _;
use std::path::PathBuf;

use heliostat::compare::{Comparison, Picture, Referred, compare};
use heliostat::engine::{Engine, EngineOptions};
use heliostat::lighting;
use heliostat::scene::{Backend, Camera, Frame, FrameRequest, IgiOptions, Progress};

use crate::measure::median;
use crate::result;

/// How many times as long as a frame the ancestor may take for the same error before it is given up.
const MOST_TIMES: f64 = 30.0;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Scenes by name or file
    #[arg(long, value_name = "NAME|FILE", num_args = 1.., value_delimiter = ',', default_value = "cornell,conference-1,spheres")]
    scene: Vec<String>,
    /// Columns and rows
    #[arg(long, num_args = 2, value_names = ["COLUMNS", "ROWS"], default_values_t = [640, 480])]
    size: Vec<u32>,
    /// Samples per pixel of the reference, by path tracing
    #[arg(long, default_value_t = 256)]
    reference: u32,
    /// Frames of each kind; medians are printed
    #[arg(long, default_value_t = 5)]
    runs: u32,
    /// Replaces the tables between the marks of a page, as docs/igi.md has them
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
}

/// A way to make a frame.
struct Contender {
    name: String,
    renderer: &'static str,
    samples: u32,
    igi: IgiOptions,
}

/// A frame's cost and error.
struct Row {
    milliseconds: f64,
    rays_per_pixel: f64,
    error: Comparison,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let mut tables = String::new();
    for scene in &arguments.scene {
        let mut bench = Bench::new(scene, arguments)?;
        let _ = writeln!(tables, "\n### {scene}\n");
        let _ = writeln!(tables, "| frame | ms | rays per pixel | FLIP | relMSE | mean |");
        let _ = writeln!(tables, "|---|---:|---:|---:|---:|---:|");
        let mut one = None;
        for contender in contenders() {
            let row = bench.measure(&contender, arguments.runs)?;
            let [a, b] = [row.error.mean_a, row.error.mean_b].map(|mean| mean.iter().sum::<f64>());
            let _ = writeln!(
                tables,
                "| {} | {:.0} | {:.1} | {:.3} | {:.4} | {:+.1} % |",
                contender.name,
                row.milliseconds,
                row.rays_per_pixel,
                row.error.flip,
                row.error.relmse,
                100.0 * (a / b - 1.0)
            );
            one.get_or_insert((row.milliseconds, row.error.relmse));
        }
        let (milliseconds, error) = one.unwrap_or_default();
        let _ = writeln!(tables, "\n{}", bench.equal_error(milliseconds, error)?);
    }
    result(tables.trim_end());
    match &arguments.page {
        None => Ok(()),
        Some(page) => {
            let text =
                std::fs::read_to_string(page).map_err(|e| format!("cannot read {}: {e}", page.display()))?;
            let text = crate::page::splice(&text, "igi", &tables)?;
            std::fs::write(page, text).map_err(|e| format!("cannot write {}: {e}", page.display()))
        }
    }
}

/// The first is what the others are compared with.
fn contenders() -> Vec<Contender> {
    let igi = IgiOptions::default();
    let frame = |name: &str, renderer, samples, igi| Contender { name: name.into(), renderer, samples, igi };
    let all = igi.paths * igi.interleave[0] * igi.interleave[1];
    vec![
        frame("`igi`, 3×3 sets of 8 paths", "igi", 1, igi),
        frame("the same, not filtered", "igi", 1, IgiOptions { filter: false, ..igi }),
        frame("`igi`, 3×3 sets of 3 paths", "igi", 1, IgiOptions { paths: 3, ..igi }),
        frame("`igi`, 4 passes of 8 paths", "igi", 4, igi),
        frame("`instant-radiosity`, 8 paths", "instant-radiosity", 1, igi),
        frame("`instant-radiosity`, all 72 paths", "instant-radiosity", 1, IgiOptions { paths: all, ..igi }),
        frame("`path`, 1 sample per pixel", "path", 1, igi),
        frame("`path`, 4 samples per pixel", "path", 4, igi),
    ]
}

/// A scene with its reference.
struct Bench<'a> {
    engine: Engine,
    camera: Camera,
    reference: Picture,
    arguments: &'a Arguments,
}

impl<'a> Bench<'a> {
    fn new(name: &str, arguments: &'a Arguments) -> Result<Self, String> {
        let scene = crate::motion::scene(name)?;
        let mut engine = Engine::new(EngineOptions::default()).map_err(|error| error.to_string())?;
        engine.apply(&scene.edits, &Progress::new()).map_err(|error| error.to_string())?;
        if !engine.scene().has_light() {
            let light = lighting::default_light(engine.scene());
            engine.apply(&light, &Progress::new()).map_err(|error| error.to_string())?;
        }
        let camera = crate::motion::camera(&engine)?;
        let empty = Picture { width: 0, height: 0, color: Vec::new(), referred: Referred::Scene };
        let mut bench = Self { engine, camera, reference: empty, arguments };
        let samples = arguments.reference.max(1);
        // Another seed than that of the frames compared with it.
        let reference =
            Contender { name: String::new(), renderer: "path", samples, igi: IgiOptions::default() };
        bench.reference = picture(&bench.render(&reference, 1)?);
        Ok(bench)
    }

    fn render(&mut self, contender: &Contender, seed: u32) -> Result<Frame, String> {
        let [width, height] = [self.arguments.size[0], self.arguments.size[1]];
        let request = FrameRequest {
            renderer: contender.renderer.into(),
            samples: contender.samples,
            igi: contender.igi,
            seed,
            ..FrameRequest::new(self.camera.clone(), width, height)
        };
        self.engine.render(&request, &Progress::new()).map_err(|error| error.to_string())
    }

    /// The median of so many frames.
    fn measure(&mut self, contender: &Contender, runs: u32) -> Result<Row, String> {
        let mut frame = self.render(contender, 0)?;
        let mut times = vec![frame.stats.milliseconds];
        for _ in 1..runs {
            frame = self.render(contender, 0)?;
            times.push(frame.stats.milliseconds);
        }
        let error = compare(&picture(&frame), &self.reference).map_err(|error| error.to_string())?;
        let pixels = f64::from(frame.width) * f64::from(frame.height);
        let rays_per_pixel = frame.stats.rays as f64 / pixels;
        Ok(Row { milliseconds: median(&mut times), rays_per_pixel, error })
    }

    /// What the ancestor takes for the same error: twice the paths until it is there.
    fn equal_error(&mut self, milliseconds: f64, error: f64) -> Result<String, String> {
        let mut paths = 8;
        loop {
            let igi = IgiOptions { paths, ..IgiOptions::default() };
            let ancestor = Contender { name: String::new(), renderer: "instant-radiosity", samples: 1, igi };
            let row = self.measure(&ancestor, 1)?;
            let ratio = row.milliseconds / milliseconds;
            if row.error.relmse <= error {
                return Ok(format!(
                    "`instant-radiosity` takes {paths} paths and {:.0} ms for a relMSE as small: {ratio:.1} times as long.",
                    row.milliseconds
                ));
            }
            if ratio > MOST_TIMES || paths > 1 << 14 {
                return Ok(format!(
                    "`instant-radiosity` with {paths} paths takes {ratio:.1} times as long and still has a relMSE of {:.4}.",
                    row.error.relmse
                ));
            }
            paths *= 2;
        }
    }
}

fn picture(frame: &Frame) -> Picture {
    Picture {
        width: frame.width,
        height: frame.height,
        color: frame.color.clone(),
        referred: Referred::Scene,
    }
}
