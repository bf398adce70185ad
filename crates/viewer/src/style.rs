//! How a picture is shown: surfaces in false colours, pixel shaders, the tone curve, exposure.

use std::collections::BTreeMap;

use glam::Vec3;
use heliostat_scene::{Frame, MaterialOverride, ParameterValue, Plane, PlaneData, ShaderRef, ShaderUse};
use heliostat_shading::pixel::{BoundPixelShader, PixelFrame, PixelRegistry};
use heliostat_shading::{LaneMode, Parameter, ParameterKind, ShaderRegistry};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::document::Refusal;

/// Most pixel shaders, one after the other.
const MAX_EFFECTS: usize = 8;
/// Most parameters in an effect, and longest name: no shader has as many.
const MAX_PARAMETERS: usize = 64;
const MAX_NAME: usize = 100;

/// A shader by its name, with the parameters that differ from its defaults.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Effect {
    /// As in `docs/shaders.md` and `docs/pixel-shaders.md`.
    pub name: String,
    /// Values by the parameter's name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<String, Setting>,
}

/// The value of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Setting {
    /// In the parameter's unit.
    Number(f32),
    /// Linear Rec. 709, or a vector.
    Triple([f32; 3]),
}

/// How pictures are shown, of what users can choose.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Style {
    /// All surfaces as diffuse ones.
    pub(crate) diffuse: bool,
    /// The shader that all surfaces have instead of their own; `diffuse` is off then.
    pub(crate) surfaces: Option<Effect>,
    /// What the picture goes through.
    pub(crate) effects: Vec<Effect>,
    /// Instead of the default.
    pub(crate) tone: Option<Effect>,
}

/// A shader that can be chosen, for menus.
#[derive(Clone, Debug, Serialize)]
pub struct ShaderChoice {
    /// Its name.
    pub name: String,
    /// One line on what it does.
    pub about: String,
    /// Whether it answers in colours for a display.
    pub for_display: bool,
    /// Its parameters.
    pub parameters: Vec<ParameterChoice>,
}

/// A parameter of a shader, for menus.
#[derive(Clone, Debug, Serialize)]
pub struct ParameterChoice {
    /// Its name.
    pub name: String,
    /// Whether it is a colour (or a vector) instead of a number.
    pub triple: bool,
    /// Its value unless set; numbers take the first component.
    pub default: [f32; 3],
    /// Least and greatest value.
    pub range: [f32; 2],
    /// Such as `m`; empty for pure numbers.
    pub unit: String,
    /// One line on what it does.
    pub about: String,
}

impl From<&Parameter> for ParameterChoice {
    fn from(parameter: &Parameter) -> Self {
        Self {
            name: parameter.name.clone(),
            triple: parameter.kind != ParameterKind::Float,
            default: parameter.default,
            range: parameter.range,
            unit: parameter.unit.clone(),
            about: parameter.about.clone(),
        }
    }
}

/// The surface shaders that show quantities in false colours: those that let surfaces glow and do nothing else.
pub fn false_colors() -> Vec<ShaderChoice> {
    let registry = ShaderRegistry::built_in();
    let infos = registry.programs().values().map(|program| program.info());
    infos
        .filter(|info| info.name.starts_with(FALSE_COLOR))
        .map(|info| ShaderChoice {
            parameters: info.parameters.iter().map(Into::into).collect(),
            name: info.name,
            about: info.about,
            for_display: true,
        })
        .collect()
}

/// How the names of shaders begin that show quantities.
const FALSE_COLOR: &str = "show-";

/// The pixel shaders, tone curves among them.
pub fn pixel_shaders() -> Vec<ShaderChoice> {
    let registry = PixelRegistry::built_in();
    let infos = registry.programs().values().map(|program| program.info());
    infos
        .map(|info| ShaderChoice {
            parameters: info.parameters.iter().map(Into::into).collect(),
            name: info.name,
            about: info.about,
            for_display: info.for_display,
        })
        .collect()
}

impl Effect {
    /// A shader with its defaults.
    pub fn named(name: impl Into<String>) -> Self {
        Self { name: name.into(), parameters: BTreeMap::new() }
    }

    /// The shader as backends and registries take it.
    pub fn shader(&self) -> ShaderUse {
        let value = |setting: &Setting| match *setting {
            Setting::Number(number) => ParameterValue::Float(number),
            Setting::Triple(values) => ParameterValue::Vector(values.into()),
        };
        let mut shader = ShaderUse::named(&self.name);
        shader.parameters =
            self.parameters.iter().map(|(name, setting)| (name.clone(), value(setting))).collect();
        shader
    }

