//! The numbers of a PLY body one after another, whatever they are written in.

use std::sync::Arc;

use super::header::Type;
use crate::error::LoadError;
use crate::place::{Place, Snippet};
use crate::text::parse_f32;

/// A stream of numbers.
pub(super) trait Values {
    /// The next number.
    fn float(&mut self, kind: Type) -> Result<f32, LoadError>;

    /// The next number, which must be an integer.
    fn integer(&mut self, kind: Type) -> Result<i64, LoadError>;

    /// An error about the last number read.
    fn error(&self, problem: String, hint: &str) -> LoadError;

    /// Bytes not yet read.
    fn bytes_left(&self) -> usize;
}

/// Numbers in text, separated by white space; lines do not matter, except in messages.
pub(super) struct Ascii<'a> {
    file: &'a Arc<str>,
    text: &'a [u8],
    position: usize,
    /// Of the last number read.
    start: usize,
    line_start: usize,
    line: u32,
}

impl<'a> Ascii<'a> {
    /// `lines` is the number of lines before `position`.
    pub(super) fn new(file: &'a Arc<str>, text: &'a [u8], position: usize, lines: u32) -> Self {
        Self { file, text, position, start: position, line_start: position, line: lines.saturating_add(1) }
    }

    fn word(&mut self) -> Result<&'a [u8], LoadError> {
        while let Some(byte) = self.text.get(self.position).filter(|b| b.is_ascii_whitespace()) {
            self.position += 1;
            if *byte == b'\n' {
                self.line = self.line.saturating_add(1);
                self.line_start = self.position;
            }
        }
        self.start = self.position;
        let rest = &self.text[self.start..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        if length == 0 {
            return Err(
                self.error("the file ends here, before all its elements".into(), "it may be truncated")
            );
        }
        self.position += length;
        Ok(&rest[..length])
    }

    fn not_a(&self, what: &str, word: &[u8]) -> LoadError {
        self.error(
            format!("`{}` is not {what}", String::from_utf8_lossy(&word[..word.len().min(40)])),
            "correct it",
        )
    }
}

impl Values for Ascii<'_> {
    fn float(&mut self, _: Type) -> Result<f32, LoadError> {
        let word = self.word()?;
        parse_f32(word).ok_or_else(|| self.not_a("a number", word))
    }

    fn integer(&mut self, _: Type) -> Result<i64, LoadError> {
        let word = self.word()?;
        if word.len() <= 18 && word.iter().all(u8::is_ascii_digit) {
            return Ok(word.iter().fold(0, |value, digit| value * 10 + i64::from(digit - b'0')));
        }
        let value = std::str::from_utf8(word).ok().and_then(|w| w.parse::<f64>().ok());
        match value {
            // Some exporters write `3.0`. Beyond 2^53 doubles are no longer exact, nor are such indices possible.
            Some(v) if v.fract() == 0.0 && v.abs() < 9e15 => Ok(v as i64),
            _ => Err(self.not_a("an integer", word)),
        }
    }

    fn error(&self, problem: String, hint: &str) -> LoadError {
        let column = u32::try_from(self.start - self.line_start + 1).unwrap_or(u32::MAX);
        let rest = &self.text[self.line_start..];
        let line = &rest[..memchr::memchr(b'\n', rest).unwrap_or(rest.len())];
        let length = self.position.saturating_sub(self.start);
        LoadError::input(Place::text(self.file, self.line, column), problem, hint).with_snippet(Snippet::new(
            line,
            self.start - self.line_start,
            length,
        ))
    }

    fn bytes_left(&self) -> usize {
        self.text.len() - self.position
    }
}

/// Numbers in binary, big endian or little endian.
pub(super) struct Binary<'a, const BIG: bool> {
    file: &'a Arc<str>,
    bytes: &'a [u8],
    position: usize,
    /// Of the last number read.
    start: usize,
}

impl<'a, const BIG: bool> Binary<'a, BIG> {
    pub(super) fn new(file: &'a Arc<str>, bytes: &'a [u8], position: usize) -> Self {
        Self { file, bytes, position, start: position }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], LoadError> {
        self.start = self.position;
        let Some(&bytes) = self.bytes[self.position..].first_chunk::<N>() else {
            return Err(
                self.error("the file ends here, before all its elements".into(), "it may be truncated")
            );
        };
        self.position += N;
        Ok(bytes)
    }
}

macro_rules! read {
    ($self:expr, $type:ty) => {{
        let bytes = $self.take()?;
        if BIG { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) }
    }};
}

impl<const BIG: bool> Values for Binary<'_, BIG> {
    fn float(&mut self, kind: Type) -> Result<f32, LoadError> {
        Ok(match kind {
            Type::F32 => read!(self, f32),
            Type::F64 => read!(self, f64) as f32,
            _ => self.integer(kind)? as f32,
        })
    }

    fn integer(&mut self, kind: Type) -> Result<i64, LoadError> {
        Ok(match kind {
            Type::I8 => read!(self, i8).into(),
            Type::U8 => read!(self, u8).into(),
            Type::I16 => read!(self, i16).into(),
            Type::U16 => read!(self, u16).into(),
            Type::I32 => read!(self, i32).into(),
            Type::U32 => read!(self, u32).into(),
            Type::F32 | Type::F64 => {
                let value = if kind == Type::F32 { f64::from(read!(self, f32)) } else { read!(self, f64) };
                if value.fract() != 0.0 || value.abs() >= 9e15 {
                    return Err(self.error(format!("{value} is not an integer"), "correct it"));
                }
                value as i64
            }
        })
    }

    fn error(&self, problem: String, hint: &str) -> LoadError {
        LoadError::input(Place::byte(self.file, self.start), problem, hint)
    }

    fn bytes_left(&self) -> usize {
        self.bytes.len() - self.position
    }
}
