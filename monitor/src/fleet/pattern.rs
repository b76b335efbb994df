//! Patterns that match the names of several sessions.

use std::str::FromStr;

use crate::error::MonitorError;

/// A session name in which `*` matches any text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern(String);

/// A pattern holds a character that no session name may have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "--session {text}: expected letters, digits, '-' and '_', and '*' for any of them, like 'cell-*'"
)]
pub struct PatternError {
    text: String,
}

impl From<PatternError> for MonitorError {
    fn from(error: PatternError) -> Self {
        Self::of(error, true)
    }
}

impl Pattern {
    /// Whether a session name is a pattern.
    pub fn is_pattern(name: &str) -> bool {
        name.contains('*')
    }

    /// Whether the pattern matches this name.
    pub fn matches(&self, name: &str) -> bool {
        let mut parts = self.0.split('*');
        let Some(mut rest) = name.strip_prefix(parts.next().unwrap_or_default()) else {
            return false;
        };
        let Some(end) = parts.next_back() else { return rest.is_empty() };
        // The first occurrence leaves the longest rest for the following parts.
        for part in parts {
            let Some(index) = rest.find(part) else { return false };
            rest = &rest[index + part.len()..];
        }
        rest.ends_with(end)
    }

    /// The pattern as it was written.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for Pattern {
    type Err = PatternError;

    fn from_str(text: &str) -> Result<Self, PatternError> {
        let is_allowed = |c: char| c.is_ascii_alphanumeric() || "-_*".contains(c);
        if text.chars().all(is_allowed) {
            return Ok(Self(text.to_owned()));
        }
        Err(PatternError { text: text.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_matches_any_text_even_none() {
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
    fn a_pattern_with_a_character_no_name_may_have_is_refused() {
        assert!("a/*".parse::<Pattern>().is_err() && "**/x".parse::<Pattern>().is_err());
    }
}
