//! Why a command failed, and what that is to the shell: the one place where exit statuses are made.

use std::{fmt, io};

use mtj_controller::serve::ServeError;
use mtj_figure::FigureError;
use mtj_model::scenario::ScenarioError;
use mtj_monitor::{error::MonitorError, recording::RecordingError};
use mtj_plant::error::PlantError;
use mtj_protocol::bus::BusError;
use mtj_study::StudyError;

#[cfg(feature = "zenoh")]
use crate::certificates::CertificateError;
use crate::{launcher::LaunchError, paper::runs::RunsError};

/// Why a command failed, with the exit status it deserves.
#[derive(Debug)]
pub struct Failure {
    /// One clear sentence; empty if the user has been told.
    pub sentence: String,
    /// 2 for bad input, 1 for anything else.
    pub code: u8,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.sentence)
    }
}

impl Failure {
    /// Something the user can mend.
    pub fn bad_input(sentence: impl fmt::Display) -> Self {
        Self::new(sentence, true)
    }

    /// Something else.
    pub fn other(sentence: impl fmt::Display) -> Self {
        Self::new(sentence, false)
    }

    fn new(error: impl fmt::Display, is_bad_input: bool) -> Self {
        Self { sentence: error.to_string(), code: if is_bad_input { 2 } else { 1 } }
    }
}

impl From<ScenarioError> for Failure {
    fn from(error: ScenarioError) -> Self {
        Self::bad_input(error)
    }
}

/// Errors that know whether the user can mend them.
macro_rules! from_errors {
    ($($(#[$attribute:meta])* $error:ty,)*) => {
        $($(#[$attribute])*
        impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::new(&error, error.is_bad_input())
            }
        })*
    };
}

from_errors! {
    BusError,
    #[cfg(feature = "zenoh")]
    CertificateError,
    FigureError,
    MonitorError,
    PlantError,
    RecordingError,
    RunsError,
    ServeError,
    StudyError,
}

impl From<LaunchError> for Failure {
    fn from(error: LaunchError) -> Self {
        let sentence = if error.is_explained() { String::new() } else { error.to_string() };
        Self { code: error.code(), sentence }
    }
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::other(error)
    }
}
