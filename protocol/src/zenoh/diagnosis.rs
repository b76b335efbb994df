//! Why a role cannot connect, for the user who waits.

use std::{
    net::{TcpStream, ToSocketAddrs},
    sync::mpsc::{self, RecvTimeoutError, Sender},
    thread,
    time::Duration,
};

use zenoh::config::EndPoint;

/// How long a role tries to connect before the user is told.
const PATIENCE: Duration = Duration::from_secs(2);
/// How long an address may take to accept a connection.
const CONNECTING: Duration = Duration::from_millis(800);

/// A thread that tells the user, once, why there is no connection yet, until this is dropped.
pub(super) struct Diagnosis {
    _until_dropped: Sender<()>,
}

impl Diagnosis {
    /// Begins to wait for a connection to one of these endpoints. Without a thread nothing is told.
    pub(super) fn begin(endpoints: Vec<String>, has_certificates: bool) -> Self {
        let (_until_dropped, dropped) = mpsc::channel();
        let tell = move || {
            // A name that nobody knows will hardly become known while we wait.
            let unknown = endpoints.iter().find_map(|endpoint| unknown_name(endpoint));
            let patience = if unknown.is_some() { Duration::ZERO } else { PATIENCE };
            if dropped.recv_timeout(patience) != Err(RecvTimeoutError::Timeout) {
                return;
            }
            for endpoint in &endpoints {
                let reason = unknown_name(endpoint)
                    .unwrap_or_else(|| unreachable_because(endpoint, has_certificates));
                tracing::warn!("cannot connect to {endpoint} yet: {reason}; still trying");
            }
        };
        // The connection itself does not need it.
        let _ = thread::Builder::new().name("diagnosis".to_owned()).spawn(tell);
        Self { _until_dropped }
    }
}

/// The protocol and the address of an endpoint, `host:port`.
fn parts(endpoint: &str) -> Option<(String, String)> {
    let endpoint: EndPoint = endpoint.parse().ok()?;
    Some((endpoint.protocol().as_str().to_owned(), endpoint.address().as_str().to_owned()))
}

/// What the system says of a host name that it does not know.
fn unknown_name(endpoint: &str) -> Option<String> {
    let (protocol, address) = parts(endpoint)?;
    if protocol.starts_with("unix") {
        return None;
    }
    let error = address.to_socket_addrs().err()?;
    let host = address.rsplit_once(':').map_or(address.as_str(), |(host, _)| host);
    Some(format!("the host name '{host}' is not known ({error})"))
}

/// What becomes of a connection to an endpoint.
fn unreachable_because(endpoint: &str, has_certificates: bool) -> String {
    let nobody = || "nobody answers there".to_owned();
    let Some((protocol, address)) = parts(endpoint) else { return nobody() };
    let is_tcp = protocol == "tcp" || protocol == "tls";
    let resolved = if is_tcp { address.to_socket_addrs().ok() } else { None };
    let Some(address) = resolved.and_then(|mut addresses| addresses.next()) else {
        return nobody();
    };
    match TcpStream::connect_timeout(&address, CONNECTING) {
        Err(error) => format!("{error}"),
        Ok(_) if has_certificates => {
            "its certificate is of another authority or for another host name, or ours is not \
             accepted, or it is no Zenoh"
                .to_owned()
        }
        Ok(_) => "what listens there is no Zenoh, or asks for certificates (--certs)".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;

    #[test]
    fn the_reason_is_what_the_system_says() {
        let unknown = unknown_name("tcp/no-such-host.invalid:7447");
        assert!(unknown.is_some_and(|words| words.contains("'no-such-host.invalid' is not known")));
        assert_eq!(unknown_name("tcp/127.0.0.1:7447"), None);
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", listener.local_addr().unwrap());
        assert!(unreachable_because(&endpoint, false).contains("no Zenoh"));
        assert!(unreachable_because(&endpoint, true).contains("certificate"));
        drop(listener);
        assert!(unreachable_because(&endpoint, false).contains("refused"));
        assert!(unreachable_because("udp/127.0.0.1:9", false).contains("nobody answers"));
    }
}
