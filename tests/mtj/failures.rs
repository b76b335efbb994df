//! Each way to fail that docs/failures.md promises something about, and is not told elsewhere: the
//! arm gets safe in time, and the loop goes on by itself, with nothing remembered from before.

use std::{fs, thread, time::Duration};

use crate::session::{Running, Session, observer::Observer, own_controller::OwnController};
use mtj_protocol::{
    bus::Bus,
    member::Role,
    sample::{ErrorSample, StateSample, VERSION},
};
use nix::sys::signal::Signal;
use serde_json::Value;

const SAMPLE_PERIOD_NS: u64 = 10_000_000;
const TIMEOUT_NS: u64 = 60_000_000;
/// N m, far less than the law wants at times.
const LIMIT: f64 = 20.0;

/// A plant in real time that is made safe after six sample periods without a command.
fn plant(session: &Session, duration: &str) -> Running {
    session.start(&format!(
        "plant --json --trace trace.csv --scenario sampled/mtj --set duration={duration} \
         --set safety.command_timeout=60ms --set safety.on_timeout=damp --set safety.damping=30.0 \
         --set safety.torque_limit={LIMIT} --set law.memory.policy=delivered"
    ))
}

fn report_of(plant: &mut Running) -> Value {
    let status = plant.wait();
    assert!(status.success(), "{status}: {}", plant.stderr());
    serde_json::from_str(&plant.stdout()).unwrap()
}

/// The arm never felt a torque that is not finite or over its limit.
fn assert_within_limits(session: &Session) {
    let trace = fs::read_to_string(session.directory.join("trace.csv")).unwrap();
    let mut lines = trace.lines();
    let titles: Vec<&str> = lines.next().unwrap().split(',').collect();
    let torques: Vec<usize> =
        (0..titles.len()).filter(|column| titles[*column].starts_with("torque")).collect();
    assert_eq!(torques.len(), 2, "{titles:?}");
    for line in lines {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        assert!(torques.iter().all(|column| cells[*column].abs() <= LIMIT), "{line}");
    }
}

/// The times from the last command on until the arm was safe, and what the loop resumed with.
struct Outage {
    /// Last command's sampling instant to the first that found the arm safe, ns.
    until_safe_ns: u64,
    /// The regulating factor of the first command after it; None if nobody heard what the law said
    /// of that one: what somebody says who has just come may be lost on its way to a monitor.
    first_factor: Option<[f64; 2]>,
    /// The largest one of the two hundred after that.
    later_factor: f64,
}

/// The regulating factor of each axis.
fn factor(error: &ErrorSample) -> [f64; 2] {
    error.signal("factor").unwrap().try_into().unwrap()
}

/// Listens through an outage that has begun, to its end.
fn live_through(observer: &mut Observer, end: impl FnOnce()) -> Outage {
    let safe = observer.until("a safe arm", |observer| {
        observer.states.iter().find(|state| state.timed_out == 1).copied()
    });
    let before = observer
        .torques
        .iter()
        .filter(|torque| torque.header.sequence < safe.header.sequence)
        .map(|torque| torque.header.time_ns)
        .max()
        .unwrap();
    end();
    let resumed = observer.until("a loop that goes on", |observer| {
        let newest = observer.states.last()?;
        let is_on = newest.timed_out == 0 && newest.header.sequence > safe.header.sequence;
        // The first answer to a state that was measured while the arm was safe.
        is_on.then(|| {
            observer.errors.range((safe.header.run, safe.header.sequence)..).next().map(|x| *x.1)
        })?
    });
    let key = (resumed.header.run, resumed.header.sequence);
    observer.until("two hundred more", |observer| {
        (observer.errors.range(key..).count() > 200).then_some(())
    });
    let is_on =
        |state: &&StateSample| state.timed_out == 0 && state.header.sequence > safe.header.sequence;
    let first_on = observer.states.iter().filter(is_on).map(|state| state.header.sequence).min();
    let is_first = Some(resumed.header.sequence) < first_on;
    Outage {
        until_safe_ns: safe.header.time_ns - before,
        first_factor: is_first.then(|| factor(&resumed)),
        later_factor: observer.errors.range(key..).map(|x| factor(x.1)[0]).fold(0.0, f64::max),
    }
}

