//! The last ten minutes of all series, reduced without losing a peak.
//!
//! Run time is divided into bins of 10 ms. Each bin keeps the minimum and the maximum of each
//! series.

use std::collections::VecDeque;

/// The width of a bin, ns of run time.
pub(super) const WIDTH_NS: u64 = 10_000_000;
/// How many bins of run time are kept: ten minutes.
const KEPT: u64 = 60_000;

/// Minimum and maximum of a series in a bin; NaN without samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    /// The minimum.
    pub min: f32,
    /// The maximum.
    pub max: f32,
}

impl Range {
    const EMPTY: Self = Self { min: f32::NAN, max: f32::NAN };

    // `min` and `max` of a number and NaN give the number.
    fn add(&mut self, other: Self) {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
    }

    /// Whether there is no sample.
    pub(super) fn is_empty(self) -> bool {
        self.min.is_nan()
    }
}

/// All series over one bin's time.
#[derive(Clone, Debug)]
pub(super) struct Bin {
    /// Counted from the start of the run.
    pub number: u64,
    /// One range for each series.
    pub ranges: Box<[Range]>,
}

/// The bins of the last ten minutes of a run that have samples.
#[derive(Default)]
pub(super) struct History {
    series: usize,
    bins: VecDeque<Bin>,
}

impl History {
    /// An empty history of a number of series.
    pub(super) fn new(series: usize) -> Self {
        Self { series, bins: VecDeque::new() }
    }

    /// How many series there are.
    pub(super) fn series(&self) -> usize {
        self.series
    }

    /// Adds one sample of a series.
    pub(super) fn add(&mut self, time_ns: u64, series: usize, value: f64) {
        // Rounding is monotonic: the maximum stays the maximum.
        let value = value as f32;
        if let Some(bin) = self.bin(time_ns / WIDTH_NS) {
            bin.ranges[series].add(Range { min: value, max: value });
        }
    }

    /// The bin of a number; `None` if it is too old.
    fn bin(&mut self, number: u64) -> Option<&mut Bin> {
        let newest = self.bins.back().map(|bin| bin.number);
        if newest.is_some_and(|newest| newest >= number + KEPT) {
            return None;
        }
        let mut index = match newest {
            Some(newest) if newest == number => self.bins.len() - 1,
            Some(newest) if newest > number => self.index(number),
            _ => self.bins.len(),
        };
        if self.bins.get(index).is_none_or(|bin| bin.number != number) {
            let ranges = vec![Range::EMPTY; self.series].into();
            self.bins.insert(index, Bin { number, ranges });
        }
        while self.bins.front().is_some_and(|oldest| oldest.number + KEPT <= number) {
            self.bins.pop_front();
            index -= 1;
        }
        self.bins.get_mut(index)
    }

    /// The index of the first bin whose number is not below `number`.
    fn index(&self, number: u64) -> usize {
        self.bins.partition_point(|bin| bin.number < number)
    }

    /// The bins from number `from` up to and without `to`.
    pub(super) fn between(
        &self,
        from: u64,
        to: u64,
    ) -> impl ExactSizeIterator<Item = &Bin> + Clone {
        let end = self.index(to);
        self.bins.range(self.index(from).min(end)..end)
    }
}

/// Merges each `span` neighbouring bins, counted from `first`, into one.
pub(super) fn merge(bins: impl Iterator<Item = Bin>, first: u64, span: u64) -> Vec<Bin> {
    let mut merged: Vec<Bin> = Vec::new();
    for bin in bins {
        let number = first + bin.number.saturating_sub(first) / span * span;
        match merged.last_mut().filter(|last| last.number == number) {
            None => merged.push(Bin { number, ..bin }),
            Some(last) => {
                for (range, more) in last.ranges.iter_mut().zip(&bin.ranges) {
                    range.add(*more);
                }
            }
        }
    }
    merged
}

#[cfg(test)]
mod tests {
    use rand_pcg::{
        Pcg32,
        rand_core::{Rng, SeedableRng},
    };

    use super::*;

    fn extremes(samples: &[(u64, f64)], from_ns: u64, to_ns: u64) -> Option<(f32, f32)> {
        let inside = samples.iter().filter(|(time, _)| (from_ns..to_ns).contains(time));
        let values: Vec<f64> = inside.map(|(_, value)| *value).collect();
        let min = values.iter().copied().reduce(f64::min)?;
        let max = values.iter().copied().reduce(f64::max)?;
        Some((min as f32, max as f32))
    }

    /// Noise with rare peaks at 10 kHz, with a few samples out of order.
    fn samples(seed: u64) -> Vec<(u64, f64)> {
        let mut random = Pcg32::seed_from_u64(seed);
        let mut samples: Vec<(u64, f64)> = (0..20_000)
            .map(|k| {
                let noise = f64::from(random.next_u32()) / f64::from(u32::MAX) - 0.5;
                let peak = if random.next_u32() % 997 == 0 { 1e3 * noise } else { noise };
                (k * 100_000 + u64::from(random.next_u32() % 50_000), peak)
            })
            .collect();
        for _ in 0..500 {
            let k = random.next_u32() as usize % (samples.len() - 300);
            samples.swap(k, k + 1 + random.next_u32() as usize % 299);
        }
        samples
    }

    #[test]
    fn binning_at_10_khz_keeps_every_peak() {
        for seed in 1..6 {
            let samples = samples(seed);
            let mut history = History::new(5);
            for (time, value) in &samples {
                history.add(*time, 3, *value);
            }
            assert_eq!(history.between(0, u64::MAX).len(), 200);
            for bin in history.between(0, u64::MAX) {
                let from = bin.number * WIDTH_NS;
                let found = (bin.ranges[3].min, bin.ranges[3].max);
                assert_eq!(extremes(&samples, from, from + WIDTH_NS), Some(found), "seed {seed}");
                assert!(bin.ranges[4].is_empty());
            }
        }
    }

    #[test]
    fn merging_neighbours_keeps_every_peak() {
        let samples = samples(7);
        let mut history = History::new(5);
        for (time, value) in &samples {
            history.add(*time, 0, *value);
        }
        for span in [1, 2, 7, 60, 1000] {
            let merged = merge(history.between(3, 190).cloned(), 3, span);
            assert_eq!(merged.len() as u64, 187_u64.div_ceil(span));
            for bin in merged {
                let (from, to) = (bin.number, (bin.number + span).min(190));
                let found = (bin.ranges[0].min, bin.ranges[0].max);
                assert_eq!(extremes(&samples, from * WIDTH_NS, to * WIDTH_NS), Some(found));
            }
        }
    }

    #[test]
    fn ten_minutes_are_kept_and_no_more() {
        let mut history = History::new(5);
        for second in 0..3000 {
            history.add(second * 1_000_000_000, 0, second as f64);
        }
        let kept: Vec<u64> = history.between(0, u64::MAX).map(|bin| bin.number).collect();
        assert_eq!((kept.len(), kept[0], kept[599]), (600, 240_000, 299_900));
        history.add(0, 0, 1.0);
        assert_eq!(history.between(0, u64::MAX).len(), 600, "a sample that is too old is not kept");
        history.add(2_999_000_000_000 + 3_600_000_000_000, 0, 1.0);
        assert_eq!(history.between(0, u64::MAX).len(), 1, "a jump of time leaves no old bins");
    }
}
