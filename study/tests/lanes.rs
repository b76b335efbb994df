//! A sweep's lanes against the scalar path.

#![allow(clippy::unwrap_used, clippy::expect_used)] // A test that cannot go on should say so.

use mtj_model::{
    lanes::Width,
    scenario::{Override, Scenario},
};
use mtj_plant::report::Report;
use mtj_study::{
    experiment,
    sweep::{lanes, plan::Plan, results::Measured},
};

/// Everything in which lanes may differ, and everything by which they are put together.
const MIXED: &str = r#"
scenario = "sampled/mtj"

[set]
"timing.clock" = "lockstep"
"bus.kind" = "local"
"duration" = "3 s"

[[axes]]
name = "law"
variants = [
    { name = "tj", set = { "law.kind" = "tj", "law.kp" = 60, "law.kd" = 100 } },
    { name = "mtj sent", set = { "law.memory.policy" = "sent", "law.memory.step" = "20 ms" } },
    { name = "mtj applied", set = { "law.memory.policy" = "applied", "law.factor.ceiling" = 0.9 } },
    { name = "mtj delivered", set = { "law.memory.policy" = "delivered", "law.memory.step" = "40 ms", "law.factor.kind" = "diagonal", "law.factor.error" = [0.5, 1.0] } },
    { name = "mtj ahead", set = { "law.memory.policy" = "delivered", "law.prediction.horizon" = "measured" } },
    { name = "mtj switch", set = { "law.factor.kind" = "switch", "law.factor.error" = 0.05, "law.factor.error_rate" = 0.5 } },
    { name = "mtj acceleration", set = { "law.acceleration" = true, "law.kp" = [30, 40], "law.kd" = [[60, 5], [5, 50]] } },
    { name = "mb", set = { "law.kind" = "mb", "law.kp" = 8, "law.kd" = 4, "law.model.mass_scale" = 1.1 } },
    { name = "mtj mass", set = { "law.acceleration" = true, "law.mass" = [0.5, 0.8], "law.memory.policy" = "delivered", "law.factor.ceiling" = 0.9 } },
    { name = "mtj full mass", set = { "law.acceleration" = true, "law.mass" = [[0.8, 0.1], [0.1, 0.5]], "law.memory.policy" = "delivered", "law.factor.ceiling" = 0.9 } },
    { name = "mtj task inertia", set = { "law.acceleration" = true, "law.mass" = "task-inertia", "law.memory.policy" = "delivered", "law.factor.ceiling" = 0.9, "law.model.mass_scale" = 0.3 } },
    { name = "mtj axes", set = { "law.factor.error" = [0.5, 1.0], "law.factor.error_rate" = [5, 8] } },
    { name = "mtj switch axes", set = { "law.factor.kind" = "switch", "law.factor.error" = [0.05, 0.1], "law.factor.error_rate" = [0.5, 0.8] } },
    { name = "mtj constant", set = { "law.factor.kind" = "constant", "law.factor.ceiling" = 0.9, "law.memory.policy" = "delivered" } },
    { name = "tdc", set = { "law.kind" = "tdc", "law.kp" = 8, "law.kd" = 4, "law.mass" = 1.5, "law.factor.kind" = "constant", "law.memory.policy" = "delivered" } },
    { name = "tdc list", set = { "law.kind" = "tdc", "law.kp" = 8, "law.kd" = 4, "law.mass" = [1.0, 1.5], "law.factor.kind" = "constant", "law.factor.ceiling" = 0.9, "law.memory.policy" = "applied" } },
    { name = "tdc full", set = { "law.kind" = "tdc", "law.kp" = [8, 9], "law.kd" = 4, "law.mass" = [[1.5, 0.2], [0.2, 1.0]], "law.memory.policy" = "delivered" } },
    { name = "tdc task inertia", set = { "law.kind" = "tdc", "law.kp" = 8, "law.kd" = 4, "law.mass" = "task-inertia", "law.factor.kind" = "constant", "law.memory.policy" = "delivered" } },
    { name = "mb ahead", set = { "law.kind" = "mb", "law.kp" = 8, "law.kd" = 4, "law.prediction.horizon" = "3 ms" } },
    { name = "mb by model", set = { "law.kind" = "mb", "law.kp" = 8, "law.kd" = 4, "law.prediction.horizon" = "measured", "law.prediction.model" = "rigid-body", "law.model.mass_scale" = 0.95 } },
    { name = "tj by model", set = { "law.kind" = "tj", "law.kp" = 30, "law.kd" = 40, "law.prediction.horizon" = "2 ms", "law.prediction.model" = "rigid-body" } },
    { name = "dob", set = { "law.kind" = "dob", "law.kp" = 8, "law.kd" = 4, "law.mass" = [1.0, 1.5], "law.filter" = "30 ms", "law.memory.policy" = "delivered" } },
    { name = "impedance", set = { "law.kind" = "impedance", "law.kp" = 60, "law.kd" = [100, 90] } },
    { name = "impedance shaped", set = { "law.kind" = "impedance", "law.kp" = 16, "law.kd" = 8, "law.inertia" = [[2.0, 0.3], [0.3, 1.5]] } },
    { name = "scct", set = { "law.kind" = "scct", "law.kp" = 8, "law.kd" = 4, "law.inertia" = [5.0, 1.5] } },
    { name = "pid", set = { "law.kind" = "pid", "law.kp" = [100, 80], "law.kd" = 40, "law.ki" = 90 } },
    { name = "rate", set = { "law.kind" = "rate", "law.kp" = 4, "law.kd" = 40, "law.ki" = [5, 6] } },
    { name = "adaptive", set = { "law.kind" = "adaptive", "law.kp" = 4, "law.kd" = 40, "law.adaptation" = 20 } },
    { name = "adaptive model", set = { "law.kind" = "adaptive", "law.kp" = 4, "law.kd" = [40, 30], "law.adaptation" = 5, "law.initial" = "model", "law.model.mass_scale" = 0.8 } },
]

