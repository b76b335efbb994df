//! Runs against the wall clock, in processes that come, go and die.

use crate::{
    machine,
    session::{Running, Session, eventually, send, shared_memory_of},
};
use nix::sys::signal::Signal;
use serde_json::Value;

fn report_of(run: &Running) -> Value {
    serde_json::from_str(&run.stdout()).unwrap_or_else(|_| panic!("no report: {}", run.stderr()))
}

/// Whether the machine gave the processes their time: what it withheld, no program can make good.
fn kept_up(report: &Value) -> bool {
    report["deadline_misses"] == 0
        && report["commands"]["late"] == 0
        && report["round_trip_us"]["max"].as_f64().unwrap() < 9e3
}

fn loses_nothing_over(bus: &str) {
    const ATTEMPTS: usize = 6;
    for attempt in 1..=ATTEMPTS {
        let report = Session::on(bus).report("run --json --scenario sampled/mtj --set duration=5s");
        assert_eq!(report["diverged"], false);
        assert_eq!((&report["bus"], &report["clock"]), (&bus.into(), &"realtime".into()));
        assert_eq!(report["samples"], 500);
        assert_eq!(
            (&report["commands"]["sent"], &report["commands"]["rejected"]),
            (&500.into(), &0.into())
        );
        let (trip, residence) = (&report["round_trip_us"], &report["residence_us"]);
        let p50 = |times: &Value| times["p50"].as_f64().unwrap();
        assert!(p50(trip) > p50(residence) && p50(residence) > 0.0, "{report}");
        if kept_up(&report) {
            assert_eq!(report["commands"]["lost"], 0, "{report}");
            assert!(report["commands"]["applied"].as_u64().unwrap() >= 499, "{report}");
            assert!(report["rms_error_m"].as_f64().unwrap() < 0.1, "{report}");
            return;
        }
        assert!(attempt < ATTEMPTS, "this machine never kept up with 10 ms: {report}");
    }
}

#[test]
fn a_real_time_run_over_iceoryx2_loses_nothing() {
    let _machine = machine::alone();
    loses_nothing_over("iceoryx2");
}

#[test]
fn a_real_time_run_over_zenoh_loses_nothing() {
    let _machine = machine::alone();
    loses_nothing_over("zenoh");
}

const PLANT: &str = "plant --json --scenario sampled/mtj --set duration=3s";

fn assert_complete(report: &Value) {
    assert_eq!(report["diverged"], false, "{report}");
    assert_eq!(report["duration_s"], 3.0, "{report}");
    assert!(report["commands"]["applied"].as_u64().unwrap() > 200, "{report}");
}

#[test]
fn three_roles_find_each_other_in_any_order() {
    let _machine = machine::alone();
    for bus in ["iceoryx2", "zenoh"] {
        for order in [
            ["controller", "monitor", PLANT],
            [PLANT, "monitor", "controller"],
            ["monitor", PLANT, "controller"],
        ] {
            let session = Session::on(bus);
            let mut roles: Vec<Running> = order
                .iter()
                .map(|role| {
                    let role = session.start(role);
                    std::thread::sleep(std::time::Duration::from_millis(300));
                    role
                })
                .collect();
            let at = |name: &str| order.iter().position(|role| role.starts_with(name)).unwrap();
            let status = roles[at("plant")].wait();
            assert!(status.success(), "{bus}, {order:?}: {}", roles[at("plant")].stderr());
            assert_complete(&report_of(&roles[at("plant")]));
            let seen = roles[at("monitor")].stdout();
            let live =
                seen.lines().filter(|line| line.contains("|e|") && line.contains("round trip p50"));
            assert!(live.count() >= 2, "{bus}, {order:?}, the monitor saw: {seen}");
            for role in ["controller", "monitor"] {
                assert!(!roles[at(role)].has_ended(), "the {role} outlives the plant");
                roles[at(role)].signal(Signal::SIGTERM);
                assert!(roles[at(role)].wait().success(), "{}", roles[at(role)].stderr());
            }
        }
    }
}

/// What `mtj up` does when some of its processes get a signal.
fn up_ends(bus: &str, signal: Signal, whom: impl Fn(&Running, &[u32]) -> Vec<u32>) {
    let session = Session::on(bus);
    let mut up = session.start("up");
    eventually("a line of the monitor", || up.stdout().contains("|e|").then_some(()));
    let processes = session.await_processes(4);
    if bus == "iceoryx2" {
        assert!(!shared_memory_of(&processes).is_empty(), "the loop is in shared memory");
    }
    for pid in whom(&up, &processes) {
        send(pid, signal);
    }
    let status = up.wait();
    assert_eq!(status.code(), Some(0), "{bus}, {signal}: {}", up.stderr());
    assert!(up.stdout().contains("rms error"), "it reports what was: {}", up.stdout());
    session.await_processes(0);
    assert!(shared_memory_of(&processes).is_empty(), "left: {:?}", shared_memory_of(&processes));
}

