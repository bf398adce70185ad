//! glTF: the input is a `.glb` or `.gltf` file, or JSON and binary data with a zero byte between them.
#![no_main]

use heliostat_formats::Memory;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let image = heliostat_formats::image::encode_png(1, 1, &[1, 2, 3]).unwrap();
    let files = Memory([("a.png".to_owned(), image), ("a.bin".to_owned(), vec![0; 1024])].into());
    match data.iter().position(|&b| b == 0) {
        Some(end) if data.starts_with(b"{") => {
            heliostat_fuzz::load("a.glb", &container(&data[..end], &data[end + 1..]), &files);
        }
        _ => heliostat_fuzz::load("a.gltf", data, &files),
    }
});

/// A well-formed container, so that mutations reach what is inside it.
fn container(json: &[u8], binary: &[u8]) -> Vec<u8> {
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((28 + json.len() as u32 + binary.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", binary)] {
        glb.extend((chunk.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    glb
}
