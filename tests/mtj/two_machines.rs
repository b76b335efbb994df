//! The controller on another machine: networks that fail, plants that come and go, routers between.
//!
//! With `MTJ_LONG=1` in the environment interruptions take up to ten seconds and runs a minute.

use std::{
    collections::BTreeSet,
    env,
    path::Path,
    process::Child,
    thread,
    time::{Duration, Instant},
};

use crate::machines::{Cut, Network};
use crate::{
    machine,
    needs::needs,
    session::{Running, Session, eventually},
};
use nix::sys::signal::Signal;
use serde_json::Value;
use zenoh::Wait;

const PLANT: u32 = 0;
const CONTROLLER: u32 = 1;
const ROUTER: u32 = 2;

/// What scenarios/remote/mtj.toml says.
const SAMPLE_PERIOD: f64 = 0.01;
const COMMAND_TIMEOUT: f64 = 0.1;
const DAMPING: f64 = 10.0;
const TORQUE_LIMIT: [f64; 2] = [40.0, 15.0];

fn is_long() -> bool {
    env::var_os("MTJ_LONG").is_some()
}

/// Two machines, a session, and how its roles get at each other.
struct Site {
    network: Network,
    session: Session,
    plant: String,
    others: String,
}

impl Site {
    fn over(protocol: &str) -> Self {
        let (network, session) = (Network::of(2), Session::on("zenoh"));
        let address = network.address(PLANT);
        let security = if protocol == "tcp" {
            "--insecure".to_owned()
        } else {
            let certs =
                session.start_exactly(&["certs", "--out", "certs", "--host", &address]).wait();
            assert!(certs.success());
            "--certs certs".to_owned()
        };
        let endpoint = format!("{protocol}/{address}:7447");
        let name = &session.name;
        let plant = format!("--session {name} --listen {endpoint} {security}");
        let security = if protocol == "tcp" { "" } else { " --certs certs" };
        let others = format!("--session {name} --connect {endpoint}{security}");
        Self { network, session, plant, others }
    }

    fn plant(&self, arguments: &str) -> Running {
        let arguments = format!("plant --json {arguments} {}", self.plant);
        self.network.start(PLANT, &self.session, &arguments)
    }

    fn other(&self, arguments: &str) -> Running {
        self.network.start(CONTROLLER, &self.session, &format!("{arguments} {}", self.others))
    }
}

/// A sampling instant, as the plant's trace tells it.
struct Instance {
    time: f64,
    velocity: [f64; 2],
    error: f64,
    torque: [f64; 2],
    force: [f64; 2],
}

fn trace(session: &Session) -> Vec<Instance> {
    let mut reader = csv::Reader::from_path(session.directory.join("trace.csv")).unwrap();
    let names = reader.headers().unwrap().clone();
    let rows = reader.records().map(|row| {
        let row = row.unwrap();
        let number = |name: &str| {
            let column = names.iter().position(|known| known == name).unwrap();
            row[column].parse::<f64>().unwrap()
        };
        let pair = |name: &str| [1, 2].map(|joint| number(&format!("{name}_{joint}")));
        Instance {
            time: number("time_s"),
            velocity: pair("q_dot_rad_s"),
            error: number("error_x_m").hypot(number("error_y_m")),
            torque: pair("torque_nm"),
            force: pair("force_n"),
        }
    });
    rows.collect()
}

/// When commands came into effect, as far as that can be seen at the sampling instants.
fn fresh(trace: &[Instance]) -> Vec<f64> {
    let is_fresh = |pair: &&[Instance]| pair[1].force != pair[0].force && pair[1].force != [0.0; 2];
    trace.windows(2).filter(is_fresh).map(|pair| pair[1].time).collect()
}

/// The longest time without a fresh command: from the last one before to the first one after.
fn gap(trace: &[Instance]) -> (f64, f64) {
    let times = fresh(trace);
    let longest = times.windows(2).max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0]))).unwrap();
    (longest[0], longest[1])
}

fn report_of(plant: &Running) -> Value {
    serde_json::from_str(&plant.stdout())
        .unwrap_or_else(|_| panic!("no report: {}", plant.stderr()))
}

/// Waits until a monitor has seen the loop closed.
fn await_loop(monitor: &Running) {
    eventually("a line of the monitor", || monitor.stdout().contains("|e|").then_some(()));
}

