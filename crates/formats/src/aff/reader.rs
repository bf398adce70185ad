//! Statements into a graph of nodes: blocks, included files, and what stands in them.

use std::collections::HashMap;
use std::f32::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, Vec3};
use heliostat_scene::{Camera, Edit, Environment, Light, MaterialId, SceneBuilder, TextureRef, UvTransform};

use super::graph::{Child, Node, Way};
use super::keyframes::{Animation, fixed};
use super::mesh::{self, Written};
use super::motion::{AffMotion, moved_camera, moved_light};
use super::textures::Textures;
use crate::context::Context;
use crate::error::LoadError;
use crate::nff::fill::{Fill, FillKey, extended, linear};
use crate::nff::shapes::Kind;
use crate::nff::statement::{self, Polygon};
use crate::nff::tokens::Tokens;
use crate::nff::{Ignored, lights};
use crate::place::Place;

/// Files included in one another.
const MAX_INCLUDES: usize = 32;

/// What decides how an included file turns out, beside itself: the fill and the detail level.
type State = (FillKey, i64);

/// A light as written: position, colour, and the name of its animation.
type WrittenLight = ((Vec3, Option<Vec3>), Option<String>);

/// The state of one load.
pub(super) struct Reader<'c, 'a> {
    pub(super) context: &'c mut Context<'a>,
    pub(super) builder: SceneBuilder,
    pub(super) nodes: Vec<Node>,
    pub(super) animations: HashMap<String, Arc<Animation>>,
    pub(super) motion: AffMotion,
    /// The node that takes what comes next, and those around it.
    open: Vec<usize>,
    fill: Fill,
    level: i64,
    /// Of all included files.
    highest: i64,
    materials: HashMap<(FillKey, Option<String>), MaterialId>,
    textures: Textures,
    lights: Vec<WrittenLight>,
    camera: Option<Camera>,
    background: Vec3,
    /// Multiplies the ambient colour of all fills, wherever it stands in the file.
    ambient: Vec3,
    /// Start, end, number of frames.
    span: Option<(f64, f64, u32)>,
    /// Included files that are being read, and what those read before became: node and the state they left.
    including: Vec<String>,
    included: HashMap<(String, State), (usize, Fill, i64)>,
    ignored: Ignored,
    polygon: Polygon,
}

impl<'c, 'a> Reader<'c, 'a> {
    pub(super) fn new(context: &'c mut Context<'a>) -> Self {
        let level = context.limits.detail_level.map_or(0, i64::from);
        Self {
            context,
            builder: SceneBuilder::new(),
            nodes: vec![Node::default()],
            animations: HashMap::new(),
            motion: AffMotion::default(),
            open: vec![0],
            fill: Fill::NEUTRAL,
            level,
            highest: 0,
            materials: HashMap::new(),
            textures: Textures::default(),
            lights: Vec::new(),
            camera: None,
            background: Vec3::ZERO,
            ambient: Vec3::ONE,
            span: None,
            including: Vec::new(),
            included: HashMap::new(),
            ignored: Ignored::default(),
            polygon: Polygon::default(),
        }
    }

    /// Reads a file into the node that is open.
    pub(super) fn read(&mut self, file: &Arc<str>, bytes: &[u8]) -> Result<(), LoadError> {
        let mut tokens = Tokens::new(file, bytes);
        let depth = self.open.len();
        while let Some(keyword) = tokens.word() {
            if keyword == b"}" {
                if self.open.len() == depth {
                    self.context.warn(tokens.place(), "`}` without its `{` was ignored", "");
                } else {
                    self.open.pop();
                }
            } else if !self.statement(&mut tokens, keyword)? {
                self.ignored.tell(self.context, &mut tokens, keyword);
            }
        }
        if self.open.len() > depth {
            let message = format!("{} blocks are still open at the end of the file", self.open.len() - depth);
            self.context.warn(tokens.place(), message, "`}` is missing");
            self.open.truncate(depth);
        }
        Ok(())
    }

