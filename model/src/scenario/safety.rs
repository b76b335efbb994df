//! Limits of the torque, and what happens when commands stay away.

use std::time::Duration;

use super::{
    error::ScenarioError,
    key::{
        Default::{Value, Words},
        Form, Parameter, Range,
    },
    section::Section,
};

const TORQUE_LIMIT: Parameter = Parameter::new(
    "safety.torque_limit",
    Form::JointList(Range::Positive),
    "N m",
    Words("no limit"),
    "A torque beyond it is scaled down as a whole, on all joints and with the echo.",
);
const COMMAND_TIMEOUT: Parameter = Parameter::new(
    "safety.command_timeout",
    Form::Duration(Duration::from_nanos(1)),
    "",
    Words("never"),
    "How long a torque may act without a fresh one; older ones do not take effect.",
);
const ON_TIMEOUT: Parameter = Parameter::new(
    "safety.on_timeout",
    Form::Choice(&["hold", "zero", "damp"]),
    "",
    Value("\"hold\""),
    "What the plant does then: keep the last torque, no torque, or brake the joints.",
);
const DAMPING: Parameter = Parameter::new(
    "safety.damping",
    Form::Number(Range::Positive),
    "N m s/rad",
    Value("10.0"),
    "How \"damp\" brakes: τ = −damping q̇ within the torque limits.",
);
const LEASE: Parameter = Parameter::new(
    "safety.lease",
    Form::Duration(Duration::from_nanos(1)),
    "",
    Value("\"100 ms\""),
    "How long the leading controller may leave a state unanswered before another one leads.",
);
/// The keys of `safety`.
pub(super) const KEYS: &[&Parameter] =
    &[&TORQUE_LIMIT, &COMMAND_TIMEOUT, &ON_TIMEOUT, &DAMPING, &LEASE];

/// Limits the plant enforces on its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Safety {
    /// For each joint, N m; `None` if there is no limit.
    ///
    /// A command over a limit is scaled down as a whole: the direction of its task force stays, and
    /// the memory can say exactly which task force was in effect.
    pub torque_limit: Option<Vec<f64>>,
    /// How long a command may stand without a fresh one; `None` for ever.
    pub command_timeout: Option<Duration>,
    /// What happens then.
    pub on_timeout: OnTimeout,
    /// How long the leading controller may leave a state unanswered before another one leads;
    /// longer than any pause that a loop over a network makes by itself.
    pub lease: Duration,
}

/// What the plant does when no fresh command has come within the timeout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OnTimeout {
    /// Keep the last torque.
    Hold,
    /// No torque.
    Zero,
    /// τ = −damping q̇, N m s/rad.
    Damp(f64),
}

impl Safety {
    pub(super) fn read(section: Section<'_>, joints: usize) -> Result<Self, ScenarioError> {
        let damping = section.number(&DAMPING)?;
        let reactions = [OnTimeout::Hold, OnTimeout::Zero, OnTimeout::Damp(damping)];
        let safety = Self {
            torque_limit: section.one_or_each(&TORQUE_LIMIT, joints)?,
            command_timeout: section.optional_duration(&COMMAND_TIMEOUT)?,
            on_timeout: section.word(&ON_TIMEOUT, &reactions)?,
            lease: section.duration(&LEASE)?,
        };
        section.finish()?;
        Ok(safety)
    }
}
