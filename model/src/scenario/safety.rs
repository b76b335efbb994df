//! What keeps the arm safe when commands are too large or stay away.

use std::time::Duration;

use super::{
    error::ScenarioError,
    section::{self, Section},
};

/// Limits the plant enforces on its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Safety {
    /// Per joint, N m; infinite where there is none.
    ///
    /// A command over a limit is scaled down as a whole: the direction of its task force stays, and
    /// the memory can say exactly which task force was in effect.
    pub torque_limit: Vec<f64>,
    /// How long a command may stand without a fresh one; `None` for ever.
    pub command_timeout: Option<Duration>,
    /// What happens then.
    pub on_timeout: OnTimeout,
    /// How long the controller in charge may leave a state unanswered before another one takes over.
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

/// Longer than any pause that a loop over a network makes by itself.
const LEASE: Duration = Duration::from_millis(100);

impl Safety {
    pub(super) fn read(section: Option<Section<'_>>, joints: usize) -> Result<Self, ScenarioError> {
        let mut safety = Self {
            torque_limit: vec![f64::INFINITY; joints],
            command_timeout: None,
            on_timeout: OnTimeout::Hold,
            lease: LEASE,
        };
        let Some(section) = section else { return Ok(safety) };
        let expected = format!("a torque in N m greater than 0, or a list of {joints}");
        if let Some(limit) = section.per_axis("torque_limit", joints, &expected, |x| x > 0.0)? {
            safety.torque_limit = limit;
        }
        let never = Duration::MAX;
        let timeout = section.duration("command_timeout", Duration::from_nanos(1), Some(never))?;
        safety.command_timeout = (timeout != never).then_some(timeout);
        safety.lease = section.duration("lease", Duration::from_nanos(1), Some(LEASE))?;
        let damping = section
            .optional("damping", "a damping in N m s/rad greater than 0", section::positive)?
            .unwrap_or(10.0);
        let choices = [
            ("hold", OnTimeout::Hold),
            ("zero", OnTimeout::Zero),
            ("damp", OnTimeout::Damp(damping)),
        ];
        safety.on_timeout = section.choice("on_timeout", &choices, Some(OnTimeout::Hold))?;
        section.finish()?;
        Ok(safety)
    }
}
