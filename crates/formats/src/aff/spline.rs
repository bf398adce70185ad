//! Splines through keyframes: positions by cubic polynomials, rotations by spherical quadrangles.
//!
//! Keys carry tension, continuity and bias. The first and the last key only shape the tangents of their neighbours: the
//! curve runs from the second key to the last but one and rests there before and after.
//!
//! # References
//! Kochanek, Bartels, "Interpolating Splines with Local Tension, Continuity, and Bias Control", 1984, equations 8 and 9
//! with the adjustment for uneven times of section 6. Shoemake, "Quaternion Calculus and Fast Animation", 1987 (squad).
//! Lext, Assarsson, Möller, "BART: A Benchmark for Animated Ray Tracing", 2000, sections on keyframes.

use glam::{DQuat, DVec3};

/// A value at a time, and how the curve goes through it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Key<T> {
    pub(super) time: f64,
    pub(super) value: T,
    pub(super) tension: f64,
    pub(super) continuity: f64,
    pub(super) bias: f64,
}

/// Weights of the steps before and after a key in a tangent there.
type Weights = [f64; 2];

impl<T> Key<T> {
    /// Of the tangent that leaves the key for one at time `after`, when the key before it is at `before`.
    fn leaving(&self, before: f64, after: f64) -> Weights {
        let scale = (1.0 - self.tension) * ratio(after - self.time, after - before);
        let (c, b) = (self.continuity, self.bias);
        [scale * (1.0 + c) * (1.0 + b), scale * (1.0 - c) * (1.0 - b)]
    }

    /// Of the tangent that arrives at the key from one at time `before`, when the key after it is at `after`.
    fn arriving(&self, before: f64, after: f64) -> Weights {
        let scale = (1.0 - self.tension) * ratio(self.time - before, after - before);
        let (c, b) = (self.continuity, self.bias);
        [scale * (1.0 - c) * (1.0 + b), scale * (1.0 + c) * (1.0 - b)]
    }
}

/// 0 for keys at the same time.
fn ratio(part: f64, whole: f64) -> f64 {
    if whole == 0.0 { 0.0 } else { part / whole }
}

/// A piece of a curve between two times.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece<T> {
    start: f64,
    end: f64,
    shape: T,
}

/// Leaves out pieces that end before an earlier one does: of keys whose times go back, the earlier ones count.
fn in_order<T>(mut pieces: Vec<Piece<T>>) -> Vec<Piece<T>> {
    let mut reached = f64::NEG_INFINITY;
    pieces.retain(|piece| {
        let further = piece.end > reached;
        reached = reached.max(piece.end);
        further
    });
    pieces
}

/// The piece at a time and where in it, 0 to 1.
fn find<T>(pieces: &[Piece<T>], time: f64) -> Option<(&T, f64)> {
    let (first, last) = (pieces.first()?, pieces.last()?);
    if time.is_nan() || time <= first.start {
        return Some((&first.shape, 0.0));
    }
    if time >= last.end {
        return Some((&last.shape, 1.0));
    }
    let piece = pieces.get(pieces.partition_point(|piece| piece.end <= time))?;
    Some((&piece.shape, ratio(time - piece.start, piece.end - piece.start)))
}

/// A path of positions or scales.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Path(Vec<Piece<[DVec3; 4]>>);

impl Path {
    /// Through all but the outermost of at least four keys.
    pub(super) fn new(keys: &[Key<DVec3>]) -> Self {
        let piece = |keys: &[Key<DVec3>]| {
            let [a, b, c, d] = [&keys[0], &keys[1], &keys[2], &keys[3]];
            let step = c.value - b.value;
            let [before, after] = b.leaving(a.time, c.time);
            let leaving = (b.value - a.value) * before + step * after;
            let [before, after] = c.arriving(b.time, d.time);
            let arriving = step * before + (d.value - c.value) * after;
            // Hermite's polynomial, by powers of the parameter.
            let quadratic = 3.0 * step - 2.0 * leaving - arriving;
            let cubic = leaving + arriving - 2.0 * step;
            Piece { start: b.time, end: c.time, shape: [b.value, leaving, quadratic, cubic] }
        };
        Self(in_order(keys.windows(4).map(piece).collect()))
    }

