//! A fractal height field of any number of triangles, the same landscape for all of them.

use heliostat::kernel::glam::Vec3;

use super::scenes::View;

/// Edge of the square, metres.
const EDGE: f32 = 1000.0;
/// Heights reach about so far from zero, metres.
const HEIGHT: f32 = 90.0;

/// Positions and triangles of a square grid with about `triangles` of them, centred on the origin.
pub(crate) fn make(triangles: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let cells = ((triangles as f64 / 2.0).sqrt().round() as u32).clamp(1, 8192);
    let at = |i: u32| (i as f32 / cells as f32 - 0.5) * EDGE;
    let positions = (0..=cells)
        .flat_map(|j| (0..=cells).map(move |i| (at(i), at(j))))
        .map(|(x, z)| Vec3::new(x, height(x, z), z))
        .collect();
    let indices = (0..cells)
        .flat_map(|j| (0..cells).map(move |i| j * (cells + 1) + i))
        .flat_map(|a| {
            let (b, c, d) = (a + 1, a + cells + 1, a + cells + 2);
            [[a, c, d], [a, d, b]]
        })
        .collect();
    (positions, indices)
}

/// From a hill at one corner over the land.
pub(super) fn view() -> View {
    let (eye, target, degrees) = look();
    View::look_at(eye, target, degrees)
}

/// Eye, target and vertical field of view in degrees of [`view`].
pub(crate) fn look() -> (Vec3, Vec3, f32) {
    let (x, z) = (-0.42 * EDGE, 0.42 * EDGE);
    let eye = Vec3::new(x, height(x, z) + 60.0, z);
    (eye, Vec3::new(60.0, -40.0, -60.0), 50.0)
}

/// Sum of octaves of value noise, each at twice the frequency and a little under half the height of the last.
fn height(x: f32, z: f32) -> f32 {
    let (mut sum, mut scale, mut frequency) = (0.0, HEIGHT, 4.0 / EDGE);
    for octave in 0..12 {
        sum += scale * noise(x * frequency, z * frequency, octave);
        scale *= 0.46;
        frequency *= 2.03;
    }
    sum
}

/// Smoothly interpolated random values of −1 to 1 at the integers.
fn noise(x: f32, z: f32, octave: u32) -> f32 {
    let (i, j) = (x.floor(), z.floor());
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let (u, v) = (smooth(x - i), smooth(z - j));
    let value = |di: i32, dj: i32| {
        let mut h = (i as i32 + di) as u32;
        for word in [(j as i32 + dj) as u32, octave] {
            h = (h ^ word.wrapping_mul(0x9e37_79b9)).wrapping_mul(0x85eb_ca6b);
            h ^= h >> 13;
        }
        (h.wrapping_mul(0xc2b2_ae35) >> 8) as f32 / (1 << 23) as f32 - 1.0
    };
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    mix(mix(value(0, 0), value(1, 0), u), mix(value(0, 1), value(1, 1), u), v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_count_is_near_what_is_asked_and_all_face_up() {
        let (positions, indices) = make(1000);
        assert!((900..1100).contains(&indices.len()), "{}", indices.len());
        for triangle in indices {
            let [a, b, c] = triangle.map(|i| positions[i as usize]);
            assert!((b - a).cross(c - a).y > 0.0);
        }
    }
}
