//! Bridges: the loop is on one bus, monitors are on another, and the loop does not notice.

use std::{
    fs,
    path::{Path, PathBuf},
    thread,
    time::Duration,
};

use crate::session::{Running, Session, eventually, free_port};
use mtj_model::scenario::{BusKind, BusSettings, Wait};
use mtj_monitor::recording::Recording;
use mtj_protocol::{
    bus::Bus,
    member::{Member, Role},
    port::Message,
    transport::AnyBus,
};
use nix::sys::signal::Signal;
use serde_json::Value;

/// A session whose loop is on one bus, with a bridge to another one.
struct Bridged {
    session: Session,
    endpoint: String,
}

impl Bridged {
    fn from(bus: &str) -> Self {
        Self { session: Session::on(bus), endpoint: format!("tcp/127.0.0.1:{}", free_port()) }
    }

    /// A bridge from shared memory to Zenoh, when it listens.
    fn bridge(&self, more: &str) -> Running {
        let listen = ["--session", &self.session.name, "--listen", &self.endpoint];
        let bridge = ["bridge", "--from", "iceoryx2", "--to", "zenoh"];
        let more = more.split_whitespace().collect::<Vec<_>>();
        let running = self.session.start_exactly(&[&bridge[..], &listen, &more].concat());
        eventually("a bridge", || running.stdout().contains("mtj bridge: session").then_some(()));
        running
    }

    /// Starts `mtj` beyond the bridge.
    fn beyond(&self, arguments: &str) -> Running {
        let connect = ["--session", &self.session.name, "--connect", &self.endpoint];
        let arguments = arguments.split(' ').collect::<Vec<_>>();
        self.session.start_exactly(&[&arguments[..], &connect].concat())
    }

    /// Starts a recording beyond the bridge, and waits until nothing can escape it.
    fn record(&self) -> (Running, PathBuf) {
        let file = self.session.directory.join("far.mcap");
        let monitor = self.beyond(&format!("monitor --record {}", file.display()));
        eventually("recording", || monitor.stderr().contains("recording to").then_some(()));
        (monitor, file)
    }
}

/// Ends a role as a user does; what it has said.
fn end(role: &mut Running) -> String {
    role.signal(Signal::SIGINT);
    let status = role.wait();
    assert!(status.success(), "{status}: {}", role.stderr());
    role.stdout() + &role.stderr()
}

fn report_of(plant: &mut Running) -> Value {
    assert!(plant.wait().success(), "{}", plant.stderr());
    serde_json::from_str(&plant.stdout()).unwrap()
}

fn messages(file: &Path) -> Vec<Message> {
    Recording::open(file).unwrap().map(|recorded| recorded.unwrap().message).collect()
}

/// The sequence numbers of some messages, without those that were repeated.
fn sequences_of(messages: &[Message], of: fn(&Message) -> Option<u64>) -> Vec<u64> {
    let mut sequences: Vec<u64> = messages.iter().filter_map(of).collect();
    sequences.dedup();
    sequences
}

/// Of the states.
fn sequences(messages: &[Message]) -> Vec<u64> {
    sequences_of(messages, |message| match message {
        Message::State(state) => Some(state.header.sequence),
        _ => None,
    })
}

#[test]
fn a_recording_beyond_the_bridge_has_every_sample_of_a_kilohertz_loop() {
    let bridged = Bridged::from("iceoryx2");
    let mut bridge = bridged.bridge("");
    let mut plant = bridged.session.start(
        "plant --json --scenario sampled/mtj --set duration=5s --set timing.clock=realtime \
         --set timing.sample_period=1ms",
    );
    let (mut monitor, file) = bridged.record();
    let mut controller = bridged.session.start("controller");
    let report = report_of(&mut plant);
    end(&mut controller);
    eventually("its last second", || {
        bridge.stdout().ends_with("no plant, no controller\n").then_some(())
    });
    let said = end(&mut monitor);
    assert!(said.contains("; 0 messages dropped, 0 states missed"), "{said}");
    let said = end(&mut bridge);
    assert!(said.contains("; 0 states missed, 0 messages malformed"), "{said}");

    let messages = messages(&file);
    assert_eq!(report["samples"], 5000);
    assert_eq!(sequences(&messages), (0..5000).collect::<Vec<_>>());
    let count = |kind: fn(&Message) -> bool| messages.iter().filter(|m| kind(m)).count();
    let torques = sequences_of(&messages, |message| match message {
        Message::Torque(torque) => Some(torque.header.sequence),
        _ => None,
    });
    let errors = sequences_of(&messages, |message| match message {
        Message::Error(error) => Some(error.header.sequence),
        _ => None,
    });
    assert_eq!(torques, errors, "an error for each answer");
    assert!(torques.len() as u64 >= report["commands"]["applied"].as_u64().unwrap(), "{report}");
    assert_eq!(count(|message| matches!(message, Message::Scenario(_))), 1);
    assert!(count(|message| matches!(message, Message::Status(_))) > 0);
    for role in [0, 1] {
        let is_of = |m: &&Message| matches!(m, Message::Presence(sample) if sample.role == role);
        assert!(messages.iter().filter(is_of).count() >= 4, "role {role} says who it is");
    }
}

