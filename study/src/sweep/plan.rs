//! The points of a study.

use std::path::{self, Path, PathBuf};

use mtj_model::scenario::{self, Origin, Override, Scenario, ScenarioError, Section, Template};
use toml::{Table, Value};

use super::{
    axis::{self, Axis, Position},
    builtin,
};
use crate::{
    best::settings::{Best, Entry},
    error::StudyError,
    shell,
};

/// A scenario, what is set in it at every point, and axes; the points are all combinations of
/// positions.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The built-in name or the file it was read from.
    pub name: String,
    /// The title of its figures.
    pub title: String,
    /// The built-in scenario or its file.
    pub scenario: String,
    /// Set at every point: by the study, then by `--set`.
    pub set: Vec<Override>,
    /// The last varies fastest.
    pub axes: Vec<Axis>,
    /// What is searched at each point; then the first axis is that of the laws. Without it a point
    /// is one run.
    pub best: Option<Best>,
    /// How many of `set` are the study's own.
    own: usize,
    template: Template,
    text: String,
}

/// More points than a study needs.
const MOST_POINTS: usize = 10_000_000;

impl Plan {
    /// Loads a built-in study or, failing that, a file; `set` is set at every point.
    ///
    /// A relative path of a file's scenario starts at the folder of the study.
    ///
    /// # Errors
    ///
    /// If there is no such study, or it is not acceptable.
    pub fn load(name: &str, set: &[Override]) -> Result<Self, StudyError> {
        if let Some(text) = builtin::built_in(name) {
            return Self::parse(name, text, set);
        }
        let text = std::fs::read_to_string(name)
            .map_err(|source| StudyError::NoStudy { name: name.to_owned(), source })?;
        let folder = Path::new(name).parent().unwrap_or(Path::new(""));
        Self::read(name, &text, set, |scenario| folder.join(scenario))
    }

    /// Reads the study whose results a folder holds, with what was set besides.
    ///
    /// # Errors
    ///
    /// If the folder holds no study, or its scenario is gone.
    pub fn from_folder(folder: &Path) -> Result<Self, StudyError> {
        let path = folder.join(FILE);
        let name = path.display().to_string();
        let text = std::fs::read_to_string(&path)
            .map_err(|source| StudyError::NoStudyIn { path, source })?;
        let lines: Vec<&str> = text.lines().collect();
        let is_note =
            |line: &&&str| line.starts_with(SET) || line.starts_with(SCENARIO) || line.is_empty();
        let body = lines.len() - lines.iter().rev().take_while(is_note).count();
        let notes = || lines[body..].iter();
        let set = notes().filter_map(|line| line.strip_prefix(SET));
        let set: Vec<Override> = set.map(str::parse).collect::<Result<_, _>>()?;
        let scenario = notes().find_map(|line| line.strip_prefix(SCENARIO)).map(PathBuf::from);
        let find = |written: &str| scenario.unwrap_or_else(|| folder.join(written));
        let mut plan = Self::read(&name, &lines[..body].join("\n"), &set, find)?;
        // The lines name all that is set at every point, in order: the study's own keys first.
        plan.set = set;
        Ok(plan)
    }

    /// Reads a study from TOML; a relative path of its scenario starts at the working directory.
    ///
    /// # Errors
    ///
    /// If the study is not acceptable.
    pub fn parse(name: &str, text: &str, set: &[Override]) -> Result<Self, StudyError> {
        Self::read(name, text, set, |scenario| PathBuf::from(scenario))
    }

