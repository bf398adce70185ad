//! How far two pictures are apart: RMSE, relative MSE, FLIP, and the mean of each channel.

mod flip;

use glam::{DVec3, Vec3};
use heliostat_engine::tone;
use heliostat_scene::{Image, Pixels};
use heliostat_shading::color::srgb_decode;

pub use flip::flip;

/// Times the mean square of the reference, this is added to the squared reference in [`Comparison::relmse`], so that black
/// pixels count but do not dominate. Relative to the picture, the measure does not depend on exposure.
pub const RELMSE_EPSILON: f64 = 1e-2;

/// A picture to compare.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear Rec. 709, rows from the top.
    pub color: Vec<Vec3>,
    /// What the values mean.
    pub referred: Referred,
}

/// What the values of a [`Picture`] mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Referred {
    /// Radiance of the scene, without an upper end.
    Scene,
    /// Light of a display from 0 to 1, as 8-bit pictures have it.
    Display,
}

/// The differences between a picture A and its reference B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// √ mean (a − b)², over all pixels and channels.
    pub rmse: f64,
    /// Mean of (a − b)² / (b² + ε), ε = [`RELMSE_EPSILON`] · mean b² (just
    /// [`RELMSE_EPSILON`] for a black reference), over all pixels and channels.
    pub relmse: f64,
    /// Mean [FLIP](flip()) error of what an observer sees, from 0 (the same) to 1.
    pub flip: f64,
    /// Exposure in stops with which both pictures were tone mapped for FLIP; `None` for 8-bit pictures.
    pub flip_exposure: Option<f32>,
    /// Mean of each channel of A.
    pub mean_a: [f64; 3],
    /// Mean of each channel of B.
    pub mean_b: [f64; 3],
}

/// Why two pictures cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// Different sizes.
    #[error("A is {}×{} and B is {}×{}; give two pictures of one size", a[0], a[1], b[0], b[1])]
    Size {
        /// Width and height of A.
        a: [u32; 2],
        /// Width and height of B.
        b: [u32; 2],
    },
    /// Linear radiance against 8 bits.
    #[error(
        "one picture holds linear radiance, the other is tone mapped; give two of a kind (.exr/.hdr, or .png)"
    )]
    Kind,
    /// A pixel that is no colour.
    #[error("pixel ({x}, {y}) of {picture} is not finite")]
    NotFinite {
        /// `A` or `B`.
        picture: char,
        /// Column from the left.
        x: u32,
        /// Row from the top.
        y: u32,
    },
    /// An even or absurd blur.
    #[error("the blur is {0} pixels wide; give an odd number below 1000")]
    Blur(u32),
}

impl Picture {
    /// Linear colours of an image; 8-bit images are decoded from sRGB. Alpha is ignored.
    pub fn from_image(image: &Image) -> Self {
        let (color, referred) = match &image.pixels {
            Pixels::Rgba8(values) => {
                let linear: Vec<f32> = (0..=255u8).map(|v| srgb_decode(f32::from(v) / 255.0)).collect();
                let pixel = |p: &[u8]| Vec3::from_array([p[0], p[1], p[2]].map(|v| linear[usize::from(v)]));
                (values.chunks_exact(4).map(pixel).collect(), Referred::Display)
            }
            Pixels::RgbaF32(values) => {
                (values.chunks_exact(4).map(|p| Vec3::new(p[0], p[1], p[2])).collect(), Referred::Scene)
            }
        };
        Self { width: image.width, height: image.height, color, referred }
    }

    /// The mean over the `size × size` pixels around each pixel; at the border over those that there are.
    ///
    /// # Errors
    /// [`CompareError::Blur`] unless `size` is odd and below 1000.
    pub fn blurred(&self, size: u32) -> Result<Self, CompareError> {
        if size.is_multiple_of(2) || size >= 1000 {
            return Err(CompareError::Blur(size));
        }
        let (width, height) = (self.width as usize, self.height as usize);
        let reach = size as usize / 2;
        let rows: Vec<DVec3> =
            self.color.chunks(width.max(1)).flat_map(|row| window_means(row, reach)).collect();
        let mut color = vec![Vec3::ZERO; self.color.len()];
        for x in 0..width {
            let column: Vec<Vec3> = (0..height).map(|y| rows[y * width + x].as_vec3()).collect();
            for (y, mean) in window_means(&column, reach).enumerate() {
                color[y * width + x] = mean.as_vec3();
            }
        }
        Ok(Self { color, ..*self })
    }

    fn mean(&self) -> [f64; 3] {
        let sum: DVec3 = self.color.iter().map(|c| c.as_dvec3()).sum();
        (sum / self.color.len().max(1) as f64).to_array()
    }

    fn check_finite(&self, picture: char) -> Result<(), CompareError> {
        match self.color.iter().position(|c| !c.is_finite()) {
            None => Ok(()),
            Some(i) => {
                let i = i as u32;
                Err(CompareError::NotFinite { picture, x: i % self.width, y: i / self.width })
            }
        }
    }
}