impl Outage {
    /// Returns whether all of it was seen.
    fn assert_safe_in_time_and_resumed_afresh(&self) -> bool {
        // The timeout counts from when the last command was applied, and states tell of it at the
        // next sampling instant.
        let most = TIMEOUT_NS + 3 * SAMPLE_PERIOD_NS;
        assert!(self.until_safe_ns >= TIMEOUT_NS, "{} ns: too early", self.until_safe_ns);
        assert!(self.until_safe_ns <= most, "{} ns until the arm was safe", self.until_safe_ns);
        assert!(self.later_factor > 0.5, "and the memory counts again");
        let first = self.first_factor.inspect(|first| {
            assert_eq!(*first, [0.0; 2], "nothing is remembered from before");
        });
        first.is_some()
    }
}

/// Tries again what was not seen as a whole.
fn until_seen(mut attempt: impl FnMut(&str) -> bool) {
    for bus in ["iceoryx2", "zenoh"] {
        assert!((0..5).any(|_| attempt(bus)), "{bus}: the first command afresh was never heard of");
    }
}

#[test]
fn a_controller_that_is_killed_leaves_a_safe_arm_and_its_successor_starts_afresh() {
    until_seen(|bus| {
        let session = Session::on(bus);
        let controller = session.start("controller");
        let mut plant = plant(&session, "6s");
        let mut observer = Observer::join(&session);
        observer.hear_torques(50);
        controller.signal(Signal::SIGKILL);
        let mut successor = None;
        let outage = live_through(&mut observer, || successor = Some(session.start("controller")));
        let is_seen = outage.assert_safe_in_time_and_resumed_afresh();
        let report = report_of(&mut plant);
        assert_eq!((&report["timeouts"], &report["takeovers"]), (&1.into(), &1.into()), "{report}");
        assert_eq!(report["diverged"], false);
        assert_within_limits(&session);
        is_seen
    });
}

#[test]
fn a_controller_that_is_stopped_goes_on_afresh() {
    until_seen(|bus| {
        let session = Session::on(bus);
        let controller = session.start("controller");
        let mut plant = plant(&session, "6s");
        let mut observer = Observer::join(&session);
        observer.hear_torques(50);
        controller.signal(Signal::SIGSTOP);
        let outage = live_through(&mut observer, || {
            thread::sleep(Duration::from_millis(300));
            controller.signal(Signal::SIGCONT);
        });
        let is_seen = outage.assert_safe_in_time_and_resumed_afresh();
        let report = report_of(&mut plant);
        assert_eq!((&report["timeouts"], &report["takeovers"]), (&1.into(), &0.into()), "{report}");
        assert_within_limits(&session);
        is_seen
    });
}

#[test]
fn a_controller_that_was_stopped_stands_by_for_the_one_that_took_over() {
    for bus in ["iceoryx2", "zenoh"] {
        let session = Session::on(bus);
        let first = session.start("controller");
        let mut plant = plant(&session, "4s");
        let mut observer = Observer::join(&session);
        observer.hear_torques(20);
        let second = session.start("controller --precedence 5");
        assert_eq!(observer.leader(0, 1), first.id(), "a precedence is no reason to take over");
        first.signal(Signal::SIGSTOP);
        assert_eq!(observer.leader(first.id(), 1), second.id());
        first.signal(Signal::SIGCONT);
        let report = report_of(&mut plant);
        observer.listen();
        assert_eq!(report["takeovers"], 1, "{bus}: {report}");
        let mut leaders: Vec<u64> =
            observer.torques.iter().map(|torque| torque.controller).collect();
        leaders.dedup();
        // What the first one had under way when it was stopped may have come after it went on.
        assert!(leaders.len() <= 4 && leaders[0] != *leaders.last().unwrap(), "{leaders:?}");
        // When it goes on it gets the states of its last lease, and answers at most those: all are
        // refused.
        let first = leaders[0];
        let is_asked = |sequence| {
            let mut asked = observer.states.iter().filter(|state| state.leader == first);
            asked.any(|state| state.header.sequence == sequence)
        };
        let since = observer.torques.iter().skip_while(|torque| torque.controller == first);
        let late: Vec<u64> = since
            .filter(|torque| torque.controller == first)
            .map(|torque| torque.header.sequence)
            .collect();
        assert!(late.iter().all(|sequence| is_asked(*sequence)), "{bus}: {late:?}");
        let rejected = report["commands"]["rejected"].as_u64().unwrap() as usize;
        assert!(rejected <= 1.max(late.len()), "{bus}: {late:?}, {report}");
        assert_within_limits(&session);
    }
}

