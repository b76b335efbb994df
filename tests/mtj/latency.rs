//! `mtj latency`, and how roles get a processor to themselves.

use std::fs;

use crate::{
    machine,
    session::{Running, Session, eventually},
};
use serde_json::Value;

/// Runs `mtj` with exactly these arguments and parses what it prints.
fn json_of(session: &Session, arguments: &str) -> Value {
    let mut run = session.start_exactly(&arguments.split(' ').collect::<Vec<_>>());
    let status = run.wait();
    assert!(status.success(), "{arguments}: {status}, {}", run.stderr());
    serde_json::from_str(&run.stdout()).unwrap()
}

#[test]
fn every_way_of_closing_the_loop_is_measured_beside_its_bare_transport_and_the_floor() {
    let _machine = machine::alone();
    let session = Session::on("local");
    let rows = json_of(&session, "latency --rounds 2 --samples 300 --json --hdr distributions");
    let rows = rows.as_array().unwrap();
    let ways: Vec<_> = rows.iter().map(|row| (&row["bus"], &row["wait"])).collect();
    assert_eq!(ways.len(), 6, "{ways:?}");
    for row in rows {
        let at = |kind: &str, quantile: &str| row[kind][quantile].as_f64().unwrap();
        for kind in ["own", "bare", "floor"] {
            assert!(0.0 < at(kind, "p50") && at(kind, "p50") <= at(kind, "max"), "{row}");
        }
        assert!(row["samples"].as_u64().unwrap() >= 500, "{row}");
        assert_eq!(row["own_p50_by_round"].as_array().unwrap().len(), 2, "{row}");
        assert!(at("own", "p50") > at("floor", "p50"), "nothing is faster than the floor: {row}");
        assert!(row["own_to_bare"].as_f64().unwrap() > 0.0, "{row}");
        let file = format!(
            "distributions/{}-{}-loop.hgrm",
            row["bus"].as_str().unwrap(),
            row["wait"].as_str().unwrap()
        );
        let hgrm = fs::read_to_string(session.directory.join(file)).unwrap();
        let last: Vec<&str> = hgrm.lines().last().unwrap().split_whitespace().collect();
        assert_eq!((last[1], last[3]), ("1.000000000000", "inf"), "the whole distribution");
        let longest: f64 = last[0].parse().unwrap();
        assert!((longest / at("own", "max") - 1.0).abs() < 0.01, "{longest} of {row}");
    }
}

#[test]
fn the_highest_rate_lies_between_one_that_was_held_and_one_that_was_not() {
    let _machine = machine::alone();
    let session = Session::on("local");
    let attempts = json_of(&session, "latency --rate --hold 1 --bus iceoryx2 --wait block --json");
    let rates = |held: bool| {
        let attempts = attempts.as_array().unwrap().iter();
        attempts.filter(move |it| it["is_held"] == held).map(|it| it["rate_hz"].as_f64().unwrap())
    };
    let held = rates(true).fold(0.0, f64::max);
    let failed = rates(false).filter(|rate| *rate > held).fold(f64::MAX, f64::min);
    // On a busy machine no rate may be held; then the lowest was tried.
    assert!(held == 0.0 || failed / held < 1.2, "{attempts}");
    assert!(rates(false).count() > 0, "{attempts}");
}

fn status_of(role: &Running, key: &str) -> String {
    let status = fs::read_to_string(format!("/proc/{}/status", role.id())).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix(key)).unwrap();
    line.trim_start_matches(':').trim().to_owned()
}

/// Scheduling policy and real-time priority of a role's first thread.
fn schedule_of(role: &Running) -> (u64, u64) {
    let stat = fs::read_to_string(format!("/proc/{}/stat", role.id())).unwrap();
    // After the name, which is in brackets, come the third and all further fields.
    let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
    (fields[41 - 3].parse().unwrap(), fields[40 - 3].parse().unwrap())
}

const PLANT: &str = "plant --json --scenario sampled/mtj --set duration=24h";

#[test]
fn a_role_gets_the_priority_the_processor_and_the_memory_that_it_asks_for() {
    let _machine = machine::alone();
    const FIFO: u64 = 1;
    let session = Session::on("iceoryx2");
    let roles = [
        session.start(&format!("{PLANT} --priority 10 --cpu 0 --lock-memory")),
        session.start("controller --priority 11 --cpu 0 --lock-memory"),
        session.start("monitor --priority 12 --cpu 0 --lock-memory"),
    ];
    eventually("the loop", || roles[2].stdout().contains("|e|").then_some(()));
    for (role, priority) in roles.iter().zip(10..) {
        assert_eq!(schedule_of(role), (FIFO, priority), "{}", role.stderr());
        assert_eq!(status_of(role, "Cpus_allowed_list"), "0");
        let locked = status_of(role, "VmLck");
        let kilobytes: u64 = locked.trim_end_matches(" kB").parse().unwrap();
        assert!(kilobytes > 1000, "{locked}");
        assert!(!role.stderr().contains("refused"), "{}", role.stderr());
    }
}

#[test]
fn a_loop_goes_on_without_what_the_system_refuses() {
    let _machine = machine::alone();
    let session = Session::on("iceoryx2");
    let without = [
        "setpriv",
        "--bounding-set=-sys_nice,-ipc_lock,-sys_resource",
        "prlimit",
        "--memlock=65536",
        "--rtprio=0",
    ];
    let mut plant = session.start_behind_on_bus(
        &without,
        "plant --json --scenario sampled/mtj --set duration=1s --priority 10 --lock-memory",
    );
    let _controller = session.start("controller");
    assert!(plant.wait().success(), "{}", plant.stderr());
    let said = plant.stderr();
    for words in [
        ["--priority 10 was refused", "CAP_SYS_NICE"],
        ["--lock-memory was refused", "CAP_IPC_LOCK"],
    ] {
        let line = said.lines().find(|line| line.contains(words[0]));
        assert!(line.is_some_and(|line| line.contains(words[1])), "{words:?} in: {said}");
    }
    let mut refused = session.start("controller --cpu 1000");
    assert_eq!(refused.wait().code(), Some(2), "{}", refused.stderr());
    assert!(refused.stderr().contains("--cpu 1000"), "{}", refused.stderr());
}
