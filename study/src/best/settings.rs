//! The table `best` of a study: which laws, which gains, under which limits.

use std::time::Duration;

use mtj_model::scenario::{Override, ScenarioError, Section, duration};
use toml::Value;

use crate::{
    margin::MARGIN,
    sweep::axis::{self, Axis, Position},
};

/// The table `best` of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Best {
    /// The limits that gains must keep.
    pub limits: Limits,
    /// The laws that are compared.
    pub laws: Vec<Entry>,
    /// What is set beside the gains: every candidate is run in each case, and the worst counts.
    pub cases: Vec<Vec<Override>>,
    /// How many starts each candidate is run from; the worst counts.
    pub starts: usize,
    /// Seeds the search.
    pub seed: u64,
    /// How many candidates the search keeps for each key.
    pub population: usize,
    /// How long the runs of the first stage are, at the most.
    pub short: Duration,
}

/// The limits that gains must keep.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// The largest torque over the whole run, N m: one number, or one a joint.
    pub torque_nm: Vec<f64>,
    /// The largest rms torque step between commands, N m.
    pub torque_step_nm: f64,
    /// The loop must stand this many times the latency.
    pub margin: f64,
    /// The largest error there, over the error at the latency.
    pub growth: f64,
}

/// A law and the keys that are searched.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Its name in tables and figures.
    pub name: String,
    /// The keys that make it this law.
    pub set: Vec<Override>,
    /// The keys that are searched.
    pub gains: Vec<GainRange>,
}

/// A key that is searched, between two positive numbers on a logarithmic scale.
#[derive(Clone, Debug, PartialEq)]
pub struct GainRange {
    /// The key of the scenario.
    pub key: String,
    /// The least value.
    pub from: f64,
    /// The largest value.
    pub to: f64,
}

/// The fewest candidates for each key that can be combined, and the most that help.
const POPULATION: std::ops::RangeInclusive<i64> = 4..=256;
/// The most starts; a law without damping of a redundant arm differs from start to start.
const STARTS: std::ops::RangeInclusive<i64> = 1..=64;

impl Limits {
    /// Limits of torque and torque step that are larger by a factor.
    pub(crate) fn times(&self, factor: f64) -> Self {
        Self {
            torque_nm: self.torque_nm.iter().map(|limit| factor * limit).collect(),
            torque_step_nm: factor * self.torque_step_nm,
            margin: self.margin,
            growth: factor * self.growth,
        }
    }

    /// The limit of a joint's torque, N m.
    pub fn torque(&self, joint: usize) -> f64 {
        let last = self.torque_nm.last().copied().unwrap_or(f64::INFINITY);
        self.torque_nm.get(joint).copied().unwrap_or(last)
    }
}

impl Best {
    /// The columns that the best gains add to a row of results: what stands in the way, the error with
    /// the margin, the gains, the command.
    pub(crate) fn columns(&self) -> Vec<String> {
        let keys = self.keys().into_iter().map(str::to_owned);
        let first = ["limit", "margin_rms_error_m"].map(str::to_owned);
        first.into_iter().chain(keys).chain(["command".to_owned()]).collect()
    }

