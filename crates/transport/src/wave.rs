//! Waves of rays: what they hit, shaded in packets.

use heliostat_kernel::{Hit, Ray};
use heliostat_shading::{Arrival, Cone, HitSorter, ShadeScratch, ShadingScene, Surfaces};

/// Shades the hits of rays that have no footprint; keeps its memory from wave to wave.
#[derive(Debug, Default)]
pub(crate) struct WaveShader {
    sorter: HitSorter,
    scratch: ShadeScratch,
    surfaces: Surfaces,
}

impl WaveShader {
    /// Hands over the surfaces that were hit, packet by packet, with the index of the ray of each lane. Packets come in the order
    /// of materials, the rays of one material in theirs.
    pub(crate) fn shade(
        &mut self,
        scene: &ShadingScene,
        (rays, hits): (&[Ray], &[Hit]),
        mut deliver: impl FnMut(&[u32], &Surfaces),
    ) {
        let Self { sorter, scratch, surfaces } = self;
        sorter.sort(scene, hits);
        let arrival =
            |index: usize| Arrival { hit: &hits[index], ray: &rays[index], cone: Cone::default(), level: 1 };
        for packet in sorter.packets() {
            scene.shade(&packet, arrival, scratch, surfaces);
            deliver(packet.hits, surfaces);
        }
    }
}
