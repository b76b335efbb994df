//! Limits of the torque, and what happens when commands stay away.

use std::time::Duration;

use super::{
    duration,
    error::ScenarioError,
    key::{
        Default::{Value, Words},
        Form, Parameter, Range,
    },
    link::Links,
    section::Section,
    timing::{ClockKind, Timing},
};

const TORQUE_LIMIT: Parameter = Parameter::new(
    "safety.torque_limit",
    Form::JointList(Range::Positive),
    "N m",
    Words("no limit"),
    "A torque beyond it is scaled down as a whole, on all joints and with the echo.",
);
const TORQUE_RATE_LIMIT: Parameter = Parameter::new(
    "safety.torque_rate_limit",
    Form::JointList(Range::Positive),
    "N m/s",
    Words("no limit"),
    "How fast commands may change a torque: one that asks for more goes a part of the way, on all \
     joints and with the echo. What ends an outage or a change of law is so made soft.",
);
const POSITION_MIN: Parameter = Parameter::new(
    "safety.position_min",
    Form::JointList(Range::Any),
    "rad",
    Words("no limit"),
    "The least angle of a joint: the arm stops beyond it, until it is resumed or reset.",
);
const POSITION_MAX: Parameter = Parameter::new(
    "safety.position_max",
    Form::JointList(Range::Any),
    "rad",
    Words("no limit"),
    "The largest angle of a joint: the arm stops beyond it, until it is resumed or reset.",
);
const SPEED_LIMIT: Parameter = Parameter::new(
    "safety.speed_limit",
    Form::JointList(Range::Positive),
    "rad/s",
    Words("no limit"),
    "The highest speed of a joint: the arm stops beyond it, until it is resumed or reset.",
);
const COMMAND_TIMEOUT: Parameter = Parameter::new(
    "safety.command_timeout",
    Form::DurationOr(&["never"]),
    "",
    Words("never in lockstep; in real time 0.5 s or 20 sample periods beyond the links' latencies"),
    "How long a torque may act without a fresh one; older ones do not take effect.",
);
const ON_TIMEOUT: Parameter = Parameter::new(
    "safety.on_timeout",
    Form::Choice(&["hold", "zero", "damp"]),
    "",
    Words("\"hold\" in lockstep, \"damp\" in real time"),
    "What the plant does then: keep the last torque, no torque, or brake the joints.",
);
const DAMPING: Parameter = Parameter::new(
    "safety.damping",
    Form::Number(Range::Positive),
    "N m s/rad",
    Value("10.0"),
    "How \"damp\" and a stop brake: τ = −damping q̇ within the torque limits.",
);
const LEASE: Parameter = Parameter::new(
    "safety.lease",
    Form::Duration(Duration::from_nanos(1)),
    "",
    Value("\"100 ms\""),
    "How long the leading controller may leave a state unanswered before another one leads.",
);
/// The keys of `safety`.
pub(super) const KEYS: &[&Parameter] = &[
    &TORQUE_LIMIT,
    &TORQUE_RATE_LIMIT,
    &POSITION_MIN,
    &POSITION_MAX,
    &SPEED_LIMIT,
    &COMMAND_TIMEOUT,
    &ON_TIMEOUT,
    &DAMPING,
    &LEASE,
];

/// Limits the plant enforces on its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Safety {
    /// For each joint, N m; `None` if there is no limit.
    ///
    /// A command over a limit is scaled down as a whole: the direction of its task force stays, and
    /// the memory can say exactly which task force was in effect.
    pub torque_limit: Option<Vec<f64>>,
    /// How much the torque of each joint may change from command to command, N m/s times the sample
    /// period; `None` if there is no limit. A timeout is not held up by it.
    pub torque_rate_limit: Option<Vec<f64>>,
    /// The bounds of each joint's motion, beyond which the arm stops.
    pub joint_limits: JointLimits,
    /// How a stop brakes, N m s/rad.
    pub damping: f64,
    /// How long a command may stand without a fresh one; `None` for ever.
    pub command_timeout: Option<Duration>,
    /// What happens then.
    pub on_timeout: OnTimeout,
    /// How long the leading controller may leave a state unanswered before another one leads;
    /// longer than any pause that a loop over a network makes by itself.
    pub lease: Duration,
}

/// The bounds of each joint's motion; `None` where there is none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointLimits {
    /// rad.
    pub position_min: Option<Vec<f64>>,
    /// rad.
    pub position_max: Option<Vec<f64>>,
    /// rad/s.
    pub speed: Option<Vec<f64>>,
}

impl JointLimits {
    /// Whether there are any.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The first joint, from 0, that is beyond one of its bounds at these angles, rad, and speeds,
    /// rad/s, and the name of the key.
    pub fn breach(&self, position: &[f64], velocity: &[f64]) -> Option<(usize, &'static str)> {
        let beyond = |limits: &Option<Vec<f64>>, is_beyond: &dyn Fn(usize, f64) -> bool| {
            let limits = limits.iter().flatten().enumerate();
            limits
                .filter(|(joint, limit)| is_beyond(*joint, **limit))
                .map(|(joint, _)| joint)
                .next()
        };
        let low = beyond(&self.position_min, &|joint, limit| position[joint] < limit);
        let high = beyond(&self.position_max, &|joint, limit| position[joint] > limit);
        let fast = beyond(&self.speed, &|joint, limit| velocity[joint].abs() > limit);
        low.map(|joint| (joint, POSITION_MIN.key))
            .or(high.map(|joint| (joint, POSITION_MAX.key)))
            .or(fast.map(|joint| (joint, SPEED_LIMIT.key)))
    }
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

/// Of an arm in real time for which no timeout was set: longer than any pause that a loop over a
/// network makes by itself.
const TIMEOUT: Duration = Duration::from_millis(500);

impl Safety {
    pub(super) fn read(
        section: Section<'_>,
        joints: usize,
        timing: &Timing,
        link: &Links,
    ) -> Result<Self, ScenarioError> {
        let damping = section.number(&DAMPING)?;
        let reactions = [OnTimeout::Hold, OnTimeout::Zero, OnTimeout::Damp(damping)];
        let is_real = timing.clock == ClockKind::Realtime;
        // None is "never".
        let timeout = section.find(&COMMAND_TIMEOUT, 1, |value| match value.as_str()? {
            "never" => Some(None),
            text => duration::parse(text).filter(|timeout| !timeout.is_zero()).map(Some),
        })?;
        let default = || {
            let latency = link.state.latency + link.torque.latency;
            is_real.then(|| TIMEOUT.max(20 * timing.sample_period) + latency)
        };
        let reaction = if is_real { OnTimeout::Damp(damping) } else { OnTimeout::Hold };
        let safety = Self {
            torque_limit: section.one_or_each(&TORQUE_LIMIT, joints)?,
            torque_rate_limit: section.one_or_each(&TORQUE_RATE_LIMIT, joints)?,
            joint_limits: JointLimits {
                position_min: section.one_or_each(&POSITION_MIN, joints)?,
                position_max: section.one_or_each(&POSITION_MAX, joints)?,
                speed: section.one_or_each(&SPEED_LIMIT, joints)?,
            },
            damping,
            command_timeout: timeout.unwrap_or_else(default),
            on_timeout: section.optional_word(&ON_TIMEOUT, &reactions)?.unwrap_or(reaction),
            lease: section.duration(&LEASE)?,
        };
        section.finish()?;
        Ok(safety)
    }
}