    /// What is out of all proportion, if anything; whether the shader takes its parameters is found out when it is used.
    pub(crate) fn problem(&self) -> Option<String> {
        let mut names = self.parameters.keys().chain([&self.name]);
        let values = self.parameters.values().flat_map(|setting| match setting {
            Setting::Number(number) => vec![*number],
            Setting::Triple(values) => values.to_vec(),
        });
        if self.parameters.len() > MAX_PARAMETERS || names.any(|name| name.len() > MAX_NAME) {
            return Some("no shader has such a name or so many parameters".into());
        }
        values.into_iter().find(|value| !value.is_finite()).map(|value| format!("{value} is not finite"))
    }

    /// Whether it shows a quantity in false colours, which exposure and tone curve would only distort.
    pub fn is_false_color(&self) -> bool {
        self.name.starts_with(FALSE_COLOR)
    }

    /// The effect that a shader in use is; `None` if it is one of a library or has textures or attributes.
    pub fn of(shader: &ShaderUse) -> Option<Self> {
        let ShaderRef::Named(name) = &shader.shader else { return None };
        let setting = |(name, value): (&String, &ParameterValue)| {
            let setting = match *value {
                ParameterValue::Float(number) => Setting::Number(number),
                ParameterValue::Vector(values) => Setting::Triple(values.to_array()),
                ParameterValue::Texture(..) | ParameterValue::Attribute(..) => return None,
            };
            Some((name.clone(), setting))
        };
        Some(Self {
            name: name.clone(),
            parameters: shader.parameters.iter().map(setting).collect::<Option<_>>()?,
        })
    }

    /// All surfaces by this shader. Levels of the tree of rays are seen in mirrors and glass, which therefore stay.
    ///
    /// # Errors
    /// When there is no such shader, or it has no such parameter.
    pub fn on_all_surfaces(&self) -> Result<MaterialOverride, Refusal> {
        let shader = self.shader();
        ShaderRegistry::built_in().find(&shader).map_err(|problem| Refusal(problem.0))?;
        Ok(MaterialOverride::Shader { mirrors: self.name == "show-level", shader })
    }
}

impl Style {
    /// What renderers are asked for. A shader that is not there has been refused before.
    pub(crate) fn materials(&self) -> MaterialOverride {
        let shader = self.surfaces.as_ref().and_then(|effect| effect.on_all_surfaces().ok());
        let otherwise = if self.diffuse { MaterialOverride::Diffuse } else { MaterialOverride::None };
        shader.unwrap_or(otherwise)
    }

    /// Whether the picture, as its effects leave it, is in colours for a display already.
    fn is_shown(&self, effects: &[BoundPixelShader]) -> bool {
        let false_color = self.surfaces.as_ref().is_some_and(Effect::is_false_color);
        effects.last().map_or(false_color, |effect| effect.info().for_display)
    }

    /// Makes it ready for pictures.
    ///
    /// # Errors
    /// When there is no such shader, a value is out of its range, or the curve is none.
    pub(crate) fn bind(&self) -> Result<Finish, Refusal> {
        if let Some(problem) = self.effects.iter().chain(&self.tone).find_map(Effect::problem) {
            return Err(Refusal(problem));
        }
        if self.effects.len() > MAX_EFFECTS {
            return Err(Refusal(format!("{} pixel shaders; the limit is {MAX_EFFECTS}", self.effects.len())));
        }
        if let Some(effect) = &self.surfaces {
            effect.problem().map_or(Ok(()), |problem| Err(Refusal(problem)))?;
            effect.on_all_surfaces()?;
        }
        let registry = PixelRegistry::built_in();
        let bind = |effect: &Effect| registry.bind(&effect.shader()).map_err(|problem| Refusal(problem.0));
        let effects = self.effects.iter().map(bind).collect::<Result<Vec<_>, _>>()?;
        let shown = self.is_shown(&effects);
        let default = Effect::named(if shown { "clip" } else { "filmic" });
        let curve = bind(self.tone.as_ref().unwrap_or(&default))?;
        if !curve.info().for_display {
            return Err(Refusal(format!("`{}` is no tone curve", curve.info().name)));
        }
        let clip = bind(&Effect::named("clip"))?;
        Ok(Finish {
            needs_geometry: effects.iter().any(|effect| effect.info().needs_geometry),
            effects,
            shown,
            tone: Tone::new(curve, &clip),
        })
    }
}

