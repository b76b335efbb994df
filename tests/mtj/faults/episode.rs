//! A loop to which faults happen, and everything that is heard of it.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    process::Command,
    thread,
    time::{Duration, Instant},
};

use mtj_protocol::{
    bus::{Bus, Writer},
    member::Role,
    port::{Message, MonitorPort},
    sample::{StateSample, StatusSample, TorqueSample},
    transport::AnyBus,
};
use nix::sys::signal::Signal;

use super::{
    disk::Disk,
    fault::{CONTROLLER, Fault, PLANT, STANDBY},
};
use crate::session::{Running, Session, cable::Cable, eventually, holdings::Holdings};

/// N m/s.
pub const RATE: f64 = 400.0;
/// Of a run in which nobody controls for a while, ms.
const LONG_TIMEOUT: u64 = 500;

/// Everything that was heard of an episode.
#[derive(Default)]
pub struct Heard {
    pub states: Vec<StateSample>,
    pub statuses: Vec<StatusSample>,
}

/// A loop to which faults happen.
pub struct Episode {
    pub session: Session,
    disk: Disk,
    recording: PathBuf,
    cable: Option<Cable>,
    pub plant: Running,
    roles: Vec<Option<Running>>,
    /// All processes that there were.
    pub pids: Vec<u32>,
    bus: AnyBus,
    port: MonitorPort,
    hostile: Box<dyn Writer<TorqueSample>>,
    pub heard: Heard,
    /// From which sample on which torque limit was in effect, N m, and which timeout, ns.
    pub limits: BTreeMap<u64, f64>,
    pub timeouts: BTreeMap<u64, u64>,
    /// What the plant held when the loop had begun.
    pub held: Holdings,
    /// Whether nobody can join the plant any more.
    pub is_closed: bool,
}

const COMMANDS: [&str; 3] = ["controller", "controller --precedence 1", "monitor"];

impl Episode {
    /// Starts a loop, and waits until it runs.
    pub fn begin(bus: &str, disk: &Disk) -> Self {
        let session = Session::on(bus);
        let plant = session.start(&format!(
            "plant --json --trace trace.csv --scenario sampled/mtj --set duration=1h \
             --set timing.sample_period=5ms --set safety.torque_limit=[20,20] \
             --set safety.torque_rate_limit={RATE:?} --set safety.command_timeout=100ms"
        ));
        let cable = session.port().map(Cable::to);
        let recording = disk.path().join(format!("{}.mcap", session.name));
        let roles: Vec<_> = (0..COMMANDS.len())
            .map(|role| Some(start(&session, &cable, role, &recording)))
            .collect();
        let pids = roles.iter().flatten().chain([&plant]).map(Running::id).collect();
        let joined = session.join(Role::Monitor);
        let mut episode = Self {
            port: MonitorPort::open(&joined).unwrap(),
            hostile: joined.writer().unwrap(),
            bus: joined,
            held: Holdings::of(plant.id()),
            is_closed: false,
            session,
            disk: disk.clone(),
            recording,
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
            (episode.heard.statuses.last()?.applied > 100).then_some(())
        });
        // As it is measured in the end: a while after a request.
        episode.ask("resume");
        episode.wait(300);
        episode.held = Holdings::of(episode.plant.id());
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

    /// Listens for so long.
    pub fn wait(&mut self, milliseconds: u64) {
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
    pub fn ask(&mut self, words: &str) -> Option<u64> {
        let mut asking = self.session.start(words);
        while !asking.has_ended() {
            self.wait(5);
        }
        let is_done = asking.wait().success();
        is_done.then(|| asking.stdout().trim().rsplit(' ').next().unwrap().parse().unwrap())
    }

    /// Lets a fault happen, and the loop go on for a while.
    pub fn apply(&mut self, fault: &Fault) {
        match fault {
            Fault::Set(sets) => drop(self.ask(&format!("set {sets}"))),
            Fault::Limit(limit) => {
                if let Some(from) = self.ask(&format!("set safety.torque_limit=[{limit},{limit}]"))
                {
                    self.limits.insert(from, *limit as f64);
                }
            }
            Fault::Timeout(milliseconds) => self.set_timeout(*milliseconds),
            Fault::Silence(silent, timeout) => {
                self.set_timeout(LONG_TIMEOUT);
                let controllers = [CONTROLLER, STANDBY];
                for role in controllers {
                    self.roles[role].as_ref().unwrap().signal(Signal::SIGSTOP);
                }
                self.wait(*silent);
                self.set_timeout(*timeout);
                self.wait(LONG_TIMEOUT);
                for role in controllers {
                    self.roles[role].as_ref().unwrap().signal(Signal::SIGCONT);
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
                let started = start(&self.session, &self.cable, *role, &self.recording);
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
            Fault::Moved(milliseconds) => {
                self.disk.hide();
                self.wait(*milliseconds);
                self.disk.show();
            }
            Fault::Removed => {
                self.disk.remove();
                self.is_closed = true;
            }
            Fault::FullDisk(milliseconds) => {
                self.disk.fill();
                self.wait(*milliseconds);
                self.disk.make_room();
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

    fn set_timeout(&mut self, milliseconds: u64) {
        let asked = self.ask(&format!("set safety.command_timeout={milliseconds}ms"));
        if let Some(from) = asked {
            self.timeouts.insert(from, milliseconds * 1_000_000);
        }
    }

    fn limit_descriptors(&self, limits: &str) {
        let pid = self.plant.id().to_string();
        let limited =
            Command::new("prlimit").args([&format!("--nofile={limits}"), "--pid", &pid]).status();
        assert!(limited.unwrap().success());
    }

    /// Ends everything.
    pub fn close(self) {
        let Self { session, disk, recording, roles, port, hostile, bus, .. } = self;
        drop((roles, port, hostile, bus, session));
        let _ = std::fs::remove_file(recording);
        disk.make_room();
    }
}

/// Starts a role, at the other end of the cable if there is one.
fn start(session: &Session, cable: &Option<Cable>, role: usize, recording: &Path) -> Running {
    let mut command = COMMANDS[role].to_owned();
    if command == "monitor" {
        command += &format!(" --overwrite --record {}", recording.display());
    }
    let Some(cable) = cable else { return session.start(&command) };
    let connect = format!("tcp/127.0.0.1:{}", cable.port);
    let there = ["--session", &session.name, "--connect", &connect];
    let words: Vec<&str> = command.split(' ').chain(there).collect();
    session.start_exactly(&words)
}
