//! The window on a display without a screen (Xvfb): it shows pictures, and mouse and keys have their effect.
#![cfg(target_os = "linux")]

mod viewing;

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use viewing::PATIENCE;
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{ConnectionExt, ImageFormat, InputFocus, Window};
use x11rb::protocol::xtest::ConnectionExt as _;
use x11rb::rust_connection::RustConnection;

const PRESS: u8 = 2;
const RELEASE: u8 = 3;
const BUTTON_PRESS: u8 = 4;
const BUTTON_RELEASE: u8 = 5;
const MOTION: u8 = 6;
/// Symbols of keys that write nothing.
const BACKSPACE: u32 = 0xFF08;
const TAB: u32 = 0xFF09;
const SHIFT: u32 = 0xFFE1;
const F1: u32 = 0xFFBE;

/// A display without a screen, and a window on it.
struct Display {
    server: Child,
    viewer: Option<Child>,
    connection: RustConnection,
    root: Window,
    name: String,
}

/// Starts Xvfb; `None` where it is missing, unless `HELIOSTAT_XVFB=required`.
fn display() -> Option<Display> {
    let program = || ["/usr/bin/Xvfb", "/usr/local/bin/Xvfb"].iter().map(PathBuf::from).find(|p| p.exists());
    if program().is_none() {
        viewing::install("xvfb");
    }
    let required = std::env::var("HELIOSTAT_XVFB").is_ok_and(|value| value == "required");
    assert!(program().is_some() || !required, "Xvfb is missing and could not be installed");
    let Some(program) = program() else {
        viewing::not_run("the tests of the window need Xvfb; install Debian's package `xvfb`");
        return None;
    };
    let mut command = Command::new(program);
    // It chooses a free number and writes it where it is told to.
    command.args(["-displayfd", "1", "-screen", "0", "640x480x24", "-nolisten", "tcp"]);
    let mut server = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("Xvfb starts");
    let mut number = String::new();
    BufReader::new(server.stdout.take().expect("a pipe")).read_line(&mut number).expect("a number");
    let name = format!(":{}", number.trim());
    let (connection, screen) = x11rb::connect(Some(&name)).expect("a connection");
    let root = connection.setup().roots[screen].root;
    Some(Display { server, viewer: None, connection, root, name })
}

impl Drop for Display {
    fn drop(&mut self) {
        for process in self.viewer.iter_mut().chain([&mut self.server]) {
            _ = process.kill();
            _ = process.wait();
        }
    }
}

