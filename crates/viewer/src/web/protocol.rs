//! What goes over the wire. Texts are JSON; pictures are binary: the length of a JSON header (four bytes, little-endian),
//! the header, the packed picture.

use serde::{Deserialize, Serialize};

use super::viewers::Company;
use crate::gizmo::Line;
use crate::input::Input;
use crate::picture::Picture;
use crate::state::State;
use crate::stats::Stats;

/// What a browser sends: any of these.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Incoming {
    /// Something the user did.
    pub(super) input: Option<Input>,
    /// The sender's number of that input; pictures carry the latest one they show.
    #[serde(default)]
    pub(super) number: u64,
    /// A picture has arrived: its number.
    pub(super) shown: Option<u64>,
    /// Asks for the controls.
    #[serde(default)]
    pub(super) ask: bool,
    /// Hands the controls to this viewer.
    pub(super) give: Option<u64>,
}

/// What a browser is told as text.
#[derive(Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Outgoing<'a> {
    /// The key by which this viewer may upload.
    Welcome {
        key: &'a str,
    },
    State(&'a State),
    Viewers(Company),
    /// Why something it sent was refused.
    Refused(&'a str),
}

impl Outgoing<'_> {
    pub(super) fn text(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// What is told with a picture.
#[derive(Debug, Serialize)]
struct Header<'a> {
    number: u64,
    kind: &'static str,
    width: u32,
    height: u32,
    frames: u32,
    still: bool,
    done: bool,
    view: &'a str,
    time: f64,
    exposure: f32,
    lines: &'a [Line],
    stats: &'a Stats,
    /// The receiver's number of the latest input that it shows.
    input: u64,
    /// Packing, milliseconds.
    encode: f64,
    /// Of the JPEG, 1 to 100; 0 without losses.
    quality: u8,
}

/// A packed picture.
#[derive(Clone, Debug)]
pub(super) struct Packed {
    pub(super) bytes: Vec<u8>,
    /// 0 without losses.
    pub(super) quality: u8,
    pub(super) milliseconds: f64,
}

/// A picture as it goes over the wire; `input` is the receiver's number.
pub(super) fn picture_message(picture: &Picture, packed: &Packed, input: u64) -> Vec<u8> {
    let header = Header {
        number: picture.number,
        kind: if packed.quality == 0 { "image/png" } else { "image/jpeg" },
        width: picture.frame.width,
        height: picture.frame.height,
        frames: picture.frames,
        still: picture.still,
        done: picture.done,
        view: &picture.view,
        time: picture.time,
        exposure: picture.exposure,
        lines: &picture.lines,
        stats: &picture.stats,
        input,
        encode: packed.milliseconds,
        quality: packed.quality,
    };
    let header = serde_json::to_vec(&header).unwrap_or_default();
    let mut message = Vec::with_capacity(4 + header.len() + packed.bytes.len());
    message.extend_from_slice(&(header.len() as u32).to_le_bytes());
    message.extend_from_slice(&header);
    message.extend_from_slice(&packed.bytes);
    message
}