[[axes]]
name = "link"
variants = [
    { name = "none", set = {} },
    { name = "state", set = { "link.state.latency" = "1 ms", "link.torque.latency" = "0.3 ms" } },
    { name = "a period", set = { "link.torque.latency" = "10 ms" } },
    { name = "jitter", set = { "link.state.latency" = "2 ms", "link.state.jitter.kind" = "gamma", "link.state.jitter.deviation" = "4 ms", "link.torque.latency" = "1 ms", "link.torque.jitter.kind" = "uniform", "link.torque.jitter.spread" = "1 ms" } },
    { name = "dropout", set = { "link.state.dropout" = 0.02, "link.torque.dropout.enter" = 0.01, "link.torque.dropout.leave" = 0.25 } },
]

[[axes]]
name = "loop"
variants = [
    { name = "plain", set = {} },
    { name = "noise", set = { "sensor.noise" = 0.005, "seed" = 7 } },
    { name = "slow", set = { "timing.sample_period" = "20 ms", "arm.links[1].mass" = 3.5 } },
    { name = "fast", set = { "timing.sample_period" = "4 ms", "arm.gravity" = [0.0, -9.81] } },
    { name = "limited", set = { "safety.torque_limit" = [14, 7], "trajectory.radius" = 1.3 } },
    { name = "carried", set = { "arm.gravity" = [0.0, -9.81], "law.gravity" = "model", "safety.torque_limit" = [80, 40] } },
    { name = "soft", set = { "safety.torque_rate_limit" = [400, 200] } },
    { name = "rubbing", set = { "arm.friction" = { coulomb = [2.0, 1.0], viscous = 1.5, stribeck = 0.5, smoothing = 0.5, stribeck_speed = 1.0 } } },
    { name = "geared", set = { "arm.armature" = [0.5, 0.2], "arm.friction.viscous" = 0.7 } },
    { name = "encoded", set = { "encoder.velocity" = "differentiated", "encoder.filter" = "5 ms" } },
    { name = "loaded", set = { "load" = [{ at = "0 s", mass = 0.5 }, { at = "1.0031 s", mass = 2.0 }, { at = "2 s", mass = 0.0 }] } },
    { name = "points", set = { "trajectory.kind" = "file" } },
    { name = "line", set = { "trajectory.kind" = "point-to-point" } },
]
"#;

