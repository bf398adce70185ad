//! Cost against triangle count: nanoseconds per primary ray over a logarithmic axis.

use super::results::Row;
use crate::chart::Chart;

/// Triangle counts of the terrain, from a thousand to ten million.
pub(super) const COUNTS: [usize; 9] =
    [1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000, 10_000_000];

/// The picture of rows that differ in their triangle counts.
pub(super) fn svg(rows: &[Row]) -> String {
    let point = |row: &Row, rate: f64| (row.triangles.max(1) as f64, 1e3 / rate);
    let ours = rows.iter().map(|row| point(row, row.ours)).collect();
    let peer = rows.iter().filter_map(|row| row.peer.map(|rate| point(row, rate))).collect();
    let peer_name = rows.iter().find_map(|row| row.peer_name.clone()).unwrap_or_default();
    let chart = Chart {
        title: "Cost of a primary ray over a terrain, the same view, one thread",
        x: "triangles",
        logarithmic: true,
        y: "ns per ray",
        lines: vec![("Heliostat".into(), ours), (peer_name, peer)],
    };
    chart.svg()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::results::tests::row;

    #[test]
    fn both_engines_are_drawn() {
        let rows = [1_000, 100_000].map(|triangles| Row { triangles, ..row("t", "primary", 1, 50.0, 20.0) });
        let svg = svg(&rows);
        assert_eq!(svg.matches("<circle").count(), 4);
        assert!(svg.contains("Embree 4.4.0"));
    }
}
