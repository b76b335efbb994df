//! A set of points: one bit each.

/// A set of points of a study, in as many bits as the study has points.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct PointSet {
    words: Vec<u64>,
    count: usize,
}

impl PointSet {
    /// No points of so many.
    pub(crate) fn none_of(points: usize) -> Self {
        Self { words: vec![0; points.div_ceil(64)], count: 0 }
    }

    /// Whether a point is in the set.
    pub(crate) fn has(&self, point: usize) -> bool {
        self.words.get(point / 64).is_some_and(|word| word >> (point % 64) & 1 == 1)
    }

    /// Adds a point.
    pub(crate) fn insert(&mut self, point: usize) {
        if !self.has(point) {
            self.words[point / 64] |= 1 << (point % 64);
            self.count += 1;
        }
    }

    /// How many points are in the set.
    pub(crate) fn len(&self) -> usize {
        self.count
    }
}