/// What a scenario of another trajectory must not say.
fn mixed(step: &str) -> Vec<Scenario> {
    let text = MIXED.replace(
        r#""trajectory.kind" = "point-to-point""#,
        r#""trajectory" = { kind = "point-to-point", from = [0.9, 1.0], to = [0.3, 1.3], duration = "2 s" }"#,
    );
    let text = text.replace(
        r#""trajectory.kind" = "file""#,
        r#""trajectory" = { kind = "file", points = [[0, 0.9, 1.0], [1, 0.3, 1.3], [2.5, 0.8, 1.1]] }"#,
    );
    let plan = Plan::parse("mixed", &text, &[set("timing.integration_step", step)]).unwrap();
    // A memory step is not a multiple of every sample period; such points have no scenario.
    (0..plan.len()).filter_map(|point| plan.scenario(point).ok()).collect()
}

fn set(key: &str, value: &str) -> Override {
    Override::text(key, value)
}

fn in_lanes(scenarios: &[Scenario]) -> Vec<Result<Report, String>> {
    in_width(Width::widest(), scenarios)
}

fn in_width(width: Width, scenarios: &[Scenario]) -> Vec<Result<Report, String>> {
    let mut results = vec![None; scenarios.len()];
    lanes::measure_in(width, scenarios, &|| true, &mut |number, measured| {
        assert!(results[number].replace(words(measured)).is_none(), "{number} was handed in twice");
    });
    results.into_iter().map(Option::unwrap).collect()
}

/// Errors by what they say.
fn words(measured: Measured) -> Result<Report, String> {
    measured.map_err(|error| error.to_string())
}

fn reference(scenario: &Scenario) -> Result<Report, String> {
    words(lanes::reference(scenario, &|| true).unwrap())
}

fn is_close(ours: Option<f64>, theirs: Option<f64>, tolerance: f64) -> bool {
    match (ours, theirs) {
        (Some(ours), Some(theirs)) => (ours - theirs).abs() <= tolerance,
        (ours, theirs) => ours.is_none() && theirs.is_none(),
    }
}

#[test]
fn every_lane_agrees_with_the_scalar_reference() {
    let scenarios = mixed("auto");
    assert!(scenarios.len() > 200, "{}", scenarios.len());
    assert!(scenarios.iter().all(|scenario| lanes::shape(scenario).is_some()));
    let (usual, fine) = (mixed("1 ms"), mixed("0.1 ms"));
    let (mut compared, mut unsettled, mut diverged) = (0, 0, 0);
    for (i, ours) in in_lanes(&scenarios).into_iter().enumerate() {
        let overrides = scenarios[i].text();
        let (ours, theirs) = match (ours, reference(&fine[i])) {
            (Ok(ours), Ok(theirs)) => (ours, theirs),
            (ours, theirs) => {
                assert_eq!(ours.err(), theirs.err(), "{overrides}");
                continue;
            }
        };
        let usual = reference(&usual[i]).unwrap();
        // A run that a thousandth of a millimetre's change drives elsewhere has no exact result:
        // what a reference of usual steps has in common with one of fine steps is what can be asked
        // for.
        let is_settled = !theirs.diverged && is_close(usual.rms_error_m, theirs.rms_error_m, 1e-10);
        if !is_settled {
            unsettled += 1;
            assert_eq!(ours.diverged, theirs.diverged, "{overrides}");
            diverged += u32::from(ours.diverged);
            continue;
        }
        compared += 1;
        assert_eq!(ours.diverged, theirs.diverged, "{overrides}");
        assert_eq!((ours.samples, ours.commands), (theirs.samples, theirs.commands), "{overrides}");
        assert_eq!(ours.duration_s, theirs.duration_s);
        let work = f64::max(1e-4, 1e-6 * theirs.energy_j.unwrap_or(0.0));
        for (name, ours, theirs, tolerance) in [
            ("rms error", ours.rms_error_m, theirs.rms_error_m, 1e-9),
            ("peak error", ours.peak_error_m, theirs.peak_error_m, 1e-8),
            ("energy", ours.energy_j, theirs.energy_j, work),
            ("torque step", ours.torque_step_rms_nm, theirs.torque_step_rms_nm, 1e-5),
            ("torque", Some(ours.peak_torque_nm[0]), Some(theirs.peak_torque_nm[0]), 1e-5),
            ("torque", Some(ours.peak_torque_nm[1]), Some(theirs.peak_torque_nm[1]), 1e-5),
        ] {
            assert!(
                is_close(ours, theirs, tolerance),
                "{name}: {ours:?}, reference {theirs:?}\n{overrides}"
            );
        }
    }
    println!("{compared} compared, {unsettled} that no step settles, of which {diverged} diverged");
    assert!(compared > 200 && unsettled * 10 < compared, "{compared} and {unsettled}");
}

