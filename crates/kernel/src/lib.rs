//! Rays in, hits out: accelerators, SIMD traversal and multi-level worlds.
#![forbid(unsafe_code)]
