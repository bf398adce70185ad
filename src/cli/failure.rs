//! Why a command ended without its result, in a form that miette shows with the offending place.

use std::process::ExitCode;

use heliostat::compare::CompareError;
use heliostat::formats::{LoadError, Spot};
use heliostat::scene::{BackendError, EditError};
use miette::{
    Diagnostic, LabeledSpan, MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents,
};

/// What went wrong, what to do about it, and the text that caused it.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub(super) struct Failure {
    message: String,
    help: Option<String>,
    excerpt: Option<Box<Excerpt>>,
    usage: bool,
}

/// One line of a file with the offending part.
#[derive(Debug)]
struct Excerpt {
    file: String,
    text: String,
    /// Counted from 0.
    line: usize,
    span: SourceSpan,
}

impl Failure {
    /// The work failed.
    pub(super) fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), help: None, excerpt: None, usage: false }
    }

    /// The command line was wrong in a way that only shows later.
    pub(super) fn usage(message: impl Into<String>) -> Self {
        Self { usage: true, ..Self::new(message) }
    }

    /// Adds what to do about it.
    pub(super) fn with_help(self, help: impl Into<String>) -> Self {
        Self { help: Some(help.into()), ..self }
    }

    pub(super) fn cancelled() -> Self {
        Self::new("cancelled; no unfinished picture was written")
    }

    pub(super) fn exit_code(&self) -> ExitCode {
        if self.usage { ExitCode::from(2) } else { ExitCode::FAILURE }
    }
}

impl Diagnostic for Failure {
    fn help<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn std::fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.excerpt.as_deref().map(|excerpt| excerpt as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let excerpt = self.excerpt.as_ref()?;
        Some(Box::new(std::iter::once(LabeledSpan::new_with_span(Some("here".into()), excerpt.span))))
    }
}

impl SourceCode for Excerpt {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        lines_before: usize,
        lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let inner = self.text.read_span(span, lines_before, lines_after)?;
        Ok(Box::new(MietteSpanContents::new_named(
            self.file.clone(),
            inner.data(),
            *inner.span(),
            self.line + inner.line(),
            inner.column(),
            inner.line_count(),
        )))
    }
}

impl From<LoadError> for Failure {
    fn from(error: LoadError) -> Self {
        let excerpt = match (error.snippet(), &error.place().spot) {
            (Some(snippet), Spot::Text { line, .. }) => Some(Box::new(Excerpt {
                file: error.place().file.to_string(),
                text: snippet.text.clone(),
                line: (*line as usize).saturating_sub(1),
                span: (snippet.start, snippet.length).into(),
            })),
            _ => None,
        };
        let message = format!("{}: {}", error.place(), error.problem());
        Self { help: error.hint().map(Into::into), excerpt, ..Self::new(message) }
    }
}

impl From<BackendError> for Failure {
    fn from(error: BackendError) -> Self {
        match error {
            BackendError::Cancelled => Self::cancelled(),
            error => Self::new(error.to_string()),
        }
    }
}

impl From<EditError> for Failure {
    fn from(error: EditError) -> Self {
        Self::new(format!("the scene contradicts itself: {error}"))
    }
}

impl From<CompareError> for Failure {
    fn from(error: CompareError) -> Self {
        Self::new(error.to_string())
    }
}
