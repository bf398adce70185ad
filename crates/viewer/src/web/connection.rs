//! One browser: takes what it sends, within limits, and sends it pictures as fast as it shows them.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};

use super::App;
use super::access::random_text;
use super::protocol::{Incoming, Outgoing, picture_message};
use crate::picture::Picture;
use crate::session::locked;

/// Pictures on their way at once.
const IN_FLIGHT: usize = 2;
/// A browser that says nothing for so long, not even in answer to a ping, is gone.
const PATIENCE: Duration = Duration::from_millis(3500);
/// Messages per second, and how many at once.
const RATE: f64 = 500.0;
const BURST: f64 = 1000.0;
/// Refused messages after which a connection is closed.
const MAX_REFUSED: u32 = 1000;
/// Inputs remembered until a picture shows them.
const MAX_UNSHOWN: usize = 4096;
/// Least time between two states.
const STATE_PAUSE: Duration = Duration::from_millis(40);
/// Qualities of JPEG, worst, first and best.
const QUALITIES: [u8; 3] = [35, 80, 88];
/// A picture is late when it takes longer to be shown, and early when shorter.
const LATE: Duration = Duration::from_millis(220);
const EARLY: Duration = Duration::from_millis(80);
/// Frames from which on a still picture is worth sending without losses.
const LOSSLESS_FROM: u32 = 8;

/// Why a connection ends.
enum End {
    /// It is closed or broken already.
    Gone,
    /// For the browser to know.
    Because(u16, &'static str),
}

/// A browser's state.
struct Connection {
    app: Arc<App>,
    socket: WebSocket,
    id: u64,
    seen: Instant,
    /// Messages it may send now.
    allowance: f64,
    filled: Instant,
    refused: u32,
    complained: Option<Instant>,
    /// Pictures on their way: number and when they were sent.
    flying: VecDeque<(u64, Instant)>,
    quality: u8,
    sent_picture: u64,
    /// Frames in the last still picture sent, and the number of the first of them; 0 after a moving one.
    sent_frames: u32,
    sent_first: u64,
    sent_state: u64,
    state_at: Option<Instant>,
    sent_viewers: u64,
    /// Its inputs that no picture has shown yet: the session's number and its own.
    inputs: VecDeque<(u64, u64)>,
    shown_input: u64,
}

/// Serves one browser until it leaves.
pub(super) async fn run(app: Arc<App>, mut socket: WebSocket) {
    let Ok(key) = random_text() else { return };
    let Some(id) = app.with_viewers(|viewers| viewers.join(key.clone())) else {
        let reason = "too many viewers; try again when one has left";
        _ = socket.send(close(close_code::AGAIN, reason)).await;
        return;
    };
    let now = Instant::now();
    let mut connection = Connection {
        app: app.clone(),
        socket,
        id,
        seen: now,
        allowance: BURST,
        filled: now,
        refused: 0,
        complained: None,
        flying: VecDeque::new(),
        quality: QUALITIES[1],
        sent_picture: 0,
        sent_frames: 0,
        sent_first: 0,
        sent_state: 0,
        state_at: None,
        sent_viewers: 0,
        inputs: VecDeque::new(),
        shown_input: 0,
    };
    let end = connection.serve(&key).await;
    if let Err(End::Because(code, reason)) = end {
        _ = tokio::time::timeout(Duration::from_secs(1), connection.socket.send(close(code, reason))).await;
    }
    if locked(&app.viewers).is_holder(id) {
        app.let_go();
    }
    app.with_viewers(|viewers| viewers.leave(id));
}

fn close(code: u16, reason: &'static str) -> Message {
    Message::Close(Some(CloseFrame { code, reason: reason.into() }))
}

impl Connection {
    async fn serve(&mut self, key: &str) -> Result<(), End> {
        self.send(Message::text(Outgoing::Welcome { key }.text())).await?;
        let mut news = self.app.news.subscribe();
        let mut tick = tokio::time::interval(Duration::from_secs(1));
        loop {
            let pause = self.pump().await?;
            tokio::select! {
                // What has been said counts before it is asked for how long nothing was: this machine may have been busy.
                biased;
                message = self.socket.recv() => match message {
                    Some(Ok(message)) => self.take(message).await?,
                    // Broken rules of the protocol end here too.
                    Some(Err(_)) | None => return Err(End::Gone),
                },
                _ = tick.tick() => {
                    if self.seen.elapsed() > PATIENCE {
                        return Err(End::Because(close_code::POLICY, "no answer"));
                    }
                    self.send(Message::Ping(Vec::new().into())).await?;
                }
                changed = news.changed() => changed.map_err(|_| End::Gone)?,
                // A state that had to wait is due.
                () = tokio::time::sleep(pause.unwrap_or(PATIENCE)) => {}
            }
        }
    }

    /// Sends a message; a browser that does not take it in time is gone.
    async fn send(&mut self, message: Message) -> Result<(), End> {
        match tokio::time::timeout(PATIENCE, self.socket.send(message)).await {
            Ok(Ok(())) => Ok(()),
            _ => Err(End::Gone),
        }
    }

    async fn take(&mut self, message: Message) -> Result<(), End> {
        self.seen = Instant::now();
        let text = match message {
            Message::Ping(_) | Message::Pong(_) => return Ok(()),
            Message::Close(_) => return Err(End::Gone),
            Message::Binary(_) => return self.complain("a binary message; send JSON as text").await,
            Message::Text(text) => text,
        };
        if !self.is_allowed() {
            return self.complain("too many messages").await;
        }
        match serde_json::from_str::<Incoming>(&text) {
            Ok(incoming) => self.obey(incoming).await,
            Err(error) => self.complain(&format!("not understood: {error}")).await,
        }
    }

