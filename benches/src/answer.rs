//! The whole answer to a state: measured joints in, torque out.

#![allow(clippy::expect_used, reason = "a benchmark that cannot go on has nothing to measure")]

use std::{f64::consts::TAU, hint::black_box};

use mtj_controller::Controller;
use mtj_model::scenario::{Override, Scenario, built_in};
use mtj_protocol::sample::{Header, StateSample, VERSION, padded};

use crate::{law::Law, meter::Meter};

/// Of the task, which is the plane.
pub const AXES: usize = 2;

/// A power of two, so that it costs nothing to start again.
const STATES: usize = 64;

/// One call of [`Controller::respond`] and one of [`Controller::preprocess`] a step, over and over
/// the same stretch of a motion.
pub fn measure(links: usize, law: Law, memory: &str, prediction: bool, meter: &mut impl Meter) {
    let mut controller = Controller::new(&scenario(links, law, memory, prediction));
    let states: [StateSample; STATES] = std::array::from_fn(|k| state(links, k));
    // The first answer is plain tj, whatever the law.
    controller.respond(&states[0]).expect("an answer");
    let mut next = 0;
    meter.measure(|| {
        let state = black_box(&states[next % STATES]);
        let answer = controller.respond(state);
        black_box(&answer).as_ref().expect("an answer");
        controller.preprocess(state);
        next += 1;
    });
}

/// The task of Fig. 4 for an arm of some links that is two metres long. The thresholds are so large
/// that all of mtj's arithmetic is done for every state.
fn scenario(links: usize, law: Law, memory: &str, prediction: bool) -> Scenario {
    let length = 2.0 / links as f64;
    let link = format!(
        "{{ length = {length:?}, mass = {:?}, center = {:?}, inertia = {:?} }}",
        7.0 / links as f64,
        0.5 * length,
        0.3 * length * length
    );
    let (position, velocity) = joints(links, 0);
    let (kind, factor) = match law {
        Law::Tj => ("tj", "exponential"),
        Law::MtjSwitch => ("mtj", "switch"),
        Law::MtjExponential => ("mtj", "exponential"),
        Law::MtjDiagonal => ("mtj", "diagonal"),
        Law::Mb => ("mb", "exponential"),
        Law::Tdc => ("tdc", "constant"),
    };
    let mut sets = vec![
        format!("arm.links=[{}]", vec![link; links].join(", ")),
        format!("arm.position={position:?}"),
        format!("arm.velocity={velocity:?}"),
        format!("law.kind={kind}"),
        "law.mass=2.0".to_owned(),
        format!("law.factor.kind={factor}"),
        "law.factor.error=10.0".to_owned(),
        "law.factor.error_rate=100.0".to_owned(),
        format!("law.memory.policy={memory}"),
    ];
    if prediction {
        sets.push("law.prediction.horizon=measured".to_owned());
    }
    let sets: Vec<Override> = sets.iter().map(|set| set.parse().expect("key=value")).collect();
    let name = "sampled/mtj";
    Scenario::parse(name, built_in(name).expect("a built-in scenario"), &sets).expect("a scenario")
}

/// q and q̇ of an arm that is bent and swings; the stretch ends where it begins.
fn joints(links: usize, k: usize) -> (Vec<f64>, Vec<f64>) {
    let phase = |i: usize| TAU * k as f64 / STATES as f64 + 0.5 * i as f64;
    let bend = 1.5 / links as f64;
    (0..links).map(|i| (bend + 0.2 * phase(i).sin(), 0.4 * phase(i).cos())).unzip()
}

fn state(links: usize, k: usize) -> StateSample {
    let (position, velocity) = joints(links, k);
    let header = Header {
        version: VERSION,
        joints: links as u32,
        axes: AXES as u32,
        run: 1,
        sequence: k as u64,
        time_ns: k as u64 * 10_000_000,
        ..Header::default()
    };
    StateSample {
        header,
        latency_ns: 1_000_000,
        position: padded(&position),
        velocity: padded(&velocity),
        applied: padded(&[3.0, -2.0]),
        delivered: padded(&[2.5, -1.5]),
        ..StateSample::default()
    }
}
