//! Why Zenoh cannot be used, and what the user can do.

use std::{io, path::PathBuf};

use crate::{bus::BusError, certificate::CertificateError};

/// Why Zenoh cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ZenohError {
    /// The user's configuration file cannot be used.
    #[error("{}: not a Zenoh configuration ({})", path.display(), in_one_line(source))]
    ConfigurationFile {
        /// The file.
        path: PathBuf,
        /// Zenoh's reason.
        source: zenoh::Error,
    },
    /// A setting of ours has no place in the configuration.
    #[error("the Zenoh configuration: {}", in_one_line(.0))]
    Configuration(#[source] zenoh::Error),
    /// A certificate or a key cannot be used.
    #[error(
        "{} {source}; 'mtj certs' makes what belongs into {}",
        file.display(),
        directory.display()
    )]
    Credentials {
        /// The certificate or the key.
        file: PathBuf,
        /// The directory of certificates.
        directory: PathBuf,
        /// What is wrong with it.
        source: CertificateError,
    },
    /// A private key belongs to another certificate.
    #[error(
        "{} does not belong to {}; 'mtj certs' makes what belongs into {}",
        key.display(),
        certificate.display(),
        directory.display()
    )]
    ForeignKey {
        /// The key.
        key: PathBuf,
        /// The role's certificate.
        certificate: PathBuf,
        /// The directory of certificates.
        directory: PathBuf,
    },
    /// The session would listen to anybody on the network.
    #[error(
        "{setting} = {endpoint} is refused: anybody who reaches this address over the network \
         could move the arm; prove who connects with --certs DIR and a tls/ or quic/ address, \
         listen on 127.0.0.1, or say --insecure if the network is yours alone"
    )]
    Exposed {
        /// Where the endpoint is set.
        setting: String,
        /// The endpoint.
        endpoint: String,
    },
    /// The plant cannot listen.
    #[error(
        "bus.listen = {endpoints} cannot be listened on, perhaps because the port is in use ({}); \
         choose another with --listen",
        in_one_line(source)
    )]
    Listen {
        /// The endpoints, separated by commas.
        endpoints: String,
        /// Zenoh's reason.
        source: zenoh::Error,
    },
    /// The system refused a thread.
    #[error("a thread for Zenoh: {0}")]
    Thread(#[source] io::Error),
    /// The session failed.
    #[error("zenoh: {}", in_one_line(.0))]
    Session(#[source] zenoh::Error),
}

impl From<ZenohError> for BusError {
    fn from(error: ZenohError) -> Self {
        let is_bad_input = error.is_bad_input();
        Self::of(error, is_bad_input)
    }
}

impl ZenohError {
    /// Whether the user's input is to blame.
    fn is_bad_input(&self) -> bool {
        !matches!(self, Self::Thread(_) | Self::Session(_))
    }
}

/// Zenoh's message without line breaks and places in its source.
fn in_one_line(error: &zenoh::Error) -> String {
    let text = error.to_string();
    let mut words = text.split_whitespace().peekable();
    let mut line = String::new();
    while let Some(word) = words.next() {
        if word == "at"
            && let Some(place) = words.next_if(|place| place.contains(".rs:"))
        {
            line.extend(place.chars().filter(|c| matches!(c, ']' | ')')));
            continue;
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    line
}
