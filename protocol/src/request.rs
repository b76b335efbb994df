//! Requests to change a running loop, and the plant's answers.

use std::time::Duration;

use mtj_model::MAX_JOINTS;
use serde::{Deserialize, Serialize};

use crate::sample::{ChangeSample, Header, Joints, RequestSample, VERSION, padded, text, text_of};

/// A request to change the running loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Request {
    /// Set keys of the scenario, each as `key=value`.
    Set(Vec<String>),
    /// Stop the run's time.
    Pause,
    /// Continue the run's time.
    Resume,
    /// Begin a new run from the initial state, with the scenario as changed so far.
    Reset,
    /// Disturb the arm with a torque that neither controller nor actuator know of.
    Kick {
        /// On each joint, N m; joints that are not listed get none.
        torque: Vec<f64>,
        /// Duration, ms.
        milliseconds: f64,
    },
}

/// The shortest kick, ms: a nanosecond.
const SHORTEST_KICK: f64 = 1e-6;
/// The longest kick, ms.
const LONGEST_KICK: f64 = 60_000.0;

/// Why a request makes no sense, whatever the scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RequestError {
    /// The list of keys to set is empty.
    #[error("nothing to set: expected KEY=VALUE, like law.memory.policy=delivered")]
    Empty,
    /// An entry of the list is no single line.
    #[error("each change is one line, KEY=VALUE")]
    NotOneLine,
    /// The list does not fit into a sample.
    #[error("too much to set at once: 384 bytes are the most")]
    TooLong,
    /// The torque or the duration of a kick is out of range.
    #[error(
        "a kick is a torque in N m for each of up to {MAX_JOINTS} joints, for more than 0 and up \
         to {LONGEST_KICK} ms"
    )]
    Kick,
    /// A sample asks for an action that does not exist.
    #[error("there is no action {0}")]
    UnknownAction(u64),
}

impl Request {
    /// Checks the request on its own; the plant checks it against its scenario.
    pub fn check(&self) -> Result<(), RequestError> {
        match self {
            Self::Set(sets) if sets.is_empty() => Err(RequestError::Empty),
            Self::Set(sets) if !sets.iter().all(|set| is_one_line(set)) => {
                Err(RequestError::NotOneLine)
            }
            Self::Set(sets) => {
                let lines = sets.join("\n");
                let fits = text_of(&text::<12>(&lines)) == lines && !lines.contains('\0');
                if fits { Ok(()) } else { Err(RequestError::TooLong) }
            }
            Self::Kick { torque, milliseconds } => {
                let is_torque = (1..=MAX_JOINTS).contains(&torque.len())
                    && torque.iter().all(|torque| torque.is_finite());
                let lasts = (SHORTEST_KICK..=LONGEST_KICK).contains(milliseconds);
                if is_torque && lasts { Ok(()) } else { Err(RequestError::Kick) }
            }
            Self::Pause | Self::Resume | Self::Reset => Ok(()),
        }
    }

    /// The sample that sends the request to the plant of `run`, identified by a number of the
    /// sender's choice.
    pub fn to_sample(&self, run: u64, number: u64) -> RequestSample {
        // A request is about no arm in particular; the counts are there for its admission.
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

    /// Reads and checks the request that a sample carries.
    pub fn from_sample(sample: &RequestSample) -> Result<Self, RequestError> {
        let request = match sample.action {
            0 => Self::Set(lines(text_of(&sample.text))),
            1 => Self::Pause,
            2 => Self::Resume,
            3 => Self::Reset,
            4 => Self::kick(&sample.torque, sample.duration_ns),
            action => return Err(RequestError::UnknownAction(action)),
        };
        request.check()?;
        Ok(request)
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

fn is_one_line(set: &str) -> bool {
    set.lines().count() == 1 && !set.contains(['\n', '\r'])
}

fn lines(text: &str) -> Vec<String> {
    text.lines().map(str::to_owned).collect()
}

impl ChangeSample {
    /// The plant's answer to a request: in effect from `header`'s instant, or refused for a reason.
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

    /// `Ok` if the change is in effect, otherwise the reason why not.
    pub fn outcome(&self) -> Result<(), &str> {
        if self.accepted == 1 { Ok(()) } else { Err(text_of(&self.text)) }
    }

    /// The change in a few words.
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
