//! OBJ without its library.
#![no_main]

use heliostat_formats::NoFiles;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| heliostat_fuzz::load("a.obj", data, &NoFiles));
