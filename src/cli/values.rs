//! Values on the command line: sizes, vectors, ranges, exposures.

use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;

use glam::Vec3;
use heliostat::scene::{Gradient, MaterialOverride, ParameterValue, ShaderUse, Sky};
use heliostat::shading::ShaderRegistry;
use heliostat_viewer::Effect;

/// Most pixels along one edge, and in one picture.
const MAX_EDGE: u32 = 1 << 16;
const MAX_PIXELS: u64 = 1 << 28;

/// A picture's size, `WxH`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Size {
    pub(super) width: u32,
    pub(super) height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || format!("`{text}` is not a size; write WIDTHxHEIGHT in pixels, such as 1024x768");
        let (width, height) = text.split_once(['x', 'X', '×']).ok_or_else(form)?;
        let [width, height] = [width, height].map(|n| n.trim().parse::<u64>());
        let (width, height) = (width.map_err(|_| form())?, height.map_err(|_| form())?);
        let edge = u64::from(MAX_EDGE);
        if width == 0 || height == 0 {
            return Err(format!("{width}×{height} has no pixels"));
        }
        if width > edge || height > edge || width * height > MAX_PIXELS {
            return Err(format!(
                "{width}×{height} is too large; the limit is {MAX_EDGE} pixels along an edge and {MAX_PIXELS} in all"
            ));
        }
        Ok(Self { width: width as u32, height: height as u32 })
    }
}

/// `X,Y,Z`, finite.
pub(super) fn vector(text: &str) -> Result<Vec3, String> {
    match numbers(text)?[..] {
        [x, y, z] => Ok(Vec3::new(x, y, z)),
        _ => Err(format!("`{text}` is not a vector; write three numbers X,Y,Z")),
    }
}

/// `NAME` or `NAME:PARAMETER=VALUE,…` of a shader; a colour is written `R/G/B`, an attribute `@NAME` or `@NAME*FACTOR`.
pub(super) fn shader(text: &str) -> Result<ShaderUse, String> {
    let (name, parameters) = text.split_once(':').unwrap_or((text, ""));
    let mut shader = ShaderUse::named(name);
    for setting in parameters.split(',').filter(|setting| !setting.is_empty()) {
        let form = || {
            format!(
                "`{setting}` in `{text}` sets nothing; write PARAMETER=VALUE, PARAMETER=R/G/B or PARAMETER=@ATTRIBUTE"
            )
        };
        let (parameter, value) = setting.split_once('=').ok_or_else(form)?;
        let constant = |value: &str| match numbers(&value.replace('/', ","))?[..] {
            [number] => Ok(Vec3::splat(number)),
            [r, g, b] => Ok(Vec3::new(r, g, b)),
            _ => Err(form()),
        };
        let value = match value.strip_prefix('@') {
            Some(attribute) => {
                let (name, factor) = attribute.split_once('*').unwrap_or((attribute, "1"));
                ParameterValue::Attribute(name.into(), constant(factor)?)
            }
            None if value.contains('/') => ParameterValue::Vector(constant(value)?),
            None => ParameterValue::Float(constant(value)?.x),
        };
        shader = shader.with(parameter, value);
    }
    Ok(shader)
}

/// What surfaces look like instead of themselves.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Materials {
    /// They are as they are.
    AsIs,
    /// All are diffuse.
    Diffuse,
    /// All are by this shader.
    Shader(Effect),
    /// All are by this shader, which takes attributes of their geometries.
    Attributed(ShaderUse),
}

impl Materials {
    /// What a backend is asked for.
    ///
    /// # Errors
    /// When there is no such shader, or it has no such parameter.
    pub(super) fn to_override(&self) -> Result<MaterialOverride, String> {
        Ok(match self {
            Self::AsIs => MaterialOverride::None,
            Self::Diffuse => MaterialOverride::Diffuse,
            Self::Shader(effect) => effect.on_all_surfaces().map_err(|refusal| refusal.0)?,
            Self::Attributed(shader) => {
                ShaderRegistry::built_in().find(shader).map_err(|problem| problem.0)?;
                MaterialOverride::Shader { shader: shader.clone(), mirrors: false }
            }
        })
    }

    /// Whether they show a quantity in false colours.
    pub(super) fn are_false_colors(&self) -> bool {
        matches!(self, Self::Shader(effect) if effect.is_false_color())
    }
}

impl FromStr for Materials {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let materials = match text {
            "as-is" => Self::AsIs,
            "diffuse" => Self::Diffuse,
            _ => {
                let shader = shader(text)?;
                Effect::of(&shader).map_or(Self::Attributed(shader), Self::Shader)
            }
        };
        materials.to_override().map_err(|problem| format!("{problem}; or give `as-is` or `diffuse`"))?;
        Ok(materials)
    }
}

