//! The seam of Heliostat: scenes as plain data, edits, frame requests, frames and the Backend trait.
#![forbid(unsafe_code)]