/// Means over windows of ±`reach`, cut off at the ends; by prefix sums.
fn window_means(values: &[Vec3], reach: usize) -> impl Iterator<Item = DVec3> {
    let mut sums = vec![DVec3::ZERO];
    for value in values {
        sums.push(sums[sums.len() - 1] + value.as_dvec3());
    }
    let count = values.len();
    (0..count).map(move |i| {
        let (first, end) = (i.saturating_sub(reach), (i + reach + 1).min(count));
        (sums[end] - sums[first]) / (end - first) as f64
    })
}

/// Compares `a` with the reference `b`.
///
/// FLIP needs what an observer sees: pictures of radiance are both tone mapped with the exposure that suits `b`.
///
/// # Errors
/// [`CompareError`] for pictures of different sizes or kinds, or with pixels that are not finite.
pub fn compare(a: &Picture, b: &Picture) -> Result<Comparison, CompareError> {
    if (a.width, a.height) != (b.width, b.height) {
        return Err(CompareError::Size { a: [a.width, a.height], b: [b.width, b.height] });
    }
    if a.referred != b.referred {
        return Err(CompareError::Kind);
    }
    a.check_finite('A')?;
    b.check_finite('B')?;
    let values = 3.0 * a.color.len().max(1) as f64;
    let energy: f64 = b.color.iter().map(|c| c.as_dvec3().length_squared()).sum();
    let epsilon = RELMSE_EPSILON * if energy > 0.0 { energy / values } else { 1.0 };
    let (mut squares, mut relative) = (DVec3::ZERO, DVec3::ZERO);
    for (a, b) in a.color.iter().zip(&b.color) {
        let (a, b) = (a.as_dvec3(), b.as_dvec3());
        let square = (a - b) * (a - b);
        squares += square;
        relative += square / (b * b + epsilon);
    }
    let flip_exposure = (b.referred == Referred::Scene).then(|| tone::auto_exposure(&b.color));
    let seen = |picture: &Picture| match flip_exposure {
        None => picture.color.clone(),
        Some(ev) => {
            let bytes = tone::tone_map(&picture.color, ev);
            let linear = |v: u8| srgb_decode(f32::from(v) / 255.0);
            bytes.chunks_exact(3).map(|p| Vec3::new(linear(p[0]), linear(p[1]), linear(p[2]))).collect()
        }
    };
    Ok(Comparison {
        rmse: (squares.element_sum() / values).sqrt(),
        relmse: relative.element_sum() / values,
        flip: flip(a.width as usize, &seen(a), &seen(b)),
        flip_exposure,
        mean_a: a.mean(),
        mean_b: b.mean(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, color: Vec<Vec3>) -> Picture {
        Picture { width, height: color.len() as u32 / width, color, referred: Referred::Scene }
    }

    #[test]
    fn measures_by_hand() {
        let a = picture(2, vec![Vec3::splat(1.0), Vec3::splat(2.0)]);
        let b = picture(2, vec![Vec3::splat(1.0), Vec3::splat(1.0)]);
        let c = compare(&a, &b).unwrap();
        assert!((c.rmse - 0.5f64.sqrt()).abs() < 1e-12);
        assert!((c.relmse - 0.5 / 1.01).abs() < 1e-12);
        assert_eq!((c.mean_a, c.mean_b), ([1.5; 3], [1.0; 3]));
        assert!(c.flip > 0.0);
        let same = compare(&b, &b).unwrap();
        assert_eq!((same.rmse, same.relmse, same.flip), (0.0, 0.0, 0.0));
    }

    #[test]
    fn blur_averages_windows_and_keeps_constants() {
        let mut color = vec![Vec3::ZERO; 25];
        color[12] = Vec3::splat(9.0);
        let blurred = picture(5, color).blurred(3).unwrap();
        assert!((blurred.color[12] - Vec3::ONE).abs().max_element() < 1e-6);
        assert!((blurred.color[6] - Vec3::ONE).abs().max_element() < 1e-6);
        assert_eq!(blurred.color[0], Vec3::ZERO);
        let grey = picture(4, vec![Vec3::splat(0.3); 12]);
        let blurred = grey.blurred(7).unwrap();
        assert!(blurred.color.iter().all(|c| (*c - Vec3::splat(0.3)).abs().max_element() < 1e-6));
        assert_eq!(grey.blurred(2), Err(CompareError::Blur(2)));
    }

    #[test]
    fn what_cannot_be_compared_is_refused() {
        let a = picture(2, vec![Vec3::ONE; 4]);
        let wide = picture(4, vec![Vec3::ONE; 4]);
        assert_eq!(compare(&a, &wide), Err(CompareError::Size { a: [2, 2], b: [4, 1] }));
        let display = Picture { referred: Referred::Display, ..a.clone() };
        assert_eq!(compare(&a, &display), Err(CompareError::Kind));
        let mut broken = a.clone();
        broken.color[3].y = f32::NAN;
        assert_eq!(compare(&broken, &a), Err(CompareError::NotFinite { picture: 'A', x: 1, y: 1 }));
    }
}
