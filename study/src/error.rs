//! Why a study, a prediction or a proposal of gains failed.

use std::{error::Error, io, path::PathBuf};

use mtj_figure::FigureError;
use mtj_model::scenario::ScenarioError;
use mtj_plant::error::PlantError;
use mtj_protocol::bus::BusError;

/// Why a study, a prediction or a proposal of gains failed.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The study or a scenario in it is not acceptable.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A run failed.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A bus could not be opened.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A figure could not be drawn or written.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// There is no such study.
    #[error(
        "there is no built-in study '{name}' and the file could not be read ({source}); \
         'mtj study list' prints the built-in names"
    )]
    NoStudy {
        /// The name that was given.
        name: String,
        /// The system's error.
        source: io::Error,
    },
    /// A folder holds no study.
    #[error(
        "{}: no study could be read ({source}); 'mtj study run STUDY --out DIR' fills a folder",
        path.display()
    )]
    NoStudyIn {
        /// The file that should hold it.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A study is not TOML.
    #[error("{name}: not TOML: {}", source.message())]
    NotToml {
        /// The study.
        name: String,
        /// The reader's error.
        source: toml::de::Error,
    },
    /// The scenario of a study is neither built in nor a file.
    #[error(
        "{study}: scenario = '{scenario}' is neither a built-in scenario nor a file: there is no {}; \
         a relative path starts at the folder of the study",
        path.display()
    )]
    NoScenario {
        /// The study.
        study: String,
        /// As the study names it.
        scenario: String,
        /// Where it was looked for.
        path: PathBuf,
    },
    /// A study has no points, or too many.
    #[error("{name}: expected axes that make 1 to {most} points")]
    PointCount {
        /// The study.
        name: String,
        /// The most points.
        most: usize,
    },
    /// The limit of a loop was asked for whose gains are still to be searched.
    #[error(
        "{name}: a study with the table 'best' searches the gains, and a limit can be predicted only \
         for gains that are known; name a study without it"
    )]
    Searched {
        /// The study.
        name: String,
    },
    /// The controller of a run over a bus could not be started.
    #[error("a controller could not be started: {0}")]
    Spawn(#[from] io::Error),
    /// The folder for the results cannot be made.
    #[error("--out {}: {source}; give a folder that can be written", folder.display())]
    Folder {
        /// The folder that was given.
        folder: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A file of the study cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A row cannot be appended.
    #[error("{}: {source}; make room and run the same command again to go on", path.display())]
    Append {
        /// The file of results.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The file of results is not CSV.
    #[error("{}: {source}", path.display())]
    Csv {
        /// The file.
        path: PathBuf,
        /// The reader's error.
        source: csv::Error,
    },
    /// The folder belongs to another study.
    #[error("{} holds the results of another study; choose another folder with --out", folder.display())]
    OtherStudy {
        /// The folder.
        folder: PathBuf,
    },
    /// A line of the results is no row of this study.
    #[error("{}, line {line}: not a row of this study", path.display())]
    NotARow {
        /// The file of results.
        path: PathBuf,
        /// From 1.
        line: usize,
    },
    /// Two shards have different results of one point.
    #[error("point {point} has two different results, one in {}", path.display())]
    TwoResults {
        /// Number of the point.
        point: usize,
        /// The file of the second one.
        path: PathBuf,
    },
    /// There is nothing to report.
    #[error(
        "no results to report: {0}; 'mtj study run' makes them, 'mtj study merge' joins shards"
    )]
    NoResults(#[source] Box<Self>),
    /// The file of results has no rows yet.
    #[error("{}: the study has no results yet", folder.display())]
    NoRows {
        /// The study's folder.
        folder: PathBuf,
    },
    /// No point could be run.
    #[error(
        "no results to report: all {count} points failed: {reason}; 'mtj study run' tries them again"
    )]
    AllFailed {
        /// How many there are.
        count: usize,
        /// Why the first failed.
        reason: String,
    },
    /// The motion alone takes more torque than a joint has.
    #[error(
        "no gains satisfy the torque limit: the motion itself takes {needed:.3} N m at joint {joint}, \
         the limit is {limit} N m"
    )]
    TorqueLimit {
        /// From 1.
        joint: usize,
        /// The torque that the motion takes, N m.
        needed: f64,
        /// The torque that the joint has, N m.
        limit: f64,
    },
    /// No gains satisfy all limits.
    #[error(
        "none of the gains tried with K_d/K_p = {time_constant_s} s satisfies all limits; in the way \
         at the last: {}",
        last.as_ref().map_or("nothing".to_owned(), ToString::to_string)
    )]
    NoGains {
        /// The wanted time constant of the error.
        time_constant_s: f64,
        /// What was tried last, and the limit that it did not satisfy.
        last: Option<Box<dyn Error + Send + Sync>>,
    },
    /// No linear theory describes the loop.
    #[error(
        "the largest latency of law.kind = \"{law}\" is not predicted: {reason}; 'mtj study' finds it"
    )]
    NoTheory {
        /// The law.
        law: &'static str,
        /// Why not.
        reason: &'static str,
    },
    /// The user ended it.
    #[error("stopped before {0}")]
    Stopped(&'static str),
    /// A fault of this program.
    #[error("a thread panicked")]
    Panicked,
}

impl StudyError {
    /// Whether the cause is what the user gave.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::Plant(error) => error.is_bad_input(),
            Self::Bus(error) => error.is_bad_input(),
            Self::Figure(error) => error.is_bad_input(),
            Self::Scenario(_)
            | Self::NoStudy { .. }
            | Self::NoStudyIn { .. }
            | Self::NotToml { .. }
            | Self::NoScenario { .. }
            | Self::PointCount { .. }
            | Self::Searched { .. }
            | Self::Folder { .. }
            | Self::File { .. }
            | Self::Csv { .. }
            | Self::OtherStudy { .. }
            | Self::NotARow { .. }
            | Self::TwoResults { .. }
            | Self::NoResults(_)
            | Self::NoTheory { .. }
            | Self::NoRows { .. }
            | Self::AllFailed { .. } => true,
            Self::Spawn(_)
            | Self::Append { .. }
            | Self::TorqueLimit { .. }
            | Self::NoGains { .. }
            | Self::Stopped(_)
            | Self::Panicked => false,
        }
    }
}