#[test]
fn an_interrupt_of_the_launcher_alone_ends_everything() {
    let _machine = machine::alone();
    for bus in ["iceoryx2", "zenoh"] {
        up_ends(bus, Signal::SIGINT, |up, _| vec![up.id()]);
    }
}

#[test]
fn an_interrupt_of_every_process_as_from_a_terminal_ends_everything() {
    let _machine = machine::alone();
    for bus in ["iceoryx2", "zenoh"] {
        up_ends(bus, Signal::SIGINT, |_, all| all.to_vec());
        up_ends(bus, Signal::SIGINT, |_, all| all.iter().rev().copied().collect());
    }
}

#[test]
fn a_launcher_that_is_killed_takes_its_roles_with_it() {
    let _machine = machine::alone();
    let session = Session::on("iceoryx2");
    let mut up = session.start("up");
    eventually("a line of the monitor", || up.stdout().contains("|e|").then_some(()));
    let processes = session.await_processes(4);
    up.signal(Signal::SIGKILL);
    assert!(!up.wait().success());
    session.await_processes(0);
    assert!(shared_memory_of(&processes).is_empty(), "left: {:?}", shared_memory_of(&processes));
}

#[test]
fn a_controller_that_is_killed_in_mid_run_can_be_replaced() {
    let _machine = machine::alone();
    for bus in ["iceoryx2", "zenoh"] {
        let session = Session::on(bus);
        let mut plant = session.start(&PLANT.replace("3s", "6s"));
        let mut killed = session.start("controller");
        let monitor = session.start("monitor");
        eventually("a line of the monitor", || monitor.stdout().contains("|e|").then_some(()));
        killed.signal(Signal::SIGKILL);
        assert!(!killed.wait().success());
        let _standby = session.start("controller");
        assert!(plant.wait().success(), "{bus}: {}", plant.stderr());
        let report = report_of(&plant);
        assert_eq!((&report["diverged"], &report["duration_s"]), (&false.into(), &6.0.into()));
        // It was away for a moment of the six seconds.
        let commands = &report["commands"];
        let applied = commands["applied"].as_u64().unwrap();
        assert!((350..600).contains(&applied), "{bus}: {report}");
        assert!(commands["lost"].as_u64().unwrap() > 0, "{bus}: {report}");
    }
}

#[test]
fn a_plant_that_starts_again_finds_the_controller_that_is_there() {
    let _machine = machine::alone();
    for bus in ["iceoryx2", "zenoh"] {
        let session = Session::on(bus);
        let mut controller = session.start("controller");
        for scenario in ["sampled/mtj", "sampled/tj", "sampled/mtj"] {
            let mut plant =
                session.start(&PLANT.replace("sampled/mtj", scenario).replace("3s", "1s"));
            assert!(plant.wait().success(), "{bus}: {}", plant.stderr());
            let report = report_of(&plant);
            assert_eq!((&report["diverged"], &report["samples"]), (&false.into(), &100.into()));
            assert!(report["commands"]["applied"].as_u64().unwrap() > 80, "{bus}: {report}");
        }
        assert!(!controller.has_ended(), "{}", controller.stderr());
    }
}

#[test]
fn a_plant_that_is_killed_can_be_started_again() {
    let _machine = machine::alone();
    for bus in ["iceoryx2", "zenoh"] {
        let session = Session::on(bus);
        let _controller = session.start("controller");
        let monitor = session.start("monitor");
        let mut killed = session.start(&PLANT.replace("3s", "1h"));
        eventually("a line of the monitor", || monitor.stdout().contains("|e|").then_some(()));
        killed.signal(Signal::SIGKILL);
        assert!(!killed.wait().success());
        let mut plant = session.start(PLANT);
        assert!(plant.wait().success(), "{bus}: {}", plant.stderr());
        assert_complete(&report_of(&plant));
    }
}

#[test]
fn launches_over_zenoh_find_ports_of_their_own() {
    let _machine = machine::alone();
    let session = Session::on("local");
    let short = "run --json --bus zenoh --set timing.clock=lockstep --set duration=1s";
    let words: Vec<&str> = short.split(' ').collect();
    let mut runs = [session.start_exactly(&words), session.start_exactly(&words)];
    for run in &mut runs {
        assert!(run.wait().success(), "{}", run.stderr());
        assert!(run.stdout().contains("\"bus\":\"zenoh\""), "{}", run.stdout());
    }
}
