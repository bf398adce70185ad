//! Draws into the window's memory: the picture, lines, text. Pixels are 0x00RRGGBB.

use font8x8::legacy::BASIC_LEGACY;

use crate::gizmo::LineKind;
use crate::picture::Picture;

/// Edge of a letter, before scaling.
pub(super) const LETTER: usize = 8;
/// Between lines of text, before scaling.
const LEADING: usize = 11;

/// The window's pixels.
pub(super) struct Canvas<'a> {
    pub(super) pixels: &'a mut [u32],
    pub(super) width: usize,
    pub(super) height: usize,
}

fn rgb(r: u8, g: u8, b: u8) -> u32 {
    u32::from(r) << 16 | u32::from(g) << 8 | u32::from(b)
}

/// The colour of a line.
pub(super) fn color(kind: LineKind) -> u32 {
    match kind {
        LineKind::X => 0xFF_5A5A,
        LineKind::Y => 0x6E_E36E,
        LineKind::Z => 0x6A_A5FF,
        LineKind::Selection => 0xFF_C24A,
        LineKind::Light => 0xFF_F27A,
    }
}

impl Canvas<'_> {
    /// Stretches a picture over all pixels.
    pub(super) fn picture(&mut self, picture: &Picture) {
        let (columns, rows) = (picture.frame.width as usize, picture.frame.height as usize);
        if (columns, rows) == (self.width, self.height) {
            for (pixel, c) in self.pixels.iter_mut().zip(picture.rgb.chunks_exact(3)) {
                *pixel = rgb(c[0], c[1], c[2]);
            }
            return;
        }
        let taps = Taps::new(self.width, columns);
        for y in 0..self.height {
            let row = Taps::at(y, self.height, rows);
            let line = |index: usize| &picture.rgb[3 * columns * index..][..3 * columns];
            let (above, below) = (line(row.first), line(row.second));
            let out = &mut self.pixels[y * self.width..][..self.width];
            for (pixel, tap) in out.iter_mut().zip(&taps.0) {
                let value = |channel: usize| {
                    let pick = |line: &[u8]| {
                        let [a, b] = [tap.first, tap.second].map(|x| u32::from(line[3 * x + channel]));
                        a * (256 - tap.share) + b * tap.share
                    };
                    (pick(above) * (256 - row.share) + pick(below) * row.share) >> 16
                };
                *pixel = value(0) << 16 | value(1) << 8 | value(2);
            }
        }
    }

    /// A line between two points, pixels, so thick.
    pub(super) fn line(&mut self, from: [f32; 2], to: [f32; 2], thickness: usize, color: u32) {
        let delta = [to[0] - from[0], to[1] - from[1]];
        let steps = delta[0].abs().max(delta[1].abs()).min(20_000.0).ceil().max(1.0);
        for i in 0..=steps as usize {
            let t = i as f32 / steps;
            let at = [from[0] + t * delta[0], from[1] + t * delta[1]];
            let corner = at.map(|v| (v - thickness as f32 / 2.0).round() as isize);
            self.fill(corner, [thickness; 2], color);
        }
    }

    /// A rectangle of one colour; what lies outside is left out.
    pub(super) fn fill(&mut self, corner: [isize; 2], size: [usize; 2], color: u32) {
        for row in self.rows(corner, size) {
            self.pixels[row].fill(color);
        }
    }

    /// A rectangle made darker, for text to stand on.
    pub(super) fn shade(&mut self, corner: [isize; 2], size: [usize; 2]) {
        for row in self.rows(corner, size) {
            for pixel in &mut self.pixels[row] {
                *pixel = (*pixel >> 2) & 0x3F_3F3F;
            }
        }
    }

    /// The pixels of each row of a rectangle that lie inside.
    fn rows(&self, corner: [isize; 2], size: [usize; 2]) -> Vec<std::ops::Range<usize>> {
        let clip = |at: isize, end: usize| at.clamp(0, end as isize) as usize;
        let (left, top) = (clip(corner[0], self.width), clip(corner[1], self.height));
        let right = clip(corner[0] + size[0] as isize, self.width);
        let bottom = clip(corner[1] + size[1] as isize, self.height);
        (top..bottom).map(|y| y * self.width + left..y * self.width + right.max(left)).collect()
    }

    /// Lines of text on a shaded ground; letters without a form are shown as `?`.
    pub(super) fn text(&mut self, corner: [isize; 2], scale: usize, color: u32, lines: &[String]) {
        let widest = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0);
        let size = text_size(widest, lines.len(), scale);
        let margin = (4 * scale) as isize;
        self.shade([corner[0] - margin, corner[1] - margin], size.map(|n| n + 8 * scale));
        for (row, line) in lines.iter().enumerate() {
            for (column, letter) in line.chars().enumerate() {
                let form = BASIC_LEGACY.get(letter as usize).unwrap_or(&BASIC_LEGACY['?' as usize]);
                let x = corner[0] + (column * LETTER * scale) as isize;
                let y = corner[1] + (row * LEADING * scale) as isize;
                for (dy, bits) in form.iter().enumerate() {
                    for dx in (0..8).filter(|dx| bits >> dx & 1 == 1) {
                        let at = [x + (dx * scale) as isize, y + (dy * scale) as isize];
                        self.fill(at, [scale; 2], color);
                    }
                }
            }
        }
    }
}

/// Columns and rows of pixels that text takes.
pub(super) fn text_size(columns: usize, rows: usize, scale: usize) -> [usize; 2] {
    [columns * LETTER * scale, rows * LEADING * scale]
}

/// Where a pixel of a stretched picture gets its value: two neighbours and the share of the second, of 256.
struct Tap {
    first: usize,
    second: usize,
    share: u32,
}

struct Taps(Vec<Tap>);

impl Taps {
    fn new(size: usize, from: usize) -> Self {
        Self((0..size).map(|i| Self::at(i, size, from)).collect())
    }

    fn at(i: usize, size: usize, from: usize) -> Tap {
        let place = ((i as f32 + 0.5) * from as f32 / size as f32 - 0.5).clamp(0.0, from as f32 - 1.0);
        let first = place as usize;
        Tap { first, second: (first + 1).min(from - 1), share: ((place - first as f32) * 256.0) as u32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_text_stay_inside() {
        let mut pixels = vec![0; 40 * 20];
        let mut canvas = Canvas { pixels: &mut pixels, width: 40, height: 20 };
        canvas.line([-100.0, 5.0], [100.0, 5.0], 3, 7);
        canvas.text([30, 15], 2, 9, &["a long line of text".into(), "ü".into()]);
        canvas.fill([-5, -5], [500, 2], 1);
        assert_eq!(pixels.iter().filter(|&&p| p == 7).count(), 40 * 3);
        assert!(pixels.contains(&9));
    }

    #[test]
    fn stretching_interpolates() {
        let taps = Taps::new(4, 2);
        let places: Vec<_> = taps.0.iter().map(|t| (t.first, t.second, t.share)).collect();
        assert_eq!(places, [(0, 1, 0), (0, 1, 64), (0, 1, 192), (1, 1, 0)]);
    }
}
