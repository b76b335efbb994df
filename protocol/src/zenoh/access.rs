//! Who may say what: Zenoh's access control, by the names in certificates.
//!
//! The rules are those of `deploy/router.json5`, where they can be read; a plant that is connected to
//! directly keeps them itself, for its own session.

use serde_json::Value;
use zenoh::{Config, Error};

/// A router's configuration, whose rules are for the sessions of all plants.
const ROUTER: &str = include_str!("../../../deploy/router.json5");

/// The `access_control` of the plant of a session.
pub fn rules(session: &str) -> Result<String, Error> {
    let text = Config::from_json5(ROUTER)?.get_json("access_control")?;
    let mut rules: Value = serde_json::from_str(&text)?;
    // A session has one plant, and that is the one that keeps these rules.
    if let Some(policies) = rules["policies"].as_array_mut() {
        policies.retain(|policy| policy["id"] != "plants");
    }
    Ok(rules.to_string().replace("mtj/*/", &format!("mtj/{session}/")))
}
