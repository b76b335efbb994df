//! Durations as people write them: a number and a unit, "10 ms".

use std::time::Duration;

/// Accepted units, shortest first, with their length in nanoseconds.
const UNITS: [(&str, f64); 8] = [
    ("ns", 1.0),
    ("us", 1e3),
    ("µs", 1e3),
    ("ms", 1e6),
    ("s", 1e9),
    ("min", 60e9),
    ("h", 3600e9),
    ("d", 86400e9),
];

/// What a duration must look like, for error messages.
pub const FORM: &str = "a number with a unit ns, us, ms, s, min, h or d, like \"10 ms\"";

/// Reads a duration, rounded to whole nanoseconds; `None` if it is not of the [`FORM`].
pub fn parse(text: &str) -> Option<Duration> {
    let text = text.trim();
    let split = text.find(|c: char| c.is_alphabetic() && c != 'e' && c != 'E')?;
    let (number, unit) = text.split_at(split);
    let number: f64 = number.trim().parse().ok()?;
    let nanoseconds = number * UNITS.iter().find(|(name, _)| *name == unit.trim())?.1;
    (0.0..1e18).contains(&nanoseconds).then(|| Duration::from_nanos(nanoseconds.round() as u64))
}

/// Writes a duration in the largest unit that keeps it a short number and is read back the same.
pub fn format(duration: Duration) -> String {
    let nanoseconds = duration.as_nanos() as f64;
    let unit = ["s", "ms", "us"].into_iter().find_map(|name| {
        let length = UNITS.iter().find(|(unit, _)| *unit == name)?.1;
        let comes_back = (nanoseconds / length * length).round() == nanoseconds;
        (nanoseconds >= length && comes_back).then_some((name, length))
    });
    match unit {
        Some((name, length)) => format!("{} {name}", nanoseconds / length),
        None if nanoseconds == 0.0 => "0 s".to_owned(),
        None => format!("{nanoseconds} ns"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_read_to_the_nanosecond() {
        for (text, nanoseconds) in [
            ("10 ms", 10_000_000),
            ("0.5ms", 500_000),
            ("1e3 us", 1_000_000),
            ("2 µs", 2_000),
            ("20 s", 20_000_000_000),
            ("1.5 min", 90_000_000_000),
            ("0 s", 0),
        ] {
            assert_eq!(parse(text), Some(Duration::from_nanos(nanoseconds)), "{text}");
        }
        for text in ["", "10", "ms", "-1 ms", "1 parsec", "nan s", "1e99 s", "1 m s"] {
            assert_eq!(parse(text), None, "{text}");
        }
    }

    #[test]
    fn durations_written_are_read_back() {
        for nanoseconds in [
            0,
            7,
            1_500,
            500_000,
            10_000_000,
            20_000_000_000,
            // So long that a nanosecond is all that a float tells apart, or less.
            10_800_000_000_000_002,
            123_456_789_012_345_680,
        ] {
            let duration = Duration::from_nanos(nanoseconds);
            assert_eq!(parse(&format(duration)), Some(duration));
        }
    }
}
