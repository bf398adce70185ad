//! The results as the tables of a Markdown page.

use std::fmt::Write;

use super::results::{BUILD_BARS, BuildRow, Results, Row, Standing, bars, is_embree};

/// All tables.
pub(super) fn tables(results: &Results) -> String {
    let mut text = machine(results);
    for isa in results.isas() {
        text += &means(results, isa);
        text += &rays(results, isa);
    }
    text += &second_peer(results);
    text += &builds(results);
    text += &kd_trees(results);
    text += &losses(results);
    text
}

fn machine(results: &Results) -> String {
    let machine = &results.machine;
    let mut text = format!(
        "Machine: {}, {} threads, {}. Heliostat {}",
        machine.cpu, machine.threads, machine.system, machine.heliostat
    );
    machine.peers.iter().for_each(|peer| _ = write!(text, ", {peer}"));
    text += ". Rates are medians of interleaved runs, in million rays per second; one thread by processor time, more by wall time.\n\n";
    text
}

fn means(results: &Results, isa: &str) -> String {
    let mut text = format!(
        "### Ratios to Embree, one thread, {isa}\n\n| rays | geometric mean | bar | least | on | bar |\n|---|---|---|---|---|---|\n"
    );
    for bar in bars(isa) {
        let Some(Standing { mean, least }) = results.standing(isa, bar.rays) else { continue };
        let _ = writeln!(
            text,
            "| {} | {mean:.2} | {:.2} | {:.2} | {} | {:.2} |",
            bar.what, bar.mean, least.0, least.1, bar.least
        );
    }
    if let Some((threads, ours, peer)) = results.scaling() {
        let peer = peer.map(|peer| format!(" (Embree {peer:.2})")).unwrap_or_default();
        let _ = writeln!(text, "\n{threads} threads over one: {ours:.2}{peer}.");
    }
    text + "\n"
}

fn rays(results: &Results, isa: &str) -> String {
    let most = results.rows.iter().map(|row| row.threads).max().filter(|&most| most > 1);
    let columns = |cells: [&str; 3]| most.map(|_| format!(" {} |", cells.join(" | "))).unwrap_or_default();
    let threads = format!("{} threads: ours", most.unwrap_or(1));
    let mut text = format!(
        "### Rays, {isa}\n\n| scene | triangles | rays | ours | Embree | ratio |{} our build | Embree's best | answers that differ |\n|---|---|---|---|---|---|{}---|---|---|\n",
        columns([&threads, "Embree", "ratio"]),
        if most.is_some() { "---|---|---|" } else { "" },
    );
    let alone = |row: &&Row| row.peer_name.is_none() && row.isa == isa && row.threads == 1;
    for row in results.versus_embree(isa, 1).chain(results.rows.iter().filter(alone)) {
        let all = results.rows.iter().find(|all| {
            (&all.scene, &all.rays, &all.isa, &all.peer_name)
                == (&row.scene, &row.rays, &row.isa, &row.peer_name)
                && Some(all.threads) == most
        });
        let cell = |value: Option<f64>| value.map_or("–".into(), |value| format!("{value:.2}"));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {:.2} | {} | {} |{} {} | {} | {} |",
            row.scene,
            row.triangles,
            row.rays,
            row.ours,
            cell(row.peer),
            cell(row.ratio),
            columns([
                &cell(all.map(|all| all.ours)),
                &cell(all.and_then(|all| all.peer)),
                &cell(all.and_then(|all| all.ratio)),
            ]),
            row.our_variant,
            row.peer_variant.as_deref().unwrap_or("–"),
            row.disagree.map_or("–".into(), |n| format!("{n} of {}", row.count)),
        );
    }
    text + "\n"
}

fn second_peer(results: &Results) -> String {
    let others: Vec<&Row> = (results.rows.iter())
        .filter(|row| row.peer_name.is_some() && !is_embree(row.peer_name.as_deref()))
        .collect();
    if others.is_empty() {
        return String::new();
    }
    let mut text = String::from(
        "### Single rays of a second peer, one thread\n\n| scene | rays | ours | peer | ratio | which |\n|---|---|---|---|---|---|\n",
    );
    for row in others {
        let _ = writeln!(
            text,
            "| {} | {} | {:.2} | {:.2} | {:.2} | {}, {} |",
            row.scene,
            row.rays,
            row.ours,
            row.peer.unwrap_or(f64::NAN),
            row.ratio.unwrap_or(f64::NAN),
            row.peer_name.as_deref().unwrap_or_default(),
            row.peer_variant.as_deref().unwrap_or_default(),
        );
    }
    text + "\n"
}