impl Display {
    fn view(&mut self, folder: &Path, arguments: &str) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_heliostat"));
        command.arg("view").args(arguments.split_whitespace()).current_dir(folder);
        command.env("DISPLAY", &self.name).env_remove("WAYLAND_DISPLAY");
        self.viewer = Some(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("it starts"));
    }

    /// The screen's pixels, four bytes each.
    fn pixels(&self) -> Vec<u8> {
        let image = self.connection.get_image(ImageFormat::Z_PIXMAP, self.root, 0, 0, 640, 480, u32::MAX);
        image.expect("a request").reply().expect("an image").data
    }

    /// Waits until the lower part of the screen, where no figures change, is so.
    fn wait(&self, what: &str, is_so: impl Fn(&[u8]) -> bool) -> Vec<u8> {
        let start = Instant::now();
        loop {
            let pixels = self.pixels();
            let lower = pixels[640 * 4 * 160..640 * 4 * 400].to_vec();
            if is_so(&lower) {
                return lower;
            }
            assert!(start.elapsed() < PATIENCE, "waited for {what}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn fake(&self, kind: u8, detail: u8, [x, y]: [i16; 2]) {
        self.connection.xtest_fake_input(kind, detail, 0, self.root, x, y, 0).expect("a request");
        self.connection.flush().expect("a connection");
        std::thread::sleep(Duration::from_millis(30));
    }

    fn drag(&self, from: [i16; 2], to: [i16; 2]) {
        self.fake(MOTION, 0, from);
        self.fake(BUTTON_PRESS, 1, from);
        for step in 1..=5 {
            let at = [0, 1].map(|i| from[i] + (to[i] - from[i]) * step / 5);
            self.fake(MOTION, 0, at);
        }
        self.fake(BUTTON_RELEASE, 1, to);
    }

    /// Gives the window the keys: there is no window manager that would.
    fn focus(&self) {
        let tree = self.connection.query_tree(self.root).expect("a request").reply().expect("windows");
        for window in tree.children {
            let focus =
                self.connection.set_input_focus(InputFocus::POINTER_ROOT, window, x11rb::CURRENT_TIME);
            // Windows that are not shown refuse.
            _ = focus.expect("a request").check();
        }
        std::thread::sleep(Duration::from_millis(200));
    }

    /// Presses the key that writes this letter.
    fn key(&self, letter: u8) {
        self.key_of(letter.into());
    }

    /// Presses a key while another one is held.
    fn key_with(&self, held: u32, symbol: u32) {
        let code = self.code(held);
        self.fake(PRESS, code, [0; 2]);
        self.key_of(symbol);
        self.fake(RELEASE, code, [0; 2]);
    }

    /// Presses the key of this symbol.
    fn key_of(&self, symbol: u32) {
        let code = self.code(symbol);
        self.fake(PRESS, code, [0; 2]);
        self.fake(RELEASE, code, [0; 2]);
    }

    fn code(&self, symbol: u32) -> u8 {
        let setup = self.connection.setup();
        let (first, last) = (setup.min_keycode, setup.max_keycode);
        let reply = self.connection.get_keyboard_mapping(first, last - first + 1).expect("a request");
        let map = reply.reply().expect("a keyboard");
        let per = usize::from(map.keysyms_per_keycode);
        let index = map.keysyms.chunks(per).position(|symbols| symbols.contains(&symbol));
        first + index.expect("a key") as u8
    }

    /// Writes the screen to a file beside the other products of the tests, to be looked at.
    fn screenshot(&self, name: &str) {
        let rgb: Vec<u8> = self.pixels().chunks_exact(4).flat_map(|p| [p[2], p[1], p[0]]).collect();
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("screenshots");
        std::fs::create_dir_all(&folder).expect("a folder");
        let bytes = heliostat::formats::image::encode_png(640, 480, &rgb).expect("a picture");
        std::fs::write(folder.join(format!("{name}.png")), bytes).expect("a file");
    }
}

fn difference(a: &[u8], b: &[u8]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64
}

fn brightness(pixels: &[u8]) -> f64 {
    pixels.iter().map(|&b| f64::from(b)).sum::<f64>() / pixels.len() as f64
}

#[test]
fn a_window_shows_a_scene_and_answers_mouse_and_keys() {
    let Some(mut display) = display() else { return };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("window");
    _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    display.view(&folder, "cornell --size 640x480");
    let playing = display.wait("a picture", |pixels| brightness(pixels) > 40.0);
    display.wait("movement", |pixels| difference(pixels, &playing) > 1.0);
    display.focus();
    display.key(b' ');
    std::thread::sleep(Duration::from_millis(800));
    let last = std::cell::RefCell::new(Vec::new());
    let still = display.wait("the clip to stop", |pixels| {
        std::thread::sleep(Duration::from_millis(200));
        let before = last.replace(pixels.to_vec());
        !before.is_empty() && difference(&before, pixels) < 0.3
    });
    display.screenshot("20-window");
    display.drag([200, 380], [330, 350]);
    let turned = display.wait("the view to turn", |pixels| difference(pixels, &still) > 3.0);
    display.key(b'h');
    display.wait("the view to come back", |pixels| difference(pixels, &turned) > 3.0);
    display.fake(MOTION, 0, [320, 70]);
    display.fake(BUTTON_PRESS, 1, [320, 70]);
    display.fake(BUTTON_RELEASE, 1, [320, 70]);
    std::thread::sleep(Duration::from_millis(500));
    display.screenshot("21-picked");
    let igi = display.wait("a picture", |_| true);
    display.key(b'v');
    display.wait("depth instead of light", |pixels| difference(pixels, &igi) > 8.0);
    display.screenshot("22-depth");
    display.key_of(BACKSPACE);
    display.wait("light instead of depth", |pixels| difference(pixels, &igi) < 8.0);
    // What a key goes on from is what was told last: not faster than pictures are made.
    for _ in 0..2 {
        std::thread::sleep(Duration::from_millis(800));
        display.key(b'm');
    }
    display.wait("false colours", |pixels| difference(pixels, &igi) > 8.0);
    std::thread::sleep(Duration::from_millis(800));
    display.screenshot("24-false-colours");
    display.key_of(BACKSPACE);
    display.wait("the picture again", |pixels| difference(pixels, &igi) < 8.0);
    // The lamp's glow, the last of its properties: less and less of it, at an exposure that stays.
    display.key(b',');
    std::thread::sleep(Duration::from_millis(800));
    let before = display.wait("a picture", |_| true);
    display.key_with(SHIFT, TAB);
    for _ in 0..6 {
        display.key_with(SHIFT, b'['.into());
        std::thread::sleep(Duration::from_millis(150));
    }
    display.wait("less light", |pixels| brightness(pixels) < 0.8 * brightness(&before));
    display.screenshot("25-panel");
    display.key(b'o');
    display.key_of(F1);
    std::thread::sleep(Duration::from_millis(400));
    display.screenshot("26-help");
    display.key_of(F1);
    display.key(b'o');
    display.key(b'p');
    let start = Instant::now();
    let saved = folder.join("heliostat-1.png");
    while !saved.exists() {
        assert!(start.elapsed() < PATIENCE, "no picture was saved");
        std::thread::sleep(Duration::from_millis(50));
    }
    display.screenshot("23-saved");
    let alive = display.viewer.as_mut().expect("a viewer").try_wait();
    assert!(matches!(alive, Ok(None)), "it still runs");
}

#[test]
fn without_a_display_there_is_a_page() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_heliostat"));
    command.args(["view", "no-such-scene"]).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    let output = command.output().expect("it runs");
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(text.contains("no-such-scene") && text.contains("atrium-evening"), "{text}");

    let mut command = Command::new(env!("CARGO_BIN_EXE_heliostat"));
    command.args(["view", "cornell"]).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    let mut process = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    let stderr = BufReader::new(process.stderr.take().expect("a pipe"));
    let note = stderr.lines().map_while(Result::ok).next().unwrap_or_default();
    assert!(note.contains("there is no display"), "{note}");
    // Another test program may have the port: then the program says so and ends.
    _ = process.kill();
    _ = process.wait();
}
