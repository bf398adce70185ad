//! File formats: bytes in, edits and diagnostics out.
#![forbid(unsafe_code)]
