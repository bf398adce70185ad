//! Shader scripts: the grammar of `scripts/*.shader`. What it means for a material is decided in `look`.

use std::sync::Arc;

use glam::{Affine2, Mat2, Vec2, Vec3};

use super::words::{Statement, Word, Words};
use crate::context::Context;
use crate::error::LoadError;
use crate::place::Place;

/// One shader of a script.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Shader {
    /// In lower case, with forward slashes.
    pub(super) name: String,
    /// Drawn one over the other.
    pub(super) stages: Vec<Stage>,
    /// Of `surfaceparm`, in lower case.
    pub(super) parameters: Vec<String>,
    /// `cull none` and its other names.
    pub(super) two_sided: bool,
    /// Whether vertices move (`deformVertexes`).
    pub(super) deforms: bool,
    /// `q3map_surfacelight`.
    pub(super) surface_light: f32,
    /// `q3map_lightimage`, else `qer_editorimage`: its mean colour is that of the light.
    pub(super) light_image: Option<String>,
    /// `q3map_sun`.
    pub(super) sun: Option<Sun>,
    /// `skyParms`.
    pub(super) sky: Option<Sky>,
}

/// A sun: colour with a maximum of 1, strength in units of the map's compiler, direction in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sun {
    pub(super) color: Vec3,
    pub(super) intensity: f32,
    /// From +X towards +Y.
    pub(super) azimuth: f32,
    pub(super) elevation: f32,
}

/// What is far away.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Sky {
    /// The name that six images share, without `_rt` and the like.
    pub(super) far_box: Option<String>,
    /// Of the layer of clouds over the viewer, units.
    pub(super) cloud_height: f32,
}

/// One pass over the surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Stage {
    pub(super) map: Map,
    /// `None` replaces what is below.
    pub(super) blend: Option<Blend>,
    pub(super) alpha_test: Option<AlphaTest>,
    pub(super) color: ColorSource,
    /// Constant alpha, if the stage has one.
    pub(super) alpha: Option<f32>,
    /// `tcGen environment`.
    pub(super) reflects: bool,
    /// `texture_from_mesh`, at time 0.
    pub(super) transform: Affine2,
    /// Whether texture coordinates change with time.
    pub(super) moves: bool,
    /// Left out on slow machines.
    pub(super) detail: bool,
}

/// The image of a stage.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) enum Map {
    #[default]
    None,
    Lightmap,
    White,
    Image {
        name: String,
        clamp: bool,
    },
}

/// What a stage does to what is below.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Blend {
    /// Adds itself, times its alpha or not.
    Add,
    /// Multiplies what is there.
    Filter,
    /// Covers it by alpha.
    Over,
    /// Anything else.
    Other,
}

/// What alpha must be for a point to be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum AlphaTest {
    AboveZero,
    BelowHalf,
    AtLeastHalf,
}

/// Where the colour of a stage comes from that multiplies its image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum ColorSource {
    #[default]
    Unstated,
    /// As it is: 1.
    Identity,
    /// Light baked into the vertices, or computed for things that move.
    Vertex,
    /// As on the screen.
    Constant(Vec3),
}

/// Reads all shaders of a script. What is not understood is told of, once per word.
///
/// # Errors
/// When there are more shaders than the limits allow.
pub(super) fn parse(
    context: &mut Context<'_>,
    file: &Arc<str>,
    text: &str,
) -> Result<Vec<Shader>, LoadError> {
    let mut words = Words::new(text);
    let mut shaders = Vec::new();
    let mut unknown = Unknown { file, known: Vec::new() };
    while let Some(word) = words.next() {
        let Word::Text(name) = word else {
            let place = Place::text(file, words.line(), 1);
            context.warn(place, "a brace where the name of a shader should be", "it was passed over");
            continue;
        };
        let line = words.line();
        if !words.open() {
            let message = format!("`{}` is followed by no `{{`", shortened(name));
            context.warn(Place::text(file, line, 1), message, "it was passed over");
            continue;
        }
        context.count_materials(1, &Place::text(file, line, 1))?;
        context.charge(size_of::<Shader>() as u64, &Place::text(file, line, 1))?;
        let mut shader = Shader { name: normalised(name), ..Shader::default() };
        let closed = body(context, &mut words, &mut unknown, &mut shader)?;
        if !closed {
            let message = format!("shader `{}` has no `}}`", shortened(name));
            context.warn(Place::text(file, line, 1), message, "it was taken to end with the file");
        }
        shaders.push(shader);
    }
    Ok(shaders)
}