/// From rendered radiance to bytes.
#[derive(Debug)]
pub(crate) struct Finish {
    effects: Vec<BoundPixelShader>,
    /// Whether the effects look at depth and normals.
    pub(crate) needs_geometry: bool,
    /// Whether no exposure is to be chosen by itself.
    pub(crate) shown: bool,
    pub(crate) tone: Tone,
}

impl Finish {
    /// Planes that effects look at.
    pub(crate) const GEOMETRY: [Plane; 2] = [Plane::Depth, Plane::Normal];

    /// Puts a frame through its effects, on the threads of the current pool; `planes` hold the geometry, `other` is a buffer
    /// that changes places with the frame's.
    pub(crate) fn apply(&self, frame: &mut Frame, planes: &[PlaneData], other: &mut Vec<Vec3>) {
        for effect in &self.effects {
            let plane = |wanted: Plane| {
                let found = planes.iter().find(|data| data.plane == wanted);
                found.map_or(&[][..], |data| &data.values)
            };
            let (width, height) = (frame.width as usize, frame.height as usize);
            let (depth, normal) = (plane(Plane::Depth), plane(Plane::Normal));
            let picture = PixelFrame { width, height, color: &frame.color, depth, normal };
            rows(effect, &picture, other);
            std::mem::swap(&mut frame.color, other);
        }
    }
}

/// All rows of a picture through a shader.
fn rows(shader: &BoundPixelShader, picture: &PixelFrame<'_>, out: &mut Vec<Vec3>) {
    out.resize(picture.color.len(), Vec3::ZERO);
    out.par_chunks_mut(picture.width.max(1))
        .enumerate()
        .for_each(|(row, colors)| shader.row(LaneMode::default(), picture, row, colors));
}

/// Maps radiance to bytes as [`heliostat_shading::tone`] does, by a table: within one step of 256, ten times as fast.
#[derive(Debug)]
pub(crate) struct Tone {
    /// The curve, where it mixes channels; else it is in the table.
    curve: Option<BoundPixelShader>,
    table: Vec<u8>,
}

/// The table covers 2^−24 to 2^8 in steps of 2^−10 of each power of two.
const LOWEST: u32 = (127 - 24) << 23;
const HIGHEST: u32 = (127 + 8) << 23;
const SHIFT: u32 = 13;

impl Tone {
    /// `clip` is the curve that is none.
    fn new(curve: BoundPixelShader, clip: &BoundPixelShader) -> Self {
        let alone = ["filmic", "clip"].contains(&curve.info().name.as_str());
        let by = if alone { &curve } else { clip };
        let centers =
            (LOWEST..HIGHEST).step_by(1 << SHIFT).map(|bits| f32::from_bits(bits + (1 << (SHIFT - 1))));
        let colors: Vec<Vec3> = centers.map(Vec3::splat).collect();
        let bytes = heliostat_shading::tone::tone_map_by(by, &colors, colors.len() as u32, 0.0);
        let table = bytes.chunks_exact(3).map(|rgb| rgb[0]).collect();
        Self { curve: (!alone).then_some(curve), table }
    }

    /// Makes `bytes` the rows of RGB after `ev` stops of exposure.
    pub(crate) fn map(&self, color: &[Vec3], width: u32, ev: f32, bytes: &mut Vec<u8>) {
        let gain = ev.exp2();
        let Some(curve) = &self.curve else { return self.look_up(color, gain, bytes) };
        let color: Vec<Vec3> = color.iter().map(|&c| c * gain).collect();
        let width = width.max(1) as usize;
        let height = color.len() / width;
        let picture = PixelFrame { width, height, color: &color, depth: &[], normal: &[] };
        let mut curved = Vec::new();
        rows(curve, &picture, &mut curved);
        self.look_up(&curved, 1.0, bytes);
    }

