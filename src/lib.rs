//! Heliostat: real-time ray tracing and interactive global illumination.
#![forbid(unsafe_code)]
