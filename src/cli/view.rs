//! `heliostat view` and `heliostat serve`: a scene in a window or on a web page.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use heliostat_viewer::{ServeOptions, Server, SessionOptions, Source, WindowError, WindowOptions};

use super::failure::Failure;
use super::host::CliHost;
use super::values::Size;
use super::{console, input};

/// The scene that opens by itself: something moves in it.
const DEFAULT_SCENE: &str = "atrium-evening";

#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    common: Common,
    /// Size of the window
    #[arg(long, value_name = "WxH", default_value = "960x600")]
    size: Size,
}

#[derive(Debug, clap::Args)]
pub(super) struct ServeArguments {
    #[command(flatten)]
    common: Common,
    /// Address and port to listen on; other than this machine's own, it demands the token that is printed
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// Largest scene file that a browser may bring, MiB; 0 refuses all
    #[arg(long, value_name = "MIB", default_value_t = 256, value_parser = clap::value_parser!(u32).range(0..=4096))]
    max_upload: u32,
}

#[derive(Debug, clap::Args)]
#[group(skip)]
struct Common {
    /// A file or the name of a built-in scene
    #[arg(default_value = DEFAULT_SCENE)]
    scene: String,
    /// How light is computed at first: igi, path, direct or cast
    #[arg(long, default_value = "igi", value_parser = ["igi", "path", "direct", "instant-radiosity", "path-filtered", "cast", "eyelight"])]
    renderer: String,
    /// Load the shader plug-ins that the scene names: they run with all your rights, so allow only what you trust
    #[arg(long)]
    allow_plugins: bool,
}

impl Common {
    fn session(&self) -> SessionOptions {
        SessionOptions { renderer: self.renderer.clone(), ..SessionOptions::default() }
    }
}

/// `heliostat` without arguments.
pub(super) fn run_default() -> Result<(), Failure> {
    let common = Common { scene: DEFAULT_SCENE.into(), renderer: "igi".into(), allow_plugins: false };
    run(&Arguments { common, size: Size { width: 960, height: 600 } })
}

/// Shows a scene in a window, or, without a display, on a page.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let common = &arguments.common;
    input::check(&common.scene)?;
    let size = [arguments.size.width, arguments.size.height];
    let options = WindowOptions { session: SessionOptions { size, ..common.session() }, size };
    let host = Arc::new(CliHost { allow_plugins: common.allow_plugins });
    let source = Source::Named(common.scene.clone());
    match heliostat_viewer::show_window(host, source, &options, &console::is_interrupted) {
        Ok(()) => Ok(()),
        Err(WindowError::NoDisplay(reason)) => {
            console::message(&format!(
                "note: there is no display for a window ({reason}); showing a page instead"
            ));
            serve(common, &ServeOptions { session: common.session(), ..ServeOptions::default() })
        }
        Err(WindowError::Failed(reason)) => Err(Failure::new(reason)),
    }
}

/// Shows a scene on a page until Ctrl-C.
pub(super) fn run_server(arguments: &ServeArguments) -> Result<(), Failure> {
    let options = ServeOptions {
        listen: arguments.listen,
        session: arguments.common.session(),
        upload_bytes: arguments.max_upload as usize * (1 << 20),
        ..ServeOptions::default()
    };
    serve(&arguments.common, &options)
}

fn serve(common: &Common, options: &ServeOptions) -> Result<(), Failure> {
    input::check(&common.scene)?;
    let host = Arc::new(CliHost { allow_plugins: common.allow_plugins });
    let server = Server::start(host, Source::Named(common.scene.clone()), options).map_err(|refusal| {
        Failure::new(refusal.0).with_help(
            "another program may use the port; `heliostat serve --listen 127.0.0.1:PORT` takes another one",
        )
    })?;
    console::message(&format!("showing {}; open this address in a browser, end with Ctrl-C:", common.scene));
    console::result(server.url())?;
    while !console::is_interrupted() {
        if server.has_ended() {
            return Err(Failure::new("the server has lost its socket"));
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    Ok(())
}
