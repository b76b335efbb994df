//! Round trips as text.

use std::{
    fmt::Write as _,
    io::{self, Write},
};

use mtj_plant::durations::Durations;

use super::{Effort, Measurement};

/// Buckets of the histogram to a doubling.
const FINENESS: f64 = 2.0;
/// Its widest bar, characters.
const WIDTH: f64 = 50.0;

/// A table of all, and the loop's histograms.
pub(crate) fn table(
    out: &mut dyn Write,
    measured: &[Measurement],
    effort: &Effort,
) -> io::Result<()> {
    writeln!(
        out,
        "Round trips in µs: median of {} rounds of {}; the loop's law is computed in another process.",
        effort.rounds, effort.samples
    )?;
    writeln!(
        out,
        "\n{:9} {:7} {:>8} {:>8} {:>8} {:>8} {:>9}  {:>8} {:>8}  {:>9} {:>10}",
        "bus",
        "wait",
        "loop p50",
        "p90",
        "p99",
        "p99.9",
        "max",
        "bare p50",
        "floor",
        "loop/bare",
        "loop/floor"
    )?;
    for row in measured.iter().filter_map(Measurement::row) {
        writeln!(
            out,
            "{:9} {:7} {:8.2} {:8.2} {:8.2} {:8.2} {:9.2}  {:8.2} {:8.2}  {:9.2} {:10.2}",
            row.bus,
            row.wait,
            super::median(&row.own_p50_by_round),
            row.own.p90,
            row.own.p99,
            row.own.p999,
            row.own.max,
            super::median(&row.bare_p50_by_round),
            super::median(&row.floor_p50_by_round),
            row.own_to_bare,
            row.own_to_floor,
        )?;
    }
    writeln!(
        out,
        "\nbare: the transport's own ping-pong with the same samples; floor: one cache line between two cores.\n\
         Ratios are of medians within a round, the median of all rounds."
    )?;
    for Measurement { way, own, .. } in measured {
        writeln!(out, "\n{} {}, the loop's round trips:", way.bus.name(), way.wait.name())?;
        out.write_all(histogram(&own.all).as_bytes())?;
    }
    Ok(())
}

/// A histogram whose buckets grow by the same factor.
fn histogram(durations: &Durations) -> String {
    let bucket = |ns: u64| (ns.max(1) as f64).log2() * FINENESS;
    let mut counts = std::collections::BTreeMap::<i64, u64>::new();
    for (ns, count) in durations.buckets() {
        *counts.entry(bucket(ns).floor() as i64).or_default() += count;
    }
    let (Some((first, _)), Some((last, _))) = (counts.first_key_value(), counts.last_key_value())
    else {
        return String::new();
    };
    let (most, all) = (counts.values().max().copied().unwrap_or(1), durations.count().max(1));
    let edge = |k: i64| (k as f64 / FINENESS).exp2() / 1e3;
    let mut text = String::new();
    for k in *first..=*last {
        let count = counts.get(&k).copied().unwrap_or(0);
        let share = count as f64 / all as f64;
        let length = (count as f64 / most as f64 * WIDTH).ceil() as usize;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:>10.2} – {:<10.2} {:>8.3} % {}",
            edge(k),
            edge(k + 1),
            100.0 * share,
            "█".repeat(length)
        );
    }
    text
}

/// The distribution in HdrHistogram's own text form, by which its plotters draw it; µs.
pub(crate) fn hdr(out: &mut dyn Write, durations: &Durations) -> io::Result<()> {
    writeln!(
        out,
        "{:>12} {:>14} {:>10} {:>14}\n",
        "Value", "Percentile", "TotalCount", "1/(1-Percentile)"
    )?;
    let all = durations.count();
    let mut below = 0;
    for (ns, count) in durations.buckets() {
        below += count;
        let share = below as f64 / all as f64;
        let odds =
            if below < all { format!("{:.2}", 1.0 / (1.0 - share)) } else { "inf".to_owned() };
        writeln!(out, "{:12.3} {share:14.12} {below:10} {odds:>14}", ns as f64 / 1e3)?;
    }
    Ok(())
}
