//! The distribution of durations over the last seconds.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

use hdrhistogram::Histogram;

/// The length of one part of the window.
const PART: Duration = Duration::from_secs(1);
/// How many parts are kept.
const PARTS: usize = 10;
/// The longest duration that is resolved, ns.
const LONGEST_NS: u64 = 60_000_000_000;

/// Durations of the last ten seconds, to about one percent.
#[derive(Clone, Debug)]
pub struct RecentDurations {
    parts: VecDeque<(Instant, Histogram<u64>)>,
}

/// Median, 99 % quantile and maximum, µs.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Spread {
    /// Median.
    pub p50: f64,
    /// 99 % quantile.
    pub p99: f64,
    /// The longest.
    pub max: f64,
}

impl Default for RecentDurations {
    fn default() -> Self {
        Self { parts: VecDeque::with_capacity(PARTS + 1) }
    }
}

#[expect(clippy::expect_used, reason = "constant bounds")]
fn empty() -> Histogram<u64> {
    Histogram::new_with_bounds(1, LONGEST_NS, 2).expect("valid bounds")
}

impl RecentDurations {
    /// Counts one duration, ns.
    pub fn record(&mut self, ns: u64) {
        let now = Instant::now();
        if self.parts.back().is_none_or(|(since, _)| now.duration_since(*since) > PART) {
            // The oldest part is emptied and used again.
            let mut part = match self.parts.len() {
                PARTS => self.parts.pop_front().map_or_else(empty, |(_, part)| part),
                _ => empty(),
            };
            part.reset();
            self.parts.push_back((now, part));
        }
        if let Some((_, part)) = self.parts.back_mut() {
            part.saturating_record(ns.clamp(1, LONGEST_NS));
        }
    }

    /// Median, 99 % and longest; `None` without recent durations.
    pub fn spread(&self) -> Option<Spread> {
        let all = self.sum();
        let at = |quantile| all.value_at_quantile(quantile) as f64 / 1e3;
        (!all.is_empty()).then(|| Spread {
            p50: at(0.5),
            p99: at(0.99),
            max: all.max() as f64 / 1e3,
        })
    }

    /// How many durations lie between neighbouring entries of `edges_ns`, which ascend.
    pub fn counts(&self, edges_ns: &[u64]) -> Vec<u64> {
        let all = self.sum();
        edges_ns
            .windows(2)
            .map(|edge| all.count_between(edge[0], edge[1].saturating_sub(1)))
            .collect()
    }

    fn sum(&self) -> Histogram<u64> {
        let mut all = empty();
        let recent = |since: &Instant| since.elapsed() < PART * PARTS as u32;
        for (_, part) in self.parts.iter().filter(|(since, _)| recent(since)) {
            // All parts have the same bounds, so adding cannot fail.
            let _ = all.add(part);
        }
        all
    }
}