    /// Reads a study; `find` says where a scenario is that is not built in.
    fn read(
        name: &str,
        text: &str,
        set: &[Override],
        find: impl FnOnce(&str) -> PathBuf,
    ) -> Result<Self, StudyError> {
        let origin = Origin::new(name, Vec::new());
        let table: Table =
            text.parse().map_err(|source| StudyError::NotToml { name: name.to_owned(), source })?;
        let root = Section::root(&origin, &table);
        let scenario = root.required("scenario", "a scenario", Value::as_str)?;
        let title = root.optional("title", "a title", Value::as_str)?.unwrap_or(name).to_owned();
        let own = root.optional("set", "a table of keys and values", axis::overrides)?;
        let own = own.unwrap_or_default();
        let scenario = match scenario::built_in(scenario) {
            Some(_) => scenario.to_owned(),
            None => {
                let path = find(scenario);
                if !path.is_file() {
                    let (study, scenario) = (name.to_owned(), scenario.to_owned());
                    return Err(StudyError::NoScenario { study, scenario, path });
                }
                path.display().to_string()
            }
        };
        let mut plan = Self {
            name: name.to_owned(),
            title,
            own: own.len(),
            set: own,
            axes: Vec::new(),
            best: root.optional_section("best")?.map(Best::read).transpose()?,
            template: Template::load(&scenario)?,
            scenario,
            text: text.to_owned(),
        };
        let count = || StudyError::PointCount { name: name.to_owned(), most: MOST_POINTS };
        plan.axes.extend(plan.best.as_ref().map(Best::axis));
        // The laws are an axis, too.
        let axes = match &plan.best {
            Some(_) if !table.contains_key("axes") => Vec::new(),
            _ => root.sections("axes", "one axis or more")?,
        };
        for axis in axes {
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
        // What is wrong everywhere is an error at once; what is wrong at one point is recorded
        // there.
        match (plan.example(0), plan.example(plan.len() - 1)) {
            (Err(first), Err(last)) if first == last => Err(first.into()),
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
    ///
    /// # Errors
    ///
    /// If the values of that point are not acceptable.
    pub fn scenario(&self, point: usize) -> Result<Scenario, ScenarioError> {
        self.template.with(&self.overrides(point))
    }

    /// The scenario at a point with more keys set.
    pub(crate) fn scenario_with(
        &self,
        point: usize,
        set: &[Override],
    ) -> Result<Scenario, ScenarioError> {
        let mut all = self.overrides(point);
        all.extend_from_slice(set);
        self.template.with(&all)
    }

    /// The law whose gains are searched at a point.
    pub(crate) fn law<'a>(&self, best: &'a Best, point: usize) -> &'a Entry {
        &best.laws[point / (self.len() / best.laws.len())]
    }

    /// A scenario at a point: where gains are searched, with some that are in their ranges.
    fn example(&self, point: usize) -> Result<Scenario, ScenarioError> {
        let gains = self.best.as_ref().map(|best| self.law(best, point).middle());
        self.scenario_with(point, &gains.unwrap_or_default())
    }

    /// The command that replays a point on its own.
    pub fn command(&self, point: usize) -> String {
        shell::run_command(&self.scenario, &self.overrides(point))
    }

    /// The keys that `--set` changes at every point.
    pub fn changes(&self) -> &[Override] {
        &self.set[self.own..]
    }

    /// The text of the study; the keys that `--set` changes are comments at its end.
    pub fn shown(&self) -> String {
        let set: String = self.changes().iter().map(|set| format!("{SET}{set}\n")).collect();
        format!("{}\n{set}", self.text.trim_end())
    }

    /// The identity of the study on disk: its text and everything that is set.
    pub(crate) fn identity(&self) -> String {
        let set: String = self.set.iter().map(|set| format!("{SET}{set}\n")).collect();
        format!("{}\n{set}", self.text.trim_end())
    }

    /// The text of [`FILE`]: the study's identity and, if its scenario is a file, where that is.
    pub(crate) fn file(&self) -> String {
        let path = match scenario::built_in(&self.scenario) {
            Some(_) => None,
            None => path::absolute(&self.scenario).ok(),
        };
        let path = path.map(|path| format!("{SCENARIO}{}\n", path.display()));
        self.identity() + &path.unwrap_or_default()
    }

    /// Whether the text of a [`FILE`] is of this study, wherever its scenario is.
    pub(crate) fn is_in(&self, file: &str) -> bool {
        let identity = |text: &str| -> Vec<String> {
            text.lines().filter(|line| !line.starts_with(SCENARIO)).map(str::to_owned).collect()
        };
        identity(file) == identity(&self.identity())
    }
}

/// The file of a folder of results that holds the study.
pub(crate) const FILE: &str = "study.toml";
/// The beginning of its lines that say what was set.
const SET: &str = "# --set ";
/// The beginning of its line that says where the scenario is.
const SCENARIO: &str = "# --scenario ";
