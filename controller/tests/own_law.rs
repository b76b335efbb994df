//! A controller with a law that the program brings.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use mtj_controller::{Controller, LawError};
use mtj_model::{
    law::{Law, find},
    lift::Lift,
    scenario::Scenario,
};
use mtj_protocol::sample::StateSample;

/// States of an arm on its way, one a sample period.
fn states() -> impl Iterator<Item = StateSample> {
    (0..20).map(|k| {
        let mut state = StateSample::default();
        let header = &mut state.header;
        (header.joints, header.axes, header.sequence) = (2, 2, k);
        header.time_ns = k * 10_000_000;
        let t = k as f64 * 0.01;
        state.position[..2].copy_from_slice(&[0.3 + t, 1.2 - 0.5 * t]);
        state.velocity[..2].copy_from_slice(&[1.0, -0.5]);
        state
    })
}

#[test]
fn a_built_in_law_brought_by_hand_answers_as_the_scenarios_own() {
    let scenario = Scenario::load("sampled/mtj", &[]).unwrap();
    let Law::Mtj(law) = scenario.law.law else { panic!("not mtj") };
    let description = find("mtj").unwrap();
    let mut by_hand =
        Controller::with_law::<_, 2>(&scenario, description, law.lift::<f64, 2>()).unwrap();
    let mut named = Controller::new(&scenario);
    for state in states() {
        assert_eq!(by_hand.respond(&state), named.respond(&state));
        assert_eq!(by_hand.error(), named.error());
    }
}

#[test]
fn a_law_brought_by_hand_stays_when_the_scenario_changes() {
    let scenario = Scenario::load("sampled/mtj", &[]).unwrap();
    let Law::Mtj(law) = scenario.law.law else { panic!("not mtj") };
    let law = law.tj.lift::<f64, 2>();
    let mut by_hand = Controller::with_law::<_, 2>(&scenario, find("tj").unwrap(), law).unwrap();
    let before: Vec<_> = states().map(|state| *by_hand.respond(&state).unwrap()).collect();
    by_hand.reconfigure(&scenario.changed(&["law.kp=500".parse().unwrap()]).unwrap());
    let after: Vec<_> = states().map(|state| *by_hand.respond(&state).unwrap()).collect();
    assert_eq!(before, after);
}

#[test]
fn a_law_for_another_number_of_axes_is_refused() {
    let scenario = Scenario::load("sampled/tj", &[]).unwrap();
    let Law::Tj(law) = scenario.law.law else { panic!("not tj") };
    let refused =
        Controller::with_law::<_, 1>(&scenario, find("tj").unwrap(), law.lift::<f64, 1>());
    assert_eq!(refused.err(), Some(LawError::Axes { law: "tj", expected: 1, found: 2 }));
}
