//! Chromium without a display, driven over its DevTools protocol.

use std::cell::{Cell, RefCell};
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

use super::PATIENCE;

/// A running browser; ends with this value.
pub(crate) struct Browser {
    process: Child,
    profile: PathBuf,
    socket: RefCell<WebSocket<MaybeTlsStream<TcpStream>>>,
    next: Cell<u64>,
    _alone: MutexGuard<'static, ()>,
}

/// One browser at a time: several starve each other on small machines until pages lose their places.
static ALONE: Mutex<()> = Mutex::new(());

/// A tab of a browser.
pub(crate) struct Tab<'a> {
    browser: &'a Browser,
    session: String,
}

/// Debian's Chromium, or what `HELIOSTAT_CHROMIUM` names. As root it is installed where it is missing. `None` when there
/// is none: then the tests say that they did not run, unless `HELIOSTAT_CHROMIUM=required`.
pub(crate) fn chromium() -> Option<PathBuf> {
    let wanted = std::env::var("HELIOSTAT_CHROMIUM").unwrap_or_default();
    if !wanted.is_empty() && wanted != "required" {
        return Some(wanted.into());
    }
    let found = || {
        let names = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
        names.iter().map(PathBuf::from).find(|path| path.exists())
    };
    found().or_else(|| {
        super::install("chromium");
        let installed = found();
        assert!(
            installed.is_some() || wanted != "required",
            "Chromium is missing and could not be installed"
        );
        if installed.is_none() {
            super::not_run("the tests of the page need Chromium; install Debian's package `chromium`");
        }
        installed
    })
}

impl Browser {
    /// Starts a browser with a profile of its own.
    pub(crate) fn start(program: &Path, name: &str) -> Self {
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let profile =
            Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("browser-{name}-{}", std::process::id()));
        _ = std::fs::remove_dir_all(&profile);
        let mut command = Command::new(program);
        command
            .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0"])
            .args(["--no-first-run", "--disable-extensions", "--disable-background-networking"])
            .args(["--disable-dev-shm-usage", "--window-size=1000,700"])
            .arg(format!("--user-data-dir={}", profile.display()));
        let mut process =
            command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the browser starts");
        let stderr = BufReader::new(process.stderr.take().expect("a pipe"));
        let mut lines = stderr.lines().map_while(Result::ok);
        let url = lines.find_map(|line| line.strip_prefix("DevTools listening on ").map(str::to_owned));
        let url = url.expect("the browser tells its address");
        // Whatever else it has to say must not fill the pipe.
        std::thread::spawn(move || lines.for_each(drop));
        let (socket, _) = tungstenite::connect(url).expect("a connection to the browser");
        Self { process, profile, socket: RefCell::new(socket), next: Cell::new(0), _alone: alone }
    }

    fn call(&self, session: Option<&str>, method: &str, parameters: Value) -> Value {
        let id = self.next.get() + 1;
        self.next.set(id);
        let mut message = json!({"id": id, "method": method, "params": parameters});
        if let Some(session) = session {
            message["sessionId"] = session.into();
        }
        let mut socket = self.socket.borrow_mut();
        socket.send(Message::text(message.to_string())).expect("a connection to the browser");
        loop {
            let Message::Text(text) = socket.read().expect("an answer of the browser") else { continue };
            let answer: Value = serde_json::from_str(&text).expect("JSON");
            if answer["id"] == id {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].clone();
            }
        }
    }

    /// What pages save goes into a folder, without a question.
    pub(crate) fn save_into(&self, folder: &Path) {
        self.call(None, "Browser.setDownloadBehavior", json!({"behavior": "allow", "downloadPath": folder}));
    }

    /// Opens a page in a tab of this size.
    pub(crate) fn open(&self, url: &str, width: u32, height: u32) -> Tab<'_> {
        let target = self.call(None, "Target.createTarget", json!({"url": "about:blank"}));
        let target = json!({"targetId": target["targetId"], "flatten": true});
        let session = self.call(None, "Target.attachToTarget", target)["sessionId"].clone();
        let tab = Tab { browser: self, session: session.as_str().expect("a session").into() };
        tab.resize(width, height, false);
        tab.call("Page.enable", json!({}));
        tab.call("Page.navigate", json!({"url": url}));
        tab
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        _ = self.process.kill();
        _ = self.process.wait();
        _ = std::fs::remove_dir_all(&self.profile);
    }
}

