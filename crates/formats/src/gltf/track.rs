//! One animated value over time: its keys and what lies between them.
//!
//! # References
//! Khronos, "glTF 2.0 Specification", section 3.11 (animations) and appendix C (interpolation modes).

use glam::Quat;

/// How values follow from the keys around them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Interpolation {
    Step,
    Linear,
    CubicSpline,
}

/// Keys of a value with `width` components. Before the first key and after the last one it stays as it is there.
pub(super) struct Track {
    /// Seconds, at least one, strictly increasing.
    times: Vec<f32>,
    /// `width` numbers per key; for splines three times as many: in-tangent, value, out-tangent.
    values: Vec<f32>,
    width: usize,
    interpolation: Interpolation,
}

/// Where a moment lies among the keys.
enum Moment {
    At(usize),
    /// After a key, by a share of the interval to the next one, which lasts so many seconds.
    Between(usize, f32, f32),
}

impl Track {
    /// # Errors
    /// What is wrong with the keys.
    pub(super) fn new(
        times: Vec<f32>,
        values: Vec<f32>,
        width: usize,
        interpolation: Interpolation,
    ) -> Result<Self, String> {
        let per_key = width * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        if times.is_empty() {
            return Err("it has no keys".into());
        }
        if !times[0].is_finite() || times[0] < 0.0 || !times.is_sorted_by(|a, b| a < b && b.is_finite()) {
            return Err("the times of its keys are not finite, negative or not increasing".into());
        }
        if times.len().checked_mul(per_key) != Some(values.len()) {
            let (keys, numbers) = (times.len(), values.len());
            return Err(format!("{numbers} numbers for {keys} keys of {per_key} numbers each"));
        }
        if !values.iter().all(|v| v.is_finite()) {
            return Err("its values are not finite".into());
        }
        Ok(Self { times, values, width, interpolation })
    }

    /// The time of the last key, seconds.
    pub(super) fn end(&self) -> f64 {
        self.times.last().copied().map_or(0.0, f64::from)
    }

    fn moment(&self, time: f64) -> Moment {
        let after = self.times.partition_point(|&key| f64::from(key) <= time);
        if after == 0 || after == self.times.len() {
            return Moment::At(after.saturating_sub(1));
        }
        let [from, to] = [after - 1, after].map(|key| f64::from(self.times[key]));
        Moment::Between(after - 1, ((time - from) / (to - from)) as f32, (to - from) as f32)
    }

    /// Row `row` of the values: for splines there are three per key.
    fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.width..][..self.width]
    }

    fn value(&self, key: usize) -> &[f32] {
        self.row(if self.interpolation == Interpolation::CubicSpline { 3 * key + 1 } else { key })
    }

    /// The value at `time`, into `out`, which has `width` components.
    pub(super) fn sample(&self, time: f64, out: &mut [f32]) {
        match (self.moment(time), self.interpolation) {
            (Moment::At(key), _) | (Moment::Between(key, ..), Interpolation::Step) => {
                out.copy_from_slice(self.value(key));
            }
            (Moment::Between(key, s, _), Interpolation::Linear) => {
                let ends = self.value(key).iter().zip(self.value(key + 1));
                out.iter_mut().zip(ends).for_each(|(out, (a, b))| *out = a + s * (b - a));
            }
            (Moment::Between(key, s, interval), Interpolation::CubicSpline) => {
                self.spline(key, s, interval, out);
            }
        }
    }

    /// The Hermite spline through the values, with the tangents scaled by the interval.
    fn spline(&self, key: usize, s: f32, interval: f32, out: &mut [f32]) {
        let (s2, s3) = (s * s, s * s * s);
        let factors = [
            2.0 * s3 - 3.0 * s2 + 1.0,
            interval * (s3 - 2.0 * s2 + s),
            -2.0 * s3 + 3.0 * s2,
            interval * (s3 - s2),
        ];
        // The value and the out-tangent of this key, the value and the in-tangent of the next.
        let rows = [3 * key + 1, 3 * key + 2, 3 * key + 4, 3 * key + 3].map(|row| self.row(row));
        for (i, out) in out.iter_mut().enumerate() {
            *out = factors.iter().zip(rows).map(|(factor, row)| factor * row[i]).sum();
        }
    }

    /// The rotation at `time`, for a track of four components.
    pub(super) fn rotation(&self, time: f64) -> Quat {
        if let (Moment::Between(key, s, _), Interpolation::Linear) = (self.moment(time), self.interpolation) {
            let [a, b] = [key, key + 1].map(|key| unit(Quat::from_slice(self.value(key))));
            return slerp(a, b, s);
        }
        let mut out = [0.0; 4];
        self.sample(time, &mut out);
        unit(Quat::from_array(out))
    }
}

/// The rotation that a quaternion of any length means; one of length 0 says nothing, so the identity.
pub(super) fn unit(q: Quat) -> Quat {
    let length = q.length();
    if length > 0.0 && length.is_finite() { q / length } else { Quat::IDENTITY }
}

