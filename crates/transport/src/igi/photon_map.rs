//! Density of photons at points: a grid for each of several radii, hashed into one table.
//!
//! Where photons are dense they spread their light over small discs, elsewhere over large ones: the radius of a photon is
//! the edge of the smallest cell, in a hierarchy of grids, that holds a few dozen of them.
//!
//! # References
//! Silverman, "Density Estimation for Statistics and Data Analysis", 1986, §5.3 (adaptive kernels). Knaus, Zwicker,
//! "Progressive Photon Mapping: A Probabilistic Approach", 2011 (radii from pass to pass).

use std::f32::consts::PI;

use glam::{IVec3, Vec3};
use heliostat_kernel::Aabb;
use heliostat_shading::color::luminance;
use heliostat_shading::lanes::Whole;

use super::photons::Photon;

/// Times the mean, the most that a photon carries in the first pass.
const BRIGHTEST: f32 = 12.0;
/// Radii: the largest, and each half the one before.
const LEVELS: usize = 8;
/// Photons in a cell that is fine enough.
const ENOUGH: u32 = 12;
/// The largest radius as a share of the box around all photons and the scene.
const LARGEST: f32 = 1.0 / 24.0;
/// Photons of surfaces that face another way by more than this cosine are no neighbours.
const LEAST_COSINE: f32 = 0.8;
/// How far off a point's plane photons may lie, in radii.
const THICKNESS: f32 = 0.25;

/// Light of photons at a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Caught {
    /// W/m².
    pub(super) irradiance: Vec3,
    /// Unit vector towards where one of them came from, chosen by its light.
    pub(super) wi: Vec3,
    /// Irradiance, W/m², that this one stands for: in the mean over the choice each photon has its own.
    pub(super) from_there: Vec3,
}

/// Photons with their discs, found by place.
#[derive(Debug, Default)]
pub(super) struct PhotonMap {
    photons: Vec<Photon>,
    /// Level of each photon.
    levels: Vec<u8>,
    /// Which levels have photons.
    used: [bool; LEVELS],
    /// Radius of the largest disc, metres.
    largest: f32,
    /// Start of each bucket in `entries`.
    buckets: Vec<u32>,
    /// Photons by bucket.
    entries: Vec<u32>,
    /// Where discs are.
    bounds: Option<Aabb>,
}

impl PhotonMap {
    /// Of the photons of a pass in a scene of some extent (metres).
    pub(super) fn new(mut photons: Vec<Photon>, extent: f32, pass: u32) -> Self {
        let largest = extent * LARGEST * shrinkage(pass);
        if photons.is_empty() || !(largest.is_finite() && largest > 0.0) {
            return Self::default();
        }
        bound(&mut photons, pass);
        let mut map = Self { photons, largest, ..Self::default() };
        map.levels = map.choose_levels(extent * LARGEST);
        for &level in &map.levels {
            map.used[usize::from(level)] = true;
        }
        let bounds = Aabb::from_points(map.photons.iter().map(|photon| photon.position));
        let margin = Vec3::splat(largest);
        map.bounds = Some(Aabb { min: bounds.min - margin, max: bounds.max + margin });
        map.fill();
        map
    }

    /// The finest level on which a photon's cell holds enough of them.
    fn choose_levels(&self, largest: f32) -> Vec<u8> {
        let mask = (self.photons.len() * 2).next_power_of_two() as u32 - 1;
        let mut levels = vec![0; self.photons.len()];
        let mut counts = vec![0_u32; mask as usize + 1];
        for level in 1..LEVELS {
            counts.fill(0);
            let edge = largest / (1 << level) as f32;
            let bucket = |photon: &Photon| (hash(cell(photon.position, edge), level) & mask) as usize;
            for photon in &self.photons {
                counts[bucket(photon)] += 1;
            }
            for (photon, at) in self.photons.iter().zip(&mut levels) {
                if counts[bucket(photon)] >= ENOUGH && usize::from(*at) == level - 1 {
                    *at = level as u8;
                }
            }
        }
        levels
    }

    fn radius(&self, level: usize) -> f32 {
        self.largest / (1 << level) as f32
    }

