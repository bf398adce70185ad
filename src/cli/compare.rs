//! `heliostat compare`: image error.

use std::path::{Path, PathBuf};

use heliostat::compare::{Comparison, Picture, compare};

use super::failure::Failure;
use super::{console, input};

#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The picture to judge
    a: PathBuf,
    /// The reference
    b: PathBuf,
    /// Box-blur both by N×N pixels first (odd)
    #[arg(long, value_name = "N", value_parser = odd)]
    blur: Option<u32>,
    /// Fail (exit code 1) when the relative mean squared error is larger
    #[arg(long, value_name = "X", value_parser = maximum)]
    max_relmse: Option<f64>,
    /// Write the result as JSON
    #[arg(long)]
    json: bool,
}

fn odd(text: &str) -> Result<u32, String> {
    let width = text.parse::<u32>().ok().filter(|n| !n.is_multiple_of(2) && *n < 1000);
    width.ok_or_else(|| format!("`{text}` is not a blur; give an odd number of pixels below 1000"))
}

fn maximum(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|x| x.is_finite() && *x >= 0.0);
    value.ok_or_else(|| format!("`{text}` is not an error; give a number of at least 0"))
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let blur = arguments.blur.unwrap_or(1);
    let read = |path: &Path| Ok::<_, Failure>(Picture::from_image(&input::picture(path)?).blurred(blur)?);
    let comparison = compare(&read(&arguments.a)?, &read(&arguments.b)?)?;
    if let Some(ev) = comparison.flip_exposure {
        console::message(&format!("note: for FLIP both pictures were tone mapped at {ev:+.2} EV"));
    }
    console::result(&if arguments.json { json(&comparison) } else { table(&comparison) })?;
    match arguments.max_relmse {
        Some(maximum) if comparison.relmse > maximum => {
            let relmse = comparison.relmse;
            Err(Failure::new(format!(
                "the relative mean squared error is {relmse:.6}, the maximum is {maximum}"
            )))
        }
        _ => Ok(()),
    }
}

/// The form that DESIGN promises to scripts; keys in its order.
fn json(c: &Comparison) -> String {
    let [a, b] = [c.mean_a, c.mean_b].map(|[r, g, b]| format!("[{r:e},{g:e},{b:e}]"));
    format!(
        r#"{{"rmse":{:e},"relmse":{:e},"flip":{:e},"mean_a":{a},"mean_b":{b}}}"#,
        c.rmse, c.relmse, c.flip
    )
}

fn table(c: &Comparison) -> String {
    let mean = |m: [f64; 3]| format!("{:.6} {:.6} {:.6}", m[0], m[1], m[2]);
    format!(
        "rmse    {:.6}\nrelmse  {:.6}\nflip    {:.6}\nmean A  {}\nmean B  {}",
        c.rmse,
        c.relmse,
        c.flip,
        mean(c.mean_a),
        mean(c.mean_b)
    )
}
