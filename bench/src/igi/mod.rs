//! Instant Global Illumination against its ancestor and path tracing: error and time of single frames from scratch.

mod sequences;

use std::fmt::Write as _;
use std::path::PathBuf;

use heliostat::compare::{Picture, Referred, compare};
use heliostat::engine::{Engine, EngineOptions};
use heliostat::lighting;
use heliostat::scene::{Backend, Camera, Frame, FrameRequest, IgiOptions, Progress};

use crate::measure::median;
use crate::result;

/// How many times as long as a frame the ancestor may take for the same error before it is given up.
const MOST_TIMES: f64 = 30.0;
/// Numbers of paths that differ by no more than this factor are close enough to each other.
const CLOSE: f64 = 1.1;

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
    /// Frames of each kind, each of a seed of its own; medians are printed
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
    /// Whether it is told what the ancestor takes for the same error.
    equalled: bool,
}

impl Contender {
    fn new(name: &str, renderer: &'static str, samples: u32, igi: IgiOptions) -> Self {
        Self { name: name.into(), renderer, samples, igi, equalled: false }
    }
}

/// Cost and error of frames.
struct Row {
    milliseconds: f64,
    rays_per_pixel: f64,
    flip: f64,
    relmse: f64,
    /// Mean of all pixels over that of the reference, less one.
    mean: f64,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let mut tables = String::new();
    for scene in &arguments.scene {
        let mut bench = Bench::new(scene, arguments)?;
        let _ = writeln!(tables, "\n### {scene}\n");
        let _ = writeln!(tables, "| frame | ms | rays per pixel | FLIP | relMSE | mean |");
        let _ = writeln!(tables, "|---|---:|---:|---:|---:|---:|");
        let mut referred = Vec::new();
        for contender in contenders() {
            let row = bench.measure(&contender, arguments.runs)?;
            let _ = writeln!(
                tables,
                "| {} | {:.0} | {:.1} | {:.3} | {:.4} | {:+.1} % |",
                contender.name,
                row.milliseconds,
                row.rays_per_pixel,
                row.flip,
                row.relmse,
                100.0 * row.mean
            );
            if contender.equalled {
                referred.push((contender.name, row));
            }
        }
        for (name, row) in referred {
            let _ = writeln!(tables, "\nFor the relMSE of {name}: {}", bench.equal_error(&row)?);
        }
        let _ = writeln!(tables, "\n{}", sequences::table(&mut bench, scene)?);
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

fn contenders() -> Vec<Contender> {
    let igi = IgiOptions::default();
    let frame = Contender::new;
    let equalled = |contender| Contender { equalled: true, ..contender };
    let all = igi.paths * igi.interleave[0] * igi.interleave[1];
    vec![
        equalled(frame("`igi`, 3×3 sets of 8 paths", "igi", 1, igi)),
        equalled(frame("the same without samples at edges", "igi", 1, IgiOptions { edges: false, ..igi })),
        frame("the same, not filtered", "igi", 1, IgiOptions { filter: false, ..igi }),
        frame("`igi`, 3×3 sets of 3 paths", "igi", 1, IgiOptions { paths: 3, ..igi }),
        frame("`igi`, 4 samples that share 8 paths", "igi", 1, IgiOptions { antialias: 4, ..igi }),
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
        let engine = engine(name)?;
        let camera = crate::motion::camera(&engine)?;
        let reference = Picture { width: 0, height: 0, color: Vec::new(), referred: Referred::Scene };
        let mut bench = Self { engine, camera, reference, arguments };
        bench.reference = bench.refer(&bench.camera.clone())?;
        Ok(bench)
    }

    /// What a camera is to see.
    fn refer(&mut self, camera: &Camera) -> Result<Picture, String> {
        let samples = self.arguments.reference.max(1);
        let contender = Contender::new("", "path", samples, IgiOptions::default());
        // Another seed than those of the frames compared with it.
        let request = FrameRequest { camera: camera.clone(), ..self.request(&contender, u32::MAX) };
        let frame = self.engine.render(&request, &Progress::new()).map_err(|error| error.to_string())?;
        Ok(picture(&frame))
    }

    fn request(&self, contender: &Contender, seed: u32) -> FrameRequest {
        let [width, height] = [self.arguments.size[0], self.arguments.size[1]];
        FrameRequest {
            renderer: contender.renderer.into(),
            samples: contender.samples,
            igi: contender.igi,
            seed,
            ..FrameRequest::new(self.camera.clone(), width, height)
        }
    }

    fn render(&mut self, contender: &Contender, seed: u32) -> Result<Frame, String> {
        let request = self.request(contender, seed);
        self.engine.render(&request, &Progress::new()).map_err(|error| error.to_string())
    }

    /// Medians of so many frames, each of a seed of its own.
    fn measure(&mut self, contender: &Contender, runs: u32) -> Result<Row, String> {
        let mut rows = Vec::new();
        for seed in 0..runs.max(1) {
            let frame = self.render(contender, seed)?;
            let error = compare(&picture(&frame), &self.reference).map_err(|error| error.to_string())?;
            let [a, b] = [error.mean_a, error.mean_b].map(|mean| mean.iter().sum::<f64>());
            let pixels = f64::from(frame.width) * f64::from(frame.height);
            rows.push(Row {
                milliseconds: frame.stats.milliseconds,
                rays_per_pixel: frame.stats.rays as f64 / pixels,
                flip: error.flip,
                relmse: error.relmse,
                mean: a / b - 1.0,
            });
        }
        let of = |value: fn(&Row) -> f64| median(&mut rows.iter().map(value).collect::<Vec<_>>());
        Ok(Row {
            milliseconds: of(|row| row.milliseconds),
            rays_per_pixel: of(|row| row.rays_per_pixel),
            flip: of(|row| row.flip),
            relmse: of(|row| row.relmse),
            mean: of(|row| row.mean),
        })
    }

    /// What the ancestor takes for the same error: twice the paths until it is there, then closer and closer between the
    /// last two.
    fn equal_error(&mut self, frame: &Row) -> Result<String, String> {
        let mut worse = None;
        let mut better = loop {
            let paths = worse.as_ref().map_or(8, |&(paths, _)| 2 * paths);
            let row = self.ancestor(paths)?;
            let times = row.milliseconds / frame.milliseconds;
            if row.relmse <= frame.relmse {
                break (paths, times);
            }
            if times > MOST_TIMES || paths > 1 << 14 {
                return Ok(format!(
                    "`instant-radiosity` with {paths} paths takes {times:.1} times as long and still has a relMSE of {:.4}.",
                    row.relmse
                ));
            }
            worse = Some((paths, times));
        };
        let Some(mut worse) = worse else {
            return Ok(format!("`instant-radiosity` needs at most {} paths.", better.0));
        };
        while better.0 > worse.0 + 1 && f64::from(better.0) > CLOSE * f64::from(worse.0) {
            let paths = f64::from(worse.0 * better.0).sqrt().round() as u32;
            let row = self.ancestor(paths)?;
            let end = if row.relmse <= frame.relmse { &mut better } else { &mut worse };
            *end = (paths, row.milliseconds / frame.milliseconds);
        }
        Ok(format!(
            "`instant-radiosity` takes {} to {} paths, {:.1} to {:.1} times as long.",
            worse.0, better.0, worse.1, better.1
        ))
    }

    /// The ancestor with so many paths.
    fn ancestor(&mut self, paths: u32) -> Result<Row, String> {
        let igi = IgiOptions { paths, ..IgiOptions::default() };
        let ancestor = Contender::new("", "instant-radiosity", 1, igi);
        self.measure(&ancestor, self.arguments.runs)
    }
}

/// An engine with a scene that has light.
fn engine(name: &str) -> Result<Engine, String> {
    let scene = crate::motion::scene(name)?;
    let mut engine = Engine::new(EngineOptions::default()).map_err(|error| error.to_string())?;
    engine.apply(&scene.edits, &Progress::new()).map_err(|error| error.to_string())?;
    if !engine.scene().has_light() {
        let light = lighting::default_light(engine.scene());
        engine.apply(&light, &Progress::new()).map_err(|error| error.to_string())?;
    }
    Ok(engine)
}

fn picture(frame: &Frame) -> Picture {
    Picture {
        width: frame.width,
        height: frame.height,
        color: frame.color.clone(),
        referred: Referred::Scene,
    }
}
