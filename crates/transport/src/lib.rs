//! How light gets there: the integrators.
#![forbid(unsafe_code)]