#[test]
fn torques_on_their_way_to_a_command_agree_with_a_reference_of_fine_steps() {
    let laws = [
        "law={kind='tj', kp=60, kd=100}",
        "law={kind='mtj', kp=30, kd=60, acceleration=true, memory={policy='delivered'}}",
        "law={kind='tdc', kp=20, kd=20, mass=1.5, memory={policy='delivered'}}",
        "law={kind='mb', kp=8, kd=4}",
    ];
    let actuators = ["actuator.time_constant=3ms", "actuator.torque_rate_limit=[400.0, 200.0]"];
    let load = |law: &str, actuator: &str, step: &str| {
        let step = format!("timing.integration_step={step}");
        let sets = ["timing.clock=lockstep", "duration=3s", "link.torque.latency=2ms", &step];
        let sets: Vec<Override> =
            sets.iter().chain(&[law, actuator]).map(|set| set.parse().unwrap()).collect();
        Scenario::load("sampled/mtj", &sets).unwrap()
    };
    for actuator in actuators {
        let scenarios = laws.map(|law| load(law, actuator, "auto"));
        assert!(scenarios.iter().all(|scenario| lanes::shape(scenario).is_some()));
        for (law, ours) in laws.iter().zip(in_lanes(&scenarios)) {
            let (ours, theirs) = (ours.unwrap(), reference(&load(law, actuator, "10us")).unwrap());
            let near = |ours: Option<f64>, theirs: Option<f64>, tolerance: f64| {
                assert!(
                    is_close(ours, theirs, tolerance),
                    "{law}, {actuator}: {ours:?} and {theirs:?}"
                );
            };
            near(ours.rms_error_m, theirs.rms_error_m, 1e-7);
            near(ours.torque_step_rms_nm, theirs.torque_step_rms_nm, 1e-4);
            near(ours.energy_j, theirs.energy_j, 1e-2);
        }
    }
}

#[test]
fn a_result_depends_neither_on_its_lane_nor_on_its_neighbours_nor_on_the_width_of_the_vectors() {
    let scenarios = mixed("auto");
    let expected = in_lanes(&scenarios);
    let mut backwards = scenarios.clone();
    backwards.reverse();
    let mut results = in_lanes(&backwards);
    results.reverse();
    assert!(results == expected, "backwards");
    for i in (0..scenarios.len()).step_by(23) {
        assert_eq!(in_lanes(&scenarios[i..=i])[0], expected[i], "alone");
    }
    for width in Width::all() {
        assert!(in_width(width, &scenarios) == expected, "{width:?}");
    }
}

#[test]
fn runs_with_other_masses_and_thresholds_lie_side_by_side() {
    let each = |law: &dyn Fn(f64) -> Vec<Override>, step: &str| -> Vec<Scenario> {
        let fixed = [
            ("timing.clock", "lockstep"),
            ("duration", "3 s"),
            ("timing.integration_step", step),
            ("law.memory.policy", "delivered"),
            ("law.factor.kind", "constant"),
        ];
        let sets = |i| {
            let mut sets = fixed.map(|(key, value)| set(key, value)).to_vec();
            sets.extend(law(1.0 + 0.05 * f64::from(i)));
            sets
        };
        (0..11).map(|i| Scenario::load("sampled/mtj", &sets(i)).unwrap()).collect()
    };
    let list = |x: f64, y: f64| -> toml::Value { vec![x, y].into() };
    let tdc = |mass: toml::Value| {
        let gains = [("law.kp", 8.0), ("law.kd", 4.0)];
        let gains = gains.map(|(key, gain)| Override::value(key, gain.into()));
        let mut sets = vec![set("law.kind", "tdc"), Override::value("law.mass", mass)];
        sets.extend(gains);
        sets
    };
    let of_mass: [&dyn Fn(f64) -> Vec<Override>; 4] = [
        &|x| tdc(x.into()),
        &|x| tdc(list(x, 2.5 - x)),
        &|x| tdc(vec![list(x, 0.2 * x), list(-0.1, 1.0)].into()),
        &|x| {
            let thresholds = Override::value("law.factor.error", list(x, 0.5 * x));
            vec![set("law.factor.kind", "exponential"), thresholds]
        },
    ];
    for law in of_mass {
        let (scenarios, fine) = (each(law, "auto"), each(law, "0.1 ms"));
        let shape = lanes::shape(&scenarios[0]);
        assert!(scenarios.iter().all(|scenario| lanes::shape(scenario) == shape));
        let ours = in_lanes(&scenarios);
        let mut errors = Vec::new();
        for (i, ours) in ours.iter().enumerate() {
            assert_eq!(*ours, in_lanes(&scenarios[i..=i])[0], "alone");
            let (ours, theirs) = (ours.as_ref().unwrap(), reference(&fine[i]).unwrap());
            assert!(is_close(ours.rms_error_m, theirs.rms_error_m, 1e-9), "{ours:?}, {theirs:?}");
            assert!(is_close(ours.energy_j, theirs.energy_j, 1e-4), "{ours:?}, {theirs:?}");
            errors.push(ours.rms_error_m.unwrap());
        }
        assert!(errors.windows(2).all(|pair| pair[0] != pair[1]), "each has its own: {errors:?}");
    }
}

