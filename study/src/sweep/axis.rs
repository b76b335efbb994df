//! One axis of a study.

use mtj_model::scenario::{Override, ScenarioError, Section, duration};
use toml::{Table, Value};

/// A list of positions, each of which sets one or more keys of the scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Its name in tables and plots.
    pub name: String,
    /// The unit of its numbers: "s" for durations, nothing for plain numbers and names.
    pub unit: &'static str,
    /// Whether it is to be drawn on a logarithmic scale.
    pub is_logarithmic: bool,
    /// Its positions.
    pub positions: Vec<Position>,
}

/// One position of an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Position {
    /// Its label in tables: a number (durations in seconds), or a name.
    pub label: String,
    /// As a number, where it is one.
    pub number: Option<f64>,
    /// The keys that it sets.
    pub set: Vec<Override>,
}

/// More positions than an axis needs.
const MOST_POSITIONS: usize = 100_000;

impl Axis {
    /// Reads a table `{name, key, values | from, to, count, scale}` or `{name, variants}`.
    pub fn read(section: Section<'_>) -> Result<Self, ScenarioError> {
        let name = section.required("name", "a name for the axis", Value::as_str)?.to_owned();
        let key = section.optional("key", "the key of the scenario to vary", Value::as_str)?;
        let axis = match key {
            None => Self::of_variants(name, &section)?,
            Some(key) => Self::of_key(name, key, &section)?,
        };
        section.finish()?;
        Ok(axis)
    }

    fn of_variants(name: String, section: &Section<'_>) -> Result<Self, ScenarioError> {
        let variants =
            section.sections("variants", "a key to vary, or a list of variants {name, set}")?;
        let positions = variants
            .into_iter()
            .map(|variant| {
                let label = variant.required("name", "a name", Value::as_str)?.to_owned();
                let set = variant.required("set", "a table of keys and values", overrides)?;
                variant.finish()?;
                Ok(Position { label, number: None, set })
            })
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Self { name, unit: "", is_logarithmic: false, positions })
    }

    fn of_key(name: String, key: &str, section: &Section<'_>) -> Result<Self, ScenarioError> {
        let mut positions: Vec<Position> = section
            .optional("values", "a list of values", Value::as_array)?
            .into_iter()
            .flatten()
            .map(|value| Position::of_value(key, value.clone()))
            .collect();
        let scale = section.choice("scale", &[("linear", false), ("log", true)], Some(false))?;
        if let Some(from) = section.optional("from", "the first value of a range", Some)? {
            let to = section.required("to", "the last value of the range", Some)?;
            let expected = format!("how many values, 2 to {MOST_POSITIONS}");
            let count = section.required("count", &expected, |value| {
                let count = usize::try_from(value.as_integer()?).ok()?;
                (2..=MOST_POSITIONS).contains(&count).then_some(count)
            })?;
            positions.extend(Range::read(section, from, to, scale)?.positions(key, count));
        }
        if positions.is_empty() {
            return Err(section.refuse("values", "a list of values, or a range from, to, count"));
        }
        let is_duration =
            |position: &Position| position.set.iter().all(is_duration) && position.number.is_some();
        let unit = if positions.iter().all(is_duration) { "s" } else { "" };
        Ok(Self { name, unit, is_logarithmic: scale, positions })
    }
}

impl Axis {
    /// Whether all its numbers are durations; there may be names besides.
    pub(crate) fn has_durations(&self) -> bool {
        let mut numbers = self.positions.iter().filter(|position| position.number.is_some());
        self.positions.iter().any(|position| position.number.is_some())
            && numbers.all(|position| position.set.iter().all(is_duration))
    }
}

fn is_duration(set: &Override) -> bool {
    set.as_text().is_some_and(|text| duration::parse(text).is_some())
}

/// A table of dotted keys as overrides.
pub fn overrides(value: &Value) -> Option<Vec<Override>> {
    let table: &Table = value.as_table()?;
    Some(table.iter().map(|(key, value)| Override::value(key, value.clone())).collect())
}

impl Position {
    fn of_value(key: &str, value: Value) -> Self {
        let number = match &value {
            Value::String(text) => duration::parse(text).map(|duration| duration.as_secs_f64()),
            value => value.as_float().or_else(|| value.as_integer().map(|i| i as f64)),
        };
        let label = match (&value, number) {
            (_, Some(number)) => number.to_string(),
            (Value::String(text), None) => text.clone(),
            (value, None) => value.to_string(),
        };
        Self { label, number, set: vec![Override::value(key, value)] }
    }
}

/// From a first to a last value, of durations or of plain numbers.
struct Range {
    from: f64,
    to: f64,
    is_duration: bool,
    is_whole: bool,
    is_logarithmic: bool,
}

impl Range {
    fn read(
        section: &Section<'_>,
        from: &Value,
        to: &Value,
        is_logarithmic: bool,
    ) -> Result<Self, ScenarioError> {
        let number = |key, value: &Value| {
            let position = Position::of_value("", value.clone());
            let positive = |x: &f64| !is_logarithmic || *x > 0.0;
            let expected = "a number or a duration, greater than 0 on a logarithmic scale";
            position.number.filter(positive).ok_or_else(|| section.refuse(key, expected))
        };
        let is_duration = from.is_str();
        if is_duration != to.is_str() {
            return Err(section.refuse("to", "a value of the same kind as 'from'"));
        }
        let is_whole = from.is_integer() && to.is_integer();
        Ok(Self {
            from: number("from", from)?,
            to: number("to", to)?,
            is_duration,
            is_whole,
            is_logarithmic,
        })
    }

    fn positions(&self, key: &str, count: usize) -> Vec<Position> {
        (0..count)
            .map(|i| {
                let part = i as f64 / (count - 1) as f64;
                let number = if self.is_logarithmic {
                    self.from * (self.to / self.from).powf(part)
                } else {
                    self.from + (self.to - self.from) * part
                };
                let value = if self.is_duration {
                    // To three digits, and never below a nanosecond.
                    Value::String(duration::format(std::time::Duration::from_nanos(rounded(
                        number * 1e9,
                    )
                        as u64)))
                } else if self.is_whole && !self.is_logarithmic && is_nearly_whole(number) {
                    Value::Integer(number.round() as i64)
                } else {
                    Value::Float(rounded(number))
                };
                Position::of_value(key, value)
            })
            .collect()
    }
}

/// Whole but for the rounding of a division.
fn is_nearly_whole(x: f64) -> bool {
    (x - x.round()).abs() < 1e-9 * x.abs().max(1.0)
}

/// To four significant digits, so that the values of a range can be read and typed.
fn rounded(x: f64) -> f64 {
    if x == 0.0 {
        return 0.0;
    }
    let scale = 10f64.powf(3.0 - x.abs().log10().floor());
    (x * scale).round() / scale
}
