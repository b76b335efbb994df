//! How the processes of a scenario find and wait for each other.

use std::{path::PathBuf, time::Duration};

use super::{
    error::ScenarioError,
    section::{Origin, Section},
};

/// The bus a session runs on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BusSettings {
    /// Which transport.
    pub kind: BusKind,
    /// Separates the loops that share a bus.
    pub session: String,
    /// How a role waits for the next sample.
    pub wait: Wait,
    /// Zenoh: where the plant listens.
    pub listen: Option<Vec<String>>,
    /// Zenoh: where controller and monitor connect.
    pub connect: Option<Vec<String>>,
    /// Zenoh: whether peers are sought by multicast; not unless asked for.
    pub scouting: Option<bool>,
    /// Zenoh: a configuration file to start from.
    pub config: Option<PathBuf>,
    /// Zenoh: a directory with the authority's certificate and the role's own: mutual TLS.
    pub certs: Option<PathBuf>,
    /// Zenoh: whose certificate it is, if not the role's own.
    pub identity: Option<String>,
    /// Zenoh: whether to listen beyond this machine to anybody.
    pub insecure: bool,
}

/// The transports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusKind {
    /// In one process.
    Local,
    /// Shared memory between processes of one machine.
    Iceoryx2,
    /// Zenoh, between machines.
    Zenoh,
}

impl BusKind {
    /// The name in scenarios and in print.
    pub fn name(self) -> &'static str {
        match self {
            Self::Local => "local",
            Self::Iceoryx2 => "iceoryx2",
            Self::Zenoh => "zenoh",
        }
    }
}

/// How a role waits for the next sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wait {
    /// Look again at once: the shortest latency, and one core of its own.
    Spin,
    /// Sleep until woken.
    Block,
    /// Look again for so long, then sleep: as quick as [`Wait::Spin`] for what comes soon, and otherwise
    /// as modest as [`Wait::Block`].
    Hybrid(Duration),
}

impl Wait {
    /// The name in scenarios and in print.
    pub fn name(self) -> &'static str {
        match self {
            Self::Spin => "spin",
            Self::Block => "block",
            Self::Hybrid(_) => "hybrid",
        }
    }
}

/// For how long a hybrid wait spins when nobody says otherwise: somewhat longer than a sleeper takes to wake.
pub const DEFAULT_SPIN: Duration = Duration::from_micros(100);

/// Where a plant listens when nobody says otherwise.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";

/// Where it listens then if it has certificates.
const DEFAULT_TLS_ENDPOINT: &str = "tls/127.0.0.1:7447";

/// The transports an endpoint may name.
const PROTOCOLS: [&str; 5] = ["tcp", "udp", "tls", "quic", "unixsock-stream"];
/// Those of them that need certificates, and are the only ones when there are.
const CERTIFIED: [&str; 2] = ["tls", "quic"];
/// What sessions may be called.
const SESSION: &str =
    "a name of letters, digits, '-' and '_', at most 64 (only a monitor takes '*')";
/// What identities may be called.
const NAME: &str = "a name of letters, digits, '-' and '_', at most 64";

impl BusSettings {
    /// Reads a table with the keys of `[bus]`, as a role without a scenario does.
    pub fn from_table(origin: &str, bus: toml::Table) -> Result<Self, ScenarioError> {
        let origin = Origin::new(origin, Vec::new());
        let table = toml::Table::from_iter([("bus".to_owned(), toml::Value::Table(bus))]);
        let root = Section::root(&origin, &table);
        Self::read(root.optional_section("bus")?)
    }

    /// Where the plant listens: on loopback unless told otherwise.
    pub fn listen_endpoints(&self) -> Vec<String> {
        let default = if self.certs.is_some() { DEFAULT_TLS_ENDPOINT } else { DEFAULT_ENDPOINT };
        self.listen.clone().unwrap_or_else(|| vec![default.to_owned()])
    }

    /// Where the others connect: where the plant listens unless told otherwise.
    pub fn connect_endpoints(&self) -> Vec<String> {
        self.connect.clone().unwrap_or_else(|| self.listen_endpoints())
    }