#[test]
fn a_lockstep_loop_does_not_notice_a_bridge_that_is_killed_and_comes_back() {
    const RUN: &str = "--scenario sampled/mtj --set timing.clock=lockstep --set duration=400s \
                       --set link.torque.latency=2ms --set law.memory.policy=delivered --trace trace.csv";
    let run = RUN.split_whitespace().collect::<Vec<_>>().join(" ");
    let trace_of = |session: &Session| fs::read(session.directory.join("trace.csv")).unwrap();
    let alone = Session::on("local");
    alone.report(&format!("run --json {run}"));

    let bridged = Bridged::from("iceoryx2");
    let mut plant = bridged.session.start(&format!("plant --json {run}"));
    let mut bridge = bridged.bridge("");
    let (mut monitor, file) = bridged.record();
    let mut controller = bridged.session.start("controller");
    let mut killed = 0;
    while !plant.has_ended() {
        thread::sleep(Duration::from_millis(400));
        bridge.signal(Signal::SIGKILL);
        assert!(!bridge.wait().success());
        killed += 1;
        bridge = bridged.bridge("");
    }
    let report = report_of(&mut plant);
    assert!(killed >= 2, "the run was too short to kill a bridge in it: {report}");
    assert_eq!(
        (&report["commands"]["lost"], &report["commands"]["rejected"]),
        (&0.into(), &0.into())
    );
    assert!(trace_of(&bridged.session) == trace_of(&alone), "the same, bit for bit");
    end(&mut controller);
    end(&mut monitor);
    assert!(!sequences(&messages(&file)).is_empty());
}

#[test]
fn a_real_time_loop_loses_nothing_while_bridges_die_and_monitors_hear_again() {
    const ATTEMPTS: usize = 4;
    for attempt in 1..=ATTEMPTS {
        let bridged = Bridged::from("iceoryx2");
        let mut bridge = bridged.bridge("");
        let mut plant =
            bridged.session.start("plant --json --scenario sampled/mtj --set duration=12s");
        let (mut monitor, file) = bridged.record();
        let mut controller = bridged.session.start("controller");
        for _ in 0..2 {
            thread::sleep(Duration::from_secs(2));
            bridge.signal(Signal::SIGKILL);
            assert!(!bridge.wait().success());
            bridge = bridged.bridge("");
        }
        let heard =
            |monitor: &Running| monitor.stdout().lines().filter(|l| l.contains("|e|")).count();
        let before = heard(&monitor);
        eventually("the monitor hears again by itself", || {
            (heard(&monitor) > before + 1).then_some(())
        });
        let report = report_of(&mut plant);
        end(&mut controller);
        end(&mut monitor);
        let kept_up = report["deadline_misses"] == 0 && report["commands"]["late"] == 0;
        if kept_up {
            assert_eq!(
                (&report["samples"], &report["commands"]["lost"]),
                (&1200.into(), &0.into())
            );
            assert_eq!(report["commands"]["rejected"], 0, "{report}");
            let heard = sequences(&messages(&file));
            assert!(heard.first() == Some(&0) && heard.is_sorted(), "in order from the first on");
            return;
        }
        assert!(attempt < ATTEMPTS, "this machine never kept up with 10 ms: {report}");
    }
}

