//! The CPU backend: compiles edits into worlds and shader tables, schedules tiles, film and tone mapping.
#![forbid(unsafe_code)]