    /// Enters every photon into all cells that its disc may touch; cells are two radii wide.
    fn fill(&mut self) {
        let mask = (self.photons.len() * 4).next_power_of_two() as u32 - 1;
        let mut pairs = Vec::with_capacity(self.photons.len() * 4);
        for (index, (photon, &level)) in (0..).zip(self.photons.iter().zip(&self.levels)) {
            let radius = self.radius(level.into());
            let low = cell(photon.position - radius, 2.0 * radius);
            let high = cell(photon.position + radius, 2.0 * radius);
            let first = pairs.len();
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    for x in low.x..=high.x {
                        let bucket = hash(IVec3::new(x, y, z), level.into()) & mask;
                        // Two of its cells may share a bucket; it must be found once.
                        if !pairs[first..].contains(&(bucket, index)) {
                            pairs.push((bucket, index));
                        }
                    }
                }
            }
        }
        self.buckets = vec![0; mask as usize + 2];
        for &(bucket, _) in &pairs {
            self.buckets[bucket as usize + 1] += 1;
        }
        for i in 1..self.buckets.len() {
            self.buckets[i] += self.buckets[i - 1];
        }
        let mut next = self.buckets.clone();
        self.entries = vec![0; pairs.len()];
        for (bucket, index) in pairs {
            let place = &mut next[bucket as usize];
            self.entries[*place as usize] = index;
            *place += 1;
        }
    }

    /// What arrives at a point of unit normal by paths of at most `max_edges` edges; `u` in [0, 1) chooses the direction.
    pub(super) fn caught(&self, position: Vec3, normal: Vec3, max_edges: u32, mut u: f32) -> Caught {
        let mut caught = Caught::default();
        if !self.bounds.is_some_and(|bounds| bounds.contains(position)) {
            return caught;
        }
        let mut total = 0.0;
        let mask = self.buckets.len() as u32 - 2;
        for level in (0..LEVELS).filter(|&level| self.used[level]) {
            let radius = self.radius(level);
            let (radius2, thickness) = (radius * radius, THICKNESS * radius);
            let bucket = (hash(cell(position, 2.0 * radius), level) & mask) as usize;
            let entries = self.buckets[bucket] as usize..self.buckets[bucket + 1] as usize;
            for &index in &self.entries[entries] {
                let photon = &self.photons[index as usize];
                let offset = photon.position - position;
                let distance2 = offset.length_squared();
                let near = distance2 < radius2 && offset.dot(normal).abs() < thickness;
                // Photons of other levels are here because their cells share the bucket.
                let own = usize::from(self.levels[index as usize]) == level;
                if near && own && photon.normal.dot(normal) > LEAST_COSINE && photon.edges <= max_edges {
                    // Epanechnikov's kernel over the disc.
                    let share = photon.flux * (2.0 / (PI * radius2) * (1.0 - distance2 / radius2));
                    caught.irradiance += share;
                    // One number chooses among all in proportion to their light: it is stretched again each time.
                    let weight = luminance(share);
                    if weight > 0.0 {
                        total += weight;
                        let chance = weight / total;
                        if u < chance {
                            u /= chance;
                            (caught.wi, caught.from_there) = (photon.wi, share / weight);
                        } else {
                            u = ((u - chance) / (1.0 - chance)).min(1.0 - f32::EPSILON);
                        }
                    }
                }
            }
        }
        caught.from_there *= total;
        caught
    }
}

/// Bounds what a photon carries to a multiple of the mean, which grows from pass to pass: a rare one that stands for much light
/// would be a bright spot in the first picture, and the mean of many passes loses nothing.
fn bound(photons: &mut [Photon], pass: u32) {
    let mean = photons.iter().map(|photon| luminance(photon.flux)).sum::<f32>() / photons.len().max(1) as f32;
    let most = BRIGHTEST * mean * (pass as f32 + 1.0);
    for photon in photons {
        let flux = luminance(photon.flux);
        if flux > most {
            photon.flux *= most / flux;
        }
    }
}

/// How much smaller radii are in a pass than in the first: so that the mean of all passes loses both noise and blur.
/// Equation 15 of Knaus and Zwicker with α = 2/3.
fn shrinkage(pass: u32) -> f32 {
    let squared: f32 = (1..=pass).map(|i| (i as f32 + 2.0 / 3.0) / (i as f32 + 1.0)).product();
    squared.sqrt()
}

fn cell(position: Vec3, edge: f32) -> IVec3 {
    (position / edge).floor().as_ivec3()
}

fn hash(cell: IVec3, level: usize) -> u32 {
    let x = (cell.x as u32 ^ (level as u32) << 28).hashed();
    let y = (x ^ cell.y as u32).hashed();
    (y ^ cell.z as u32).hashed()
}

#[cfg(test)]
mod tests {
    use super::*;
    use heliostat_shading::Sampler;

