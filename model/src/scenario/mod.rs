//! One experiment as data.
//!
//! A scenario is a TOML text; [`reference`](reference()) lists its keys. It is validated once,
//! here: code that gets a [`Scenario`] trusts its values. Each file holds the keys of one table and
//! reads them.

mod actuator;
pub(crate) mod arm;
mod builtin;
mod bus;
mod declared;
pub mod duration;
mod encoder;
pub(crate) mod error;
mod friction;
pub(crate) mod key;
mod law;
mod link;
mod live;
mod load;
mod reference;
mod safety;
pub mod section;
mod timing;
mod trajectory;
mod wall;
mod whole;

use std::{sync::Arc, time::Duration};

use toml::{Table, Value};

pub use actuator::{ActuatorSettings, CourseSettings};
pub use arm::{ArmSettings, Chain};
pub use builtin::{BUILT_IN, built_in};
pub use bus::{BusKind, BusSettings, DEFAULT_ENDPOINT, DEFAULT_SPIN, Wait, is_name};
pub use encoder::EncoderSettings;
pub use error::ScenarioError;
pub use friction::{FRICTION, FrictionSettings};
pub use key::{Default as KeyDefault, Parameter};
pub use law::{
    Gravity, Horizon, LawSettings, MEMORY, MemoryPolicy, MemorySettings, PREDICTION,
    PredictionModel,
};
pub use link::{Dropout, Jitter, LinkSettings, Links, REPLAY_FORMAT};
pub use load::Load;
pub use reference::{KeyTable, reference, reference_page};
pub use safety::{JointLimits, OnTimeout, Safety};
pub use section::{Origin, Section};
pub use timing::{ClockKind, Timing};
pub use whole::{Advice, too_old};

use key::{Default, Form, Range, literal};

use crate::{
    arm::wall::Wall,
    task::{self, TASKS},
    trajectory::Trajectory,
};

const DURATION: Parameter = Parameter::new(
    "duration",
    Form::Duration(Duration::from_millis(1)),
    "",
    Default::Value("\"20 s\""),
    "How long a run lasts.",
);
const SEED: Parameter = Parameter::new(
    "seed",
    Form::Whole,
    "",
    Default::Value("1"),
    "Seeds all that is random: noise, jitter and losses.",
);
const TASK: Parameter = Parameter::new(
    "task.kind",
    Form::Choice(&["plane"]),
    "",
    Default::Value("\"plane\""),
    "What of the tip is controlled: its position in the plane.",
);
const NOISE: Parameter = Parameter::new(
    "sensor.noise",
    Form::Number(Range::NotNegative),
    "",
    Default::Value("0.0"),
    "Uniform noise of the measured angles and velocities, as a fraction of each magnitude.",
);

/// A validated experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// The built-in name or the path it was loaded from.
    pub name: String,
    /// How long a run lasts.
    pub duration: Duration,
    /// Seeds all that is random.
    pub seed: u64,
    /// What of the tip is controlled.
    pub task: &'static task::Description,
    /// The arm and its initial state.
    pub arm: ArmSettings,
    /// What the tip should do.
    pub trajectory: Trajectory<f64>,
    /// How long the way to another desired motion takes, if one is set while the loop runs.
    pub blend: Duration,
    /// What the controller does about it.
    pub law: LawSettings,
    /// When samples are taken.
    pub timing: Timing,
    /// How long samples and commands travel.
    pub link: Links,
    /// Sensor noise: amplitude as a fraction of each output's magnitude.
    pub noise: f64,
    /// What the tip can touch.
    pub wall: Option<Wall>,
    /// What the tip takes up and drops, in the order of time.
    pub loads: Vec<Load>,
    /// How torques follow their commands; `None` for perfect actuators.
    pub actuator: Option<ActuatorSettings>,
    /// How joints are measured; `None` for perfect encoders.
    pub encoder: Option<EncoderSettings>,
    /// Between which processes.
    pub bus: BusSettings,
    /// What protects the arm.
    pub safety: Safety,
    text: String,
}

/// A key with a value to set over a scenario, like `law.memory.policy=delivered`.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    path: String,
    value: Value,
}

impl Override {
    /// Sets `path` to any TOML value.
    pub fn value(path: &str, value: Value) -> Self {
        Self { path: path.to_owned(), value }
    }

