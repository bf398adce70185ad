//! `heliostat photometry`: luminous intensity over angle, as a table and as a picture.

use std::fmt::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use heliostat::engine::{Engine, EngineOptions, Photometry, PhotometryRequest};
use heliostat::formats::image::encode_png;
use heliostat::scene::{Backend, Scene};
use serde_json::json;

use super::failure::Failure;
use super::values::Size;
use super::{console, input, output};

/// Decades of intensity below the peak that the picture shows.
const DECADES: f64 = 4.0;
/// The picture is enlarged until it is about as wide, pixels.
const WIDTH: u32 = 720;

#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// A file or the name of a built-in scene; its lamp aims along −Z, +Y is up
    scene: String,
    /// The table, a .csv file of candela over H and V; a picture of it goes beside it as .png
    #[arg(short, long, value_name = "FILE.csv", value_parser = table_file)]
    output: Option<PathBuf>,
    /// Bins over the horizontal angle H and the vertical angle V
    #[arg(long, value_name = "HxV", default_value = "180x90")]
    bins: Size,
    /// Degrees to either side of −Z that the bins cover; 180,90 is all directions
    #[arg(long, value_name = "H,V", default_value = "180,90", value_parser = window)]
    window: [f64; 2],
    /// Particles of light to follow
    #[arg(long, value_name = "N", default_value_t = 4_000_000)]
    particles: u64,
    /// Surfaces that a particle may meet before it is given up
    #[arg(long, value_name = "N", default_value_t = 64)]
    max_depth: u32,
    /// Lumens that stand for a watt of the scene's light; 1 if the scene's numbers are photometric already
    #[arg(long, value_name = "X", default_value_t = 683.0, value_parser = efficacy)]
    lumens_per_watt: f64,
    /// Threads to work with [default: one per core]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Another seed gives other noise
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u32,
    /// Write the totals as JSON
    #[arg(long)]
    json: bool,
}

fn table_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let csv = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    if csv { Ok(path) } else { Err(format!("`{text}` is no table; end the name in .csv")) }
}

fn window(text: &str) -> Result<[f64; 2], String> {
    let wrong = || format!("`{text}` is no window; write H,V in degrees, up to 180,90");
    let (h, v) = text.split_once(',').ok_or_else(wrong)?;
    let angle = |text: &str, most: f64| {
        let degrees = text.trim().parse::<f64>().ok().filter(|d| *d > 0.0 && *d <= most);
        degrees.map(f64::to_radians).ok_or_else(wrong)
    };
    Ok([angle(h, 180.0)?, angle(v, 90.0)?])
}

fn efficacy(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|x| x.is_finite() && *x > 0.0);
    value.ok_or_else(|| format!("`{text}` is no efficacy; give a positive number of lumens per watt"))
}

pub(super) fn run(arguments: Arguments) -> Result<(), Failure> {
    let source = input::scene(&arguments.scene, &input::Reading::default())?;
    Scene::default().apply(&source.edits)?;
    let options = EngineOptions {
        threads: arguments.threads.and_then(|n| NonZeroUsize::new(n.into())),
        ..EngineOptions::default()
    };
    let request = PhotometryRequest {
        particles: arguments.particles,
        bins: [arguments.bins.width, arguments.bins.height],
        window: arguments.window,
        max_edges: arguments.max_depth,
        seed: arguments.seed,
    };
    let edits = source.edits;
    let found = console::with_progress("measuring", move |progress| {
        let mut engine = Engine::new(options)?;
        engine.apply(&edits, progress)?;
        Ok(engine.photometry(&request, progress)?)
    })?;
    let efficacy = arguments.lumens_per_watt;
    console::result(&if arguments.json {
        totals_json(&found, efficacy).to_string()
    } else {
        totals(&found, efficacy)
    })?;
    if let Some(path) = &arguments.output {
        write(path, &found, efficacy)?;
    }
    Ok(())
}

/// Lumens of a flux in watts.
fn lumens(flux: DVec3, efficacy: f64) -> f64 {
    flux.dot(DVec3::new(0.2126, 0.7152, 0.0722)) * efficacy
}

/// How much of what was sent is accounted for; the rest is the noise of Russian roulette.
fn accounted(found: &Photometry) -> f64 {
    let flux = &found.flux;
    lumens(flux.left + flux.absorbed + flux.given_up, 1.0) / lumens(flux.emitted, 1.0)
}

fn totals(found: &Photometry, efficacy: f64) -> String {
    let emitted = lumens(found.flux.emitted, efficacy);
    let line = |name: &str, flux: DVec3| {
        let flux = lumens(flux, efficacy);
        format!("{name:<13} {flux:.2} lm ({:.2} %)", 100.0 * flux / emitted)
    };
    let (column, row, peak) = found.peak();
    let [h, v] = found.angles(column, row).map(f64::to_degrees);
    let mut lines = vec![
        line("emitted", found.flux.emitted),
        line("left", found.flux.left),
        line("absorbed", found.flux.absorbed),
        line("given up", found.flux.given_up),
        format!("accounted for {:.3} %", 100.0 * accounted(found)),
        format!("peak          {:.1} cd at H {h:+.2}°, V {v:+.2}°", peak * efficacy),
        format!("particles     {}, {} rays", found.particles, found.rays),
    ];
    if found.flux.from_afar != DVec3::ZERO {
        lines.push("left out      light from infinitely far away, which has no intensity".into());
    }
    lines.join("\n")
}

