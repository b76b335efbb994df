//! Access control: who may watch, and who may send requests to the plant.
//!
//! Everybody who reaches the server may watch, except a page of another origin. Its `Origin` header
//! reveals a direct request; its `Host` header reveals DNS rebinding, where a foreign name points
//! to this server: only an address or one of the server's [`HostNames`] is accepted there. Requests
//! to the plant need the token as well.

use std::net::{IpAddr, Ipv6Addr};

use axum::http::{
    HeaderMap, HeaderName, StatusCode,
    header::{AUTHORIZATION, HOST, ORIGIN},
};

use super::{host_names::HostNames, token::Token};

/// Why a request is denied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Denial {
    pub status: StatusCode,
    /// The reason as one sentence.
    pub reason: &'static str,
}

const fn deny<T>(status: StatusCode, reason: &'static str) -> Result<T, Denial> {
    Err(Denial { status, reason })
}

/// Decides which HTTP requests the server serves.
#[derive(Clone)]
pub(super) struct AccessControl {
    /// The names under which browsers reach the server.
    pub names: HostNames,
    /// The secret that requests to the plant need; without one they are all denied.
    pub token: Option<Token>,
}

impl AccessControl {
    /// Denies requests of pages of another origin.
    pub(super) fn check_origin(&self, headers: &HeaderMap) -> Result<(), Denial> {
        let foreign = StatusCode::FORBIDDEN;
        let Some(host) = only(headers, HOST) else {
            return deny(StatusCode::BAD_REQUEST, "a request needs one Host header");
        };
        if !self.is_ours(name_of(host)) {
            return deny(
                foreign,
                "this server is reached by its address, as localhost, by the machine's name, or by \
                 a name given to --web or --web-host",
            );
        }
        if headers.contains_key(ORIGIN) {
            let authority =
                only(headers, ORIGIN).and_then(|origin| origin.split_once("://")).map(|(_, at)| at);
            if !authority.is_some_and(|at| at.eq_ignore_ascii_case(host)) {
                return deny(foreign, "pages of another origin are not served");
            }
        }
        Ok(())
    }

    /// Denies requests without the token.
    pub(super) fn check_token(&self, headers: &HeaderMap) -> Result<(), Denial> {
        let Some(token) = &self.token else {
            return deny(StatusCode::FORBIDDEN, "this monitor was started with --read-only");
        };
        let shown = only(headers, AUTHORIZATION).and_then(|words| words.strip_prefix("Bearer "));
        if !shown.is_some_and(|shown| token.is(shown)) {
            return deny(
                StatusCode::UNAUTHORIZED,
                "turning a knob takes the token that the monitor printed when it started, or the one \
                 in its --web-token-file",
            );
        }
        Ok(())
    }

    fn is_ours(&self, name: &str) -> bool {
        name.parse::<IpAddr>().is_ok() || self.names.contains(name)
    }
}

/// The value of a header that occurs exactly once.
fn only(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    let mut values = headers.get_all(name).iter();
    values.next().filter(|_| values.next().is_none())?.to_str().ok()
}

/// The host without port and brackets, from "name:port", "name" or "[address]:port".
fn name_of(host: &str) -> &str {
    if let Some((address, _)) = host.strip_prefix('[').and_then(|host| host.split_once(']')) {
        return if address.parse::<Ipv6Addr>().is_ok() { address } else { "" };
    }
    host.rsplit_once(':').map_or(host, |(name, _)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(&'static str, &str)]) -> HeaderMap {
        let mut headers = HeaderMap::new();
        for (name, value) in pairs {
            headers.append(*name, value.parse().unwrap());
        }
        headers
    }

    fn access() -> AccessControl {
        let names = HostNames::of_machine("arm7.plant.example").with("robot.lab");
        AccessControl { names, token: Some(Token::new().unwrap()) }
    }

    #[test]
    fn only_names_of_this_server_are_answered() {
        for host in [
            "127.0.0.1:8080",
            "[::1]:8080",
            "192.168.0.7",
            "localhost:80",
            "LocalHost",
            "robot.lab:1",
            "arm7:8080",
            "ARM7.local:8080",
            "arm7.plant.example",
        ] {
            assert_eq!(access().check_origin(&headers(&[("host", host)])), Ok(()), "{host}");
        }
        for host in [
            "evil.example:8080",
            "127.0.0.1.evil.example",
            "localhost.evil.example",
            "arm7.evil.example",
            "arm7.local.evil.example",
            "evil.local",
            "plant.example",
            "",
            ":8080",
            "[evil]:8080",
        ] {
            let denial = access().check_origin(&headers(&[("host", host)])).unwrap_err();
            assert_eq!(denial.status, StatusCode::FORBIDDEN, "{host}");
        }
        let twice = [("host", "127.0.0.1"), ("host", "127.0.0.1")];
        for none in [&[][..], &twice] {
            let denial = access().check_origin(&headers(none)).unwrap_err();
            assert_eq!(denial.status, StatusCode::BAD_REQUEST);
        }
    }

    #[test]
    fn a_page_of_another_origin_is_turned_away() {
        let host = ("host", "127.0.0.1:8080");
        assert_eq!(
            access().check_origin(&headers(&[host, ("origin", "http://127.0.0.1:8080")])),
            Ok(())
        );
        for origin in [
            "http://evil.example",
            "http://127.0.0.1:8081",
            "http://127.0.0.1",
            "http://localhost:8080",
            "http://127.0.0.1:8080.evil.example",
            "null",
            "",
        ] {
            let denial = access().check_origin(&headers(&[host, ("origin", origin)])).unwrap_err();
            assert_eq!(denial.status, StatusCode::FORBIDDEN, "{origin}");
        }
    }

    #[test]
    fn only_the_token_turns_knobs() {
        let access = access();
        let token = access.token.clone().unwrap();
        let bearer = format!("Bearer {}", token.as_str());
        assert_eq!(access.check_token(&headers(&[("authorization", &bearer)])), Ok(()));
        let longer = format!("{bearer}0");
        for wrong in
            [&bearer[..bearer.len() - 1], &longer, "Bearer ", "Bearer", token.as_str(), "Basic x"]
        {
            let denial = access.check_token(&headers(&[("authorization", wrong)])).unwrap_err();
            assert_eq!(denial.status, StatusCode::UNAUTHORIZED, "{wrong}");
        }
        assert_eq!(access.check_token(&headers(&[])).unwrap_err().status, StatusCode::UNAUTHORIZED);
        let read_only = AccessControl { token: None, ..access };
        let denial = read_only.check_token(&headers(&[("authorization", &bearer)])).unwrap_err();
        assert_eq!(denial.status, StatusCode::FORBIDDEN);
    }
}
