//! MTL: the library of a fixed OBJ file, with an image that it can use.
#![no_main]

use heliostat_formats::Memory;
use libfuzzer_sys::fuzz_target;

const OBJ: &[u8] =
    b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\nusemtl c c\nf 1 2 3\n";

fuzz_target!(|data: &[u8]| {
    let image = heliostat_formats::image::encode_png(2, 1, &[1, 2, 3, 9, 9, 9]).unwrap();
    let grey = heliostat_formats::image::encode_png(1, 2, &[1, 1, 1, 9, 9, 9]).unwrap();
    let files =
        [("a.mtl".to_owned(), data.to_vec()), ("i.png".to_owned(), image), ("g.png".to_owned(), grey)];
    heliostat_fuzz::load("a.obj", OBJ, &Memory(files.into()));
});
