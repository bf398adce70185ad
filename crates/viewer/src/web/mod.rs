//! The page: a small web server that shows a session to browsers.
//!
//! It listens on this machine alone unless told otherwise; elsewhere it demands a token that it prints as part of the
//! address. Nothing that a browser sends names a file of the server, loads a plug-in, or takes more than the limits in
//! [`ServeOptions`] allow.

mod accept;
mod access;
mod connection;
mod encode;
mod protocol;
#[cfg(test)]
mod tests;
mod upload;
mod viewers;

use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use axum::Router;
use axum::extract::{Query, State, WebSocketUpgrade};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use tokio::sync::{Semaphore, oneshot, watch};

use crate::document::Refusal;
use crate::host::{Host, Source};
use crate::input::{Button, Input, Phase};
use crate::session::{Session, SessionOptions, locked};
pub use accept::Limits;
use access::Access;
use encode::Encoder;
use viewers::Viewers;

/// Largest message from a browser, bytes; whole files come another way.
const MAX_MESSAGE: usize = 64 << 10;

/// How a server runs.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// Where to listen; port 0 takes a free one.
    pub listen: SocketAddr,
    /// How the session begins.
    pub session: SessionOptions,
    /// Largest file that a browser may bring, bytes.
    pub upload_bytes: usize,
    /// Most browsers at once.
    pub viewers: usize,
    /// What their connections may take.
    pub limits: Limits,
}

impl Default for ServeOptions {
    /// This machine, port 8080; files of 256 MiB; eight browsers.
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 8080)),
            session: SessionOptions::default(),
            upload_bytes: 256 << 20,
            viewers: 8,
            limits: Limits::default(),
        }
    }
}

/// What the connections share.
struct App {
    session: Session,
    host: Arc<dyn Host>,
    access: Access,
    viewers: Mutex<Viewers>,
    encoder: Encoder,
    /// Grows when there is something new to send.
    news: Arc<watch::Sender<u64>>,
    /// The last input's number, whoever made it.
    inputs: AtomicU64,
    /// Largest file, bytes, and who may send one now: each is whole in memory.
    upload_bytes: usize,
    uploading: Semaphore,
}

impl App {
    /// Tells all connections to look for news.
    fn stir(&self) {
        self.news.send_modify(|number| *number += 1);
    }

    /// Changes who watches.
    fn with_viewers<T>(&self, change: impl FnOnce(&mut Viewers) -> T) -> T {
        let mut viewers = locked(&self.viewers);
        let result = change(&mut viewers);
        self.session.set_watchers(viewers.count());
        drop(viewers);
        self.stir();
        result
    }
}

/// A running server; it ends with this value.
pub struct Server {
    address: SocketAddr,
    url: String,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Server").field("url", &self.url).finish_non_exhaustive()
    }
}

