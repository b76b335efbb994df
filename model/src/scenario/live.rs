//! Changes to a running loop.

use super::{Override, Scenario, ScenarioError};

/// Keys and tables that a running loop can change between two samples. Arm, task and clock stay:
/// they define the run.
const LIVE: [&str; 5] = ["law", "link", "safety", "sensor", "timing.sample_period"];

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
        Self::parse(&self.name, &self.text, sets)
    }
}
