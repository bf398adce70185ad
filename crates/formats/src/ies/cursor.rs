//! Numbers in running text, separated by spaces, commas and line ends, that know where they stand.

use std::sync::Arc;

use crate::error::LoadError;
use crate::place::{Place, Snippet};
use crate::text::parse_f32;

/// A cursor over the numbers of a text.
pub(super) struct Numbers<'a> {
    file: &'a Arc<str>,
    text: &'a [u8],
    position: usize,
}

impl<'a> Numbers<'a> {
    /// From a position of the text on.
    pub(super) fn new(file: &'a Arc<str>, text: &'a [u8], position: usize) -> Self {
        Self { file, text, position }
    }

    /// The next word; comments from `#` to the end of the line are passed over.
    fn word(&mut self) -> Option<(usize, &'a [u8])> {
        loop {
            let rest = &self.text[self.position..];
            let blank = |b: &u8| b.is_ascii_whitespace() || *b == b',' || *b == 0x1A;
            let start = self.position + rest.iter().position(|b| !blank(b))?;
            let rest = &self.text[start..];
            if rest[0] == b'#' {
                self.position = start + memchr::memchr(b'\n', rest).unwrap_or(rest.len());
                continue;
            }
            let length = rest.iter().position(blank).unwrap_or(rest.len());
            self.position = start + length;
            return Some((start, &rest[..length]));
        }
    }

    /// The finite number that must follow; `what` names it.
    pub(super) fn float(&mut self, what: &str) -> Result<f32, LoadError> {
        let Some((start, word)) = self.word() else {
            let hint = "the file may be truncated";
            return Err(LoadError::input(Place::whole(self.file), format!("{what} is missing"), hint));
        };
        parse_f32(word).filter(|number| number.is_finite()).ok_or_else(|| {
            let shown = String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned();
            self.error_at(start, word.len(), format!("{what} is `{shown}`, which is not a finite number"))
        })
    }

    /// A whole number from `low` to `high`.
    pub(super) fn whole(&mut self, what: &str, low: u32, high: u32) -> Result<usize, LoadError> {
        let number = self.float(what)?;
        let whole = number.fract() == 0.0 && (low as f32..=high as f32).contains(&number);
        if whole {
            return Ok(number as usize);
        }
        let problem = format!("{what} is {number}; it must be a whole number from {low} to {high}");
        Err(self.error_at(self.position.saturating_sub(1), 1, problem))
    }

    /// As many numbers as asked for.
    pub(super) fn floats(&mut self, count: usize, what: &str) -> Result<Vec<f32>, LoadError> {
        // Never more room than the text could fill: each takes two bytes.
        let mut numbers = Vec::with_capacity(count.min(self.text.len() / 2));
        for _ in 0..count {
            numbers.push(self.float(what)?);
        }
        Ok(numbers)
    }

    /// An error at the last number taken.
    pub(super) fn error(&self, problem: String) -> LoadError {
        self.error_at(self.position.saturating_sub(1), 1, problem)
    }

    fn error_at(&self, at: usize, length: usize, problem: String) -> LoadError {
        let before = &self.text[..at.min(self.text.len())];
        let start = memchr::memrchr(b'\n', before).map_or(0, |end| end + 1);
        let line = memchr::memchr_iter(b'\n', before).count() + 1;
        let rest = &self.text[start..];
        let shown = &rest[..memchr::memchr(b'\n', rest).unwrap_or(rest.len())];
        let number = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        let place = Place::text(self.file, number(line), number(at - start + 1));
        LoadError::input(place, problem, "correct the file").with_snippet(Snippet::new(
            shown,
            at - start,
            length,
        ))
    }
}
