//! The knobs of a running loop: what may be asked of a plant, and what it makes of that.

use std::time::Duration;

use mtj_model::MAX_JOINTS;
use serde::{Deserialize, Serialize};

use crate::sample::{ChangeSample, Header, Joints, RequestSample, VERSION, padded, text, text_of};

/// A request to change the running loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Knob {
    /// Set keys of the scenario, each as `key=value`.
    Set(Vec<String>),
    /// Let the run's time stand still.
    Pause,
    /// Let it go on.
    Resume,
    /// Begin a new run from the initial state, with the scenario as it is by now.
    Reset,
    /// Disturb the arm with a torque that neither controller nor actuator know of.
    Kick {
        /// On each joint, N m; joints that are not named get none.
        torque: Vec<f64>,
        /// For how long, ms.
        milliseconds: f64,
    },
}

/// The shortest kick, ms: a nanosecond.
const SHORTEST_KICK: f64 = 1e-6;
/// The longest kick, ms.
const LONGEST_KICK: f64 = 60_000.0;

impl Knob {
    /// What is wrong with it, whatever the scenario; `None` if nothing is.
    pub fn fault(&self) -> Option<String> {
        match self {
            Self::Set(sets) if sets.is_empty() => {
                Some("nothing to set: expected KEY=VALUE, like law.memory.policy=delivered".into())
            }
            Self::Set(sets)
                if sets
                    .iter()
                    .any(|set| set.lines().count() != 1 || set.contains(['\n', '\r'])) =>
            {
                Some("each change is one line, KEY=VALUE".into())
            }
            Self::Set(sets) => {
                let lines = sets.join("\n");
                let fits = text_of(&text::<12>(&lines)) == lines && !lines.contains('\0');
                (!fits).then(|| "too much to set at once: 384 bytes are the most".into())
            }
            Self::Kick { torque, milliseconds } => {
                let is_torque = (1..=MAX_JOINTS).contains(&torque.len())
                    && torque.iter().all(|torque| torque.is_finite());
                let is_short = *milliseconds >= SHORTEST_KICK && *milliseconds <= LONGEST_KICK;
                (!is_torque || !is_short).then(|| {
                    format!(
                        "a kick is a torque in N m for each of up to {MAX_JOINTS} joints, for more \
                         than 0 and up to {LONGEST_KICK} ms"
                    )
                })
            }
            Self::Pause | Self::Resume | Self::Reset => None,
        }
    }

    /// The sample that asks the plant of `run` for it, under a number of the asker's choice.
    pub fn request(&self, run: u64, number: u64) -> RequestSample {
        // A request is about no arm in particular; the counts are there for the gate.
        let header = Header {
            version: VERSION,
            joints: MAX_JOINTS as u32,
            axes: 1,
            run,
            sequence: number,
            ..Header::default()
        };
        let mut request = RequestSample { header, action: self.action(), ..Default::default() };
        match self {
            Self::Set(sets) => request.text = text(&sets.join("\n")),
            Self::Kick { torque, milliseconds } => {
                request.torque = padded(torque);
                request.duration_ns = (milliseconds * 1e6).round() as u64;
            }
            Self::Pause | Self::Resume | Self::Reset => {}
        }
        request
    }

    /// What a request asks for; the reason, if that is nothing a plant could do.
    pub fn of(request: &RequestSample) -> Result<Self, String> {
        let knob = match request.action {
            0 => Self::Set(lines(text_of(&request.text))),
            1 => Self::Pause,
            2 => Self::Resume,
            3 => Self::Reset,
            4 => Self::kick(&request.torque, request.duration_ns),
            action => return Err(format!("there is no action {action}")),
        };
        knob.fault().map_or(Ok(knob), Err)
    }

    fn kick(torque: &Joints, duration_ns: u64) -> Self {
        Self::Kick { torque: torque.to_vec(), milliseconds: duration_ns as f64 * 1e-6 }
    }

    fn action(&self) -> u64 {
        match self {
            Self::Set(_) => 0,
            Self::Pause => 1,
            Self::Resume => 2,
            Self::Reset => 3,
            Self::Kick { .. } => 4,
        }
    }
}

fn lines(text: &str) -> Vec<String> {
    text.lines().map(str::to_owned).collect()
}

impl ChangeSample {
    /// A plant's answer to a request: in effect from `header`'s instant, or refused for a reason.
    pub fn answer(header: Header, request: &RequestSample, outcome: Result<(), &str>) -> Self {
        Self {
            header,
            request: request.header.sequence,
            action: request.action,
            accepted: u64::from(outcome.is_ok()),
            duration_ns: request.duration_ns,
            torque: request.torque,
            text: outcome.map_or_else(text, |()| request.text),
        }
    }

    /// Whether it is in effect; why not, if it is not.
    pub fn outcome(&self) -> Result<(), &str> {
        if self.accepted == 1 { Ok(()) } else { Err(text_of(&self.text)) }
    }

    /// What was changed, in a few words.
    pub fn words(&self) -> String {
        match self.action {
            0 => text_of(&self.text).replace('\n', ", "),
            1 => "pause".to_owned(),
            2 => "resume".to_owned(),
            3 => "reset".to_owned(),
            _ => {
                let joints = MAX_JOINTS.min(self.header.joints as usize);
                format!(
                    "kick {:?} N m for {:?}",
                    &self.torque[..joints],
                    Duration::from_nanos(self.duration_ns)
                )
            }
        }
    }
}
