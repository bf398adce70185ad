//! Why a file could not be loaded: who is at fault, where, and what to do.

use std::io;

use crate::place::{Place, Snippet};

/// Why a file could not be loaded. `Display` gives place, problem and hint in one line; the accessors give the
/// parts, for programs that show the offending text.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The file contradicts its format.
    #[error("{0}")]
    Input(Box<Details>),
    /// The file is larger or deeper than the [`Limits`](crate::Limits) allow.
    #[error("{0}")]
    Limit(Box<Details>),
    /// The file is in order but uses something this crate does not read.
    #[error("{0}")]
    Unsupported(Box<Details>),
    /// The operating system could not deliver the file.
    #[error("{place}: cannot be read: {source}")]
    Io {
        /// Which file.
        place: Box<Place>,
        /// The system's reason.
        source: io::Error,
    },
}

/// What a [`LoadError`] has to say.
#[derive(Clone, Debug, PartialEq)]
pub struct Details {
    /// Where.
    pub place: Place,
    /// What is wrong, with the value.
    pub problem: String,
    /// What to do about it; may be empty.
    pub hint: String,
    /// The offending line, when the place is in a text.
    pub snippet: Option<Snippet>,
}

impl std::fmt::Display for Details {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.place, self.problem)?;
        if self.hint.is_empty() { Ok(()) } else { write!(f, "; {}", self.hint) }
    }
}

impl LoadError {
    pub(crate) fn input(place: Place, problem: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Input(Details::boxed(place, problem.into(), hint.into()))
    }

    pub(crate) fn unsupported(place: Place, problem: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Unsupported(Details::boxed(place, problem.into(), hint.into()))
    }

    /// `value` of `what` exceeds `Limits::{field}`, which is `limit`.
    pub(crate) fn limit(place: Place, what: &str, value: u64, field: &str, limit: u64) -> Self {
        let problem = format!("{value} {what}, the limit is {limit}");
        Self::limit_text(
            place,
            problem,
            format!("this is `Limits::{field}` of the importer; a program that trusts the file may raise it"),
        )
    }

    pub(crate) fn limit_text(place: Place, problem: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Limit(Details::boxed(place, problem.into(), hint.into()))
    }

    /// Adds the text around the place.
    pub(crate) fn with_snippet(mut self, snippet: Snippet) -> Self {
        if let Self::Input(details) | Self::Limit(details) | Self::Unsupported(details) = &mut self {
            details.snippet = Some(snippet);
        }
        self
    }

    fn details(&self) -> Option<&Details> {
        match self {
            Self::Input(details) | Self::Limit(details) | Self::Unsupported(details) => Some(details),
            Self::Io { .. } => None,
        }
    }

    /// Where.
    pub fn place(&self) -> &Place {
        match self {
            Self::Input(details) | Self::Limit(details) | Self::Unsupported(details) => &details.place,
            Self::Io { place, .. } => place,
        }
    }

    /// What is wrong, without the place and the hint.
    pub fn problem(&self) -> String {
        match self {
            Self::Io { source, .. } => format!("cannot be read: {source}"),
            _ => self.details().map(|details| details.problem.clone()).unwrap_or_default(),
        }
    }

    /// What to do about it, when there is something to say.
    pub fn hint(&self) -> Option<&str> {
        self.details().map(|details| details.hint.as_str()).filter(|hint| !hint.is_empty())
    }

    /// The offending line, when the place is in a text.
    pub fn snippet(&self) -> Option<&Snippet> {
        self.details()?.snippet.as_ref()
    }
}

impl Details {
    fn boxed(place: Place, problem: String, hint: String) -> Box<Self> {
        Box::new(Self { place, problem, hint, snippet: None })
    }
}