#[test]
fn knobs_are_turned_through_the_bridge_unless_it_is_read_only() {
    let bridged = Bridged::from("iceoryx2");
    let mut plant = bridged.session.start("plant --json --scenario sampled/mtj --set duration=1h");
    let _controller = bridged.session.start("controller");
    let mut bridge = bridged.bridge("");
    let monitor = bridged.beyond("monitor");
    eventually("the loop", || monitor.stdout().contains("|e|").then_some(()));
    for change in ["set law.kind=tj", "kick --torque 1,1", "pause", "resume"] {
        let mut knob = bridged.beyond(change);
        assert!(knob.wait().success(), "{change}: {}", knob.stderr());
        assert!(knob.stdout().contains("in effect from t = "), "{}", knob.stdout());
    }
    eventually("the new law", || monitor.stdout().contains(" s  tj ").then_some(()));
    assert!(monitor.stdout().contains("changed: law.kind=tj"), "{}", monitor.stdout());

    let mut reset = bridged.beyond("reset");
    assert!(reset.wait().success(), "a new run, and its scenario comes over: {}", reset.stderr());
    let mut set = bridged.beyond("set law.kind=mtj");
    assert!(set.wait().success(), "{}", set.stderr());

    assert!(end(&mut bridge).contains(" requests back; "), "it says what it carried");
    let _bridge = bridged.bridge("--read-only");
    let mut refused = bridged.beyond("set law.kind=tj");
    assert_eq!(refused.wait().code(), Some(1), "{}", refused.stdout());
    assert!(refused.stderr().contains("the plant does not answer"), "{}", refused.stderr());
    plant.signal(Signal::SIGINT);
    assert_eq!(report_of(&mut plant)["law"], "mtj", "nobody has turned it since");
}

#[test]
fn a_bridge_tells_which_roles_take_part_and_when_the_plant_is_gone() {
    let bridged = Bridged::from("iceoryx2");
    let _bridge = bridged.bridge("");
    let settings = BusSettings {
        kind: BusKind::Zenoh,
        session: bridged.session.name.clone(),
        wait: Wait::Block,
        connect: Some(vec![bridged.endpoint.clone()]),
        ..BusSettings::from_table("test", toml::Table::new()).unwrap()
    };
    let far = AnyBus::open(&settings, Role::Monitor, &|| true).unwrap().unwrap();
    let mut attendance = far.attendance().unwrap();
    let mut comes_to = |expected: &[(Role, u32)]| {
        eventually(&format!("{expected:?} beyond the bridge"), || {
            let mut present: Vec<(Role, u32)> = attendance
                .present()
                .unwrap()
                .iter()
                .map(|m: &Member| (m.role, m.precedence))
                .collect();
            present.sort_unstable();
            (present == expected).then_some(())
        });
    };
    comes_to(&[]);
    let mut plant = bridged.session.start("plant --json --scenario sampled/mtj --set duration=1h");
    let first = bridged.session.start("controller");
    let _second = bridged.session.start("controller --precedence 3");
    comes_to(&[(Role::Plant, 0), (Role::Controller, 0), (Role::Controller, 3)]);
    assert!(far.fetch().unwrap().is_some(), "the scenario is there with the plant");
    first.signal(Signal::SIGKILL);
    comes_to(&[(Role::Plant, 0), (Role::Controller, 3)]);
    end(&mut plant);
    comes_to(&[(Role::Controller, 3)]);
    eventually("no scenario any more", || far.fetch().unwrap().is_none().then_some(()));
    let _again = bridged.session.start("plant --json --scenario sampled/tj --set duration=1h");
    comes_to(&[(Role::Plant, 0), (Role::Controller, 3)]);
    eventually("another scenario", || far.fetch().unwrap());
}

#[test]
fn a_loop_over_zenoh_is_watched_in_shared_memory() {
    let session = Session::on("zenoh");
    let listen = session.start("plant --json --scenario sampled/mtj --set duration=1h");
    let _controller = session.start("controller");
    // `start` names the session's endpoint, on which all but the plant connect.
    let mut bridge = session.start("bridge --from zenoh --to iceoryx2");
    let near = ["--session", &session.name, "--bus", "iceoryx2"];
    let monitor = session.start_exactly(&[&["monitor"][..], &near].concat());
    eventually("the loop", || monitor.stdout().contains("|e|").then_some(()));
    let mut set = session.start_exactly(&[&["set", "law.kind=tj"][..], &near].concat());
    assert!(set.wait().success(), "{}", set.stderr());
    eventually("the new law", || monitor.stdout().contains(" s  tj ").then_some(()));
    end(&mut bridge);
    drop(listen);
}

#[test]
fn a_bridge_that_cannot_be_is_refused_in_a_sentence() {
    let session = Session::on("local");
    for (arguments, words) in [
        ("--from zenoh --to zenoh", "two different buses"),
        ("--from iceoryx2 --to local", "local"),
        ("--from smoke --to zenoh", "smoke"),
        ("--bus zenoh", "--from and --to"),
    ] {
        let arguments: Vec<&str> = ["bridge"].into_iter().chain(arguments.split(' ')).collect();
        let mut bridge = session.start_exactly(&arguments);
        assert_eq!(bridge.wait().code(), Some(2), "{arguments:?}");
        assert!(bridge.stderr().contains(words), "{arguments:?}: {}", bridge.stderr());
        assert_eq!(bridge.stderr().lines().count(), 1, "{}", bridge.stderr());
    }
}
