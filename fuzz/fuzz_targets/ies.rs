//! Photometric files: an IES file with a file of tilt factors, or a table of Radiance, as the first byte says.
#![no_main]

use heliostat_formats::Memory;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((kind, rest)) = data.split_first() else { return };
    let mut files = Memory::default();
    files.0.insert("tilt.dat".into(), b"1 2 0 90 1 0.9".to_vec());
    heliostat_fuzz::load(if kind % 2 == 0 { "a.ies" } else { "a.dat" }, rest, &files);
});
