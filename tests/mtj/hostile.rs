//! A bus that somebody else writes to as well: rubbish, forgeries and leftovers, many times as many
//! as the loop's own samples. Nothing of it moves the arm.
//!
//! Every forgery is wrong in at least one field that says whose it is. What is right in all of them
//! cannot be told from the genuine without authentication.

use std::{
    fs,
    time::{Duration, Instant},
};

use crate::attack::{Attack, over_iceoryx2, over_zenoh};
use crate::session::{Running, Session, eventually, free_port};
use mtj_protocol::{
    bus::Bus,
    iceoryx2::Iceoryx2Bus,
    sample::{ChangeSample, StateSample, StatusSample},
};
use serde_json::Value;

/// Messages a second: a hundred times as many as the loop's.
pub(crate) const RATE: u64 = 10_000;

/// How many messages each test sends.
fn messages() -> u64 {
    let asked = std::env::var("MTJ_HOSTILE_MESSAGES");
    asked.map_or(50_000, |count| count.parse().unwrap())
}

/// Starts an attack on the session, over its bus.
type Begin = fn(&str, &str) -> Attack;

/// A session of a plant with a controller, attacked if so wanted; what it reported, and the
/// messages that were sent.
fn run(bus: &str, plant: &str, attack: Option<Begin>) -> (Session, Value, u64) {
    let session = Session::on("local");
    let endpoint = format!("tcp/127.0.0.1:{}", free_port());
    let there: Vec<&str> = match bus {
        "zenoh" => vec!["--session", &session.name, "--connect", &endpoint],
        _ => vec!["--session", &session.name, "--bus", "iceoryx2"],
    };
    let listen: Vec<&str> =
        there.iter().map(|word| if *word == "--connect" { "--listen" } else { *word }).collect();
    let plant: Vec<&str> = plant.split_whitespace().collect();
    let mut plant = session.start_exactly(&[&plant[..], &listen].concat());
    let mut controller = session.start_exactly(&[&["controller"][..], &there].concat());
    let attack = attack.map(|begin| begin(&session.name, &endpoint));
    let status = wait_long(&mut plant);
    let sent = attack.map_or(0, Attack::end);
    assert!(status.success(), "{bus}: {}", plant.stderr());
    assert!(!controller.has_ended(), "{bus}: {}", controller.stderr());
    (session, serde_json::from_str(&plant.stdout()).unwrap(), sent)
}

fn wait_long(plant: &mut Running) -> std::process::ExitStatus {
    let end = Instant::now() + Duration::from_secs(900);
    while !plant.has_ended() && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(20));
    }
    plant.wait()
}

fn a_lockstep_run_stays_the_same(bus: &str, attack: Begin) {
    let plant = "plant --json --scenario sampled/mtj --set timing.clock=lockstep --set duration=600s --trace trace.csv";
    let trace =
        |session: &Session| fs::read_to_string(session.directory.join("trace.csv")).unwrap();
    let (quiet, report, _) = run(bus, plant, None);
    assert_eq!(report["commands"]["rejected"], 0);
    let (mut sent, mut rejected, mut runs) = (0, 0, 0);
    while sent < messages() {
        let (session, report, count) = run(bus, plant, Some(attack));
        assert!(trace(&session) == trace(&quiet), "{bus}: the trajectory is another one: {report}");
        rejected += report["commands"]["rejected"].as_u64().unwrap();
        sent += count;
        runs += 1;
    }
    assert!(rejected > 0, "{bus}: what was ignored was counted");
    eprintln!(
        "lockstep over {bus}: {sent} messages in {runs} runs, {rejected} torques rejected, the same trajectory"
    );
}

fn a_real_time_run_is_as_accurate(bus: &str, attack: Begin) {
    let seconds = (messages() / RATE).max(5) + 1;
    let plant = format!(
        "plant --json --scenario sampled/mtj --set duration={seconds}s --set law.memory.policy=delivered \
         --set law.prediction.horizon=measured"
    );
    let rms = |report: &Value| report["rms_error_m"].as_f64().unwrap();
    const ATTEMPTS: usize = 4;
    for attempt in 1..=ATTEMPTS {
        let (_, quiet, _) = run(bus, &plant, None);
        let (_, disturbed, sent) = run(bus, &plant, Some(attack));
        let change = rms(&disturbed) / rms(&quiet) - 1.0;
        let told = |report: &Value| {
            format!(
                "{:.4e} m, p50 {} and p99 {} µs, {} late, {} lost, {} rejected",
                rms(report),
                report["round_trip_us"]["p50"],
                report["round_trip_us"]["p99"],
                report["commands"]["late"],
                report["commands"]["lost"],
                report["commands"]["rejected"],
            )
        };
        eprintln!(
            "real time over {bus}: {sent} messages in {seconds} s; undisturbed {}; disturbed {}; rms {:+.2} %",
            told(&quiet),
            told(&disturbed),
            100.0 * change
        );
        assert!(sent >= messages() * 9 / 10, "{sent} messages were sent");
        assert!(disturbed["commands"]["rejected"].as_u64().unwrap() > 0, "{disturbed}");
        assert_eq!(disturbed["diverged"], false);
        // What the machine withholds from either run, no program can make good.
        let kept_up =
            |report: &Value| report["deadline_misses"] == 0 && report["commands"]["late"] == 0;
        if change.abs() <= 0.05 {
            return;
        }
        let had_its_time = kept_up(&quiet) && kept_up(&disturbed);
        assert!(!had_its_time && attempt < ATTEMPTS, "{bus}: rms {:+.1} %", 100.0 * change);
    }
}

#[test]
fn hostile_bytes_over_zenoh_leave_a_lockstep_run_bit_for_bit_the_same() {
    a_lockstep_run_stays_the_same("zenoh", over_zenoh);
}

#[test]
fn only_the_plant_writes_its_topics_in_shared_memory() {
    let session = Session::on("iceoryx2");
    let mut plant = session.start("plant --set duration=1h");
    let bus = Iceoryx2Bus::open(&session.name).unwrap();
    eventually("a plant", || bus.fetch().unwrap());
    assert!(bus.writer::<StateSample>().is_err());
    assert!(bus.writer::<StatusSample>().is_err());
    assert!(bus.writer::<ChangeSample>().is_err());
    assert!(!plant.has_ended());
}

#[test]
fn hostile_samples_in_shared_memory_leave_a_lockstep_run_bit_for_bit_the_same() {
    a_lockstep_run_stays_the_same("iceoryx2", over_iceoryx2);
}

#[test]
fn hostile_bytes_over_zenoh_leave_a_real_time_loop_as_accurate_as_it_was() {
    a_real_time_run_is_as_accurate("zenoh", over_zenoh);
}

#[test]
fn hostile_samples_in_shared_memory_leave_a_real_time_loop_as_accurate_as_it_was() {
    a_real_time_run_is_as_accurate("iceoryx2", over_iceoryx2);
}