    pub(super) fn at(&self, time: f64) -> Option<DVec3> {
        let ([a, b, c, d], u) = find(&self.0, time)?;
        Some(*a + u * (*b + u * (*c + u * *d)))
    }

    /// First and last time at which it moves.
    pub(super) fn span(&self) -> Option<(f64, f64)> {
        Some((self.0.first()?.start, self.0.last()?.end))
    }
}

/// A course of rotations.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Turning(Vec<Piece<[DQuat; 4]>>);

impl Turning {
    /// As for [`Path`]. Each key takes the sign nearer to the key before it once its turn has come, and not before, as
    /// in the format's own code: it matters where keys are more than half a turn apart.
    pub(super) fn new(keys: &[Key<DQuat>]) -> Self {
        let mut keys = keys.to_vec();
        let mut pieces = Vec::with_capacity(keys.len().saturating_sub(3));
        for i in 0..keys.len().saturating_sub(3) {
            if keys[i + 1].value.dot(keys[i + 2].value) < 0.0 {
                keys[i + 2].value = -keys[i + 2].value;
            }
            let [a, b, c, d] = [&keys[i], &keys[i + 1], &keys[i + 2], &keys[i + 3]];
            let difference = |from: DQuat, to: DQuat| log(from.conjugate() * to);
            let step = difference(b.value, c.value);
            let [before, after] = b.leaving(a.time, c.time);
            let leaving = difference(a.value, b.value) * before + step * after;
            let [before, after] = c.arriving(b.time, d.time);
            let arriving = step * before + difference(c.value, d.value) * after;
            let first = b.value * exp(0.5 * (leaving - step));
            let second = c.value * exp(0.5 * (step - arriving));
            pieces.push(Piece { start: b.time, end: c.time, shape: [b.value, first, second, c.value] });
        }
        Self(in_order(pieces))
    }

    pub(super) fn at(&self, time: f64) -> Option<DQuat> {
        let ([p, a, b, q], u) = find(&self.0, time)?;
        let turn = slerp(slerp(*p, *q, u), slerp(*a, *b, u), 2.0 * u * (1.0 - u));
        turn.is_finite().then(|| turn.normalize())
    }

    pub(super) fn span(&self) -> Option<(f64, f64)> {
        Some((self.0.first()?.start, self.0.last()?.end))
    }
}

/// Sines below this are replaced by their limits.
const SMALL: f64 = 1e-3;

/// Axis times half the angle of a unit quaternion.
fn log(q: DQuat) -> DVec3 {
    let v = DVec3::new(q.x, q.y, q.z);
    if q.w.abs() >= 1.0 {
        return v;
    }
    let angle = q.w.acos();
    if angle.sin() >= SMALL { v * (angle / angle.sin()) } else { v }
}

fn exp(v: DVec3) -> DQuat {
    let angle = v.length();
    let (sin, cos) = angle.sin_cos();
    let v = if sin.abs() >= SMALL { v * (sin / angle) } else { v };
    DQuat::from_xyzw(v.x, v.y, v.z, cos)
}

