//! Words of shader scripts: texts and braces, with the line ends that close statements.

/// A word of a script.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Word<'a> {
    Open,
    Close,
    Text(&'a str),
}

/// A keyword and what stands behind it on its line.
#[derive(Debug)]
pub(super) struct Statement<'a> {
    /// In lower case.
    pub(super) keyword: String,
    pub(super) words: Vec<&'a str>,
}

impl Statement<'_> {
    /// A finite number.
    pub(super) fn number(&self, index: usize) -> Option<f32> {
        self.words.get(index)?.parse().ok().filter(|value: &f32| value.is_finite())
    }

    /// A word in lower case.
    pub(super) fn lower(&self, index: usize) -> Option<String> {
        Some(self.words.get(index)?.to_ascii_lowercase())
    }
}

/// Most words that a statement keeps; none has more that matter.
const MOST_WORDS: usize = 32;

/// Cuts a script into words. Comments, parentheses and commas are spaces.
pub(super) struct Words<'a> {
    text: &'a str,
    at: usize,
    line: u32,
}

impl<'a> Words<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self { text: text.strip_prefix('\u{FEFF}').unwrap_or(text), at: 0, line: 1 }
    }

    /// Of the last word, counted from 1.
    pub(super) fn line(&self) -> u32 {
        self.line
    }

    /// Passes over space and comments, line ends only if `lines`.
    fn skip(&mut self, lines: bool) {
        let bytes = self.text.as_bytes();
        loop {
            match &bytes[self.at..] {
                [b'\n', ..] if lines => {
                    self.line = self.line.saturating_add(1);
                    self.at += 1;
                }
                [b'\n', ..] | [] => return,
                [b'/', b'/', rest @ ..] => {
                    self.at += 2 + rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
                }
                [b'/', b'*', rest @ ..] => {
                    let length = rest.windows(2).position(|pair| pair == b"*/").map(|end| end + 2);
                    let length = length.unwrap_or(rest.len());
                    let ends = rest[..length].iter().filter(|&&b| b == b'\n').count();
                    self.line = self.line.saturating_add(ends as u32);
                    self.at += 2 + length;
                }
                [b'(' | b')' | b',', ..] => self.at += 1,
                [byte, ..] if byte.is_ascii_whitespace() || *byte == 0 => self.at += 1,
                _ => return,
            }
        }
    }

    fn take(&mut self) -> Option<Word<'a>> {
        let rest = &self.text[self.at..];
        let (word, length) = match rest.bytes().next()? {
            b'\n' => return None,
            b'{' => (Word::Open, 1),
            b'}' => (Word::Close, 1),
            b'"' => {
                let end = rest[1..].find(['"', '\n']).map_or(rest.len(), |end| end + 1);
                (Word::Text(&rest[1..end]), (end + usize::from(rest[end..].starts_with('"'))))
            }
            _ => {
                let ends = |c: char| c.is_ascii_whitespace() || "{}(),\"\0".contains(c);
                let end = rest.find(ends).unwrap_or(rest.len());
                // A comment may follow without a space.
                let end = rest[..end].find("//").filter(|&at| at > 0).unwrap_or(end);
                (Word::Text(&rest[..end]), end)
            }
        };
        self.at += length;
        Some(word)
    }

    /// The next word, on whatever line.
    pub(super) fn next(&mut self) -> Option<Word<'a>> {
        self.skip(true);
        self.take()
    }

    /// Takes the next word if it is `{`.
    pub(super) fn open(&mut self) -> bool {
        self.skip(true);
        let open = self.text[self.at..].starts_with('{');
        self.at += usize::from(open);
        open
    }

    /// The statement of a keyword that was just taken: up to the end of the line or a brace.
    pub(super) fn statement(&mut self, keyword: &str) -> Statement<'a> {
        let mut words = Vec::new();
        loop {
            self.skip(false);
            let before = self.at;
            match self.take() {
                Some(Word::Text(word)) => {
                    if words.len() < MOST_WORDS {
                        words.push(word);
                    }
                }
                Some(_) => {
                    self.at = before;
                    break;
                }
                None => break,
            }
        }
        Statement { keyword: keyword.to_ascii_lowercase(), words }
    }
}
