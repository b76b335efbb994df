//! Reads one TOML table; its errors name file, key, value and remedy.

use std::{cell::RefCell, fmt, path::Path, sync::LazyLock};

use toml::{Table, Value};

use super::{builtin::built_in, error::ScenarioError};

/// Where values came from: a named text, and the keys that the command line set over it.
#[derive(Clone, Debug)]
pub struct Origin {
    name: String,
    overridden: Vec<String>,
}

impl Origin {
    /// A text called `name`, with the dotted keys in `overridden` set by `--set`.
    pub fn new(name: &str, overridden: Vec<String>) -> Self {
        Self { name: name.to_owned(), overridden }
    }

    fn of(&self, key: &str) -> String {
        let set = self.overridden.iter().any(|path| {
            key == path
                || key.strip_prefix(path.as_str()).is_some_and(|rest| rest.starts_with(['.', '[']))
        });
        if set { "--set".to_owned() } else { self.name.clone() }
    }

    /// Where an unknown key came from: a key that was set below it may have brought it in.
    fn of_unknown(&self, key: &str) -> String {
        let below =
            |path: &String| path.strip_prefix(key).is_some_and(|rest| rest.starts_with(['.', '[']));
        if self.overridden.iter().any(below) { "--set".to_owned() } else { self.of(key) }
    }

    /// The folder of the file that the text came from: where relative paths start. Empty, which is
    /// the working directory, if it is built in.
    pub(super) fn folder(&self) -> &Path {
        let file = if built_in(&self.name).is_none() { self.name.as_str() } else { "" };
        Path::new(file).parent().unwrap_or(Path::new(""))
    }

    /// An error about the text as a whole.
    pub fn refuse(&self, expected: impl fmt::Display) -> ScenarioError {
        ScenarioError::Text {
            origin: self.name.as_str().into(),
            expected: expected.to_string().into(),
        }
    }
}

/// One table of the document. Every key that is read becomes a known key; [`Section::finish`]
/// refuses all others.
#[derive(Debug)]
pub struct Section<'a> {
    origin: &'a Origin,
    path: String,
    pub(super) table: &'a Table,
    known: RefCell<Vec<String>>,
}

pub(super) type Read<T> = Result<T, ScenarioError>;

impl<'a> Section<'a> {
    /// The document's root table.
    pub fn root(origin: &'a Origin, table: &'a Table) -> Self {
        Self::new(origin, String::new(), table)
    }

    fn new(origin: &'a Origin, path: String, table: &'a Table) -> Self {
        Self { origin, path, table, known: RefCell::default() }
    }

    /// Refuses keys that were never read.
    pub fn finish(self) -> Read<()> {
        let known = self.known.borrow();
        match self.table.keys().find(|key| !known.contains(key)) {
            None => Ok(()),
            Some(unknown) => {
                let key = self.key(unknown);
                Err(ScenarioError::UnknownKey {
                    origin: self.origin.of_unknown(&key).into(),
                    key: key.into(),
                    name: unknown.as_str().into(),
                    value: short(&self.table[unknown]).into(),
                    known: known.join(", ").into(),
                })
            }
        }
    }

    /// An error about one key of this table.
    pub fn refuse(&self, key: &str, expected: impl fmt::Display) -> ScenarioError {
        let (key, value) = (self.key(key), self.table.get(key).map(short));
        let (origin, expected) = (self.origin.of(&key), expected.to_string());
        match value {
            Some(value) => ScenarioError::Refused {
                origin: origin.into(),
                key: key.into(),
                value: value.into(),
                expected: expected.into(),
            },
            None => ScenarioError::Missing {
                origin: origin.into(),
                key: key.into(),
                expected: expected.into(),
            },
        }
    }

