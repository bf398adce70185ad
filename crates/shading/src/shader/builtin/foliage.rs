//! Leaves cut out of whatever the texture coordinates cover, lit through from behind.

use crate::closure::Closure;
use crate::lanes::noise::{cell_hash, linear_step, smooth_step};
use crate::lanes::{Real, Vector, Whole, pow};
use crate::lobe_set::Lobes;
use crate::shader::{Inputs, Parameter, Point, ShaderInfo, SurfaceShader};

const FRONT: usize = 0;
const BACK: usize = 1;
const REPEAT: usize = 2;
const FULLNESS: usize = 3;
const TEETH: usize = 4;
const VEINS: usize = 5;
const TRANSLUCENCY: usize = 6;
const VARIATION: usize = 7;

/// Coordinates over which the border fades.
const SOFTNESS: f32 = 0.03;

/// A leaf in each unit of the texture coordinates (after the repeat), its stem at v = 1. Light that it lets through is
/// spread by a very rough thin sheet.
///
/// # References
/// Habel, Kusternig, Wimmer, "Physically Based Real-Time Translucency for Leaves", 2007, for what leaves let through.
#[derive(Debug)]
pub(super) struct Foliage;

impl SurfaceShader for Foliage {
    fn info(&self) -> ShaderInfo {
        ShaderInfo {
            name: "foliage".into(),
            about: "leaves cut out by texture coordinates, translucent".into(),
            parameters: vec![
                Parameter::color("front", [0.09, 0.22, 0.035], "colour of the upper side"),
                Parameter::color("back", [0.17, 0.27, 0.09], "colour of the lower side"),
                Parameter::float(
                    "repeat",
                    1.0,
                    [1.0, 1000.0],
                    "",
                    "leaves along a unit of the texture coordinates",
                ),
                Parameter::float("fullness", 0.95, [0.0, 1.0], "", "width of a leaf relative to its cell"),
                Parameter::float("teeth", 0.25, [0.0, 1.0], "", "depth of the serrated border"),
                Parameter::float("veins", 0.5, [0.0, 1.0], "", "contrast of the veins"),
                Parameter::float(
                    "translucency",
                    0.5,
                    [0.0, 1.0],
                    "",
                    "share of light that passes instead of being reflected",
                ),
                Parameter::float("variation", 0.4, [0.0, 1.0], "", "how much leaves differ in colour"),
            ],
            lobes: Lobes::DIFFUSE.union(Lobes::SPECULAR).union(Lobes::THIN_TRANSMIT),
            see_through: true,
        }
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let (zero, one) = (inputs.constant(0.0), inputs.constant(1.0));
        let repeat = inputs.float(REPEAT);
        let (u, v) = (at.uv[0] * repeat, at.uv[1] * repeat);
        let row = v.floor();
        // Every other row is moved by half a leaf.
        let u = u + row * 0.5 - (row * 0.5).floor();
        let column = u.floor();
        // Across from −1 to 1, along from the stem's end at 0 to the tip at 1.
        let across = ((u - column) * 2.0 - 1.0).abs();
        let along = (v - row).complement();
        let blade = (along * (1.0 / 0.88) - 0.12 / 0.88).clamp(0.0, 1.0);

        let outline = pow(blade, one * 0.55) * pow(blade.complement(), one * 0.8) * 1.72;
        let tooth = blade * 14.0 + across * 2.0;
        let tooth = (tooth - tooth.floor()) * inputs.float(TEETH) * 0.35;
        let half_width = outline * tooth.complement() * inputs.float(FULLNESS);
        let leaf = linear_step(-SOFTNESS, 0.0, half_width - across).only(half_width.gt(zero));
        let stem = linear_step(-SOFTNESS, 0.0, -across + 0.04).only(along.lt(one * 0.2) & !leaf.gt(zero));
        closure.opacity = leaf.max(stem);

        let side = blade * 7.0 - across * 2.2;
        let side = ((side - side.floor()) * 2.0 - 1.0).abs();
        let vein = smooth_step(0.75, 1.0, side).max(smooth_step(0.0, 0.06, across).complement());
        let contrast = vein * inputs.float(VEINS);
        let id = cell_hash(Vector::new(column, row, zero), 81);
        let lean = (id.unit() - 0.5) * inputs.float(VARIATION);
        let color = inputs.vector(FRONT).where_or(at.front, inputs.vector(BACK));
        // Autumn is red before it is dark.
        let color = color * Vector::new(lean * 1.6 + 1.0, lean * 0.6 + 1.0, one);
        let color = color.mix(color.scaled(2.2), contrast * 0.5).clamp(0.0, 1.0);
        let see_through = inputs.float(TRANSLUCENCY) * (vein * -0.4 + 1.0);
        closure.base_color = color;
        closure.transmission = see_through;
        closure.metallic = zero;
        closure.coat = zero;
        closure.specular = one * 0.6;
        closure.specular_color = Vector::grey(one);
        closure.roughness = one * 0.62;
    }
}