/// Pulls a machine's cable for so many seconds; how many it really were.
fn interrupt(network: &Network, machine: u32, cut: Cut, seconds: f64) -> f64 {
    let began = Instant::now();
    network.cut(machine, cut);
    thread::sleep(Duration::from_secs_f64(seconds));
    network.mend(machine, cut);
    began.elapsed().as_secs_f64()
}

/// Asserts that the arm was safe while commands stayed away between two instants, and within its
/// limits always.
fn assert_safe(trace: &[Instance], from: f64, to: f64) {
    for instance in trace {
        let Instance { time, velocity, torque, force, .. } = instance;
        for ((torque, velocity), limit) in torque.iter().zip(velocity).zip(TORQUE_LIMIT) {
            assert!(torque.abs() <= limit, "at {time} s: {torque} N m");
            let has_timed_out = *time > from + COMMAND_TIMEOUT + SAMPLE_PERIOD;
            if has_timed_out && *time < to - SAMPLE_PERIOD {
                let braking = (-DAMPING * velocity).clamp(-limit, limit);
                assert!((torque - braking).abs() < 1e-9, "at {time} s: {torque}, not {braking}");
                assert_eq!(*force, [0.0; 2], "at {time} s");
            }
        }
    }
}

/// The loop is closed again within a second after each interruption, whichever way the link was
/// cut.
fn recovers_over(protocol: &str) {
    const ATTEMPTS: usize = 3;
    let lengths: &[f64] = if is_long() { &[0.1, 1.0, 5.0, 10.0] } else { &[0.1, 1.0] };
    for cut in [Cut::Carrier, Cut::Silence] {
        for seconds in lengths {
            // What a busy machine withholds from the processes, no network can make good.
            let recovered = (1..=ATTEMPTS).any(|_| {
                let (recovery, kept_up) = recovery_after(protocol, cut, *seconds);
                println!("{protocol}, {cut:?} for {seconds} s: closed again after {recovery:.2} s");
                assert!(
                    recovery < 1.0 || !kept_up,
                    "{protocol}, {cut:?}, {seconds} s: {recovery} s"
                );
                recovery < 1.0
            });
            assert!(recovered, "{protocol}, {cut:?}, {seconds} s: this machine never kept up");
        }
    }
}

/// How long after the end of an interruption the first command came, s, and whether the machine
/// gave the processes their time.
fn recovery_after(protocol: &str, cut: Cut, seconds: f64) -> (f64, bool) {
    let site = Site::over(protocol);
    let duration = seconds + 4.0;
    let scenario = "--scenario remote/mtj --trace trace.csv --set";
    let mut plant = site.plant(&format!("{scenario} duration={duration}s"));
    let _controller = site.other("controller");
    let monitor = site.other("monitor");
    await_loop(&monitor);
    thread::sleep(Duration::from_millis(500));
    let lasted = interrupt(&site.network, PLANT, cut, seconds);
    assert!(plant.wait().success(), "{}", plant.stderr());
    let trace = trace(&site.session);
    let (from, to) = gap(&trace);
    assert_safe(&trace, from, to);
    let report = report_of(&plant);
    let count = |name: &str| report["commands"][name].as_u64().unwrap();
    assert!(count("applied") + count("lost") + 2 >= count("sent"), "{report}");
    let kept_up = report["deadline_misses"] == 0 && count("late") == 0;
    if kept_up {
        let after = fresh(&trace[trace.len() - 100..]).len();
        assert!(after > 90, "it stays closed: {after} commands in the last second");
    }
    (to - from - lasted, kept_up)
}

#[test]
fn a_loop_over_tcp_is_closed_again_within_a_second_after_a_cut() {
    needs!(Machines);
    let _machine = machine::alone();
    recovers_over("tcp");
}

#[test]
fn a_loop_over_tls_is_closed_again_within_a_second_after_a_cut() {
    needs!(Machines);
    let _machine = machine::alone();
    recovers_over("tls");
}

#[test]
fn a_loop_over_quic_is_closed_again_within_a_second_after_a_cut() {
    needs!(Machines);
    let _machine = machine::alone();
    recovers_over("quic");
}

