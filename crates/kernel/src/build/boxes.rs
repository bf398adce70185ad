//! Boxes in the form that builders work on: eight lanes, of which one minimum unites two boxes.
use fearless_simd::{f32x4, f32x8, prelude::*};
use glam::{Vec3, Vec3A};

/// A box and two 32-bit tags, 32 B: lower x, y, z, first tag; upper x, y, z negated, second tag.
///
/// As the upper corner is negated, the lane-wise minimum of two boxes is their union. Tags are carried as bits; the
/// arithmetic on whole vectors makes nonsense of them, which nobody reads.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct PackedBox(pub [f32; 8]);

impl Default for PackedBox {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl PackedBox {
    /// The neutral element of the union.
    pub(crate) const EMPTY: Self = Self([f32::INFINITY; 8]);

    pub(crate) fn new(lo: Vec3, hi: Vec3, tags: [u32; 2]) -> Self {
        // Adding zero turns −0 into +0, between which minima would choose by order.
        let (lo, hi) = (lo + Vec3::ZERO, hi + Vec3::ZERO);
        let [a, b] = tags.map(f32::from_bits);
        Self([lo.x, lo.y, lo.z, a, -hi.x, -hi.y, -hi.z, b])
    }

    /// The box of primitive `id`. Both tags hold it: their difference is then zero, and not a denormal number that
    /// slows multiplications down.
    #[inline(always)]
    pub(crate) fn primitive(lo: impl Into<Vec3A>, hi: impl Into<Vec3A>, id: u32) -> Self {
        // As in `new`.
        let (lo, minus_hi) = (lo.into() + Vec3A::ZERO, -(hi.into() + Vec3A::ZERO));
        let id = f32::from_bits(id);
        let ([x, y, z], [minus_x, minus_y, minus_z]) = (lo.to_array(), minus_hi.to_array());
        Self([x, y, z, id, minus_x, minus_y, minus_z, id])
    }

    /// The number of a primitive.
    pub(crate) fn id(&self) -> u32 {
        self.0[3].to_bits()
    }

    pub(crate) fn tags(&self) -> [u32; 2] {
        [self.0[3].to_bits(), self.0[7].to_bits()]
    }

    pub(crate) fn with_tags(mut self, tags: [u32; 2]) -> Self {
        [self.0[3], self.0[7]] = tags.map(f32::from_bits);
        self
    }

    pub(crate) fn lo(&self) -> Vec3 {
        Vec3::new(self.0[0], self.0[1], self.0[2])
    }

    pub(crate) fn hi(&self) -> Vec3 {
        -Vec3::new(self.0[4], self.0[5], self.0[6])
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0[0] > -self.0[4]
    }

    /// Half the surface area; infinite for an empty box.
    #[inline(always)]
    pub(crate) fn half_area(&self) -> f32 {
        // Extents come out negative; their products do not.
        let [x, y, z] = [self.0[0] + self.0[4], self.0[1] + self.0[5], self.0[2] + self.0[6]];
        x * y + (y * z + z * x)
    }

    #[inline(always)]
    pub(crate) fn union(&self, other: &Self) -> Self {
        let mut lanes = self.0;
        for (a, b) in lanes.iter_mut().zip(other.0) {
            *a = if b < *a { b } else { *a };
        }
        Self(lanes)
    }

    #[inline(always)]
    pub(crate) fn load<S: Simd>(&self, simd: S) -> f32x8<S> {
        f32x8::load_array_ref(simd, &self.0)
    }

    /// Twice the centre along `axis`, rounded exactly as [`doubled_center`] does.
    #[inline(always)]
    pub(crate) fn doubled_center(&self, axis: usize) -> f32 {
        self.0[axis & 3] - self.0[(axis & 3) + 4]
    }
}

/// Twice the centre of a packed box; the fourth lane means nothing.
#[inline(always)]
pub(crate) fn doubled_center<S: Simd>(packed: f32x8<S>) -> f32x4<S> {
    let (lo, minus_hi) = packed.split();
    lo - minus_hi
}

/// Half areas of three packed boxes in the first three lanes.
#[inline(always)]
pub(crate) fn half_areas<S: Simd>(boxes: [f32x8<S>; 3]) -> f32x4<S> {
    let [a, b, c] = [extent(boxes[0]), extent(boxes[1]), extent(boxes[2])];
    let (ac, bb) = (a.zip_low(c), b.zip_low(b));
    let (x, y) = (ac.zip_low(bb), ac.zip_high(bb));
    let z = a.zip_high(c).zip_low(b.zip_high(b));
    x * y + (y * z + z * x)
}

/// Minus the extents of a packed box.
#[inline(always)]
fn extent<S: Simd>(packed: f32x8<S>) -> f32x4<S> {
    let (lo, minus_hi) = packed.split();
    lo + minus_hi
}
