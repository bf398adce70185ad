//! Measured lights: IES photometric files and the candela tables of Radiance.
//!
//! [`read`] gives the intensity over direction of a luminaire; other formats name such files for their lights. Loaded as a
//! scene, a file shows its light on the floor and walls of a room.
//!
//! Of LM-63 all versions are read (1986, 1991, 1995, 2002, 2019), and types A, B and C with all their symmetries. Candela are
//! multiplied by the file's multiplier, ballast factor and ballast–lamp factor, and by the TILT factor of an upright
//! luminaire. What describes the housing (luminous opening, watts) makes no difference to a light without size.
//!
//! A `.dat` file of Radiance (`brightdata`, as `ies2rad` writes it) holds W/sr at 179 lm/W over horizontal and vertical angles;
//! a table with negative angles is taken for type B, another one for type C. Its multiplier stands in the `.rad` file and is
//! not known here.
//!
//! # References
//! ANSI/IESNA LM-63-2002, "Standard File Format for the Electronic Transfer of Photometric Data". Ward, "The RADIANCE Lighting
//! Simulation and Rendering System", 1994; its file format of data files.

mod angles;
mod cursor;
mod lm63;
mod room;
mod table;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use heliostat_scene::{Edit, Profile};

use crate::context::Context;
use crate::error::LoadError;
use crate::limits::Limits;
use crate::place::Place;
use crate::source::FileSource;

/// A measured light.
#[derive(Clone, Debug, PartialEq)]
pub struct Luminaire {
    /// From the file's keywords, else its name.
    pub name: String,
    /// Candela over direction, all factors included.
    pub profile: Profile,
}

/// Reads a photometric file; `name` serves to tell the kind (`.dat` is a table of Radiance) and in messages, `source` delivers
/// the file of tilt factors if there is one.
///
/// # Errors
/// [`LoadError`] when the file is broken, exceeds a limit or has a kind of angles that the standard does not know.
pub fn read(
    name: &str,
    bytes: &[u8],
    source: &dyn FileSource,
    limits: &Limits,
) -> Result<Luminaire, LoadError> {
    let mut context = Context::new(limits, source);
    luminaire(&mut context, &name.into(), bytes)
}

/// As [`read`], as part of a load.
pub(crate) fn luminaire(
    context: &mut Context<'_>,
    file: &Arc<str>,
    bytes: &[u8],
) -> Result<Luminaire, LoadError> {
    let is_table = file.to_ascii_lowercase().ends_with(".dat");
    let read = if is_table { table::read } else { lm63::read };
    let luminaire = read(context, file, bytes)?;
    match luminaire.profile.problem() {
        Some(problem) => Err(LoadError::input(Place::whole(file), problem, "correct the table")),
        None => Ok(luminaire),
    }
}

/// A room that shows a luminaire.
pub(crate) fn load(context: &mut Context<'_>, file: &Arc<str>, bytes: &[u8]) -> Result<Vec<Edit>, LoadError> {
    let luminaire = luminaire(context, file, bytes)?;
    let (flux, peak) = (luminaire.profile.flux(), luminaire.profile.peak());
    let message = format!("`{}`: {flux:.0} lm, at most {peak:.0} cd", luminaire.name);
    context.note(Place::whole(file), message, "a room was put around it");
    Ok(room::edits(&luminaire))
}
