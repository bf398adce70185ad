//! Candela tables as Radiance's data files have them.

use std::sync::Arc;

use heliostat_scene::{Photometry, Profile};

use super::Luminaire;
use super::angles::Table;
use super::cursor::Numbers;
use crate::context::Context;
use crate::error::LoadError;
use crate::place::Place;

/// Radiance's lumens per watt.
const LUMENS_PER_WATT: f32 = 179.0;

pub(super) fn read(context: &mut Context<'_>, file: &Arc<str>, text: &[u8]) -> Result<Luminaire, LoadError> {
    let mut numbers = Numbers::new(file, text, 0);
    let dimensions = numbers.whole("the number of dimensions", 1, 2)?;
    let horizontal = if dimensions == 2 { axis(context, file, &mut numbers)? } else { vec![0.0] };
    let vertical = axis(context, file, &mut numbers)?;
    let entries = horizontal.len().saturating_mul(vertical.len());
    if entries > Profile::MAX_ENTRIES {
        let (entries, limit) = (entries, Profile::MAX_ENTRIES);
        let problem = format!("{entries} values; the limit is {limit}");
        return Err(LoadError::limit_text(Place::whole(file), problem, "thin the table out"));
    }
    context.charge_array(entries.saturating_mul(4), 2 * size_of::<f32>(), &Place::whole(file))?;
    let mut candela = Vec::with_capacity(horizontal.len());
    for _ in &horizontal {
        let mut column = numbers.floats(vertical.len(), "a value")?;
        column.iter_mut().for_each(|value| *value *= LUMENS_PER_WATT);
        candela.push(column);
    }
    let negative = horizontal.iter().chain(&vertical).any(|&angle| angle < 0.0);
    let photometry = if negative { Photometry::B } else { Photometry::C };
    let table = Table { photometry, vertical, horizontal, candela };
    let profile = table.profile().map_err(|problem| numbers.error(problem))?;
    Ok(Luminaire { name: crate::stem(file).to_owned(), profile })
}

/// The angles of one dimension: first, last and number of even steps, or 0, 0 and the number of angles that follow.
fn axis(
    context: &mut Context<'_>,
    file: &Arc<str>,
    numbers: &mut Numbers<'_>,
) -> Result<Vec<f32>, LoadError> {
    let (first, last) = (numbers.float("the first angle")?, numbers.float("the last angle")?);
    let count = numbers.whole("the number of angles", 1, 1 << 16)?;
    context.charge_array(count, size_of::<f32>(), &Place::whole(file))?;
    if first == 0.0 && last == 0.0 {
        return numbers.floats(count, "an angle");
    }
    let step = (last - first) / (count.max(2) - 1) as f32;
    Ok((0..count).map(|i| first + step * i as f32).collect())
}
