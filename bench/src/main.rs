//! Peers side by side and the report's tables as ratios.
fn main() {}
