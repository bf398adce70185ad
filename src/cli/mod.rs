//! The command line: what can be asked, and who answers it.
//!
//! Results go to stdout, messages and progress to stderr. Exit codes: 0 done, 1 the work failed, 2 the command line
//! was wrong.

mod camera;
mod compare;
mod console;
mod failure;
mod host;
mod info;
mod input;
mod output;
mod photometry;
mod pictures;
mod playback;
mod render;
mod scenes;
mod sequence;
mod statistics;
mod values;
mod view;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Real-time ray tracing and interactive global illumination.
#[derive(Debug, Parser)]
#[command(name = "heliostat", version, arg_required_else_help = false)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make a picture and write it to a file
    Render(Box<render::Arguments>),
    /// Tell what a scene holds
    Info(info::Arguments),
    /// Measure how far picture A is from the reference B
    Compare(compare::Arguments),
    /// Measure how strongly a scene's lights shine in which direction, through its mirrors and lenses
    Photometry(photometry::Arguments),
    /// List the built-in scenes, which every command takes by name
    Scenes(scenes::Arguments),
    /// Show a scene in a window and change it; without a display on a web page
    View(view::Arguments),
    /// Show a scene on a web page and change it
    Serve(view::ServeArguments),
}

/// Parses the command line, does the work, and says how it went.
pub(crate) fn run() -> ExitCode {
    let arguments = Arguments::parse();
    console::watch_for_interrupt();
    let result = match arguments.command {
        None => view::run_default(),
        Some(Command::Render(arguments)) => render::run(*arguments),
        Some(Command::Info(arguments)) => info::run(&arguments),
        Some(Command::Compare(arguments)) => compare::run(&arguments),
        Some(Command::Photometry(arguments)) => photometry::run(arguments),
        Some(Command::Scenes(arguments)) => scenes::run(&arguments),
        Some(Command::View(arguments)) => view::run(&arguments),
        Some(Command::Serve(arguments)) => view::run_server(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            console::report(&failure);
            failure.exit_code()
        }
    }
}
