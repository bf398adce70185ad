//! The values of a shader's parameters at points.

use glam::{Vec2, Vec3, Vec4};

use crate::lanes::{Real, Vector, Vectors};
use crate::material::{Slot, TextureCoordinates};
use crate::point::Points;
use crate::texture::Footprint;

/// Where a parameter's value comes from.
#[derive(Clone, Debug)]
pub struct Input {
    /// In the parameter's range; numbers have three equal components.
    pub(crate) factor: Vec3,
    /// Multiplies the factor.
    pub(crate) texture: Option<Slot>,
}

impl Input {
    /// The same value everywhere.
    pub fn constant(value: Vec3) -> Self {
        Self { factor: value, texture: None }
    }

    /// The value, or what the texture is multiplied by.
    pub fn factor(&self) -> Vec3 {
        self.factor
    }

    /// Whether a texture makes it vary from point to point.
    pub fn is_textured(&self) -> bool {
        self.texture.is_some()
    }

    /// The values at the first `count` points.
    pub fn values(&self, points: &Points, count: usize, out: &mut Vectors) {
        for lane in 0..count {
            let texel = self
                .texture
                .as_ref()
                .map_or(Vec3::ONE, |slot| slot.lookup(&points.coordinates::<f32>((), lane)).rgb.into());
            out.set(lane, self.factor * texel);
        }
    }

    /// The value, and the texture's alpha, at texture coordinates other than those of the point, filtered over `width` of
    /// them. Anything that is not finite counts as 0.
    pub fn sample(&self, uv: Vec2, width: f32) -> Vec4 {
        let Some(slot) = &self.texture else { return self.factor.extend(1.0) };
        let square = Footprint { uv: uv.to_array(), lod: width.log2(), along: [0.0; 2], probes: 1.0 };
        let texel = slot.filtered::<f32>(square);
        (self.factor * Vec3::from(texel.rgb)).extend(texel.a)
    }
}

/// The parameters of a shader at points.
#[derive(Debug)]
pub struct Inputs<'a, F: Real> {
    token: F::Token,
    inputs: &'a [Input],
    at: TextureCoordinates<F>,
}

impl<'a, F: Real> Inputs<'a, F> {
    #[inline(always)]
    pub(crate) fn new(token: F::Token, lane: usize, inputs: &'a [Input], points: &Points) -> Self {
        Self { token, inputs, at: points.coordinates(token, lane) }
    }

    /// The parameter at a place of [`ShaderInfo::parameters`](super::ShaderInfo::parameters), as a vector or colour.
    #[inline(always)]
    pub fn vector(&self, parameter: usize) -> Vector<F> {
        let input = &self.inputs[parameter];
        let factor = Vector::constant(self.token, input.factor);
        match &input.texture {
            Some(slot) => factor * slot.lookup(&self.at).rgb,
            None => factor,
        }
    }

    /// The parameter as a number.
    #[inline(always)]
    pub fn float(&self, parameter: usize) -> F {
        let input = &self.inputs[parameter];
        let factor = F::constant(self.token, input.factor.x);
        match &input.texture {
            Some(slot) => factor * slot.lookup(&self.at).rgb.x,
            None => factor,
        }
    }

    /// The same number in every lane.
    #[inline(always)]
    pub fn constant(&self, value: f32) -> F {
        F::constant(self.token, value)
    }
}