impl Server {
    /// Starts to serve a session that opens `source`.
    ///
    /// # Errors
    /// When the address cannot be listened on, or threads or randomness are missing.
    pub fn start(host: Arc<dyn Host>, source: Source, options: &ServeOptions) -> Result<Self, Refusal> {
        let failed = |what: &str, error: &dyn std::fmt::Display| Refusal(format!("{what}: {error}"));
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .max_blocking_threads(4)
            // They stay: allocators keep memory for each, and ever new ones would make it more and more.
            .thread_keep_alive(Duration::from_secs(24 * 3600))
            .thread_name("heliostat-web")
            .enable_all()
            .build()
            .map_err(|error| failed("cannot start threads", &error))?;
        let listen = options.listen;
        let listener = runtime
            .block_on(tokio::net::TcpListener::bind(listen))
            .map_err(|error| failed(&format!("cannot listen on {listen}"), &error))?;
        let address = listener.local_addr().map_err(|error| failed("no address", &error))?;
        let access = Access::new(address).map_err(|error| failed("no random token", &error))?;
        let url = access.url(address);
        let news = Arc::new(watch::Sender::new(0));
        let bell = news.clone();
        let listening = move || bell.send_modify(|number| *number += 1);
        let session = Session::start(host.clone(), source, options.session.clone(), listening)?;
        let app = Arc::new(App {
            session,
            host,
            access,
            viewers: Mutex::new(Viewers::new(options.viewers)),
            encoder: Encoder::default(),
            news,
            inputs: AtomicU64::new(0),
            upload_bytes: options.upload_bytes,
            uploading: Semaphore::new(1),
        });
        let (stop, stopped) = oneshot::channel();
        let (router, limits) = (router(app), options.limits);
        let thread = std::thread::Builder::new().name("heliostat-serve".into()).spawn(move || {
            runtime.block_on(async {
                tokio::select! {
                    // It ends on its own only if it cannot listen any more.
                    () = accept::serve(listener, router, limits) => {}
                    _ = stopped => {}
                }
            });
            // Open connections are closed with their tasks.
            runtime.shutdown_timeout(Duration::from_secs(2));
        });
        let thread = thread.map_err(|error| failed("cannot start a thread", &error))?;
        Ok(Self { address, url, stop: Some(stop), thread: Some(thread) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The page's address, with the token where one is demanded.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Whether it has ended, as after losing its socket.
    pub fn has_ended(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(stop) = self.stop.take() {
            _ = stop.send(());
        }
        if let Some(thread) = self.thread.take() {
            _ = thread.join();
        }
    }
}

fn router(app: Arc<App>) -> Router {
    Router::new()
        .route("/", get(page))
        .route("/style.css", get(|| asset("text/css", include_str!("page/style.css"))))
        .route("/main.js", get(|| asset("text/javascript", include_str!("page/main.js"))))
        .route("/input.js", get(|| asset("text/javascript", include_str!("page/input.js"))))
        .route("/panels.js", get(|| asset("text/javascript", include_str!("page/panels.js"))))
        .route("/fields.js", get(|| asset("text/javascript", include_str!("page/fields.js"))))
        .route("/looks.js", get(|| asset("text/javascript", include_str!("page/looks.js"))))
        .route("/upload.js", get(|| asset("text/javascript", include_str!("page/upload.js"))))
        .route("/overlay.js", get(|| asset("text/javascript", include_str!("page/overlay.js"))))
        .route("/socket", get(socket))
        .route("/picture.png", get(picture_png))
        .route("/picture.exr", get(picture_exr))
        .route("/replay.json", get(replay))
        .route("/upload", post(upload::upload))
        .with_state(app)
}

/// What an address may carry behind its question mark.
#[derive(Debug, Default, serde::Deserialize)]
struct Parameters {
    #[serde(default)]
    token: String,
    /// The name of an uploaded file.
    #[serde(default)]
    name: String,
    /// Whether more comes with it.
    #[serde(default)]
    several: bool,
    /// The key of the viewer who uploads.
    #[serde(default)]
    key: String,
}

/// An answer with the headers that keep a page to itself.
fn answer(kind: &'static str, body: impl IntoResponse) -> Response {
    let mut response = body.into_response();
    let fixed = [
        (header::CONTENT_TYPE, kind),
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (
            header::CONTENT_SECURITY_POLICY,
            "default-src 'self'; img-src 'self' blob: data:; connect-src 'self' ws: wss:; frame-ancestors 'none'; base-uri 'none'",
        ),
        (header::HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    ];
    for (name, value) in fixed {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

fn refuse(status: StatusCode, reason: &str) -> Response {
    let mut response = answer("text/plain; charset=utf-8", format!("{reason}\n"));
    *response.status_mut() = status;
    response
}

async fn asset(kind: &'static str, text: &'static str) -> Response {
    answer(kind, text)
}

async fn page(State(app): State<Arc<App>>, query: Query<Parameters>, headers: HeaderMap) -> Response {
    match app.access.check(&headers, &query.token) {
        Ok(()) => answer("text/html; charset=utf-8", include_str!("page/index.html")),
        Err(reason) => refuse(StatusCode::FORBIDDEN, reason),
    }
}

async fn socket(
    State(app): State<Arc<App>>,
    query: Query<Parameters>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if let Err(reason) = app.access.check(&headers, &query.token) {
        return refuse(StatusCode::FORBIDDEN, reason);
    }
    let upgrade = upgrade.max_message_size(MAX_MESSAGE).max_frame_size(MAX_MESSAGE);
    upgrade.on_upgrade(move |socket| connection::run(app, socket))
}

async fn picture_png(State(app): State<Arc<App>>, query: Query<Parameters>, headers: HeaderMap) -> Response {
    picture(&app, &query, &headers, "image/png", |picture, _| {
        let mut bytes = Vec::new();
        picture.to_png(&mut bytes).map_err(|e| e.to_string())?;
        Ok(bytes)
    })
    .await
}

async fn picture_exr(State(app): State<Arc<App>>, query: Query<Parameters>, headers: HeaderMap) -> Response {
    let pack = |picture: &crate::Picture, host: &dyn Host| host.to_exr(&picture.frame).map_err(|e| e.0);
    picture(&app, &query, &headers, "image/x-exr", pack).await
}

/// The picture on show as a file.
async fn picture(
    app: &Arc<App>,
    query: &Parameters,
    headers: &HeaderMap,
    kind: &'static str,
    pack: impl FnOnce(&crate::Picture, &dyn Host) -> Result<Vec<u8>, String> + Send + 'static,
) -> Response {
    if let Err(reason) = app.access.check(headers, &query.token) {
        return refuse(StatusCode::FORBIDDEN, reason);
    }
    let Some(picture) = app.session.news().picture else {
        return refuse(StatusCode::NOT_FOUND, "there is no picture yet");
    };
    let host = app.host.clone();
    match tokio::task::spawn_blocking(move || pack(&picture, &*host)).await {
        Ok(Ok(bytes)) => answer(kind, bytes),
        Ok(Err(problem)) => refuse(StatusCode::INTERNAL_SERVER_ERROR, &problem),
        Err(_) => refuse(StatusCode::INTERNAL_SERVER_ERROR, "packing the picture failed"),
    }
}

async fn replay(State(app): State<Arc<App>>, query: Query<Parameters>, headers: HeaderMap) -> Response {
    if let Err(reason) = app.access.check(&headers, &query.token) {
        return refuse(StatusCode::FORBIDDEN, reason);
    }
    let asked = app.clone();
    match tokio::task::spawn_blocking(move || asked.session.replay()).await {
        Ok(Some(replay)) => answer("application/json", replay.to_json()),
        _ => refuse(StatusCode::NOT_FOUND, "there is no scene yet"),
    }
}

impl App {
    /// Lets go of whatever the one who held the controls was still holding: keys and the pointer.
    fn let_go(&self) {
        let still = Input::Drive { way: [0.0; 3], hurry: false };
        let up = Input::Pointer { phase: Phase::Up, at: [-1.0; 2], button: Button::Pan };
        for input in [up, still] {
            // With too many inputs waiting the session is not moving anyway.
            _ = self.session.input(self.next_input(), input);
        }
    }

    /// A number for the next input.
    fn next_input(&self) -> u64 {
        self.inputs.fetch_add(1, Ordering::SeqCst) + 1
    }
}
