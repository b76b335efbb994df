//! Which points a study has.

use std::path::Path;

use mtj_model::scenario::{Origin, Override, Scenario, ScenarioError, Section, Template};
use toml::{Table, Value};

use super::{
    axis::{self, Axis, Position},
    builtin,
};

/// A scenario, what is set in it throughout, and axes; the points are all combinations of positions.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The built-in name or the file it was read from.
    pub name: String,
    /// What it is about.
    pub title: String,
    /// The scenario.
    pub scenario: String,
    /// Set at every point.
    pub set: Vec<Override>,
    /// The last varies fastest.
    pub axes: Vec<Axis>,
    template: Result<Template, ScenarioError>,
    text: String,
}

/// More points than anybody means to ask for.
const MOST_POINTS: usize = 10_000_000;

impl Plan {
    /// Loads a built-in study or, failing that, a file; `set` is set at every point.
    pub fn load(name: &str, set: &[Override]) -> Result<Self, ScenarioError> {
        let text = match builtin::built_in(name) {
            Some(text) => text.to_owned(),
            None => std::fs::read_to_string(name).map_err(|error| {
                Origin::new("mtj study", Vec::new()).refuse(format!(
                    "there is no built-in study '{name}' and the file could not be read ({error}); \
                     'mtj study list' prints the built-in names"
                ))
            })?,
        };
        Self::parse(name, &text, set)
    }

    /// Reads the study whose results a folder holds, with what was set besides.
    pub fn from_folder(folder: &Path) -> Result<Self, ScenarioError> {
        let path = folder.join("study.toml");
        let name = path.display().to_string();
        let text = std::fs::read_to_string(&path).map_err(|error| {
            Origin::new(&name, Vec::new()).refuse(format!(
                "no study could be read ({error}); 'mtj study run STUDY --out DIR' fills a folder"
            ))
        })?;
        let lines: Vec<&str> = text.lines().collect();
        let is_set = |line: &&&str| line.starts_with(SET) || line.is_empty();
        let body = lines.len() - lines.iter().rev().take_while(is_set).count();
        let set = lines[body..].iter().filter_map(|line| line.strip_prefix(SET));
        let set: Vec<Override> = set.map(str::parse).collect::<Result<_, _>>()?;
        let mut plan = Self::parse(&name, &lines[..body].join("\n"), &set)?;
        // The lines name all that is set at every point, in order: the study's own keys first.
        plan.set = set;
        Ok(plan)
    }

    /// Reads a study from TOML.
    pub fn parse(name: &str, text: &str, set: &[Override]) -> Result<Self, ScenarioError> {
        let origin = Origin::new(name, Vec::new());
        let table: Table = text.parse().map_err(|error: toml::de::Error| {
            origin.refuse(format!("not TOML: {}", error.message()))
        })?;
        let root = Section::root(&origin, &table);
        let scenario = root.required("scenario", "a scenario", Value::as_str)?;
        let mut plan = Self {
            name: name.to_owned(),
            title: root.optional("title", "a title", Value::as_str)?.unwrap_or(name).to_owned(),
            scenario: scenario.to_owned(),
            set: root
                .optional("set", "a table of keys and values", axis::overrides)?
                .unwrap_or_default(),
            axes: Vec::new(),
            template: Template::load(scenario),
            text: text.to_owned(),
        };
        let count = || origin.refuse(format!("expected axes that make 1 to {MOST_POINTS} points"));
        for axis in root.sections("axes", "one axis or more")? {
            plan.axes.push(Axis::read(axis)?);
            if plan.len() > MOST_POINTS {
                return Err(count());
            }
        }
        root.finish()?;
        plan.set.extend(set.iter().cloned());
        if plan.axes.is_empty() || plan.is_empty() {
            return Err(count());
        }
        // What is wrong everywhere is said at once; what is wrong at one point is recorded there.
        match (plan.scenario(0), plan.scenario(plan.len() - 1)) {
            (Err(first), Err(last)) if first == last => Err(first),
            _ => Ok(plan),
        }
    }

    /// How many points there are.
    pub fn len(&self) -> usize {
        self.axes.iter().fold(1, |count, axis| count.saturating_mul(axis.positions.len()))
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The position on each axis of a point.
    pub fn positions(&self, point: usize) -> Vec<&Position> {
        let mut rest = point;
        let mut positions: Vec<_> = self
            .axes
            .iter()
            .rev()
            .map(|axis| {
                let count = axis.positions.len();
                let position = &axis.positions[rest % count];
                rest /= count;
                position
            })
            .collect();
        positions.reverse();
        positions
    }

    /// Everything that is set at a point.
    pub fn overrides(&self, point: usize) -> Vec<Override> {
        let at = self.positions(point);
        self.set.iter().chain(at.iter().flat_map(|position| &position.set)).cloned().collect()
    }

    /// The scenario at a point.
    pub fn scenario(&self, point: usize) -> Result<Scenario, ScenarioError> {
        self.template.as_ref().map_err(Clone::clone)?.with(&self.overrides(point))
    }

    /// The command that replays a point on its own.
    pub fn command(&self, point: usize) -> String {
        let at = self.positions(point);
        let flags: String = at.iter().map(|position| flags(&position.set)).collect();
        self.command_start() + &flags
    }

    /// What the commands of all points have in common; the [`flags`] of the positions follow.
    pub fn command_start(&self) -> String {
        format!("mtj run --scenario {}{}", quoted(&self.scenario), flags(&self.set))
    }

    /// What identifies the study on disk: its text and what was set besides.
    pub fn identity(&self) -> String {
        let set: String = self.set.iter().map(|set| format!("{SET}{set}\n")).collect();
        format!("{}\n{set}", self.text.trim_end())
    }
}

/// What the lines of a folder's study begin with that say what was set.
const SET: &str = "# --set ";

/// What sets keys on a command line, with a space before each.
pub fn flags(set: &[Override]) -> String {
    set.iter().map(|set| format!(" --set {}", quoted(&set.to_string()))).collect()
}

/// A word for a shell.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_=./:,".contains(c);
    if word.chars().all(is_plain) { word.to_owned() } else { format!("'{word}'") }
}
