//! Faults in any order: an episode draws them from a seed, and what docs/failures.md promises holds
//! at every sample of it.
//!
//! `MTJ_FAULTS_SECONDS` says for how long episodes follow each other over each bus, 20 unless set;
//! `MTJ_FAULTS_SEED` sets the first. An episode that breaks a promise is shortened, and printed with
//! its seed.

use std::{
    collections::BTreeMap,
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    process::Command,
    thread,
    time::{Duration, Instant},
};

use mtj_protocol::{
    bus::{Bus, Writer},
    member::Role,
    port::{Message, MonitorPort},
    sample::{Phase, StateSample, StatusSample, TorqueSample},
    transport::AnyBus,
};
use nix::sys::signal::Signal;
use serde_json::Value;

use crate::{
    machine,
    session::{
        Running, Session,
        cable::Cable,
        chance::{Chance, setting},
        eventually, shared_memory_of,
    },
};

/// How many faults an episode has.
const FAULTS: usize = 24;
/// N m/s.
const RATE: f64 = 2000.0;
/// The longest latency that an episode sets, and what travels in it at the shortest period.
const UNDER_WAY: u64 = 30;

/// What can happen to a loop.
#[derive(Clone, Debug, PartialEq)]
enum Fault {
    /// Keys are set while it runs.
    Set(String),
    /// N m, the limit on both joints.
    Limit(u64),
    /// ms.
    Timeout(u64),
    /// A role is stopped for so many ms.
    Stop(usize, u64),
    /// A role is killed, and another one started so many ms later.
    Kill(usize, u64),
    /// The link between the plant and the other roles is cut for so many ms, where there is one.
    Cut(u64),
    /// The plant has no descriptors for so many ms.
    NoDescriptors(u64),
    /// Somebody sends torques that are none.
    Hostile(u64),
    /// An operator pauses the run for so many ms.
    Pause(u64),
    Kick,
}

const CONTROLLER: usize = 0;
const STANDBY: usize = 1;
const MONITOR: usize = 2;
const PLANT: usize = 3;

impl Fault {
    fn draw(chance: &mut Chance) -> Self {
        let mut one_of =
            |words: &[&str]| words[chance.below(words.len() as u64) as usize].to_owned();
        let set = one_of(&[
            "link.torque.latency=20ms",
            "link.torque.latency=0s",
            "link.state.latency=5ms",
            "link.state.latency=0s",
            "link.torque.dropout=0.3",
            "link.torque.dropout=0.0",
            "link.state.dropout=0.2",
            "safety.on_timeout=zero",
            "safety.on_timeout=hold",
            "safety.on_timeout=damp",
            "law.kind=tj law.kp=60 law.kd=120",
            "law.kind=mtj law.kp=30 law.kd=60",
            "law.memory.policy=delivered",
            "law.memory.policy=sent",
            "timing.sample_period=4ms",
            "timing.sample_period=10ms",
            "law.prediction.horizon=measured",
        ]);
        match chance.below(13) {
            0..3 => Self::Set(set),
            3 => Self::Limit(2 + chance.below(30)),
            4 => Self::Timeout(60 + chance.below(200)),
            5 => Self::Stop(
                [CONTROLLER, STANDBY, MONITOR][chance.below(3) as usize],
                chance.below(400),
            ),
            6 => Self::Stop(PLANT, chance.below(400)),
            7 | 8 => Self::Kill(
                [CONTROLLER, STANDBY, MONITOR][chance.below(3) as usize],
                chance.below(300),
            ),
            9 => Self::NoDescriptors(chance.below(400)),
            10 => Self::Hostile(1 + chance.below(50)),
            11 => Self::Cut(chance.below(800)),
            _ if chance.below(2) == 0 => Self::Pause(chance.below(300)),
            _ => Self::Kick,
        }
    }
}

/// Everything that was heard of an episode.
#[derive(Default)]
struct Heard {
    states: Vec<StateSample>,
    statuses: Vec<StatusSample>,
}

