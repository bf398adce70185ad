//! Programs that measure and show: peers side by side, the report's tables as ratios, pictures of whole folders.
//!
//! ```text
//! cargo run --release -p heliostat-bench -- contact-sheet FOLDER -o FILE.png
//! cargo run --release -p heliostat-bench -- frame [--scene NAME|FILE …] [--renderer NAME …]
//! cargo run --release -p heliostat-bench -- gallery [--docs FOLDER] [NAME…]
//! cargo run --release -p heliostat-bench -- igi [--scene NAME|FILE …] [--page FILE]
//! cargo run --release -p heliostat-bench -- kernel [--scene NAME|FILE] [--json FILE]
//! cargo run --release -p heliostat-bench -- motion alternatives|edits|grouping|instancing|play …
//! cargo run --release -p heliostat-bench -- shading [--scene NAME|FILE …] [--json FILE]
//! ```

mod chart;
mod contact_sheet;
mod flatten;
mod frame;
mod gallery;
mod igi;
mod kernel;
mod measure;
mod motion;
mod page;
mod shading;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

#[derive(Debug, Parser)]
#[command(name = "heliostat-bench")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Render every glTF, OBJ and PLY file below a folder and put the pictures on one sheet
    ContactSheet {
        /// Searched with everything below it
        folder: PathBuf,
        /// The sheet, a PNG
        #[arg(short, long, default_value = "contact-sheet.png")]
        output: PathBuf,
        /// Samples per pixel
        #[arg(long, default_value_t = 16)]
        spp: u32,
        /// Of the files in one folder, show only the first few
        #[arg(long, default_value_t = 8)]
        per_folder: usize,
    },
    /// What a frame takes: rays, their share of the time, threads, lanes
    Frame(frame::Arguments),
    /// Render every surface shader on a stand and write the page that describes them
    Gallery(gallery::Arguments),
    /// Error and time of Instant Global Illumination beside its ancestor and path tracing
    Igi(igi::Arguments),
    /// Rays per second of the kernel and of Embree, side by side on the same scenes and rays
    Kernel(Box<kernel::Arguments>),
    /// What motion costs: edits, instances, deforming meshes, animated scenes
    #[command(subcommand)]
    Motion(motion::Command),
    /// What shading costs: against tracing alone, with 32 shaders at once, one by one, in a plug-in
    Shading(shading::Arguments),
}

fn main() -> ExitCode {
    let done = match Arguments::parse().command {
        Command::ContactSheet { folder, output, spp, per_folder } => {
            contact_sheet::run(&folder, &output, spp, per_folder)
        }
        Command::Frame(arguments) => frame::run(&arguments),
        Command::Gallery(arguments) => gallery::run(&arguments),
        Command::Igi(arguments) => igi::run(&arguments),
        Command::Kernel(arguments) => kernel::run(&arguments),
        Command::Motion(command) => motion::run(&command),
        Command::Shading(arguments) => shading::run(&arguments),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            report(&format!("error: {message}"));
            ExitCode::FAILURE
        }
    }
}

#[expect(clippy::print_stderr, reason = "messages of a program go to stderr")]
fn report(message: &str) {
    eprintln!("{message}");
}

#[expect(clippy::print_stdout, reason = "results of a program go to stdout")]
fn result(line: &str) {
    println!("{line}");
}
