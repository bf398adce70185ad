//! Vignette, drawn edges, heat map.

use super::{PixelInfo, PixelRegistry, PixelShader, PixelValues, Pixels};
use crate::lanes::{Real, Vector, log2, pow};
use crate::shader::{Parameter, cube_helix};

pub(super) fn register(registry: &mut PixelRegistry) {
    registry.register(Vignette);
    registry.register(Edges);
    registry.register(Heat);
}

/// Darkens the corners by the law of lenses, a power of the cosine.
#[derive(Debug)]
struct Vignette;

impl PixelShader for Vignette {
    fn info(&self) -> PixelInfo {
        let parameters = vec![
            Parameter::float("strength", 1.0, [0.0, 4.0], "", "tangent of the angle in the corners"),
            Parameter::float("power", 2.0, [0.0, 4.0], "", "of the squared cosine: 2 is the natural law"),
        ];
        PixelInfo {
            name: "vignette".into(),
            about: "darkens the corners as lenses do, by the fourth power of the cosine".into(),
            parameters,
            for_display: false,
            needs_geometry: false,
        }
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Pixels<'_, F>, values: &PixelValues<'_, F>) -> Vector<F> {
        let [x, y] = at.place();
        let tangent2 = (x * x + y * y) * values.float(0).squared();
        let cosine2 = (tangent2 + 1.0).recip();
        at.color(0, 0) * pow(cosine2, values.float(1))
    }
}

/// Lines where depth or normals jump.
///
/// # References
/// Saito, Takahashi, "Comprehensible Rendering of 3-D Shapes", 1990.
#[derive(Debug)]
struct Edges;

impl PixelShader for Edges {
    fn info(&self) -> PixelInfo {
        let parameters = vec![
            Parameter::color("ink", [0.0, 0.0, 0.0], "colour of the lines"),
            Parameter::float("strength", 1.0, [0.0, 1.0], "", "how far lines cover the picture"),
            Parameter::float(
                "depth",
                0.03,
                [1e-4, 10.0],
                "",
                "jump of the distance, relative to it, that makes a line",
            ),
            Parameter::float("crease", 0.3, [1e-3, 2.0], "", "difference of normals that makes a line"),
            Parameter::float("paper", 0.0, [0.0, 1.0], "", "how far all else fades to white paper"),
        ];
        PixelInfo {
            name: "edges".into(),
            about: "draws lines along outlines and creases".into(),
            parameters,
            for_display: false,
            needs_geometry: true,
        }
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Pixels<'_, F>, values: &PixelValues<'_, F>) -> Vector<F> {
        let here = at.depth(0, 0);
        // The second difference of the distance: even planes have none, however steep.
        let across = (at.depth(-1, 0) + at.depth(1, 0) - here * 2.0).abs();
        let along = (at.depth(0, -1) + at.depth(0, 1) - here * 2.0).abs();
        let jump = across.max(along) / here;
        let normal = at.normal(0, 0);
        let right = (at.normal(1, 0) - normal).length();
        let below = (at.normal(0, 1) - normal).length();
        let crease = right.max(below);
        // From half the threshold to the whole one, so that lines have soft borders.
        let by_depth = (jump / values.float(2) * 2.0 - 1.0).clamp(0.0, 1.0);
        let by_crease = (crease / values.float(3) * 2.0 - 1.0).clamp(0.0, 1.0);
        let line = by_depth.max(by_crease) * values.float(1);
        let white = Vector::grey(line.splat(1.0));
        at.color(0, 0).mix(white, values.float(4)).mix(values.vector(0), line)
    }
}

/// False colours by luminance.
///
/// # References
/// Green, "A Colour Scheme for the Display of Astronomical Intensity Images", 2011.
#[derive(Debug)]
struct Heat;

impl PixelShader for Heat {
    fn info(&self) -> PixelInfo {
        let parameters = vec![
            Parameter::float("low", 0.01, [1e-9, 1e9], "W/(m²·sr)", "luminance that is black"),
            Parameter::float("high", 10.0, [1e-9, 1e9], "W/(m²·sr)", "luminance that is white"),
        ];
        PixelInfo {
            name: "heat".into(),
            about: "luminance in false colours, on a logarithmic scale: black, blue, green, red, white"
                .into(),
            parameters,
            for_display: true,
            needs_geometry: false,
        }
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Pixels<'_, F>, values: &PixelValues<'_, F>) -> Vector<F> {
        let (low, high) = (log2(values.float(0)), log2(values.float(1)));
        let range = (high - low).max(low.splat(1e-6));
        let share = ((log2(at.color(0, 0).luminance()) - low) / range).clamp(0.0, 1.0);
        cube_helix(share)
    }
}
