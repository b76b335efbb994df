//! When a recording goes on in another file.

use std::{str::FromStr, time::Duration};

use mtj_model::scenario::duration;

use super::error::RecordingError;

/// Accepted units of a size with their length in bytes.
const UNITS: [(&str, f64); 4] = [("kB", 1e3), ("MB", 1e6), ("GB", 1e9), ("TB", 1e12)];
/// The smallest size of a file; a fraction of it are the schemas.
const SMALLEST: f64 = 1e5;
/// The shortest time in a file.
const SHORTEST: Duration = Duration::from_secs(1);

/// A file ends at the first limit that it reaches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SplitLimits {
    /// The size of a file, bytes.
    pub bytes: Option<u64>,
    /// The time from the first to the last message of a file.
    pub time: Option<Duration>,
}

impl FromStr for SplitLimits {
    type Err = RecordingError;

    /// Reads a size, a time, or both with a comma between them: "100MB,10min".
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let error = || RecordingError::Split { text: text.to_owned() };
        let mut limits = Self::default();
        for part in text.split(',') {
            let is_known = match (bytes(part), duration::parse(part)) {
                (Some(bytes), _) => limits.bytes.replace(bytes).is_some(),
                (_, Some(time)) if time >= SHORTEST => limits.time.replace(time).is_some(),
                _ => return Err(error()),
            };
            if is_known {
                return Err(error());
            }
        }
        Ok(limits)
    }
}

fn bytes(text: &str) -> Option<u64> {
    let text = text.trim();
    let (number, unit) = text.split_at(text.find(char::is_alphabetic)?);
    let number: f64 = number.trim().parse().ok()?;
    let bytes = number * UNITS.iter().find(|(name, _)| *name == unit)?.1;
    (SMALLEST..1e18).contains(&bytes).then_some(bytes as u64)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]

    use super::*;

    #[test]
    fn a_limit_is_a_size_or_a_time_or_both() {
        let minutes = |count: u64| Some(Duration::from_secs(60 * count));
        for (text, bytes, time) in [
            ("100MB", Some(100_000_000), None),
            ("0.1 MB", Some(100_000), None),
            ("10min", None, minutes(10)),
            ("1.5 GB, 1 h", Some(1_500_000_000), minutes(60)),
            ("1h,250kB", Some(250_000), minutes(60)),
        ] {
            assert_eq!(text.parse::<SplitLimits>().unwrap(), SplitLimits { bytes, time }, "{text}");
        }
        for text in
            ["", "100", "MB", "-1MB", "99kB", "1ms", "1MB,2MB", "1h,2h", "1MB,", "1Mb", "NaNMB"]
        {
            let sentence = text.parse::<SplitLimits>().unwrap_err().to_string();
            assert!(sentence.contains(&format!("'{text}'")), "{sentence}");
            assert!(sentence.contains("100MB,10min"), "{sentence}");
        }
    }
}
