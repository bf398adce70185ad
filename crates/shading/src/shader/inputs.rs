//! The values of a shader's parameters at points.

use glam::Vec3;

use crate::lanes::{Real, Vector};
use crate::material::{Slot, TextureCoordinates};
use crate::point::Points;

/// Where a parameter's value comes from.
#[derive(Clone, Debug)]
pub struct Input {
    /// In the parameter's range; numbers have three equal components.
    pub(crate) factor: Vec3,
    /// Multiplies the factor.
    pub(crate) texture: Option<Slot>,
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