#[test]
fn a_slow_controller_is_late_and_its_torques_act_late() {
    for bus in ["iceoryx2", "zenoh"] {
        let session = Session::on(bus);
        let mut plant = plant(&session, "2s");
        let mut controller = OwnController::join(&session);
        while !plant.has_ended() {
            controller.answer(|torque| {
                thread::sleep(Duration::from_millis(15));
                torque.residence_ns = 15_000_000;
            });
        }
        let report = report_of(&mut plant);
        let count = |name: &str| report["commands"][name].as_u64().unwrap();
        assert!(count("late") > 50 && count("applied") > 50, "{bus}: {report}");
        assert_eq!((&report["timeouts"], count("rejected")), (&0.into(), 0), "{bus}: {report}");
        assert_within_limits(&session);
    }
}

#[test]
fn monitors_that_are_stopped_or_killed_are_nothing_to_the_loop() {
    const ATTEMPTS: usize = 6;
    for bus in ["iceoryx2", "zenoh"] {
        let lost_nothing = (0..ATTEMPTS).any(|_| {
            let report = run_with_broken_monitors(bus);
            let lost = report["commands"]["lost"].as_u64().unwrap();
            assert_eq!((&report["timeouts"], &report["takeovers"]), (&0.into(), &0.into()));
            // What the machine withheld from the plant itself, no monitor is to blame for.
            assert!(lost == 0 || report["deadline_misses"] != 0, "{bus}: {report}");
            lost == 0
        });
        assert!(lost_nothing, "this machine never kept up with 10 ms over {bus}");
    }
}

fn run_with_broken_monitors(bus: &str) -> Value {
    let session = Session::on(bus);
    let mut plant = plant(&session, "4s");
    let monitors = [session.start("monitor"), session.start("monitor")];
    let _controller = session.start("controller");
    for monitor in &monitors {
        crate::session::eventually("a line", || monitor.stdout().contains("|e|").then_some(()));
    }
    let mut observer = Observer::join(&session);
    observer.hear_torques(50);
    monitors[0].signal(Signal::SIGKILL);
    monitors[1].signal(Signal::SIGSTOP);
    observer.hear_torques(100);
    monitors[1].signal(Signal::SIGCONT);
    report_of(&mut plant)
}

#[test]
fn a_session_has_one_plant() {
    for bus in ["iceoryx2", "zenoh"] {
        let session = Session::on(bus);
        let _controller = session.start("controller");
        let mut first = plant(&session, "3s");
        let mut observer = Observer::join(&session);
        observer.hear_torques(10);
        let mut second = session.start("plant --json --scenario sampled/tj --set duration=1s");
        assert_eq!(second.wait().code(), Some(2), "{bus}: {}", second.stderr());
        assert_eq!(second.stderr().lines().count(), 1, "{}", second.stderr());
        // Over Zenoh a second plant first finds the first one's address.
        let reason = if bus == "iceoryx2" { "plant already" } else { "in use" };
        assert!(second.stderr().contains(reason), "{}", second.stderr());
        let report = report_of(&mut first);
        assert_eq!((&report["timeouts"], &report["samples"]), (&0.into(), &300.into()), "{report}");
    }
}

#[test]
fn a_trace_that_finds_the_disk_full_is_told() {
    let session = Session::on("iceoryx2");
    let mut run = session.start_exactly(&[
        "run",
        "--scenario",
        "sampled/mtj",
        "--set",
        "duration=1s",
        "--trace",
        "/dev/full",
        "--bus",
        "local",
    ]);
    assert_eq!(run.wait().code(), Some(1));
    assert!(run.stderr().starts_with("mtj: --trace /dev/full: "), "{}", run.stderr());
    assert_eq!(run.stderr().lines().count(), 1, "{}", run.stderr());
    assert!(run.stdout().contains("rms error"), "what was measured is not lost");
}

#[test]
fn a_controller_says_once_that_the_plant_speaks_another_version() {
    // The other version is played by this test, over a bus where anybody may write any bytes.
    let session = Session::on("zenoh");
    let bus = session.join(Role::Plant);
    let offer = mtj_protocol::codec::encode_offer(&mtj_protocol::codec::Offer {
        version: VERSION + 1,
        revision: 0,
        run: 7,
        name: "of tomorrow".to_owned(),
        text: "tomorrow = true".to_owned(),
    });
    let _offering = bus.offer(offer).unwrap();
    let mut controller = session.start("controller");
    let versions = format!("protocol version {}, this program has {VERSION}", VERSION + 1);
    crate::session::eventually("a complaint", || {
        controller.stderr().contains(&versions).then_some(())
    });
    // Longer than it waits before it says that there is no plant.
    thread::sleep(Duration::from_millis(2500));
    let complaints = controller.stderr().lines().count();
    assert_eq!((complaints, controller.has_ended()), (1, false), "{}", controller.stderr());
}
