//! Line charts as SVG: measured points over a linear or logarithmic axis.

use std::fmt::Write;

const SIZE: (f64, f64) = (720.0, 420.0);
/// Left, right, top, bottom.
const MARGIN: (f64, f64, f64, f64) = (64.0, 24.0, 40.0, 56.0);
const COLORS: [&str; 5] = ["#c33", "#36c", "#292", "#a5a", "#a60"];
/// Points are marked where there are no more than this.
const FEW: usize = 40;

/// What a chart shows.
pub(crate) struct Chart<'a> {
    pub(crate) title: &'a str,
    /// What the horizontal axis counts.
    pub(crate) x: &'a str,
    pub(crate) logarithmic: bool,
    /// What the vertical axis, which starts at zero, counts.
    pub(crate) y: &'a str,
    /// Name and points of each line.
    pub(crate) lines: Vec<(String, Vec<(f64, f64)>)>,
}

impl Chart<'_> {
    /// The picture. Lines without points are left out.
    pub(crate) fn svg(&self) -> String {
        let points = || self.lines.iter().flat_map(|(_, points)| points);
        let frame = Frame::new(self.logarithmic, points());
        let mut text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" font-size=\"13\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
             <text x=\"{}\" y=\"22\" font-size=\"15\">{}</text>\n",
            SIZE.0, SIZE.1, MARGIN.0, self.title
        );
        frame.axes(&mut text, self.x, self.y);
        let lines = self.lines.iter().filter(|(_, points)| !points.is_empty());
        for (i, (name, points)) in lines.enumerate() {
            let color = COLORS[i % COLORS.len()];
            let path: Vec<String> =
                points.iter().map(|&(x, y)| format!("{:.1} {:.1}", frame.x(x), frame.y(y))).collect();
            let _ = writeln!(
                text,
                "<path d=\"M{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>",
                path.join("L")
            );
            for &(x, y) in points.iter().filter(|_| points.len() <= FEW) {
                let (x, y) = (frame.x(x), frame.y(y));
                let _ = writeln!(text, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{color}\"/>");
            }
            let (x, y) = (MARGIN.0 + 12.0, MARGIN.2 + 20.0 + 18.0 * i as f64);
            let _ = writeln!(text, "<text x=\"{x:.1}\" y=\"{y:.1}\" fill=\"{color}\">{name}</text>");
        }
        text + "</svg>\n"
    }
}

/// From values to the page.
struct Frame {
    logarithmic: bool,
    /// Of the horizontal axis; decades if it is logarithmic.
    least: f64,
    most: f64,
    x_step: f64,
    top: f64,
    y_step: f64,
    width: f64,
    height: f64,
}

impl Frame {
    fn new<'a>(logarithmic: bool, points: impl Iterator<Item = &'a (f64, f64)> + Clone) -> Self {
        let (y_step, top) = scale(points.clone().map(|p| p.1).fold(0.0, f64::max));
        let (first, last) = points
            .map(|p| p.0)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), x| (least.min(x), most.max(x)));
        let (least, most, x_step) = if logarithmic {
            // Counts are near round numbers, on either side of them.
            let least = (first.log10() + 0.05).floor();
            (least, (last.log10() - 0.05).ceil().max(least + 1.0), 1.0)
        } else {
            let (step, end) = scale(last);
            (first.min(0.0), end, step)
        };
        let (width, height) = (SIZE.0 - MARGIN.0 - MARGIN.1, SIZE.1 - MARGIN.2 - MARGIN.3);
        Self { logarithmic, least, most, x_step, top, y_step, width, height }
    }

    fn x(&self, value: f64) -> f64 {
        let value = if self.logarithmic { value.log10() } else { value };
        MARGIN.0 + self.width * (value - self.least) / (self.most - self.least)
    }

    fn y(&self, value: f64) -> f64 {
        MARGIN.2 + self.height * (1.0 - value / self.top)
    }

    fn axes(&self, text: &mut String, x_name: &str, y_name: &str) {
        let line = |x1: f64, y1: f64, x2: f64, y2: f64| {
            format!("<path d=\"M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}\" stroke=\"#ddd\"/>\n")
        };
        let (right, bottom) = (MARGIN.0 + self.width, MARGIN.2 + self.height);
        for i in 0..=((self.most - self.least) / self.x_step).round() as i32 {
            let value = self.least + self.x_step * f64::from(i);
            let (value, label) = match self.logarithmic {
                true => (10f64.powf(value), count_label(value.round() as i32)),
                false => (value, value.to_string()),
            };
            let at = self.x(value);
            *text += &line(at, MARGIN.2, at, bottom);
            let _ = writeln!(
                text,
                "<text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
                bottom + 20.0
            );
        }
        for i in 0..=(self.top / self.y_step).round() as u32 {
            let value = self.y_step * f64::from(i);
            let at = self.y(value);
            *text += &line(MARGIN.0, at, right, at);
            let label = (value * 1e6).round() / 1e6;
            let _ = writeln!(
                text,
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
                MARGIN.0 - 8.0,
                at + 4.0
            );
        }
        let _ = writeln!(
            text,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{x_name}</text>",
            MARGIN.0 + self.width / 2.0,
            SIZE.1 - 14.0
        );
        let _ = writeln!(
            text,
            "<text x=\"18\" y=\"{0:.1}\" text-anchor=\"middle\" transform=\"rotate(-90 18 {0:.1})\">{y_name}</text>",
            MARGIN.2 + self.height / 2.0
        );
    }
}

/// A round step and the end of an axis from 0 to at least `largest`.
fn scale(largest: f64) -> (f64, f64) {
    let rough = (largest / 5.0).max(1e-9);
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|k| k * power).into_iter().find(|&s| s >= rough).unwrap_or(rough);
    (step, step * (largest / step).ceil().max(1.0))
}

fn count_label(decade: i32) -> String {
    match decade {
        ..3 => format!("{}", 10f64.powi(decade)),
        3..6 => format!("{}k", 10f64.powi(decade - 3)),
        _ => format!("{}M", 10f64.powi(decade - 6)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_end_on_round_numbers() {
        assert_eq!(scale(23.0), (5.0, 25.0));
        assert_eq!(scale(100.0), (20.0, 100.0));
        assert_eq!([3, 5, 6, 7].map(count_label), ["1k", "100k", "1M", "10M"]);
    }

    #[test]
    fn every_line_is_drawn_on_either_axis() {
        for logarithmic in [false, true] {
            let points = vec![(1.0, 2.0), (100.0, 3.0)];
            let lines =
                vec![("a".to_owned(), points.clone()), ("b".to_owned(), points), ("c".to_owned(), vec![])];
            let svg = Chart { title: "t", x: "x", logarithmic, y: "y", lines }.svg();
            assert_eq!((svg.matches("<circle").count(), svg.matches("stroke-width").count()), (4, 2));
            assert!(svg.ends_with("</svg>\n") && !svg.contains("NaN") && !svg.contains("inf"));
        }
    }
}
