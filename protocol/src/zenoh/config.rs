//! The configuration of a Zenoh session.

use mtj_model::scenario::BusSettings;
use zenoh::Config;

use super::{access, credentials::Credentials, exposure, in_one_line, recovery};
use crate::{bus::BusError, member::Role};

/// How many samples may wait for Zenoh's sending thread before one is dropped: the most that Zenoh
/// allows. Its default of 2 loses samples of a monitor's stream at 1 kHz whenever the thread gets no
/// core for some milliseconds; the loop reads the newest anyway.
const QUEUE: usize = 16;

/// How long a patient writer waits for room, µs: what a machine may withhold from Zenoh's sending thread.
const PATIENCE_US: &str = "200000";

/// The session's configuration: the user's file if there is one, ours over it where it speaks of
/// what the user said on the command line or in the scenario.
pub(super) fn configure(settings: &BusSettings, role: Role) -> Result<Config, BusError> {
    let mut config = match &settings.config {
        None => Config::default(),
        Some(path) => Config::from_file(path).map_err(|error| {
            let reason = in_one_line(&error);
            BusError::Settings(format!("{}: not a Zenoh configuration ({reason})", path.display()))
        })?,
    };
    let mut set = |key: &str, value: String| config.insert_json5(key, &value).map_err(refusal);
    let ours = settings.config.is_none();
    let listens = listens(settings, role);
    if ours || settings.scouting.is_some() {
        let scouting = settings.scouting.unwrap_or(false);
        set("scouting/multicast/enabled", scouting.to_string())?;
    }
    if ours {
        // Nobody needs to know of anybody but the plant, and nobody listens but where told.
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
        // Whatever else is found on the way, by scouting or gossip, is not spoken to.
        set("transport/link/protocols", r#"["tls", "quic"]"#.to_owned())?;
        if role == Role::Plant {
            set("access_control", access::rules(&settings.session).map_err(refusal)?)?;
        }
    }
    exposure::check(&config, settings)?;
    Ok(config)
}

/// Rather waits a moment than drops a sample: nobody waits for the one who writes it. A peer that takes
/// nothing more holds up the others once, and is then passed over until it does.
pub(super) fn be_patient(config: &mut Config) -> Result<(), BusError> {
    let key = "transport/link/tx/queue/congestion_control/drop/wait_before_drop";
    config.insert_json5(key, PATIENCE_US).map_err(refusal)
}

/// Whether a role waits for others to connect: a plant does, unless it is told of a router to connect to
/// and of nowhere to listen.
pub(super) fn listens(settings: &BusSettings, role: Role) -> bool {
    role == Role::Plant && (settings.listen.is_some() || settings.connect.is_none())
}

fn refusal(error: zenoh::Error) -> BusError {
    BusError::Settings(format!("the Zenoh configuration: {}", in_one_line(&error)))
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
