//! Tiles of few rays, in packets: each ray of a packet goes its own way where those of a tile share one, which pays when
//! there are too few of them to fill their frustum.
use fearless_simd::{f32x16, prelude::*};

use super::{
    Answers, Scratch,
    work::{GROUP, Rays, first_lanes},
};
use crate::{
    ray::PathId,
    traverse::{
        Within,
        descent::{self, Walker},
    },
};

/// Answers `rays` in an object that takes packets.
#[inline(always)]
pub(super) fn trace<S: Simd, const ANY: bool>(
    simd: S,
    within: Within<'_>,
    path: PathId,
    rays: Rays<'_>,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    let Walker { packet, scratch } = &mut scratch.walker;
    for g in 0..rays.len.div_ceil(GROUP) {
        let limit = f32x16::load_array_ref(simd, &rays.limit.as_chunks::<GROUP>().0[g]);
        let used = first_lanes(simd, rays.len - g * GROUP);
        let bits = packet.take(simd, &rays.lined(simd, g), limit, used);
        let slots = &rays.slot.as_chunks::<GROUP>().0[g];
        if !ANY {
            for &slot in &slots[..(rays.len - g * GROUP).min(GROUP)] {
                _ = answers.of(slot);
            }
        }
        let mut to = descent::Answers { hits: &mut *answers.hits, index: *slots, through: answers.through };
        let mut found = descent::through::<S, ANY>(simd, within, path, packet, bits, &mut to, scratch);
        let mut met = packet.met & bits;
        while found != 0 {
            answers.set(slots[(found.trailing_zeros() & 15) as usize]);
            found &= found - 1;
        }
        while met != 0 {
            answers.meet(slots[(met.trailing_zeros() & 15) as usize]);
            met &= met - 1;
        }
    }
}