    fn node(&mut self) -> &mut Node {
        let index = self.open.last().copied().unwrap_or_default();
        &mut self.nodes[index]
    }

    /// Reads what follows a keyword; `false` if it is none.
    fn statement(&mut self, tokens: &mut Tokens<'_>, keyword: &[u8]) -> Result<bool, LoadError> {
        match keyword {
            b"v" => self.camera = Some(statement::view(self.context, tokens)?.0),
            b"b" => self.background = linear(tokens.color("the background")?),
            b"l" | b"la" => {
                let name = if keyword == b"la" { Some(tokens.name("the light's name")?) } else { None };
                self.context.charge(128, &tokens.place())?;
                self.lights.push((statement::light(tokens)?, name));
            }
            b"f" => self.fill = Fill::parse(tokens)?,
            b"fm" => self.fill = extended(tokens)?,
            b"a" => {
                let (start, end) = (tokens.float("the start")?, tokens.float("the end")?);
                if !(start.is_finite() && end.is_finite() && start <= end) {
                    let problem = format!("the animation runs from {start} to {end}");
                    return Err(tokens.error(problem, "give finite times, the later one last"));
                }
                self.span = Some((start.into(), end.into(), tokens.count("the number of frames", 1)?));
            }
            b"am" => self.ambient = tokens.color("the ambient light")?,
            b"d" => {
                let level = tokens.integer("the detail level")?;
                if self.context.limits.detail_level.is_none() {
                    self.level = level;
                }
            }
            b"i" => self.include(tokens)?,
            b"k" => {
                let (name, animation) = Animation::parse(self.context, tokens)?;
                self.animations.insert(name, Arc::new(animation));
            }
            b"x" => {
                let way = Way::Named(tokens.name("the transform's name")?);
                self.block(tokens, way)?;
            }
            b"xs" => {
                let (scale, axis) = (tokens.vector("the scale")?, tokens.vector("the axis")?);
                let (degrees, translation) = (tokens.float("the angle")?, tokens.vector("the translation")?);
                let transform = fixed(scale, axis, degrees, translation);
                if !transform.is_finite() {
                    return Err(tokens.error("the transform is not finite", "give finite numbers"));
                }
                self.block(tokens, Way::Fixed(transform))?;
            }
            _ => return self.shape(tokens, keyword),
        }
        Ok(true)
    }

