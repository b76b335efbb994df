//! The configuration of a Zenoh session.

use mtj_model::scenario::BusSettings;
use zenoh::Config;

use super::{ZenohError, access, credentials::Credentials, exposure, recovery};
use crate::member::Role;

/// How many samples may wait for Zenoh's sending thread before one is dropped: Zenoh's maximum.
///
/// Its default of 2 loses samples of a monitor's stream at 1 kHz whenever the thread gets no core
/// for some milliseconds; the loop reads the newest anyway.
const QUEUE: usize = 16;

/// How long a bridge's writer waits for room, µs: for as long a machine may keep Zenoh's sending
/// thread from a core.
const PATIENCE_US: &str = "200000";

/// The session's configuration: the user's file if there is one, overridden by the settings of the
/// command line and the scenario.
pub(super) fn configure(settings: &BusSettings, role: Role) -> Result<Config, ZenohError> {
    let mut config = match &settings.config {
        None => Config::default(),
        Some(path) => Config::from_file(path)
            .map_err(|source| ZenohError::ConfigurationFile { path: path.clone(), source })?,
    };
    let mut set = |key: &str, value: String| {
        config.insert_json5(key, &value).map_err(ZenohError::Configuration)
    };
    let ours = settings.config.is_none();
    let listens = listens(settings, role);
    if ours || settings.scouting.is_some() {
        let scouting = settings.scouting.unwrap_or(false);
        set("scouting/multicast/enabled", scouting.to_string())?;
    }
    if ours {
        // A role needs to know only the plant, and listens only where it is told.
        set("scouting/gossip/enabled", "false".to_owned())?;
        set("mode", if listens { "\"peer\"" } else { "\"client\"" }.to_owned())?;
        set("listen/endpoints", "[]".to_owned())?;
        set("transport/link/tx/queue/size/real_time", QUEUE.to_string())?;
        for (key, value) in recovery::SETTINGS {
            set(key, value.to_owned())?;
        }
    }
    match listens {
        true if ours || settings.listen.is_some() => {
            set("listen/endpoints", list(&settings.listen_endpoints()))?;
            if let Some(connect) = &settings.connect {
                set("connect/endpoints", list(connect))?;
            }
        }
        false if ours || settings.connect.is_some() || settings.listen.is_some() => {
            set("connect/endpoints", list(&settings.connect_endpoints()))?;
        }
        _ => {}
    }
    if let Some(credentials) = Credentials::of(settings, role)? {
        for (key, value) in credentials.tls() {
            set(&key, value)?;
        }
        // Peers without TLS, found by scouting or gossip, are not connected to.
        set("transport/link/protocols", r#"["tls", "quic"]"#.to_owned())?;
        if role == Role::Plant {
            let rules = access::rules(&settings.session).map_err(ZenohError::Configuration)?;
            set("access_control", rules)?;
        }
    }
    exposure::check(&config, settings)?;
    Ok(config)
}

/// Makes a writer wait a moment rather than drop a sample. A peer that accepts nothing more delays
/// the others once, and is then skipped until it accepts samples again.
pub(super) fn wait_before_drop(config: &mut Config) -> Result<(), ZenohError> {
    let key = "transport/link/tx/queue/congestion_control/drop/wait_before_drop";
    config.insert_json5(key, PATIENCE_US).map_err(ZenohError::Configuration)
}

/// Whether a role listens: a plant does, unless it has a router to connect to and no endpoint to
/// listen on.
pub(super) fn listens(settings: &BusSettings, role: Role) -> bool {
    role == Role::Plant && (settings.listen.is_some() || settings.connect.is_none())
}

/// Whether any link of a session may use TLS.
pub(super) fn has_tls(config: &Config) -> bool {
    ["listen/endpoints", "connect/endpoints"]
        .iter()
        .any(|key| config.get_json(key).is_ok_and(|endpoints| endpoints.contains("\"tls/")))
}

fn list(endpoints: &[String]) -> String {
    format!("{endpoints:?}")
}
