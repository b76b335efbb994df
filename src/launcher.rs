//! Starts roles as processes of their own from this program's executable, and ends them.

use std::{
    env,
    io::{self, Write},
    net::TcpListener,
    pin::pin,
    process::{ExitStatus, Stdio},
    time::Duration,
};

use mtj_model::scenario::{BusKind, Scenario};
use mtj_options::BusOptions;
use mtj_plant::report::Report;
use mtj_protocol::{member::Role, shutdown::Shutdown};
use tokio::{
    io::{AsyncBufReadExt, AsyncReadExt, BufReader},
    process::{Child, ChildStderr, ChildStdin, Command},
    sync::oneshot,
    time::{sleep, timeout},
};

use crate::{
    command::monitor::LISTENING,
    options::{realtime::LoopRealtime, scenario::ScenarioOptions},
};

/// How long a role may take to end after it was asked to.
const GRACE: Duration = Duration::from_secs(3);

/// Why a launch did not end well.
#[derive(Debug, thiserror::Error)]
pub enum LaunchError {
    /// A process could not be started or waited for.
    #[error("a role could not be started: {0}")]
    Io(#[from] io::Error),
    /// A role ended on its own; it has said why on standard error.
    #[error("the {0} ended early ({1})")]
    Role(&'static str, ExitStatus),
    /// The plant ended without a report.
    #[error("the plant ended without a report")]
    NoReport,
}

impl LaunchError {
    /// Whether the role has told the user itself why it ended.
    pub fn is_explained(&self) -> bool {
        matches!(self, Self::Role(_, status) if status.code().is_some())
    }

    /// The exit status to pass on.
    pub fn code(&self) -> u8 {
        match self {
            Self::Role(_, status) => {
                status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1)
            }
            _ => 1,
        }
    }
}

/// What to start.
pub struct Launch {
    /// The experiment, with the bus it runs on.
    pub options: ScenarioOptions,
    /// Whether the plant waits for a reset after a divergence, rather than end.
    pub keeps_open: bool,
    /// Where the plant writes its trace.
    pub trace: Option<std::path::PathBuf>,
    /// The monitor that shows the run, if one does.
    pub monitor: Option<Show>,
    /// How plant and controller run.
    pub realtime: LoopRealtime,
}

/// How a run is shown.
pub struct Show {
    /// Printed when the monitor listens.
    pub greeting: String,
    /// The monitor's arguments.
    pub arguments: Vec<String>,
}

impl Launch {
    /// Gives the launch a session of its own, and on Zenoh a free port on loopback, where the user
    /// has not named them: launches do not get in each other's way.
    pub fn separate(mut self, scenario: &Scenario) -> io::Result<Self> {
        let bus = &mut self.options.bus;
        if bus.session.session.is_none() && scenario.bus.session == "default" {
            bus.session.session = Some(format!("mtj-{}", std::process::id()));
        }
        let addressed = bus.listen.is_some()
            || scenario.bus.listen.is_some()
            || scenario.bus.connect.is_some()
            || scenario.bus.config.is_some();
        if scenario.bus.kind == BusKind::Zenoh && !addressed {
            let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
            let protocol = if scenario.bus.certs.is_some() { "tls" } else { "tcp" };
            bus.listen = Some(format!("{protocol}/127.0.0.1:{port}"));
        }
        Ok(self)
    }

    /// Starts the roles, waits for the plant to end, ends the others, and returns the plant's
    /// report.
    pub async fn run(&self, scenario: &Scenario) -> Result<Report, LaunchError> {
        let mut plant = self.spawn("plant", &self.plant_arguments(), Stdio::piped())?;
        let mut monitor = match &self.monitor {
            Some(show) => Some(self.spawn_monitor(show, scenario, &mut plant).await?),
            None => None,
        };
        // Last, because the run begins with it: a recorder is to hear the first sample.
        let arguments = self.controller_arguments(scenario);
        let mut controller = self.spawn("controller", &arguments, Stdio::null())?;
        let mut output = String::new();
        let mut results = plant.process.stdout.take().ok_or(LaunchError::NoReport)?;
        // Read by one future from first to last: one that is dropped loses what it has read.
        let mut plant_is_done = false;
        let mut reading = pin!(results.read_to_string(&mut output));
        let ended_first = tokio::select! {
            read = &mut reading => {
                read?;
                plant_is_done = true;
                None
            }
            status = controller.process.wait() => Some(("controller", status?)),
            status = ended(&mut monitor) => Some(("monitor", status?)),
            () = asked_to_stop() => None,
        };
        if !plant_is_done {
            // On Ctrl-C every role gets the signal, so the one that ends first is no failure.
            plant.leash = None;
            reading.await?;
        }
        let status = plant.end().await?;
        controller.end().await?;
        if let Some(monitor) = &mut monitor {
            monitor.end().await?;
        }
        match (ended_first, status) {
            (Some((role, status)), _) if !status.success() => Err(LaunchError::Role(role, status)),
            (_, Some(status)) if !status.success() => Err(LaunchError::Role("plant", status)),
            _ => serde_json::from_str(&output).map_err(|_| LaunchError::NoReport),
        }
    }

