//! The built-in procedural scenes: a name in, edits out.
#![forbid(unsafe_code)]