    /// The value, if it is a string.
    pub fn as_text(&self) -> Option<&str> {
        self.value.as_str()
    }

    /// The key.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Sets `path` to a string.
    pub fn text(path: &str, value: &str) -> Self {
        Self { path: path.to_owned(), value: Value::String(value.to_owned()) }
    }
}

impl std::fmt::Display for Override {
    /// Writes what may follow `--set`. Quotes are left out where the text is read the same without
    /// them.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.value {
            Value::String(text) if read_value(text) == self.value => {
                write!(f, "{}={text}", self.path)
            }
            value => write!(f, "{}={value}", self.path),
        }
    }
}

impl std::str::FromStr for Override {
    type Err = ScenarioError;

    /// Reads `key=value`. A value that is not TOML is a string, so quotes may be left out:
    /// `link.torque.latency=1ms`.
    fn from_str(text: &str) -> Result<Self, ScenarioError> {
        let refuse = || ScenarioError::Assignment { text: text.into() };
        let (path, value) = text.split_once('=').ok_or_else(refuse)?;
        let path = path.trim();
        if path.is_empty() {
            return Err(refuse());
        }
        Ok(Self { path: path.to_owned(), value: read_value(value) })
    }
}

/// Reads a TOML value; text that is not TOML becomes a string.
fn read_value(text: &str) -> Value {
    let text = text.trim();
    let mut parsed = toml::from_str::<Table>(&format!("value = {text}")).unwrap_or_default();
    parsed.remove("value").unwrap_or_else(|| Value::String(text.to_owned()))
}

impl Scenario {
    /// Loads a built-in scenario by its name or, failing that, a file, and lays `overrides` over
    /// it.
    pub fn load(name: &str, overrides: &[Override]) -> Result<Self, ScenarioError> {
        Template::load(name)?.with(overrides)
    }
    /// Reads and validates a TOML text called `name` with `overrides` laid over it.
    pub fn parse(name: &str, text: &str, overrides: &[Override]) -> Result<Self, ScenarioError> {
        Template::parse(name, text)?.with(overrides)
    }

    fn read(name: &str, root: Section<'_>, text: String) -> Result<Self, ScenarioError> {
        let duration = root.duration(&DURATION)?;
        let seed = root.get(&SEED, 1, |value| u64::try_from(value.as_integer()?).ok())?;
        let task = read_task(root.section_or_empty("task")?)?;
        let arm = ArmSettings::read(root.section("arm")?, task)?;
        let timing = Timing::read(root.section("timing")?, duration)?;
        let law = LawSettings::read(root.section("law")?, &arm, task, timing.sample_period)?;
        if let Err(unsuited) = law.law.check(&arm, task) {
            return Err(root.section("law")?.refuse(unsuited.key(), unsuited));
        }
        let link = Links::read(root.section_or_empty("link")?)?;
        let safety =
            Safety::read(root.section_or_empty("safety")?, arm.links.len(), &timing, &link)?;
        let (trajectory, blend) = Trajectory::read(root.section("trajectory")?)?;
        let scenario = Self {
            name: name.to_owned(),
            duration,
            seed,
            task,
            trajectory,
            blend,
            law,
            timing,
            link,
            noise: read_noise(root.section_or_empty("sensor")?)?,
            wall: wall::read(&root, &arm)?,
            loads: load::read(&root)?,
            actuator: ActuatorSettings::read(root.section_or_empty("actuator")?, arm.links.len())?,
            encoder: EncoderSettings::read(root.section_or_empty("encoder")?, arm.links.len())?,
            bus: BusSettings::read(root.section_or_empty("bus")?)?,
            safety,
            arm,
            text,
        };
        scenario.check(&root)?;
        root.finish()?;
        Ok(scenario)
    }

    /// The TOML this scenario was read from, overrides included.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The values of its keys, for displays.
    pub fn settings(&self) -> Settings {
        Settings(self.text.parse().unwrap_or_default())
    }
}

/// The keys of a scenario with their values as TOML.
#[derive(Clone, Debug)]
pub struct Settings(Table);

impl Settings {
    /// The value of a parameter that is in effect: the one in the scenario, else the declared
    /// default.
    pub fn get(&self, parameter: &Parameter) -> Option<Value> {
        self.find(parameter.key).or_else(|| match parameter.default {
            Default::Required | Default::Words(_) => None,
            Default::Value(text) => Some(literal(text)),
            Default::SameAs(key) => self.find(key),
        })
    }

