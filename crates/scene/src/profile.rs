//! Measured lights: luminous intensity over direction, as goniophotometers tabulate it.

use std::f64::consts::{PI, TAU};

use glam::{Mat3, Vec3};

/// Intensity over direction: a table between whose angles it is interpolated linearly, and outside of which it is zero.
///
/// Directions have a polar angle from the table's pole and an azimuth around it. In light space, where the light aims
/// along −Z, the three systems of goniophotometry put the pole in different places; [`Photometry`] has them.
///
/// # References
/// ANSI/IESNA LM-63-2002, "Standard File Format for the Electronic Transfer of Photometric Data", sections 3 and 5;
/// Khronos glTF extension EXT_lights_ies, "Coordinate System Mapping".
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Where the pole is.
    pub photometry: Photometry,
    /// Polar angles, ascending, radians from 0 to π; at least two.
    pub polar: Vec<f32>,
    /// Azimuths, ascending, radians, over at most a full turn; a single one stands for all.
    pub azimuth: Vec<f32>,
    /// Candela (counted as W/sr), at least 0: for each azimuth those of all polar angles.
    pub intensity: Vec<f32>,
}

/// The system of angles of a [`Profile`]: where the pole and azimuth zero lie in light space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Photometry {
    /// Planes through a vertical axis (cars): the pole is +X, which is up; azimuth runs clockwise, seen from above.
    A,
    /// Planes through a horizontal axis (floodlights): the pole is −Y, to the right; azimuth rises towards +X, up.
    B,
    /// Planes through the axis of aim (most luminaires): the pole is −Z, azimuth runs from +X to +Y.
    C,
}

impl Photometry {
    /// Its axes in light space: of azimuth 0 and a quarter turn (at right angles to the pole), and the pole.
    pub fn light_from_profile(self) -> Mat3 {
        match self {
            Self::A => Mat3::from_cols(Vec3::NEG_Z, Vec3::NEG_Y, Vec3::X),
            Self::B => Mat3::from_cols(Vec3::NEG_Z, Vec3::X, Vec3::NEG_Y),
            Self::C => Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::NEG_Z),
        }
    }
}

/// A patch of directions between neighbouring angles of a [`Profile`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileCell {
    /// Polar angles, radians.
    pub polar: [f32; 2],
    /// Azimuths, radians.
    pub azimuth: [f32; 2],
    /// What leaves through it, lm (counted as W).
    pub flux: f64,
}

impl Profile {
    /// Most entries of a table.
    pub const MAX_ENTRIES: usize = 1 << 22;

    /// The same intensity in all directions.
    pub fn uniform(intensity: f32) -> Self {
        let (photometry, azimuth) = (Photometry::C, vec![0.0]);
        let polar = vec![0.0, std::f32::consts::PI];
        Self { photometry, polar, azimuth, intensity: vec![intensity; 2] }
    }

    /// Intensity at a polar angle and an azimuth in radians, of any turn.
    pub fn at(&self, polar: f32, azimuth: f32) -> f32 {
        let Some((row, rest)) = bracket(&self.polar, polar) else { return 0.0 };
        let rows = self.polar.len();
        let column = |column: usize| {
            let values = &self.intensity[column * rows..];
            between(values[row], values[(row + 1).min(rows - 1)], rest)
        };
        let [first, .., last] = self.azimuth[..] else { return column(0) };
        let turn = std::f32::consts::TAU;
        let mut angle = first + (azimuth - first).rem_euclid(turn);
        // Where the table closes, rounding must not leave a gap.
        if last - first > turn - 1e-4 {
            angle = angle.min(last);
        }
        let Some((index, rest)) = bracket(&self.azimuth, angle) else { return 0.0 };
        between(column(index), column((index + 1).min(self.azimuth.len() - 1)), rest)
    }

