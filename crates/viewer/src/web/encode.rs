//! Packs each picture once for all who get it in the same quality.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use super::protocol::Packed;
use crate::picture::Picture;
use crate::session::locked;

/// Packed pictures kept: a few viewers of different qualities, a picture or two behind each other.
const KEPT: usize = 6;

/// The last packed pictures, by number and quality.
#[derive(Debug, Default)]
pub(super) struct Encoder {
    kept: Mutex<VecDeque<(u64, u8, Arc<Packed>)>>,
    /// What pictures were packed in that nobody asks for any more.
    spare: Mutex<Vec<Vec<u8>>>,
}

impl Encoder {
    /// Packs a picture; quality 0 is without losses.
    ///
    /// # Errors
    /// When the picture is too large.
    pub(super) fn pack(&self, picture: &Picture, quality: u8) -> Result<Arc<Packed>, String> {
        let same = |(number, q, _): &&(u64, u8, _)| *number == picture.number && *q == quality;
        if let Some((_, _, packed)) = locked(&self.kept).iter().find(same) {
            return Ok(packed.clone());
        }
        let start = Instant::now();
        let mut bytes = locked(&self.spare).pop().unwrap_or_default();
        let done =
            if quality == 0 { picture.to_png(&mut bytes) } else { picture.to_jpeg(quality, &mut bytes) };
        done.map_err(|error| error.to_string())?;
        let packed = Arc::new(Packed { bytes, quality, milliseconds: start.elapsed().as_secs_f64() * 1e3 });
        let mut kept = locked(&self.kept);
        kept.push_back((picture.number, quality, packed.clone()));
        while kept.len() > KEPT
            && let Some((_, _, packed)) = kept.pop_front()
        {
            locked(&self.spare).extend(Arc::into_inner(packed).map(|packed| packed.bytes));
        }
        Ok(packed)
    }
}
