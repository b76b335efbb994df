//! Roles that are killed hundreds of times, at any moment of their lives, and what is left of them:
//! nothing.
//!
//! `MTJ_SOAK_KILLS` says how many are killed over each bus, 20 unless set; the full soak has 300.
//! `MTJ_SOAK_SEED` sets the moments.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs, thread,
    time::{Duration, Instant},
};

use crate::{
    machine,
    session::{
        Running, Session,
        chance::{Chance, setting},
        eventually,
        holdings::Holdings,
        shared_memory_of,
    },
};
use mtj_protocol::{
    member::Role,
    port::{Message, MonitorPort},
    transport::AnyBus,
};
use nix::sys::signal::Signal;

/// How soon a process that starts again must take part.
const SOON: Duration = Duration::from_secs(1);
/// A process is in its start-up for about so long, ms.
const STARTUP: u64 = 40;

/// Somebody on the bus who sees who takes part.
struct Watch {
    bus: AnyBus,
    port: MonitorPort,
    /// The runs that a plant has told a state of.
    runs: BTreeSet<u64>,
    /// Who has answered which run.
    answers: BTreeSet<(u64, u64)>,
}

impl Watch {
    fn on(session: &Session) -> Self {
        let bus = session.join(Role::Monitor);
        let port = MonitorPort::open(&bus).unwrap();
        Self { bus, port, runs: BTreeSet::new(), answers: BTreeSet::new() }
    }

    fn look(&mut self) {
        let Self { bus, port, runs, answers } = self;
        port.drain(bus, &mut |message| match message {
            Message::State(state) => drop(runs.insert(state.header.run)),
            Message::Torque(torque) => {
                answers.insert((torque.header.run, torque.controller));
            }
            _ => {}
        })
        .unwrap();
    }
}

const ROLES: [(Role, &str); 3] = [
    (Role::Plant, "plant --json --scenario sampled/mtj --set duration=24h"),
    (Role::Controller, "controller"),
    (Role::Monitor, "monitor"),
];

/// A session whose roles are killed.
struct Soak<'a> {
    session: &'a Session,
    watch: Watch,
    /// One of each role.
    running: Vec<Running>,
    /// All who ever lived.
    processes: Vec<u32>,
}

impl<'a> Soak<'a> {
    fn begin(session: &'a Session) -> Self {
        let running: Vec<Running> =
            ROLES.iter().map(|(_, arguments)| session.start(arguments)).collect();
        let processes = running.iter().map(Running::id).collect();
        let mut soak = Self { session, watch: Watch::on(session), running, processes };
        eventually("the loop", || {
            soak.watch.look();
            (!soak.watch.answers.is_empty()).then_some(())
        });
        soak
    }

    fn start(&mut self, role: usize) {
        self.running[role] = self.session.start(ROLES[role].1);
        self.processes.push(self.running[role].id());
    }

    fn kill(&mut self, role: usize) {
        self.running[role].signal(Signal::SIGKILL);
        self.running[role].wait();
    }

    /// Starts a role again, and says how long it took until it took part.
    fn restart(&mut self, role: usize) -> Duration {
        self.watch.look();
        let (runs, answers) = (self.watch.runs.clone(), self.watch.answers.clone());
        let controllers: BTreeSet<u64> =
            answers.iter().map(|(_, controller)| *controller).collect();
        let began = Instant::now();
        self.start(role);
        let Self { watch, running, .. } = self;
        eventually(ROLES[role].1, || {
            watch.look();
            let mut news = watch.answers.difference(&answers);
            let took = began.elapsed();
            match ROLES[role].0 {
                Role::Plant => news.any(|(run, _)| !runs.contains(run)).then_some(took),
                Role::Controller => news.any(|(_, id)| !controllers.contains(id)).then_some(took),
                // It says what it heard in its first second when that is over.
                _ => running[role].stdout().lines().next().map(str::to_owned).map(|line| {
                    let said = running.iter_mut().map(|role| (role.has_ended(), role.stderr()));
                    let said: Vec<_> = said.collect();
                    assert!(line.contains("|e|"), "it heard no loop: {line}; {said:?}");
                    took.saturating_sub(Duration::from_secs(1))
                }),
            }
        })
    }
}

/// What processes have in shared memory, by kind, once every process has found the writers that it
/// follows.
fn shared(processes: &[u32]) -> BTreeMap<String, usize> {
    thread::sleep(Duration::from_millis(500));
    let mut kinds = BTreeMap::new();
    for path in shared_memory_of(processes) {
        let (_, kind) = path.rsplit_once('.').unwrap_or_default();
        *kinds.entry(kind.to_owned()).or_default() += 1;
    }
    kinds
}

fn survives_kills_over(bus: &str) {
    let (kills, seed) = (setting("MTJ_SOAK_KILLS", 20), setting("MTJ_SOAK_SEED", 5));
    let mut chance = Chance(seed);
    let session = Session::on(bus);
    let mut soak = Soak::begin(&session);
    let witness = session.start("monitor");
    soak.processes.push(witness.id());
    let mut joined: [Vec<Duration>; 3] = Default::default();
    let mut before = None;
    let mut killed = 0;
    while killed < kills {
        let role = chance.below(3) as usize;
        chance.wait(200);
        soak.kill(role);
        killed += 1;
        while killed < kills && chance.below(2) == 0 {
            soak.start(role);
            chance.wait(STARTUP);
            soak.kill(role);
            killed += 1;
        }
        joined[role].push(soak.restart(role));
        // Once everybody has been replaced, nothing may grow any more.
        if before.is_none() && (killed >= kills / 4 || killed > 30) {
            before = Some((Holdings::of(witness.id()), shared(&soak.processes)));
        }
    }
    let held = (Holdings::of(witness.id()), shared(&soak.processes));
    println!("{bus}: {killed} killed (seed {seed}); the witness held {before:?}, then {held:?}");
    let load = fs::read_to_string("/proc/loadavg").unwrap();
    println!("  load of the machine: {}", load.trim());
    for (joined, (role, _)) in joined.iter_mut().zip(ROLES) {
        joined.sort();
        if let Some(slowest) = joined.last() {
            let at = |percent: usize| joined[joined.len() * percent / 100];
            let (p50, p90) = (at(50), at(90));
            println!(
                "  {role:?} joined {} times: p50 {p50:?} p90 {p90:?} max {slowest:?}",
                joined.len()
            );
        }
    }
    let slowest = joined.iter().flatten().max();
    assert!(slowest <= Some(&SOON), "it took {slowest:?} until somebody took part again");
    if let Some((holdings, files)) = before {
        held.0.assert_not_above(holdings);
        let count = |files: &BTreeMap<String, usize>| files.values().sum::<usize>();
        assert!(count(&held.1) <= count(&files) + 2, "{files:#?}\nthen {:#?}", held.1);
    }
    let Soak { running, processes, watch, .. } = soak;
    for mut role in running.into_iter().chain([witness]) {
        role.signal(Signal::SIGTERM);
        assert!(role.wait().success(), "{}", role.stderr());
    }
    drop(watch);
    let left = shared_memory_of(&processes);
    assert!(left.is_empty(), "left in shared memory: {left:?}");
}

#[test]
fn roles_on_shared_memory_may_be_killed_at_any_moment() {
    let _machine = machine::alone();
    survives_kills_over("iceoryx2");
}

#[test]
fn roles_on_zenoh_may_be_killed_at_any_moment() {
    let _machine = machine::alone();
    survives_kills_over("zenoh");
}
