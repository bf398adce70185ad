//! Images of every format; by its name the file may be a TGA, by its content any other.
#![no_main]

use heliostat_formats::image::decode;
use heliostat_scene::Pixels;
use libfuzzer_sys::fuzz_target;

/// The decoder libraries' panics are caught by the importer; libfuzzer's hook would end the process before that. A
/// panic that nothing catches ends it all the same.
fn init() {
    std::panic::set_hook(Box::new(|_| ()));
}

fuzz_target!(init: init(), |data: &[u8]| {
    if let Ok(image) = decode("a.tga", data, &heliostat_fuzz::limits()) {
        let values = match &image.pixels {
            Pixels::Rgba8(values) => values.len(),
            Pixels::RgbaF32(values) => values.len(),
        };
        assert_eq!(values, image.width as usize * image.height as usize * 4);
        assert!(values > 0);
    }
});
