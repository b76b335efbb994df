//! The configuration of a Zenoh session.

use mtj_model::scenario::BusSettings;
use zenoh::Config;

use super::{access, credentials::Credentials, exposure, in_one_line};
use crate::{bus::BusError, member::Role};

/// How many samples may wait for Zenoh's sending thread before one is dropped: the most that Zenoh
/// allows. Its default of 2 loses samples of a monitor's stream at 1 kHz whenever the thread gets no
/// core for some milliseconds; the loop reads the newest anyway.
const QUEUE: usize = 16;

/// The session's configuration: the user's file if there is one, ours over it where it speaks of
/// what the user said on the command line or in the scenario.
pub(super) fn configure(settings: &BusSettings, role: Role) -> Result<Config, BusError> {
    let refuse = |error: zenoh::Error| {
        BusError::Settings(format!("the Zenoh configuration: {}", in_one_line(&error)))
    };
    let mut config = match &settings.config {
        None => Config::default(),
        Some(path) => Config::from_file(path).map_err(|error| {
            let reason = in_one_line(&error);
            BusError::Settings(format!("{}: not a Zenoh configuration ({reason})", path.display()))
        })?,
    };
    let mut set = |key: &str, value: String| config.insert_json5(key, &value).map_err(refuse);
    let ours = settings.config.is_none();
    if ours || settings.scouting.is_some() {
        let scouting = settings.scouting.unwrap_or(false);
        set("scouting/multicast/enabled", scouting.to_string())?;
    }
    if ours {
        // Nobody needs to know of anybody but the plant, and nobody listens but where told.
        set("scouting/gossip/enabled", "false".to_owned())?;
        set("mode", if role == Role::Plant { "\"peer\"" } else { "\"client\"" }.to_owned())?;
        set("listen/endpoints", "[]".to_owned())?;
        set("transport/link/tx/queue/size/real_time", QUEUE.to_string())?;
    }
    match role {
        Role::Plant if ours || settings.listen.is_some() => {
            set("listen/endpoints", list(&settings.listen_endpoints()))?;
            if settings.listen.is_some()
                && let Some(connect) = &settings.connect
            {
                set("connect/endpoints", list(connect))?;
            }
        }
        _ if ours || settings.connect.is_some() || settings.listen.is_some() => {
            set("connect/endpoints", list(&settings.connect_endpoints()))?;
        }
        _ => {}
    }
    if let Some(credentials) = Credentials::of(settings, role)? {
        for (key, value) in credentials.tls() {
            set(&key, value)?;
        }
        // Whatever else is found on the way, by scouting or gossip, is not spoken to.
        set("transport/link/protocols", r#"["tls", "quic"]"#.to_owned())?;
        if role == Role::Plant {
            set("access_control", access::rules(&settings.session).map_err(refuse)?)?;
        }
    }
    exposure::check(&config, settings)?;
    Ok(config)
}

/// Whether any link of a session may be one of TLS.
pub(super) fn has_tls(config: &Config) -> bool {
    ["listen/endpoints", "connect/endpoints"]
        .iter()
        .any(|key| config.get_json(key).is_ok_and(|endpoints| endpoints.contains("\"tls/")))
}

fn list(endpoints: &[String]) -> String {
    format!("{endpoints:?}")
}
