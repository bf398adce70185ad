//! Procedural noise on lanes: lattice gradients, sums of octaves that know their footprint, cells, soft steps.
//!
//! All of it is hashed, so that nothing repeats and no table is read, and made of the four operations, so that lanes and
//! single values agree bit for bit. Points beyond ±[`LIMIT`] are moved to it: floats have no fraction there.

use super::{Mask, Real, Vector, Whole};

/// Coordinates have fractions, and fit whole numbers, within this.
pub const LIMIT: f32 = 4e6;

/// Most octaves that a sum has: 4096 details along the largest.
pub const MAX_OCTAVES: usize = 12;

/// Odd factors that spread the lattice over the hash's input.
const LATTICE: [u32; 3] = [0x9e37_79b1, 0x85eb_ca77, 0xc2b2_ae3d];

/// A value with its gradient.
#[derive(Clone, Copy, Debug)]
pub struct Sloped<F> {
    /// The value.
    pub value: F,
    /// Its derivatives along the axes.
    pub gradient: Vector<F>,
}

/// A lattice cell: its hash before mixing, and the place in it.
struct Cell<F: Real> {
    key: F::Whole,
    /// 0 to 1.
    inside: Vector<F>,
}

impl<F: Real> Cell<F> {
    #[inline(always)]
    fn around(p: Vector<F>, seed: u32) -> Self {
        let p = p.clamp(-LIMIT, LIMIT);
        let corner = Vector::new(p.x.floor(), p.y.floor(), p.z.floor());
        let (x, y, z) = (corner.x.truncate(), corner.y.truncate(), corner.z.truncate());
        let [fx, fy, fz] = LATTICE;
        let key = x.times(x.splat(fx)).plus(y.times(y.splat(fy))).plus(z.times(z.splat(fz)));
        Self { key: key.plus(key.splat(seed.wrapping_mul(0x27d4_eb2f))), inside: p - corner }
    }

    /// The hash of a neighbour.
    #[inline(always)]
    fn hashed(&self, [x, y, z]: [i32; 3]) -> F::Whole {
        let [fx, fy, fz] = LATTICE;
        let offset = (x as u32)
            .wrapping_mul(fx)
            .wrapping_add((y as u32).wrapping_mul(fy))
            .wrapping_add((z as u32).wrapping_mul(fz));
        self.key.plus(self.key.splat(offset)).hashed()
    }
}

/// A random number for the cell of the unit lattice that a point is in; [`Whole::unit`] makes it a float.
#[inline(always)]
pub fn cell_hash<F: Real>(p: Vector<F>, seed: u32) -> F::Whole {
    Cell::around(p, seed).hashed([0, 0, 0])
}

/// Gradient noise of about one feature per unit, from −1 to 1 with mean 0, and its exact derivative. It vanishes on the
/// lattice; its second derivative is continuous.
///
/// # References
/// Perlin, "Improving Noise", 2002: gradients towards the twelve edges of a cube, quintic interpolation.
#[inline(always)]
pub fn gradient_noise<F: Real>(p: Vector<F>, seed: u32) -> Sloped<F> {
    let cell = Cell::around(p, seed);
    let f = cell.inside;
    let (ux, uy, uz) = (fade(f.x), fade(f.y), fade(f.z));
    // Along x, for each of the four edges: the interpolated value and gradient, and the value's difference.
    let zero = f.x.splat(0.0);
    let flat = Sloped { value: zero, gradient: Vector::grey(zero) };
    let mut edges = [(flat, zero); 4];
    for (i, edge) in edges.iter_mut().enumerate() {
        let (y, z) = (i as i32 & 1, i as i32 >> 1);
        let near = corner(&cell, [0, y, z]);
        let far = corner(&cell, [1, y, z]);
        *edge = (near.mix(far, ux), far.value - near.value);
    }
    let [(s00, x00), (s10, x10), (s01, x01), (s11, x11)] = edges;
    let (s0, s1) = (s00.mix(s10, uy), s01.mix(s11, uy));
    let along_x = x00.mix(x10, uy).mix(x01.mix(x11, uy), uz);
    let along_y = (s10.value - s00.value).mix(s11.value - s01.value, uz);
    let along_z = s1.value - s0.value;
    let Sloped { value, gradient } = s0.mix(s1, uz);
    let slopes = Vector::new(fade_slope(f.x), fade_slope(f.y), fade_slope(f.z));
    Sloped { value, gradient: gradient + slopes * Vector::new(along_x, along_y, along_z) }
}

impl<F: Real> Sloped<F> {
    /// `self` at 0, `other` at 1.
    #[inline(always)]
    fn mix(self, other: Self, at: F) -> Self {
        Self { value: self.value.mix(other.value, at), gradient: self.gradient.mix(other.gradient, at) }
    }
}

