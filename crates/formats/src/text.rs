//! A cursor over line-based text formats that knows where it is.

use std::borrow::Cow;
use std::sync::Arc;

use crate::error::LoadError;
use crate::place::{Place, Snippet};

/// Splits a text into logical lines: `\` before a line end continues the line.
pub(crate) struct Lines<'a> {
    rest: &'a [u8],
    number: u32,
    done: bool,
}

/// One logical line.
pub(crate) struct Line<'a> {
    /// Of its first physical line, from 1.
    pub(crate) number: u32,
    /// Without the line end.
    pub(crate) bytes: Cow<'a, [u8]>,
}

impl<'a> Lines<'a> {
    pub(crate) fn new(text: &'a [u8]) -> Self {
        let rest = text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text);
        Self { rest, number: 0, done: rest.is_empty() }
    }

    /// The next physical line without `\n` or `\r\n`.
    fn physical(&mut self) -> Option<&'a [u8]> {
        if self.done {
            return None;
        }
        let line = match memchr::memchr(b'\n', self.rest) {
            Some(end) => {
                let line = &self.rest[..end];
                self.rest = &self.rest[end + 1..];
                line
            }
            None => std::mem::take(&mut self.rest),
        };
        self.done = self.rest.is_empty();
        self.number = self.number.saturating_add(1);
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    fn next(&mut self) -> Option<Line<'a>> {
        let first = self.physical()?;
        let number = self.number;
        let Some(mut head) = first.strip_suffix(b"\\") else {
            return Some(Line { number, bytes: Cow::Borrowed(first) });
        };
        let mut joined = Vec::new();
        loop {
            joined.extend_from_slice(head);
            joined.push(b' ');
            let Some(next) = self.physical() else { break };
            match next.strip_suffix(b"\\") {
                Some(more) => head = more,
                None => {
                    joined.extend_from_slice(next);
                    break;
                }
            }
        }
        Some(Line { number, bytes: Cow::Owned(joined) })
    }
}

/// The words of a line, up to a comment.
pub(crate) struct Words<'l> {
    file: &'l Arc<str>,
    number: u32,
    line: &'l [u8],
    /// Where the next word is looked for.
    position: usize,
    /// Where the last word began.
    start: usize,
}

impl<'l> Words<'l> {
    pub(crate) fn new(file: &'l Arc<str>, line: &'l Line<'_>) -> Self {
        Self { file, number: line.number, line: &line.bytes, position: 0, start: 0 }
    }

    /// The next word; `None` at the end of the line or at a comment.
    pub(crate) fn word(&mut self) -> Option<&'l [u8]> {
        let rest = &self.line[self.position..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
        self.start = self.position + start;
        let rest = &rest[start..];
        if rest.first().is_none_or(|&b| b == b'#') {
            self.position = self.start;
            return None;
        }
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.position = self.start + end;
        Some(&rest[..end])
    }

    /// Looks at the next word without taking it.
    pub(crate) fn peek(&mut self) -> Option<&'l [u8]> {
        let (position, start) = (self.position, self.start);
        let word = self.word();
        (self.position, self.start) = (position, start);
        word
    }

    /// All that is left, trimmed, without surrounding quotes: names with spaces. `#` is part of a name unless it
    /// follows a space.
    pub(crate) fn rest(&mut self) -> String {
        let rest = &self.line[self.position..];
        let comment = rest.windows(2).position(|w| w[0].is_ascii_whitespace() && w[1] == b'#');
        let text = rest[..comment.unwrap_or(rest.len())].trim_ascii();
        self.start = self.position + (rest.len() - rest.trim_ascii_start().len());
        self.position = self.line.len();
        let bare = text.strip_prefix(b"\"").and_then(|t| t.strip_suffix(b"\"")).unwrap_or(text);
        String::from_utf8_lossy(bare).into_owned()
    }

    /// A number if the next word is one; otherwise nothing is taken.
    pub(crate) fn float_if_any(&mut self) -> Option<f32> {
        let value = parse_f32(self.peek()?)?;
        self.word();
        Some(value)
    }

    /// The number that must follow; `what` names it.
    pub(crate) fn float(&mut self, what: &str) -> Result<f32, LoadError> {
        match self.word() {
            Some(word) => parse_f32(word).ok_or_else(|| {
                let shown = String::from_utf8_lossy(word).into_owned();
                self.error(
                    format!("{what} is `{shown}`, which is not a number"),
                    "write a number such as 1.5",
                )
            }),
            None => Err(self.error(format!("{what} is missing"), "write a number")),
        }
    }

    /// Of the line, from 1.
    pub(crate) fn line_number(&self) -> u32 {
        self.number
    }

    /// The place of the last word taken.
    pub(crate) fn place(&self) -> Place {
        Place::text(self.file, self.number, u32::try_from(self.start + 1).unwrap_or(u32::MAX))
    }

    /// An error at the last word taken.
    pub(crate) fn error(&self, problem: impl Into<String>, hint: impl Into<String>) -> LoadError {
        let length = self.position.saturating_sub(self.start);
        LoadError::input(self.place(), problem, hint)
            .with_snippet(Snippet::new(self.line, self.start, length))
    }
}

/// Parses a decimal number; infinities and NaN are numbers here, as some exporters write them.
pub(crate) fn parse_f32(word: &[u8]) -> Option<f32> {
    std::str::from_utf8(word).ok()?.parse().ok()
}
