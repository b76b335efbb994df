//! The phase of a run, its alarms, and when a monitor joined it.

use std::time::Duration;

/// The phase of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The plant waits for a controller.
    Waiting,
    /// The arm moves.
    Running,
    /// The run is over.
    Finished,
    /// An operator paused the run.
    Paused,
}

impl Phase {
    /// The phase in one word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Running => "running",
            Self::Finished => "finished",
            Self::Paused => "paused",
        }
    }
}

/// A condition that every display points out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alarm {
    /// No message of a plant has come yet.
    NoPlant,
    /// No message of the plant has come for this long.
    PlantSilent(Duration),
    /// The plant waits for its first controller.
    NoController,
    /// No message of the controller has come for this long, though the plant sends states.
    ControllerSilent(Duration),
}

impl Alarm {
    /// The alarm as a sentence for the user.
    pub fn sentence(&self) -> String {
        match self {
            Self::NoPlant => "waiting for a plant".to_owned(),
            Self::PlantSilent(silence) => {
                format!("the plant has been silent for {:.1} s", silence.as_secs_f64())
            }
            Self::NoController => "the plant is waiting for a controller".to_owned(),
            Self::ControllerSilent(silence) => {
                format!("the controller has been silent for {:.1} s", silence.as_secs_f64())
            }
        }
    }
}

/// When a monitor joined a run that had begun.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Joined {
    /// The run's time, ns.
    pub time_ns: u64,
    /// How many times the scenario had been changed before.
    pub missed_changes: u32,
}

impl Joined {
    /// What is not known, for the end of a list of changes.
    pub fn words(&self) -> String {
        match self.missed_changes {
            0 => "monitor joined".to_owned(),
            1 => "monitor joined after 1 change".to_owned(),
            count => format!("monitor joined after {count} changes"),
        }
    }
}
