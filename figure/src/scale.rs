//! An axis of cells: each position of a study has one cell, and numbers between positions have a
//! place between cells.

/// Positions in a row, with what is needed to label them.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// Quantity and unit.
    pub title: String,
    /// A label for each position.
    pub labels: Vec<String>,
    /// The position's number, where it is one, in the unit of the labels.
    pub numbers: Vec<Option<f64>>,
    /// Whether numbers between positions are placed by their logarithm.
    pub is_logarithmic: bool,
}

impl Scale {
    /// How many cells there are.
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// Whether the first cell stands apart: a zero on a logarithmic axis, or a name before numbers.
    pub fn is_first_apart(&self) -> bool {
        let is_zero = self.is_logarithmic && self.numbers.first() == Some(&Some(0.0));
        let is_name = self.numbers.first() == Some(&None);
        let numbered = self.numbers.get(1).is_some_and(Option::is_some);
        (is_zero || is_name) && numbered
    }

    /// The place of a number in cells: a whole number at the middle of a cell. Beyond the ends the
    /// last two cells are continued.
    pub fn place(&self, number: f64) -> Option<f64> {
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

    /// Labels with their places, the more important first.
    pub fn ticks(&self) -> Vec<(f64, String)> {
        const FEW: usize = 13;
        if !self.is_logarithmic || self.len() <= FEW {
            return self.labels.iter().cloned().enumerate().map(|(i, l)| (i as f64, l)).collect();
        }
        let mut ticks: Vec<(f64, String)> = Vec::new();
        for (i, label) in self.labels.iter().enumerate() {
            if self.numbers[i].is_none_or(|number| number <= 0.0) {
                ticks.push((i as f64, label.clone()));
            }
        }
        let positive = || self.numbers.iter().flatten().copied().filter(|number| *number > 0.0);
        let (least, most) = (positive().fold(f64::MAX, f64::min), positive().fold(0.0, f64::max));
        for digit in [1.0, 2.0, 5.0] {
            for exponent in -9..10 {
                let number = digit * 10f64.powi(exponent);
                let is_inside = number >= least * (1.0 - 1e-9) && number <= most * (1.0 + 1e-9);
                if let Some(place) = self.place(number).filter(|_| is_inside) {
                    ticks.push((place, short(number)));
                }
            }
        }
        ticks
    }
}

/// A number to three significant digits, without trailing zeros.
pub fn short(number: f64) -> String {
    if number == 0.0 || !number.is_finite() {
        return if number == 0.0 { "0".to_owned() } else { "∞".to_owned() };
    }
    let digits = (2 - number.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{number:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(numbers: &[f64]) -> Scale {
        Scale {
            title: String::new(),
            labels: numbers.iter().map(|number| short(*number)).collect(),
            numbers: numbers.iter().copied().map(Some).collect(),
            is_logarithmic: true,
        }
    }

    #[test]
    fn a_number_between_two_positions_is_placed_by_its_logarithm() {
        let scale = scale(&[0.0, 1.0, 100.0]);
        assert_eq!(scale.place(10.0), Some(1.5));
        assert_eq!(scale.place(0.5), Some(0.5));
        assert!(scale.is_first_apart());
    }

    #[test]
    fn numbers_are_written_short() {
        assert_eq!([0.05, 1.0, 12.345, 1234.0].map(short), ["0.05", "1", "12.3", "1234"]);
    }
}