    /// Whether it may send another message now.
    fn is_allowed(&mut self) -> bool {
        let now = Instant::now();
        self.allowance = (self.allowance + RATE * (now - self.filled).as_secs_f64()).min(BURST);
        self.filled = now;
        let allowed = self.allowance >= 1.0;
        if allowed {
            self.allowance -= 1.0;
        }
        allowed
    }

    /// Tells why a message was refused, but not more often than anyone reads.
    async fn complain(&mut self, reason: &str) -> Result<(), End> {
        self.refused += 1;
        if self.refused > MAX_REFUSED {
            return Err(End::Because(close_code::POLICY, "too many messages that had to be refused"));
        }
        if self.complained.is_some_and(|at| at.elapsed() < Duration::from_millis(50)) {
            return Ok(());
        }
        self.complained = Some(Instant::now());
        self.send(Message::text(Outgoing::Refused(reason).text())).await
    }

    async fn obey(&mut self, incoming: Incoming) -> Result<(), End> {
        if let Some(number) = incoming.shown {
            self.note_shown(number);
        }
        if incoming.ask {
            self.app.with_viewers(|viewers| viewers.ask(self.id));
        }
        if let Some(to) = incoming.give {
            if !self.app.with_viewers(|viewers| viewers.give(self.id, to)) {
                return self.complain("the controls are not yours to give, or there is no such viewer").await;
            }
            self.app.let_go();
        }
        let Some(input) = incoming.input else { return Ok(()) };
        if !locked(&self.app.viewers).is_holder(self.id) {
            return self.complain("another viewer holds the controls; ask for them first").await;
        }
        let number = self.app.next_input();
        match self.app.session.input(number, input) {
            Ok(()) => {
                self.inputs.push_back((number, incoming.number));
                if self.inputs.len() > MAX_UNSHOWN {
                    self.inputs.pop_front();
                }
                Ok(())
            }
            Err(refusal) => self.complain(&refusal.0).await,
        }
    }

    /// A picture has been shown: the connection is as fast as that tells.
    fn note_shown(&mut self, number: u64) {
        while let Some(&(flying, sent)) = self.flying.front() {
            if flying > number {
                break;
            }
            self.flying.pop_front();
            if flying == number {
                let [worst, _, best] = QUALITIES;
                let took = sent.elapsed();
                if took > LATE {
                    self.quality = self.quality.saturating_sub(8).max(worst);
                } else if took < EARLY {
                    self.quality = (self.quality + 1).min(best);
                }
            }
        }
    }

    /// Sends what is new; returns how long something has to wait, if anything does.
    async fn pump(&mut self) -> Result<Option<Duration>, End> {
        let number = locked(&self.app.viewers).number;
        if number != self.sent_viewers {
            self.sent_viewers = number;
            let company = locked(&self.app.viewers).company(self.id);
            self.send(Message::text(Outgoing::Viewers(company).text())).await?;
        }
        let news = self.app.session.news();
        let mut pause = None;
        if news.state.number != self.sent_state {
            let since = self.state_at.map_or(STATE_PAUSE, |at| at.elapsed());
            if since >= STATE_PAUSE {
                self.sent_state = news.state.number;
                self.state_at = Some(Instant::now());
                self.send(Message::text(Outgoing::State(&news.state).text())).await?;
            } else {
                pause = Some(STATE_PAUSE - since);
            }
        }
        if let Some(picture) = news.picture.filter(|picture| self.wants(picture)) {
            self.send_picture(&picture).await?;
        }
        Ok(pause)
    }

    /// Whether a picture is worth sending now.
    fn wants(&self, picture: &Picture) -> bool {
        let better = |frames: u32| picture.done || frames > self.sent_frames + self.sent_frames / 4;
        picture.number > self.sent_picture
            && self.flying.len() < IN_FLIGHT
            && (!picture.still
                || self.sent_frames == 0
                // A later stand-still, the beginning of which came too fast for this browser.
                || picture.first != self.sent_first
                || picture.frames <= self.sent_frames
                || better(picture.frames))
    }

    async fn send_picture(&mut self, picture: &Arc<Picture>) -> Result<(), End> {
        let good = self.quality >= QUALITIES[1];
        let quality = match picture.still {
            true if good && (picture.frames >= LOSSLESS_FROM || picture.done) => 0,
            true if good => 90,
            _ => self.quality,
        };
        let (app, shared) = (self.app.clone(), picture.clone());
        let packed = tokio::task::spawn_blocking(move || app.encoder.pack(&shared, quality)).await;
        let packed = match packed {
            Ok(Ok(packed)) => packed,
            Ok(Err(problem)) => {
                self.sent_picture = picture.number;
                return self.complain(&problem).await;
            }
            Err(_) => return Err(End::Gone),
        };
        while let Some(&(session, own)) = self.inputs.front() {
            if session > picture.input {
                break;
            }
            self.shown_input = own;
            self.inputs.pop_front();
        }
        self.sent_picture = picture.number;
        self.sent_frames = if picture.still { picture.frames } else { 0 };
        self.sent_first = picture.first;
        self.flying.push_back((picture.number, Instant::now()));
        let message = picture_message(picture, &packed, self.shown_input);
        self.send(Message::Binary(message.into())).await
    }
}
