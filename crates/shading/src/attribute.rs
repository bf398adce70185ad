//! Attributes of geometries at points, as parameters of shaders take them.

use glam::{Vec2, Vec3};
use heliostat_scene::{Attribute, AttributeScope, Geometry, GeometryId};

use crate::gather::Reached;
use crate::lanes::{Vectors, WIDTH};
use crate::material::SurfaceMaterial;
use crate::placement::ShadedPart;
use crate::point::Points;
use crate::shader::{Parameter, ParameterKind};

/// A parameter that takes its values from an attribute.
#[derive(Clone, Debug)]
pub(crate) struct AttributeInput {
    /// Of the attribute.
    pub(crate) name: String,
    /// Where its values are in [`Points::attributes`].
    pub(crate) slot: usize,
    parameter: String,
    factor: Vec3,
    default: Vec3,
    range: [Vec3; 2],
    is_float: bool,
}

impl AttributeInput {
    pub(crate) fn new(parameter: &Parameter, name: &str, factor: Vec3, slot: usize) -> Self {
        let is_float = parameter.kind == ParameterKind::Float;
        let default = match is_float {
            true => Vec3::splat(parameter.default[0]),
            false => parameter.default.into(),
        };
        let (name, parameter_name) = (name.into(), parameter.name.clone());
        Self {
            name,
            parameter: parameter_name,
            slot,
            factor,
            default,
            range: parameter.range.map(Vec3::splat),
            is_float,
        }
    }

    /// Says that geometries lack the attribute, one of which is `first`.
    pub(crate) fn missing(&self, material: &str, first: GeometryId, others: usize) -> String {
        let Self { name, parameter, .. } = self;
        let lack = if others == 0 { "has".to_owned() } else { format!("and {others} more have") };
        format!(
            "material `{material}`: {first} {lack} no attribute `{name}`; `{parameter}` keeps its default there"
        )
    }

    /// The parameter where the attribute has a value, and where it has none.
    fn value(&self, attribute: Option<Vec3>) -> Vec3 {
        let Some(value) = attribute else { return self.default };
        let value = value * self.factor;
        let value = if self.is_float { Vec3::splat(value.x) } else { value };
        value.max(self.range[0]).min(self.range[1])
    }
}

/// The value at barycentric coordinates `uv` of a primitive.
fn value_at(attribute: &Attribute, shape: &Geometry, primitive: usize, uv: Vec2) -> Option<Vec3> {
    let values = &attribute.values;
    match (attribute.scope, shape) {
        (AttributeScope::Object, _) => values.get(0),
        (AttributeScope::Primitive, _) => values.get(primitive),
        (AttributeScope::Vertex, Geometry::Mesh(mesh)) => {
            let [a, b, c] = mesh.indices[primitive].map(|vertex| values.get(vertex as usize));
            Some(a? * (1.0 - uv.x - uv.y) + b? * uv.x + c? * uv.y)
        }
        (AttributeScope::Vertex, Geometry::Quadrics(_)) => None,
    }
}

impl Points {
    /// Fills lanes with the parameters that take their values from attributes of what was reached.
    pub(crate) fn read_attributes(&mut self, material: &SurfaceMaterial, reached: &[Reached<'_>]) {
        for input in material.attribute_inputs() {
            if self.attributes.len() <= input.slot {
                self.attributes.resize(input.slot + 1, Vectors::default());
            }
            // Neighbours mostly lie on the same part.
            let mut known: Option<(&ShadedPart, Option<&Attribute>)> = None;
            for (lane, &(arrival, _, part)) in reached.iter().enumerate().take(WIDTH) {
                let attribute = match known {
                    Some((same, attribute)) if std::ptr::eq(same, part) => attribute,
                    _ => part.attributes.get(&input.name),
                };
                known = Some((part, attribute));
                let (primitive, uv) =
                    (arrival.hit.primitive as usize, Vec2::new(arrival.hit.u, arrival.hit.v));
                let value = attribute.and_then(|it| value_at(it, &part.shape, primitive, uv));
                self.attributes[input.slot].set(lane, input.value(value));
            }
        }
    }
}
