//! Which lobes: sets of them, and selections by how sharp they are.

use crate::lanes::Real;

/// A set of lobes.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lobes(u8);

impl Lobes {
    /// No lobe.
    pub const NONE: Self = Self(0);
    /// Lambertian reflection.
    pub const DIFFUSE: Self = Self(1);
    /// GGX reflection of the base (metal or dielectric).
    pub const SPECULAR: Self = Self(2);
    /// GGX reflection of the clear coat.
    pub const COAT: Self = Self(4);
    /// Reflection by the interface of a transmitting solid.
    pub const GLASS_REFLECT: Self = Self(8);
    /// Refraction into or out of a solid.
    pub const GLASS_TRANSMIT: Self = Self(16);
    /// Straight-on transmission through a rough thin sheet.
    pub const THIN_TRANSMIT: Self = Self(32);
    /// All of them.
    pub const ALL: Self = Self(63);
    /// Those on the viewer's side of the surface.
    pub const REFLECTING: Self = Self(1 | 2 | 4 | 8);
    /// Those on the other side.
    pub const TRANSMITTING: Self = Self(16 | 32);

    /// Whether all of `other` are in the set.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether the set is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The lobes of this set that are not in `other`.
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Lobes of both sets.
    pub const fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Lobes of either set.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// Groups of lobes that are chosen together. The two of a solid's interface share one microfacet, whose Fresnel term
/// decides between them: chosen one by one, refraction near the critical angle would have unbounded weights.
pub(crate) const GROUPS: [Lobes; 5] = [
    Lobes::DIFFUSE,
    Lobes::SPECULAR,
    Lobes::COAT,
    Lobes::GLASS_REFLECT.union(Lobes::GLASS_TRANSMIT),
    Lobes::THIN_TRANSMIT,
];

/// Which lobes take part in an evaluation or a sample: those of a set whose GGX α lies in an interval. Diffuse lobes
/// count as α = 1, interfaces of solids as α = 0 however rough they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection {
    pub(crate) lobes: Lobes,
    /// Excluded.
    above: f32,
    /// Included.
    up_to: f32,
}

impl Selection {
    /// All lobes.
    pub const ALL: Self = Self { lobes: Lobes::ALL, above: -1.0, up_to: f32::INFINITY };

    /// Those whose α is at most `alpha`: mirrors, glass and clear gloss.
    pub const fn up_to(alpha: f32) -> Self {
        Self { up_to: alpha, ..Self::ALL }
    }

    /// Those whose α is larger than `alpha`.
    pub const fn above(alpha: f32) -> Self {
        Self { above: alpha, ..Self::ALL }
    }

    /// Those whose α is larger than `above` and at most `up_to`.
    pub const fn between(above: f32, up_to: f32) -> Self {
        Self { above, up_to, ..Self::ALL }
    }

    /// Those that are in `lobes` too.
    pub const fn among(self, lobes: Lobes) -> Self {
        Self { lobes: Lobes(self.lobes.0 & lobes.0), ..self }
    }

    /// Whether it may take any of these lobes, whatever their α: the diffuse one is known to have 1.
    pub(crate) fn may_take(&self, lobes: Lobes) -> bool {
        let lobes = self.lobes.intersection(lobes);
        let diffuse = self.above < 1.0 && self.up_to >= 1.0;
        !if diffuse { lobes } else { lobes.without(Lobes::DIFFUSE) }.is_empty()
    }

    /// Where a lobe of this α takes part.
    #[inline(always)]
    pub(crate) fn takes<F: Real>(&self, alpha: F) -> F::Mask {
        alpha.gt(alpha.splat(self.above)) & alpha.le(alpha.splat(self.up_to))
    }
}