    /// The folder of the file that the text came from: where relative paths start.
    pub(super) fn folder(&self) -> &'a Path {
        self.origin.folder()
    }

    /// A table below this one, which must be there.
    pub fn section(&self, key: &str) -> Read<Section<'a>> {
        self.optional_section(key)?.ok_or_else(|| self.refuse(key, "a table"))
    }

    /// A table below this one; an absent one is empty.
    pub(crate) fn section_or_empty(&self, key: &str) -> Read<Section<'a>> {
        static EMPTY: LazyLock<Table> = LazyLock::new(Table::new);
        let found = self.optional_section(key)?;
        Ok(found.unwrap_or_else(|| Section::new(self.origin, self.key(key), &EMPTY)))
    }

    /// A table below this one, if it is there.
    pub fn optional_section(&self, key: &str) -> Read<Option<Section<'a>>> {
        self.optional(key, "a table", |value| {
            Some(Section::new(self.origin, self.key(key), value.as_table()?))
        })
    }

    /// An array of tables.
    pub fn sections(&self, key: &str, expected: &str) -> Read<Vec<Section<'a>>> {
        self.required(key, expected, |value| self.tables(key, value))
    }

    /// The same, empty if it is not there.
    pub fn optional_sections(&self, key: &str, expected: &str) -> Read<Vec<Section<'a>>> {
        let found = self.optional(key, expected, |value| self.tables(key, value))?;
        Ok(found.unwrap_or_default())
    }

    fn tables(&self, key: &str, value: &'a Value) -> Option<Vec<Section<'a>>> {
        let tables = value.as_array()?.iter().enumerate().map(|(i, value)| {
            Some(Section::new(self.origin, format!("{}[{i}]", self.key(key)), value.as_table()?))
        });
        tables.collect()
    }

    /// A value that `read` accepts; it must be there.
    pub fn required<T>(
        &self,
        key: &str,
        expected: &str,
        read: impl FnOnce(&'a Value) -> Option<T>,
    ) -> Read<T> {
        self.optional(key, expected, read)?.ok_or_else(|| self.refuse(key, expected))
    }

    /// A value that `read` accepts, or nothing.
    pub fn optional<T>(
        &self,
        key: &str,
        expected: &str,
        read: impl FnOnce(&'a Value) -> Option<T>,
    ) -> Read<Option<T>> {
        self.know(key);
        self.table
            .get(key)
            .map(|value| read(value).ok_or_else(|| self.refuse(key, expected)))
            .transpose()
    }

    /// One of a few named choices; `default` when the key is absent.
    pub fn choice<T: Copy>(&self, key: &str, choices: &[(&str, T)], default: Option<T>) -> Read<T> {
        let names: Vec<_> = choices.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        let expected = format!("one of {}", names.join(", "));
        let chosen = self.optional(key, &expected, |value| {
            let text = value.as_str()?;
            choices.iter().find(|(name, _)| *name == text).map(|(_, choice)| *choice)
        })?;
        chosen.or(default).ok_or_else(|| self.refuse(key, expected))
    }

    /// Accepts a key without looking at its value.
    fn know(&self, key: &str) {
        let mut known = self.known.borrow_mut();
        if !known.iter().any(|other| other == key) {
            known.push(key.to_owned());
        }
    }

    fn key(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }
}

/// A finite number, whether written with a decimal point or not.
pub(crate) fn number(value: &Value) -> Option<f64> {
    let number = value.as_float().or_else(|| value.as_integer().map(|i| i as f64))?;
    number.is_finite().then_some(number)
}

/// Exactly `count` finite numbers.
pub(crate) fn numbers(value: &Value, count: usize) -> Option<Vec<f64>> {
    let list: Vec<_> = value.as_array()?.iter().map(number).collect::<Option<_>>()?;
    (list.len() == count).then_some(list)
}

/// A value in one line, cut where it would fill the screen.
fn short(value: &Value) -> String {
    let text = value.to_string().replace('\n', " ");
    if text.chars().count() <= 80 {
        text
    } else {
        text.chars().take(77).chain("...".chars()).collect()
    }
}
