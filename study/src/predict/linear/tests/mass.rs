//! Eq. (11) as time-delay control, eq. (16) as its limit, prediction as a mass, and what mass an
//! outer loop needs.

use super::*;

#[test]
fn eq_11_is_time_delay_control_whose_gains_are_divided_by_the_mass() {
    let Memory { kp, kd, .. } = PAPER;
    for mass in [0.3, 1.0, 2.5] {
        for policy in POLICIES {
            for latency in LATENCIES {
                let eq_11 = held(mtj(Memory { k: 1.0, ..PAPER }, Some(mass)), 2.0, policy, latency);
                let tdc = LinearLoop { law: tdc(kp / mass, kd / mass, mass), ..eq_11 };
                let apart = difference(&eq_11, &tdc);
                assert!(apart < 1e-11, "{mass} kg, {policy:?}, {latency} s: {apart}");
            }
        }
    }
}

#[test]
fn eq_16_is_its_limit_for_no_mass() {
    let Memory { kp, kd, .. } = PAPER;
    for policy in POLICIES {
        for latency in LATENCIES {
            let eq_16 = held(mtj(Memory { k: 1.0, ..PAPER }, None), 2.0, policy, latency);
            for mass in [1e-2, 1e-4, 1e-6] {
                let tdc = LinearLoop { law: tdc(kp / mass, kd / mass, mass), ..eq_16 };
                // They differ by the force M̄ a = M̄ (v_k − v_{k−1})/T_s alone.
                let (apart, expected) = (difference(&eq_16, &tdc), mass / PERIOD);
                assert!((apart / expected - 1.0).abs() < 1e-4, "{apart} for {expected}");
            }
        }
    }
}

#[test]
fn prediction_is_a_mass_and_a_little_more_damping() {
    let Memory { kp, kd, .. } = PAPER;
    for policy in POLICIES {
        for latency in LATENCIES {
            let eq_16 = held(mtj(PAPER, None), 2.0, policy, latency);
            let aiming = LinearLoop { predicts: true, ..eq_16 };
            let mass = kd * latency + 0.5 * kp * latency * latency;
            let law = mtj(Memory { kd: kd + kp * latency, ..PAPER }, Some(mass));
            let apart = difference(&aiming, &LinearLoop { law, ..eq_16 });
            assert!(apart < 1e-10, "{policy:?}, {latency} s: {apart}");
        }
    }
}

#[test]
fn delivered_with_the_right_mass_is_computed_torque_with_a_perfect_model_at_any_latency() {
    for mass in MASSES {
        for latency in LATENCIES.into_iter().chain([0.1, 0.2345]) {
            for (kp, kd) in [(8.0, 4.0), (20.0, 20.0)] {
                let tdc = held(tdc(kp, kd, mass), mass, MemoryPolicy::Delivered, latency);
                let mb = LinearLoop { law: mb(kp, kd), ..tdc };
                // Two polynomials with as many coefficients as this have values at a circle of
                // points.
                let count = tdc.size() + 1;
                for i in 0..count {
                    let angle = std::f64::consts::TAU * i as f64 / count as f64;
                    let z = Complex::from_polar(1.5, angle);
                    let (one, other) = (characteristic(&tdc, z), characteristic(&mb, z));
                    let apart = (one / other - 1.0).norm();
                    assert!(apart < 1e-9, "{mass} kg, {latency} s, {z}: {one} and {other}");
                }
            }
        }
    }
}

#[test]
fn with_another_memory_or_another_mass_it_is_not() {
    let z = Complex::from_polar(1.5, 0.3);
    let right = held(tdc(8.0, 4.0, 2.0), 2.0, MemoryPolicy::Delivered, 0.015);
    let mb = characteristic(&LinearLoop { law: mb(8.0, 4.0), ..right }, z);
    let sent = LinearLoop { memory: MemoryPolicy::Sent, ..right };
    let light = LinearLoop { law: tdc(8.0, 4.0, 1.9), ..right };
    for wrong in [sent, light] {
        assert!((characteristic(&wrong, z) / mb - 1.0).norm() > 1e-3, "{wrong:?}");
    }
}

#[test]
fn a_mass_must_exceed_the_lag_of_the_load_estimate_over_the_error_time_constant() {
    // (T_s + d) K_p/K_d < M̄/m, as long as the lag T_s + d is short against 1/K_d as well.
    for (kp, kd) in [(8.0, 4.0), (20.0, 10.0), (20.0, 20.0)] {
        for period in [0.002, 0.005, 0.01] {
            for latency in [0.0, 0.002, 0.005] {
                let least = critical(1e-6, 0.9, |part| {
                    let held = held::<1>(tdc(kp, kd, part), 1.0, MemoryPolicy::Delivered, latency);
                    LinearLoop { period, ..held }.spectral_radius() < 1.0
                });
                let stated = (period + latency) * kp / kd;
                let within = (0.95..1.05).contains(&(stated / least));
                assert!(within, "{kp} {kd} {period} {latency}: {stated} for {least}");
            }
        }
    }
}

#[test]
fn damping_raises_the_least_mass_at_long_latencies() {
    // K_d (T_s + d) = 0.3: the least mass is a quarter more than stated.
    let least = critical(1e-6, 0.9, |part| {
        held::<1>(tdc(20.0, 20.0, part), 1.0, MemoryPolicy::Delivered, 0.02).spectral_radius() < 1.0
    });
    let ratio = least / (0.03 * 20.0 / 20.0);
    assert!((ratio - 1.242).abs() < 0.002, "{ratio}");
}
