//! Zenoh's access control: which role may write and read which topic, by the names in certificates.
//!
//! The rules are those of `deploy/router.json5`. A plant without a router applies them itself, for
//! its own session.

use serde_json::Value;
use zenoh::{Config, Error};

/// A router's configuration, with rules for the sessions of all plants.
const ROUTER: &str = include_str!("../../router.json5");

/// The `access_control` of a session's plant.
pub(super) fn rules(session: &str) -> Result<String, Error> {
    let text = Config::from_json5(ROUTER)?.get_json("access_control")?;
    let mut rules: Value = serde_json::from_str(&text)?;
    // A session has one plant, the one that applies these rules.
    if let Some(policies) = rules["policies"].as_array_mut() {
        policies.retain(|policy| policy["id"] != "plants");
    }
    Ok(rules.to_string().replace("mtj/*/", &format!("mtj/{session}/")))
}