    fn look_up(&self, color: &[Vec3], gain: f32, bytes: &mut Vec<u8>) {
        let last = self.table.len() - 1;
        let byte = |x: f32| {
            let x = x * gain;
            // Not a number and negative values are black, as in the exact curve.
            let bits = if x > 0.0 { x.to_bits() } else { 0 };
            self.table[((bits.max(LOWEST) - LOWEST) >> SHIFT).min(last as u32) as usize]
        };
        bytes.clear();
        bytes.reserve_exact(3 * color.len());
        for c in color {
            bytes.extend_from_slice(&[byte(c.x), byte(c.y), byte(c.z)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use heliostat_scene::FrameStats;
    use heliostat_shading::tone;

    use super::*;

    fn with_tone(name: &str) -> Style {
        Style { tone: Some(Effect::named(name)), ..Style::default() }
    }

    #[test]
    fn tables_are_within_one_step_of_their_curves() {
        let values = (0..20_000).map(|i| (i as f32 * 0.001 - 14.0).exp2());
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, 1e-40, 1e30];
        let color = |x: f32| Vec3::new(x, 0.3 * x, 0.7 * x);
        let colors: Vec<Vec3> = values.chain(odd).map(color).collect();
        for name in ["filmic", "clip", "agx", "aces", "reinhard"] {
            let finish = with_tone(name).bind().expect("a curve");
            let curve = PixelRegistry::built_in().bind(&ShaderUse::named(name)).expect("a curve");
            for ev in [0.0, -3.3, 5.0] {
                let width = colors.len() as u32;
                let mut table = Vec::new();
                finish.tone.map(&colors, width, ev, &mut table);
                let exact = tone::tone_map_by(&curve, &colors, width, ev);
                let worst = table.iter().zip(&exact).map(|(a, b)| a.abs_diff(*b)).max();
                assert!(worst <= Some(1), "{name}: {worst:?} at {ev}");
            }
        }
    }

    #[test]
    fn effects_take_geometry_and_any_number_of_threads() {
        let (width, height) = (40, 7);
        let color = vec![Vec3::splat(0.5); width * height];
        let depth = (0..width * height).map(|i| if i % width < 20 { 1.0 } else { 2.0 }).collect();
        let normal = [0.0, 0.0, 1.0].repeat(width * height);
        let planes = [(Plane::Depth, depth), (Plane::Normal, normal)]
            .map(|(plane, values)| PlaneData { plane, values });
        let style = Style { effects: vec![Effect::named("edges")], ..Style::default() };
        let finish = style.bind().expect("there is such a shader");
        assert!(finish.needs_geometry && !finish.shown);
        let shade = |threads| {
            let mut frame = Frame {
                width: width as u32,
                height: height as u32,
                color: color.clone(),
                planes: Vec::new(),
                stats: FrameStats::default(),
                problems: Vec::new(),
            };
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| finish.apply(&mut frame, &planes, &mut Vec::new()));
            frame.color
        };
        let shaded = shade(1);
        assert!(shaded[20].x < 0.1 && shaded[3].x == 0.5, "a line where the depth jumps: {shaded:?}");
        assert_eq!((shade(3), shade(20)), (shaded.clone(), shaded));
    }

    #[test]
    fn what_is_not_there_is_refused() {
        let effects = |list: &[Effect]| Style { effects: list.to_vec(), ..Style::default() }.bind();
        assert!(effects(&[Effect::named("magic")]).unwrap_err().0.contains("heat"));
        assert!(effects(&vec![Effect::named("heat"); MAX_EFFECTS + 1]).is_err());
        let low = BTreeMap::from([("low".to_owned(), Setting::Number(-1.0))]);
        assert!(effects(&[Effect { name: "heat".into(), parameters: low }]).is_err());
        assert!(with_tone("edges").bind().unwrap_err().0.contains("no tone curve"));
        let surfaces = |name: &str| Style { surfaces: Some(Effect::named(name)), ..Style::default() };
        assert!(surfaces("show-magic").bind().unwrap_err().0.contains("show-normal"));
        let depth = surfaces("show-depth");
        assert!(depth.bind().expect("there is such a shader").shown);
        assert!(matches!(depth.materials(), MaterialOverride::Shader { mirrors: false, .. }));
        assert!(matches!(surfaces("show-level").materials(), MaterialOverride::Shader { mirrors: true, .. }));
        assert_eq!(false_colors().len(), 5);
        assert!(pixel_shaders().iter().any(|shader| shader.name == "heat" && shader.for_display));
    }

    #[test]
    fn effects_have_a_form_in_files() {
        let text = r#"{"name":"edges","parameters":{"depth":0.1,"ink":[1.0,0.5,0.0]}}"#;
        let effect: Effect = serde_json::from_str(text).expect("an effect");
        assert_eq!(serde_json::to_string(&effect).expect("JSON"), text);
        assert_eq!(Effect::of(&effect.shader()), Some(effect.clone()));
        assert_eq!(
            effect.shader(),
            ShaderUse::named("edges").with("depth", 0.1).with("ink", Vec3::new(1.0, 0.5, 0.0))
        );
    }
}
