//! The check that a session does not listen to anybody on the network by accident.

use std::net::IpAddr;

use mtj_model::scenario::BusSettings;
use serde_json::Value;
use zenoh::{Config, config::EndPoint};

use super::ZenohError;

/// Refuses to listen beyond this machine without mutual TLS, unless the settings say `insecure`.
///
/// Checks the configuration in effect, whether it comes from the command line, a scenario, a
/// configuration file or Zenoh's own defaults.
pub(super) fn check(config: &Config, settings: &BusSettings) -> Result<(), ZenohError> {
    if settings.insecure {
        return Ok(());
    }
    let authenticates = read(config, "transport/link/tls/enable_mtls") == true;
    let mode = read(config, "mode");
    let mut listen = read(config, "listen/endpoints");
    if listen.is_object() {
        listen = listen[mode.as_str().unwrap_or("peer")].take();
    }
    let open = endpoints(&listen).into_iter().find(|text| is_open(text, authenticates));
    let Some(endpoint) = open else { return Ok(()) };
    let setting = match &settings.config {
        Some(path) if settings.listen.is_none() => format!("{}: listen.endpoints", path.display()),
        _ => "bus.listen".to_owned(),
    };
    Err(ZenohError::Exposed { setting, endpoint })
}

fn read(config: &Config, key: &str) -> Value {
    let text = config.get_json(key).unwrap_or_default();
    serde_json::from_str(&text).unwrap_or_default()
}

/// The endpoints of a setting: a string, a list or a group of lists.
fn endpoints(value: &Value) -> Vec<String> {
    match value {
        Value::String(endpoint) => vec![endpoint.clone()],
        Value::Array(list) => list.iter().flat_map(endpoints).collect(),
        Value::Object(group) => {
            group.values().flat_map(endpoints).filter(|text| text.contains('/')).collect()
        }
        _ => Vec::new(),
    }
}

/// Whether an endpoint accepts anybody beyond this machine.
fn is_open(text: &str, authenticates: bool) -> bool {
    let Ok(endpoint) = text.parse::<EndPoint>() else { return true };
    match endpoint.protocol().as_str() {
        "unixsock-stream" => return false,
        "tls" | "quic" => {
            // An endpoint may have a configuration of its own.
            let own = endpoint.config().get("enable_mtls").map(|value| value == "true");
            if own.unwrap_or(authenticates) {
                return false;
            }
        }
        _ => {}
    }
    let address = endpoint.address();
    let host = address.as_str().rsplit_once(':').map_or(address.as_str(), |(host, _)| host);
    !is_loopback(host)
}

fn is_loopback(host: &str) -> bool {
    match host.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>() {
        Ok(address) => address.to_canonical().is_loopback(),
        Err(_) => host == "localhost",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loopback_addresses_and_mutual_tls_are_not_open() {
        for (endpoint, without, with) in [
            ("tcp/127.0.0.1:7447", false, false),
            ("tcp/127.9.9.9:7447", false, false),
            ("udp/[::1]:7447", false, false),
            ("tcp/[::ffff:127.0.0.1]:7447", false, false),
            ("tcp/localhost:7447", false, false),
            ("unixsock-stream//tmp/mtj.sock", false, false),
            ("tls/localhost:7447", false, false),
            ("tcp/0.0.0.0:7447", true, true),
            ("tcp/[::]:0", true, true),
            ("tcp/192.168.1.2:7447", true, true),
            ("udp/224.0.0.1:7447", true, true),
            ("tcp/robot:7447", true, true),
            ("tcp/localhost.example.org:7447", true, true),
            ("tls/0.0.0.0:7447", true, false),
            ("quic/[::]:7447", true, false),
            ("tls/0.0.0.0:7447#enable_mtls=false", true, true),
            ("tls/0.0.0.0:7447#enable_mtls=true", false, false),
            ("tcp/0.0.0.0:7447#enable_mtls=true", true, true),
        ] {
            assert_eq!(is_open(endpoint, false), without, "{endpoint} without certificates");
            assert_eq!(is_open(endpoint, true), with, "{endpoint} with certificates");
        }
    }
}
