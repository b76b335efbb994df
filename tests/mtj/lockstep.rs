//! Runs in virtual time: the same everywhere, and the numbers of an independent program.

use std::fs;

use crate::session::Session;
use mtj_model::scenario::{Override, Scenario, built_in};
use mtj_plant::{plant::Outcome, report::Report};
use mtj_study::experiment;

fn run(name: &str, sets: &[&str]) -> Outcome {
    let sets: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
    let scenario = Scenario::parse(name, built_in(name).unwrap(), &sets).unwrap();
    experiment::run_direct(&scenario, true, &|| true).unwrap()
}

fn sampled(name: &str, sets: &[&str]) -> Report {
    run(name, &[&["timing.clock=lockstep"], sets].concat()).report
}

fn trace_over(bus: &str, arguments: &str) -> String {
    let session = Session::on(bus);
    let report = session.report(&format!("run --json --trace trace.csv {arguments}"));
    assert_eq!(report["bus"], bus);
    assert_eq!(report["commands"]["lost"], 0);
    assert_eq!(report["commands"]["rejected"], 0);
    let trace = fs::read_to_string(session.directory.join("trace.csv")).unwrap();
    assert_eq!(trace.lines().count() as u64, report["samples"].as_u64().unwrap() + 1);
    trace
}

#[test]
fn a_lockstep_run_is_the_same_over_every_bus() {
    for arguments in [
        "--scenario sampled/mtj --set timing.clock=lockstep",
        "--scenario sampled/mtj --set timing.clock=lockstep --set law.memory.policy=delivered \
         --set law.prediction.horizon=measured --set link.state.latency=3ms \
         --set link.torque.latency=12ms --set sensor.noise=0.01 --set duration=5s",
        "--scenario redundant/mtj --set duration=2s",
    ] {
        let arguments = arguments.split_whitespace().collect::<Vec<_>>().join(" ");
        let reference = trace_over("local", &arguments);
        for bus in ["local", "iceoryx2", "zenoh", "iceoryx2", "zenoh"] {
            assert!(trace_over(bus, &arguments) == reference, "{arguments} over {bus}");
        }
    }
}

#[test]
fn spinning_gives_the_same_trace_as_blocking() {
    let arguments = "--scenario sampled/mtj --set timing.clock=lockstep --set duration=2s";
    let reference = trace_over("local", arguments);
    for bus in ["iceoryx2", "zenoh"] {
        let spinning = trace_over(bus, &format!("{arguments} --wait spin"));
        assert!(spinning == reference, "{bus}");
    }
}

/// Fails unless `found` is within `fraction` of `expected`.
fn assert_within(fraction: f64, found: Option<f64>, expected: f64, what: &str) {
    let found = found.unwrap_or(f64::NAN);
    assert!(
        (found / expected - 1.0).abs() <= fraction,
        "{what}: {found} is not within {fraction} of {expected}"
    );
}

#[test]
fn fig_4_has_the_energies_and_errors_of_the_independent_program() {
    for (name, energy, rms) in [
        ("paper/fig4-tj", 152.3, 8.37e-3),
        ("paper/fig4-mtj", 156.5, 1.43e-3),
        ("paper/fig4-mb", 153.2, 1.25e-4),
        ("paper/fig4-mb-perturbed", 153.0, 2.21e-3),
    ] {
        let report = run(name, &[]).report;
        assert_within(0.01, report.energy_j, energy, name);
        assert_within(0.02, report.rms_error_m, rms, name);
        assert!(!report.diverged && report.samples == 40_000, "{name}");
    }
    let report = run("paper/fig4-mtj", &[]).report;
    assert_within(0.01, report.energy_j, 156.0, "the paper's 156 J");
    assert_within(0.02, report.rms_error_m, 1.428e-3, "to four digits");
}

const DELIVERED: &str = "law.memory.policy=delivered";
const EQ_11: &str = "law.acceleration=true";
/// k = 1: the scenario has a factor of its own.
const TRUST_ALL: &str = "law.factor.kind=constant";
const TDC: [&str; 5] = ["law.kind=tdc", "law.kp=20", "law.kd=20", TRUST_ALL, DELIVERED];

/// An rms error that an independent program found, m.
#[derive(Clone, Copy)]
enum Known {
    /// To a part of itself.
    Within(f64, f64),
    /// To a factor of two: of a limit cycle only the size is known.
    About(f64),
    /// The run diverges.
    Lost,
}

use Known::{About, Lost, Within};

