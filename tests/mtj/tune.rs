//! `mtj tune` as a user has it: what it takes for the latency, and what it prints about its
//! proposal.

use std::{
    fs,
    path::PathBuf,
    process::{Command, Stdio},
    sync::Arc,
};

use serde_json::Value;

use crate::{
    machine::{self, Place},
    session::MTJ,
};

/// A file of latencies for a replay, removed when the test is over.
struct Replay(PathBuf, #[expect(dead_code, reason = "held, not read")] Arc<Place>);

impl Replay {
    fn new(name: &str, latencies_ms: &[f64]) -> Self {
        let path = std::env::temp_dir().join(format!("mtj-tune-{name}-{}", std::process::id()));
        let lines: String = latencies_ms.iter().map(|latency| format!("{latency}\n")).collect();
        fs::write(&path, format!("latency_ms\n{lines}")).unwrap();
        Self(path, machine::beside_others())
    }

    fn set(&self) -> String {
        let file = self.0.display();
        format!(r#"link.state.jitter={{ kind = "replay", file = "{file}" }}"#)
    }
}

impl Drop for Replay {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

/// What the program prints on standard output.
fn stdout(command: &mut Command) -> String {
    let output = command.stdin(Stdio::null()).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {stderr}");
    String::from_utf8(output.stdout).unwrap()
}

fn tune(arguments: &[&str]) -> String {
    stdout(Command::new(MTJ).arg("tune").args(arguments))
}

fn proposal(arguments: &[&str]) -> Value {
    serde_json::from_str(&tune(&[arguments, &["--json"]].concat())).unwrap()
}

/// The report of the run that a proposal tells its user to repeat, for as long as it was verified.
fn repeated(proposal: &Value, set: &str) -> Value {
    let command = proposal["command"].as_str().unwrap().strip_prefix("mtj run").unwrap();
    let shell = format!("'{MTJ}' run --json {command} --set duration=60s {set}");
    serde_json::from_str(&stdout(Command::new("sh").arg("-c").arg(shell))).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn a_proposal_knows_the_latency_of_a_replayed_file_and_simulates_it() {
    let mut latencies = vec![4.0; 100];
    (latencies[17], latencies[18]) = (20.0, 20.0);
    let replay = Replay::new("replayed", &latencies);
    let set = replay.set();
    let proposal = proposal(&["--set", &set]);
    let wanted = &proposal["wanted"];
    let (mean, p99) = (number(&wanted["latency_s"]), number(&wanted["latency_p99_s"]));
    assert!((mean - 4.32e-3).abs() < 1e-4 && p99 == 0.02, "{wanted}");
    assert_eq!(wanted["latency_source"], "links");
    // What is set for the run keeps the file, and the run has the error that was verified.
    let run = repeated(&proposal, "");
    let (ours, theirs) =
        (number(&proposal["verified"]["rms_error_m"]), number(&run["rms_error_m"]));
    assert!((theirs / ours - 1.0).abs() < 0.1, "{ours} m verified, {theirs} m when repeated");
    let table = tune(&["--set", &set]);
    assert!(table.contains("99 % within 20.000 ms; drawn from the links"), "{table}");
}

#[test]
fn a_given_latency_takes_the_place_of_a_replayed_file_in_design_and_in_simulation() {
    let replay = Replay::new("given", &[40.0]);
    let set = replay.set();
    let beside = proposal(&["--latency", "5ms", "--set", &set]);
    let alone = proposal(&["--latency", "5ms"]);
    for key in ["wanted", "kp", "kd", "memory", "verified", "with_margin"] {
        assert_eq!(beside[key], alone[key], "{key}");
    }
    assert_eq!(beside["wanted"]["latency_source"], "given");
    let rms = |proposal| number(&repeated(proposal, "")["rms_error_m"]);
    assert_eq!(rms(&beside), rms(&alone));
    let verified = number(&beside["verified"]["rms_error_m"]);
    assert!((rms(&beside) - verified).abs() < 1e-8, "{verified} m verified: {}", rms(&beside));
    let table = tune(&["--latency", "5ms", "--set", &set]);
    assert!(table.contains("given, in place of the links' own latency"), "{table}");
}

#[test]
fn a_verification_has_the_worst_of_several_starts_and_lasts_a_minute() {
    let _place = machine::beside_others();
    let proposal = proposal(&["--latency", "5ms"]);
    assert_eq!(proposal["shortfalls"], serde_json::json!([]));
    for (row, latency) in [("verified", "5ms"), ("with_margin", "7.5ms")] {
        let row = &proposal[row];
        let [own, median, worst] = ["rms_error_m", "median_rms_error_m", "worst_rms_error_m"]
            .map(|name| number(&row[name]));
        assert!(median <= worst && own <= worst, "{row}");
        // Another start, beside the scenario's own.
        let set = format!(
            "--set link.torque.latency={latency} --set 'arm.position=[0.031, 1.5717963267948966]'"
        );
        let other = number(&repeated(&proposal, &set)["rms_error_m"]);
        assert!(other <= 1.001 * worst && other >= 0.9 * median, "{other} m, {row}");
    }
}

#[test]
fn what_is_wanted_and_not_reached_is_said() {
    let _place = machine::beside_others();
    let table = tune(&["--latency", "20ms", "--time-constant", "0.5s"]);
    let verified = table.lines().find(|line| line.starts_with("with the latency")).unwrap();
    let shortfall = table.lines().find(|line| line.starts_with("falls short")).unwrap();
    let found = shortfall.split("time constant of ").nth(1).unwrap().split(" s;").next().unwrap();
    assert!(verified.contains(&format!("{found} s")), "{verified}\n{shortfall}");
    assert!(shortfall.ends_with("0.5 s was wanted"), "{shortfall}");
    let found: f64 = found.parse().unwrap();
    assert!((found / 0.5 - 1.0).abs() > 0.25, "{found}");
}

#[test]
fn a_redundant_arm_that_gathers_speed_for_a_minute_is_proposed_gains_with_a_warning() {
    let _place = machine::beside_others();
    let redundant = ["--scenario", "redundant/mtj", "--set", "timing.sample_period=10ms"];
    let proposal = proposal(&redundant);
    let shortfalls = proposal["shortfalls"].as_array().unwrap();
    let first = shortfalls.first().and_then(Value::as_str).unwrap_or_default();
    assert!(first.starts_with("from 9 starts and for 60 s or more, "), "{shortfalls:?}");
    let limits = proposal["wanted"]["torque_limit_nm"].as_array().unwrap();
    let exceeds = |row: &str| {
        let peaks = proposal[row]["peak_torque_nm"].as_array().unwrap();
        let is_over = peaks.iter().zip(limits).any(|(peak, limit)| number(peak) > number(limit));
        is_over || proposal[row]["diverged"] == true
    };
    assert!(exceeds("verified") || exceeds("with_margin"), "{proposal}");
}