/// `TURBIDITY,ELEVATION,AZIMUTH` of a sky, angles in degrees.
pub(super) fn sky(text: &str) -> Result<Sky, String> {
    let form = || format!("`{text}` is no sky; write TURBIDITY,ELEVATION,AZIMUTH, such as 3,40,135");
    let [turbidity, elevation, azimuth] = numbers(text)?[..] else { return Err(form()) };
    if !(1.7..=10.0).contains(&turbidity) {
        return Err(format!(
            "turbidity {turbidity} is out of range; give 1.7 (very clear) to 10 (thick haze)"
        ));
    }
    if !(0.0..=90.0).contains(&elevation) {
        return Err(format!("the sun cannot stand {elevation}° high; give 0 to 90"));
    }
    Ok(Sky::new(turbidity, elevation.to_radians(), (azimuth % 360.0).to_radians()))
}

/// A full angle in degrees up to the whole sphere, as radians.
pub(super) fn wide_angle(text: &str) -> Result<f32, String> {
    let degrees = text.parse::<f32>().ok().filter(|d| (0.1..=360.0).contains(d));
    let problem = || format!("`{text}` is not a field of view; give degrees from 0.1 to 360");
    degrees.map(f32::to_radians).ok_or_else(problem)
}

/// `R,G,B` or one number for all three, finite and at least 0.
pub(super) fn color(text: &str) -> Result<Vec3, String> {
    let color = match numbers(text)?[..] {
        [grey] => Vec3::splat(grey),
        [r, g, b] => Vec3::new(r, g, b),
        _ => return Err(format!("`{text}` is not a colour; write R,G,B or one number")),
    };
    if color.min_element() < 0.0 {
        return Err(format!("`{text}` is negative; give values of at least 0"));
    }
    Ok(color)
}

fn numbers(text: &str) -> Result<Vec<f32>, String> {
    let parse = |part: &str| {
        let number = part.trim().parse::<f32>().ok().filter(|n| n.is_finite());
        number.ok_or_else(|| format!("`{part}` in `{text}` is not a finite number"))
    };
    text.split(',').map(parse).collect()
}

/// Frame numbers `A..B` (without B) or one number.
pub(super) fn frames(text: &str) -> Result<Range<u32>, String> {
    let form =
        || format!("`{text}` is not a range of frames; write FIRST..END, such as 0..24, or one number");
    let number = |part: &str| part.trim().parse::<u32>().map_err(|_| form());
    let range = match text.split_once("..") {
        Some((first, end)) => number(first)?..number(end)?,
        None => number(text)?..number(text)?.saturating_add(1),
    };
    if range.is_empty() {
        return Err(format!("`{text}` holds no frame; the end is not part of the range"));
    }
    Ok(range)
}

/// A time in seconds, finite and at least 0.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|t| (0.0..1e9).contains(t));
    seconds.ok_or_else(|| format!("`{text}` is not a time; give seconds from 0 on"))
}

/// Frames per second.
pub(super) fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse::<f64>().ok().filter(|rate| (0.001..=1000.0).contains(rate));
    rate.ok_or_else(|| format!("`{text}` is not a rate; give frames per second from 0.001 to 1000"))
}

/// A share from 0 to 1.
pub(super) fn share(text: &str) -> Result<f64, String> {
    let share = text.parse::<f64>().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| format!("`{text}` is not a share; give a number from 0 to 1"))
}

/// The file of an animated picture.
pub(super) fn animation(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("png" | "apng") => Ok(path),
        _ => Err(format!("`{text}` is no animated picture; end the name in .png or .apng")),
    }
}

/// How bright an 8-bit picture is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Exposure {
    /// As suits the picture.
    Auto,
    /// Stops.
    Ev(f32),
}

impl FromStr for Exposure {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let stops = text.parse::<f32>().ok().filter(|ev| (-60.0..=60.0).contains(ev));
        stops
            .map(Self::Ev)
            .ok_or_else(|| format!("`{text}` is not an exposure; give `auto` or stops from -60 to 60"))
    }
}

/// What surrounds the scene instead of its own environment.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Surroundings {
    None,
    Constant(Vec3),
    Gradient(Gradient),
    File(PathBuf),
}