/// A loop to which faults happen.
struct Episode {
    session: Session,
    cable: Option<Cable>,
    plant: Running,
    roles: Vec<Option<Running>>,
    /// All processes that there were.
    pids: Vec<u32>,
    bus: AnyBus,
    port: MonitorPort,
    hostile: Box<dyn Writer<TorqueSample>>,
    heard: Heard,
    /// From which sample on which torque limit was in effect, N m, and which timeout, ns.
    limits: BTreeMap<u64, f64>,
    timeouts: BTreeMap<u64, u64>,
}

const COMMANDS: [&str; 3] = ["controller", "controller --precedence 1", "monitor"];

impl Episode {
    fn begin(bus: &str) -> Self {
        let session = Session::on(bus);
        let plant = session.start(&format!(
            "plant --json --trace trace.csv --scenario sampled/mtj --set duration=1h \
             --set timing.sample_period=5ms --set safety.torque_limit=[20,20] \
             --set safety.torque_rate_limit={RATE:?} --set safety.command_timeout=100ms"
        ));
        let cable = session.port().map(Cable::to);
        let roles: Vec<_> =
            COMMANDS.iter().map(|command| Some(start(&session, &cable, command))).collect();
        let pids = roles.iter().flatten().chain([&plant]).map(Running::id).collect();
        let joined = session.join(Role::Monitor);
        let mut episode = Self {
            port: MonitorPort::open(&joined).unwrap(),
            hostile: joined.writer().unwrap(),
            bus: joined,
            session,
            cable,
            plant,
            roles,
            pids,
            heard: Heard::default(),
            limits: [(0, 20.0)].into(),
            timeouts: [(0, 100_000_000)].into(),
        };
        eventually("the loop", || {
            episode.listen();
            (episode.heard.statuses.last()?.applied > 20).then_some(())
        });
        episode
    }

    fn listen(&mut self) {
        let Self { bus, port, heard, .. } = self;
        port.drain(bus, &mut |message| match message {
            Message::State(state) => heard.states.push(state),
            Message::Status(status) => heard.statuses.push(status),
            _ => {}
        })
        .unwrap();
    }

    fn wait(&mut self, milliseconds: u64) {
        let end = Instant::now() + Duration::from_millis(milliseconds);
        loop {
            self.listen();
            if Instant::now() >= end {
                return;
            }
            thread::sleep(Duration::from_millis(2));
        }
    }

    /// Asks the plant for something; returns from which sample on it is in effect, `None` if the
    /// plant refused it or was not there to answer.
    fn ask(&mut self, words: &str) -> Option<u64> {
        let mut asking = self.session.start(words);
        while !asking.has_ended() {
            self.wait(5);
        }
        let is_done = asking.wait().success();
        is_done.then(|| asking.stdout().trim().rsplit(' ').next().unwrap().parse().unwrap())
    }

    fn apply(&mut self, fault: &Fault) {
        match fault {
            Fault::Set(sets) => drop(self.ask(&format!("set {sets}"))),
            Fault::Limit(limit) => {
                if let Some(from) = self.ask(&format!("set safety.torque_limit=[{limit},{limit}]"))
                {
                    self.limits.insert(from, *limit as f64);
                }
            }
            Fault::Timeout(milliseconds) => {
                let asked = self.ask(&format!("set safety.command_timeout={milliseconds}ms"));
                if let Some(from) = asked {
                    self.timeouts.insert(from, milliseconds * 1_000_000);
                }
            }
            Fault::Stop(PLANT, milliseconds) => {
                self.plant.signal(Signal::SIGSTOP);
                self.wait(*milliseconds);
                self.plant.signal(Signal::SIGCONT);
            }
            Fault::Stop(role, milliseconds) => {
                let role = *role;
                self.roles[role].as_ref().unwrap().signal(Signal::SIGSTOP);
                self.wait(*milliseconds);
                self.roles[role].as_ref().unwrap().signal(Signal::SIGCONT);
            }
            Fault::Kill(role, milliseconds) => {
                let killed = self.roles[*role].take();
                killed.as_ref().unwrap().signal(Signal::SIGKILL);
                drop(killed);
                self.wait(*milliseconds);
                let started = start(&self.session, &self.cable, COMMANDS[*role]);
                self.pids.push(started.id());
                self.roles[*role] = Some(started);
            }
            Fault::Cut(milliseconds) => {
                if let Some(cable) = &self.cable {
                    cable.cut();
                }
                self.wait(*milliseconds);
                if let Some(cable) = &self.cable {
                    cable.mend();
                }
            }
            Fault::NoDescriptors(milliseconds) => {
                self.limit_descriptors("3:1024");
                self.wait(*milliseconds);
                self.limit_descriptors("1024:1024");
            }
            Fault::Hostile(count) => {
                for number in 0..*count {
                    let Some(state) = self.heard.states.last() else { break };
                    let mut torque = TorqueSample { header: state.header, ..Default::default() };
                    torque.state_sent_ns = state.sent_ns;
                    torque.controller = state.leader;
                    torque.torque = [1e6; 7];
                    match number % 5 {
                        0 => torque.header.time_ns ^= 1,
                        1 => torque.header.sequence += 1 << 30,
                        2 => torque.controller ^= 1,
                        3 => torque.state_sent_ns ^= 1,
                        _ => torque.header.run ^= 1,
                    }
                    self.hostile.write(&torque).unwrap();
                    self.wait(2);
                }
            }
            Fault::Pause(milliseconds) => {
                self.ask("pause");
                self.wait(*milliseconds);
                self.ask("resume");
            }
            Fault::Kick => drop(self.ask("kick --torque=10,-10 --duration 50ms")),
        }
        self.wait(150);
    }

