//! BSP maps with a shader script: two bytes (little-endian) say how long the script is, the map follows it.
#![no_main]

use heliostat_formats::Memory;
use libfuzzer_sys::fuzz_target;

/// Uncompressed TGA of 1×1 pixel.
const IMAGE: [u8; 21] = [0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 24, 0, 9, 8, 7];

fuzz_target!(|data: &[u8]| {
    let Some((length, rest)) = data.split_first_chunk() else { return };
    let (script, map) = rest.split_at(usize::from(u16::from_le_bytes(*length)).min(rest.len()));
    let mut files = Memory::default();
    files.0.insert("../scripts/a.shader".into(), script.to_vec());
    files.0.insert("../textures/a/stone.tga".into(), IMAGE.to_vec());
    heliostat_fuzz::load("maps/a.bsp", map, &files);
});