/// Spherical linear interpolation, the shorter way around.
///
/// # References
/// Shoemake, "Animating Rotation with Quaternion Curves", 1985, section 3.3.
fn slerp(a: Quat, b: Quat, s: f32) -> Quat {
    let dot = a.dot(b);
    let b = if dot < 0.0 { -b } else { b };
    // Where the sine loses its digits the arc is as good as straight.
    if dot.abs() > 0.9995 {
        return unit(a * (1.0 - s) + b * s);
    }
    let angle = dot.abs().acos();
    unit((a * ((1.0 - s) * angle).sin() + b * (s * angle).sin()) / angle.sin())
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn track(times: &[f32], values: &[f32], width: usize, interpolation: Interpolation) -> Track {
        Track::new(times.to_vec(), values.to_vec(), width, interpolation).expect("a valid track")
    }

    fn at(track: &Track, time: f64) -> f32 {
        let mut out = [0.0];
        track.sample(time, &mut out);
        out[0]
    }

    #[test]
    fn steps_and_lines_hold_their_ends() {
        let (times, values) = ([1.0, 2.0, 4.0], [10.0, 20.0, 0.0]);
        let step = track(&times, &values, 1, Interpolation::Step);
        let expected =
            [(0.0, 10.0), (1.0, 10.0), (1.99, 10.0), (2.0, 20.0), (3.9, 20.0), (4.0, 0.0), (9.0, 0.0)];
        for (time, value) in expected {
            assert_eq!(at(&step, time), value, "at {time}");
        }
        let line = track(&times, &values, 1, Interpolation::Linear);
        for (time, value) in [(0.5, 10.0), (1.25, 12.5), (2.0, 20.0), (3.5, 5.0), (4.0, 0.0), (5.0, 0.0)] {
            assert_eq!(at(&line, time), value, "at {time}");
        }
        assert_eq!(line.end(), 4.0);
    }

    #[test]
    fn splines_reproduce_a_cubic() {
        // Tangents are derivatives by seconds: p(t) = t³ − 2t + 1 comes back exactly, whatever the interval.
        let p = |t: f32| t * t * t - 2.0 * t + 1.0;
        let slope = |t: f32| 3.0 * t * t - 2.0;
        let times = [0.0, 0.5, 2.5];
        let values: Vec<f32> = times.iter().flat_map(|&t| [slope(t), p(t), slope(t)]).collect();
        let spline = track(&times, &values, 1, Interpolation::CubicSpline);
        for i in 0..=50 {
            let t = i as f32 * 0.05;
            assert!((at(&spline, t.into()) - p(t)).abs() < 1e-5, "at {t}: {}", at(&spline, t.into()));
        }
    }

    #[test]
    fn rotations_turn_evenly_the_shorter_way() {
        let turn = |angle: f32| Quat::from_rotation_z(angle);
        for angle in [0.01, 1.0, 3.0, 3.1] {
            for sign in [1.0, -1.0] {
                // The same rotation with either sign; `-q` must not turn the long way.
                let values = [turn(0.2).to_array(), (turn(0.2 + angle) * sign).to_array()].concat();
                let track = track(&[0.0, 2.0], &values, 4, Interpolation::Linear);
                for i in 0..=10 {
                    let s = i as f32 * 0.1;
                    let expected = turn(0.2 + s * angle);
                    let found = track.rotation(f64::from(s) * 2.0);
                    let error = (found * Vec3::X - expected * Vec3::X).length();
                    assert!(error < 2e-6, "{angle} {sign} {s}: {error}");
                }
            }
        }
        // Splines of quaternions are normalised.
        let values =
            [[0.0; 4], turn(0.0).to_array(), [0.0; 4], [0.0; 4], turn(2.0).to_array(), [0.0; 4]].concat();
        let spline = track(&[0.0, 1.0], &values, 4, Interpolation::CubicSpline);
        let middle = spline.rotation(0.5);
        assert!((middle.length() - 1.0).abs() < 1e-6);
        assert!((middle * Vec3::X - turn(1.0) * Vec3::X).length() < 1e-6);
        assert_eq!(unit(Quat::from_array([0.0; 4])), Quat::IDENTITY);
    }

    #[test]
    fn broken_keys_are_refused() {
        let refuse = |times: &[f32], values: &[f32], interpolation| {
            Track::new(times.to_vec(), values.to_vec(), 1, interpolation).err().expect("refused")
        };
        assert!(refuse(&[], &[], Interpolation::Step).contains("no keys"));
        for times in
            [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, f32::NAN], [f32::NAN, 0.0], [0.0, f32::INFINITY]]
        {
            assert!(refuse(&times, &[0.0; 2], Interpolation::Linear).contains("times"), "{times:?}");
        }
        assert!(
            refuse(&[0.0, 1.0], &[0.0; 2], Interpolation::CubicSpline).contains("2 numbers for 2 keys of 3")
        );
        assert!(refuse(&[0.0], &[f32::NAN], Interpolation::Step).contains("not finite"));
    }
}
