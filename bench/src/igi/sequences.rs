//! Instant Global Illumination against path tracing with the same filter and history: error and flicker of frames that
//! follow each other, before a camera that stands still and one that moves slowly.

use std::fmt::Write as _;

use heliostat::compare::compare;
use heliostat::kernel::glam::{Affine3A, Vec3};
use heliostat::scene::{Backend, Camera, Frame, FrameRequest, IgiOptions, Plane, Progress};
use heliostat::shading::CameraRays;
use heliostat::shading::color::luminance;

use super::{Bench, Contender, engine, picture};
use crate::measure::median;

/// Frames of a sequence, and those of them that histories fill with.
const FRAMES: u32 = 16;
const FILLING: u32 = 8;
/// What the camera moves by with each frame, as a share of the box around the scene.
const STEP: f32 = 2e-4;
/// Points of another depth than this, as a share, are not the same.
const SAME: f32 = 0.01;
/// Surfaces that reflect less say little about the light on them.
const LEAST_ALBEDO: f32 = 0.02;

/// A row for each way to make frames, of a scene.
pub(super) fn table(bench: &mut Bench<'_>, scene: &str) -> Result<String, String> {
    let bounds = bench.engine.scene().bounds().ok_or("there is nothing to see")?;
    let step = STEP * bounds.max.distance(bounds.min);
    let moved = at(&bench.camera, step, FRAMES - 1);
    let references = [bench.reference.clone(), bench.refer(&moved)?];
    let mut table = String::from(
        "| frames | ms | relMSE, still | flicker, still | change, still | relMSE, moving | flicker, moving |\n|---|---:|---:|---:|---:|---:|---:|\n",
    );
    for (name, renderer, accumulate) in [
        ("`igi`, each from scratch", "igi", false),
        ("`igi`, going on", "igi", true),
        ("`path-filtered`, each from scratch", "path-filtered", false),
        ("`path-filtered`, going on", "path-filtered", true),
    ] {
        let igi = IgiOptions { accumulate, ..IgiOptions::default() };
        let contender = Contender::new("", renderer, 1, igi);
        let (mut times, mut cells) = (Vec::new(), String::new());
        for (reference, step) in references.iter().zip([0.0, step]) {
            // One that remembers nothing.
            bench.engine = engine(scene)?;
            let Played { frame, flicker, change } = play(bench, &contender, step, &mut times)?;
            let error = compare(&picture(&frame), reference).map_err(|error| error.to_string())?;
            let _ = write!(cells, " {:.4} | {:.2} % |", error.relmse, 100.0 * flicker);
            // The reference of pixels changes where the camera moves.
            if step == 0.0 {
                let _ = write!(cells, " {:.2} % |", 100.0 * change);
            }
        }
        let _ = writeln!(table, "| {name} | {:.0} |{cells}", median(&mut times));
    }
    Ok(table)
}

/// The camera after some steps to its right.
fn at(camera: &Camera, step: f32, frame: u32) -> Camera {
    let right = camera.world_from_camera.matrix3.x_axis.normalize_or_zero() * (step * frame as f32);
    let world_from_camera = Affine3A::from_translation(right.into()) * camera.world_from_camera;
    Camera { world_from_camera, ..camera.clone() }
}

/// What a sequence has shown.
struct Played {
    /// The last one.
    frame: Frame,
    /// Mean change from frame to frame of the light on points that both see, relative to it.
    flicker: f64,
    /// Mean absolute change of all pixels from frame to frame, relative to their mean.
    change: f64,
}

/// Renders a sequence.
fn play(
    bench: &mut Bench<'_>,
    contender: &Contender,
    step: f32,
    times: &mut Vec<f64>,
) -> Result<Played, String> {
    let mut before: Option<(Frame, CameraRays)> = None;
    let (mut points, mut pixels) = (Changes::default(), Changes::default());
    for number in 0..FRAMES {
        let camera = at(&bench.camera, step, number);
        let request = FrameRequest {
            frame: number,
            planes: vec![Plane::Position, Plane::Albedo],
            camera: camera.clone(),
            ..bench.request(contender, 0)
        };
        let frame = bench.engine.render(&request, &Progress::new()).map_err(|error| error.to_string())?;
        times.push(frame.stats.milliseconds);
        let rays = CameraRays::new(&camera, frame.width, frame.height);
        if let Some((before, rays)) = before.as_ref().filter(|_| number >= FILLING) {
            points.add_points(&frame, before, rays);
            let colors = frame.color.iter().zip(&before.color);
            colors.for_each(|(now, then)| pixels.add(luminance(*now), luminance(*then)));
        }
        before = Some((frame, rays));
    }
    let (frame, _) = before.ok_or("no frames")?;
    Ok(Played { frame, flicker: points.relative(), change: pixels.relative() })
}

/// By how much light differs between frames, and that light.
#[derive(Default)]
struct Changes {
    change: f64,
    light: f64,
}

impl Changes {
    fn add(&mut self, now: f32, then: f32) {
        self.change += f64::from((now - then).abs());
        self.light += f64::from(now);
    }

    /// Adds the light on all points that two frames see.
    fn add_points(&mut self, frame: &Frame, before: &Frame, rays: &CameraRays) {
        for index in 0..frame.color.len() {
            let Some((position, now)) = lit(frame, index) else { continue };
            let Some(place) = rays.project(position) else { continue };
            let (x, y) = (place.x.floor(), place.y.floor());
            if x < 0.0 || y < 0.0 || x >= before.width as f32 || y >= before.height as f32 {
                continue;
            }
            let other = y as usize * before.width as usize + x as usize;
            let Some((other, then)) = lit(before, other) else { continue };
            if other.distance(position) < SAME * position.distance(rays.position()) {
                self.add(now, then);
            }
        }
    }

    fn relative(&self) -> f64 {
        if self.light > 0.0 { self.change / self.light } else { 0.0 }
    }
}

/// The point that a pixel sees, and the luminance that it reflects of white light's: its light apart from its colour.
fn lit(frame: &Frame, index: usize) -> Option<(Vec3, f32)> {
    let plane = |which: usize| Vec3::from_slice(&frame.planes[which].values[3 * index..]);
    let (position, albedo) = (plane(0), luminance(plane(1)));
    (albedo > LEAST_ALBEDO).then(|| (position, luminance(frame.color[index]) / albedo))
}