/// To 2 %.
const fn is(error: f64) -> Known {
    Within(0.02, error)
}

/// To 1 %.
const fn exactly(error: f64) -> Known {
    Within(0.01, error)
}

/// The columns of the README's table: settings, and the rms error at latencies of 0, 1, 5 and 20
/// ms.
fn known() -> Vec<(&'static str, Vec<&'static str>, [Known; 4])> {
    let limit_cycles = [is(1.430e-3), is(1.376e-2), About(1.46e-1), About(1.8)];
    vec![
        ("sampled/mtj", vec!["law.memory.policy=sent"], limit_cycles),
        ("sampled/mtj", vec!["law.memory.policy=applied"], limit_cycles),
        ("sampled/mtj", vec![DELIVERED], [is(1.430e-3), is(2.227e-3), About(3.60e-2), About(1.9)]),
        (
            "sampled/mtj",
            vec![DELIVERED, "law.prediction.horizon="],
            [is(1.430e-3), is(1.568e-3), is(2.106e-3), is(3.780e-3)],
        ),
        (
            "sampled/mtj",
            vec![EQ_11],
            [exactly(1.243e-3), exactly(1.253e-3), exactly(1.270e-3), Lost],
        ),
        (
            "sampled/mtj",
            vec![EQ_11, DELIVERED],
            [exactly(1.243e-3), exactly(1.399e-3), exactly(2.008e-3), exactly(4.296e-3)],
        ),
        (
            "sampled/mtj",
            [&TDC[..], &["law.mass=1.5"]].concat(),
            [exactly(2.334e-3), exactly(2.640e-3), exactly(3.878e-3), exactly(8.897e-3)],
        ),
        (
            "sampled/mb",
            vec!["law.kp=8", "law.kd=4"],
            [is(2.534e-3), is(3.067e-3), is(5.223e-3), is(1.394e-2)],
        ),
    ]
}

/// Fails unless a run has the error that is known of it.
fn assert_known(report: &Report, known: Known, what: &str) {
    let found = report.rms_error_m.unwrap_or(f64::NAN);
    assert_eq!(report.diverged, matches!(known, Lost), "{what}: {found}");
    match known {
        Lost => {}
        Within(fraction, expected) => assert_within(fraction, Some(found), expected, what),
        About(expected) => {
            let ratio = found / expected;
            assert!((0.5..2.0).contains(&ratio), "{what}: {found}, not about {expected}");
        }
    }
}

#[test]
fn the_documented_errors_under_latency_are_reproduced() {
    for (name, sets, errors) in known() {
        for (latency, known) in ["0ms", "1ms", "5ms", "20ms"].iter().zip(errors) {
            let link = format!("link.torque.latency={latency}");
            // The horizon of a predicting law is the constant latency.
            let ahead = |set: &&str| {
                if set.ends_with('=') { format!("{set}{latency}") } else { set.to_string() }
            };
            let sets: Vec<String> = sets.iter().map(ahead).chain([link]).collect();
            let report = sampled(name, &sets.iter().map(String::as_str).collect::<Vec<_>>());
            assert_known(&report, known, &format!("{name} {sets:?}"));
        }
    }
}

#[test]
fn the_task_inertia_makes_time_delay_control_incremental_dynamic_inversion() {
    for (latency, expected) in [
        ("0ms", 0.99e-3),
        ("5ms", 1.71e-3),
        ("10ms", 2.41e-3),
        ("20ms", 3.92e-3),
        ("30ms", 5.47e-3),
        ("40ms", 7.07e-3),
    ] {
        let link = format!("link.torque.latency={latency}");
        let sets = [&TDC[..], &["law.mass=\"task-inertia\"", &link]].concat();
        assert_within(0.01, sampled("sampled/mtj", &sets).rms_error_m, expected, latency);
    }
}

#[test]
fn eq_11_is_time_delay_control_on_the_whole_arm_too() {
    for policy in ["law.memory.policy=sent", DELIVERED] {
        for latency in ["0ms", "5ms"] {
            let link = format!("link.torque.latency={latency}");
            // K_p and K_d of 20/s² and 20/s on 1.5 kg.
            let eq_11 = ["law.kp=30", "law.kd=30", "law.mass=1.5", EQ_11, TRUST_ALL, policy, &link];
            let tdc = [&TDC[..4], &["law.mass=1.5", policy, &link]].concat();
            let lockstep = |sets: &[&str]| {
                run("sampled/mtj", &[&["timing.clock=lockstep"], sets].concat()).trace
            };
            let (one, other) = (lockstep(&eq_11), lockstep(&tdc));
            assert_eq!(one.len(), other.len());
            let apart = one.iter().zip(&other).flat_map(|(a, b)| {
                a.tip.iter().zip(&b.tip).map(|(a, b)| (a - b).abs()).collect::<Vec<_>>()
            });
            let apart = apart.fold(0.0, f64::max);
            assert!(apart < 1e-12, "{policy}, {latency}: {apart} m");
        }
    }
}