/// The form in which names are compared: lower case, forward slashes, no extension.
pub(super) fn normalised(name: &str) -> String {
    let name = name.replace('\\', "/").to_ascii_lowercase();
    match name.rsplit_once('.') {
        Some((stem, extension)) if !extension.contains('/') => stem.to_owned(),
        _ => name,
    }
}

fn shortened(name: &str) -> String {
    name.chars().take(64).collect()
}

/// Statements that are not understood, each told of once.
struct Unknown<'a> {
    file: &'a Arc<str>,
    known: Vec<String>,
}

impl Unknown<'_> {
    fn tell(&mut self, context: &mut Context<'_>, line: u32, statement: &str) {
        let shown = shortened(statement);
        if self.known.len() < 32 && !self.known.contains(&shown) {
            let message = format!("`{shown}` is no statement of shader scripts that is known");
            context.warn(Place::text(self.file, line, 1), message, "it was left out");
            self.known.push(shown);
        }
    }
}

/// Reads up to the brace that closes the shader; `false` if there is none.
fn body(
    context: &mut Context<'_>,
    words: &mut Words<'_>,
    unknown: &mut Unknown<'_>,
    shader: &mut Shader,
) -> Result<bool, LoadError> {
    loop {
        match words.next() {
            None => return Ok(false),
            Some(Word::Close) => return Ok(true),
            Some(Word::Open) => {
                let place = Place::text(unknown.file, words.line(), 1);
                context.charge(size_of::<Stage>() as u64, &place)?;
                let mut stage = Stage::default();
                let closed = stage_body(context, words, unknown, &mut stage);
                shader.stages.push(stage);
                if !closed {
                    return Ok(false);
                }
            }
            Some(Word::Text(keyword)) => {
                let statement = words.statement(keyword);
                if !shader.statement(&statement) {
                    unknown.tell(context, words.line(), &statement.keyword);
                }
            }
        }
    }
}

fn stage_body(
    context: &mut Context<'_>,
    words: &mut Words<'_>,
    unknown: &mut Unknown<'_>,
    stage: &mut Stage,
) -> bool {
    loop {
        match words.next() {
            None => return false,
            Some(Word::Close) => return true,
            Some(Word::Open) => unknown.tell(context, words.line(), "{"),
            Some(Word::Text(keyword)) => {
                let statement = words.statement(keyword);
                if !stage.statement(&statement) {
                    unknown.tell(context, words.line(), &statement.keyword);
                }
            }
        }
    }
}

impl Shader {
    /// Whether `surfaceparm` names this.
    pub(super) fn has(&self, parameter: &str) -> bool {
        self.parameters.iter().any(|known| known == parameter)
    }

    /// Takes a statement outside of stages; `false` if it is none.
    fn statement(&mut self, s: &Statement<'_>) -> bool {
        match s.keyword.as_str() {
            "surfaceparm" => self.parameters.extend(s.lower(0)),
            "cull" => {
                self.two_sided = matches!(s.lower(0).as_deref(), Some("none" | "disable" | "twosided"));
            }
            "deformvertexes" => self.deforms = true,
            "q3map_surfacelight" => self.surface_light = s.number(0).unwrap_or(0.0).max(0.0),
            "q3map_lightimage" => self.light_image = s.words.first().map(|name| normalised(name)),
            "qer_editorimage" => {
                let name = s.words.first().map(|name| normalised(name));
                self.light_image = self.light_image.take().or(name);
            }
            "sun" | "q3map_sun" | "q3map_sunext" => self.sun = Sun::parse(s),
            "skyparms" => {
                let far_box = s.words.first().filter(|name| !matches!(**name, "-" | "full" | "half"));
                let far_box = far_box.map(|name| name.replace('\\', "/").to_ascii_lowercase());
                let cloud_height = s.number(1).filter(|height| *height > 0.0).unwrap_or(512.0);
                self.sky = Some(Sky { far_box, cloud_height });
            }
            // What concerns the game, the editor and the compiler but not the look; fog is told of with its volumes.
            "nopicmip" | "nomipmaps" | "polygonoffset" | "portal" | "sort" | "fogparms"
            | "entitymergable" | "light" | "tesssize" | "clamptime" | "cloudparms" | "lightning"
            | "foggen" => {}
            keyword => return keyword.starts_with("q3map_") || keyword.starts_with("qer_"),
        }
        true
    }
}