fn builds(results: &Results) -> String {
    if results.builds.is_empty() {
        return String::new();
    }
    let mut text = String::from(
        "### Builds\n\nMillion triangles per second. Bytes are all that tracing needs: our nodes and leaves, which hold the vertices, or beside them the mesh whose vertices the compact layout reads; \
         what Embree's device holds, with vertices and indices; for obvhs nodes, indices and triangles.\n\n",
    );
    text += &build_means(results);
    text += "| scene | builder | threads | Mtri/s | SAH | bytes/tri | peer | Mtri/s | bytes/tri | ratio |\n|---|---|---|---|---|---|---|---|---|---|\n";
    for row in &results.builds {
        let cell = |value: Option<f64>| value.map_or("–".into(), |value| format!("{value:.2}"));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {:.2} | {:.1} | {:.1} | {} | {} | {} | {} |",
            row.scene,
            row.builder,
            row.threads,
            row.mtris_per_s,
            row.sah,
            row.bytes_per_tri,
            peer(row),
            cell(row.peer),
            cell(row.peer_bytes_per_tri),
            cell(row.ratio),
        );
    }
    text + "\n"
}

fn build_means(results: &Results) -> String {
    let mut rows = String::new();
    for (builder, bar) in BUILD_BARS {
        for threads in results.build_threads() {
            let Some(Standing { mean, least }) = results.build_standing(builder, threads) else { continue };
            let _ = writeln!(
                rows,
                "| {builder} | {threads} | {mean:.2} | {bar:.2} | {:.2} | {} |",
                least.0, least.1
            );
        }
    }
    if rows.is_empty() {
        return rows;
    }
    format!(
        "| builder | threads | over Embree's, geometric mean | bar | least | on |\n|---|---|---|---|---|---|\n{rows}\n"
    )
}

fn kd_trees(results: &Results) -> String {
    if results.kd_trees.is_empty() {
        return String::new();
    }
    let mut text = String::from(
        "### Kd-trees, one thread\n\nPackets and single rays are the same rays in the same order.\n\n\
         | scene | triangles | rays | instructions | tree and way | Mray/s | over | Mray/s | ratio | answers that differ |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for row in &results.kd_trees {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {:.2} | {} | {:.2} | {:.2} | {} of {} |",
            row.scene,
            row.triangles,
            row.rays,
            row.isa,
            row.what,
            row.rate,
            row.over,
            row.over_rate,
            row.ratio,
            row.disagree,
            row.count,
        );
    }
    text + "\n"
}

fn peer(row: &BuildRow) -> String {
    let parts = [row.peer_name.as_deref(), row.peer_variant.as_deref()];
    let text = parts.into_iter().flatten().collect::<Vec<_>>().join(" ");
    if text.is_empty() { "–".into() } else { text }
}

fn losses(results: &Results) -> String {
    let mut text = String::from("### Where a peer is faster\n\n");
    let below = |ratio: Option<f64>| ratio.filter(|&ratio| ratio < 1.0);
    let threads = |n: usize| if n == 1 { "one thread".into() } else { format!("{n} threads") };
    let mut any = false;
    for row in &results.rows {
        let Some(ratio) = below(row.ratio) else { continue };
        let name = row.peer_name.as_deref().unwrap_or_default();
        any = true;
        let _ = writeln!(
            text,
            "- {}, {}, {}, {}: {ratio:.2} of {name}",
            row.scene,
            row.rays,
            threads(row.threads),
            row.isa
        );
    }
    for row in &results.builds {
        let Some(ratio) = below(row.ratio) else { continue };
        any = true;
        let _ = writeln!(
            text,
            "- {}, building `{}`, {}: {ratio:.2} of {}",
            row.scene,
            row.builder,
            threads(row.threads),
            peer(row)
        );
    }
    if any { text } else { text + "Nowhere in these tables.\n" }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::results::tests::some;

    #[test]
    fn tables_say_what_was_measured_and_where_a_peer_wins() {
        let text = tables(&some());
        assert!(text.contains("| primary, closest hit | 2.00 | 1.50 | 1.00 | b | 1.50 |"), "{text}");
        assert!(
            text.contains("| a | 1000 | primary | 40.00 | 10.00 | 4.00 | 76.00 | 20.00 | 3.80 |"),
            "{text}"
        );
        assert!(
            text.contains("| a | default | 1 | 3.00 | 12.0 | 54.0 | Embree 4.4.0 MEDIUM | 2.00 |"),
            "{text}"
        );
        assert!(
            text.contains("| primary | avx2 | SAH, packets of 16 | 16.00 | SAH, single rays | 5.00 | 3.20 |"),
            "{text}"
        );
        assert!(text.contains("- a, vpl16, one thread, avx2: 0.80 of Embree 4.4.0"), "{text}");
        assert!(text.contains("| default | 1 | 1.50 | 1.30 | 1.50 | a |"), "{text}");
        assert!(!text.contains("building `default`"), "that row wins");
    }
}
