//! Frames of Instant Global Illumination: regions first, then, when all neighbours are there, the filter row by row, and
//! last, when all light is there, edges.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard};

use glam::Vec3;
use heliostat_scene::{BackendError, IgiOptions, Progress};
use heliostat_transport::{
    Fragment, Gathered, History, IgiFrame, IgiSettings, Light, Lit, PixelSum, Remembered, Settings, View,
};

use crate::film::{Film, renew};
use crate::meter::Metered;
use crate::queue::work_through;

/// What a frame is made in, kept from frame to frame.
#[derive(Default)]
pub(crate) struct Buffers {
    picture: Vec<Gathered>,
    fragments: Vec<Fragment>,
    /// Of all pixels, region by region.
    sums: Vec<PixelSum>,
    /// What falls on all pixels, row by row, and what comes back from them.
    lit: Vec<Light>,
    light: Vec<Vec3>,
    /// What each row leaves to the next frame.
    rows: Vec<Mutex<Vec<Remembered>>>,
    /// What frames before have left and no longer need.
    old: Vec<Remembered>,
}

impl Buffers {
    /// Makes room for a picture of this size.
    fn renew(&mut self, (width, height): (u32, u32)) {
        let pixels = width as usize * height as usize;
        renew(&mut self.picture, pixels);
        renew(&mut self.sums, pixels);
        renew(&mut self.light, pixels);
        renew(&mut self.lit, pixels);
        self.rows.resize_with(height as usize, Mutex::default);
        self.rows.iter().for_each(|row| {
            let mut row = locked(row);
            row.clear();
            row.reserve_exact(width as usize);
        });
        renew(&mut self.old, pixels);
        self.old.clear();
    }
}

/// Renders all passes into a film and returns the number of rays. If frames go on from each other, `history` is what the
/// frame before has left, and afterwards what this one leaves. `by_paths` takes a path from every point instead of virtual
/// point lights.
pub(crate) fn render(
    (pool, buffers): (&rayon::ThreadPool, &Mutex<Buffers>),
    view: &View<'_, Metered<'_>>,
    settings: &Settings,
    (options, film, progress): (&IgiOptions, &Film, &Progress),
    by_paths: bool,
    history: &mut Option<History>,
) -> Result<u64, BackendError> {
    let size = film.size();
    let before = history.as_ref().filter(|_| options.accumulate);
    let passes_before = before.map_or(0, |history| history.frames().wrapping_mul(settings.samples));
    let mut frame =
        pool.install(|| IgiFrame::new(view, settings, igi_settings(options, by_paths), passes_before));
    let regions = frame.regions(size.0, size.1);
    progress.start(regions.len() as u64 * u64::from(settings.samples));
    let rays = AtomicU64::new(0);
    let stop = || progress.is_cancelled();
    let pixels = size.0 as usize * size.1 as usize;
    let mut buffers = locked(buffers);
    buffers.renew(size);
    let Buffers { picture, fragments, sums, lit: falling, light, rows: remembered, old } = &mut *buffers;
    let mut rest = &mut sums[..];
    let sums: Vec<_> = regions
        .iter()
        .map(|region| Mutex::new(rest.split_off_mut(..region.area()).unwrap_or_default()))
        .collect();
    let rows: Vec<_> = light.chunks_mut(size.0.max(1) as usize).map(Mutex::new).collect();
    let lights: Vec<_> = (0..size.1).map(|_| Mutex::new(Vec::new())).collect();
    for pass in 0..settings.samples {
        rays.fetch_add(pool.install(|| frame.start(pass)), Ordering::Relaxed);
        fragments.clear();
        let shared = Mutex::new((&mut *picture, &mut *fragments));
        work_through(pool, regions.len(), &stop, &|index| {
            let region = &regions[index];
            let (gathered, split, traced) = frame.render(region, &mut locked(&sums[index]));
            rays.fetch_add(traced, Ordering::Relaxed);
            let (picture, fragments) = &mut *locked(&shared);
            let mut split = split.into_iter().peekable();
            for ((index, (x, y)), pixel) in (0..).zip(region.pixels()).zip(gathered) {
                let place = y * size.0 + x;
                picture[place as usize] = pixel;
                while let Some(fragment) = split.next_if(|fragment| fragment.pixel == index) {
                    fragments.push(fragment.at(place));
                }
            }
            progress.advance(1);
        })?;
        // Those of a pixel stay in their order.
        fragments.sort_by_key(|fragment| fragment.pixel);
        work_through(pool, rows.len(), &stop, &|y| {
            let mut memory = locked(&remembered[y]);
            memory.clear();
            let memory = options.accumulate.then_some(&mut *memory);
            *locked(&lights[y]) = frame.light(picture, size, y as u32, before, memory);
        })?;
        falling.clear();
        lights.iter().for_each(|row| falling.append(&mut locked(row)));
        if falling.len() < pixels {
            // Cancelled.
            break;
        }
        let lit = Lit { gathered: picture, lights: falling, fragments, size };
        work_through(pool, rows.len(), &stop, &|y| {
            let (colors, traced) = frame.row(&lit, y as u32);
            rays.fetch_add(traced, Ordering::Relaxed);
            locked(&rows[y]).iter_mut().zip(colors).for_each(|(sum, color)| *sum += color);
        })?;
    }
    for (region, sums) in regions.iter().zip(&sums) {
        film.store(region, &locked(sums));
    }
    for (y, row) in (0..).zip(&rows) {
        film.add_row(y, &locked(row));
    }
    if options.accumulate && !progress.is_cancelled() {
        let mut memory = std::mem::take(old);
        memory.reserve_exact(picture.len());
        remembered.iter().for_each(|row| memory.append(&mut locked(row)));
        match history {
            Some(history) => *old = history.advance(view.camera.clone(), size, memory),
            None => *history = Some(History::new(view.camera.clone(), size, memory)),
        }
    }
    Ok(rays.into_inner())
}

fn igi_settings(options: &IgiOptions, by_paths: bool) -> IgiSettings {
    IgiSettings {
        paths: options.paths,
        interleave: options.interleave,
        filter: options.filter,
        edges: options.edges,
        antialias: options.antialias,
        clamp: options.clamp,
        compensate: options.compensate,
        importance: options.importance,
        first_pass: options.first_pass,
        photons: options.photons,
        by_paths,
    }
}

/// What a lock holds; a thread that panicked while it held the lock left whole pixels behind.
fn locked<T>(lock: &Mutex<T>) -> MutexGuard<'_, T> {
    lock.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}