impl Sun {
    fn parse(s: &Statement<'_>) -> Option<Self> {
        let color = Vec3::new(s.number(0)?, s.number(1)?, s.number(2)?).max(Vec3::ZERO);
        let color = if color.max_element() > 0.0 { color / color.max_element() } else { Vec3::ONE };
        Some(Self { color, intensity: s.number(3)?.max(0.0), azimuth: s.number(4)?, elevation: s.number(5)? })
    }
}

impl Stage {
    /// Takes a statement; `false` if it is none.
    fn statement(&mut self, s: &Statement<'_>) -> bool {
        match s.keyword.as_str() {
            "map" => self.map = Map::parse(s.words.first(), false),
            "clampmap" => self.map = Map::parse(s.words.first(), true),
            // The first picture of the film.
            "animmap" | "clampanimmap" => {
                self.map = Map::parse(s.words.get(1), s.keyword == "clampanimmap");
                self.moves = true;
            }
            "videomap" => {
                self.map = Map::White;
                self.moves = true;
            }
            "blendfunc" => self.blend = blend(s),
            "alphafunc" => {
                self.alpha_test = match s.lower(0).as_deref() {
                    Some("gt0") => Some(AlphaTest::AboveZero),
                    Some("lt128") => Some(AlphaTest::BelowHalf),
                    Some("ge128") => Some(AlphaTest::AtLeastHalf),
                    _ => None,
                };
            }
            "rgbgen" => self.color = ColorSource::parse(s),
            "alphagen" => {
                self.alpha = match s.lower(0).as_deref() {
                    Some("const") => s.number(1).map(|alpha| alpha.clamp(0.0, 1.0)),
                    Some("wave") => mean_of_wave(s),
                    _ => None,
                };
            }
            "tcgen" | "texgen" => self.reflects = s.lower(0).as_deref() == Some("environment"),
            "tcmod" => self.modify(s),
            "detail" => self.detail = true,
            "depthwrite" | "depthfunc" | "nodepthtest" | "nofog" | "stage" => {}
            _ => return false,
        }
        true
    }

    /// `tcMod`: scales and fixed transforms as they are, motions at their start.
    fn modify(&mut self, s: &Statement<'_>) {
        let number = |i: usize| s.number(i).unwrap_or(0.0);
        let change = match s.lower(0).as_deref() {
            Some("scale") => Affine2::from_scale(Vec2::new(number(1), number(2))),
            Some("transform") => Affine2::from_mat2_translation(
                Mat2::from_cols(Vec2::new(number(1), number(2)), Vec2::new(number(3), number(4))),
                Vec2::new(number(5), number(6)),
            ),
            _ => {
                self.moves = true;
                return;
            }
        };
        let transform = change * self.transform;
        if transform.is_finite() {
            self.transform = transform;
        }
    }
}

impl Map {
    fn parse(name: Option<&&str>, clamp: bool) -> Self {
        match name.map(|name| name.to_ascii_lowercase()).as_deref() {
            None => Self::None,
            Some("$lightmap") => Self::Lightmap,
            Some("$whiteimage" | "*white" | "$white") => Self::White,
            Some(name) => Self::Image { name: normalised(name), clamp },
        }
    }
}

impl ColorSource {
    fn parse(s: &Statement<'_>) -> Self {
        match s.lower(0).as_deref() {
            Some("identity" | "identitylighting") => Self::Identity,
            Some("vertex" | "exactvertex" | "oneminusvertex" | "lightingdiffuse") => Self::Vertex,
            Some("const") => match (s.number(1), s.number(2), s.number(3)) {
                (Some(r), Some(g), Some(b)) => {
                    Self::Constant(Vec3::new(r, g, b).clamp(Vec3::ZERO, Vec3::ONE))
                }
                _ => Self::Identity,
            },
            Some("wave") => mean_of_wave(s).map_or(Self::Identity, |v| Self::Constant(Vec3::splat(v))),
            _ => Self::Unstated,
        }
    }
}

/// The mean in time of `wave FUNCTION BASE AMPLITUDE PHASE FREQUENCY`, cut to 0..1.
fn mean_of_wave(s: &Statement<'_>) -> Option<f32> {
    let (base, amplitude) = (s.number(2)?, s.number(3)?);
    // The others swing about their base.
    let mean = match s.lower(1).as_deref() {
        Some("sawtooth" | "inversesawtooth") => base + 0.5 * amplitude,
        _ => base,
    };
    Some(mean.clamp(0.0, 1.0))
}

