//! The header that authors of plug-ins use is made from the interface in Rust, and compiles as C11 and C++17.
#![allow(clippy::print_stderr, reason = "a test says when it did not run")]

use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// `HELIOSTAT_BLESS=1` writes the header instead.
#[test]
fn the_header_is_in_step_with_the_interface() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(here.join("cbindgen.toml")).expect("the configuration");
    let builder = cbindgen::Builder::new().with_config(config).with_src(here.join("src/abi.rs"));
    let mut made = Vec::new();
    builder.generate().expect("bindings").write(&mut made);
    let made = String::from_utf8(made).expect("UTF-8");
    let path = root().join("include/heliostat_shader.h");
    if std::env::var_os("HELIOSTAT_BLESS").is_some() {
        std::fs::write(&path, &made).expect("the header is written");
    }
    let kept = std::fs::read_to_string(&path).expect("the header");
    assert!(
        kept == made,
        "include/heliostat_shader.h is not what src/abi.rs gives; \
         HELIOSTAT_BLESS=1 cargo test -p heliostat-plugins --test header makes it anew"
    );
}

#[test]
fn the_header_compiles_as_c11_and_cpp17() {
    let source = |name: &str| {
        let text = "#include \"heliostat_shader.h\"\n\
            const HeliostatPlugin *heliostat_plugin(uint32_t abi_version) { (void)abi_version; return 0; }\n";
        let path = std::env::temp_dir().join(format!("heliostat-header-{}-{name}", std::process::id()));
        std::fs::write(&path, text).expect("a temporary file");
        path
    };
    for (compiler, variable, standard, name) in
        [("cc", "CC", "-std=c11", "a.c"), ("c++", "CXX", "-std=c++17", "a.cpp")]
    {
        let compiler = std::env::var(variable).unwrap_or_else(|_| compiler.into());
        let path = source(name);
        let mut command = Command::new(&compiler);
        command.args([standard, "-Wall", "-Wextra", "-Werror", "-pedantic", "-fsyntax-only", "-I"]);
        let output = command.arg(root().join("include")).arg(&path).output();
        std::fs::remove_file(&path).expect("it is there");
        match output {
            Ok(output) => {
                assert!(output.status.success(), "{compiler}: {}", String::from_utf8_lossy(&output.stderr));
            }
            Err(error) => {
                eprintln!("note: {standard} was not tested, since `{compiler}` does not run: {error}");
            }
        }
    }
}