/// The columns of the last row of a topic's table.
fn last_row(session: &Session, topic: &str) -> Vec<(String, String)> {
    let path = session.directory.join(format!("tables/{topic}.csv"));
    let mut reader = csv::Reader::from_path(path).unwrap();
    let names = reader.headers().unwrap().clone();
    let row = reader.records().last().unwrap().unwrap();
    names.iter().zip(&row).map(|(name, cell)| (name.to_owned(), cell.to_owned())).collect()
}

/// Which states were recorded.
fn sequences(session: &Session) -> BTreeSet<u64> {
    let mut reader = csv::Reader::from_path(session.directory.join("tables/state.csv")).unwrap();
    let names = reader.headers().unwrap().clone();
    let column = names.iter().position(|name| name == "sequence").unwrap();
    reader.records().map(|row| row.unwrap()[column].parse().unwrap()).collect()
}

#[test]
fn a_monitor_on_another_machine_has_the_counts_of_an_interruption_right() {
    needs!(Machines);
    let _machine = machine::alone();
    let (before, seconds, after) = if is_long() { (20.0, 5.0, 35.0) } else { (3.0, 2.0, 4.0) };
    let site = Site::over("tls");
    let duration: f64 = before + seconds + after;
    let scenario = "--scenario remote/mtj --trace trace.csv --set";
    let mut plant = site.plant(&format!("{scenario} duration={duration}s"));
    let mut monitor = site.other("monitor --record run.mcap");
    let _controller = site.other("controller");
    await_loop(&monitor);
    thread::sleep(Duration::from_secs_f64(before - 1.0));
    let lasted = interrupt(&site.network, PLANT, Cut::Silence, seconds);
    assert!(plant.wait().success(), "{}", plant.stderr());
    thread::sleep(Duration::from_secs(1));
    monitor.signal(Signal::SIGTERM);
    assert!(monitor.wait().success(), "{}", monitor.stderr());

    let trace = trace(&site.session);
    let (from, to) = gap(&trace);
    assert_safe(&trace, from, to);
    let recovery = to - from - lasted;
    assert!(recovery < 1.0, "closed again after {recovery} s");
    // It catches up with the gains' time constant of two seconds.
    let error_at = |time: f64| trace.iter().find(|i| i.time >= time).unwrap().error;
    let (back, end) = (error_at(to), trace.last().unwrap().error);
    println!("closed again after {recovery:.2} s; |e| {back:.3} m then, {end:.2e} m at the end");
    let share = if is_long() { 0.02 } else { 0.5 };
    assert!(end < share * back, "|e| from {back} m to {end} m");

    let export = site.session.start_exactly(&["export", "run.mcap", "--csv", "tables"]).wait();
    assert!(export.success());
    let status = last_row(&site.session, "status");
    let count = |name: &str| -> u64 {
        status.iter().find(|(known, _)| known == name).unwrap().1.parse().unwrap()
    };
    let sent = (duration / SAMPLE_PERIOD) as u64;
    assert_eq!((count("phase"), count("sent"), count("rejected")), (2, sent, 0), "{status:?}");
    assert!(sent - count("applied") - count("lost") <= 2, "{status:?}");
    // What the monitor was told, and what the plant's trace shows.
    let times = fresh(&trace);
    let longer_than =
        |seconds: f64| times.windows(2).filter(|pair| pair[1] - pair[0] > seconds).count() as u64;
    let margin = 2.0 * SAMPLE_PERIOD;
    let timeouts = longer_than(COMMAND_TIMEOUT + margin)..=longer_than(COMMAND_TIMEOUT - margin);
    assert!(timeouts.contains(&count("timeouts")), "{timeouts:?}: {status:?}");
    let down = ((to - from) / SAMPLE_PERIOD) as u64;
    let unanswered = sent - times.len() as u64;
    assert!(
        (down - 2..=unanswered + 2).contains(&count("lost")),
        "{down}, {unanswered}: {status:?}"
    );
    let said = monitor.stdout();
    let missed = said.lines().last().unwrap().rsplit_once("missed ").unwrap().1;
    let missed: u64 = missed.split(' ').next().unwrap().parse().unwrap();
    let heard = sequences(&site.session);
    let span = heard.last().unwrap() - heard.first().unwrap() + 1;
    assert_eq!(missed, span - heard.len() as u64, "{said}");
    let cut = (lasted / SAMPLE_PERIOD) as u64;
    assert!(missed + 2 >= cut, "{cut} states were cut off: {said}");
    assert!(said.contains("the plant has been silent for"), "{said}");
}

