//! Animated pictures, written frame by frame: a long sequence takes no more memory than one frame.

use std::io::Write;

use super::encode::{EncodeError, check};

/// An animated PNG of 8-bit sRGB frames that plays over and over. A program that knows nothing of animation shows the
/// first frame.
///
/// # References
/// W3C, "Portable Network Graphics (PNG) Specification (Third Edition)", 2025, section 4.9.
pub struct PngAnimation<W: Write> {
    writer: png::Writer<W>,
    width: u32,
    height: u32,
}

impl<W: Write> std::fmt::Debug for PngAnimation<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PngAnimation").field("width", &self.width).field("height", &self.height).finish()
    }
}

impl<W: Write> PngAnimation<W> {
    /// An animation of exactly `frames` frames.
    ///
    /// # Errors
    /// [`EncodeError`] when there are no frames or pixels, the rate is not from 0.001 to 1,000 frames per second, or
    /// `output` takes no bytes.
    pub fn new(
        output: W,
        width: u32,
        height: u32,
        frames: u32,
        frames_per_second: f64,
    ) -> Result<Self, EncodeError> {
        let (numerator, denominator) = delay(frames_per_second)?;
        let mut encoder = png::Encoder::new(output, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        encoder.validate_sequence(true);
        let header = || {
            encoder.set_animated(frames, 0)?;
            encoder.set_frame_delay(numerator, denominator)?;
            encoder.write_header()
        };
        Ok(Self { writer: header().map_err(refused)?, width, height })
    }

    /// Adds the next frame, rows from the top.
    ///
    /// # Errors
    /// [`EncodeError`] when `rgb` is not `width × height × 3` long, there are more frames than were promised, or the
    /// output takes no more bytes.
    pub fn frame(&mut self, rgb: &[u8]) -> Result<(), EncodeError> {
        check("the picture", rgb.len(), self.width, self.height, 3)?;
        self.writer.write_image_data(rgb).map_err(refused)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// [`EncodeError`] when frames are missing or the output takes no more bytes.
    pub fn finish(self) -> Result<(), EncodeError> {
        self.writer.finish().map_err(refused)
    }
}

/// Seconds per frame as a fraction of 16-bit numbers.
fn delay(frames_per_second: f64) -> Result<(u16, u16), EncodeError> {
    if !(0.001..=1000.0).contains(&frames_per_second) {
        let problem = format!("{frames_per_second} frames per second; give a rate from 0.001 to 1000");
        return Err(EncodeError::Format(problem));
    }
    // The cast cannot cut anything off: the values are in range.
    Ok(match frames_per_second {
        rate if rate.fract() == 0.0 => (1, rate as u16),
        // 23.976, 29.97, …
        rate if rate < 65.0 => (1000, (rate * 1000.0).round() as u16),
        rate => (10, (rate * 10.0).round() as u16),
    })
}

fn refused(error: png::EncodingError) -> EncodeError {
    EncodeError::Format(error.to_string())
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    #[test]
    fn frames_come_back_with_their_delay() {
        let frames = [[1u8, 2, 3, 4, 5, 6], [9; 6], [0; 6]];
        let mut bytes = Vec::new();
        let mut animation = PngAnimation::new(&mut bytes, 2, 1, 3, 29.97).unwrap();
        frames.iter().for_each(|frame| animation.frame(frame).unwrap());
        animation.finish().unwrap();
        let mut reader = png::Decoder::new(Cursor::new(&bytes)).read_info().unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_frames, 3);
        for frame in frames {
            let mut pixels = [7; 6];
            reader.next_frame(&mut pixels).unwrap();
            assert_eq!(pixels, frame);
            let control = reader.info().frame_control().unwrap();
            assert_eq!((control.delay_num, control.delay_den), (1000, 29970));
        }
        // Others see the first frame.
        let still = crate::image::decode("a.png", &bytes, &crate::Limits::default()).unwrap();
        assert_eq!((still.width, still.height), (2, 1));
    }

    #[test]
    fn promises_are_kept_or_refused() {
        assert!(PngAnimation::new(Vec::new(), 1, 1, 0, 24.0).is_err());
        assert!(PngAnimation::new(Vec::new(), 0, 1, 1, 24.0).is_err());
        for rate in [0.0, -1.0, f64::NAN, 1e9] {
            assert!(PngAnimation::new(Vec::new(), 1, 1, 1, rate).is_err(), "{rate}");
        }
        let mut animation = PngAnimation::new(Vec::new(), 1, 1, 2, 24.0).unwrap();
        assert!(matches!(animation.frame(&[0; 4]), Err(EncodeError::Size { .. })));
        animation.frame(&[0; 3]).unwrap();
        assert!(animation.finish().is_err(), "a frame is missing");
        assert_eq!((delay(24.0).unwrap(), delay(120.5).unwrap()), ((1, 24), (10, 1205)));
    }
}
