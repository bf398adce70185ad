//! From the angles of photometric files, with their symmetries, to whole profiles.

use heliostat_scene::{Photometry, Profile};

/// Degrees by which angles may miss what they mean.
const SLACK: f32 = 0.1;

/// A table as files have it: angles in degrees, and the candela of all vertical angles for each horizontal one.
pub(super) struct Table {
    pub(super) photometry: Photometry,
    pub(super) vertical: Vec<f32>,
    pub(super) horizontal: Vec<f32>,
    pub(super) candela: Vec<Vec<f32>>,
}

impl Table {
    /// The profile of the whole sphere of directions. The error says what is wrong with the angles.
    pub(super) fn profile(mut self) -> Result<Profile, String> {
        for (name, angles) in [("vertical", &self.vertical), ("horizontal", &self.horizontal)] {
            if let Some(pair) = angles.windows(2).find(|pair| pair[0] >= pair[1]) {
                return Err(format!("{name} angles must rise; {} comes before {}", pair[0], pair[1]));
            }
        }
        if self.vertical.len() < 2 {
            return Err("a single vertical angle makes no profile".into());
        }
        match self.photometry {
            Photometry::C => self.around_axis()?,
            Photometry::A | Photometry::B => self.across_axis()?,
        }
        let (vertical, horizontal) = (&self.vertical, &self.horizontal);
        let radians = |angles: &mut dyn Iterator<Item = f32>| angles.map(f32::to_radians).collect();
        // The poles of A and B lie at +90°: their polar angles run backwards.
        let from_pole = |angles: &[f32]| radians(&mut angles.iter().rev().map(|angle| 90.0 - angle));
        let columns = self.candela.iter();
        let (polar, azimuth, intensity) = match self.photometry {
            Photometry::C => (
                radians(&mut vertical.iter().copied()),
                radians(&mut horizontal.iter().copied()),
                columns.flatten().copied().collect(),
            ),
            Photometry::A => (
                from_pole(vertical),
                radians(&mut horizontal.iter().copied()),
                columns.flat_map(|column| column.iter().rev().copied()).collect(),
            ),
            Photometry::B => (
                from_pole(horizontal),
                radians(&mut vertical.iter().copied()),
                (0..vertical.len())
                    .flat_map(|v| self.candela.iter().rev().map(move |column| column[v]))
                    .collect(),
            ),
        };
        Ok(Profile { photometry: self.photometry, polar, azimuth, intensity })
    }

    /// Type C: completes the turn.
    fn around_axis(&mut self) -> Result<(), String> {
        let near = |a: f32, b: f32| (a - b).abs() <= SLACK;
        let (first, last) = (self.horizontal[0], self.horizontal[self.horizontal.len() - 1]);
        if self.horizontal.len() == 1 {
            self.horizontal[0] = 0.0;
        } else if near(first, 0.0) && near(last, 90.0) {
            self.mirror();
            self.mirror();
        } else if near(first, 0.0) && near(last, 180.0) || near(first, 90.0) && near(last, 270.0) {
            self.mirror();
        } else if near(first, 0.0) && last > 180.0 && last < 360.0 - SLACK {
            // Some files leave the last plane out, since it is the first.
            self.horizontal.push(first + 360.0);
            self.candela.push(self.candela[0].clone());
        } else if !(near(first, 0.0) && near(last, 360.0)) {
            return Err(format!(
                "horizontal angles run from {first}° to {last}°; type C has 0 alone, 0 to 90, 180 or 360, or 90 to 270"
            ));
        }
        Ok(())
    }

    /// Types A and B: completes the left side if it is like the right one.
    fn across_axis(&mut self) -> Result<(), String> {
        if self.horizontal.len() < 2 {
            return Err("types A and B need at least two horizontal angles".into());
        }
        let inside = |angles: &[f32], most: f32| angles.iter().all(|angle| angle.abs() <= most + SLACK);
        let (h, v) = match self.photometry {
            Photometry::A => (180.0, 90.0),
            _ => (90.0, 180.0),
        };
        if !(inside(&self.horizontal, h) && inside(&self.vertical, v)) {
            return Err(format!("horizontal angles may reach ±{h}° and vertical ones ±{v}°"));
        }
        if self.horizontal[0].abs() <= SLACK {
            self.horizontal[0] = 0.0;
            let (angles, columns) = (self.horizontal[1..].to_vec(), self.candela[1..].to_vec());
            self.horizontal.splice(0..0, angles.iter().rev().map(|angle| -angle));
            self.candela.splice(0..0, columns.into_iter().rev());
        }
        Ok(())
    }

    /// Continues the table by its mirror image beyond the last angle.
    fn mirror(&mut self) {
        let count = self.horizontal.len();
        let last = self.horizontal[count - 1];
        for i in (0..count - 1).rev() {
            self.horizontal.push(2.0 * last - self.horizontal[i]);
            self.candela.push(self.candela[i].clone());
        }
    }
}
