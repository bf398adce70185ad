//! The one home of the terminal: results to stdout, messages, errors and progress bars to stderr, Ctrl-C.

use std::io::{IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use heliostat::scene::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{GraphicalReportHandler, GraphicalTheme};

use super::failure::Failure;

/// Set by the first Ctrl-C. A signal has nowhere else to go.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// From now on Ctrl-C asks the work to stop; a second one ends the program at once. Unfinished files have temporary
/// names, so nothing half-written is taken for a result.
pub(super) fn watch_for_interrupt() {
    #[expect(clippy::exit, reason = "the user asked twice, and nothing else stops every thread")]
    let handler = || {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(1);
        }
    };
    if let Err(error) = ctrlc::set_handler(handler) {
        message(&format!("note: Ctrl-C will end the program at once ({error})"));
    }
}

/// Whether Ctrl-C was pressed.
pub(super) fn is_interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Writes a result line to stdout. A closed pipe is the reader's choice, not an error.
///
/// # Errors
/// When the line is lost for any other reason, such as a full disk.
pub(super) fn result(text: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    match writeln!(stdout, "{text}").and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Failure::new(format!("the result cannot be written to stdout: {error}")))
        }
        _ => Ok(()),
    }
}

/// Writes a message line to stderr.
pub(super) fn message(text: &str) {
    _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// Writes an error to stderr, with the offending text where there is one.
pub(super) fn report(failure: &Failure) {
    let terminal = std::io::stderr().is_terminal();
    let theme = if terminal { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
    let handler = GraphicalReportHandler::new_themed(theme).with_wrap_lines(false);
    let mut text = String::new();
    match handler.render_report(&mut text, failure) {
        Ok(()) => message(text.trim_end()),
        Err(_) => message(&failure.to_string()),
    }
}

/// Does `work` on another thread while a progress bar named `label` shows how far it is; Ctrl-C cancels it. Work that
/// does not look at its progress is abandoned.
///
/// # Errors
/// Those of the work; [`Failure::cancelled`] after Ctrl-C.
pub(super) fn with_progress<T: Send + 'static>(
    label: impl Into<String>,
    work: impl FnOnce(&Progress) -> Result<T, Failure> + Send + 'static,
) -> Result<T, Failure> {
    const GRACE: u32 = 40;
    let progress = Arc::new(Progress::new());
    let shared = progress.clone();
    let (sender, receiver) = std::sync::mpsc::channel();
    // Detached: once the result is sent nothing is left to do, and abandoned work ends with the program.
    std::thread::spawn(move || _ = sender.send(work(&shared)));
    let label = label.into();
    let bar = bar(label.clone());
    let mut polls_since_cancel = 0;
    loop {
        match receiver.recv_timeout(Duration::from_millis(50)) {
            Ok(outcome) => {
                bar.finish_and_clear();
                return outcome;
            }
            Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => {
                bar.finish_and_clear();
                return Err(Failure::new(format!("{label}: the thread that does it has died")));
            }
            Err(std::sync::mpsc::RecvTimeoutError::Timeout) => {}
        }
        let (done, total) = progress.state();
        bar.set_length(total);
        bar.set_position(done);
        if INTERRUPTED.load(Ordering::Relaxed) {
            progress.cancel();
            polls_since_cancel += 1;
            if polls_since_cancel > GRACE {
                bar.finish_and_clear();
                return Err(Failure::cancelled());
            }
        }
    }
}

/// A bar on stderr; indicatif hides it by itself when stderr is no terminal.
fn bar(label: String) -> ProgressBar {
    let bar = ProgressBar::new(0).with_message(label);
    let style = ProgressStyle::with_template("{msg:>9} {wide_bar} {percent:>3} %  {elapsed}, {eta} left");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}
