//! Laws on an arm with friction that none of them knows, beside figures of an independent program.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use mtj_model::scenario::{Override, Scenario};
use mtj_study::sweep::lanes;

/// Latencies, ms.
const LATENCIES: [u64; 7] = [0, 5, 10, 20, 30, 40, 60];
/// 2 N m of Coulomb friction and 2 N m s/rad of viscous friction in both joints; laws, and their rms
/// errors in mm at those latencies.
const PUBLISHED: [(&str, &[f64]); 7] = [
    (r#"{kind="mb", kp=8, kd=4}"#, &[131.0, 131.0, 131.0, 131.0, 131.0, 132.0, 134.0]),
    (
        r#"{kind="mb", kp=8, kd=4, prediction={horizon="measured", model="rigid-body"}}"#,
        &[131.0, 133.0, 135.0, 139.0, 144.0, 148.0, 157.0],
    ),
    (r#"{kind="adaptive", kp=4, kd=40, adaptation=20}"#, &[24.2, 24.0, 23.7, 23.4]),
    (
        r#"{kind="mtj", kp=30, kd=60, memory={policy="delivered"}, prediction={horizon="measured"}}"#,
        &[1.65, 2.25, 2.91, 4.15],
    ),
    (
        r#"{kind="mtj", kp=30, kd=60, acceleration=true, factor={kind="constant"}, memory={policy="delivered"}}"#,
        &[1.33, 2.13, 2.87, 4.51],
    ),
    (
        r#"{kind="tdc", kp=20, kd=20, mass=1.5, memory={policy="delivered"}}"#,
        &[2.49, 4.04, 5.57, 8.94, 12.6, 16.8, 27.2],
    ),
    (
        r#"{kind="tdc", kp=20, kd=20, mass="task-inertia", memory={policy="delivered"}}"#,
        &[1.80, 2.84, 3.83, 5.95, 8.2, 10.5, 15.6],
    ),
];

#[test]
fn laws_with_a_memory_follow_an_arm_with_friction_and_computed_torque_does_not() {
    let mut scenarios = Vec::new();
    let mut expected = Vec::new();
    for (law, errors) in PUBLISHED {
        for (latency, error) in LATENCIES.iter().zip(errors) {
            let sets = [
                "timing.clock=lockstep".to_owned(),
                "timing.integration_step=auto".to_owned(),
                "arm.friction={coulomb=2.0, viscous=2.0}".to_owned(),
                format!("link.torque.latency={latency}ms"),
                format!("law={law}"),
            ];
            let sets: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
            scenarios.push(Scenario::load("sampled/mtj", &sets).unwrap());
            expected.push((law, latency, error * 1e-3));
        }
    }
    let mut compared = 0;
    lanes::measure(&scenarios, &|| true, &mut |number, measured| {
        let (law, latency, expected) = expected[number];
        let found = measured.unwrap().rms_error_m.unwrap();
        // Printed with two or three digits.
        assert!(
            (found / expected - 1.0).abs() < 0.01,
            "{found} m, published {expected} m: {law} at {latency} ms"
        );
        compared += 1;
    });
    assert_eq!(compared, scenarios.len());
}
