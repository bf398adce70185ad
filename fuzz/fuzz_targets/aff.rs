//! AFF and NFF, with a file to include and a texture. The timeline is played, too.
#![no_main]

use heliostat_formats::Memory;
use libfuzzer_sys::fuzz_target;

const PART: &[u8] = b"fm 0 0 0 1 0 0 0 0 0 1 0 0\ns 1 0 0 1\nx spin { p 3 0 0 0 1 0 0 0 1 0 }\n";
const PICTURE: &[u8] = b"P6 2 1 255\n\xFF\x00\x00\x00\xFF\x00";

fuzz_target!(|data: &[u8]| {
    let files = [("part.aff", PART), ("t.ppm", PICTURE)];
    let files = Memory(files.map(|(name, bytes)| (name.to_owned(), bytes.to_vec())).into());
    heliostat_fuzz::load("a.aff", data, &files);
    heliostat_fuzz::load("a.nff", data, &files);
});
