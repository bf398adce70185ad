//! About where all emitters are and how strong: to compare many of them at many points.

use std::f32::consts::PI;

use glam::Vec3;
use heliostat_kernel::Aabb;

/// What is remembered of each emitter, in their order.
#[derive(Clone, Debug, Default)]
pub struct Lamps {
    center: [Vec<f32>; 3],
    /// Of the sphere around it, metres.
    radius: Vec<f32>,
    /// Luminance of the radiant intensity if it were alike in all directions, W/sr.
    intensity: Vec<f32>,
    /// Luminance of the irradiance of light that is the same everywhere, W/m².
    irradiance: Vec<f32>,
}

impl Lamps {
    /// Adds an emitter of some power (W) that lies within a box.
    pub(crate) fn push(&mut self, bounds: Aabb, power: f32) {
        self.push_lamp(bounds.center(), 0.5 * bounds.size().length(), power / (4.0 * PI), 0.0);
    }

    /// Adds an emitter whose light is the same everywhere.
    pub(crate) fn push_everywhere(&mut self, irradiance: f32) {
        self.push_lamp(Vec3::ZERO, f32::MAX.sqrt(), 0.0, irradiance);
    }

    fn push_lamp(&mut self, center: Vec3, radius: f32, intensity: f32, irradiance: f32) {
        for (list, coordinate) in self.center.iter_mut().zip(center.to_array()) {
            list.push(coordinate);
        }
        self.radius.push(radius);
        self.intensity.push(intensity);
        self.irradiance.push(irradiance);
    }

    /// Estimates of the irradiance that every emitter causes at a point with a normal, if nothing stood between: exact for
    /// small lights that shine alike in all directions, up to the surface's cosine. Zero for those behind the surface.
    pub fn irradiances(&self, at: Vec3, normal: Vec3, out: &mut Vec<f32>) {
        let [x, y, z] = &self.center;
        out.clear();
        out.extend((0..self.radius.len()).map(|i| {
            let (radius, way) = (self.radius[i], [x[i] - at.x, y[i] - at.y, z[i] - at.z]);
            let distance2 = way.iter().map(|c| c * c).sum::<f32>().max(radius * radius);
            let height = way[0] * normal.x + way[1] * normal.y + way[2] * normal.z;
            let before = if height > -radius { 1.0 } else { 0.0 };
            before * (self.intensity[i] / distance2.max(f32::MIN_POSITIVE)) + self.irradiance[i]
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lamps_follow_the_inverse_square_of_the_distance_before_the_surface() {
        let mut lamps = Lamps::default();
        let small = |at: Vec3| Aabb { min: at - 1e-3, max: at + 1e-3 };
        lamps.push(small(Vec3::Y), 4.0 * PI);
        lamps.push(small(3.0 * Vec3::Y), 4.0 * PI);
        lamps.push(small(-Vec3::Y), 4.0 * PI);
        lamps.push_everywhere(0.25);
        let mut out = Vec::new();
        lamps.irradiances(Vec3::ZERO, Vec3::Y, &mut out);
        for (estimate, expected) in out.iter().zip([1.0, 1.0 / 9.0, 0.0, 0.25]) {
            assert!((estimate - expected).abs() < 1e-5, "{estimate}, expected {expected}");
        }
        // A point inside a lamp's sphere is as far as its edge.
        let mut lamp = Lamps::default();
        lamp.push(Aabb { min: Vec3::splat(-1.0), max: Vec3::ONE }, 4.0 * PI);
        lamp.irradiances(Vec3::ZERO, Vec3::Y, &mut out);
        assert!((out[0] - 1.0 / 3.0).abs() < 1e-6, "{out:?}");
    }
}
