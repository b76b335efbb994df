//! Where a loop is: each option stands for a key of a scenario's `[bus]` table.

use std::path::PathBuf;

use clap::Args;
use mtj_model::scenario::{BusSettings, Override, ScenarioError};
use mtj_protocol::{bus::BusError, member::Role, shutdown::Shutdown, transport::AnyBus};
use toml::Value;

/// Which loop on which bus
#[derive(Args, Clone, Debug, Default)]
pub struct SessionOptions {
    /// Transport: iceoryx2 (shared memory) or zenoh; local within one process
    #[arg(long, value_name = "KIND")]
    pub bus: Option<String>,
    /// Name that separates the loops on one bus
    #[arg(long, value_name = "NAME")]
    pub session: Option<String>,
    /// Zenoh configuration file (JSON5) to start from
    #[arg(long, value_name = "FILE")]
    pub zenoh_config: Option<PathBuf>,
    /// Zenoh over TLS or QUIC with the certificates in this directory ('mtj certs' makes them)
    #[arg(long, value_name = "DIR")]
    pub certs: Option<PathBuf>,
    /// Certificate to show, if not the role's own: a monitor with the operator's may change the
    /// loop
    #[arg(long, value_name = "NAME")]
    pub identity: Option<String>,
    /// Zenoh: listen beyond this machine without certificates, so that any process can move the arm
    #[arg(long)]
    pub insecure: bool,
}

/// Where the plant is
#[derive(Args, Clone, Debug, Default)]
pub struct JoinOptions {
    /// Which loop.
    #[command(flatten)]
    pub session: SessionOptions,
    /// Zenoh endpoint of the plant or of a router, like tcp/127.0.0.1:7447
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Option<String>,
}

/// Where a plant is, and how its loop waits
#[derive(Args, Clone, Debug, Default)]
pub struct BusOptions {
    /// Which loop.
    #[command(flatten)]
    pub session: SessionOptions,
    /// How the loop waits: spin (fastest, needs a core of its own), hybrid or block
    #[arg(long, value_name = "MODE")]
    pub wait: Option<String>,
    /// Zenoh endpoint the plant listens on, like tcp/127.0.0.1:7447
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Option<String>,
    /// Zenoh endpoint of a router to connect to, like tcp/127.0.0.1:7447
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Option<String>,
}

impl From<JoinOptions> for BusOptions {
    fn from(JoinOptions { session, connect }: JoinOptions) -> Self {
        Self { session, connect, ..Self::default() }
    }
}

impl BusOptions {
    /// The keys of the `[bus]` table that these options set.
    fn pairs(&self) -> Vec<(&'static str, Value)> {
        let Self { session, wait, listen, connect } = self;
        let named = |key, value: &Option<String>| Some((key, Value::String(value.clone()?)));
        let path = |key, value: &Option<PathBuf>| {
            Some((key, Value::String(value.as_ref()?.display().to_string())))
        };
        // An address, a configuration or a certificate says which transport is meant.
        let zenoh = listen.is_some()
            || connect.is_some()
            || session.zenoh_config.is_some()
            || session.certs.is_some();
        let bus = session.bus.clone().or_else(|| zenoh.then(|| "zenoh".to_owned()));
        [
            named("kind", &bus),
            named("session", &session.session),
            named("wait", wait),
            named("listen", listen),
            named("connect", connect),
            path("config", &session.zenoh_config),
            path("certs", &session.certs),
            named("identity", &session.identity),
            session.insecure.then_some(("insecure", Value::Boolean(true))),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// What these options change in a scenario.
    pub fn overrides(&self) -> Vec<Override> {
        self.pairs()
            .into_iter()
            .map(|(key, value)| Override::value(&format!("bus.{key}"), value))
            .collect()
    }

    /// The bus of a role that has no scenario yet: shared memory unless an option says otherwise.
    ///
    /// # Errors
    ///
    /// A sentence about the option that is not acceptable.
    pub fn settings(&self) -> Result<BusSettings, ScenarioError> {
        let mut table = toml::Table::new();
        table.insert("kind".to_owned(), "iceoryx2".into());
        for (key, value) in self.pairs() {
            table.insert(key.to_owned(), value);
        }
        BusSettings::from_table("command line", table)
    }

    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        let flag = |key: &str| match key {
            "kind" => "--bus".to_owned(),
            "config" => "--zenoh-config".to_owned(),
            _ => format!("--{key}"),
        };
        let mut arguments = Vec::new();
        for (key, value) in self.pairs() {
            arguments.push(flag(key));
            // A flag without a text is a switch that is on.
            arguments.extend(value.as_str().map(str::to_owned));
        }
        arguments
    }
}

impl JoinOptions {
    /// The bus on which the plant is.
    ///
    /// # Errors
    ///
    /// A sentence about the option that is not acceptable.
    pub fn settings(&self) -> Result<BusSettings, ScenarioError> {
        BusOptions::from(self.clone()).settings()
    }

    /// Joins the bus; `None` if asked to stop meanwhile.
    ///
    /// # Errors
    ///
    /// An option that is not acceptable, or a bus that cannot be joined.
    pub fn join(&self, role: Role, shutdown: Shutdown) -> Result<Option<AnyBus>, BusError> {
        let settings = self.settings()?;
        AnyBus::open(&settings, role, &|| shutdown.proceed())
    }
}
