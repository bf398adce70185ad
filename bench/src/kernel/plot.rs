//! Cost against triangle count as an SVG: nanoseconds per primary ray over a logarithmic axis.

use std::fmt::Write;

use super::results::Row;

/// Triangle counts of the terrain, from a thousand to ten million.
pub(super) const COUNTS: [usize; 9] =
    [1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000, 10_000_000];

const SIZE: (f64, f64) = (720.0, 420.0);
/// Left, right, top, bottom.
const MARGIN: (f64, f64, f64, f64) = (64.0, 24.0, 40.0, 56.0);

/// The picture of rows that differ in their triangle counts; nothing without rows.
pub(super) fn svg(rows: &[Row]) -> String {
    let point = |row: &Row, rate: f64| (row.triangles.max(1) as f64, 1e3 / rate);
    let ours: Vec<_> = rows.iter().map(|row| point(row, row.ours)).collect();
    let peer: Vec<_> = rows.iter().filter_map(|row| row.peer.map(|rate| point(row, rate))).collect();
    let all = || ours.iter().chain(&peer);
    // The terrain's counts are near round numbers, on either side of them.
    let least = (all().map(|p| p.0).fold(f64::INFINITY, f64::min).log10() + 0.05).floor();
    let most = (all().map(|p| p.0).fold(1.0, f64::max).log10() - 0.05).ceil().max(least + 1.0);
    let (step, top) = scale(all().map(|p| p.1).fold(0.0, f64::max));
    let (width, height) = (SIZE.0 - MARGIN.0 - MARGIN.1, SIZE.1 - MARGIN.2 - MARGIN.3);
    let x = |n: f64| MARGIN.0 + width * (n.log10() - least) / (most - least);
    let y = |cost: f64| MARGIN.2 + height * (1.0 - cost / top);

    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{}\" y=\"22\" font-size=\"15\">Cost of a primary ray over a terrain, the same view, one thread</text>\n",
        SIZE.0, SIZE.1, MARGIN.0
    );
    let line = |x1: f64, y1: f64, x2: f64, y2: f64| {
        format!("<path d=\"M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}\" stroke=\"#ddd\"/>\n")
    };
    for decade in least as i32..=most as i32 {
        let at = x(10f64.powi(decade));
        text += &line(at, MARGIN.2, at, MARGIN.2 + height);
        let label = count_label(decade);
        let _ = writeln!(
            text,
            "<text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
            MARGIN.2 + height + 20.0
        );
    }
    for i in 0..=(top / step).round() as u32 {
        let (cost, at) = (step * f64::from(i), y(step * f64::from(i)));
        text += &line(MARGIN.0, at, MARGIN.0 + width, at);
        let _ = writeln!(
            text,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{cost}</text>",
            MARGIN.0 - 8.0,
            at + 4.0
        );
    }
    let _ = writeln!(
        text,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">triangles</text>",
        MARGIN.0 + width / 2.0,
        SIZE.1 - 14.0
    );
    let _ = writeln!(
        text,
        "<text x=\"18\" y=\"{0:.1}\" text-anchor=\"middle\" transform=\"rotate(-90 18 {0:.1})\">ns per ray</text>",
        MARGIN.2 + height / 2.0
    );
    let peer_name = rows.iter().find_map(|row| row.peer_name.as_deref()).unwrap_or_default();
    for (i, (points, color, name)) in
        [(&ours, "#c33", "Heliostat"), (&peer, "#36c", peer_name)].into_iter().enumerate()
    {
        if points.is_empty() {
            continue;
        }
        let path: Vec<String> =
            points.iter().map(|&(n, cost)| format!("{:.1} {:.1}", x(n), y(cost))).collect();
        let _ = writeln!(
            text,
            "<path d=\"M{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>",
            path.join("L")
        );
        for &(n, cost) in points {
            let _ =
                writeln!(text, "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\" fill=\"{color}\"/>", x(n), y(cost));
        }
        let _ = writeln!(
            text,
            "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"{color}\">{name}</text>",
            MARGIN.0 + 12.0,
            MARGIN.2 + 20.0 + 18.0 * i as f64
        );
    }
    text + "</svg>\n"
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
    use crate::kernel::results::tests::row;

    #[test]
    fn axes_end_on_round_numbers() {
        assert_eq!(scale(23.0), (5.0, 25.0));
        assert_eq!(scale(100.0), (20.0, 100.0));
        assert_eq!([3, 5, 6, 7].map(count_label), ["1k", "100k", "1M", "10M"]);
    }

    #[test]
    fn both_engines_are_drawn() {
        let rows = [1_000, 100_000].map(|triangles| Row { triangles, ..row("t", "primary", 1, 50.0, 20.0) });
        let svg = svg(&rows);
        assert_eq!(svg.matches("<circle").count(), 4);
        assert!(svg.contains("Embree 4.4.0") && svg.ends_with("</svg>\n"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}
