//! What the tests of the viewer share: a server as users start it, a client that speaks its protocol, a browser.

#![allow(dead_code, reason = "each test program uses a part of it")]

pub(crate) mod browser;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

/// Longest that anything is waited for: machines that test many things at once are slow.
pub(crate) const PATIENCE: Duration = Duration::from_secs(90);

/// `heliostat serve`; ends with this value.
pub(crate) struct Served {
    process: Child,
    pub(crate) url: String,
}

impl Served {
    /// Starts it with arguments separated by spaces.
    pub(crate) fn start(arguments: &str) -> Self {
        Self::start_with(arguments, Stdio::null())
    }

    /// The same; what it has to say goes to `stderr`.
    pub(crate) fn start_with(arguments: &str, stderr: impl Into<Stdio>) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_heliostat"));
        command.arg("serve").args(arguments.split_whitespace());
        let mut process = command.stdout(Stdio::piped()).stderr(stderr).spawn().expect("it starts");
        let mut url = String::new();
        let stdout = process.stdout.take().expect("a pipe");
        BufReader::new(stdout).read_line(&mut url).expect("an address");
        assert!(url.starts_with("http://"), "{url}");
        Self { process, url: url.trim().into() }
    }

    /// Host and port.
    pub(crate) fn address(&self) -> &str {
        self.url["http://".len()..].split('/').next().expect("a host")
    }

    pub(crate) fn port(&self) -> u16 {
        self.address().rsplit_once(':').expect("a port").1.parse().expect("a number")
    }

    /// Bytes that the process holds in memory, where the system tells.
    pub(crate) fn memory(&self) -> Option<u64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.process.id())).ok()?;
        let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
        Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? << 10)
    }

    pub(crate) fn is_alive(&mut self) -> bool {
        matches!(self.process.try_wait(), Ok(None))
    }

    /// Answers a request with its status and body.
    pub(crate) fn request(&self, head: &str, body: &[u8]) -> (u16, Vec<u8>) {
        let mut stream = TcpStream::connect(self.address()).expect("it listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        let length = body.len();
        let head = format!("{head}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n");
        // A server that refuses a large body may close before all of it has come.
        _ = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(body));
        let mut answer = Vec::new();
        _ = stream.read_to_end(&mut answer);
        let text = String::from_utf8_lossy(&answer);
        let status = text.split_whitespace().nth(1).and_then(|code| code.parse().ok()).unwrap_or(0);
        let end = answer.windows(4).position(|w| w == b"\r\n\r\n").map_or(answer.len(), |at| at + 4);
        (status, answer[end..].to_vec())
    }

    pub(crate) fn get(&self, path: &str) -> (u16, Vec<u8>) {
        self.request(&format!("GET {path} HTTP/1.1\r\nHost: {}", self.address()), b"")
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        _ = self.process.kill();
        _ = self.process.wait();
    }
}

/// A picture as it came.
#[derive(Clone, Debug)]
pub(crate) struct Shown {
    pub(crate) header: Value,
    pub(crate) bytes: Vec<u8>,
    pub(crate) at: Instant,
}

impl Shown {
    pub(crate) fn number(&self, name: &str) -> f64 {
        self.header[name].as_f64().unwrap_or_else(|| panic!("`{name}` in {}", self.header))
    }

    pub(crate) fn is(&self, name: &str) -> bool {
        self.header[name].as_bool().unwrap_or(false)
    }
}

/// A viewer without a browser.
pub(crate) struct Client {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    pub(crate) key: String,
    pub(crate) state: Value,
    pub(crate) viewers: Value,
    pub(crate) refused: Vec<String>,
    pub(crate) last: Option<Shown>,
    number: u64,
}

impl Client {
    pub(crate) fn connect(served: &Served) -> Self {
        Self::try_connect(served).expect("a connection")
    }