#[test]
fn a_tolerance_is_kept() {
    let scenario = |more: &[Override]| {
        let mut sets = vec![
            set("timing.clock", "lockstep"),
            set("timing.sample_period", "40ms"),
            set("law.kind", "tj"),
            set("duration", "5 s"),
        ];
        sets.extend_from_slice(more);
        Scenario::load("sampled/mtj", &sets).unwrap()
    };
    let gains = [("30", "20"), ("15", "12")];
    for (kp, kd) in gains.map(|(kp, kd)| (kp.parse::<f64>().unwrap(), kd.parse::<f64>().unwrap())) {
        let gains = [Override::value("law.kp", kp.into()), Override::value("law.kd", kd.into())];
        let fine = [set("timing.integration_step", "0.1 ms")];
        let exact = reference(&scenario(&[&gains[..], &fine].concat())).unwrap();
        let error = |tolerance: f64| {
            let auto = set("timing.integration_step", "auto");
            let tolerance = Override::value("timing.tolerance", tolerance.into());
            let ours = in_lanes(&[scenario(&[&gains[..], &[auto, tolerance]].concat())]);
            let ours = ours[0].as_ref().unwrap().rms_error_m.unwrap();
            (ours - exact.rms_error_m.unwrap()).abs()
        };
        let errors = [1e-3, 1e-5, 1e-7, 1e-9].map(|tolerance| (tolerance, error(tolerance)));
        println!("kp {kp}, kd {kd}: tolerance and error {errors:?}");
        assert!(errors.iter().all(|(tolerance, error)| error < tolerance), "{errors:?}");
    }
}

#[test]
fn an_arm_that_stretches_itself_is_no_less_accurate_than_alone() {
    // Without torque to speak of, the second arm has stretched itself by the second sample.
    let begun_at = |position: &str| {
        let sets = [
            "timing.clock=lockstep",
            "timing.integration_step=auto",
            "timing.sample_period=1s",
            "duration=3s",
            "safety.torque_limit=[1e-12, 1e-12]",
            "arm.velocity=[0.0, -1e-5]",
            &format!("arm.position={position}"),
        ];
        Scenario::load("sampled/mb", &sets.map(|set| set.parse().unwrap())).unwrap()
    };
    let scenarios = ["[0.03, 1.5]", "[0.3, 1e-5]", "[0.03, 1.6]"].map(begun_at);
    let together = in_lanes(&scenarios);
    for (one, scenario) in together.iter().zip(&scenarios) {
        assert_eq!(*one, in_lanes(std::slice::from_ref(scenario))[0]);
        assert!(one.as_ref().is_ok_and(|report| !report.diverged), "{one:?}");
    }
}

#[test]
fn runs_that_lanes_cannot_do_take_the_scalar_path_bit_for_bit() {
    for more in [
        [set("timing.integration_step", "5 ms"), set("duration", "1 s")],
        [set("safety.command_timeout", "50 ms"), set("safety.on_timeout", "damp")],
    ] {
        let mut sets =
            vec![set("timing.clock", "lockstep"), set("timing.integration_step", "auto")];
        sets.extend(more);
        let scenario = Scenario::load("sampled/mtj", &sets).unwrap();
        assert_eq!(lanes::shape(&scenario), None);
        let expected = experiment::run_direct(&scenario, false, &|| true).unwrap().report;
        assert_eq!(in_lanes(std::slice::from_ref(&scenario))[0], Ok(expected));
    }
}
