//! The text of IES LM-63 files.

use std::sync::Arc;

use heliostat_scene::{Photometry, Profile};

use super::Luminaire;
use super::angles::Table;
use super::cursor::Numbers;
use crate::context::Context;
use crate::error::LoadError;
use crate::place::Place;

/// Most angles along either side.
const MAX_ANGLES: u32 = 1 << 16;

pub(super) fn read(context: &mut Context<'_>, file: &Arc<str>, text: &[u8]) -> Result<Luminaire, LoadError> {
    let header = Header::new(text).ok_or_else(|| {
        let hint = "an IES file has a line `TILT=NONE` before its numbers";
        LoadError::input(Place::whole(file), "there is no line that starts with `TILT=`", hint)
    })?;
    let mut numbers = Numbers::new(file, text, header.numbers);
    let tilt = match header.tilt.as_str() {
        "NONE" => 1.0,
        "INCLUDE" => upright_factor(&mut numbers)?,
        name => tilt_file(context, file, name)?,
    };
    let profile = photometry(context, file, &mut numbers, tilt)?;
    let name = header.name.unwrap_or_else(|| crate::stem(file).to_owned());
    Ok(Luminaire { name, profile })
}

/// What stands before the numbers.
struct Header {
    name: Option<String>,
    /// What follows `TILT=`.
    tilt: String,
    /// Where the numbers start.
    numbers: usize,
}

impl Header {
    fn new(text: &[u8]) -> Option<Self> {
        let mut name = None;
        let mut start = 0;
        while start < text.len() {
            let end = memchr::memchr(b'\n', &text[start..]).map_or(text.len(), |length| start + length);
            let line = text[start..end].trim_ascii();
            start = end + 1;
            if let Some(tilt) = line.strip_prefix(b"TILT=") {
                let tilt = String::from_utf8_lossy(tilt.trim_ascii()).into_owned();
                let keyword = ["NONE", "INCLUDE"].into_iter().find(|word| word.eq_ignore_ascii_case(&tilt));
                let tilt = keyword.map_or(tilt, str::to_owned);
                return Some(Self { name, tilt, numbers: start.min(text.len()) });
            }
            for keyword in [&b"[LUMINAIRE]"[..], b"[LUMCAT]"] {
                let value = line.strip_prefix(keyword).map(<[u8]>::trim_ascii);
                if let (None, Some(value)) = (&name, value.filter(|value| !value.is_empty())) {
                    name = Some(String::from_utf8_lossy(&value[..value.len().min(200)]).into_owned());
                }
            }
        }
        None
    }
}

/// The factor of a table of tilts for a luminaire that stands upright.
fn upright_factor(numbers: &mut Numbers<'_>) -> Result<f32, LoadError> {
    numbers.whole("the lamp's place in the luminaire", 1, 3)?;
    let count = numbers.whole("the number of tilt angles", 1, MAX_ANGLES)?;
    let angles = numbers.floats(count, "a tilt angle")?;
    let factors = numbers.floats(count, "a tilt factor")?;
    let above = angles.partition_point(|&angle| angle <= 0.0).min(count - 1);
    let below = above.saturating_sub(1);
    let share = (0.0 - angles[below]) / (angles[above] - angles[below]);
    let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
    let factor = factors[below] + (factors[above] - factors[below]) * share;
    if factor >= 0.0 { Ok(factor) } else { Err(numbers.error(format!("the tilt factor is {factor}"))) }
}

/// The factor from a file of its own; 1 after a warning if it cannot be read.
fn tilt_file(context: &mut Context<'_>, file: &Arc<str>, name: &str) -> Result<f32, LoadError> {
    let name = name.replace('\\', "/");
    match context.read(&name) {
        Ok(bytes) => {
            let tilts: Arc<str> = name.as_str().into();
            upright_factor(&mut Numbers::new(&tilts, &bytes, 0))
        }
        Err(error) => {
            let message = format!("the file of tilt factors `{name}`: {error}; the factor 1 was taken");
            context.warn(Place::whole(file), message, "put it beside the IES file");
            Ok(1.0)
        }
    }
}

fn photometry(
    context: &mut Context<'_>,
    file: &Arc<str>,
    numbers: &mut Numbers<'_>,
    tilt: f32,
) -> Result<Profile, LoadError> {
    numbers.float("the number of lamps")?;
    numbers.float("lumens per lamp")?;
    let multiplier = numbers.float("the multiplier")?;
    let vertical = numbers.whole("the number of vertical angles", 1, MAX_ANGLES)?;
    let horizontal = numbers.whole("the number of horizontal angles", 1, MAX_ANGLES)?;
    let photometry = match numbers.whole("the photometric type", 1, 3)? {
        1 => Photometry::C,
        2 => Photometry::B,
        _ => Photometry::A,
    };
    for what in ["the type of units", "the width", "the length", "the height"] {
        numbers.float(what)?;
    }
    let ballast = numbers.float("the ballast factor")?;
    // Kept free for future use since 2002, and then 1.
    let ballast_lamp = numbers.float("the ballast-lamp photometric factor")?;
    numbers.float("the input watts")?;
    let factor = multiplier * ballast * ballast_lamp * tilt;
    if !(factor.is_finite() && factor >= 0.0) {
        return Err(
            numbers.error(format!("the factors of the candela make {factor}; they must not be negative"))
        );
    }
    // Mirrored at most twice.
    let entries = vertical.saturating_mul(horizontal).saturating_mul(4);
    if entries / 4 > Profile::MAX_ENTRIES {
        let (entries, limit) = (entries / 4, Profile::MAX_ENTRIES);
        let problem = format!("{entries} candela values; the limit is {limit}");
        return Err(LoadError::limit_text(Place::whole(file), problem, "thin the table out"));
    }
    context.charge_array(entries, 2 * size_of::<f32>(), &Place::whole(file))?;
    let vertical = numbers.floats(vertical, "a vertical angle")?;
    let horizontal = numbers.floats(horizontal, "a horizontal angle")?;
    let mut candela = Vec::with_capacity(horizontal.len());
    for _ in &horizontal {
        let mut column = numbers.floats(vertical.len(), "a candela value")?;
        column.iter_mut().for_each(|value| *value *= factor);
        candela.push(column);
    }
    let table = Table { photometry, vertical, horizontal, candela };
    table.profile().map_err(|problem| numbers.error(problem))
}