impl FromStr for Surroundings {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "none" {
            return Ok(Self::None);
        }
        // What starts like a number and is no file must be a colour, so that its errors are about colours.
        let numeric = text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
        if numeric && !std::path::Path::new(text).exists() {
            let Some((zenith, rest)) = text.split_once('/') else { return color(text).map(Self::Constant) };
            let form = || format!("`{text}` is no gradient; write ZENITH/HORIZON/NADIR, a colour each");
            let (horizon, nadir) = rest.split_once('/').ok_or_else(form)?;
            let (zenith, horizon, nadir) = (color(zenith)?, color(horizon)?, color(nadir)?);
            return Ok(Self::Gradient(Gradient { zenith, horizon, nadir }));
        }
        Ok(Self::File(text.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!("640x480".parse(), Ok(Size { width: 640, height: 480 }));
        assert!("0x4".parse::<Size>().unwrap_err().contains("no pixels"));
        assert!("640".parse::<Size>().unwrap_err().contains("WIDTHxHEIGHT"));
        let error = "1000000x1000000".parse::<Size>().unwrap_err();
        assert!(error.contains("65536") && error.contains("268435456"), "{error}");
    }

    #[test]
    fn vectors_and_colors() {
        assert_eq!(vector("-1,2.5,3e1"), Ok(Vec3::new(-1.0, 2.5, 30.0)));
        assert!(vector("1,2").is_err() && vector("1,2,nan").is_err());
        assert_eq!(color("0.5"), Ok(Vec3::splat(0.5)));
        assert!(color("1,-1,0").is_err());
    }

    #[test]
    fn ranges_and_exposures() {
        assert_eq!(frames("3..5"), Ok(3..5));
        assert_eq!(frames("7"), Ok(7..8));
        assert_eq!((seconds("2.5"), rate("29.97"), share("1")), (Ok(2.5), Ok(29.97), Ok(1.0)));
        assert!(
            seconds("-1").is_err() && rate("0").is_err() && share("1.1").is_err() && share("nan").is_err()
        );
        assert!(animation("a.APNG").is_ok() && animation("a.webp").is_err());
        assert!(frames("5..5").is_err() && frames("x").is_err());
        assert_eq!("-1.5".parse(), Ok(Exposure::Ev(-1.5)));
        assert_eq!("auto".parse(), Ok(Exposure::Auto));
        assert!("bright".parse::<Exposure>().is_err());
        assert!(wide_angle("361").is_err() && wide_angle("0").is_err());
    }

    #[test]
    fn shaders() {
        assert_eq!(shader("heat"), Ok(ShaderUse::named("heat")));
        let expected = ShaderUse::named("edges").with("ink", Vec3::new(1.0, 0.5, 0.0)).with("depth", 0.1);
        assert_eq!(shader("edges:ink=1/0.5/0,depth=0.1"), Ok(expected));
        assert!(
            shader("edges:ink").is_err() && shader("edges:ink=1/2").is_err() && shader("heat:low=x").is_err()
        );
    }

    #[test]
    fn materials() {
        assert_eq!("diffuse".parse(), Ok(Materials::Diffuse));
        let depth = "show-depth:far=5".parse::<Materials>().expect("a shader");
        assert!(depth.are_false_colors() && !Materials::AsIs.are_false_colors());
        let problem = "shiny".parse::<Materials>().unwrap_err();
        assert!(problem.contains("show-normal") && problem.contains("as-is"), "{problem}");
        let by_attribute = |factor| {
            let value = ParameterValue::Attribute("face_color".into(), factor);
            Ok(Materials::Attributed(ShaderUse::named("lambert").with("diffuse", value)))
        };
        assert_eq!("lambert:diffuse=@face_color".parse(), by_attribute(Vec3::ONE));
        assert_eq!("lambert:diffuse=@face_color*0.5/1/2".parse(), by_attribute(Vec3::new(0.5, 1.0, 2.0)));
        assert!("lambert:size=@face_color".parse::<Materials>().unwrap_err().contains("diffuse"));
        assert!("lambert:diffuse=@a*b".parse::<Materials>().is_err());
        assert!("show-depth:fur=5".parse::<Materials>().unwrap_err().contains("far"));
    }

    #[test]
    fn surroundings() {
        assert_eq!("none".parse(), Ok(Surroundings::None));
        assert_eq!("0.2,0.3,1".parse(), Ok(Surroundings::Constant(Vec3::new(0.2, 0.3, 1.0))));
        assert_eq!("sky.hdr".parse(), Ok(Surroundings::File("sky.hdr".into())));
        assert!("1,2".parse::<Surroundings>().is_err());
        let (zenith, horizon, nadir) = (Vec3::ONE, Vec3::splat(0.5), Vec3::new(0.1, 0.2, 0.3));
        let gradient = Gradient { zenith, horizon, nadir };
        assert_eq!("1/0.5/0.1,0.2,0.3".parse(), Ok(Surroundings::Gradient(gradient)));
        assert!("1/0.5".parse::<Surroundings>().is_err());
        assert_eq!(sky("3,90,0").map(|sky| sky.turbidity), Ok(3.0));
        assert!(sky("1,20,0").is_err() && sky("3,-1,0").is_err() && sky("3,20").is_err());
    }
}
