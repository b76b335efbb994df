//! How the processes of a scenario find and wait for each other.

use std::{path::PathBuf, time::Duration};

use super::{
    error::ScenarioError,
    key::{
        Default::{Value, Words},
        Form, Parameter,
    },
    section::{Origin, Section},
};

const KIND: Parameter = Parameter::new(
    "bus.kind",
    Form::Choice(&["local", "iceoryx2", "zenoh"]),
    "",
    Value("\"local\""),
    "In one process, shared memory between processes of one machine, or between machines.",
);
const SESSION: Parameter = Parameter::new(
    "bus.session",
    Form::Text("a name of letters, digits, '-' and '_', at most 64 (only a monitor takes '*')"),
    "",
    Value("\"default\""),
    "Separates loops that share a bus.",
);
const WAIT: Parameter = Parameter::new(
    "bus.wait",
    Form::Choice(&["spin", "block", "hybrid"]),
    "",
    Value("\"block\""),
    "How a role waits for the next sample: on a core of its own, asleep, or spinning for a while.",
);
const SPIN: Parameter = Parameter::new(
    "bus.spin",
    Form::Duration(Duration::from_nanos(1)),
    "",
    Value("\"100 us\""),
    "For how long \"hybrid\" spins before it sleeps.",
);
const ENDPOINTS: Form = Form::Text(
    "an endpoint like \"tcp/127.0.0.1:7447\" (protocol tcp, udp, tls, quic or unixsock-stream), or \
     a list of them",
);
const LISTEN: Parameter = Parameter::new(
    "bus.listen",
    ENDPOINTS,
    "",
    Words("tcp/127.0.0.1:7447; with certificates tls/127.0.0.1:7447"),
    "Zenoh: where the plant listens.",
);
const CONNECT: Parameter = Parameter::new(
    "bus.connect",
    ENDPOINTS,
    "",
    Words("where the plant listens"),
    "Zenoh: where controller and monitor connect.",
);
const SCOUTING: Parameter = Parameter::new(
    "bus.scouting",
    Form::Flag,
    "",
    Words("as the Zenoh configuration says, else false"),
    "Zenoh: whether peers are sought by multicast.",
);
const CONFIG: Parameter = Parameter::new(
    "bus.config",
    Form::Text("the path of a Zenoh configuration file"),
    "",
    Words("none"),
    "Zenoh: a configuration to start from.",
);
const CERTS: Parameter = Parameter::new(
    "bus.certs",
    Form::Text("the path of a directory of certificates"),
    "",
    Words("none"),
    "Zenoh: the authority's certificate and the role's own, for mutual TLS; 'mtj certs' makes \
     them.",
);
const IDENTITY: Parameter = Parameter::new(
    "bus.identity",
    Form::Text("a name of letters, digits, '-' and '_', at most 64"),
    "",
    Words("the role"),
    "Zenoh: whose certificate it is.",
);
const INSECURE: Parameter = Parameter::new(
    "bus.insecure",
    Form::Flag,
    "",
    Value("false"),
    "Zenoh: whether to listen beyond this machine without certificates.",
);
/// The keys of `bus`.
pub(super) const KEYS: &[&Parameter] = &[
    &KIND, &SESSION, &WAIT, &SPIN, &LISTEN, &CONNECT, &SCOUTING, &CONFIG, &CERTS, &IDENTITY,
    &INSECURE,
];

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
    /// Zenoh: whether peers are sought by multicast; `None` leaves it to the configuration.
    pub scouting: Option<bool>,
    /// Zenoh: a configuration file to start from.
    pub config: Option<PathBuf>,
    /// Zenoh: a directory with the authority's certificate and the role's own: mutual TLS.
    pub certs: Option<PathBuf>,
    /// Zenoh: whose certificate it is, if not the role's own.
    pub identity: Option<String>,
    /// Zenoh: whether to listen beyond this machine without certificates.
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
    /// Look again for so long, then sleep: as quick as [`Wait::Spin`] for what comes soon, and
    /// otherwise as modest as [`Wait::Block`].
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

/// For how long a hybrid wait spins by default: somewhat longer than a sleeping thread takes to
/// wake.
pub const DEFAULT_SPIN: Duration = Duration::from_micros(100);

/// Where a plant listens by default.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";

/// Where a plant with certificates listens by default.
const DEFAULT_TLS_ENDPOINT: &str = "tls/127.0.0.1:7447";

/// The transports an endpoint may name.
const PROTOCOLS: [&str; 5] = ["tcp", "udp", "tls", "quic", "unixsock-stream"];
/// Those of them that need certificates, and are the only ones when there are.
const CERTIFIED: [&str; 2] = ["tls", "quic"];
impl BusSettings {
    /// Reads a table with the keys of `[bus]`, as a role without a scenario does.
    pub fn from_table(origin: &str, bus: toml::Table) -> Result<Self, ScenarioError> {
        let origin = Origin::new(origin, Vec::new());
        let table = toml::Table::from_iter([("bus".to_owned(), toml::Value::Table(bus))]);
        let root = Section::root(&origin, &table);
        Self::read(root.section_or_empty("bus")?)
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

    pub(super) fn read(section: Section<'_>) -> Result<Self, ScenarioError> {
        let spin = section.duration(&SPIN)?;
        let path = |key| Ok(section.text(key, |_| true)?.map(PathBuf::from));
        let settings = Self {
            kind: section.word(&KIND, &[BusKind::Local, BusKind::Iceoryx2, BusKind::Zenoh])?,
            session: section.text(&SESSION, is_name)?.unwrap_or_default(),
            wait: section.word(&WAIT, &[Wait::Spin, Wait::Block, Wait::Hybrid(spin)])?,
            listen: endpoints(&section, &LISTEN)?,
            connect: endpoints(&section, &CONNECT)?,
            scouting: section.find(&SCOUTING, 1, toml::Value::as_bool)?,
            config: path(&CONFIG)?,
            certs: path(&CERTS)?,
            identity: section.text(&IDENTITY, is_name)?,
            insecure: section.flag(&INSECURE)?,
        };
        settings.refuse_mixed(&section)?;
        section.finish()?;
        Ok(settings)
    }

    /// Refuses endpoints without certificates beside certificates, and the other way round.
    fn refuse_mixed(&self, section: &Section<'_>) -> Result<(), ScenarioError> {
        let has_certificates = self.certs.is_some();
        if self.config.is_some() && !has_certificates {
            return Ok(()); // The file may bring its own.
        }
        let expected = if has_certificates {
            "tls/ or quic/ beside bus.certs: with certificates every link needs one"
        } else {
            "tcp/, udp/ or unixsock-stream/, or certificates for tls and quic (--certs DIR; 'mtj \
             certs' makes them)"
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

/// Whether a session can have this name.
pub fn is_name(text: &str) -> bool {
    let fits = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    !text.is_empty() && text.len() <= 64 && text.chars().all(fits)
}

fn endpoints(section: &Section<'_>, key: &Parameter) -> Result<Option<Vec<String>>, ScenarioError> {
    section.find(key, 1, |value| {
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
