//! Bounds-checked reading of accessors: views, strides, component types, normalisation and sparse storage.
//!
//! # References
//! Khronos, "glTF 2.0 Specification", sections 3.6.2 (accessors) and 3.6.2.3 (sparse accessors).

use super::Loader;
use super::json::Accessor;
use crate::error::LoadError;
use crate::place::Place;

/// Component types by their OpenGL numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn from_number(number: u32) -> Option<Self> {
        Some(match number {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The value at the start of `bytes`, which are long enough.
    fn float(self, bytes: &[u8], normalized: bool) -> f32 {
        let two = || [bytes[0], bytes[1]];
        let four = || [bytes[0], bytes[1], bytes[2], bytes[3]];
        let (value, maximum) = match self {
            Self::I8 => (f32::from(bytes[0] as i8), 127.0),
            Self::U8 => (f32::from(bytes[0]), 255.0),
            Self::I16 => (f32::from(i16::from_le_bytes(two())), 32767.0),
            Self::U16 => (f32::from(u16::from_le_bytes(two())), 65535.0),
            Self::U32 => (u32::from_le_bytes(four()) as f32, 4_294_967_295.0),
            Self::F32 => return f32::from_le_bytes(four()),
        };
        if normalized { (value / maximum).max(-1.0) } else { value }
    }

    fn integer(self, bytes: &[u8]) -> u32 {
        match self {
            Self::I8 | Self::U8 => bytes[0].into(),
            Self::I16 | Self::U16 => u16::from_le_bytes([bytes[0], bytes[1]]).into(),
            Self::U32 | Self::F32 => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        }
    }
}

/// Equally spaced elements in a buffer, checked to lie inside it.
struct Elements<'b> {
    bytes: &'b [u8],
    stride: usize,
    size: usize,
}

impl<'b> Elements<'b> {
    fn get(&self, index: usize) -> &'b [u8] {
        let start = index * self.stride;
        &self.bytes[start..start + self.size]
    }
}

/// Components of an element type.
fn components(shape: &str) -> Option<usize> {
    Some(match shape {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" | "MAT2" => 4,
        "MAT3" => 9,
        "MAT4" => 16,
        _ => return None,
    })
}