    /// The table's patches, azimuth by azimuth, each with its flux in closed form.
    pub fn cells(&self) -> impl Iterator<Item = ProfileCell> + '_ {
        let rows = self.polar.len();
        // A single azimuth stands for a whole turn.
        let turns = if self.azimuth.len() == 1 { 1 } else { self.azimuth.len() - 1 };
        (0..turns).flat_map(move |a| {
            let next = (a + 1) % self.azimuth.len();
            let azimuth = match self.azimuth.len() {
                1 => [self.azimuth[0], self.azimuth[0] + std::f32::consts::TAU],
                _ => [self.azimuth[a], self.azimuth[next]],
            };
            let width = if self.azimuth.len() == 1 { TAU } else { f64::from(azimuth[1] - azimuth[0]) };
            let mean = move |p: usize| {
                0.5 * (f64::from(self.intensity[a * rows + p]) + f64::from(self.intensity[next * rows + p]))
            };
            (0..rows - 1).map(move |p| {
                let polar = [self.polar[p], self.polar[p + 1]];
                let flux = width * ring(polar.map(f64::from), [mean(p), mean(p + 1)]);
                ProfileCell { polar, azimuth, flux }
            })
        })
    }

    /// All that it sends, lm (counted as W): the integral of the intensity.
    pub fn flux(&self) -> f64 {
        self.cells().map(|cell| cell.flux).sum()
    }

    /// Largest intensity, cd.
    pub fn peak(&self) -> f32 {
        self.intensity.iter().fold(0.0, |most, &value| most.max(value))
    }

    /// What is out of range, if anything.
    pub fn problem(&self) -> Option<String> {
        let (rows, columns) = (self.polar.len(), self.azimuth.len());
        let ascending = |angles: &[f32]| angles.windows(2).all(|pair| pair[0] < pair[1]);
        let within = |low: f32, high: f32| self.polar.iter().all(|angle| (low..=high).contains(angle));
        if rows < 2 || columns == 0 || self.intensity.len() != rows * columns {
            let values = self.intensity.len();
            return Some(format!(
                "{values} intensities for {rows} polar angles and {columns} azimuths; give at least 2, 1, and a value each"
            ));
        }
        if self.intensity.len() > Self::MAX_ENTRIES {
            let (values, limit) = (self.intensity.len(), Self::MAX_ENTRIES);
            return Some(format!("the profile has {values} values; the limit is {limit}"));
        }
        if !(ascending(&self.polar) && within(-1e-4, PI as f32 + 1e-4)) {
            return Some("polar angles must rise from 0 to at most π".into());
        }
        let span = self.azimuth[columns - 1] - self.azimuth[0];
        if !(ascending(&self.azimuth) && self.azimuth[0].abs() < 100.0 && span < TAU as f32 + 1e-3) {
            return Some("azimuths must rise over at most a full turn".into());
        }
        let bad = self.intensity.iter().find(|value| !(0.0..f32::INFINITY).contains(*value));
        bad.map(|value| format!("an intensity is {value} cd; give finite values of at least 0"))
    }
}

/// ∫ I sin θ dθ of an intensity that is linear between two angles.
fn ring([from, to]: [f64; 2], [first, last]: [f64; 2]) -> f64 {
    let slope = (last - first) / (to - from);
    // The antiderivative of (a + b θ) sin θ is b sin θ − (a + b θ) cos θ.
    slope * (to.sin() - from.sin()) - last * to.cos() + first * from.cos()
}

/// The interval of ascending numbers that holds `x`, and where in it; `None` outside.
fn bracket(numbers: &[f32], x: f32) -> Option<(usize, f32)> {
    let [first, .., last] = numbers[..] else { return Some((0, 0.0)) };
    if !(first..=last).contains(&x) {
        return None;
    }
    let above = numbers.partition_point(|&number| number <= x).clamp(1, numbers.len() - 1);
    let (low, high) = (numbers[above - 1], numbers[above]);
    Some((above - 1, ((x - low) / (high - low)).clamp(0.0, 1.0)))
}

