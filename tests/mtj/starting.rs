//! How soon an arm is held after `mtj` was started. `-- --nocapture` prints how long it took.

use std::{
    thread,
    time::{Duration, Instant},
};

use crate::{
    machine,
    session::{Session, observer::Observer},
};
use nix::sys::signal::Signal;

/// How often each start is measured. The fastest is what mtj needs; the others also waited for
/// whatever else was busy on this machine.
const STARTS: usize = 5;

/// In one process.
const SOON: Duration = Duration::from_millis(100);
/// In a process for each role.
const ACROSS_PROCESSES: Duration = Duration::from_millis(500);

fn milliseconds(duration: Duration) -> f64 {
    1e3 * duration.as_secs_f64()
}

/// Fails unless the fastest of some starts takes less than `limit`.
fn assert_starts(what: &str, limit: Duration, start: impl Fn() -> Duration) {
    let mut times: Vec<Duration> = (0..STARTS).map(|_| start()).collect();
    times.sort();
    let (fastest, median, slowest) = (times[0], times[STARTS / 2], times[STARTS - 1]);
    println!(
        "{what}: {:.0} ms, {:.0} to {:.0} ms",
        milliseconds(median),
        milliseconds(fastest),
        milliseconds(slowest)
    );
    assert!(fastest < limit, "{what}: {times:?}");
}

/// From the start of a command to its end: no torque comes later.
fn whole_run(bus: &str, arguments: &str) -> Duration {
    let session = Session::on(bus);
    let began = Instant::now();
    let mut run = session.start(arguments);
    let status = run.wait();
    let took = began.elapsed();
    assert!(status.success(), "{}", run.stderr());
    took
}

/// From the start of a command to the first torque that a monitor of its bus hears.
fn first_torque(bus: &str, arguments: &str) -> Duration {
    let session = Session::on(bus);
    let mut observer = Observer::join(&session);
    let began = Instant::now();
    let mut started = session.start(arguments);
    while observer.torques.is_empty() {
        assert!(!started.has_ended(), "{}", started.stderr());
        thread::sleep(Duration::from_micros(200));
        observer.listen();
    }
    let took = began.elapsed();
    drop(observer);
    started.signal(Signal::SIGINT);
    started.wait();
    session.await_processes(0);
    took
}

#[test]
fn a_run_in_one_process_has_its_torque_within_a_tenth_of_a_second() {
    let _machine = machine::alone();
    // One sample: the torque is computed, applied and reported when the process ends.
    let one = "run --json --set timing.clock=lockstep --set duration=10ms";
    assert_starts("mtj run, one sample, start to end", SOON, || whole_run("local", one));
}

#[test]
fn a_loop_of_several_processes_has_its_torque_within_half_a_second() {
    let _machine = machine::alone();
    for command in ["run", "up"] {
        let what = format!("mtj {command} over iceoryx2, start to first torque");
        assert_starts(&what, ACROSS_PROCESSES, || first_torque("iceoryx2", command));
    }
    // Nobody has opened shared memory for the roles here; and on Zenoh nobody can listen before the
    // plant.
    for bus in ["iceoryx2", "zenoh"] {
        let what = format!("mtj run over {bus}, one sample, start to end");
        let one = "run --json --set duration=10ms";
        assert_starts(&what, ACROSS_PROCESSES, || whole_run(bus, one));
    }
}
