//! The command line options by which any role finds its bus.

use std::path::PathBuf;

use clap::Args;
use mtj_model::scenario::{BusSettings, Override, ScenarioError, Wait};
use toml::Value;

use crate::{
    bus::BusError, member::Role, realtime::RealtimeOptions, shutdown::Shutdown, transport::AnyBus,
};

/// Where the others are. Each option stands for a key of the scenario's `[bus]` table.
#[derive(Args, Clone, Debug, Default)]
pub struct BusOptions {
    /// Transport: local, iceoryx2 (shared memory) or zenoh
    #[arg(long, value_name = "KIND")]
    pub bus: Option<String>,
    /// Name that separates the loops on one bus
    #[arg(long, value_name = "NAME")]
    pub session: Option<String>,
    /// How the loop waits: spin (fastest, a core of its own) or block
    #[arg(long, value_name = "MODE")]
    pub wait: Option<String>,
    /// Zenoh endpoint the plant listens on, like tcp/127.0.0.1:7447
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Option<String>,
    /// Zenoh endpoint to connect to, like tcp/127.0.0.1:7447
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Option<String>,
    /// Zenoh configuration file (JSON5) to start from
    #[arg(long, value_name = "FILE")]
    pub zenoh_config: Option<PathBuf>,
    /// Zenoh over TLS or QUIC with the certificates in this directory ('mtj certs' makes them)
    #[arg(long, value_name = "DIR")]
    pub certs: Option<PathBuf>,
    /// Whose certificate to show, if not the role's own: a monitor that is operator may turn knobs
    #[arg(long, value_name = "NAME")]
    pub identity: Option<String>,
    /// Zenoh: listen beyond this machine without certificates; anybody who gets there can move the arm
    #[arg(long)]
    pub insecure: bool,
}

impl BusOptions {
    /// What these options say, by keys of the scenario's `[bus]` table.
    fn pairs(&self) -> Vec<(&'static str, Value)> {
        let named = |key, value: &Option<String>| Some((key, Value::String(value.clone()?)));
        let path = |key, value: &Option<PathBuf>| {
            Some((key, Value::String(value.as_ref()?.display().to_string())))
        };
        // An address, a configuration or a certificate says which transport is meant.
        let zenoh = self.listen.is_some()
            || self.connect.is_some()
            || self.zenoh_config.is_some()
            || self.certs.is_some();
        let bus = self.bus.clone().or_else(|| zenoh.then(|| "zenoh".to_owned()));
        [
            named("kind", &bus),
            named("session", &self.session),
            named("wait", &self.wait),
            named("listen", &self.listen),
            named("connect", &self.connect),
            path("config", &self.zenoh_config),
            path("certs", &self.certs),
            named("identity", &self.identity),
            self.insecure.then_some(("insecure", Value::Boolean(true))),
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
            // What is no text is a switch that is on.
            arguments.extend(value.as_str().map(str::to_owned));
        }
        arguments
    }
}

/// The options of a role that gets its scenario from the plant.
#[derive(Args, Clone, Debug)]
pub struct RoleOptions {
    /// Where the plant is.
    #[command(flatten)]
    pub bus: BusOptions,
    /// How it runs.
    #[command(flatten)]
    pub realtime: RealtimeOptions,
    /// Stop when standard input ends
    #[arg(long, hide = true)]
    pub until_stdin_closes: bool,
}

impl RoleOptions {
    /// From now on the role stops when it is asked to.
    pub fn shutdown(&self) -> Shutdown {
        let shutdown = Shutdown::on_signals();
        if self.until_stdin_closes { shutdown.when_stdin_closes() } else { shutdown }
    }

    /// Joins the bus; `None` if asked to stop meanwhile.
    pub fn join(&self, role: Role, shutdown: Shutdown) -> Result<Option<AnyBus>, BusError> {
        let settings = self.bus.settings()?;
        self.realtime.before_joining();
        let bus = AnyBus::open(&settings, role, &|| shutdown.proceed())?;
        self.realtime.before_the_loop()?;
        Ok(bus)
    }

    /// How the user wants the role to wait, if that was said.
    pub fn wait(&self) -> Option<Wait> {
        self.bus.wait.as_ref()?;
        self.bus.settings().ok().map(|settings| settings.wait)
    }
}
