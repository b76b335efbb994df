//! Reads declared keys: name, default, accepted values and error all come from the declaration.

use std::time::Duration;

use toml::Value;

use super::{
    duration,
    key::{Form, Parameter, Range},
    section::{self, Read, Section},
};

impl Section<'_> {
    /// A key's value, or its declared default, as `read` takes it; `None` if it has neither.
    ///
    /// `count` is the number of joints or task axes that a list is for.
    pub(crate) fn find<T>(
        &self,
        key: &Parameter,
        count: usize,
        read: impl Fn(&Value) -> Option<T>,
    ) -> Read<Option<T>> {
        let given = self.optional(key.name(), "", Some)?;
        let value = match given {
            Some(value) => read(value),
            None => match key.default_value() {
                Some(value) => read(&value),
                None => return Ok(None),
            },
        };
        value.map(Some).ok_or_else(|| self.refuse(key.name(), key.expected(count)))
    }

    /// The same for a key that has a value or a default, or else is missing.
    pub(crate) fn get<T>(
        &self,
        key: &Parameter,
        count: usize,
        read: impl Fn(&Value) -> Option<T>,
    ) -> Read<T> {
        let found = self.find(key, count, read)?;
        found.ok_or_else(|| self.refuse(key.name(), key.expected(count)))
    }

    /// Whether the key is there.
    pub(crate) fn has(&self, key: &Parameter) -> bool {
        self.table.contains_key(key.name())
    }

    /// A number.
    pub(crate) fn number(&self, key: &Parameter) -> Read<f64> {
        self.get(key, 1, |value| number(value, key))
    }

    /// A number, if the key is there.
    pub(crate) fn optional_number(&self, key: &Parameter) -> Read<Option<f64>> {
        self.find(key, 1, |value| number(value, key))
    }

    /// A list of `count` numbers, if the key is there or has a default.
    pub(crate) fn optional_list(&self, key: &Parameter, count: usize) -> Read<Option<Vec<f64>>> {
        self.find(key, count, |value| section::numbers(value, count))
    }

    /// A list of two numbers.
    pub(crate) fn point(&self, key: &Parameter) -> Read<[f64; 2]> {
        self.get(key, 2, |value| section::numbers(value, 2)?.try_into().ok())
    }

    /// One number for all, or a list of `count`; if the key is there or has a default.
    pub(crate) fn one_or_each(&self, key: &Parameter, count: usize) -> Read<Option<Vec<f64>>> {
        self.find(key, count, |value| match number(value, key) {
            Some(number) => Some(vec![number; count]),
            None => {
                let list = section::numbers(value, count)?;
                list.iter().all(|number| range(key).accepts(*number)).then_some(list)
            }
        })
    }

    /// True or false.
    pub(crate) fn flag(&self, key: &Parameter) -> Read<bool> {
        self.get(key, 1, Value::as_bool)
    }

    /// One of `values`, which are in the order of the key's words.
    pub(crate) fn word<T: Copy>(&self, key: &Parameter, values: &[T]) -> Read<T> {
        let found = self.optional_word(key, values)?;
        found.ok_or_else(|| self.refuse(key.name(), key.expected(1)))
    }

    /// The same, if the key is there or has a default.
    pub(crate) fn optional_word<T: Copy>(&self, key: &Parameter, values: &[T]) -> Read<Option<T>> {
        let words = if let Form::Choice(words) = key.form { words } else { &[] };
        debug_assert_eq!(words.len(), values.len(), "{}", key.key);
        self.find(key, 1, |value| {
            let word = value.as_str()?;
            let place = words.iter().position(|known| *known == word)?;
            values.get(place).copied()
        })
    }

    /// A duration, if the key is there or has a default.
    pub(crate) fn optional_duration(&self, key: &Parameter) -> Read<Option<Duration>> {
        let least = if let Form::Duration(least) = key.form { least } else { Duration::ZERO };
        self.find(key, 1, |value| duration::parse(value.as_str()?).filter(|found| *found >= least))
    }

    /// A duration.
    pub(crate) fn duration(&self, key: &Parameter) -> Read<Duration> {
        let found = self.optional_duration(key)?;
        found.ok_or_else(|| self.refuse(key.name(), key.expected(1)))
    }

    /// A text that `accept` likes, if the key is there or has a default.
    pub(crate) fn text(&self, key: &Parameter, accept: fn(&str) -> bool) -> Read<Option<String>> {
        self.find(key, 1, |value| value.as_str().filter(|text| accept(text)).map(str::to_owned))
    }
}

fn number(value: &Value, key: &Parameter) -> Option<f64> {
    section::number(value).filter(|number| range(key).accepts(*number))
}

fn range(key: &Parameter) -> Range {
    match key.form {
        Form::Number(range) | Form::List(range) | Form::JointList(range) => range,
        _ => Range::Any,
    }
}
