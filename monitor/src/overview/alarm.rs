//! The alarms of a run, and when a monitor joined it.

use std::time::Duration;

use mtj_model::scenario::OnTimeout;

/// A condition that every display points out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Alarm {
    /// No message of a plant has come yet.
    NoPlant,
    /// No message of the plant has come for this long.
    PlantSilent(Duration),
    /// The plant waits for its first controller.
    NoController,
    /// No message of the controller has come for this long, though the plant sends states.
    ControllerSilent(Duration),
    /// Two plants are in the session, with these process ids; their samples get mixed.
    TwoPlants(u64, u64),
    /// The arm diverged at this time, s, and the plant waits for a reset.
    Diverged(f64),
    /// A joint left its limits, and the arm brakes.
    Stopped,
    /// No command takes effect; the arm is in its safe state.
    SafeState {
        /// What the plant does then: `hold`, `zero` or `damp`.
        reaction: OnTimeout,
        /// How many commands were too old when they came.
        too_old: u64,
    },
}

impl Alarm {
    /// Whether it only says that a role has not come yet.
    pub fn is_about_waiting(&self) -> bool {
        matches!(self, Self::NoPlant | Self::NoController)
    }

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
            Self::TwoPlants(one, other) => format!(
                "two plants are in this session, processes {one} and {other}: stop one of them, or \
                 give it another name with --session"
            ),
            Self::Diverged(time) => format!(
                "the arm diverged at t = {time:.1} s; a reset begins anew (button, key or mtj reset)"
            ),
            Self::Stopped => {
                "a joint left its limits: the arm brakes until it is resumed or reset (mtj \
                              resume, mtj reset)"
                    .to_owned()
            }
            Self::SafeState { reaction, too_old } => {
                let does = match reaction {
                    OnTimeout::Hold => "holds the last torque",
                    OnTimeout::Zero => "has no torque",
                    OnTimeout::Damp(_) => "brakes",
                };
                let why = match too_old {
                    0 => String::new(),
                    count => format!("; {count} commands were too old"),
                };
                format!(
                    "no command has taken effect within safety.command_timeout: the arm {does}{why}"
                )
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