fn totals_json(found: &Photometry, efficacy: f64) -> serde_json::Value {
    let (column, row, peak) = found.peak();
    let [h, v] = found.angles(column, row).map(f64::to_degrees);
    json!({
        "emitted_lm": lumens(found.flux.emitted, efficacy),
        "left_lm": lumens(found.flux.left, efficacy),
        "absorbed_lm": lumens(found.flux.absorbed, efficacy),
        "given_up_lm": lumens(found.flux.given_up, efficacy),
        "accounted_for": accounted(found),
        "peak_cd": peak * efficacy,
        "peak_h_degrees": h,
        "peak_v_degrees": v,
        "particles": found.particles,
        "rays": found.rays,
    })
}

/// The table, and the picture beside it.
fn write(path: &Path, found: &Photometry, efficacy: f64) -> Result<(), Failure> {
    output::write(path, table(found, efficacy).as_bytes())?;
    let (width, height, rgb) = picture(found);
    let beside = path.with_extension("png");
    output::write(&beside, &encode_png(width, height, &rgb)?)?;
    console::message(&format!("wrote {}, {}", path.display(), beside.display()));
    Ok(())
}

/// Candela: a column for each H, a row for each V, both in degrees.
fn table(found: &Photometry, efficacy: f64) -> String {
    let [columns, rows] = found.bins;
    let mut text = String::from("V\\H");
    // Writing to a string cannot fail.
    for column in 0..columns {
        _ = write!(text, ",{:.4}", found.angles(column, 0)[0].to_degrees());
    }
    text.push('\n');
    for row in 0..rows {
        _ = write!(text, "{:.4}", found.angles(0, row)[1].to_degrees());
        for column in 0..columns {
            let intensity = found.intensity[(row * columns + column) as usize];
            _ = write!(text, ",{:.6e}", intensity * efficacy);
        }
        text.push('\n');
    }
    text
}

/// False colours over the logarithm of intensity, [`DECADES`] below the peak and above; H to the right, V up.
fn picture(found: &Photometry) -> (u32, u32, Vec<u8>) {
    let [columns, rows] = found.bins;
    let enlarge = (WIDTH / columns).max(1);
    let peak = found.peak().2.max(f64::MIN_POSITIVE);
    let (width, height) = (columns * enlarge, rows * enlarge);
    let mut rgb = Vec::with_capacity((width * height * 3) as usize);
    for y in 0..height {
        let row = rows - 1 - y / enlarge;
        for x in 0..width {
            let intensity = found.intensity[(row * columns + x / enlarge) as usize];
            let level = 1.0 + (intensity / peak).log10() / DECADES;
            rgb.extend(false_color(level.clamp(0.0, 1.0) as f32));
        }
    }
    (width, height, rgb)
}

/// Black, blue, violet, red, yellow, white for 0 to 1.
fn false_color(level: f32) -> [u8; 3] {
    const COLORS: [Vec3; 6] = [
        Vec3::ZERO,
        Vec3::new(0.08, 0.10, 0.45),
        Vec3::new(0.50, 0.10, 0.55),
        Vec3::new(0.90, 0.25, 0.20),
        Vec3::new(0.99, 0.80, 0.20),
        Vec3::ONE,
    ];
    let at = level * (COLORS.len() - 1) as f32;
    let below = (at as usize).min(COLORS.len() - 2);
    let color = COLORS[below].lerp(COLORS[below + 1], at - below as f32);
    color.to_array().map(|channel| (255.0 * channel + 0.5) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_and_names_are_checked() {
        assert_eq!(window("180,90"), Ok([std::f64::consts::PI, std::f64::consts::FRAC_PI_2]));
        for bad in ["", "30", "181,10", "10,91", "0,10", "a,b"] {
            assert!(window(bad).is_err(), "{bad}");
        }
        assert!(table_file("lamp.csv").is_ok() && table_file("lamp.png").is_err());
        assert!(efficacy("683").is_ok() && efficacy("0").is_err());
    }

    #[test]
    fn tables_have_a_row_for_each_vertical_angle() {
        let found = Photometry {
            bins: [2, 3],
            window: [0.2, 0.3],
            intensity: vec![1.0, 0.0, 2.0, 0.0, 3.0, 0.5],
            flux: heliostat::engine::FluxBalance::default(),
            particles: 1,
            rays: 1,
        };
        let text = table(&found, 2.0);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len(), 4);
        assert!(lines[3].ends_with(",6.000000e0,1.000000e0"), "{text}");
        let (width, height, rgb) = picture(&found);
        assert_eq!((width, height, rgb.len()), (720, 1080, 720 * 1080 * 3));
        // The strongest is in the highest row, that is on top.
        assert_eq!(rgb[..3], [255, 255, 255]);
    }
}
