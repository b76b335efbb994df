//! The knobs of a loop that runs in processes of its own, turned from the command line.

use std::{process::ExitStatus, thread, time::Duration};

use crate::session::{Session, eventually};

/// Runs `mtj` to its end: its status, and what it said.
fn say(session: &Session, arguments: &str) -> (ExitStatus, String) {
    let mut run = session.start(arguments);
    let status = run.wait();
    (status, run.stdout() + &run.stderr())
}

/// From which sample on a change was said to be in effect.
fn sample_of(sentence: &str) -> u64 {
    sentence.trim().rsplit(' ').next().unwrap().parse().unwrap_or_else(|_| panic!("{sentence}"))
}

fn a_loop_is_changed_while_it_runs_over(bus: &str) {
    let session = Session::on(bus);
    let mut plant = session.start("plant --json --set duration=60s --trace trace.csv");
    let mut controller = session.start("controller");
    let monitor = session.start("monitor");
    eventually("the loop", || monitor.stdout().contains("mtj").then_some(()));
    let mut changes = Vec::new();
    for change in [
        "set link.torque.latency=2ms law.memory.policy=delivered",
        "kick --torque=-3,1 --duration 50ms",
        "pause",
        "resume",
        "set law.kind=tj timing.sample_period=5ms",
        "set trajectory.radius=1.0 trajectory.blend=300ms",
    ] {
        let (status, said) = say(&session, change);
        assert!(status.success(), "{change}: {said}");
        changes.push(sample_of(&said));
    }
    assert!(changes.is_sorted(), "{changes:?}");
    let heard = eventually("six changes", || {
        let lines = monitor.stdout();
        (lines.matches("changed: ").count() == 6).then_some(lines)
    });
    for words in ["link.torque.latency=2ms, law.memory.policy=delivered", "kick [-3.0, 1.0]", "tj"]
    {
        assert!(heard.contains(words), "announced to every monitor: {words} in {heard}");
    }
    eventually("a second under tj", || monitor.stdout().contains(" s  tj ").then_some(()));
    assert!(!controller.has_ended() && !plant.has_ended());
    // The way to the smaller circle.
    thread::sleep(Duration::from_millis(400));
    plant.signal(nix::sys::signal::Signal::SIGINT);
    assert!(plant.wait().success(), "{}", plant.stderr());
    let report: serde_json::Value = serde_json::from_str(&plant.stdout()).unwrap();
    assert_eq!(report["law"], "tj", "as it was in the end");
    assert_eq!(report["commands"]["rejected"], 0);
    let trace = std::fs::read_to_string(session.directory.join("trace.csv")).unwrap();
    let times: Vec<f64> =
        trace.lines().skip(1).map(|row| row.split(',').next().unwrap().parse().unwrap()).collect();
    let last = changes[4] as usize;
    let period = |k: usize| ((times[k + 1] - times[k]) * 1e3).round();
    assert_eq!(
        (period(last - 1), period(last)),
        (10.0, 5.0),
        "from the very sample that was named"
    );
    assert_desired_point_does_not_jump(&trace);
}

/// Looks at the desired point of a trace: from sample to sample it goes no faster than the paper's
/// circle and the way to another one need.
fn assert_desired_point_does_not_jump(trace: &str) {
    let mut lines = trace.lines();
    let titles: Vec<&str> = lines.next().unwrap().split(',').collect();
    let columns = ["time_s", "x_desired_m", "y_desired_m"]
        .map(|title| titles.iter().position(|column| *column == title).unwrap());
    let rows: Vec<[f64; 3]> = lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            columns.map(|column| cells[column].parse().unwrap())
        })
        .collect();
    let radius = |row: &[f64; 3]| row[1].hypot(row[2]);
    assert!((radius(rows.last().unwrap()) - 1.0).abs() < 0.15, "on the smaller circle");
    for pair in rows.windows(2) {
        let way = (pair[1][1] - pair[0][1]).hypot(pair[1][2] - pair[0][2]);
        let time = pair[1][0] - pair[0][0];
        assert!(way <= 8.0 * time, "{way} m in {time} s at {} s", pair[0][0]);
    }
}

#[test]
fn a_loop_is_changed_while_it_runs_over_shared_memory() {
    a_loop_is_changed_while_it_runs_over("iceoryx2");
}

#[test]
fn a_loop_is_changed_while_it_runs_over_zenoh() {
    a_loop_is_changed_while_it_runs_over("zenoh");
}

#[test]
fn an_impossible_change_is_bad_input_and_a_missing_plant_is_not() {
    let session = Session::on("iceoryx2");
    let (status, said) = say(&session, "set law.kp=31");
    assert_eq!(status.code(), Some(1), "{said}");
    assert!(said.contains(&session.name) && said.contains("there is no plant"), "{said}");
    let _plant = session.start("plant --set duration=60s");
    for (change, words) in [
        ("set law.kp=-31", "law.kp = -31"),
        ("set law.kp=31 arm.links[0].mass=1", "arm.links[0].mass"),
        ("set law.kp", "KEY=VALUE"),
        ("kick --duration soon", "--duration soon"),
        ("kick --duration 2min", "a kick is"),
    ] {
        let (status, said) = say(&session, change);
        assert_eq!(status.code(), Some(2), "{change}: {said}");
        assert!(said.contains(words) && said.trim().lines().count() == 1, "{change}: {said}");
    }
}

#[test]
fn a_reset_begins_another_run_that_the_controller_follows() {
    let session = Session::on("iceoryx2");
    let plant = session.start("plant --json --set duration=2s");
    let _controller = session.start("controller");
    let monitor = session.start("monitor");
    eventually("the loop", || monitor.stdout().contains("k 0.").then_some(()));
    let (status, said) = say(&session, "reset");
    assert!(status.success(), "{said}");
    let report = eventually("the end of the second run", || {
        serde_json::from_str::<serde_json::Value>(&plant.stdout()).ok()
    });
    assert_eq!((&report["samples"], &report["duration_s"]), (&200.into(), &2.0.into()));
}
