//! The values of a shader's parameters at points.

use glam::{Vec2, Vec3, Vec4};

use crate::attribute::AttributeInput;
use crate::lanes::{Real, Vector, Vectors};
use crate::material::{Slot, TextureCoordinates};
use crate::point::Points;
use crate::texture::Footprint;

/// Where a parameter's value comes from.
#[derive(Clone, Debug)]
pub struct Input {
    /// Numbers have three equal components. In the parameter's range, unless it multiplies an attribute.
    pub(crate) factor: Vec3,
    pub(crate) source: InputSource,
}

/// What multiplies the factor of an input.
#[derive(Clone, Debug)]
pub(crate) enum InputSource {
    /// Nothing.
    Constant,
    /// A texture.
    Texture(Slot),
    /// An attribute of the geometry. The product is at the points already.
    Attribute(AttributeInput),
}

impl Input {
    /// The same value everywhere.
    pub fn constant(value: Vec3) -> Self {
        Self { factor: value, source: InputSource::Constant }
    }

    /// The value, or what the texture or the attribute is multiplied by.
    pub fn factor(&self) -> Vec3 {
        self.factor
    }

    /// Whether a texture or an attribute makes it vary from point to point.
    pub fn varies(&self) -> bool {
        !matches!(self.source, InputSource::Constant)
    }

    pub(crate) fn attribute(&self) -> Option<&AttributeInput> {
        match &self.source {
            InputSource::Attribute(attribute) => Some(attribute),
            _ => None,
        }
    }

    /// The values at the first `count` points.
    pub fn values(&self, points: &Points, count: usize, out: &mut Vectors) {
        for lane in 0..count {
            let value = match &self.source {
                InputSource::Constant => self.factor,
                InputSource::Texture(slot) => {
                    let texel: Vec3 = slot.lookup(&points.coordinates::<f32>((), lane)).rgb.into();
                    self.factor * texel
                }
                InputSource::Attribute(attribute) => points.attributes[attribute.slot].get(lane),
            };
            out.set(lane, value);
        }
    }

    /// The value in a lane, and the texture's alpha, at texture coordinates other than those of the point, filtered over
    /// `width` of them. Anything that is not finite counts as 0. Values without a texture are those of the point.
    pub fn sample(&self, points: &Points, lane: usize, uv: Vec2, width: f32) -> Vec4 {
        match &self.source {
            InputSource::Constant => self.factor.extend(1.0),
            InputSource::Texture(slot) => {
                let square = Footprint { uv: uv.to_array(), lod: width.log2(), along: [0.0; 2], probes: 1.0 };
                let texel = slot.filtered::<f32>(square);
                (self.factor * Vec3::from(texel.rgb)).extend(texel.a)
            }
            InputSource::Attribute(attribute) => points.attributes[attribute.slot].get(lane).extend(1.0),
        }
    }
}

/// The parameters of a shader at points.
#[derive(Debug)]
pub struct Inputs<'a, F: Real> {
    token: F::Token,
    inputs: &'a [Input],
    at: TextureCoordinates<F>,
    attributes: &'a [Vectors],
    /// The first lane.
    lane: usize,
}

impl<'a, F: Real> Inputs<'a, F> {
    #[inline(always)]
    pub(crate) fn new(token: F::Token, lane: usize, inputs: &'a [Input], points: &'a Points) -> Self {
        let (at, attributes) = (points.coordinates(token, lane), &points.attributes[..]);
        Self { token, inputs, at, attributes, lane }
    }

    /// The parameter at a place of [`ShaderInfo::parameters`](super::ShaderInfo::parameters), as a vector or colour.
    #[inline(always)]
    pub fn vector(&self, parameter: usize) -> Vector<F> {
        let input = &self.inputs[parameter];
        let factor = Vector::constant(self.token, input.factor);
        match &input.source {
            InputSource::Constant => factor,
            InputSource::Texture(slot) => factor * slot.lookup(&self.at).rgb,
            InputSource::Attribute(attribute) => {
                Vector::load(self.token, &self.attributes[attribute.slot], self.lane)
            }
        }
    }

    /// The parameter as a number.
    #[inline(always)]
    pub fn float(&self, parameter: usize) -> F {
        let input = &self.inputs[parameter];
        let factor = F::constant(self.token, input.factor.x);
        match &input.source {
            InputSource::Constant => factor,
            InputSource::Texture(slot) => factor * slot.lookup(&self.at).rgb.x,
            InputSource::Attribute(attribute) => {
                F::load(self.token, &self.attributes[attribute.slot].x, self.lane)
            }
        }
    }

    /// The same number in every lane.
    #[inline(always)]
    pub fn constant(&self, value: f32) -> F {
        F::constant(self.token, value)
    }
}
