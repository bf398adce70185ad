//! `kernel`: Heliostat's ray tracing kernel and its peers on the same scenes and rays, in one run.

mod builds;
mod embree;
mod instanced;
mod kdtree;
mod markdown;
mod obvhs;
mod ours;
mod plot;
mod rays;
mod results;
pub(crate) mod scenes;
pub(crate) mod split;
pub(crate) mod terrain;
mod twist;
mod versus;

use std::path::{Path, PathBuf};

use heliostat::kernel::Isa;
use heliostat::kernel::glam::Vec3;

use self::embree::Embree;
use self::instanced::Instanced;
use self::rays::Kind;
use self::results::{Machine, Results};
use self::scenes::{Origin, Spec};
use self::twist::Twist;
use self::versus::Versus;
use crate::{report, result};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Only this scene: one of the standard ones, a built-in one, or a file [may be repeated]
    #[arg(long, value_name = "NAME|FILE")]
    scene: Vec<String>,
    /// Only these rays: primary, light, vpl16, vpl16-3x3, diffuse, ao, mirror [may be repeated]
    #[arg(long, value_name = "KIND", value_parser = kind)]
    rays: Vec<Kind>,
    /// Where to look from, for a single scene
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, requires = "target", allow_hyphen_values = true)]
    eye: Option<Vec3>,
    /// What to look at
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, requires = "eye", allow_hyphen_values = true)]
    target: Option<Vec3>,
    /// Vertical field of view in degrees, of a view placed by hand
    #[arg(long, default_value_t = 45.0)]
    fov: f32,
    /// Pixels along the edge of the square picture
    #[arg(long, default_value_t = 1024, value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Interleaved runs of each engine; medians count
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    runs: u32,
    /// Interleaved runs of each builder; 0 leaves builds out
    #[arg(long, default_value_t = 3)]
    build_runs: usize,
    /// Leave out the crate obvhs
    #[arg(long)]
    without_obvhs: bool,
    /// Kinds of rays are thinned out to so many millions
    #[arg(long, default_value_t = 4.0)]
    most: f64,
    /// Threads: 1, 2, … or `all` [may be repeated; default: 1 and all]
    #[arg(long, value_name = "N|all", value_parser = threads)]
    threads: Vec<usize>,
    /// Instruction set of both engines: avx512, avx2 or sse4.2
    #[arg(long, value_parser = isa)]
    isa: Option<Isa>,
    /// Triangles of the generated terrain
    #[arg(long, default_value_t = 10_000_000)]
    terrain: usize,
    /// Write the results to a file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Put the tables between the markers `kernel:begin` and `kernel:end` of a Markdown page
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Instead of scenes, measure primary rays over terrains of 1,000 to 10,000,000 triangles and draw their cost
    #[arg(long, value_name = "FILE.svg", conflicts_with_all = ["scene", "rays"])]
    plot: Option<PathBuf>,
    /// Instead of engines, compare one flat tree with about so many placed objects, in each engine; of the conference
    /// room unless scenes are named
    #[arg(long, value_name = "COUNT", conflicts_with_all = ["plot", "json", "markdown"], value_parser = clap::value_parser!(u32).range(1..))]
    instances: Option<u32>,
    /// The objects of --instances are turned about the vertical as well as moved
    #[arg(long, requires = "instances")]
    turned: bool,
    /// Instead of engines, measure refitting while the mesh is twisted by so many turns in a hundred frames; of the
    /// dragon unless scenes are named
    #[arg(long, value_name = "TURNS", conflicts_with_all = ["plot", "json", "markdown", "instances", "rays"])]
    twist: Option<f32>,
    /// Take the results of earlier runs, written by --json, instead of measuring [may be repeated]
    #[arg(long, value_name = "FILE", conflicts_with_all = ["scene", "rays", "plot"])]
    from: Vec<PathBuf>,
}

fn kind(name: &str) -> Result<Kind, String> {
    let names = || Kind::ALL.map(Kind::name).join(", ");
    let found = Kind::ALL.into_iter().find(|kind| kind.name() == name);
    found.ok_or_else(|| format!("`{name}` is none of {}", names()))
}

fn vector(text: &str) -> Result<Vec3, String> {
    let numbers: Result<Vec<f32>, _> = text.split(',').map(|part| part.trim().parse::<f32>()).collect();
    match numbers.as_deref() {
        Ok(&[x, y, z]) if Vec3::new(x, y, z).is_finite() => Ok(Vec3::new(x, y, z)),
        _ => Err(format!("`{text}` is not a vector; write three numbers X,Y,Z")),
    }
}

fn threads(text: &str) -> Result<usize, String> {
    let number = if text == "all" { Some(all_threads()) } else { text.parse().ok().filter(|&n| n > 0) };
    number.ok_or_else(|| format!("`{text}` is neither a number of threads nor `all`"))
}

fn isa(name: &str) -> Result<Isa, String> {
    name.parse().map_err(|error: heliostat::kernel::IsaError| error.to_string())
}

fn all_threads() -> usize {
    std::thread::available_parallelism().map_or(1, Into::into)
}

