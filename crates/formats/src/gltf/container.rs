//! What is around the document: the binary container, URIs and buffers.
//!
//! # References
//! Khronos, "glTF 2.0 Specification", sections 4.4 (GLB) and 3.6.1 (buffers). RFC 2397 (data URIs), RFC 3986
//! section 2.1 (percent-encoding).

use std::borrow::Cow;
use std::sync::Arc;

use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::json::Root;
use crate::context::Context;
use crate::error::LoadError;
use crate::place::{Place, Snippet};

/// A `.glb` file's parts.
pub(super) struct Glb<'a> {
    pub(super) json: &'a [u8],
    pub(super) binary: Option<&'a [u8]>,
}

impl<'a> Glb<'a> {
    pub(super) fn parse(file: &Arc<str>, bytes: &'a [u8]) -> Result<Self, LoadError> {
        let word = |at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
        let truncated = |at: usize| {
            LoadError::input(
                Place::byte(file, at),
                "the file ends here",
                "it may be truncated; fetch it again",
            )
        };
        match word(4) {
            Some(2) => {}
            Some(version) => {
                let problem = format!("binary glTF version {version}");
                return Err(LoadError::unsupported(Place::byte(file, 4), problem, "convert it to glTF 2.0"));
            }
            None => return Err(truncated(bytes.len())),
        }
        let total = word(8).ok_or_else(|| truncated(bytes.len()))? as usize;
        if total > bytes.len() {
            let problem = format!("the header says {total} bytes, the file has {}", bytes.len());
            return Err(LoadError::input(
                Place::byte(file, 8),
                problem,
                "it may be truncated; fetch it again",
            ));
        }
        let bytes = &bytes[..total];
        let mut glb = Self { json: &[], binary: None };
        let mut at = 12;
        for number in 0.. {
            let (Some(length), Some(kind)) = (word(at), word(at + 4)) else { break };
            let Some(chunk) = bytes.get(at + 8..).and_then(|rest| rest.get(..length as usize)) else {
                let problem = format!("a chunk of {length} bytes exceeds the file");
                return Err(LoadError::input(Place::byte(file, at), problem, "it may be truncated"));
            };
            match (number, &kind.to_le_bytes()) {
                (0, b"JSON") => glb.json = chunk,
                (0, _) => break,
                (_, b"BIN\0") if glb.binary.is_none() => glb.binary = Some(chunk),
                _ => {}
            }
            at += 8 + length as usize;
        }
        if glb.json.is_empty() {
            let problem = "the first chunk is not JSON";
            return Err(LoadError::input(Place::byte(file, 12), problem, "the file may be damaged"));
        }
        Ok(glb)
    }
}

/// Reads the document. In a `.gltf` file (`is_text`) errors have lines and columns, otherwise JSON paths.
pub(super) fn parse_document(
    context: &mut Context<'_>,
    file: &Arc<str>,
    text: &[u8],
    is_text: bool,
) -> Result<Root, LoadError> {
    let text = text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text);
    context.charge(super::json::parsed_size(text), &Place::whole(file))?;
    if let Ok(root) = serde_json::from_slice(text) {
        return Ok(root);
    }
    // Once more, slowly, to learn the path.
    let mut json = serde_json::Deserializer::from_slice(text);
    let result: Result<Root, _> = serde_path_to_error::deserialize(&mut json);
    let (path, error) = match result {
        Ok(root) => match json.end() {
            Ok(()) => return Ok(root),
            Err(error) => (String::new(), error),
        },
        Err(error) => (error.path().to_string(), error.into_inner()),
    };
    let message = error.to_string();
    let message = message.split(" at line ").next().unwrap_or_default();
    let at = if path.is_empty() || path == "." { String::new() } else { format!("{path}: ") };
    let hint = if error.is_eof() { "the file may be truncated" } else { "correct the document" };
    if !is_text {
        return Err(LoadError::input(
            Place::json(file, path),
            format!("the JSON is broken: {message}"),
            hint,
        ));
    }
    let (line, column) = (error.line(), error.column().max(1));
    let shown = text.split(|&b| b == b'\n').nth(line.saturating_sub(1)).unwrap_or_default();
    let number = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let place = Place::text(file, number(line), number(column));
    Err(LoadError::input(place, format!("{at}{message}"), hint).with_snippet(Snippet::new(
        shown,
        column - 1,
        1,
    )))
}

/// The buffers of a document, each at least as long as it says.
pub(super) fn read_buffers<'a>(
    context: &mut Context<'_>,
    file: &Arc<str>,
    root: &Root,
    binary: Option<&'a [u8]>,
) -> Result<Vec<Cow<'a, [u8]>>, LoadError> {
    let mut buffers = Vec::new();
    for (number, buffer) in root.buffers.iter().enumerate() {
        let place = Place::json(file, format!("buffers[{number}]"));
        let bytes = match (&buffer.uri, binary) {
            (Some(uri), _) => Cow::Owned(read_uri(context, &place, uri).map_err(|problem| {
                let hint = "put the file beside the scene or correct `uri`";
                LoadError::input(place.clone(), problem, hint)
            })?),
            (None, Some(binary)) if number == 0 => Cow::Borrowed(binary),
            (None, _) => {
                let hint = "give it a `uri`, or a binary chunk in a .glb file";
                return Err(LoadError::input(place, "the buffer has no data", hint));
            }
        };
        if (bytes.len() as u64) < buffer.byte_length {
            let problem =
                format!("`byteLength` is {}, the data has {} bytes", buffer.byte_length, bytes.len());
            return Err(LoadError::input(place, problem, "the data may be truncated"));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// The data that a URI names or holds; the error is what is wrong with it.
pub(super) fn read_uri(context: &mut Context<'_>, place: &Place, uri: &str) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (head, body) = data.split_once(',').ok_or("the data URI has no comma")?;
        context.charge(body.len() as u64, place).map_err(|error| error.problem())?;
        if !head.ends_with(";base64") {
            return Ok(percent_decode(body));
        }
        let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
        let engine = GeneralPurpose::new(&base64::alphabet::STANDARD, config);
        return engine.decode(body).map_err(|error| format!("the base64 data is broken: {error}"));
    }
    if uri.split_once("://").is_some_and(|(scheme, _)| scheme.bytes().all(|b| b.is_ascii_alphanumeric())) {
        return Err(format!("`{uri}` is not a local file"));
    }
    let name = file_name(uri);
    context.read(&name).map_err(|error| format!("`{name}`: {error}"))
}

/// The file that a relative URI names.
pub(super) fn file_name(uri: &str) -> String {
    String::from_utf8_lossy(&percent_decode(uri)).replace('\\', "/")
}

/// Replaces `%20` and the like; what is no valid escape stays.
fn percent_decode(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let digits =
            bytes.get(at + 1..at + 3).filter(|d| bytes[at] == b'%' && d.iter().all(u8::is_ascii_hexdigit));
        let escaped = digits.and_then(|d| u8::from_str_radix(std::str::from_utf8(d).ok()?, 16).ok());
        out.push(escaped.unwrap_or(bytes[at]));
        at += if escaped.is_some() { 3 } else { 1 };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_escapes_are_undone_where_they_are_valid() {
        assert_eq!(file_name("my%20textures\\a%C3%A9.png"), "my textures/aé.png");
        assert_eq!(file_name("100%_50%2"), "100%_50%2");
    }
}
