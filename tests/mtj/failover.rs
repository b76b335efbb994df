//! Controllers that die in mid-run, and others that stand by: the plant never goes without for
//! long.
//!
//! `MTJ_KILLS` is how many die in one run, 10 unless set. `-- --nocapture` prints what each run
//! showed.

use std::{env, thread, time::Duration};

use crate::{
    machine,
    session::{Running, Session, observer::Observer, send},
};
use nix::sys::signal::Signal;
use serde_json::Value;

/// How many runs there are before this machine is found unable to keep up.
const ATTEMPTS: usize = 20;
/// `safety.lease` and `timing.sample_period`, ms.
const LEASE: f64 = 5.0;
const SAMPLE_PERIOD: f64 = 2.0;

/// How often the leading controller is killed.
fn kills() -> u64 {
    env::var("MTJ_KILLS").map_or(10, |kills| kills.parse().unwrap())
}

/// Of each run, s. Its rms error is that of the second half, in which the kills are.
fn duration() -> f64 {
    10.0 + 0.2 * kills() as f64
}

fn plant(session: &Session) -> Running {
    in_real_time(
        session,
        60,
        &format!(
            "plant --json --scenario sampled/mtj --set duration={}s \
         --set timing.sample_period={SAMPLE_PERIOD}ms --set safety.lease={LEASE}ms \
         --set law.memory.policy=delivered",
            duration()
        ),
    )
}

/// A role with deadlines of some milliseconds needs a priority by which nothing else keeps it from
/// them.
fn in_real_time(session: &Session, priority: u32, arguments: &str) -> Running {
    session.start(&format!("{arguments} --priority {priority}"))
}

fn report_of(mut plant: Running) -> Value {
    let status = plant.wait();
    assert!(status.success(), "{status}: {}", plant.stderr());
    serde_json::from_str(&plant.stdout()).unwrap()
}

/// Whether the machine gave the processes their time: what it withheld, no program can make good.
/// The run without kills, just before, is the peer that shows it.
fn kept_up(report: &Value, undisturbed: &Value) -> bool {
    let commands = &undisturbed["commands"];
    report["deadline_misses"] == 0 && commands["late"] == 0 && commands["lost"] == 0
}

fn fails_over(bus: &str) {
    for _ in 0..ATTEMPTS {
        let undisturbed = run_undisturbed(bus);
        let report = run_with_kills(bus);
        let of = |report: &Value, name: &str| report[name].as_f64().unwrap();
        let gap = of(&report, "longest_gap_us") / 1e3;
        let (rms, reference) = (of(&report, "rms_error_m"), of(&undisturbed, "rms_error_m"));
        println!(
            "{bus}: gap {gap:.2} ms, rms {rms:.3e} m ({:.2} times the undisturbed), {report}",
            rms / reference
        );
        assert_eq!((&report["diverged"], &report["timeouts"]), (&false.into(), &0.into()));
        let is_short = gap < LEASE + 2.0 * SAMPLE_PERIOD;
        let is_accurate = rms <= 1.5 * reference;
        if report["takeovers"] == kills() && is_short && is_accurate {
            return;
        }
        let excuse = !kept_up(&report, &undisturbed);
        assert!(excuse, "{gap} ms without a fresh torque: {report}\n{undisturbed}");
    }
    panic!("this machine never kept up with {SAMPLE_PERIOD} ms in {ATTEMPTS} runs");
}

fn run_undisturbed(bus: &str) -> Value {
    let session = Session::on(bus);
    let _controllers =
        [in_real_time(&session, 50, "controller"), in_real_time(&session, 50, "controller")];
    report_of(plant(&session))
}

/// Kills the controller in charge again and again; another one takes its place on the bench.
fn run_with_kills(bus: &str) -> Value {
    let session = Session::on(bus);
    let mut controllers =
        vec![in_real_time(&session, 50, "controller"), in_real_time(&session, 50, "controller")];
    let running = plant(&session);
    let mut observer = Observer::join(&session);
    let half = 1e9 * duration() / 2.0;
    observer.until("the second half of the run", |observer| {
        (observer.states.last()?.header.time_ns as f64 > half).then_some(())
    });
    let mut leader = 0;
    for _ in 0..kills() {
        leader = observer.leader(leader, 1);
        // A little later, at any point of a sample period.
        thread::sleep(Duration::from_micros(50_000 + 177 * u64::from(leader % 16)));
        send(leader, Signal::SIGKILL);
        controllers.retain_mut(|controller| !controller.has_ended_as(leader));
        // A start takes a core for some milliseconds: not those of the take-over.
        let next = observer.leader(leader, 0);
        assert_ne!(next, leader);
        controllers.push(in_real_time(&session, 50, "controller"));
    }
    observer.leader(leader, 1);
    report_of(running)
}

#[test]
fn dead_leaders_over_iceoryx2_leave_no_gap_beyond_the_lease() {
    let _machine = machine::alone();
    fails_over("iceoryx2");
}

#[test]
fn dead_leaders_over_zenoh_leave_no_gap_beyond_the_lease() {
    let _machine = machine::alone();
    fails_over("zenoh");
}