#[test]
fn eq_11_lets_all_of_the_memory_be_trusted_and_then_a_load_costs_little() {
    let gravity = "arm.gravity=[0,-9.81]";
    for (sets, expected) in [
        (vec![], 38.2e-3),
        (vec![EQ_11], 33.6e-3),
        (vec![EQ_11, TRUST_ALL], 3.05e-3),
        (vec![EQ_11, TRUST_ALL, DELIVERED, "link.torque.latency=5ms"], 4.6e-3),
        (vec![EQ_11, TRUST_ALL, DELIVERED, "link.torque.latency=20ms"], 9.3e-3),
    ] {
        let what = format!("{sets:?}");
        let report = sampled("sampled/mtj", &[&sets[..], &[gravity]].concat());
        assert_within(0.01, report.rms_error_m, expected, &what);
    }
    // Without the acceleration term k = 1 is not usable.
    let report = sampled("sampled/mtj", &[TRUST_ALL, gravity]);
    assert!(report.diverged || report.rms_error_m.unwrap() > 0.1);
}

#[test]
fn a_measured_horizon_does_as_well_as_a_known_one() {
    for (latency, expected) in [("1ms", 1.568e-3), ("5ms", 2.106e-3), ("20ms", 3.780e-3)] {
        let link = format!("link.torque.latency={latency}");
        let sets = [DELIVERED, "law.prediction.horizon=measured", &link];
        assert_within(0.05, sampled("sampled/mtj", &sets).rms_error_m, expected, latency);
    }
}

#[test]
fn splitting_a_latency_differently_gives_the_same_trajectory() {
    let trace = |there: &str, back: &str| {
        let (there, back) =
            (format!("link.state.latency={there}"), format!("link.torque.latency={back}"));
        let sets = [
            "timing.clock=lockstep",
            "duration=5s",
            DELIVERED,
            "law.prediction.horizon=measured",
            &there,
            &back,
        ];
        run("sampled/mtj", &sets).trace
    };
    let reference = trace("13ms", "0ms");
    assert!(reference == trace("0ms", "13ms"));
    assert!(reference == trace("4300us", "8700us"));
    assert!(reference != trace("0ms", "14ms"));
}

#[test]
fn a_run_that_diverges_is_a_result() {
    let session = Session::on("local");
    let report = session.report(
        "run --json --scenario sampled/tj --set law.kp=150 --set law.kd=300 --set timing.clock=lockstep",
    );
    assert_eq!(report["diverged"], true);
    assert!(report["duration_s"].as_f64().unwrap() < 20.0);
}

#[test]
fn a_report_has_exactly_the_documented_keys() {
    let keys = |value: &serde_json::Value| {
        let mut keys: Vec<_> = value.as_object().unwrap().keys().cloned().collect();
        keys.sort();
        keys.join(" ")
    };
    let arguments =
        "run --json --scenario sampled/mtj --set duration=200ms --set timing.clock=lockstep";
    for bus in ["local", "iceoryx2"] {
        let report = Session::on(bus).report(arguments);
        assert_eq!(
            keys(&report),
            "bus clock commands deadline_misses diverged duration_s energy_j law longest_gap_us \
             longest_stall_us peak_error_m peak_torque_nm residence_us rms_error_m round_trip_us \
             samples scenario stalls takeovers timeouts torque_step_rms_nm"
        );
        assert_eq!(keys(&report["commands"]), "applied late lost rejected sent too_old");
        assert_eq!(report["peak_torque_nm"].as_array().unwrap().len(), 2);
        assert!(report["deadline_misses"].is_null(), "no deadlines in virtual time");
        for times in ["round_trip_us", "residence_us"] {
            if bus == "local" {
                assert!(report[times].is_null(), "no bus was crossed");
            } else {
                assert_eq!(keys(&report[times]), "max p50 p90 p99 p999");
            }
        }
        assert_eq!((&report["law"], &report["clock"]), (&"mtj".into(), &"lockstep".into()));
        assert_eq!((&report["samples"], &report["duration_s"]), (&20.into(), &0.2.into()));
    }
}