    fn plant_arguments(&self) -> Vec<String> {
        let mut options = self.options.clone();
        options.bus.session.identity = None; // Is meant for the monitor; a plant is itself.
        let mut arguments = options.arguments();
        arguments.extend(self.realtime.plant().arguments());
        arguments.push("--json".to_owned());
        if self.keeps_open {
            arguments.push("--keep-open".to_owned());
        }
        if let Some(trace) = &self.trace {
            arguments.extend(["--trace".to_owned(), trace.display().to_string()]);
        }
        arguments
    }

    /// The others need only to know where the plant is; they fetch the scenario from it.
    fn join_options(&self, scenario: &Scenario, identity: Option<&str>) -> BusOptions {
        let BusOptions { mut session, connect, listen, .. } = self.options.bus.clone();
        // Where the plant listens, if this launch chose it.
        let mut connect = connect.or(listen);
        session.identity = identity.map(str::to_owned);
        session.insecure = false; // They do not listen.
        session.certs = scenario.bus.certs.clone();
        session.bus = Some(scenario.bus.kind.name().to_owned());
        session.session = session.session.or_else(|| Some(scenario.bus.session.clone()));
        if let Some(config) = &scenario.bus.config {
            session.zenoh_config = Some(config.clone());
        }
        if scenario.bus.listen.is_some() || scenario.bus.connect.is_some() {
            connect = scenario.bus.connect_endpoints().into_iter().next();
        }
        BusOptions { session, connect, ..BusOptions::default() }
    }

    fn controller_arguments(&self, scenario: &Scenario) -> Vec<String> {
        let wait = self.options.bus.wait.clone();
        let bus = BusOptions { wait, ..self.join_options(scenario, None) };
        [bus.arguments(), self.realtime.controller().arguments()].concat()
    }

    fn spawn(&self, role: &str, arguments: &[String], stdout: Stdio) -> io::Result<RoleProcess> {
        let mut command = Command::from(role_command(role, arguments, stdout)?);
        let mut process = command.kill_on_drop(true).spawn()?;
        let leash = process.stdin.take();
        Ok(RoleProcess { process, leash })
    }

    /// Starts a monitor and waits until it listens, as long as it and the plant live, for a bounded
    /// time.
    async fn spawn_monitor(
        &self,
        show: &Show,
        scenario: &Scenario,
        plant: &mut RoleProcess,
    ) -> io::Result<RoleProcess> {
        // The user who starts a loop may change it.
        let own = scenario.bus.certs.is_some().then_some(Role::Operator.name());
        let identity = self.options.bus.session.identity.as_deref().or(own);
        let bus = self.join_options(scenario, identity);
        let arguments = [bus.arguments(), show.arguments.clone()].concat();
        let mut command = role_command("monitor", &arguments, Stdio::inherit())?;
        command.stderr(Stdio::piped());
        let mut process = Command::from(command).kill_on_drop(true).spawn()?;
        let leash = process.stdin.take();
        if let Some(stderr) = process.stderr.take() {
            let (listens, is_listening) = oneshot::channel();
            tokio::spawn(pass_on(stderr, listens));
            tokio::select! {
                listening = timeout(GRACE, is_listening) => if let Ok(Ok(())) = listening {
                    writeln!(io::stdout(), "{}", show.greeting)?;
                },
                _ = plant.process.wait() => {}
            }
        }
        Ok(RoleProcess { process, leash })
    }

    /// The command that starts a controller for this launch.
    pub fn controller_command(&self, scenario: &Scenario) -> io::Result<std::process::Command> {
        role_command("controller", &self.controller_arguments(scenario), Stdio::null())
    }
}

/// A role from this program's executable, on a leash: it ends when its standard input closes.
fn role_command(
    role: &str,
    arguments: &[String],
    stdout: Stdio,
) -> io::Result<std::process::Command> {
    let mut command = std::process::Command::new(env::current_exe()?);
    command.arg(role).args(arguments).arg("--until-stdin-closes");
    command.stdin(Stdio::piped()).stdout(stdout);
    Ok(command)
}

/// A role in a process of its own.
struct RoleProcess {
    process: Child,
    /// The role's standard input; the role ends when it closes, even if this program is killed.
    leash: Option<ChildStdin>,
}

impl RoleProcess {
    /// Asks the role to end, and ends it if it does not.
    async fn end(&mut self) -> io::Result<Option<ExitStatus>> {
        self.leash = None;
        match timeout(GRACE, self.process.wait()).await {
            Ok(status) => status.map(Some),
            Err(_) => {
                self.process.kill().await?;
                Ok(None)
            }
        }
    }
}

/// Passes on what a monitor has to say on standard error, and says when it listens.
async fn pass_on(stderr: ChildStderr, listens: oneshot::Sender<()>) {
    let mut listens = Some(listens);
    let mut lines = BufReader::new(stderr).lines();
    while let Ok(Some(line)) = lines.next_line().await {
        if line == LISTENING {
            listens.take().map(|listens| listens.send(()));
        } else {
            let _ = writeln!(io::stderr(), "{line}");
        }
    }
}

/// When this program alone is asked to stop, as by a service manager: from a terminal, the roles
/// are asked too.
async fn asked_to_stop() {
    while Shutdown.proceed() {
        sleep(Duration::from_millis(50)).await;
    }
}

/// When an optional role ends; never, if there is none.
async fn ended(role: &mut Option<RoleProcess>) -> io::Result<ExitStatus> {
    match role {
        Some(role) => role.process.wait().await,
        None => std::future::pending().await,
    }
}