/// A lattice corner's gradient, and what it makes of the place in the cell.
#[inline(always)]
fn corner<F: Real>(cell: &Cell<F>, at: [i32; 3]) -> Sloped<F> {
    let hash = cell.hashed(at);
    let sign = hash.splat(0x8000_0000);
    let one = cell.inside.x.splat(1.0);
    let first = (one.bits() ^ (hash & sign)).as_real_bits();
    let second = (one.bits() ^ (hash.left(1) & sign)).as_real_bits();
    // Which of the three components is zero.
    let third = (hash & hash.splat(0x00ff_ffff)).to_real();
    let is_x = third.lt(third.splat((1 << 24) as f32 / 3.0));
    let is_x_or_y = third.lt(third.splat((1 << 24) as f32 / 1.5));
    let zero = one.splat(0.0);
    let gradient = Vector::new(
        zero.where_or(is_x, first),
        first.where_or(is_x, zero.where_or(is_x_or_y, second)),
        second.only(is_x_or_y),
    );
    let [x, y, z] = at.map(|offset| offset as f32);
    let from_corner = Vector::new(cell.inside.x - x, cell.inside.y - y, cell.inside.z - z);
    Sloped { value: gradient.dot(from_corner), gradient }
}

/// 6t⁵ − 15t⁴ + 10t³
#[inline(always)]
fn fade<F: Real>(t: F) -> F {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

#[inline(always)]
fn fade_slope<F: Real>(t: F) -> F {
    (t * (t - 1.0)).squared() * 30.0
}

/// How octaves of noise are summed, each with features half as large as the one before.
#[derive(Clone, Copy, Debug)]
pub struct Octaves<F> {
    /// Number of octaves, up to [`MAX_OCTAVES`]; the last one may count in part.
    pub count: F,
    /// Weight of an octave relative to the one before, 0 to 1.
    pub gain: F,
    /// Width of the footprint in the noise's space. An octave gives way to its mean while its wavelength goes from four
    /// widths to two, the shortest that samples of that spacing can tell.
    pub width: F,
    /// Different seeds give unrelated sums.
    pub seed: u32,
}

/// What a sum makes of each octave.
trait Term {
    /// Mean of [`Self::of`] over all of space.
    const MEAN: f32;

    fn of<F: Real>(noise: F) -> F;
}

/// Fractional Brownian motion: a weighted mean of octaves of gradient noise, from −1 to 1.
///
/// # References
/// Musgrave in Ebert et al., *Texturing and Modeling*, 3rd edition, 2003, chapter 14; Norton, Rockwood, Skolmoski,
/// "Clamping: A Method of Antialiasing Textured Surfaces by Bandwidth Limiting in Object Space", 1982.
#[inline(always)]
pub fn fbm<F: Real>(p: Vector<F>, octaves: Octaves<F>) -> F {
    struct Plain;
    impl Term for Plain {
        const MEAN: f32 = 0.0;
        #[inline(always)]
        fn of<F: Real>(noise: F) -> F {
            noise
        }
    }
    sum::<F, Plain>(p, octaves)
}

/// A weighted mean of the magnitudes of octaves, from 0 to 1: billows with sharp valleys.
///
/// # References
/// Perlin, "An Image Synthesizer", 1985.
#[inline(always)]
pub fn turbulence<F: Real>(p: Vector<F>, octaves: Octaves<F>) -> F {
    struct Magnitude;
    impl Term for Magnitude {
        const MEAN: f32 = MEAN_MAGNITUDE;
        #[inline(always)]
        fn of<F: Real>(noise: F) -> F {
            noise.abs()
        }
    }
    sum::<F, Magnitude>(p, octaves)
}

/// A weighted mean of (1 − |noise|)², from 0 to 1: a web of sharp crests.
///
/// # References
/// Musgrave in Ebert et al., *Texturing and Modeling*, 3rd edition, 2003, chapter 16; without its feedback between octaves.
#[inline(always)]
pub fn ridged<F: Real>(p: Vector<F>, octaves: Octaves<F>) -> F {
    struct Crest;
    impl Term for Crest {
        const MEAN: f32 = MEAN_CREST;
        #[inline(always)]
        fn of<F: Real>(noise: F) -> F {
            noise.abs().complement().squared()
        }
    }
    sum::<F, Crest>(p, octaves)
}

/// Means over space of |noise| and (1 − |noise|)², as the tests measure them.
const MEAN_MAGNITUDE: f32 = 0.2198;
const MEAN_CREST: f32 = 0.6331;

#[inline(always)]
fn sum<F: Real, T: Term>(mut p: Vector<F>, octaves: Octaves<F>) -> F {
    let zero = octaves.count.splat(0.0);
    let (mut sum, mut total, mut weight, mut width) = (zero, zero, zero.splat(1.0), octaves.width);
    for octave in 0..MAX_OCTAVES {
        let share = weight * (octaves.count - octave as f32).clamp(0.0, 1.0);
        if !share.gt(zero).any() {
            break;
        }
        total = total + share;
        let seen = share * smooth_step(0.25, 0.5, width).complement();
        sum = sum + (share - seen) * T::MEAN;
        if seen.gt(zero).any() {
            let noise = gradient_noise(p, octaves.seed.wrapping_add(octave as u32)).value;
            sum = sum + T::of(noise) * seen;
        }
        weight = weight * octaves.gain;
        width = width * 2.0;
        p = turned(p).scaled(2.0);
    }
    sum / total.max(zero.splat(1e-6))
}

/// Turned so that the lattices of octaves do not line up: by the angles of two Pythagorean triangles.
#[inline(always)]
fn turned<F: Real>(p: Vector<F>) -> Vector<F> {
    const Z: [f32; 2] = [3.0 / 5.0, 4.0 / 5.0];
    const X: [f32; 2] = [5.0 / 13.0, 12.0 / 13.0];
    let y = p.x * Z[1] + p.y * Z[0];
    // Moved, too: all lattices contain the origin.
    Vector::new(p.x * Z[0] - p.y * Z[1] + 0.31, y * X[0] - p.z * X[1] + 0.17, y * X[1] + p.z * X[0] + 0.73)
}

/// The random points nearest to a place: one lies in each cell of the unit lattice.
#[derive(Clone, Copy, Debug)]
pub struct Cells<F: Real> {
    /// Distance to the nearest one.
    pub nearest: F,
    /// Distance to the second nearest; where it equals `nearest` two cells meet.
    pub second: F,
    /// A random number that belongs to the nearest one.
    pub id: F::Whole,
}

/// The nearest two of random points, one to a lattice cell, among the 27 cells around a place. Once in thousands of places
/// the true second one lies farther off.
///
/// # References
/// Worley, "A Cellular Texture Basis Function", 1996.
#[inline(always)]
pub fn cells<F: Real>(p: Vector<F>, seed: u32) -> Cells<F> {
    let cell = Cell::around(p, seed);
    let far = cell.inside.x.splat(16.0);
    let (mut nearest, mut second, mut id) = (far, far, far);
    for neighbour in 0..27 {
        let offset = [neighbour % 3 - 1, neighbour / 3 % 3 - 1, neighbour / 9 - 1];
        let hash = cell.hashed(offset);
        // Ten bits for each coordinate.
        let low = hash.splat(1023);
        let point = Vector::new(
            (hash & low).to_real() * (1.0 / 1024.0) + offset[0] as f32,
            (hash.right(10) & low).to_real() * (1.0 / 1024.0) + offset[1] as f32,
            (hash.right(20) & low).to_real() * (1.0 / 1024.0) + offset[2] as f32,
        );
        let distance = (point - cell.inside).length_squared();
        let closer = distance.lt(nearest);
        second = nearest.where_or(closer, distance.min(second));
        // Lanes choose between floats; the bits pass as they are.
        id = hash.as_real_bits().where_or(closer, id);
        nearest = distance.min(nearest);
    }
    // Hashed once more: its bits say where the point lies.
    Cells { nearest: nearest.sqrt(), second: second.sqrt(), id: id.bits().hashed() }
}

/// From 0 at `low` to 1 at `high` in a straight line.
#[inline(always)]
pub fn linear_step<F: Real>(low: f32, high: f32, x: F) -> F {
    ((x - low) * (1.0 / (high - low))).clamp(0.0, 1.0)
}

/// From 0 at `low` to 1 at `high`, level at both ends.
#[inline(always)]
pub fn smooth_step<F: Real>(low: f32, high: f32, x: F) -> F {
    let t = linear_step(low, high, x);
    t * t * (t * -2.0 + 3.0)
}

/// 0 below `edge`, 1 above, averaged over `width` around `x`.
#[inline(always)]
pub fn filtered_step<F: Real>(edge: F, x: F, width: F) -> F {
    ((x - edge) / width.max(width.splat(1e-6)) + 0.5).clamp(0.0, 1.0)
}

/// The wave that is 1 in the first `share` of every unit and 0 in the rest, averaged over `width` around `x`.
#[inline(always)]
pub fn filtered_pulses<F: Real>(x: F, share: F, width: F) -> F {
    let width = width.max(width.splat(1e-5));
    // Near the origin, where differences of the integral keep their digits.
    let x = x - x.floor();
    let difference = pulses_integral(x + width * 0.5, share) - pulses_integral(x - width * 0.5, share);
    (difference / width).clamp(0.0, 1.0)
}

#[inline(always)]
fn pulses_integral<F: Real>(x: F, share: F) -> F {
    let whole = x.floor();
    whole * share + (x - whole).min(share)
}

#[cfg(test)]
mod tests;
