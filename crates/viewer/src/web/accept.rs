//! Takes connections: no more than a limit, and none that keeps the server waiting.

use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep, sleep};

/// After so long a connection takes no further requests; browsers open another one.
const REQUESTS: Duration = Duration::from_secs(60);
/// After so long again the last of them ends, done or not; what has become a WebSocket goes on.
const LAST: Duration = Duration::from_secs(600);
/// Largest head of a request, bytes, and most headers in it.
const MAX_HEAD: usize = 32 << 10;
const MAX_HEADERS: usize = 64;
/// Failures to take a connection, one after the other, that mean that the socket is lost.
const MAX_FAILURES: u32 = 200;

/// What connections may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// At once, those that become WebSockets included; further ones are told so and closed.
    pub connections: usize,
    /// For the head of a request to come in, and until the next one begins.
    pub head: Duration,
    /// Without a byte in either direction; answers that take long to be made are among what is waited for.
    pub stall: Duration,
}

impl Default for Limits {
    /// 64 connections (a browser opens up to seven), 10 s for a head, a minute without a byte.
    fn default() -> Self {
        Self { connections: 64, head: Duration::from_secs(10), stall: Duration::from_secs(60) }
    }
}

/// Serves until the socket is lost.
pub(super) async fn serve(listener: TcpListener, router: Router, limits: Limits) {
    let places = Arc::new(Semaphore::new(limits.connections));
    let mut failures = 0;
    while failures < MAX_FAILURES {
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            Err(_) => {
                // Out of file handles, or gone before it was taken: others may be luckier a little later.
                failures += 1;
                sleep(Duration::from_millis(25)).await;
                continue;
            }
        };
        failures = 0;
        // Pictures and the answers to inputs are not to wait for each other.
        _ = stream.set_nodelay(true);
        match places.clone().try_acquire_owned() {
            Ok(place) => {
                let stream = Patient::new(stream, limits.stall, place);
                tokio::spawn(connection(stream, router.clone(), limits));
            }
            Err(_) => turn_away(&stream),
        }
    }
}

/// Says that there is no room, if that can be said at once.
fn turn_away(stream: &TcpStream) {
    let text = "too many connections; try again later\n";
    let length = text.len();
    _ = stream.try_write(
        format!("HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{text}")
            .as_bytes(),
    );
}

/// Answers the requests of one connection.
async fn connection(stream: Patient, router: Router, limits: Limits) {
    let mut builder = http1::Builder::new();
    builder.timer(TokioTimer::new()).header_read_timeout(limits.head);
    builder.max_buf_size(MAX_HEAD).max_headers(MAX_HEADERS);
    let service = TowerToHyperService::new(router);
    let mut served = std::pin::pin!(builder.serve_connection(TokioIo::new(stream), service).with_upgrades());
    // However it ends, nobody is left to be told.
    tokio::select! {
        _ = served.as_mut() => return,
        () = sleep(REQUESTS) => {}
    }
    served.as_mut().graceful_shutdown();
    _ = tokio::time::timeout(LAST, served).await;
}

/// A stream that breaks when nothing moves for too long; it holds its place among the connections.
struct Patient {
    stream: TcpStream,
    patience: Duration,
    end: Pin<Box<Sleep>>,
    _place: OwnedSemaphorePermit,
}

impl Patient {
    fn new(stream: TcpStream, patience: Duration, place: OwnedSemaphorePermit) -> Self {
        Self { stream, patience, end: Box::pin(sleep(patience)), _place: place }
    }

    /// Passes on what came of reading or writing; an error where both have waited too long.
    fn judged<T>(&mut self, context: &mut Context<'_>, outcome: Poll<io::Result<T>>) -> Poll<io::Result<T>> {
        if outcome.is_ready() {
            let end = Instant::now() + self.patience;
            self.end.as_mut().reset(end);
            return outcome;
        }
        ready!(self.end.as_mut().poll(context));
        Poll::Ready(Err(io::ErrorKind::TimedOut.into()))
    }
}

impl AsyncRead for Patient {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let outcome = Pin::new(&mut self.stream).poll_read(context, buffer);
        self.judged(context, outcome)
    }
}

impl AsyncWrite for Patient {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let outcome = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.judged(context, outcome)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        pieces: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let outcome = Pin::new(&mut self.stream).poll_write_vectored(context, pieces);
        self.judged(context, outcome)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
