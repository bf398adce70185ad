//! Properties of vertices and faces that nothing else takes: they become attributes, for shaders to use.

use glam::Vec3;
use heliostat_scene::{Attribute, AttributeScope, AttributeValues};

use super::color_value;
use super::header::{Element, Kind, Type};
use crate::context::Context;
use crate::place::Place;

/// Columns of numbers by name.
#[derive(Debug, Default)]
pub(super) struct Columns(Vec<(String, Vec<f32>)>);

/// The components of the colour of a face.
const COLOR: [&str; 3] = ["red", "green", "blue"];

/// Which columns the properties of an element belong to.
pub(super) struct Layout {
    /// For each property, the place of its value in `row`.
    places: Vec<Option<usize>>,
    /// The column of each value.
    columns: Vec<usize>,
    /// The values of the current element.
    row: Vec<f32>,
    has_color: bool,
}

impl Columns {
    /// Takes up the scalar properties of an element that are `wanted` by their name.
    pub(super) fn layout(&mut self, element: &Element, wanted: impl Fn(&str) -> bool) -> Layout {
        let is_scalar = |name: &str| {
            element.properties.iter().any(|p| p.name == name && matches!(p.kind, Kind::Scalar(_)))
        };
        let has_color = COLOR.iter().all(|name| is_scalar(name));
        let (mut places, mut columns) = (Vec::new(), Vec::new());
        for property in &element.properties {
            let is_column = matches!(property.kind, Kind::Scalar(_)) && wanted(&property.name);
            places.push(is_column.then_some(columns.len()));
            if is_column {
                columns.push(self.column(&property.name));
            }
        }
        Layout { places, row: vec![0.0; columns.len()], columns, has_color }
    }

    fn column(&mut self, name: &str) -> usize {
        self.0.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
            self.0.push((name.to_owned(), Vec::new()));
            self.0.len() - 1
        })
    }

    /// Adds the current element's values, `times` over.
    pub(super) fn push(&mut self, layout: &Layout, times: usize) {
        for (&column, &value) in layout.columns.iter().zip(&layout.row) {
            let values = &mut self.0[column].1;
            values.resize(values.len() + times, value);
        }
    }

    /// The attributes that `count` primitives or vertices have. The columns of a colour become one; names of faces begin
    /// with `face_`, as vertices may have the same properties.
    pub(super) fn attributes(
        self,
        context: &mut Context<'_>,
        scope: AttributeScope,
        count: usize,
        place: &Place,
    ) -> Vec<(String, Attribute)> {
        let is_face = scope == AttributeScope::Primitive;
        let color = COLOR.map(|name| self.0.iter().find(|(known, _)| known == name));
        let mut named: Vec<(String, AttributeValues)> = Vec::new();
        let mut joined = false;
        if let ([Some((_, r)), Some((_, g)), Some((_, b))], true) = (color, is_face)
            && [r, g, b].iter().all(|values| values.len() == count)
        {
            let colors: Vec<Vec3> = (0..count).map(|i| Vec3::new(r[i], g[i], b[i])).collect();
            named.push(("color".into(), colors.into()));
            joined = true;
        }
        let others = self.0.into_iter().filter(|(name, _)| !(joined && COLOR.contains(&name.as_str())));
        named.extend(others.map(|(name, values)| (name, values.into())));
        let mut attributes = Vec::new();
        for (name, values) in named {
            let problem = match (values.len() == count, values.is_finite()) {
                (true, true) => {
                    let name = if is_face { format!("face_{name}") } else { name };
                    attributes.push((name, Attribute::new(scope, values)));
                    continue;
                }
                (false, _) => "is not there once for each of them",
                (true, false) => "has values that are not finite",
            };
            let what = if is_face { "faces" } else { "vertices" };
            let message = format!("the property `{name}` of {what} {problem} and is not read");
            context.warn(place.clone(), message, "correct it, or leave it out");
        }
        attributes
    }
}

impl Layout {
    /// How many values an element has.
    pub(super) fn len(&self) -> usize {
        self.row.len()
    }

    /// Takes the value of a property.
    pub(super) fn take(&mut self, property: usize, name: &str, kind: Type, value: f32) {
        let Some(place) = self.places[property] else { return };
        let is_color = self.has_color && COLOR.contains(&name);
        self.row[place] = if is_color { color_value(value, kind, false) } else { value };
    }
}
