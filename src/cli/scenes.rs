//! `heliostat scenes`: what is built in.

use heliostat::builtin;
use serde_json::json;

use super::console;
use super::failure::Failure;

#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Write the list as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.json {
        let list: Vec<_> = builtin::names()
            .iter()
            .map(|(name, description)| json!({"name": name, "description": description}))
            .collect();
        console::result(&serde_json::Value::from(list).to_string())?;
        return Ok(());
    }
    let widest = builtin::names().iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    for (name, description) in builtin::names() {
        console::result(&format!("{name:widest$}  {description}"))?;
    }
    Ok(())
}