    pub(super) fn read(section: Option<Section<'_>>) -> Result<Self, ScenarioError> {
        let mut settings = Self {
            kind: BusKind::Local,
            session: "default".to_owned(),
            wait: Wait::Block,
            listen: None,
            connect: None,
            scouting: None,
            config: None,
            certs: None,
            identity: None,
            insecure: false,
        };
        let Some(section) = section else { return Ok(settings) };
        let kinds =
            [("local", BusKind::Local), ("iceoryx2", BusKind::Iceoryx2), ("zenoh", BusKind::Zenoh)];
        settings.kind = section.choice("kind", &kinds, Some(settings.kind))?;
        if let Some(session) = section.optional("session", SESSION, name)? {
            settings.session = session;
        }
        let spin = section.duration("spin", Duration::from_nanos(1), Some(DEFAULT_SPIN))?;
        let waits = [Wait::Spin, Wait::Block, Wait::Hybrid(spin)].map(|wait| (wait.name(), wait));
        settings.wait = section.choice("wait", &waits, Some(settings.wait))?;
        settings.listen = endpoints(&section, "listen")?;
        settings.connect = endpoints(&section, "connect")?;
        settings.scouting = section.optional("scouting", "true or false", toml::Value::as_bool)?;
        settings.config = section
            .optional("config", "the path of a Zenoh configuration file", toml::Value::as_str)?
            .map(PathBuf::from);
        settings.certs = section
            .optional("certs", "the path of a directory of certificates", toml::Value::as_str)?
            .map(PathBuf::from);
        settings.identity = section.optional("identity", NAME, name)?;
        let insecure = section.optional("insecure", "true or false", toml::Value::as_bool)?;
        settings.insecure = insecure.unwrap_or(false);
        settings.refuse_mixed(&section)?;
        section.finish()?;
        Ok(settings)
    }

    /// With certificates nothing goes over a link without them; without, there are no links that need them.
    fn refuse_mixed(&self, section: &Section<'_>) -> Result<(), ScenarioError> {
        let has_certificates = self.certs.is_some();
        if self.config.is_some() && !has_certificates {
            return Ok(()); // The file may bring its own.
        }
        let expected = if has_certificates {
            "tls/ or quic/ beside bus.certs: with certificates nobody is heard without one"
        } else {
            "tcp/, udp/ or unixsock-stream/, or certificates for tls and quic (--certs DIR; 'mtj certs' makes them)"
        };
        let fits = |endpoint: &String| {
            let protocol = endpoint.split('/').next().unwrap_or_default();
            CERTIFIED.contains(&protocol) == has_certificates
        };
        for (key, endpoints) in [("listen", &self.listen), ("connect", &self.connect)] {
            if !endpoints.iter().flatten().all(fits) {
                return Err(section.refuse(key, expected));
            }
        }
        Ok(())
    }
}

/// Whether a session can be called so.
pub fn is_name(text: &str) -> bool {
    let fits = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    !text.is_empty() && text.len() <= 64 && text.chars().all(fits)
}

fn name(value: &toml::Value) -> Option<String> {
    value.as_str().filter(|text| is_name(text)).map(str::to_owned)
}

fn endpoints(section: &Section<'_>, key: &str) -> Result<Option<Vec<String>>, ScenarioError> {
    let expected = "an endpoint like \"tcp/127.0.0.1:7447\" (protocol tcp, udp, tls, quic or \
                    unixsock-stream), or a list of them";
    section.optional(key, expected, |value| {
        let one =
            |value: &toml::Value| value.as_str().filter(|text| is_endpoint(text)).map(String::from);
        match value.as_array() {
            Some(list) => list.iter().map(one).collect(),
            None => one(value).map(|endpoint| vec![endpoint]),
        }
    })
}

fn is_endpoint(text: &str) -> bool {
    let Some((protocol, address)) = text.split_once('/') else { return false };
    // Zenoh lets metadata and configuration follow the address.
    let address = address.split(['?', '#']).next().unwrap_or_default();
    PROTOCOLS.contains(&protocol)
        && match address.rsplit_once(':') {
            Some((host, port)) => !host.is_empty() && port.parse::<u16>().is_ok(),
            None => protocol == "unixsock-stream" && !address.is_empty(),
        }
}
