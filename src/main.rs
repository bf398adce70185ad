//! The `heliostat` command: see [`cli`].
#![forbid(unsafe_code)]

mod cli;

/// A viewer makes pictures of ever other sizes for hours: the system's allocator keeps more and more holes between them.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    cli::run()
}