    /// Reads the table.
    pub(crate) fn read(section: Section<'_>) -> Result<Self, ScenarioError> {
        let positive = |value: &Value| number(value).filter(|x| *x > 0.0);
        let at_least_one = |value: &Value| number(value).filter(|x| *x >= 1.0);
        let expected = "a torque in N m greater than 0, or a list with one for each joint";
        let torque_nm = section.required("torque_limit", expected, |value| match value {
            Value::Array(list) if !list.is_empty() => list.iter().map(positive).collect(),
            value => Some(vec![positive(value)?]),
        })?;
        let expected = "an rms torque step in N m greater than 0";
        let torque_step_nm = section.required("torque_step_limit", expected, positive)?;
        let expected = "a multiple of the latency, at least 1";
        let margin = section.optional("margin", expected, at_least_one)?.unwrap_or(MARGIN);
        let expected = "a multiple of the error, at least 1";
        let growth = section.optional("growth", expected, at_least_one)?.unwrap_or(GROWTH);
        let whole = |range: &'static std::ops::RangeInclusive<i64>| {
            move |value: &Value| value.as_integer().filter(|i| range.contains(i))
        };
        let starts = section.optional("starts", "how many starts, 1 to 64", whole(&STARTS))?;
        let expected = "how many candidates for each key, 4 to 256";
        let population = section.optional("population", expected, whole(&POPULATION))?;
        let seed = section.optional("seed", "a whole number, 0 or more", |value| {
            u64::try_from(value.as_integer()?).ok()
        })?;
        let short = section.optional("short", duration::FORM, |value| {
            duration::parse(value.as_str()?).filter(|short| !short.is_zero())
        })?;
        let cases = section.optional("cases", "a list of tables of keys and values", |value| {
            value.as_array()?.iter().map(axis::overrides).collect::<Option<Vec<_>>>()
        })?;
        let laws = section
            .sections("laws", "a list of laws {name, set, search}")?
            .into_iter()
            .map(Entry::read)
            .collect::<Result<Vec<_>, _>>()?;
        if laws.is_empty() {
            return Err(section.refuse("laws", "at least one law {name, set, search}"));
        }
        section.finish()?;
        Ok(Self {
            limits: Limits { torque_nm, torque_step_nm, margin, growth },
            laws,
            cases: cases.filter(|cases| !cases.is_empty()).unwrap_or_else(|| vec![Vec::new()]),
            starts: starts.map_or(1, |starts| starts as usize),
            seed: seed.unwrap_or(1),
            population: population.map_or(CANDIDATES, |count| count as usize),
            short: short.unwrap_or(SHORT),
        })
    }

    /// The laws as the first axis of the study.
    pub(crate) fn axis(&self) -> Axis {
        let positions = self.laws.iter().map(|law| {
            let (label, set) = (law.name.clone(), law.set.clone());
            Position { label, number: None, set }
        });
        Axis {
            name: "law".to_owned(),
            unit: "",
            is_logarithmic: false,
            positions: positions.collect(),
        }
    }

    /// All keys that are searched for any law, each once.
    pub(crate) fn keys(&self) -> Vec<&str> {
        let mut keys = Vec::new();
        for gain in self.laws.iter().flat_map(|law| &law.gains) {
            if !keys.contains(&gain.key.as_str()) {
                keys.push(&gain.key);
            }
        }
        keys
    }
}

/// The growth of the error unless the study says otherwise: what `mtj tune` tells.
const GROWTH: f64 = 2.0;
/// The candidates for each key unless the study says otherwise.
const CANDIDATES: usize = 6;
/// The duration of short runs unless the study says otherwise.
const SHORT: Duration = Duration::from_secs(5);

impl Entry {
    fn read(section: Section<'_>) -> Result<Self, ScenarioError> {
        let name = section.required("name", "a name", Value::as_str)?.to_owned();
        let set = section.required("set", "a table of keys and values", axis::overrides)?;
        let expected = "a table of keys, each with a range [from, to], 0 < from < to";
        let gains = section.required("search", expected, |value| {
            let table = value.as_table().filter(|table| !table.is_empty())?;
            table.iter().map(|(key, range)| GainRange::read(key, range)).collect()
        })?;
        section.finish()?;
        Ok(Self { name, set, gains })
    }

    /// The keys in the middle of their ranges.
    pub(crate) fn middle(&self) -> Vec<Override> {
        self.gains_at(&vec![0.5; self.gains.len()])
    }

    /// The keys that a candidate sets; `at` has a number from 0 to 1 for each.
    pub(crate) fn gains_at(&self, at: &[f64]) -> Vec<Override> {
        let pairs = self.gains.iter().zip(at);
        pairs.map(|(gain, at)| Override::value(&gain.key, gain.value(*at).into())).collect()
    }
}

impl GainRange {
    fn read(key: &str, range: &Value) -> Option<Self> {
        let [from, to] = &range.as_array()?[..] else { return None };
        let (from, to) = (number(from)?, number(to)?);
        (0.0 < from && from < to && to.is_finite()).then(|| Self { key: key.to_owned(), from, to })
    }

    /// The value at a place from 0 to 1, to three digits, so that it can be read and typed.
    pub(crate) fn value(&self, at: f64) -> f64 {
        let value = self.from * (self.to / self.from).powf(at);
        format!("{value:.2e}").parse().unwrap_or(value)
    }

    /// The place of a value that is a factor larger than the one at a place.
    pub(crate) fn times(&self, at: f64, factor: f64) -> f64 {
        at + factor.ln() / (self.to / self.from).ln()
    }
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|i| i as f64)).filter(|x| x.is_finite())
}
