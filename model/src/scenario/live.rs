//! Changes to a running loop.

use super::{Override, Scenario, ScenarioError, Template, trajectory};

/// Keys and tables that a running loop can change between two samples. Arm, task and clock stay:
/// they define the run.
const LIVE: [&str; 9] = [
    "law",
    "link",
    "safety",
    "sensor",
    "timing.sample_period",
    "trajectory",
    "arm.friction",
    "actuator",
    "encoder",
];

impl Scenario {
    /// This scenario with some keys changed, validated, for a running loop.
    pub fn changed(&self, sets: &[Override]) -> Result<Self, ScenarioError> {
        let is_live = |path: &str| {
            LIVE.iter().any(|live| {
                path.strip_prefix(live)
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
            })
        };
        if let Some(fixed) = sets.iter().find(|set| !is_live(set.path())) {
            return Err(ScenarioError::NotLive {
                key: fixed.path().into(),
                value: fixed.value.to_string().into(),
                live: LIVE.join(", ").into(),
            });
        }
        let mut template = Template::parse(&self.name, &self.text)?;
        trajectory::remove_transition(&mut template.table);
        template.with(sets)
    }

    /// This scenario for another run from the beginning.
    pub fn anew(&self) -> Self {
        self.changed(&[]).unwrap_or_else(|_| self.clone())
    }

    /// Goes on from `before`, whose place this scenario takes at `time_ns`: its desired motion begins
    /// where that of `before` is.
    pub fn follow(&mut self, before: &Self, time_ns: u64) {
        let (time, duration) = (time_ns as f64 * 1e-9, self.blend.as_secs_f64());
        self.trajectory = self.trajectory.following(&before.trajectory, time, duration);
        if let Some(transition) = self.trajectory.transition {
            self.text.push_str(&transition.to_toml());
        }
    }
}
