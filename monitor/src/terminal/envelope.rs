//! One number over time, reduced without losing a peak.

use std::collections::VecDeque;

/// The width of a bin, s of the run's time.
const BIN: f64 = 0.01;
/// Added before rounding down, so that a whole number of bins stays in its own bin, bins.
const ROUNDING: f64 = 1e-6;
/// The number of bins: five minutes.
const BINS: usize = 30_000;

/// Minimum and maximum of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Range {
    pub min: f64,
    pub max: f64,
}

impl Range {
    fn of(value: f64) -> Self {
        Self { min: value, max: value }
    }

    fn join(&mut self, other: Self) {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
    }

    /// The largest magnitude.
    pub(super) fn peak(&self) -> f64 {
        self.max.max(-self.min)
    }
}

/// The last minutes of a number: minimum and maximum of each bin.
#[derive(Clone, Debug, Default)]
pub(super) struct Envelope {
    bins: VecDeque<(u64, Range)>,
}

impl Envelope {
    /// Adds a value at a time in s. A late value goes into the newest bin: a peak at the wrong time
    /// is better than a lost one.
    pub(super) fn push(&mut self, time: f64, value: f64) {
        if !value.is_finite() {
            return;
        }
        let bin = (time / BIN + ROUNDING) as u64;
        match self.bins.back_mut() {
            Some((newest, range)) if bin <= *newest => range.join(Range::of(value)),
            _ => {
                if self.bins.len() == BINS {
                    self.bins.pop_front();
                }
                self.bins.push_back((bin, Range::of(value)));
            }
        }
    }

    /// Minimum and maximum between two times.
    pub(super) fn range(&self, from: f64, to: f64) -> Option<Range> {
        self.between(from, to).map(|(_, range)| range).reduce(|mut all, range| {
            all.join(range);
            all
        })
    }

    /// A line through at most `columns` pairs of minimum and maximum between two times; interrupted
    /// where there is no value for longer than `gap`.
    pub(super) fn lines(
        &self,
        from: f64,
        to: f64,
        columns: usize,
        gap: f64,
    ) -> Vec<Vec<(f64, f64)>> {
        let width = ((to - from) / columns.max(1) as f64).max(BIN);
        let mut merged: Vec<(f64, Range)> = Vec::new();
        for (time, range) in self.between(from, to) {
            let column = from + ((time - from) / width + ROUNDING).floor() * width;
            match merged.last_mut() {
                Some((last, all)) if *last == column => all.join(range),
                _ => merged.push((column, range)),
            }
        }
        let mut lines: Vec<Vec<(f64, f64)>> = Vec::new();
        for (time, Range { min, max }) in merged {
            let last = lines.last().and_then(|line| line.last()).copied();
            // The nearer end first, so that the line does not zigzag.
            let (first, second) = match last {
                Some((_, value)) if (max - value).abs() < (min - value).abs() => (max, min),
                _ => (min, max),
            };
            let points = [(time, first), (time, second)];
            match (last, lines.last_mut()) {
                (Some((before, _)), Some(line)) if time - before <= gap.max(2.5 * width) => {
                    line.extend(points);
                }
                _ => lines.push(points.to_vec()),
            }
        }
        lines
    }

    fn between(&self, from: f64, to: f64) -> impl Iterator<Item = (f64, Range)> {
        let first = self.bins.partition_point(|(bin, _)| (*bin as f64) * BIN < from - BIN / 2.0);
        self.bins
            .range(first..)
            .map(|(bin, range)| (*bin as f64 * BIN, *range))
            .take_while(move |(time, _)| *time <= to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peak_of_one_sample_survives_any_reduction() {
        let mut envelope = Envelope::default();
        for sample in 0..600_000 {
            let value = if sample == 123_457 { 7.0 } else { 1.0 };
            envelope.push(f64::from(sample) * 1e-4, value);
        }
        for columns in [1, 10, 77, 240] {
            let lines = envelope.lines(0.0, 60.0, columns, 1.0);
            assert_eq!(lines.len(), 1, "nothing is missing, so there is one line");
            assert!(lines[0].len() <= 2 * columns + 2, "{} for {columns}", lines[0].len());
            let peaks: Vec<_> = lines[0].iter().filter(|(_, value)| *value == 7.0).collect();
            assert_eq!(peaks.len(), 1, "{columns} columns");
            assert!((peaks[0].0 - 12.3457).abs() <= 60.0 / columns as f64);
        }
        assert_eq!(envelope.range(0.0, 60.0), Some(Range { min: 1.0, max: 7.0 }));
        assert_eq!(envelope.range(13.0, 60.0), Some(Range { min: 1.0, max: 1.0 }));
    }

    #[test]
    fn an_envelope_is_bounded_and_keeps_the_newest() {
        let mut envelope = Envelope::default();
        for second in 0..1000 {
            for hundredth in 0..100 {
                envelope.push(f64::from(second) + 0.01 * f64::from(hundredth) + 0.005, 1.0);
            }
        }
        assert_eq!(envelope.bins.len(), BINS);
        assert!(envelope.range(0.0, 699.0).is_none());
        assert!(envelope.range(999.0, 1000.0).is_some());
    }

    #[test]
    fn a_gap_interrupts_the_line() {
        let mut envelope = Envelope::default();
        for (time, value) in [(1.0, 1.0), (1.01, 2.0), (5.0, 3.0), (5.01, 4.0)] {
            envelope.push(time, value);
        }
        let lines = envelope.lines(0.0, 10.0, 1000, 0.5);
        let values: Vec<Vec<f64>> = lines
            .iter()
            .map(|line| line.iter().step_by(2).map(|point| point.1).collect())
            .collect();
        assert_eq!(values, [[1.0, 2.0], [3.0, 4.0]]);
    }

    #[test]
    fn late_values_and_nan_do_no_harm() {
        let mut envelope = Envelope::default();
        envelope.push(2.0, 1.0);
        envelope.push(1.0, 9.0);
        envelope.push(2.0, f64::NAN);
        assert_eq!(envelope.range(0.0, 3.0), Some(Range { min: 1.0, max: 9.0 }));
    }
}
