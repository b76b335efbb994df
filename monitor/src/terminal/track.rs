//! One number over time, thinned without losing a peak.

use std::collections::VecDeque;

/// How long one bin is, s of the run's time.
const BIN: f64 = 0.01;
/// So that a time which is a whole number of bins does not fall short of its own.
const ROUNDING: f64 = 1e-6;
/// How many bins are kept: five minutes.
const BINS: usize = 30_000;

/// From the smallest to the largest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The smallest.
    pub min: f64,
    /// The largest.
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
    pub fn peak(&self) -> f64 {
        self.max.max(-self.min)
    }
}

/// The last minutes of a number: of what falls into one bin the smallest and the largest are kept.
#[derive(Clone, Debug, Default)]
pub struct Track {
    bins: VecDeque<(u64, Range)>,
}

impl Track {
    /// Takes in a value at a time in s. What comes late is counted to the newest bin: a peak in the
    /// wrong place is better than none.
    pub fn push(&mut self, time: f64, value: f64) {
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

    /// The smallest and the largest value between two times.
    pub fn range(&self, from: f64, to: f64) -> Option<Range> {
        self.between(from, to).map(|(_, range)| range).reduce(|mut all, range| {
            all.join(range);
            all
        })
    }

    /// A line through at most `columns` pairs of smallest and largest between two times; interrupted
    /// where there is nothing for longer than `gap`.
    pub fn lines(&self, from: f64, to: f64, columns: usize, gap: f64) -> Vec<Vec<(f64, f64)>> {
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
            // The nearer end first, so that the line does not go to and fro.
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
    fn a_peak_of_one_sample_survives_any_thinning() {
        let mut track = Track::default();
        for sample in 0..600_000 {
            let value = if sample == 123_457 { 7.0 } else { 1.0 };
            track.push(f64::from(sample) * 1e-4, value);
        }
        for columns in [1, 10, 77, 240] {
            let lines = track.lines(0.0, 60.0, columns, 1.0);
            assert_eq!(lines.len(), 1, "nothing is missing, so the line is one");
            assert!(lines[0].len() <= 2 * columns + 2, "{} for {columns}", lines[0].len());
            let peaks: Vec<_> = lines[0].iter().filter(|(_, value)| *value == 7.0).collect();
            assert_eq!(peaks.len(), 1, "{columns} columns");
            assert!((peaks[0].0 - 12.3457).abs() <= 60.0 / columns as f64);
        }
        assert_eq!(track.range(0.0, 60.0), Some(Range { min: 1.0, max: 7.0 }));
        assert_eq!(track.range(13.0, 60.0), Some(Range { min: 1.0, max: 1.0 }));
    }

    #[test]
    fn a_track_is_bounded_and_keeps_the_newest() {
        let mut track = Track::default();
        for second in 0..1000 {
            for hundredth in 0..100 {
                track.push(f64::from(second) + 0.01 * f64::from(hundredth) + 0.005, 1.0);
            }
        }
        assert_eq!(track.bins.len(), BINS);
        assert!(track.range(0.0, 699.0).is_none());
        assert!(track.range(999.0, 1000.0).is_some());
    }

    #[test]
    fn a_silence_interrupts_the_line() {
        let mut track = Track::default();
        for (time, value) in [(1.0, 1.0), (1.01, 2.0), (5.0, 3.0), (5.01, 4.0)] {
            track.push(time, value);
        }
        let lines = track.lines(0.0, 10.0, 1000, 0.5);
        let values: Vec<Vec<f64>> = lines
            .iter()
            .map(|line| line.iter().step_by(2).map(|point| point.1).collect())
            .collect();
        assert_eq!(values, [[1.0, 2.0], [3.0, 4.0]]);
    }

    #[test]
    fn what_is_late_or_not_a_number_does_no_harm() {
        let mut track = Track::default();
        track.push(2.0, 1.0);
        track.push(1.0, 9.0);
        track.push(2.0, f64::NAN);
        assert_eq!(track.range(0.0, 3.0), Some(Range { min: 1.0, max: 9.0 }));
    }
}
