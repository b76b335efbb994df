//! The address at which the dashboard is served.

use std::{
    io::{self, ErrorKind},
    net::{SocketAddr, TcpListener, ToSocketAddrs},
};

use super::error::WebError;

/// How many ports are tried, one after the other.
const ATTEMPTS: u16 = 20;

/// `HOST:PORT` as the user wrote it; host or port may be missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Address {
    /// A name or an IP address.
    pub host: String,
    /// 0 for any free port.
    pub port: u16,
}

impl Address {
    /// Reads an address.
    pub(super) fn parse(text: &str) -> Result<Self, WebError> {
        let error = || WebError::Address { text: text.to_owned() };
        let (host, port) = match text.rsplit_once(':') {
            // An IPv6 address without brackets: its last part is not a port.
            Some((host, _)) if host.contains(':') && !host.ends_with(']') => (text, "8080"),
            Some((host, port)) => (host, port),
            None if text.bytes().all(|byte| byte.is_ascii_digit()) => ("", text),
            None => (text, "8080"),
        };
        let host = host.trim_start_matches('[').trim_end_matches(']');
        let host = if host.is_empty() { "127.0.0.1" } else { host };
        let is_host = |byte: u8| byte.is_ascii_alphanumeric() || b".-_:%".contains(&byte);
        if !host.bytes().all(is_host) {
            return Err(error());
        }
        Ok(Self { host: host.to_owned(), port: port.parse().map_err(|_| error())? })
    }

    /// Listens at the port, or at the next free one.
    pub(super) fn listen(&self) -> Result<TcpListener, WebError> {
        let last = self.port.saturating_add(if self.port == 0 { 0 } else { ATTEMPTS - 1 });
        for port in self.port..=last {
            match self.listen_at(port) {
                Ok(listener) => return Ok(listener),
                Err(error) if error.kind() == ErrorKind::AddrInUse => {}
                Err(source) => {
                    return Err(WebError::Listen { host: self.host.clone(), port, source });
                }
            }
        }
        Err(WebError::PortsInUse { host: self.host.clone(), first: self.port, last })
    }

    fn listen_at(&self, port: u16) -> io::Result<TcpListener> {
        let mut last_error = io::Error::from(ErrorKind::NotFound);
        for address in (self.host.as_str(), port).to_socket_addrs()? {
            match TcpListener::bind(address) {
                Ok(listener) => return Ok(listener),
                Err(error) => last_error = error,
            }
        }
        Err(last_error)
    }

    /// The URL for a browser on this machine, of a server that listens at `local`.
    pub(super) fn url(&self, local: SocketAddr) -> String {
        let port = local.port();
        if local.ip().is_unspecified() {
            return format!("http://127.0.0.1:{port}/");
        }
        if self.host.contains(':') {
            return format!("http://[{}]:{port}/", self.host);
        }
        format!("http://{}:{port}/", self.host)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn host_and_port_may_be_missing() {
        for (text, host, port) in [
            ("127.0.0.1:8080", "127.0.0.1", 8080),
            ("9000", "127.0.0.1", 9000),
            (":9000", "127.0.0.1", 9000),
            ("robot.lab", "robot.lab", 8080),
            ("0.0.0.0:0", "0.0.0.0", 0),
            ("[::1]:81", "::1", 81),
            ("::1", "::1", 8080),
        ] {
            let expected = Address { host: host.to_owned(), port };
            assert_eq!(Address::parse(text).unwrap(), expected, "{text}");
        }
        for text in ["127.0.0.1:99999", "http://127.0.0.1:8080", "a b:1", "localhost:http", "99999"]
        {
            let sentence = Address::parse(text).unwrap_err().to_string();
            assert!(sentence.contains(text) && sentence.contains("HOST:PORT"), "{sentence}");
        }
    }

    #[test]
    fn the_next_free_port_is_taken() {
        let any = Address::parse("127.0.0.1:0").unwrap();
        let taken = any.listen().unwrap();
        let busy = taken.local_addr().unwrap().port();
        let wanted = Address { port: busy, ..any };
        let next = wanted.listen().unwrap().local_addr().unwrap().port();
        assert!(next > busy && next < busy + ATTEMPTS);
    }
}