    fn find(&self, path: &str) -> Option<Value> {
        let (first, rest) = path.split_once('.').unwrap_or((path, ""));
        let parts = rest.split('.').filter(|part| !part.is_empty());
        let value = parts.fold(self.0.get(first), |value, part| value?.get(part));
        value.cloned()
    }
}

/// A scenario's text, parsed once, for many sets of overrides.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    name: String,
    text: String,
    table: Table,
}

impl Template {
    /// Loads a built-in scenario by its name or, failing that, a file.
    pub fn load(name: &str) -> Result<Self, ScenarioError> {
        if let Some(text) = built_in(name) {
            return Self::parse(name, text);
        }
        match std::fs::read_to_string(name) {
            Ok(text) => Self::parse(name, &text),
            Err(error) => {
                Err(ScenarioError::NotFound { name: name.into(), source: Arc::new(error) })
            }
        }
    }

    fn parse(name: &str, text: &str) -> Result<Self, ScenarioError> {
        let table: Table = text.parse().map_err(|error: toml::de::Error| {
            let line = error
                .span()
                .map_or(0, |span| text[..span.start.min(text.len())].lines().count().max(1));
            ScenarioError::Syntax {
                origin: name.into(),
                line,
                reason: error.message().replace('\n', ", ").into(),
            }
        })?;
        Ok(Self { name: name.to_owned(), text: text.to_owned(), table })
    }

    /// The scenario with `overrides` laid over it, validated.
    pub fn with(&self, overrides: &[Override]) -> Result<Scenario, ScenarioError> {
        let mut table = self.table.clone();
        for set in overrides {
            lay_over(&mut table, set)?;
        }
        let origin = origin(&self.name, overrides);
        let is_loaded = trajectory::load_points(&mut table, &origin)?;
        // A text that nothing was laid over keeps its comments.
        let is_changed = is_loaded || !overrides.is_empty();
        let text = if is_changed { table.to_string() } else { self.text.clone() };
        Scenario::read(&self.name, Section::root(&origin, &table), text)
    }
}

fn origin(name: &str, overrides: &[Override]) -> Origin {
    Origin::new(name, overrides.iter().map(|set| set.path.clone()).collect())
}

fn read_task(section: Section<'_>) -> Result<&'static task::Description, ScenarioError> {
    let task = section.word(&TASK, &TASKS.each_ref())?;
    section.finish()?;
    Ok(task)
}

fn read_noise(section: Section<'_>) -> Result<f64, ScenarioError> {
    let noise = section.number(&NOISE)?;
    section.finish()?;
    Ok(noise)
}

/// Puts one value at its dotted path; `arm.links[1].mass` reaches into a list.
fn lay_over(table: &mut Table, set: &Override) -> Result<(), ScenarioError> {
    let no_place = || ScenarioError::NoPlace {
        key: set.path.as_str().into(),
        value: set.value.to_string().into(),
    };
    let (parents, last) = set.path.rsplit_once('.').unwrap_or(("", &set.path));
    let mut table = table;
    for part in parents.split('.').filter(|part| !part.is_empty()) {
        let (name, index) = split_index(part).ok_or_else(no_place)?;
        let value = table.entry(name).or_insert_with(|| Value::Table(Table::new()));
        let value = match index {
            None => Some(value),
            Some(index) => value.as_array_mut().and_then(|list| list.get_mut(index)),
        };
        table = value.and_then(Value::as_table_mut).ok_or_else(no_place)?;
    }
    let (name, index) = split_index(last).ok_or_else(no_place)?;
    match index {
        None => {
            table.insert(name.to_owned(), set.value.clone());
        }
        Some(index) => {
            let place = table.get_mut(name).and_then(Value::as_array_mut);
            *place.and_then(|list| list.get_mut(index)).ok_or_else(no_place)? = set.value.clone();
        }
    }
    Ok(())
}

/// "links[1]" into "links" and 1.
fn split_index(part: &str) -> Option<(&str, Option<usize>)> {
    match part.split_once('[') {
        None => Some((part, None)),
        Some((name, index)) => Some((name, Some(index.strip_suffix(']')?.parse().ok()?))),
    }
}
