//! The text part of a BSP file: entities as lists of keys and values.

use std::sync::Arc;

use glam::Vec3;

use crate::context::Context;
use crate::error::LoadError;
use crate::place::Place;

/// A thing in the map: a light, a door, a place where players appear.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Entity {
    /// In the order of the file. Keys are lower case.
    pairs: Vec<(String, String)>,
}

impl Entity {
    /// The value of a key; the last one, if it is there more than once.
    pub(super) fn get(&self, key: &str) -> Option<&str> {
        self.pairs.iter().rev().find(|(known, _)| known == key).map(|(_, value)| value.as_str())
    }

    /// Its kind; empty if it has none.
    pub(super) fn class(&self) -> &str {
        self.get("classname").unwrap_or("")
    }

    /// A finite number.
    pub(super) fn number(&self, key: &str) -> Option<f32> {
        first_number(self.get(key)?)
    }

    /// Three finite numbers.
    pub(super) fn vector(&self, key: &str) -> Option<Vec3> {
        let mut numbers = self.get(key)?.split_ascii_whitespace().map(first_number);
        Some(Vec3::new(numbers.next()??, numbers.next()??, numbers.next()??))
    }
}

/// The number that a text begins with, as the game reads them.
fn first_number(text: &str) -> Option<f32> {
    text.split_ascii_whitespace().next()?.parse().ok().filter(|value: &f32| value.is_finite())
}

/// Reads the lump of entities: `{ "key" "value" … } { … }`.
///
/// # Errors
/// When braces or quotes do not match, or there are more entities than the limits allow.
pub(super) fn parse(
    context: &mut Context<'_>,
    file: &Arc<str>,
    lump: &[u8],
) -> Result<Vec<Entity>, LoadError> {
    let end = lump.iter().position(|&b| b == 0).unwrap_or(lump.len());
    let text = String::from_utf8_lossy(&lump[..end]);
    let place = Place::whole(file);
    context.charge(4 * text.len() as u64, &place)?;
    let broken = |line: usize, problem: &str| {
        let problem = format!("the entities are broken in their line {line}: {problem}");
        LoadError::input(place.clone(), problem, "the file may be damaged")
    };
    let mut entities = Vec::new();
    let mut open: Option<Entity> = None;
    let mut key: Option<String> = None;
    let mut tokens = Tokens { rest: &text, line: 1 };
    while let Some(token) = tokens.next().map_err(|problem| broken(tokens.line, problem))? {
        match (token, &mut open) {
            (Token::Open, None) => open = Some(Entity::default()),
            (Token::Open, Some(_)) => return Err(broken(tokens.line, "`{` within an entity")),
            (Token::Close, _) => {
                if key.is_some() {
                    return Err(broken(tokens.line, "a key without a value"));
                }
                let entity = open.take().ok_or_else(|| broken(tokens.line, "`}` outside of an entity"))?;
                context.charge(size_of::<Entity>() as u64, &place)?;
                entities.push(entity);
            }
            (Token::Text(_), None) => return Err(broken(tokens.line, "text outside of an entity")),
            (Token::Text(text), Some(entity)) => match key.take() {
                None => key = Some(text.to_ascii_lowercase()),
                Some(key) => {
                    context.charge(2 * size_of::<String>() as u64, &place)?;
                    entity.pairs.push((key, text.to_owned()));
                }
            },
        }
    }
    if open.is_some() {
        return Err(broken(tokens.line, "the last entity has no `}`"));
    }
    Ok(entities)
}

enum Token<'a> {
    Open,
    Close,
    Text(&'a str),
}

struct Tokens<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> Tokens<'a> {
    fn next(&mut self) -> Result<Option<Token<'a>>, &'static str> {
        let trimmed = self.rest.trim_ascii_start();
        self.line += self.rest[..self.rest.len() - trimmed.len()].matches('\n').count();
        self.rest = trimmed;
        let Some(first) = trimmed.chars().next() else { return Ok(None) };
        let (token, length) = match first {
            '{' => (Token::Open, 1),
            '}' => (Token::Close, 1),
            '"' => {
                let end = trimmed[1..].find('"').ok_or("a quote without its end")?;
                (Token::Text(&trimmed[1..=end]), end + 2)
            }
            _ => {
                let end = trimmed.find(|c: char| c.is_ascii_whitespace() || "{}\"".contains(c));
                let end = end.unwrap_or(trimmed.len());
                (Token::Text(&trimmed[..end]), end)
            }
        };
        self.line += trimmed[..length].matches('\n').count();
        self.rest = &trimmed[length..];
        Ok(Some(token))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::Limits;
    use crate::source::NoFiles;

    fn read(text: &str) -> Result<Vec<Entity>, String> {
        let limits = Limits::default();
        parse(&mut Context::new(&limits, &NoFiles), &"a.bsp".into(), text.as_bytes())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn keys_and_values() {
        let text =
            "{\n\"classname\" \"light\" \"Origin\" \"1 -2.5 3e1\"\n}{ light 300x\n \"_color\" \"1 1\" }\0{";
        let entities = read(text).unwrap();
        assert_eq!(entities.len(), 2);
        assert_eq!(entities[0].class(), "light");
        assert_eq!(entities[0].vector("origin"), Some(Vec3::new(1.0, -2.5, 30.0)));
        assert_eq!(entities[0].number("light"), None);
        assert_eq!((entities[1].number("light"), entities[1].vector("_color")), (None, None));
    }

    #[test]
    fn what_does_not_match_is_an_error() {
        for (text, problem) in [
            ("{ \"a\" \"b\"", "no `}`"),
            ("}", "`}` outside"),
            ("\n\na", "line 3: text outside"),
            ("{ {", "`{` within"),
            ("{ a }", "a key without a value"),
            ("{ \"a", "a quote without its end"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(problem), "{text}: {error}");
        }
    }
}