impl Tab<'_> {
    pub(crate) fn call(&self, method: &str, parameters: Value) -> Value {
        self.browser.call(Some(&self.session), method, parameters)
    }

    pub(crate) fn resize(&self, width: u32, height: u32, phone: bool) {
        let metrics = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": phone});
        self.call("Emulation.setDeviceMetricsOverride", metrics);
    }

    /// The value of an expression of JavaScript.
    pub(crate) fn value(&self, expression: &str) -> Value {
        let parameters = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        let answer = self.call("Runtime.evaluate", parameters);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub(crate) fn wait(&self, expression: &str) {
        let start = Instant::now();
        while self.value(&format!("!!({expression})")) != true {
            assert!(
                start.elapsed() < PATIENCE,
                "waited for {expression}; {}",
                self.value("JSON.stringify([window.heliostat?.header, window.heliostat?.state, document.getElementById('messages')?.innerText])")
            );
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    fn mouse(&self, kind: &str, [x, y]: [f64; 2], button: &str) {
        let buttons = u32::from(kind != "mouseReleased");
        let event =
            json!({"type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1});
        self.call("Input.dispatchMouseEvent", event);
    }

    pub(crate) fn click(&self, at: [f64; 2]) {
        self.mouse("mousePressed", at, "left");
        self.mouse("mouseReleased", at, "left");
    }

    /// Drags in some steps.
    pub(crate) fn drag(&self, from: [f64; 2], to: [f64; 2]) {
        self.mouse("mousePressed", from, "left");
        for step in 1..=6 {
            let t = f64::from(step) / 6.0;
            let at = [0, 1].map(|i| from[i] + t * (to[i] - from[i]));
            self.mouse("mouseMoved", at, "left");
            std::thread::sleep(Duration::from_millis(25));
        }
        self.mouse("mouseReleased", to, "left");
    }

    /// Fingers go from the first places to the second ones.
    pub(crate) fn fingers(&self, from: &[[f64; 2]], to: &[[f64; 2]]) {
        let points = |places: &[[f64; 2]]| -> Vec<Value> {
            places.iter().enumerate().map(|(id, [x, y])| json!({"x": x, "y": y, "id": id})).collect()
        };
        for count in 1..=from.len() {
            let event = json!({"type": "touchStart", "touchPoints": points(&from[..count])});
            self.call("Input.dispatchTouchEvent", event);
        }
        for step in 1..=6 {
            let t = f64::from(step) / 6.0;
            let mix = |(a, b): (&[f64; 2], &[f64; 2])| [0, 1].map(|i| a[i] + t * (b[i] - a[i]));
            let places: Vec<_> = from.iter().zip(to).map(mix).collect();
            let event = json!({"type": "touchMove", "touchPoints": points(&places)});
            self.call("Input.dispatchTouchEvent", event);
            std::thread::sleep(Duration::from_millis(25));
        }
        self.call("Input.dispatchTouchEvent", json!({"type": "touchEnd", "touchPoints": []}));
    }

    /// Presses and lets go of a key that writes this text.
    pub(crate) fn key(&self, code: &str, text: &str) {
        for kind in ["keyDown", "keyUp"] {
            let event = json!({"type": kind, "code": code, "key": text, "text": if kind == "keyDown" { text } else { "" }});
            self.call("Input.dispatchKeyEvent", event);
        }
    }

    /// Writes what is seen to a file beside the other products of the tests, to be looked at.
    pub(crate) fn screenshot(&self, name: &str) {
        self.save(&format!("{name}.png"), json!({"format": "png"}));
    }

    /// The same in a form of choice.
    pub(crate) fn save(&self, file: &str, form: Value) {
        let picture = self.call("Page.captureScreenshot", form);
        let bytes = super::base64(picture["data"].as_str().expect("a picture"));
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("screenshots");
        std::fs::create_dir_all(&folder).expect("a folder");
        std::fs::write(folder.join(file), bytes).expect("a file");
    }
}