    fn shape(&mut self, tokens: &mut Tokens<'_>, keyword: &[u8]) -> Result<bool, LoadError> {
        match keyword {
            b"s" | b"c" => {
                let shape =
                    if keyword == b"s" { statement::sphere(tokens)? } else { statement::cone(tokens)? };
                self.context.charge(size_of_val(&shape) as u64, &tokens.place())?;
                let material = self.material(tokens, None)?;
                self.node().shapes.quadric(material, shape);
            }
            b"p" | b"pp" => {
                let mut polygon = std::mem::take(&mut self.polygon);
                statement::polygon(self.context, tokens, &mut polygon, keyword == b"pp")?;
                let material = self.material(tokens, None)?;
                self.node().shapes.polygon(material, &polygon);
                self.polygon = polygon;
            }
            b"tt" | b"ttp" => {
                let (texture, smooth) = (tokens.name("the texture's name")?, keyword == b"ttp");
                let material = self.material(tokens, Some(&texture))?;
                let index = self.open.last().copied().unwrap_or_default();
                let mesh = self.nodes[index].shapes.mesh(Kind { material, smooth, textured: true });
                mesh::textured_triangle(self.context, tokens, smooth, mesh)?;
            }
            b"m" => {
                let mesh = Written::parse(self.context, tokens)?;
                let material = self.material(tokens, mesh.texture.as_deref())?;
                let (smooth, textured) = (!mesh.normals.is_empty(), !mesh.uvs.is_empty());
                let index = self.open.last().copied().unwrap_or_default();
                let to = self.nodes[index].shapes.mesh(Kind { material, smooth, textured });
                mesh.append(self.context, tokens, to)?;
            }
            b"tpa" => {
                let material = self.material(tokens, None)?;
                let index = self.open.last().copied().unwrap_or_default();
                self.nodes[index].deforming.parse(self.context, tokens, material)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Opens a block after its transform.
    fn block(&mut self, tokens: &mut Tokens<'_>, way: Way) -> Result<(), LoadError> {
        super::open_brace(tokens)?;
        let place = tokens.place();
        let (levels, limit) = (self.open.len() as u64, self.context.limits.nesting);
        if levels > limit {
            return Err(LoadError::limit(place, "levels of blocks", levels, "nesting", limit));
        }
        let node = self.new_node(&place)?;
        self.node().children.push(Child { node, way });
        self.open.push(node);
        Ok(())
    }

    fn new_node(&mut self, place: &Place) -> Result<usize, LoadError> {
        let (count, limit) = (self.nodes.len() as u64, self.context.limits.nodes);
        if count > limit {
            return Err(LoadError::limit(place.clone(), "blocks and included files", count, "nodes", limit));
        }
        self.context.charge(size_of::<Node>() as u64 + 64, place)?;
        self.nodes.push(Node::default());
        Ok(self.nodes.len() - 1)
    }

    /// `i` after the keyword. A file that cannot be read is left out with a warning.
    fn include(&mut self, tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
        let level = tokens.integer("the detail level")?;
        self.highest = self.highest.max(level);
        let name = tokens.name("the file's name")?.replace('\\', "/");
        let place = tokens.place();
        if level > self.level {
            let message = format!("`{name}` has detail level {level} and was left out");
            let hint = format!("the level is {}; raise it to see the file", self.level);
            self.context.note(place, message, hint);
            return Ok(());
        }
        if self.including.contains(&name) || self.including.len() >= MAX_INCLUDES {
            let problem = match self.including.contains(&name) {
                true => format!("`{name}` includes itself"),
                false => format!("more than {MAX_INCLUDES} files are included in one another"),
            };
            return Err(tokens.error(problem, "break the chain of `i`"));
        }
        let key = (name.clone(), (self.fill.key(), self.level));
        let (node, fill, level) = match self.included.get(&key) {
            Some(known) => *known,
            None => {
                let bytes = match self.context.read(&name) {
                    Ok(bytes) => bytes,
                    Err(error) => {
                        let hint = "put the file there, or choose another detail level";
                        self.context.warn(place, format!("included file `{name}`: {error}"), hint);
                        return Ok(());
                    }
                };
                let node = self.new_node(&place)?;
                self.open.push(node);
                self.including.push(name.clone());
                self.read(&name.as_str().into(), &bytes)?;
                self.including.pop();
                self.open.pop();
                let result = (node, self.fill, self.level);
                self.included.insert(key, result);
                result
            }
        };
        (self.fill, self.level) = (fill, level);
        self.context.charge(size_of::<Child>() as u64, &place)?;
        self.node().children.push(Child { node, way: Way::Fixed(DAffine3::IDENTITY) });
        Ok(())
    }

    /// The current fill's material, with a texture.
    fn material(&mut self, tokens: &Tokens<'_>, texture: Option<&str>) -> Result<MaterialId, LoadError> {
        let key = (self.fill.key(), texture.map(str::to_owned));
        if let Some(&known) = self.materials.get(&key) {
            return Ok(known);
        }
        let place = tokens.place();
        self.context.count_materials(1, &place)?;
        let mut material = self.fill.material(format!("fill {}", self.materials.len()));
        if let Some(name) = texture {
            let texture = self.textures.get(self.context, &mut self.builder, &place, name)?;
            material.base_color_texture =
                Some(TextureRef { texture, uv_set: 0, transform: UvTransform::IDENTITY });
            material.name = format!("{} {name}", material.name);
        }
        let id = self.builder.material(material);
        self.materials.insert(key, id);
        Ok(id)
    }

    /// The edits, what moves, and frames per second.
    pub(super) fn finish(
        mut self,
        file: &Arc<str>,
    ) -> Result<(Vec<Edit>, AffMotion, Option<f64>), LoadError> {
        let frame_rate = self.time_span();
        if self.highest > 0 {
            let (level, highest) = (self.level, self.highest);
            let message = format!("detail level {level} is read, and the file goes up to {highest}");
            let hint = "choose another by `Limits::detail_level`, on the command line `--detail-level`";
            self.context.note(Place::whole(file), message, hint);
        }
        self.views_and_lights();
        if self.background != Vec3::ZERO {
            self.builder.environment(Environment::Constant(self.background));
        }
        let nothing = self.nodes.iter().all(Node::is_empty);
        if nothing && self.camera.is_none() {
            let hint = "an AFF file has lines such as `v` with a view and `i 0 room.aff`";
            return Err(LoadError::input(Place::whole(file), "the file has no view and no shapes", hint));
        }
        if nothing {
            self.context.warn(Place::whole(file), "the file has no shapes; nothing is shown", "");
        }
        let hidden = self.place_all(file)?;
        let mut edits = self.builder.finish();
        for edit in &mut edits {
            if let Edit::Material(_, material) = edit {
                let material = Arc::make_mut(material);
                material.ambient = (material.ambient * self.ambient).min(Vec3::splat(f32::MAX));
            }
        }
        edits.extend(hidden.into_iter().map(|id| Edit::ShowInstance(id, false)));
        Ok((edits, self.motion, frame_rate))
    }

    /// Sets the span of time: what `a` says, or else that of all keys.
    fn time_span(&mut self) -> Option<f64> {
        if let Some((start, end, frames)) = self.span {
            (self.motion.start, self.motion.end) = (start, end);
            // The first frame shows the start, the last one the end.
            return (frames > 1 && end > start).then(|| f64::from(frames - 1) / (end - start));
        }
        let keys = self.animations.values().filter_map(|animation| animation.span());
        let meshes = self.nodes.iter().flat_map(|node| &node.deforming.meshes);
        let meshes = meshes
            .filter_map(|(_, mesh)| Some((f64::from(*mesh.times.first()?), f64::from(*mesh.times.last()?))));
        let span = keys.chain(meshes).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        (self.motion.start, self.motion.end) = span.unwrap_or_default();
        None
    }

    fn views_and_lights(&mut self) {
        let start = self.motion.start;
        let animation = self.animations.get("camera").cloned();
        let camera = self.camera.clone().or_else(|| {
            let plain = Camera::look_at("view", Vec3::Z, Vec3::ZERO, Vec3::Y, PI / 4.0);
            animation.is_some().then_some(plain)
        });
        if let Some(camera) = camera {
            let now = animation.as_ref().map_or(camera.clone(), |a| moved_camera(&camera, a, start));
            let id = self.builder.camera(now);
            self.motion.camera = animation.map(|animation| (id, camera.clone(), animation));
            self.camera = Some(camera);
        }
        let written: Vec<_> = self.lights.iter().map(|(light, _)| *light).collect();
        let made = lights(&written, &glam::Affine3A::IDENTITY);
        for (light, (_, name)) in made.into_iter().zip(std::mem::take(&mut self.lights)) {
            let animation = name.as_ref().and_then(|name| self.animations.get(name)).cloned();
            let light = Light { name: name.unwrap_or_else(|| light.name.clone()), ..light };
            let now = animation.as_ref().map_or(light.clone(), |a| moved_light(&light, a, start));
            let id = self.builder.light(now);
            self.motion.lights.extend(animation.map(|animation| (id, light, animation)));
        }
    }
}