impl<'a> Loader<'a, '_> {
    /// The accessor of that number, which `user` (a JSON path) refers to.
    pub(super) fn accessor(&self, index: usize, user: &str) -> Result<&'a Accessor, LoadError> {
        self.item(&self.root.accessors, "accessors", index, user)
    }

    /// Elements of `N` floats; an accessor with fewer components leaves the rest as in `missing`.
    pub(super) fn read_floats<const N: usize>(
        &mut self,
        index: usize,
        user: &str,
        shapes: &[&str],
        missing: [f32; N],
    ) -> Result<Vec<[f32; N]>, LoadError> {
        let (accessor, component) = self.open(index, user, shapes)?;
        let normalized = accessor.normalized;
        // `open` has checked the shape.
        let width = components(&accessor.shape).unwrap_or(N).min(N);
        let convert = |bytes: &[u8]| {
            let mut element = missing;
            for (lane, value) in element.iter_mut().enumerate().take(width) {
                *value = component.float(&bytes[lane * component.bytes()..], normalized);
            }
            element
        };
        let mut zero = missing;
        zero[..width].fill(0.0);
        self.read(index, component, zero, convert)
    }

    /// Elements of `N` unsigned integers.
    pub(super) fn read_integers<const N: usize>(
        &mut self,
        index: usize,
        user: &str,
        shapes: &[&str],
    ) -> Result<Vec<[u32; N]>, LoadError> {
        let (_, component) = self.open(index, user, shapes)?;
        if !matches!(component, Component::U8 | Component::U16 | Component::U32) {
            let problem = "the components are not unsigned integers";
            return Err(self.accessor_error(index, problem, "use component type 5121, 5123 or 5125"));
        }
        let convert =
            |bytes: &[u8]| std::array::from_fn(|lane| component.integer(&bytes[lane * component.bytes()..]));
        self.read(index, component, [0; N], convert)
    }

    fn accessor_error(&self, index: usize, problem: impl Into<String>, hint: &str) -> LoadError {
        LoadError::input(Place::json(self.file, format!("accessors[{index}]")), problem, hint)
    }

    fn open(
        &self,
        index: usize,
        user: &str,
        shapes: &[&str],
    ) -> Result<(&'a Accessor, Component), LoadError> {
        let accessor = self.accessor(index, user)?;
        if !shapes.contains(&accessor.shape.as_str()) {
            let problem = format!("{user} refers to it, but `type` is {}", accessor.shape);
            let hint = format!("the type must be {}", shapes.join(" or "));
            return Err(self.accessor_error(index, problem, &hint));
        }
        let component = Component::from_number(accessor.component_type).ok_or_else(|| {
            let problem = format!("`componentType` is {}", accessor.component_type);
            self.accessor_error(index, problem, "use 5120, 5121, 5122, 5123, 5125 or 5126")
        })?;
        Ok((accessor, component))
    }

    fn read<T: Copy>(
        &mut self,
        index: usize,
        component: Component,
        zero: T,
        convert: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, LoadError> {
        let accessor = &self.root.accessors[index];
        let place = Place::json(self.file, format!("accessors[{index}]"));
        let limit = self.context.limits.vertices.saturating_mul(4);
        if accessor.count > limit {
            return Err(LoadError::limit(
                place,
                "elements (four per vertex)",
                accessor.count,
                "vertices",
                limit,
            ));
        }
        let size = components(&accessor.shape).unwrap_or(1) * component.bytes();
        let elements = match accessor.buffer_view {
            Some(view) => {
                Some(self.elements(&place, view, accessor.byte_offset, accessor.count, size, false)?)
            }
            None if accessor.count > self.context.limits.zeros => {
                let limit = self.context.limits.zeros;
                let what = "elements without a buffer view";
                return Err(LoadError::limit(place, what, accessor.count, "zeros", limit));
            }
            None => None,
        };
        let count = accessor.count as usize;
        self.context.charge_array(count, size_of::<T>(), &place)?;
        let mut values = match elements {
            Some(elements) => (0..count).map(|i| convert(elements.get(i))).collect(),
            None => vec![zero; count],
        };
        if let Some(sparse) = &accessor.sparse {
            let place = Place::json(self.file, format!("accessors[{index}].sparse"));
            let index_type = Component::from_number(sparse.indices.component_type)
                .filter(|c| matches!(c, Component::U8 | Component::U16 | Component::U32))
                .ok_or_else(|| {
                    let problem = format!("`indices.componentType` is {}", sparse.indices.component_type);
                    LoadError::input(place.clone(), problem, "use 5121, 5123 or 5125")
                })?;
            let (view, offset) = (sparse.indices.buffer_view, sparse.indices.byte_offset);
            let indices = self.elements(&place, view, offset, sparse.count, index_type.bytes(), true)?;
            let (view, offset) = (sparse.values.buffer_view, sparse.values.byte_offset);
            let replaced = self.elements(&place, view, offset, sparse.count, size, true)?;
            for i in 0..sparse.count as usize {
                let target = index_type.integer(indices.get(i));
                let Some(value) = values.get_mut(target as usize) else {
                    let problem = format!("index {target} of {count} elements");
                    return Err(LoadError::input(place, problem, "sparse indices must be below `count`"));
                };
                *value = convert(replaced.get(i));
            }
        }
        Ok(values)
    }

    /// `count` elements of `size` bytes from `offset` of a view, which must hold them all.
    fn elements(
        &self,
        place: &Place,
        view: usize,
        offset: u64,
        count: u64,
        size: usize,
        tight: bool,
    ) -> Result<Elements<'a>, LoadError> {
        let (bytes, stride) = self.view(view, &place_path(place))?;
        let stride = if tight { size as u64 } else { stride.unwrap_or(size as u64) };
        if stride < size as u64 {
            let problem =
                format!("`byteStride` of bufferViews[{view}] is {stride}, an element has {size} bytes");
            return Err(LoadError::input(place.clone(), problem, "give a stride of at least an element"));
        }
        let last = count.saturating_sub(1).saturating_mul(stride).saturating_add(size as u64);
        let end = offset.saturating_add(if count == 0 { 0 } else { last });
        if end > bytes.len() as u64 {
            let problem = format!("{count} elements end at byte {end} of a view of {} bytes", bytes.len());
            return Err(LoadError::input(
                place.clone(),
                problem,
                "correct `count`, `byteOffset` or the view",
            ));
        }
        Ok(Elements { bytes: &bytes[offset as usize..], stride: stride as usize, size })
    }

    /// The bytes of a buffer view, and its stride.
    pub(super) fn view(&self, index: usize, user: &str) -> Result<(&'a [u8], Option<u64>), LoadError> {
        let view = self.item(&self.root.buffer_views, "bufferViews", index, user)?;
        let path = format!("bufferViews[{index}]");
        let buffer = self.item(self.buffers, "buffers", view.buffer, &path)?;
        let end = view.byte_offset.saturating_add(view.byte_length);
        if end > buffer.len() as u64 {
            let problem = format!("the view ends at byte {end} of a buffer of {} bytes", buffer.len());
            let hint = "correct `byteOffset` or `byteLength`";
            return Err(LoadError::input(Place::json(self.file, path), problem, hint));
        }
        Ok((&buffer[view.byte_offset as usize..end as usize], view.byte_stride))
    }
}

fn place_path(place: &Place) -> String {
    match &place.spot {
        crate::place::Spot::Json(path) => path.clone(),
        _ => String::new(),
    }
}
