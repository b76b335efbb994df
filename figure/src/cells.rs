//! Figures over cells: an axis has a cell for each position, and a value belongs to a cell.

use super::axis::{self, Tick, short};

/// The value of one cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CellValue {
    /// One number or more.
    Known(Spread),
    /// The simulation ran away.
    Diverged,
    /// Nothing is known.
    Empty,
}

/// Median, least and greatest of some numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// The median.
    pub median: f64,
    /// The least.
    pub least: f64,
    /// The greatest.
    pub greatest: f64,
}

impl Spread {
    /// The spread of one number.
    pub fn of(number: f64) -> Self {
        Self { median: number, least: number, greatest: number }
    }

    /// The spread in another unit.
    pub fn times(self, factor: f64) -> Self {
        self.map(|number| number * factor)
    }

    pub(crate) fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self { median: f(self.median), least: f(self.least), greatest: f(self.greatest) }
    }
}

impl CellValue {
    pub(crate) fn spread(self) -> Option<Spread> {
        match self {
            Self::Known(spread) => Some(spread),
            Self::Diverged | Self::Empty => None,
        }
    }
}

/// An axis of cells, one for each position; numbers between positions have a place between cells.
#[derive(Clone, Debug, PartialEq)]
pub struct CellAxis {
    /// Quantity and unit.
    pub title: String,
    /// A label for each position.
    pub labels: Vec<String>,
    /// The position's number, where it is one, in the unit of the labels.
    pub numbers: Vec<Option<f64>>,
    /// Whether numbers between positions are placed by their logarithm.
    pub is_logarithmic: bool,
}

/// Space between the first cell and the others where the first is no number like them, pixels.
const GAP: f64 = 4.0;

impl CellAxis {
    /// An axis of numbers.
    pub fn of_numbers(title: &str, numbers: &[f64], is_logarithmic: bool) -> Self {
        Self {
            title: title.to_owned(),
            labels: numbers.iter().map(|number| short(*number)).collect(),
            numbers: numbers.iter().copied().map(Some).collect(),
            is_logarithmic,
        }
    }

    /// How many cells there are.
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// Whether there is a gap after the first cell: it is a zero on a logarithmic axis, or a name
    /// before numbers.
    fn has_gap_after_first(&self) -> bool {
        let is_zero = self.is_logarithmic && self.numbers.first() == Some(&Some(0.0));
        let is_name = self.numbers.first() == Some(&None);
        let numbered = self.numbers.get(1).is_some_and(Option::is_some);
        (is_zero || is_name) && numbered
    }

    /// The place of a number in cells: a whole number at the middle of a cell. Beyond the ends the
    /// last two cells are continued.
    pub(crate) fn place(&self, number: f64) -> Option<f64> {
        let known: Vec<(f64, f64)> = self
            .numbers
            .iter()
            .enumerate()
            .filter_map(|(i, at)| at.map(|at| (i as f64, at)))
            .collect();
        let pairs = known.windows(2);
        let pair = pairs.clone().find(|pair| number <= pair[1].1).or_else(|| pairs.last())?;
        let ((i, from), (j, to)) = (pair[0], pair[1]);
        let part = if self.is_logarithmic && from > 0.0 && number > 0.0 {
            (number / from).ln() / (to / from).ln()
        } else {
            (number - from) / (to - from)
        };
        Some(i + part * (j - i)).filter(|place| place.is_finite())
    }

    /// The distance of a place from the beginning of an axis that is `length` long.
    pub(crate) fn offset(&self, length: f64, place: f64) -> f64 {
        let gap = if self.has_gap_after_first() { GAP } else { 0.0 };
        (place + 0.5) * self.size(length) + gap * place.clamp(0.0, 1.0)
    }

    /// The size of a cell on an axis that is `length` long.
    pub(crate) fn size(&self, length: f64) -> f64 {
        let gap = if self.has_gap_after_first() { GAP } else { 0.0 };
        (length - gap) / self.len().max(1) as f64
    }

    /// A tick at each position where their labels have room, else at round numbers.
    pub(crate) fn ticks(&self, length: f64, room: impl Fn(&str) -> f64) -> Vec<Tick> {
        let positions = self.labels.iter().enumerate();
        let all: Vec<Tick> = positions
            .map(|(i, label)| Tick { at: self.offset(length, i as f64), label: label.clone() })
            .collect();
        let known = || self.numbers.iter().flatten().copied();
        let is_between = |number: &f64| *number > 0.0 || !self.is_logarithmic;
        let least = known().filter(is_between).fold(f64::MAX, f64::min);
        let most = known().filter(is_between).fold(f64::MIN, f64::max);
        if axis::fit(&all, &room) || least >= most {
            return axis::with_room(all, room);
        }
        let place = |number| Some(self.offset(length, self.place(number)?));
        let ticks = if self.is_logarithmic {
            axis::logarithmic(&(least..most), place, &room)
        } else {
            axis::linear(&(least..most), place, &room)
        };
        // Zero and names have no place among the others.
        let others = all.into_iter().zip(&self.numbers);
        let others = others.filter(|(_, number)| !number.is_some_and(|number| is_between(&number)));
        axis::with_room(others.map(|(tick, _)| tick).chain(ticks), room)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_between_two_positions_is_placed_by_its_logarithm() {
        let axis = CellAxis::of_numbers("", &[0.0, 1.0, 100.0], true);
        assert_eq!(axis.place(10.0), Some(1.5));
        assert_eq!(axis.place(0.5), Some(0.5));
        assert!(axis.has_gap_after_first());
    }

    #[test]
    fn ticks_stand_at_every_position_if_there_is_room_and_else_at_round_numbers() {
        let numbers: Vec<f64> = (3..=38).map(f64::from).collect();
        let axis = CellAxis::of_numbers("", &numbers, false);
        assert_eq!(axis.ticks(1000.0, |_| 20.0).len(), numbers.len());
        let ticks = axis.ticks(200.0, |_| 30.0);
        let labels: Vec<_> = ticks.iter().map(|tick| tick.label.as_str()).collect();
        assert_eq!(labels, ["10", "20", "30"], "not 3, 8, 13");
        assert_eq!(ticks[0].at, axis.offset(200.0, 7.0), "where the position 10 is");
    }

    #[test]
    fn a_name_before_numbers_keeps_its_tick() {
        let mut axis = CellAxis::of_numbers("", &(0..40).map(f64::from).collect::<Vec<_>>(), false);
        axis.labels.insert(0, "measured".to_owned());
        axis.numbers.insert(0, None);
        let ticks = axis.ticks(200.0, |_| 30.0);
        assert_eq!(ticks[0].label, "measured");
        assert_eq!(ticks[1].label, "10", "0 would be too near");
    }
}