    pub(crate) fn try_connect(served: &Served) -> Result<Self, tungstenite::Error> {
        let query = served.url.split_once('?').map_or("", |(_, query)| query);
        let (socket, _) = tungstenite::connect(format!("ws://{}/socket?{query}", served.address()))?;
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            stream.set_read_timeout(Some(Duration::from_millis(200)))?;
            stream.set_nodelay(true)?;
        }
        Ok(Self {
            socket,
            key: String::new(),
            state: Value::Null,
            viewers: Value::Null,
            refused: Vec::new(),
            last: None,
            number: 0,
        })
    }

    /// Sends any text.
    pub(crate) fn say(&mut self, text: &str) -> Result<(), tungstenite::Error> {
        self.socket.send(Message::text(text))
    }

    /// Sends any bytes.
    pub(crate) fn say_bytes(&mut self, bytes: Vec<u8>) -> Result<(), tungstenite::Error> {
        self.socket.send(Message::binary(bytes))
    }

    /// Does something; returns its number.
    pub(crate) fn input(&mut self, input: Value) -> u64 {
        self.number += 1;
        let message = json!({"input": input, "number": self.number});
        self.say(&message.to_string()).expect("a connection");
        self.number
    }

    /// Takes one message, if one comes soon; acknowledges pictures.
    pub(crate) fn hear(&mut self) -> Result<Option<Shown>, tungstenite::Error> {
        let message = match self.socket.read() {
            Err(tungstenite::Error::Io(error))
                if matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) =>
            {
                return Ok(None);
            }
            other => other?,
        };
        match message {
            Message::Text(text) => {
                let message: Value = serde_json::from_str(&text).expect("JSON");
                if let Some(key) = message["welcome"]["key"].as_str() {
                    self.key = key.into();
                } else if !message["state"].is_null() {
                    self.state = message["state"].clone();
                } else if !message["viewers"].is_null() {
                    self.viewers = message["viewers"].clone();
                } else if let Some(reason) = message["refused"].as_str() {
                    self.refused.push(reason.into());
                }
                Ok(None)
            }
            Message::Binary(data) => {
                let length = u32::from_le_bytes(data[..4].try_into().expect("four bytes")) as usize;
                let header: Value = serde_json::from_slice(&data[4..4 + length]).expect("JSON");
                let shown = Shown { header, bytes: data[4 + length..].to_vec(), at: Instant::now() };
                self.say(&json!({"shown": shown.header["number"]}).to_string())?;
                self.last = Some(shown.clone());
                Ok(Some(shown))
            }
            _ => Ok(None),
        }
    }

    /// Waits until something is so.
    pub(crate) fn wait(&mut self, what: &str, is_so: impl Fn(&Self) -> bool) {
        let start = Instant::now();
        while !is_so(self) {
            assert!(start.elapsed() < PATIENCE, "waited for {what}; {} {:?}", self.state, self.refused);
            self.hear().unwrap_or_else(|error| panic!("waiting for {what}: {error}"));
        }
    }

    /// Waits for a picture that is so.
    pub(crate) fn picture(&mut self, what: &str, is_so: impl Fn(&Shown) -> bool) -> Shown {
        let start = Instant::now();
        loop {
            assert!(start.elapsed() < PATIENCE, "waited for {what}; {} {:?}", self.state, self.refused);
            match self.hear() {
                Ok(Some(shown)) if is_so(&shown) => return shown,
                Ok(_) => {}
                Err(error) => panic!("waiting for {what}: {error}"),
            }
        }
    }
}

/// Says of each claim whether it was kept; panics if one was not.
#[expect(clippy::print_stdout, reason = "verdicts are for those who ask for them")]
pub(crate) fn judge(what: &str, claims: &[(String, bool)]) {
    for (claim, kept) in claims {
        println!("{} {claim}", if *kept { "kept:  " } else { "BROKEN:" });
    }
    let passed = claims.iter().all(|(_, kept)| *kept);
    println!("verdict on {what}: {}", if passed { "PASSED" } else { "FAILED" });
    assert!(passed, "{what}");
}

/// Says plainly that tests did not run, past the test harness that would swallow it.
pub(crate) fn not_run(why: &str) {
    _ = writeln!(std::io::stderr(), "NOT RUN: {why}");
}

/// Installs a Debian package, as far as that is possible here.
pub(crate) fn install(package: &str) {
    for arguments in [&["update", "-qq"][..], &["install", "-y", "-qq", "--no-install-recommends", package]] {
        let quiet = || Stdio::null();
        let mut command = Command::new("apt-get");
        // Without rights or without Debian nothing happens, and the caller finds that out.
        _ = command.args(arguments).stdin(quiet()).stdout(quiet()).stderr(quiet()).status();
    }
}

/// Decodes base64 without gaps.
fn base64(text: &str) -> Vec<u8> {
    let digit = |b: u8| match b {
        b'A'..=b'Z' => b - b'A',
        b'a'..=b'z' => b - b'a' + 26,
        b'0'..=b'9' => b - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let digits: Vec<u32> = text.bytes().filter(|&b| b != b'=').map(|b| digit(b).into()).collect();
    let group = |four: &[u32]| {
        let bits = four.iter().enumerate().fold(0, |bits, (i, d)| bits | d << (18 - 6 * i));
        [bits >> 16, bits >> 8, bits].map(|b| b as u8)[..four.len() - 1].to_vec()
    };
    digits.chunks(4).flat_map(group).collect()
}
