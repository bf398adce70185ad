//! Words of a text in which line ends are spaces and comments begin with `#` or `%`.

use std::sync::Arc;

use glam::Vec3;

use crate::error::LoadError;
use crate::place::{Place, Snippet};
use crate::text::parse_f32;

/// A cursor over the words of a file that knows where it is.
pub(crate) struct Tokens<'a> {
    file: &'a Arc<str>,
    text: &'a [u8],
    /// Where the next word is looked for.
    position: usize,
    /// Where the last word began, and the line it is in: number from 1 and start.
    start: usize,
    line: u32,
    line_start: usize,
}

impl<'a> Tokens<'a> {
    pub(crate) fn new(file: &'a Arc<str>, text: &'a [u8]) -> Self {
        let position = if text.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
        Self { file, text, position, start: position, line: 1, line_start: 0 }
    }

    /// Moves to the next word, past spaces and comments.
    fn skip(&mut self) {
        while let Some(&byte) = self.text.get(self.position) {
            match byte {
                b'\n' => {
                    self.line = self.line.saturating_add(1);
                    self.line_start = self.position + 1;
                }
                b'#' | b'%' => {
                    self.skip_line();
                    continue;
                }
                // Some editors of the time ended files with a control character.
                0x1A => {}
                byte if !byte.is_ascii_whitespace() => return,
                _ => {}
            }
            self.position += 1;
        }
    }

    /// Moves to the end of the line.
    pub(crate) fn skip_line(&mut self) {
        let rest = &self.text[self.position..];
        self.position += memchr::memchr(b'\n', rest).unwrap_or(rest.len());
    }

    /// The next word, which braces are on their own; `None` at the end.
    pub(crate) fn word(&mut self) -> Option<&'a [u8]> {
        self.skip();
        self.start = self.position;
        let rest = &self.text[self.position..];
        let ends = |b: &u8| b.is_ascii_whitespace() || matches!(b, b'{' | b'}' | b'#' | b'%');
        let length = match rest.first()? {
            b'{' | b'}' => 1,
            _ => rest.iter().position(ends).unwrap_or(rest.len()),
        };
        self.position += length;
        Some(&rest[..length])
    }

    /// Looks at the next word without taking it.
    pub(crate) fn peek(&mut self) -> Option<&'a [u8]> {
        // Spaces and comments are behind for good.
        self.skip();
        let start = self.start;
        let word = self.word();
        self.position = self.position.min(self.start);
        self.start = start;
        word
    }

    /// Takes the next word if it is this one.
    pub(crate) fn take(&mut self, wanted: &[u8]) -> bool {
        let is = self.peek() == Some(wanted);
        if is {
            self.word();
        }
        is
    }

    /// The word that must follow; `what` names it.
    pub(crate) fn name(&mut self, what: &str) -> Result<String, LoadError> {
        match self.word() {
            Some(word) => Ok(String::from_utf8_lossy(word).into_owned()),
            None => Err(self.error(format!("{what} is missing: the file ends"), "it may be truncated")),
        }
    }

    /// The number that must follow; `what` names it.
    pub(crate) fn float(&mut self, what: &str) -> Result<f32, LoadError> {
        let word = self.word();
        let Some(word) = word else {
            return Err(self.error(format!("{what} is missing: the file ends"), "it may be truncated"));
        };
        parse_f32(word).ok_or_else(|| {
            let shown = String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned();
            self.error(format!("{what} is `{shown}`, which is not a number"), "write a number such as 1.5")
        })
    }

    /// Whether the next word is a number.
    pub(crate) fn number_follows(&mut self) -> bool {
        self.peek().is_some_and(|word| parse_f32(word).is_some())
    }

    /// Three numbers.
    pub(crate) fn vector(&mut self, what: &str) -> Result<Vec3, LoadError> {
        Ok(Vec3::new(self.float(what)?, self.float(what)?, self.float(what)?))
    }

    /// Three colour channels; what is negative or not finite is an error.
    pub(crate) fn color(&mut self, what: &str) -> Result<Vec3, LoadError> {
        let color = self.vector(what)?;
        if color.is_finite() && color.min_element() >= 0.0 {
            return Ok(color);
        }
        Err(self.error(format!("{what} is {color}"), "give finite values of at least 0"))
    }

    /// A whole number of at least `least`.
    pub(crate) fn count(&mut self, what: &str, least: u32) -> Result<u32, LoadError> {
        let value = self.integer(what)?;
        u32::try_from(value).ok().filter(|&n| n >= least).ok_or_else(|| {
            self.error(format!("{what} is {value}"), format!("give a whole number of at least {least}"))
        })
    }

    /// A whole number.
    pub(crate) fn integer(&mut self, what: &str) -> Result<i64, LoadError> {
        let word = self.name(what)?;
        word.parse().map_err(|_| {
            let shown: String = word.chars().take(40).collect();
            self.error(format!("{what} is `{shown}`, which is not a whole number"), "write for example 4")
        })
    }

    /// The place of the last word taken.
    pub(crate) fn place(&self) -> Place {
        let column = self.start.saturating_sub(self.line_start) + 1;
        Place::text(self.file, self.line, u32::try_from(column).unwrap_or(u32::MAX))
    }

    /// An error at the last word taken.
    pub(crate) fn error(&self, problem: impl Into<String>, hint: impl Into<String>) -> LoadError {
        let rest = &self.text[self.line_start.min(self.text.len())..];
        let line = &rest[..memchr::memchr(b'\n', rest).unwrap_or(rest.len())];
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        let start = self.start.saturating_sub(self.line_start);
        let snippet = Snippet::new(line, start, self.position.saturating_sub(self.start));
        LoadError::input(self.place(), problem, hint).with_snippet(snippet)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_know_their_place() {
        let file: Arc<str> = "a".into();
        let mut tokens = Tokens::new(&file, b"% note\n l 1\t2 # two\r\n{x}\nyy");
        assert!(tokens.take(b"l"));
        assert_eq!(tokens.float("x").unwrap(), 1.0);
        assert_eq!(tokens.peek(), Some(&b"2"[..]));
        assert!(tokens.number_follows());
        assert_eq!(tokens.float("y").unwrap(), 2.0);
        assert!(!tokens.number_follows());
        assert!(!tokens.take(b"x"));
        assert_eq!([tokens.word(), tokens.word(), tokens.word()], [&b"{"[..], b"x", b"}"].map(Some));
        let error = tokens.float("the radius").unwrap_err();
        assert_eq!(
            error.to_string(),
            "a:4:1: the radius is `yy`, which is not a number; write a number such as 1.5"
        );
        assert_eq!(error.snippet().unwrap().text, "yy");
        assert!(tokens.float("x").unwrap_err().to_string().contains("the file ends"));
    }
}