fn between(a: f32, b: f32, at: f32) -> f32 {
    a + (b - a) * at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flux_is_the_integral_of_the_intensity() {
        let uniform = Profile::uniform(2.0);
        assert_eq!(uniform.problem(), None);
        assert!((uniform.flux() - 8.0 * PI).abs() < 1e-5);
        // A table whose azimuths matter, by the midpoint rule over what `at` says.
        let profile = Profile {
            photometry: Photometry::C,
            polar: vec![0.0, 0.4, 1.1, 1.6],
            azimuth: vec![0.0, 1.0, 2.5, 4.0, std::f32::consts::TAU],
            intensity: (0..20).map(|i| [3.0, 8.0, 5.0, 0.5, 2.0, 9.0, 4.0][i * 3 % 7]).collect(),
        };
        assert_eq!(profile.problem(), None);
        let n = 1500;
        let mut sum = 0.0;
        for i in 0..n {
            let polar = (i as f64 + 0.5) / n as f64 * PI;
            for j in 0..n {
                let azimuth = (j as f64 + 0.5) / n as f64 * TAU;
                sum += f64::from(profile.at(polar as f32, azimuth as f32)) * polar.sin();
            }
        }
        let measured = sum * PI * TAU / (n * n) as f64;
        assert!((measured / profile.flux() - 1.0).abs() < 1e-3, "{measured} against {}", profile.flux());
        assert_eq!(profile.peak(), 9.0);
    }

    #[test]
    fn a_table_is_zero_outside_and_closes_around() {
        let mut profile = Profile {
            photometry: Photometry::B,
            polar: vec![1.0, 2.0],
            azimuth: vec![-0.5, 0.5],
            intensity: vec![1.0, 3.0, 5.0, 7.0],
        };
        assert_eq!(profile.at(1.5, 0.0), 4.0);
        assert_eq!((profile.at(0.9, 0.0), profile.at(1.5, 0.6), profile.at(1.5, -0.6)), (0.0, 0.0, 0.0));
        assert_eq!(profile.at(1.5, 0.25 - std::f32::consts::TAU), profile.at(1.5, 0.25));
        assert_eq!(profile.at(f32::NAN, 0.0), 0.0);
        assert_eq!(profile.at(1.5, f32::NAN), 0.0);
        profile.azimuth = vec![0.0, std::f32::consts::TAU];
        assert!(profile.at(1.5, -1e-9) >= 2.0 && profile.at(1.5, 1e-9) >= 2.0);
        for broken in [
            Profile { polar: vec![0.0, 4.0], ..profile.clone() },
            Profile { polar: vec![2.0, 1.0], ..profile.clone() },
            Profile { azimuth: vec![0.0, 7.0], ..profile.clone() },
            Profile { azimuth: vec![0.0], ..profile.clone() },
            Profile { intensity: vec![0.0, -1.0, 1.0, 1.0], ..profile.clone() },
            Profile { intensity: vec![0.0, f32::NAN, 1.0, 1.0], ..profile.clone() },
        ] {
            assert!(broken.problem().is_some(), "{broken:?}");
        }
    }

    #[test]
    fn all_systems_aim_along_the_axis() {
        // Where both angles of the file are zero: A and B half-way from pole to pole, C at the pole.
        let at = |photometry: Photometry, polar: f32, azimuth: f32| {
            let (sin, cos) = polar.sin_cos();
            photometry.light_from_profile() * Vec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
        };
        let quarter = std::f32::consts::FRAC_PI_2;
        for (photometry, polar) in [(Photometry::A, quarter), (Photometry::B, quarter), (Photometry::C, 0.0)]
        {
            assert!(at(photometry, polar, 0.0).distance(Vec3::NEG_Z) < 1e-6, "{photometry:?}");
        }
        // A degree up, and a degree to the right, of a lamp that has +X up and so +Y to its left.
        let degree = 1.0_f32.to_radians();
        let up = Vec3::new(degree.sin(), 0.0, -degree.cos());
        let right = Vec3::new(0.0, -degree.sin(), -degree.cos());
        assert!(at(Photometry::A, quarter - degree, 0.0).distance(up) < 1e-6);
        assert!(at(Photometry::B, quarter, degree).distance(up) < 1e-6);
        assert!(at(Photometry::A, quarter, degree).distance(right) < 1e-6);
        assert!(at(Photometry::B, quarter - degree, 0.0).distance(right) < 1e-6);
    }
}