    fn limit_descriptors(&self, limits: &str) {
        let pid = self.plant.id().to_string();
        let limited =
            Command::new("prlimit").args([&format!("--nofile={limits}"), "--pid", &pid]).status();
        assert!(limited.unwrap().success());
    }

    /// Ends the episode, and holds it against the promises.
    fn end(mut self) {
        assert!(!self.plant.has_ended(), "the plant ended: {}", self.plant.stderr());
        self.ask("resume");
        self.wait(300);
        self.plant.signal(Signal::SIGINT);
        let status = self.plant.wait();
        assert!(status.success(), "{status}: {}", self.plant.stderr());
        let report: Value = serde_json::from_str(&self.plant.stdout()).unwrap();
        assert_eq!(report["diverged"], false, "{report}");
        self.assert_counts_add_up(&report);
        self.assert_torques_keep_their_limits();
        self.assert_safe_in_time();
        let Self { session, roles, pids, port, hostile, bus, .. } = self;
        drop((roles, port, hostile, bus, session));
        // The next process to come cleans up after those that were killed.
        let next = Session::on("iceoryx2");
        let mut cleaning = next.start("run --json --set duration=0.1s");
        assert!(cleaning.wait().success(), "{}", cleaning.stderr());
        let left = shared_memory_of(&pids);
        assert!(left.is_empty(), "left behind: {left:?}");
    }

    fn assert_counts_add_up(&self, report: &Value) {
        let count = |name: &str| report["commands"][name].as_u64().unwrap();
        let known = count("applied") + count("lost") + count("too_old");
        assert!(known <= count("sent"), "{report}");
        assert!(count("sent") - known <= UNDER_WAY, "commands nobody knows of: {report}");
    }

    fn assert_torques_keep_their_limits(&self) {
        let trace = fs::read_to_string(self.session.directory.join("trace.csv")).unwrap();
        let mut lines = trace.lines();
        let titles: Vec<&str> = lines.next().unwrap().split(',').collect();
        let columns: Vec<usize> =
            (0..titles.len()).filter(|column| titles[*column].starts_with("torque")).collect();
        for (sample, line) in (0_u64..).zip(lines) {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            assert!(cells.iter().all(|cell| cell.is_finite()), "sample {sample}: {line}");
            let limit = *self.limits.range(..=sample).next_back().unwrap().1;
            let largest = columns.iter().map(|column| cells[*column].abs()).fold(0.0, f64::max);
            assert!(largest <= limit, "sample {sample}: {largest} N m beyond {limit} N m");
        }
    }

