//! The discontinuity buffer: each pixel takes the light of its neighbours' sets where they see the same surface.
//!
//! Irradiance is averaged before it is multiplied by the surface's colour, so that textures stay sharp. The window is
//! exactly as large as the interleaving pattern: every set counts once. Where a neighbour lies on another surface, the
//! pixel of the same set one pattern further on may stand in; only when neither does is the average over fewer sets.
//!
//! # References
//! Keller, Heidrich, "Interleaved Sampling", 2001. Wald et al. 2002 (the discontinuity buffer); the stand-ins are ours.

use glam::Vec3;

use super::Gathered;

/// Normals may differ by this much: cosine.
const LEAST_COSINE: f32 = 0.9;
/// The same where gloss is shared: a bump's or a flake's is noise to the eye.
const LEAST_GLOSSY_COSINE: f32 = 0.5;
/// The same for surfaces seen in mirrors and through glass.
const LEAST_MIRRORED_COSINE: f32 = 0.5;
/// A neighbour may lie off the tangent plane by this share of its distance from the camera.
pub(super) const PLANE_DISTANCE: f32 = 0.01;

/// What the surface at a pixel receives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Light {
    /// Irradiance over π: to be multiplied by the surface's colour.
    pub irradiance: Vec3,
    /// Radiance that other lobes reflect.
    pub gloss: Vec3,
}

impl Light {
    /// What a surface of some colour reflects of it.
    pub(super) fn reflected(&self, albedo: Vec3) -> Vec3 {
        albedo * self.irradiance + self.gloss
    }
}

/// Filters rows of a picture.
pub(super) struct Window<'a> {
    /// Row by row.
    pub(super) pixels: &'a [Gathered],
    pub(super) width: u32,
    pub(super) height: u32,
    /// Of the interleaving pattern.
    pub(super) pattern: [u32; 2],
    /// Where the picture is taken from.
    pub(super) eye: Vec3,
}

impl Window<'_> {
    /// Light that the surface at a pixel receives, averaged over the window.
    pub(super) fn light(&self, x: u32, y: u32) -> Light {
        let [n, m] = self.pattern.map(|p| p as i32);
        let center = &self.pixels[(y * self.width + x) as usize];
        if center.strength == 0.0 {
            return Light { irradiance: Vec3::ZERO, gloss: center.scattered };
        }
        let scale = PLANE_DISTANCE * center.position.distance(self.eye);
        // The pixel itself always counts; each as much as it has samples of the surface.
        let mut sum = Light::default();
        let (mut count, mut gloss_count) = (0.0, 0.0);
        let mut add = |tap: &Gathered, diffuse: bool| {
            if diffuse {
                sum.irradiance += tap.irradiance * tap.coverage;
                count += tap.coverage;
            }
            sum.gloss += (tap.gloss + tap.scattered) * tap.coverage;
            gloss_count += tap.coverage;
        };
        add(center, true);
        for dy in -(m / 2)..m - m / 2 {
            for dx in -(n / 2)..n - n / 2 {
                if (dx, dy) == (0, 0) {
                    continue;
                }
                // The same set lies one pattern further on, on the other side.
                let (other_x, other_y) = (dx - n * dx.signum(), dy - m * dy.signum());
                let stand_ins = [(dx, dy), (other_x, dy), (dx, other_y), (other_x, other_y)];
                let find = |least_cosine| {
                    stand_ins.into_iter().find_map(|(dx, dy)| {
                        let tap = self.at(x as i32 + dx, y as i32 + dy)?;
                        is_within(center, tap, scale, least_cosine).then_some(tap)
                    })
                };
                if let Some(tap) = find(LEAST_COSINE) {
                    add(tap, true);
                } else if let Some(tap) = find(LEAST_GLOSSY_COSINE) {
                    add(tap, false);
                }
            }
        }
        Light { irradiance: sum.irradiance / count, gloss: sum.gloss / gloss_count }
    }

    fn at(&self, x: i32, y: i32) -> Option<&Gathered> {
        let inside = (0..self.width as i32).contains(&x) && (0..self.height as i32).contains(&y);
        inside.then(|| &self.pixels[y as usize * self.width as usize + x as usize])
    }
}

/// Whether two pixels see the same surface, or ones alike. `scale` is how far off the plane of one the other may lie.
pub(super) fn is_alike(a: &Gathered, b: &Gathered, scale: f32) -> bool {
    is_within(a, b, scale, LEAST_COSINE)
}

/// The same for normals that differ by some cosine at most.
fn is_within(a: &Gathered, b: &Gathered, scale: f32, least_cosine: f32) -> bool {
    if b.strength == 0.0 || a.straight != b.straight {
        return false;
    }
    let cos = a.normal.dot(b.normal);
    if !a.straight {
        // A curved mirror spreads neighbours far apart; what they see still gets much the same light.
        return cos > LEAST_MIRRORED_COSINE;
    }
    let way = b.position - a.position;
    cos > least_cosine && way.dot(a.normal).abs().max(way.dot(b.normal).abs()) < scale
}
