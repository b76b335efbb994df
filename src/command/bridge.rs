//! `mtj bridge`: a loop on one bus, heard on another.

use std::{
    io::{self, Write},
    thread,
    time::{Duration, Instant},
};

use clap::Args;
use mtj_model::scenario::BusSettings;
use mtj_options::{BusOptions, SessionOptions, lossy::LossyWriter};
use mtj_protocol::{
    bus::Bus,
    member::{Member, Role},
    port::{Bridge, Tolerance, Traffic},
    shutdown::Shutdown,
    transport::AnyBus,
};

use crate::failure::Failure;

/// How long a sample may lie before it is carried over.
const PERIOD: Duration = Duration::from_millis(1);

/// Forward a loop from one bus to another, and requests back: the loop on shared memory, monitors
/// elsewhere
#[derive(Args, Debug)]
pub struct BridgeCommand {
    /// The bus the loop is on
    #[arg(long, value_name = "KIND", default_value = "iceoryx2")]
    from: String,
    /// The bus it is to be heard on
    #[arg(long, value_name = "KIND", default_value = "zenoh")]
    to: String,
    /// Refuse requests from beyond the bridge
    #[arg(long)]
    read_only: bool,
    #[command(flatten)]
    bus: BusOptions,
}

impl BridgeCommand {
    /// Carries until asked to stop.
    pub fn run(self) -> Result<(), Failure> {
        let (from, to) = self.sides()?;
        let shutdown = Shutdown::on_signals();
        let proceed = || shutdown.proceed();
        // Those beyond connect to the bridge as they do to a plant; here it listens, and hands in
        // requests.
        let role = if self.read_only { Role::Monitor } else { Role::Operator };
        let Some(far) = AnyBus::open_for_bridge(&to, &proceed)? else { return Ok(()) };
        let Some(near) = AnyBus::open(&from, role, &proceed)? else { return Ok(()) };
        let mut bridge = Bridge::open(&near, &far, self.read_only)?;
        let mut log = Log::new(LossyWriter::new(io::stdout())?);
        log.say(&format!(
            "mtj bridge: session '{}' from {} to {}; Ctrl-C ends the bridge, and nothing else",
            from.session, self.from, self.to
        ));
        let mut tolerance = Tolerance::default();
        while proceed() {
            tolerance.tolerate("forward samples", bridge.forward());
            log.refresh(&bridge);
            thread::sleep(PERIOD);
        }
        log.end(&bridge.traffic());
        Ok(())
    }

    /// The two buses.
    fn sides(&self) -> Result<(BusSettings, BusSettings), Failure> {
        if self.bus.session.bus.is_some() {
            return Err(Failure::bad_input(
                "--bus: a bridge is on two of them; name them with --from and --to",
            ));
        }
        let side = |kind: &String| {
            let bus = Some(kind.clone());
            let session = SessionOptions { bus, ..self.bus.session.clone() };
            BusOptions { session, ..self.bus.clone() }.settings()
        };
        let (from, to) = (side(&self.from)?, side(&self.to)?);
        if from.kind == to.kind {
            return Err(Failure::bad_input(format!(
                "--from {} --to {}: a bridge needs two different buses, like --from iceoryx2 --to zenoh",
                self.from, self.to
            )));
        }
        Ok((from, to))
    }
}

/// Says once a second how it goes.
struct Log {
    out: LossyWriter,
    before: Traffic,
    is_missing: bool,
    next: Instant,
}

const SECOND: Duration = Duration::from_secs(1);

impl Log {
    fn new(out: LossyWriter) -> Self {
        let next = Instant::now() + SECOND;
        Self { out, before: Traffic::default(), is_missing: false, next }
    }

    /// Prints a line; a reader that is gone does not end the bridge.
    fn say(&mut self, line: &str) {
        let _ = writeln!(self.out, "{line}");
    }

    fn refresh<N: Bus, F: Bus>(&mut self, bridge: &Bridge<'_, N, F>) {
        if Instant::now() < self.next {
            return;
        }
        self.next = Instant::now() + SECOND;
        let traffic = bridge.traffic();
        let missed = traffic.missed - self.before.missed;
        if missed > 0 && !self.is_missing {
            tracing::warn!(
                "{missed} states were gone before they could be carried over: the bridge gets \
                 too little time on this machine (said when it begins, counted always)"
            );
        }
        self.is_missing = missed > 0;
        self.say(&format!(
            "{:6} samples/s  requests {}  missed {}  malformed {}  here: {}",
            traffic.forwarded - self.before.forwarded,
            traffic.returned,
            traffic.missed,
            traffic.malformed,
            company(bridge.members())
        ));
        self.before = traffic;
    }

    fn end(&mut self, traffic: &Traffic) {
        let Traffic { forwarded, returned, missed, malformed } = traffic;
        self.say(&format!(
            "mtj bridge: carried {forwarded} samples over and {returned} requests back; {missed} states missed, \
             {malformed} messages malformed"
        ));
        self.out.finish();
    }
}

/// Which roles take part, in words.
fn company<'a>(members: impl Iterator<Item = &'a Member>) -> String {
    let (mut plants, mut controllers) = (0, 0);
    for member in members {
        match member.role {
            Role::Plant => plants += 1,
            Role::Controller => controllers += 1,
            _ => {}
        }
    }
    let plant = if plants > 0 { "a plant" } else { "no plant" };
    match controllers {
        0 => format!("{plant}, no controller"),
        1 => format!("{plant}, a controller"),
        _ => format!("{plant}, {controllers} controllers"),
    }
}