/// Measures and prints.
///
/// # Errors
/// When a scene cannot be read or a result cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    if !arguments.from.is_empty() {
        let mut results = Results::default();
        for path in &arguments.from {
            results.merge(read(path)?);
        }
        return finish(&results, arguments);
    }
    if let Some(turns) = arguments.twist {
        return twist(arguments, turns);
    }
    let embree = match Embree::load(embree_isa(arguments.isa)?) {
        Ok(embree) => {
            let width = if embree.native16 { 16 } else { 8 };
            report(&format!("{}, packets of up to {width} rays", embree.name()));
            Some(embree)
        }
        Err(problem) => {
            report(&format!("note: only our own figures: {problem}"));
            None
        }
    };
    if let Some(count) = arguments.instances {
        return instances(arguments, embree.as_ref(), count as usize);
    }
    let all = || vec![1, all_threads()];
    let mut versus = Versus {
        embree: embree.as_ref(),
        isa: arguments.isa.unwrap_or_else(Isa::best),
        size: arguments.size,
        runs: arguments.runs as usize,
        build_runs: arguments.build_runs,
        most: (arguments.most * 1e6) as usize,
        threads: if arguments.threads.is_empty() { all() } else { arguments.threads.clone() },
        kinds: if arguments.rays.is_empty() { Kind::ALL.to_vec() } else { arguments.rays.clone() },
        obvhs: !arguments.without_obvhs,
    };
    versus.threads.dedup();
    let specs = match &arguments.plot {
        None => specs(arguments)?,
        Some(_) => {
            (versus.threads, versus.kinds) = (vec![1], vec![Kind::Primary]);
            (versus.build_runs, versus.obvhs) = (0, false);
            plot::COUNTS.map(Spec::terrain).to_vec()
        }
    };
    let mut results = Results::default();
    for spec in &specs {
        results.merge(versus.scene(spec)?);
    }
    let mut peers: Vec<String> = embree.iter().map(Embree::name).collect();
    peers.extend(versus.obvhs.then(|| obvhs::NAME.to_string()));
    results.machine = Machine::here(peers);
    if let Some(path) = &arguments.plot {
        write(path, &plot::svg(&results.rows))?;
    }
    finish(&results, arguments)
}

/// Deforming meshes.
fn twist(arguments: &Arguments, turns: f32) -> Result<(), String> {
    let twist = Twist {
        isa: arguments.isa.unwrap_or_else(Isa::best),
        size: arguments.size,
        runs: arguments.runs as usize,
        most: (arguments.most * 1e6) as usize,
        threads: arguments.threads.first().copied().unwrap_or_else(all_threads),
        turns,
    };
    let mut specs = specs(arguments)?;
    if arguments.scene.is_empty() {
        specs.retain(|spec| spec.name == "dragon");
    }
    specs.iter().try_for_each(|spec| twist.scene(spec))
}

/// Flat trees against instances.
fn instances(arguments: &Arguments, embree: Option<&Embree>, count: usize) -> Result<(), String> {
    let kinds = if arguments.rays.is_empty() { &Kind::ALL } else { &arguments.rays[..] };
    let instanced = Instanced {
        embree,
        isa: arguments.isa.unwrap_or_else(Isa::best),
        size: arguments.size,
        runs: arguments.runs as usize,
        most: (arguments.most * 1e6) as usize,
        kinds,
        count,
        turned: arguments.turned,
    };
    let mut specs = specs(arguments)?;
    if arguments.scene.is_empty() {
        specs.retain(|spec| spec.name == "conference");
    }
    specs.iter().try_for_each(|spec| instanced.scene(spec))
}

fn read(path: &Path) -> Result<Results, String> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    serde_json::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
}

/// Prints how the rows stand to the bars and writes what is asked for.
fn finish(results: &Results, arguments: &Arguments) -> Result<(), String> {
    result("");
    results.summary().iter().for_each(|line| result(line));
    if let Some(path) = &arguments.json {
        let json = serde_json::to_string_pretty(results).map_err(|error| error.to_string())?;
        write(path, &(json + "\n"))?;
    }
    if let Some(path) = &arguments.markdown {
        let page = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let spliced = crate::page::splice(&page, "kernel", &markdown::tables(results));
        write(path, &spliced.map_err(|error| format!("{}: {error}", path.display()))?)?;
    }
    Ok(())
}

/// What Embree calls the instruction set, if one is forced.
fn embree_isa(isa: Option<Isa>) -> Result<Option<&'static str>, String> {
    Ok(match isa {
        None => None,
        Some(Isa::Avx512) => Some("avx512"),
        Some(Isa::Avx2) => Some("avx2"),
        Some(Isa::Sse42) => Some("sse4.2"),
        Some(other) => {
            return Err(format!("{other} cannot be forced on both engines; take avx512, avx2 or sse4.2"));
        }
    })
}

fn specs(arguments: &Arguments) -> Result<Vec<Spec>, String> {
    let view = arguments.eye.zip(arguments.target).map(|(eye, target)| (eye, target, arguments.fov));
    let (standard, missing) = scenes::standard(arguments.terrain);
    if arguments.scene.is_empty() {
        if view.is_some() {
            return Err("--eye and --target need a --scene".into());
        }
        if !missing.is_empty() {
            let folder = scenes::scenes_folder();
            report(&format!("note: left out, for want of {}: {}", folder.display(), missing.join(", ")));
        }
        return Ok(standard);
    }
    let named = |name: &String| {
        let known = standard.iter().find(|spec| spec.name == *name).cloned();
        let builtin = || {
            let (name, _) = heliostat::builtin::names().iter().find(|(builtin, _)| builtin == name)?;
            Some(Spec { name: (*name).into(), source: Origin::Builtin(name), view: None, light: None })
        };
        let file = || {
            let path = PathBuf::from(name);
            let stem =
                path.file_stem().map_or_else(|| name.clone(), |stem| stem.to_string_lossy().into_owned());
            let source = if path.is_dir() { Origin::Folder(path) } else { Origin::File(path) };
            Spec { name: stem, source, view: None, light: None }
        };
        let mut spec = known.or_else(builtin).unwrap_or_else(file);
        spec.view = view.or(spec.view);
        spec
    };
    Ok(arguments.scene.iter().map(named).collect())
}