/// Along the arc between the two as they are, which may be the longer way round.
fn slerp(p: DQuat, q: DQuat, t: f64) -> DQuat {
    let cos = p.dot(q).clamp(-1.0, 1.0);
    let angle = cos.acos();
    let sin = angle.sin();
    if sin >= SMALL {
        return p * ((1.0 - t) * angle).sin() * (1.0 / sin) + q * ((t * angle).sin() / sin);
    }
    if cos > 0.0 { (p * (1.0 - t) + q * t).normalize() } else { p }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn key<T>(time: f64, value: T) -> Key<T> {
        Key { time, value, tension: 0.0, continuity: 0.0, bias: 0.0 }
    }

    fn path(xs: &[(f64, f64)]) -> Vec<Key<DVec3>> {
        xs.iter().map(|&(time, x)| key(time, DVec3::new(x, 0.0, 0.0))).collect()
    }

    #[test]
    fn plain_keys_at_even_times_make_a_catmull_rom_spline() {
        let curve = Path::new(&path(&[(0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 2.0)]));
        let x = |t: f64| curve.at(t).unwrap().x;
        // It rests outside.
        assert_eq!([x(-1.0), x(0.5), x(1.0), x(2.0), x(9.0)], [1.0, 1.0, 1.0, 3.0, 3.0]);
        // (−a + 9 b + 9 c − d) / 16 in the middle.
        assert!((x(1.5) - (9.0 + 27.0 - 2.0) / 16.0).abs() < 1e-12);
        assert_eq!(curve.span(), Some((1.0, 2.0)));
    }

    #[test]
    fn tension_continuity_and_bias_by_hand() {
        let mut keys = path(&[(0.0, 0.0), (1.0, 1.0), (3.0, 3.0), (4.0, 2.0)]);
        keys[1] = Key { tension: 0.5, continuity: 0.25, bias: -0.5, ..keys[1] };
        // Leaving: (1 − 0.5) · 2/3 · [(1.25)(0.5) · 1 + (0.75)(1.5) · 2] = 1/3 · 2.875.
        // Arriving, plain: 2/3 · [2 + (−1)] = 2/3.
        let (leaving, arriving) = (2.875 / 3.0, 2.0 / 3.0);
        let x = Path::new(&keys).at(2.0).unwrap().x;
        // Hermite in the middle: the mean of the ends, and an eighth of the difference of the tangents.
        assert!((x - (2.0 + (leaving - arriving) / 8.0)).abs() < 1e-12, "{x}");
        keys[1].tension = 1.0;
        keys[2].tension = 1.0;
        assert!((Path::new(&keys).at(2.0).unwrap().x - 2.0).abs() < 1e-12, "no tangents at all");
    }

    #[test]
    fn keys_at_the_same_time_jump() {
        let curve =
            Path::new(&path(&[(0.0, 0.0), (0.0, 1.0), (1.0, 2.0), (1.0, 5.0), (2.0, 6.0), (2.0, 7.0)]));
        let x = |t: f64| curve.at(t).unwrap().x;
        assert!((x(0.999_999) - 2.0).abs() < 1e-3 && x(1.0) == 5.0 && x(2.0) == 6.0);
        assert!((0..200).all(|i| x(f64::from(i) * 0.01).is_finite()));
    }

    #[test]
    fn keys_that_go_back_in_time_are_passed_over() {
        let keys = [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0), (1.5, 9.0), (2.0, 2.0), (3.0, 3.0), (4.0, 4.0)];
        let curve = Path::new(&path(&keys));
        let x = |t: f64| curve.at(t).unwrap().x;
        assert!((x(2.0) - 2.0).abs() < 1e-12 && (x(3.0) - 3.0).abs() < 1e-12);
        assert!((0..100).all(|i| x(f64::from(i) * 0.04) < 5.0), "the stray key is not seen");
    }

    #[test]
    fn an_even_spin_stays_even_for_any_number_of_turns() {
        let turn = |degrees: f64| DQuat::from_axis_angle(DVec3::Y, degrees.to_radians());
        let keys: Vec<_> = (0..40).map(|i| key(f64::from(i), turn(90.0 * f64::from(i)))).collect();
        let spin = Turning::new(&keys);
        for i in 0..360 {
            let time = 1.0 + f64::from(i) * 0.1;
            let expected = turn(90.0 * time);
            let angle = spin.at(time).unwrap().angle_between(expected);
            // A sign is no difference.
            assert!(angle.min(2.0 * PI - angle) < 1e-6, "{time}: {angle}");
        }
    }

    #[test]
    fn rotations_pass_through_their_keys() {
        let axes = [DVec3::X, DVec3::Y, DVec3::new(0.6, 0.8, 0.0), DVec3::Z, DVec3::X, DVec3::Y];
        let keys: Vec<_> = (0..6)
            .map(|i| key(f64::from(i), DQuat::from_axis_angle(axes[i as usize], 0.3 + 0.4 * f64::from(i))))
            .collect();
        let turning = Turning::new(&keys);
        for key in &keys[1..5] {
            let turn = turning.at(key.time).unwrap();
            assert!(turn.dot(key.value).abs() > 1.0 - 1e-9, "{}", key.time);
        }
    }
}