#[test]
fn a_controller_needs_an_address_and_serves_whatever_plant_comes_there() {
    needs!(Machines);
    let _machine = machine::alone();
    let site = Site::over("tls");
    let mut controller = site.other("controller");
    thread::sleep(Duration::from_secs(3));
    for scenario in ["remote/mtj", "sampled/tj", "remote/mtj"] {
        let mut plant = site.plant(&format!("--scenario {scenario} --set duration=1s"));
        assert!(plant.wait().success(), "{}", plant.stderr());
        let report = report_of(&plant);
        assert_eq!((&report["scenario"], &report["samples"]), (&scenario.into(), &100.into()));
        assert!(report["commands"]["applied"].as_u64().unwrap() > 0, "{report}");
    }
    // One that is killed has no time to say goodbye.
    let mut killed = site.plant("--scenario remote/mtj --set duration=1h");
    let monitor = site.other("monitor");
    await_loop(&monitor);
    killed.signal(Signal::SIGKILL);
    killed.wait();
    let mut plant = site.plant("--scenario remote/mtj --set duration=1s");
    assert!(plant.wait().success(), "{}", plant.stderr());
    assert!(report_of(&plant)["commands"]["applied"].as_u64().unwrap() > 0);
    assert!(!controller.has_ended(), "{}", controller.stderr());
}

/// Where the router of a test listens; set where this program is to be one.
const LISTEN: &str = "MTJ_TEST_ROUTER";

/// As a router, when another test starts this program on another machine: it does what zenohd does
/// with the same configuration.
#[test]
fn a_router_for_the_other_tests() {
    let Ok(listen) = env::var(LISTEN) else { return };
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/router.json5");
    let mut config = zenoh::Config::from_file(file).unwrap();
    config.insert_json5("listen/endpoints", &format!("[{listen:?}]")).unwrap();
    let _router = zenoh::open(config).wait().unwrap();
    // The test that started it ends it.
    thread::sleep(crate::session::LONG);
}

struct Router(Child);

impl Router {
    /// Starts one in the directory of its certificates.
    fn on(network: &Network, machine: u32, listen: &str, certs: &Path) -> Self {
        let program = env::current_exe().unwrap();
        let mut command = network.command(machine, program.to_str().unwrap());
        command.args(["--exact", "two_machines::a_router_for_the_other_tests"]);
        command.env("ZENOH_RUNTIME", "(rx: (worker_threads: 1), tx: (handover: rx))");
        Self(command.env(LISTEN, listen).current_dir(certs).spawn().unwrap())
    }
}

impl Drop for Router {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_loop_through_a_router_survives_a_restart_of_any_part() {
    needs!(Machines);
    let _machine = machine::alone();
    let (network, session) = (Network::of(3), Session::on("zenoh"));
    let address = network.address(ROUTER);
    let certs = session.start_exactly(&["certs", "--out", "certs", "--host", &address]).wait();
    assert!(certs.success());
    let endpoint = format!("tls/{address}:7447");
    let to_router = format!("--session {} --connect {endpoint} --certs certs", session.name);
    let start = |machine, arguments: &str| {
        network.start(machine, &session, &format!("{arguments} {to_router}"))
    };
    let plant = |arguments: &str| {
        let scenario = "plant --json --listen tls/127.0.0.1:7447 --scenario remote/mtj";
        start(PLANT, &format!("{scenario} {arguments}"))
    };
    let _controller = start(CONTROLLER, "controller");
    let monitor = start(CONTROLLER, "monitor");
    // A role that starts before the router waits for it.
    let mut first = plant("--set duration=8s --trace trace.csv");
    thread::sleep(Duration::from_secs(1));
    let _router = Router::on(&network, ROUTER, &endpoint, &session.directory.join("certs"));
    await_loop(&monitor);
    let lasted = interrupt(&network, CONTROLLER, Cut::Silence, 1.0);
    assert!(first.wait().success(), "{}", first.stderr());
    let (from, to) = gap(&trace(&session));
    assert!(to - from - lasted < 1.0, "closed again after {} s", to - from - lasted);
    for _ in 0..2 {
        let mut plant = plant("--set duration=1s");
        assert!(plant.wait().success(), "{}", plant.stderr());
        assert!(report_of(&plant)["commands"]["applied"].as_u64().unwrap() > 0);
    }
}
