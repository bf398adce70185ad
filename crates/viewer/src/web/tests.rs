//! Those who take up connections, with real sockets.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::{Limits, ServeOptions, Server};
use crate::host::Source;
use crate::session_tests::TestHost;

fn server(limits: Limits) -> Server {
    let listen = SocketAddr::from(([127, 0, 0, 1], 0));
    let options = ServeOptions { listen, limits, upload_bytes: 1 << 20, ..ServeOptions::default() };
    Server::start(Arc::new(TestHost::default()), Source::Named("cornell".into()), &options).expect("a server")
}

fn connect(server: &Server) -> TcpStream {
    let stream = TcpStream::connect(server.address()).expect("it listens");
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
    stream
}

/// What comes until the connection ends, and after how long it does.
fn rest(mut stream: &TcpStream) -> (String, Duration) {
    let (start, mut bytes) = (Instant::now(), Vec::new());
    // A connection that is cut ends as well as one that is closed.
    _ = stream.read_to_end(&mut bytes);
    (String::from_utf8_lossy(&bytes).into_owned(), start.elapsed())
}

fn get(server: &Server, path: &str) -> String {
    let mut stream = connect(server);
    let head = format!("GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", server.address());
    stream.write_all(head.as_bytes()).expect("it listens");
    rest(&stream).0
}

fn answers(server: &Server) -> bool {
    get(server, "/").starts_with("HTTP/1.1 200")
}

#[test]
fn connections_are_counted_and_free_their_places() {
    let patient = Duration::from_secs(600);
    let server = server(Limits { connections: 3, head: patient, stall: patient });
    let held: Vec<_> = (0..3).map(|_| connect(&server)).collect();
    let start = Instant::now();
    // They are taken in order, so that this one is the fourth.
    let refused = get(&server, "/");
    assert!(refused.starts_with("HTTP/1.1 503") && refused.contains("too many"), "{refused}");
    drop(held);
    while !answers(&server) {
        assert!(start.elapsed() < Duration::from_secs(20), "the places stay taken");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn who_is_slow_with_a_head_loses_the_connection() {
    let limits = Limits { connections: 8, head: Duration::from_millis(700), stall: Duration::from_secs(600) };
    let server = server(limits);
    let mut stream = connect(&server);
    stream.write_all(b"GET / HTTP/1.1\r\nHo").expect("it listens");
    let start = Instant::now();
    // A byte now and then does not help: the whole head counts.
    while start.elapsed() < Duration::from_secs(20) && stream.write_all(b"x").is_ok() {
        std::thread::sleep(Duration::from_millis(100));
    }
    assert!(start.elapsed() < Duration::from_secs(10), "{:?}", start.elapsed());
    // Nor does a first request that was whole: the connection does not wait for ever for the next one.
    let mut stream = connect(&server);
    let head = format!("GET /style.css HTTP/1.1\r\nHost: {}\r\n\r\n", server.address());
    stream.write_all(head.as_bytes()).expect("it listens");
    let (text, after) = rest(&stream);
    assert!(text.starts_with("HTTP/1.1 200") && after < Duration::from_secs(10), "{after:?}");
    // Heads that have no end are not stored.
    let mut stream = connect(&server);
    let long = format!("GET / HTTP/1.1\r\nHost: {}\r\nX: {}", server.address(), "x".repeat(1 << 20));
    _ = stream.write_all(long.as_bytes());
    let text = rest(&stream).0;
    assert!(text.is_empty() || text.starts_with("HTTP/1.1 4"), "{text}");
    assert!(answers(&server));
}

#[test]
fn who_neither_reads_nor_writes_loses_the_connection() {
    let limits = Limits { connections: 8, head: Duration::from_secs(600), stall: Duration::from_millis(700) };
    let server = server(limits);
    // Nothing at all.
    assert!(rest(&connect(&server)).1 < Duration::from_secs(10));
    // Many requests, no answer read: the buffers between fill up, then the server waits to write.
    let mut stream = connect(&server);
    let head = format!("GET /panels.js HTTP/1.1\r\nHost: {}\r\n\r\n", server.address());
    stream.set_write_timeout(Some(Duration::from_millis(100))).expect("a timeout");
    let start = Instant::now();
    loop {
        match stream.write(head.repeat(50).as_bytes()) {
            Ok(_) => {}
            Err(error)
                if matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => {}
            // Cut off.
            Err(_) => break,
        }
        assert!(start.elapsed() < Duration::from_secs(30), "it is waited for");
    }
    assert!(answers(&server));
}

#[test]
fn files_of_strangers_are_not_taken_in() {
    let server = server(Limits::default());
    let mut stream = connect(&server);
    // A megabyte is announced; the answer comes before a byte of it.
    let head = format!(
        "POST /upload?name=a.obj&key=0 HTTP/1.1\r\nHost: {}\r\nContent-Length: 1000000\r\n\r\n",
        server.address()
    );
    stream.write_all(head.as_bytes()).expect("it listens");
    let mut answer = [0; 12];
    stream.read_exact(&mut answer).expect("an answer");
    assert_eq!(&answer, b"HTTP/1.1 403");
}
