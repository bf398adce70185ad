//! What the stages of a shader add up to: which image reflects light, which ones glow, what is seen through.
//!
//! Stages are drawn one over the other. One that replaces what is below starts anew; light maps and vertex colours make
//! what is there so far a reflector; what is added after them, or without them, glows.

use super::script::{AlphaTest, Blend, ColorSource, Map, Shader, Stage};

/// The sum of a shader's stages.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Look<'a> {
    /// What covers the surface, if it does.
    pub(super) base: Option<&'a Stage>,
    /// Mirrors its surroundings as a picture of them.
    pub(super) mirror: Option<&'a Stage>,
    /// Added on top, unlit.
    pub(super) glow: Vec<&'a Stage>,
    /// Whether light falls on the base, rather than it being shown as it is.
    pub(super) lit: bool,
    /// What shows through.
    pub(super) cover: Cover,
    /// Stages that could not be shown.
    pub(super) left_out: usize,
}

/// How a surface covers what is behind it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Cover {
    #[default]
    Opaque,
    /// Holes by alpha, below this value.
    Holes(f32),
    /// By alpha.
    Alpha,
    /// Not at all: it only adds light.
    Glow,
    /// By its colours, as a filter.
    Filter,
}

impl<'a> Look<'a> {
    /// Adds up the stages.
    pub(super) fn new(shader: &'a Shader) -> Self {
        let mut look = Self::default();
        let mut empty = true;
        for stage in shader.stages.iter().filter(|stage| stage.map != Map::None) {
            if stage.detail {
                look.left_out += 1;
                continue;
            }
            look.add(stage, empty);
            empty = false;
        }
        look
    }

    fn add(&mut self, stage: &'a Stage, first: bool) {
        if stage.map == Map::Lightmap {
            self.lit = true;
            // What was added before is lit with the rest; the base stands for it.
            self.left_out += self.glow.len();
            self.glow.clear();
            return;
        }
        match stage.blend {
            None => self.replace(stage, Cover::Opaque),
            // The light map came first.
            Some(Blend::Filter) if self.base.is_none() && self.lit => self.set(stage),
            Some(Blend::Over) if first => self.replace(stage, Cover::Alpha),
            // Where it lets things show that are below, these count for less than it.
            Some(Blend::Over) => {
                let cover = self.cover;
                self.replace(stage, if cover == Cover::Glow { Cover::Alpha } else { cover });
            }
            Some(Blend::Add) => {
                if first {
                    self.cover = Cover::Glow;
                }
                if stage.reflects {
                    self.mirror = Some(stage);
                } else {
                    self.glow.push(stage);
                }
            }
            Some(Blend::Filter) if first => self.replace(stage, Cover::Filter),
            Some(Blend::Filter | Blend::Other) => self.left_out += 1,
        }
    }

    /// What was below is gone.
    fn replace(&mut self, stage: &'a Stage, cover: Cover) {
        self.left_out += self.glow.len() + usize::from(self.base.is_some_and(|below| below.map != stage.map));
        self.glow.clear();
        // A light map below lights nothing that covers it.
        self.lit = stage.color == ColorSource::Vertex;
        self.cover = match (stage.alpha_test, cover) {
            (Some(AlphaTest::AboveZero), _) => Cover::Holes(1.0 / 255.0),
            (Some(AlphaTest::AtLeastHalf), _) => Cover::Holes(0.5),
            (_, cover) => cover,
        };
        self.set(stage);
    }

    fn set(&mut self, stage: &'a Stage) {
        if stage.reflects {
            self.mirror = Some(stage);
        } else {
            self.base = Some(stage);
            self.mirror = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(name: &str, blend: Option<Blend>) -> Stage {
        Stage { map: Map::Image { name: name.into(), clamp: false }, blend, ..Stage::default() }
    }

    fn lightmap() -> Stage {
        Stage { map: Map::Lightmap, blend: Some(Blend::Filter), ..Stage::default() }
    }

    fn name(stage: Option<&Stage>) -> &str {
        match stage.map(|stage| &stage.map) {
            Some(Map::Image { name, .. }) => name,
            _ => "",
        }
    }

    #[test]
    fn what_comes_after_the_light_map_glows() {
        let stages = vec![image("wall", None), lightmap(), image("lamp", Some(Blend::Add))];
        let shader = Shader { stages, ..Shader::default() };
        let look = Look::new(&shader);
        assert_eq!((name(look.base), look.lit, look.cover), ("wall", true, Cover::Opaque));
        assert_eq!(name(look.glow.first().copied()), "lamp");
    }

    #[test]
    fn a_light_map_below_lights_the_image_over_it() {
        let first = Stage { blend: None, ..lightmap() };
        let shader = Shader { stages: vec![first, image("wall", Some(Blend::Filter))], ..Shader::default() };
        let look = Look::new(&shader);
        assert_eq!((name(look.base), look.lit), ("wall", true));
    }

    #[test]
    fn without_light_all_is_as_it_is() {
        let stages = vec![image("lava", None), image("lava", Some(Blend::Add))];
        let shader = Shader { stages, ..Shader::default() };
        let look = Look::new(&shader);
        assert_eq!((name(look.base), look.lit, look.glow.len()), ("lava", false, 1));
    }

    #[test]
    fn covers() {
        for (blend, cover) in
            [(Blend::Add, Cover::Glow), (Blend::Filter, Cover::Filter), (Blend::Over, Cover::Alpha)]
        {
            let shader = Shader { stages: vec![image("a", Some(blend))], ..Shader::default() };
            assert_eq!(Look::new(&shader).cover, cover);
        }
        let grate = Stage { alpha_test: Some(AlphaTest::AtLeastHalf), ..image("grate", None) };
        let shader = Shader { stages: vec![grate, lightmap()], ..Shader::default() };
        let look = Look::new(&shader);
        assert_eq!((look.cover, look.lit), (Cover::Holes(0.5), true));
    }

    #[test]
    fn a_mirror_over_an_image_and_alone() {
        let mirror = Stage { reflects: true, ..image("chrome", None) };
        let shader = Shader { stages: vec![image("metal", None), mirror, lightmap()], ..Shader::default() };
        let look = Look::new(&shader);
        assert_eq!((name(look.base), name(look.mirror), look.lit), ("metal", "chrome", true));
    }
}
