//! The declaration of a key: what the reader accepts, and what reference and displays say about it.

use std::time::Duration;

use toml::Value;

use super::duration;

/// A key of a scenario, declared once for the reader, the reference and the displays.
#[derive(Debug, PartialEq)]
pub struct Parameter {
    /// The dotted path, like `law.factor.error`; `[]` is any entry of a list, `*` either direction.
    pub key: &'static str,
    /// The label of a control; empty if no display has one.
    pub label: &'static str,
    /// What values look like.
    pub form: Form,
    /// The unit of a number; empty for a pure number.
    pub unit: &'static str,
    /// What is in effect where the key is absent.
    pub default: Default,
    /// What it does, in one sentence.
    pub help: &'static str,
}

/// What the values of a key look like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// One of a few words.
    Choice(&'static [&'static str]),
    /// True or false.
    Flag,
    /// One number.
    Number(Range),
    /// A whole number, 0 or more.
    Whole,
    /// One number for all task axes, or a list with one for each.
    List(Range),
    /// One number for all joints, or a list with one for each.
    JointList(Range),
    /// A list with a number for each joint.
    Joints,
    /// A list of two numbers, x and y.
    Point,
    /// One number, a list for a diagonal, or rows; positive definite.
    Matrix,
    /// The same, or one of a few words.
    MatrixOr(&'static [&'static str]),
    /// A duration, like "10 ms", and the shortest.
    Duration(Duration),
    /// A duration, or one of a few words.
    DurationOr(&'static [&'static str]),
    /// What these words say.
    Text(&'static str),
}

/// Which numbers are accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// All that are finite.
    Any,
    /// Those greater than zero.
    Positive,
    /// Zero and those greater.
    NotNegative,
    /// From zero to one.
    Fraction,
}

/// What is in effect where a key is absent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Default {
    /// Nothing: the key is required.
    Required,
    /// This TOML value.
    Value(&'static str),
    /// The value of another key.
    SameAs(&'static str),
    /// What these words say.
    Words(&'static str),
}

impl Parameter {
    /// A key that no display has a control for.
    pub(crate) const fn new(
        key: &'static str,
        form: Form,
        unit: &'static str,
        default: Default,
        help: &'static str,
    ) -> Self {
        Self { key, label: "", form, unit, default, help }
    }

    /// The last part of the path.
    pub fn name(&self) -> &'static str {
        self.key.rsplit('.').next().unwrap_or(self.key)
    }

    /// The declared default as a value, if it is one.
    pub(super) fn default_value(&self) -> Option<Value> {
        match self.default {
            Default::Value(text) => Some(literal(text)),
            _ => None,
        }
    }

    /// What an error says would be accepted; `count` is the number of joints or axes.
    pub(crate) fn expected(&self, count: usize) -> String {
        let unit = self.in_unit();
        match self.form {
            Form::Choice(words) => format!("one of {}", quoted(words).join(", ")),
            Form::Flag => "true or false".to_owned(),
            Form::Number(range) => format!("a number{unit}{}", range.words()),
            Form::Whole => "a whole number, 0 or more".to_owned(),
            Form::List(range) | Form::JointList(range) => {
                format!("a number{unit}{}, or a list of {count}", range.words())
            }
            Form::Joints => format!("a list of {count} numbers{unit}, one for each joint"),
            Form::Point => format!("a list of 2 numbers{unit}"),
            Form::Matrix | Form::MatrixOr(_) => {
                let words = if let Form::MatrixOr(words) = self.form { words } else { &[] };
                let or =
                    quoted(words).iter().map(|word| format!("; or {word}")).collect::<String>();
                format!(
                    "a positive definite matrix{unit}: one number, a list of {count} for a \
                     diagonal, or {count} rows of {count}{or}"
                )
            }
            Form::Duration(least) => {
                format!("{}, at least {}", duration::FORM, duration::format(least))
            }
            Form::DurationOr(words) => {
                format!("{} or {}", quoted(words).join(", "), duration::FORM)
            }
            Form::Text(syntax) => syntax.to_owned(),
        }
    }

    /// What values look like, for a table of the reference.
    pub fn syntax(&self) -> String {
        let or = |words: &[&str]| format!(" or {}", quoted(words).join(" or "));
        match self.form {
            Form::Choice(words) => quoted(words).join(", "),
            Form::Flag => "true, false".to_owned(),
            Form::Number(range) => format!("number{}", range.words()),
            Form::Whole => "whole number, 0 or more".to_owned(),
            Form::List(range) => format!("number{}, or one for each axis", range.words()),
            Form::JointList(range) => format!("number{}, or one for each joint", range.words()),
            Form::Joints => "a number for each joint".to_owned(),
            Form::Point => "[x, y]".to_owned(),
            Form::Matrix => "matrix".to_owned(),
            Form::MatrixOr(words) => format!("matrix{}", or(words)),
            Form::Duration(least) if least.is_zero() => "duration".to_owned(),
            Form::Duration(least) => format!("duration, at least {}", duration::format(least)),
            Form::DurationOr(words) => format!("duration{}", or(words)),
            Form::Text(syntax) => syntax.to_owned(),
        }
    }

    fn in_unit(&self) -> String {
        if self.unit.is_empty() { String::new() } else { format!(" in {}", self.unit) }
    }
}

impl Range {
    /// Whether a finite number is accepted.
    pub(super) fn accepts(self, number: f64) -> bool {
        match self {
            Self::Any => true,
            Self::Positive => number > 0.0,
            Self::NotNegative => number >= 0.0,
            Self::Fraction => (0.0..=1.0).contains(&number),
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Any => "",
            Self::Positive => " greater than 0",
            Self::NotNegative => ", 0 or more",
            Self::Fraction => " from 0 to 1",
        }
    }
}

/// The value of a declared default: a word, a flag, a number or a list of numbers.
///
/// Every scenario of a study reads its defaults, so this does not go through the TOML reader.
pub(super) fn literal(text: &'static str) -> Value {
    if let Some(word) = text.strip_prefix('"').and_then(|text| text.strip_suffix('"')) {
        return Value::String(word.to_owned());
    }
    if let Some(list) = text.strip_prefix('[').and_then(|text| text.strip_suffix(']')) {
        return Value::Array(list.split(", ").map(literal).collect());
    }
    if let Ok(flag) = text.parse() {
        return Value::Boolean(flag);
    }
    text.parse().map_or_else(|_| Value::Float(text.parse().unwrap_or(f64::NAN)), Value::Integer)
}

fn quoted(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| format!("\"{word}\"")).collect()
}
