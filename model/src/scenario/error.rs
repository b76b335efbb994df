//! Why a scenario is not accepted.

use std::{io, sync::Arc};

/// Why a scenario, or a key set over it, is not accepted.
///
/// Every sentence names where the value came from, the key, the value, and what would be accepted.
/// All of these are bad input: a program ends with exit status 2.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ScenarioError {
    /// A name is neither built in nor a file that can be read.
    #[error(
        "--scenario: there is no built-in scenario '{name}' and the file could not be read \
         ({source}); 'mtj scenario list' prints the built-in names"
    )]
    NotFound {
        /// What was asked for.
        name: Box<str>,
        /// Why it is no file either.
        source: Arc<io::Error>,
    },
    /// The text is not TOML.
    #[error("{origin}: line {line} is not TOML: {reason}")]
    Syntax {
        /// The file or the built-in scenario.
        origin: Box<str>,
        /// The line, from 1.
        line: usize,
        /// What the TOML reader says, in one line.
        reason: Box<str>,
    },
    /// The text as a whole is not accepted.
    #[error("{origin}: {expected}")]
    Text {
        /// The file.
        origin: Box<str>,
        /// What would be accepted.
        expected: Box<str>,
    },
    /// A key must be there.
    #[error("{origin}: {key} is missing: expected {expected}")]
    Missing {
        /// The file or the built-in scenario.
        origin: Box<str>,
        /// Dotted path of the key.
        key: Box<str>,
        /// What would be accepted.
        expected: Box<str>,
    },
    /// A key has a value that is not accepted.
    #[error("{origin}: {key} = {value} is not accepted: expected {expected}")]
    Refused {
        /// The file, the built-in scenario or the option that the value came from.
        origin: Box<str>,
        /// Dotted path of the key.
        key: Box<str>,
        /// The value as written.
        value: Box<str>,
        /// What would be accepted.
        expected: Box<str>,
    },
    /// There is no key of this name.
    #[error(
        "{origin}: {key} = {value} is not accepted: expected one of the known keys {known} (there \
         is no key '{name}' here)"
    )]
    UnknownKey {
        /// The file, the built-in scenario or the option that the key came from.
        origin: Box<str>,
        /// Dotted path of the key.
        key: Box<str>,
        /// Its last part.
        name: Box<str>,
        /// The value as written.
        value: Box<str>,
        /// The keys that the table may have.
        known: Box<str>,
    },
    /// An override is not an assignment.
    #[error("--set {text}: expected KEY=VALUE, like law.memory.policy=delivered")]
    Assignment {
        /// The override as written.
        text: Box<str>,
    },
    /// An override reaches into something that is not there.
    #[error(
        "--set: {key} = {value} is not accepted: expected the path of a key; one of its parts is \
         not a table, or not a list that long"
    )]
    NoPlace {
        /// Dotted path of the key.
        key: Box<str>,
        /// The value as written.
        value: Box<str>,
    },
    /// A running loop cannot change this key.
    #[error(
        "--set: {key} = {value} is not accepted: expected a key that a running loop can change \
         ({live}); for others start the plant anew"
    )]
    NotLive {
        /// Dotted path of the key.
        key: Box<str>,
        /// The value as written.
        value: Box<str>,
        /// What a running loop can change.
        live: Box<str>,
    },
}

impl ScenarioError {
    /// The key whose value is not accepted, if a value is to blame.
    pub fn refused_key(&self) -> Option<&str> {
        match self {
            Self::Refused { key, .. } | Self::UnknownKey { key, .. } => Some(key),
            _ => None,
        }
    }
}

/// Errors are equal if they say the same.
impl PartialEq for ScenarioError {
    fn eq(&self, other: &Self) -> bool {
        self.to_string() == other.to_string()
    }
}