fn blend(s: &Statement<'_>) -> Option<Blend> {
    let first = s.lower(0)?;
    let second = s.lower(1);
    match (first.as_str(), second.as_deref()) {
        ("add", _) => Some(Blend::Add),
        ("filter", _) => Some(Blend::Filter),
        ("blend", _) => Some(Blend::Over),
        ("gl_one", Some("gl_zero")) => None,
        ("gl_one" | "gl_src_alpha", Some("gl_one")) => Some(Blend::Add),
        ("gl_dst_color", Some("gl_zero" | "gl_one_minus_dst_alpha")) | ("gl_zero", Some("gl_src_color")) => {
            Some(Blend::Filter)
        }
        ("gl_src_alpha", Some("gl_one_minus_src_alpha")) => Some(Blend::Over),
        _ => Some(Blend::Other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::Limits;
    use crate::source::NoFiles;

    fn read(text: &str) -> (Vec<Shader>, Vec<String>) {
        let limits = Limits::default();
        let mut context = Context::new(&limits, &NoFiles);
        let file: Arc<str> = "a.shader".into();
        let shaders = parse(&mut context, &file, text).unwrap();
        (shaders, context.finish(&file).iter().map(ToString::to_string).collect())
    }

    #[test]
    fn the_grammar() {
        let text = "// a comment\nTextures\\A/b.TGA /* { */ {\n surfaceparm Trans\n surfaceparm water\nCULL none\n\
            q3map_surfacelight 300 // more\nqer_editorimage textures/e.tga\nq3map_lightimage textures/l.tga\n\
            q3map_sun 1 0.5 0 150 30 60\nskyparms env/x 700 -\ndeformVertexes wave 100 sin 0 1 0 1\nq3map_novel\n\
            {\nclampmap a/b.jpg\nblendfunc add\nrgbGen const ( 0.5 .25 1 )\nalphaGen const 0.5\n\
            tcMod scale 2 4\ntcMod scroll 1 1\ntcMod transform 1 0 0 1 0.5 0\nalphafunc GE128\ndetail}\n\
            { map $lightmap \n blendFunc gl_dst_color gl_zero\n tcgen lightmap }\n\
            { animMap 5 a b c\n rgbGen wave sawtooth 0.2 0.6 0 1\n tcGen environment } }\nlast { { map $whiteimage } }";
        let (shaders, diagnostics) = read(text);
        assert_eq!(diagnostics, [""; 0]);
        assert_eq!(shaders.len(), 2);
        let shader = &shaders[0];
        assert_eq!(shader.name, "textures/a/b");
        assert!(shader.two_sided && shader.deforms && shader.has("trans") && shader.has("water"));
        assert_eq!((shader.surface_light, shader.light_image.as_deref()), (300.0, Some("textures/l")));
        let sun = Sun { color: Vec3::new(1.0, 0.5, 0.0), intensity: 150.0, azimuth: 30.0, elevation: 60.0 };
        assert_eq!(shader.sun, Some(sun));
        assert_eq!(shader.sky, Some(Sky { far_box: Some("env/x".into()), cloud_height: 700.0 }));
        let [first, second, third] = &shader.stages[..] else { panic!() };
        assert_eq!(first.map, Map::Image { name: "a/b".into(), clamp: true });
        assert_eq!(first.color, ColorSource::Constant(Vec3::new(0.5, 0.25, 1.0)));
        assert_eq!((first.blend, first.alpha), (Some(Blend::Add), Some(0.5)));
        assert_eq!(first.transform.transform_point2(Vec2::ONE), Vec2::new(2.5, 4.0));
        assert!(first.moves && first.detail && first.alpha_test == Some(AlphaTest::AtLeastHalf));
        assert_eq!((&second.map, second.blend), (&Map::Lightmap, Some(Blend::Filter)));
        assert_eq!(third.map, Map::Image { name: "a".into(), clamp: false });
        assert!(third.reflects && third.color == ColorSource::Constant(Vec3::splat(0.5)));
        assert_eq!(shaders[1].stages[0].map, Map::White);
    }

    #[test]
    fn what_is_broken_is_told_of_and_passed_over() {
        let (shaders, diagnostics) = read("} a b { nonsense 1\nnonsense 2\n { map x\n { wrong } ");
        assert_eq!(shaders.len(), 1);
        assert_eq!(shaders[0].stages.len(), 1);
        let all = diagnostics.join("\n");
        for problem in ["a brace where", "`a` is followed", "`nonsense` is no", "`{` is no", "has no `}`"] {
            assert!(all.contains(problem), "{problem}: {all}");
        }
        assert_eq!(diagnostics.iter().filter(|d| d.contains("nonsense")).count(), 1);
    }
}