    fn even(count: u32) -> Vec<Photon> {
        let at = |i| {
            let [u, v, ..] = Sampler::along(i, 3).set(0);
            Photon {
                position: Vec3::new(u, 0.3, v),
                normal: Vec3::Y,
                wi: if v < 0.5 { Vec3::Y } else { Vec3::X },
                flux: Vec3::new(1.0, 2.0, 3.0) / count as f32,
                edges: 3,
            }
        };
        (0..count).map(at).collect()
    }

    #[test]
    fn even_light_is_even() {
        for pass in [0, 7] {
            let map = PhotonMap::new(even(20_000), 2.0, pass);
            let at = |x: f32, z: f32| map.caught(Vec3::new(x, 0.3, z), Vec3::Y, 3, 0.5).irradiance;
            let points =
                || (0..400).map(|i| (0.2 + 0.6 * (i % 20) as f32 / 19.0, 0.2 + 0.6 * (i / 20) as f32 / 19.0));
            let mean = points().map(|(x, z)| at(x, z)).sum::<Vec3>() / 400.0;
            assert!(mean.abs_diff_eq(Vec3::new(1.0, 2.0, 3.0), 0.03), "W/m² of 1, 2, 3 W on 1 m²: {mean}");
            assert!(points().all(|(x, z)| (at(x, z).x - 1.0).abs() < 0.6));
        }
    }

    #[test]
    fn directions_are_chosen_by_their_light() {
        let mut photons = even(20_000);
        photons.iter_mut().filter(|photon| photon.wi == Vec3::X).for_each(|photon| photon.flux.x *= 3.0);
        let map = PhotonMap::new(photons, 2.0, 0);
        // Where light of either direction arrives.
        let at = Vec3::new(0.5, 0.3, 0.5);
        let n = 10_000;
        let caught = |i| map.caught(at, Vec3::Y, 3, (i as f32 + 0.5) / n as f32);
        let mean = |wi| {
            let of = (0..n).map(caught).filter(|caught| caught.wi == wi);
            of.map(|caught| caught.from_there).sum::<Vec3>() / n as f32
        };
        let (above, beside) = (mean(Vec3::Y), mean(Vec3::X));
        assert!((above + beside).abs_diff_eq(caught(0).irradiance, 0.01), "all that arrives");
        for (light, ratio) in [(above, 2.0), (beside, 2.0 / 3.0)] {
            assert!((light.y / light.x / ratio - 1.0).abs() < 0.01, "{light}");
        }
    }

    #[test]
    fn light_stays_on_its_surface() {
        let map = PhotonMap::new(even(5_000), 2.0, 0);
        let at = |position, normal, max_edges| map.caught(position, normal, max_edges, 0.5).irradiance;
        assert_eq!(at(Vec3::new(0.5, 0.3, 0.5), Vec3::NEG_Y, 9), Vec3::ZERO, "the back");
        assert_eq!(at(Vec3::new(0.5, 0.5, 0.5), Vec3::Y, 9), Vec3::ZERO, "another plane");
        assert_eq!(at(Vec3::new(0.5, 0.3, 0.5), Vec3::Y, 2), Vec3::ZERO, "paths that are too long");
        assert_eq!(at(Vec3::new(5.0, 0.3, 0.5), Vec3::Y, 9), Vec3::ZERO, "far away");
    }

    #[test]
    fn a_photon_that_outshines_all_is_bounded_at_first() {
        for (pass, expected) in [(0, 12.0), (1, 24.0), (1000, 1000.0)] {
            let mut photons = even(999);
            photons.iter_mut().for_each(|photon| photon.flux = Vec3::ONE);
            photons.push(Photon { flux: Vec3::splat(1000.0), ..photons[0] });
            bound(&mut photons, pass);
            // The mean is 2.
            let brightest = photons[999].flux.x;
            assert!(
                (brightest / (expected * 1.999_f32).min(1000.0) - 1.0).abs() < 1e-3,
                "{pass}: {brightest}"
            );
            assert!(photons[..999].iter().all(|photon| photon.flux == Vec3::ONE));
        }
    }

    #[test]
    fn dense_light_is_sharp() {
        // All light in a patch of a hundredth of the area, seen from a little beside it.
        let mut photons = even(20_000);
        photons.iter_mut().for_each(|photon| photon.position *= Vec3::new(0.1, 1.0, 0.1));
        let map = PhotonMap::new(photons, 2.0, 0);
        let inside = map.caught(Vec3::new(0.05, 0.3, 0.05), Vec3::Y, 9, 0.5).irradiance.x;
        assert!((inside - 100.0).abs() < 20.0, "{inside}");
        assert_eq!(map.caught(Vec3::new(0.12, 0.3, 0.05), Vec3::Y, 9, 0.5), Caught::default());
    }
}
