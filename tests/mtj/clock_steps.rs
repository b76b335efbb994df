//! Wall clocks that jump: the loop goes by clocks that do not.

use std::{fs, thread, time::Duration};

use crate::{
    needs::{self, needs},
    session::{Session, eventually},
};
use serde_json::Value;

/// A run of four seconds, in which the clock of one role jumps by an hour, forward and then back.
fn run(bus: &str, stepped: Option<&str>) -> Value {
    let session = Session::on(bus);
    let clock = session.directory.join("clock");
    fs::write(&clock, "+0\n").unwrap();
    let variables = [
        format!("LD_PRELOAD={}", needs::faketime().unwrap().display()),
        format!("FAKETIME_TIMESTAMP_FILE={}", clock.display()),
        "FAKETIME_CACHE_DURATION=1".to_owned(),
        "FAKETIME_DONT_FAKE_MONOTONIC=1".to_owned(),
    ];
    let prefix: Vec<&str> =
        ["env"].into_iter().chain(variables.iter().map(String::as_str)).collect();
    let start = |role: &str, arguments: &str| {
        let prefix = if stepped == Some(role) { &prefix[..] } else { &[] };
        session.start_behind_on_bus(prefix, arguments)
    };
    let scenario = "plant --json --scenario remote/mtj --set duration=6s";
    let mut plant = start("plant", scenario);
    let mut controller = start("controller", "controller");
    let monitor = start("monitor", "monitor");
    eventually("a line of the monitor", || monitor.stdout().contains("|e|").then_some(()));
    for step in ["+3600\n", "-3600\n"] {
        fs::write(&clock, step).unwrap();
        thread::sleep(Duration::from_secs(2));
    }
    assert!(plant.wait().success(), "{}", plant.stderr());
    assert!(!controller.has_ended(), "{}", controller.stderr());
    serde_json::from_str(&plant.stdout()).unwrap()
}

/// Whether the machine gave the processes their time.
fn kept_up(report: &Value) -> bool {
    report["deadline_misses"] == 0 && report["commands"]["late"] == 0
}

fn is_undisturbed(bus: &str) {
    for role in [None, Some("controller"), Some("plant")] {
        const ATTEMPTS: usize = 4;
        for attempt in 1..=ATTEMPTS {
            let report = run(bus, role);
            if kept_up(&report) {
                let commands = &report["commands"];
                assert_eq!(commands["sent"], 600, "{bus}, {role:?}: {report}");
                assert_eq!(commands["lost"], 0, "{bus}, {role:?}: {report}");
                assert_eq!(commands["rejected"], 0, "{bus}, {role:?}: {report}");
                // With the arm at rest it would be a metre.
                let rms = report["rms_error_m"].as_f64().unwrap();
                assert!(rms < 0.02, "{bus}, {role:?}: {report}");
                println!("{bus}, {role:?}: rms error {rms} m");
                break;
            }
            assert!(attempt < ATTEMPTS, "this machine never kept up with 10 ms: {report}");
        }
    }
}

#[test]
fn a_clock_that_jumps_does_not_disturb_a_loop_over_iceoryx2() {
    needs!(Clock);
    is_undisturbed("iceoryx2");
}

#[test]
fn a_clock_that_jumps_does_not_disturb_a_loop_over_zenoh() {
    needs!(Clock);
    is_undisturbed("zenoh");
}
