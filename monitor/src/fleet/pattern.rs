//! Names of several sessions at once.

use std::str::FromStr;

use mtj_protocol::bus::BusError;

/// A session's name in which `*` stands for anything.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern(String);

impl Pattern {
    /// Whether a name means several sessions.
    pub fn is_one(name: &str) -> bool {
        name.contains('*')
    }

    /// Whether it means this session.
    pub fn matches(&self, name: &str) -> bool {
        let mut parts = self.0.split('*');
        let Some(mut rest) = name.strip_prefix(parts.next().unwrap_or_default()) else {
            return false;
        };
        let Some(end) = parts.next_back() else { return rest.is_empty() };
        // The first place that fits leaves most for the parts behind it.
        for part in parts {
            let Some(place) = rest.find(part) else { return false };
            rest = &rest[place + part.len()..];
        }
        rest.ends_with(end)
    }

    /// As it was written.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for Pattern {
    type Err = BusError;

    fn from_str(text: &str) -> Result<Self, BusError> {
        let fits = |c: char| c.is_ascii_alphanumeric() || "-_*".contains(c);
        if text.chars().all(fits) {
            return Ok(Self(text.to_owned()));
        }
        Err(BusError::Settings(format!(
            "--session {text}: expected letters, digits, '-' and '_', and '*' for any of them, like 'cell-*'"
        ).into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_anything_even_nothing() {
        for (pattern, name, expected) in [
            ("*", "default", true),
            ("cell-*", "cell-7", true),
            ("cell-*", "cell-", true),
            ("cell-*", "well-7", false),
            ("*-7", "cell-7", true),
            ("*-7", "cell-77", false),
            ("a*a", "a", false),
            ("a*a", "aa", true),
            ("a*b*b", "axbb", true),
            ("a*b*b", "axb", false),
            ("*-*-*", "cell-1-left", true),
            ("*-*-*", "cell-1", false),
            ("cell", "cell", true),
            ("cell", "cell-1", false),
        ] {
            let found = pattern.parse::<Pattern>().map(|pattern| pattern.matches(name));
            assert_eq!(found.unwrap(), expected, "{pattern} {name}");
        }
    }

    #[test]
    fn what_no_session_can_be_called_is_refused() {
        assert!("a/*".parse::<Pattern>().is_err() && "**/x".parse::<Pattern>().is_err());
    }
}
