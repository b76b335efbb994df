//! Who may look, and who may turn knobs.
//!
//! Anybody who reaches the server may look, but no page of another origin: not by asking directly
//! (its `Origin` gives it away) and not by a name that it lets point here, DNS rebinding (`Host` then
//! holds that name). Knobs take the token on top.

use std::net::{IpAddr, Ipv6Addr};

use axum::http::{
    HeaderMap, HeaderName, StatusCode,
    header::{AUTHORIZATION, HOST, ORIGIN},
};
use subtle::ConstantTimeEq;

/// What the server asks for before it lets a knob be turned: 128 random bits, fresh at each start.
#[derive(Clone)]
pub struct Token(String);

impl Token {
    /// A fresh one from the operating system.
    pub fn draw() -> Result<Self, getrandom::Error> {
        let mut bits = [0; 16];
        getrandom::fill(&mut bits)?;
        Ok(Self(bits.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// As it is printed.
    pub fn words(&self) -> &str {
        &self.0
    }
}

/// Why a request was turned away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// For the response's first line.
    pub status: StatusCode,
    /// One sentence.
    pub reason: &'static str,
}

const fn refuse<T>(status: StatusCode, reason: &'static str) -> Result<T, Refusal> {
    Err(Refusal { status, reason })
}

/// Stands at the server's door.
#[derive(Clone)]
pub struct Guard {
    /// The name by which the user wants the server to be reached.
    pub name: String,
    /// What opens the knobs; nothing does if there is none.
    pub token: Option<Token>,
}

impl Guard {
    /// Whether a request may be answered at all.
    pub fn admit(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let foreign = StatusCode::FORBIDDEN;
        let Some(host) = only(headers, HOST) else {
            return refuse(StatusCode::BAD_REQUEST, "a request needs one Host header");
        };
        if !self.is_ours(name_of(host)) {
            return refuse(
                foreign,
                "this server is reached by its address, as localhost, or by the name given to --web",
            );
        }
        if headers.contains_key(ORIGIN) {
            let authority =
                only(headers, ORIGIN).and_then(|origin| origin.split_once("://")).map(|(_, at)| at);
            if !authority.is_some_and(|at| at.eq_ignore_ascii_case(host)) {
                return refuse(foreign, "pages of another origin are not served");
            }
        }
        Ok(())
    }

    /// Whether an admitted request may turn a knob.
    pub fn trust(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let Some(token) = &self.token else {
            return refuse(StatusCode::FORBIDDEN, "this monitor was started with --read-only");
        };
        let shown = only(headers, AUTHORIZATION).and_then(|words| words.strip_prefix("Bearer "));
        let is_right = |shown: &str| bool::from(shown.as_bytes().ct_eq(token.0.as_bytes()));
        if !shown.is_some_and(is_right) {
            return refuse(
                StatusCode::UNAUTHORIZED,
                "turning a knob takes the token that the monitor printed when it started",
            );
        }
        Ok(())
    }

    fn is_ours(&self, name: &str) -> bool {
        name.parse::<IpAddr>().is_ok()
            || name.eq_ignore_ascii_case("localhost")
            || (!name.is_empty() && name.eq_ignore_ascii_case(&self.name))
    }
}

/// The value of a header that is there exactly once.
fn only(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    let mut values = headers.get_all(name).iter();
    values.next().filter(|_| values.next().is_none())?.to_str().ok()
}

/// "name:port", "name" or "[address]:port" without port and brackets.
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

    fn guard() -> Guard {
        Guard { name: "robot.lab".to_owned(), token: Some(Token::draw().unwrap()) }
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
        ] {
            assert_eq!(guard().admit(&headers(&[("host", host)])), Ok(()), "{host}");
        }
        for host in [
            "evil.example:8080",
            "127.0.0.1.evil.example",
            "localhost.evil.example",
            "",
            ":8080",
            "[evil]:8080",
        ] {
            let refusal = guard().admit(&headers(&[("host", host)])).unwrap_err();
            assert_eq!(refusal.status, StatusCode::FORBIDDEN, "{host}");
        }
        let twice = [("host", "127.0.0.1"), ("host", "127.0.0.1")];
        for none in [&[][..], &twice] {
            let refusal = guard().admit(&headers(none)).unwrap_err();
            assert_eq!(refusal.status, StatusCode::BAD_REQUEST);
        }
    }

    #[test]
    fn a_page_of_another_origin_is_turned_away() {
        let host = ("host", "127.0.0.1:8080");
        assert_eq!(guard().admit(&headers(&[host, ("origin", "http://127.0.0.1:8080")])), Ok(()));
        for origin in [
            "http://evil.example",
            "http://127.0.0.1:8081",
            "http://127.0.0.1",
            "http://localhost:8080",
            "http://127.0.0.1:8080.evil.example",
            "null",
            "",
        ] {
            let refusal = guard().admit(&headers(&[host, ("origin", origin)])).unwrap_err();
            assert_eq!(refusal.status, StatusCode::FORBIDDEN, "{origin}");
        }
    }

    #[test]
    fn only_the_token_turns_knobs() {
        let guard = guard();
        let token = guard.token.clone().unwrap();
        let bearer = format!("Bearer {}", token.words());
        assert_eq!(guard.trust(&headers(&[("authorization", &bearer)])), Ok(()));
        let longer = format!("{bearer}0");
        for wrong in
            [&bearer[..bearer.len() - 1], &longer, "Bearer ", "Bearer", token.words(), "Basic x"]
        {
            let refusal = guard.trust(&headers(&[("authorization", wrong)])).unwrap_err();
            assert_eq!(refusal.status, StatusCode::UNAUTHORIZED, "{wrong}");
        }
        assert_eq!(guard.trust(&headers(&[])).unwrap_err().status, StatusCode::UNAUTHORIZED);
        let read_only = Guard { token: None, ..guard };
        let refusal = read_only.trust(&headers(&[("authorization", &bearer)])).unwrap_err();
        assert_eq!(refusal.status, StatusCode::FORBIDDEN);
    }

    #[test]
    fn no_two_tokens_are_the_same_and_each_has_128_bits() {
        let (one, other) = (Token::draw().unwrap(), Token::draw().unwrap());
        assert_ne!(one.words(), other.words());
        assert_eq!(one.words().len(), 32);
        assert!(one.words().bytes().all(|digit| digit.is_ascii_hexdigit()));
    }
}