    /// Where no command took effect for longer than the timeout, the arm is in its safe state; and no
    /// command that took effect was older.
    fn assert_safe_in_time(&self) {
        let Heard { states, statuses } = &self.heard;
        let timeout_at = |sequence: u64| *self.timeouts.range(..=sequence).next_back().unwrap().1;
        // A timeout that was longer before may have let an older command act just before it changed.
        let longest = |sequence: u64| {
            let before = self.timeouts.range(..=sequence).rev().take(2);
            before.map(|(_, timeout)| *timeout).max().unwrap()
        };
        for state in states.iter().filter(|state| state.header.sequence > 0) {
            let limit = longest(state.header.sequence);
            assert!(state.latency_ns <= limit, "{} ns old: {:?}", state.latency_ns, state.header);
        }
        let mut last_applied: Option<StatusSample> = None;
        for status in statuses.iter().filter(|status| status.phase() == Some(Phase::Running)) {
            let since = match &last_applied {
                Some(last) if last.applied == status.applied => last,
                _ => {
                    last_applied = Some(*status);
                    continue;
                }
            };
            // Applied just before the status that first told of it; told of at the next sample.
            let silent_ns = status.header.time_ns - since.header.time_ns;
            let timeout = timeout_at(status.header.sequence);
            if silent_ns > timeout + 30_000_000 {
                let state =
                    states.iter().find(|state| state.header.sequence == status.header.sequence);
                let is_safe = state.is_none_or(|state| state.timed_out == 1);
                assert!(is_safe, "{silent_ns} ns without a command: {:?}", status.header);
            }
        }
    }
}

/// Starts a role, at the other end of the cable if there is one.
fn start(session: &Session, cable: &Option<Cable>, command: &str) -> Running {
    let Some(cable) = cable else { return session.start(command) };
    let connect = format!("tcp/127.0.0.1:{}", cable.port);
    let there = ["--session", &session.name, "--connect", &connect];
    let words: Vec<&str> = command.split(' ').chain(there).collect();
    session.start_exactly(&words)
}

/// The faults of an episode.
fn drawn(seed: u64) -> Vec<Fault> {
    let mut chance = Chance(seed);
    (0..FAULTS).map(|_| Fault::draw(&mut chance)).collect()
}

/// Plays an episode; what promise it broke, if any.
fn play(bus: &str, faults: &[Fault]) -> Result<(), String> {
    catch_unwind(AssertUnwindSafe(|| {
        let mut episode = Episode::begin(bus);
        for fault in faults {
            episode.apply(fault);
        }
        episode.end();
    }))
    .map_err(|panic| {
        let words = panic.downcast_ref::<String>().cloned();
        words.unwrap_or_else(|| (*panic.downcast_ref::<&str>().unwrap_or(&"?")).to_owned())
    })
}

/// A shorter episode that breaks a promise, too: without whatever part can be left out.
fn shortened(bus: &str, mut faults: Vec<Fault>) -> Vec<Fault> {
    let mut part = faults.len() / 2;
    let mut tries = 12;
    while part > 0 && tries > 0 {
        let mut begin = 0;
        while begin < faults.len() && tries > 0 {
            let end = (begin + part).min(faults.len());
            let without = [&faults[..begin], &faults[end..]].concat();
            tries -= 1;
            if play(bus, &without).is_err() {
                faults = without;
            } else {
                begin = end;
            }
        }
        part /= 2;
    }
    faults
}

fn faults_break_no_promise_over(bus: &str) {
    let _place = machine::alone();
    let end = Instant::now() + Duration::from_secs(setting("MTJ_FAULTS_SECONDS", 20));
    let first = setting("MTJ_FAULTS_SEED", 1);
    for seed in first.. {
        let faults = drawn(seed);
        if let Err(broken) = play(bus, &faults) {
            let short = shortened(bus, faults);
            panic!("MTJ_FAULTS_SEED={seed} over {bus}: {broken}\nshortened to {short:#?}");
        }
        if Instant::now() >= end {
            return;
        }
    }
}

#[test]
fn faults_in_any_order_break_no_promise_over_shared_memory() {
    faults_break_no_promise_over("iceoryx2");
}

#[test]
fn faults_in_any_order_break_no_promise_over_zenoh() {
    faults_break_no_promise_over("zenoh");
}
