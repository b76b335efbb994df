//! Ticks at round numbers, as close as their labels allow.

use std::ops::Range;

/// A tick and its label.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    /// Distance from the beginning of the axis, pixels.
    pub(crate) at: f64,
    pub(crate) label: String,
}

/// More ticks than any axis has room for.
const MOST: f64 = 60.0;

/// Ticks at all multiples in `range` of the smallest step 1, 2 or 5 × 10ⁿ whose labels have room.
pub(crate) fn linear(
    range: &Range<f64>,
    place: impl Fn(f64) -> Option<f64>,
    room: impl Fn(&str) -> f64,
) -> Vec<Tick> {
    let span = range.end - range.start;
    if !(span.is_finite() && span > 0.0) {
        return Vec::new();
    }
    let least = (span / MOST).log10().ceil() as i32;
    let steps = (least..least + 4).flat_map(|exponent| [1.0, 2.0, 5.0].map(|d| (d, exponent)));
    for (digit, exponent) in steps {
        let step = digit * 10f64.powi(exponent);
        // Rounding must not lose a tick at an end.
        let (first, last) = (range.start / step - 1e-9, range.end / step + 1e-9);
        let multiples = first.ceil() as i64..=last.floor() as i64;
        let ticks: Vec<Tick> = multiples
            .filter_map(|k| {
                let number = k as f64 * step;
                Some(Tick { at: place(number)?, label: rounded(number, (-exponent).max(0)) })
            })
            .collect();
        if fit(&ticks, &room) {
            return ticks;
        }
    }
    Vec::new()
}

/// Ticks at 1, 2 and 5 × 10ⁿ, or at powers of ten only, as their labels have room; at multiples of
/// a step where there is less than a decade.
pub(crate) fn logarithmic(
    range: &Range<f64>,
    place: impl Fn(f64) -> Option<f64>,
    room: impl Fn(&str) -> f64,
) -> Vec<Tick> {
    let is_inside = |x: &f64| *x >= range.start * (1.0 - 1e-9) && *x <= range.end * (1.0 + 1e-9);
    let at = |digits: &'static [f64]| -> Vec<Tick> {
        (-12..=12)
            .flat_map(|exponent| digits.iter().map(move |digit| digit * 10f64.powi(exponent)))
            .filter(is_inside)
            .filter_map(|number| Some(Tick { at: place(number)?, label: short(number) }))
            .collect()
    };
    let fine = at(&[1.0, 2.0, 5.0]);
    if fine.len() < 2 {
        linear(range, place, room)
    } else if fit(&fine, &room) {
        fine
    } else {
        with_room(at(&[1.0]), room)
    }
}

/// Those ticks that leave room for the ones before them.
pub(crate) fn with_room(
    ticks: impl IntoIterator<Item = Tick>,
    room: impl Fn(&str) -> f64,
) -> Vec<Tick> {
    let mut kept: Vec<Tick> = Vec::new();
    for tick in ticks {
        let needed = room(&tick.label);
        if kept.iter().all(|other| (other.at - tick.at).abs() >= needed.max(room(&other.label))) {
            kept.push(tick);
        }
    }
    kept
}

/// Whether all ticks, in order, have the room that their labels need.
pub(crate) fn fit(ticks: &[Tick], room: impl Fn(&str) -> f64) -> bool {
    ticks.windows(2).all(|pair| {
        (pair[1].at - pair[0].at).abs() >= room(&pair[0].label).max(room(&pair[1].label))
    })
}

/// A number with so many decimals and a true minus sign.
fn rounded(number: f64, decimals: i32) -> String {
    let text = format!("{:.*}", decimals as usize, number.abs());
    if number < 0.0 && text.contains(|c: char| ('1'..='9').contains(&c)) {
        format!("−{text}")
    } else {
        text
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

    fn labels(ticks: &[Tick]) -> Vec<&str> {
        ticks.iter().map(|tick| tick.label.as_str()).collect()
    }

    #[test]
    fn linear_ticks_are_multiples_of_1_2_or_5() {
        let ticks = |range: Range<f64>, length: f64| {
            let scale = length / (range.end - range.start);
            linear(&range, |x| Some((x - range.start) * scale), |_| 40.0)
        };
        assert_eq!(labels(&ticks(3.0..38.0, 200.0)), ["10", "20", "30"]);
        assert_eq!(labels(&ticks(3.0..38.0, 320.0)), ["5", "10", "15", "20", "25", "30", "35"]);
        assert_eq!(labels(&ticks(-0.3..0.3, 200.0)), ["−0.2", "0.0", "0.2"]);
        assert_eq!(labels(&ticks(0.0..20.0, 400.0)).len(), 11);
        assert_eq!(ticks(1.0..1.0, 200.0), []);
    }

    #[test]
    fn logarithmic_ticks_are_the_same_in_every_decade_and_multiples_within_one() {
        let ticks = |range: Range<f64>, length: f64| {
            let scale = length / (range.end / range.start).ln();
            logarithmic(&range, |x| Some((x / range.start).ln() * scale), |_| 26.0)
        };
        assert_eq!(labels(&ticks(0.5..200.0, 100.0)), ["1", "10", "100"]);
        assert_eq!(labels(&ticks(0.5..200.0, 60.0)), ["1", "100"]);
        assert_eq!(labels(&ticks(0.5..20.0, 200.0)), ["0.5", "1", "2", "5", "10", "20"]);
        assert_eq!(labels(&ticks(11.0..19.0, 200.0)), ["12", "14", "16", "18"]);
    }

    #[test]
    fn numbers_are_written_short() {
        assert_eq!([0.05, 1.0, 12.345, 1234.0].map(short), ["0.05", "1", "12.3", "1234"]);
    }
}
