//! Points, closures and parameters at random, for tests of shaders.

use glam::{Mat3, Quat, Vec3};

use super::{Input, Parameter};
use crate::closure::{Closure, Closures};
use crate::lanes::{Vector, WIDTH, Whole};
use crate::point::Points;

/// Deterministic numbers in [0, 1).
#[derive(Debug)]
pub(crate) struct Random(u32);

impl Random {
    pub(crate) fn new(seed: u32) -> Self {
        Self(seed.hashed())
    }

    pub(crate) fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9);
        self.0.hashed().unit()
    }

    fn signed(&mut self) -> f32 {
        self.unit() * 2.0 - 1.0
    }

    pub(crate) fn direction(&mut self) -> Vec3 {
        let v = Vec3::new(self.signed(), self.signed(), self.signed());
        v.try_normalize().unwrap_or(Vec3::Y)
    }

    /// A packet of points of a metre around the origin, seen from everywhere; footprints from none to a decimetre.
    pub(crate) fn points(&mut self) -> Points {
        let mut points = Points::default();
        for lane in 0..WIDTH {
            let position = Vec3::new(self.signed(), self.signed(), self.signed());
            let ng = self.direction();
            let normal = (ng + 0.2 * self.direction()).normalize();
            let scale = 0.25 + 2.0 * self.unit();
            let turn = Mat3::from_quat(Quat::from_axis_angle(self.direction(), self.unit() * 6.0)) * scale;
            points.position.set(lane, position);
            points.object_position.set(lane, turn * position);
            points.ng.set(lane, ng);
            points.normal.set(lane, normal);
            points.wo.set(lane, self.direction());
            points.color.set(lane, Vec3::ONE);
            points.alpha.0[lane] = 1.0;
            points.distance.0[lane] = 10.0 * self.unit();
            points.level.0[lane] = 1.0 + (4.0 * self.unit()).floor();
            points.width.0[lane] = 0.1 * (self.unit() - 0.2).max(0.0).powi(4);
            for floats in points.uv.iter_mut().flatten() {
                floats.0[lane] = self.unit() * 4.0 - 2.0;
            }
            for (column, to) in turn.to_cols_array_2d().into_iter().zip(&mut points.object_from_world) {
                to.set(lane, column.into());
            }
        }
        points
    }

    /// The same at places that no scene should have.
    pub(crate) fn extreme_points(&mut self) -> Points {
        const ODD: [f32; 6] = [0.0, 1e-30, 1e12, -1e20, 3e38, -7.5];
        let mut points = self.points();
        let odd = |random: &mut Self| ODD[(random.unit() * 6.0) as usize];
        for lane in 0..WIDTH {
            points.object_position.set(lane, Vec3::new(odd(self), odd(self), odd(self)));
            points.width.0[lane] = odd(self).abs();
            points.distance.0[lane] = odd(self).abs();
            points.uv[0][0].0[lane] = odd(self);
            points.uv[0][1].0[lane] = odd(self);
        }
        points
    }

    /// A value that a parameter may have: often an end of its range.
    pub(crate) fn value(&mut self, parameter: &Parameter) -> Vec3 {
        let [low, high] = parameter.range;
        let component = |random: &mut Self, default: f32| match (random.unit() * 6.0) as u32 {
            0 => low,
            1 => high,
            2 => (default * (0.5 + random.unit())).clamp(low, high),
            3 => default,
            _ => low + (high - low) * random.unit().powi(4),
        };
        Vec3::from(parameter.default.map(|default| component(self, default)))
    }
}

/// Every parameter at its default.
pub(crate) fn defaults(parameters: &[Parameter]) -> Vec<Input> {
    parameters.iter().map(|p| Input::constant(p.default.into())).collect()
}

/// The closures of half-glossy grey plastic at points.
pub(crate) fn grey_plastic(points: &Points) -> Closures {
    let mut closures = Closures::default();
    for lane in 0..WIDTH {
        let normal = Vector::from(points.normal.get(lane));
        let grey = Vector::grey(0.5);
        let closure = Closure {
            base_color: grey,
            opacity: 1.0,
            metallic: 0.1,
            roughness: 0.33,
            specular: 0.9,
            specular_color: Vector::grey(1.1),
            transmission: 0.15,
            coat: 0.2,
            coat_roughness: 0.3,
            emission: Vector::grey(0.01),
            ambient: Vector::grey(0.02),
            normal,
            coat_normal: normal,
        };
        closures.store(&closure, lane);
    }
    closures
}

/// All numbers of a lane's closure, after they were moved into their ranges.
pub(crate) fn numbers(closures: &Closures, lane: usize) -> Vec<f32> {
    let c = closures.load::<f32>((), lane).sane();
    let vectors = [c.base_color, c.specular_color, c.emission, c.ambient, c.normal, c.coat_normal];
    let shares = [c.opacity, c.metallic, c.roughness, c.specular, c.transmission, c.coat, c.coat_roughness];
    vectors.into_iter().flat_map(|v| [v.x, v.y, v.z]).chain(shares).collect()
}
