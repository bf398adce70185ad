//! `heliostat view` and `heliostat serve`: say plainly that there is no viewer yet, and what works instead.

use super::failure::Failure;

#[derive(Debug, Default, clap::Args)]
pub(super) struct Arguments {
    /// A file or the name of a built-in scene
    scene: Option<String>,
}

#[derive(Debug, clap::Args)]
pub(super) struct ServeArguments {
    /// A file or the name of a built-in scene
    scene: Option<String>,
    /// Address and port to listen on
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:8080")]
    listen: String,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    Err(missing("the viewer's window is not built yet", arguments.scene.as_deref()))
}

pub(super) fn run_server(arguments: &ServeArguments) -> Result<(), Failure> {
    let what = format!("the web viewer is not built yet; nothing listens on {}", arguments.listen);
    Err(missing(&what, arguments.scene.as_deref()))
}

fn missing(what: &str, scene: Option<&str>) -> Failure {
    let scene = scene.map_or(String::new(), |scene| format!("{scene} "));
    Failure::new(what).with_help(format!(
        "make a picture instead: `heliostat render {scene}-o picture.png`; `heliostat --help` lists all commands"
    ))
}
