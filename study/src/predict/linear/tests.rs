use mtj_model::{
    gains::Gains,
    law::{factor::Factor, mass::Mass, mtj::ModifiedTransposeJacobian, tj::TransposeJacobian},
};

use super::*;

/// mtj's gains, N/m and N s/m, and k.
#[derive(Clone, Copy, Debug)]
pub struct Memory {
    kp: f64,
    kd: f64,
    k: f64,
}

const PAPER: Memory = Memory { kp: 30.0, kd: 60.0, k: 0.99 };

/// mtj with a constant k, and with the term M̄ ë of eq. (11) if a mass is given.
fn mtj(Memory { kp, kd, k }: Memory, mass: Option<f64>) -> Law<f64, 1> {
    let gain = |gain| Gains::Diagonal(SVector::repeat(gain));
    Law::Mtj(ModifiedTransposeJacobian {
        tj: TransposeJacobian { kp: gain(kp), kd: gain(kd) },
        factor: Factor::constant(k),
        acceleration: mass.map(|mass| Mass::Constant(gain(mass))),
    })
}

/// A loop at T_s = 10 ms without prediction.
fn held(law: Law<f64, 1>, mass: f64, memory: MemoryPolicy, latency: f64) -> LinearLoop<1> {
    LinearLoop { law, mass, model_mass: mass, period: 0.01, latency, memory, predicts: false }
}

/// k at which a loop is just stable, less than one by this much.
fn critical_leak(of: Memory, held: &LinearLoop<1>) -> f64 {
    let is_stable = |leak: f64| {
        let law = mtj(Memory { k: 1.0 - leak, ..of }, None);
        LinearLoop { law, ..*held }.spectral_radius() < 1.0
    };
    1.0 - close_in(0.0, 1.0, |k| is_stable(1.0 - k))
}

/// How far below one k must stay for a loop with a memory to be stable, to second order in the phases
/// at crossover, for latencies of less than a period (derived in `docs/latency.md`):
///
/// ```text
/// sent, applied   1 − k > K_p T_s/K_d + K_d d/m
/// delivered       1 − k > K_p (T_s + d)/K_d + K_d d²/(m (T_s + d))
/// ```
fn least_leak(Memory { kp, kd, .. }: Memory, held: &LinearLoop<1>) -> f64 {
    let LinearLoop { mass, period, latency, .. } = *held;
    match held.memory {
        MemoryPolicy::Sent | MemoryPolicy::Applied => kp * period / kd + kd * latency / mass,
        MemoryPolicy::Delivered => {
            let lag = period + latency;
            kp * lag / kd + kd * latency * latency / (mass * lag)
        }
    }
}

#[test]
fn the_closed_forms_agree_with_the_matrices() {
    for (mass, period) in [(1.05, 0.01), (2.0, 0.01), (4.4, 0.01), (1.05, 0.002), (2.0, 0.005)] {
        for policy in [MemoryPolicy::Sent, MemoryPolicy::Delivered] {
            for part in [0.0, 0.02, 0.05, 0.1, 0.15] {
                let held =
                    LinearLoop { period, ..held(mtj(PAPER, None), mass, policy, part * period) };
                let (exact, short) = (critical_leak(PAPER, &held), least_leak(PAPER, &held));
                assert!((short / exact - 1.0).abs() < 0.15, "{held:?}: {short} for {exact}");
            }
        }
    }
}

#[test]
fn without_latency_the_condition_on_k_is_exact_and_free_of_the_mass() {
    for mass in [0.9, 2.0, 10.0] {
        let held = held(mtj(PAPER, None), mass, MemoryPolicy::Sent, 0.0);
        let Memory { kp, kd, .. } = PAPER;
        let bound = (2.0 * kd - kp * held.period) / (2.0 * kd + kp * held.period);
        let exact = 1.0 - critical_leak(PAPER, &held);
        assert!((exact - bound).abs() < 1e-6, "{exact} for {bound}");
    }
}

#[test]
fn with_prediction_a_delivered_memory_is_stable_even_at_k_one() {
    let law = mtj(Memory { k: 1.0, ..PAPER }, None);
    for latency in [0.002, 0.005, 0.01, 0.02] {
        let held = held(law, 2.0, MemoryPolicy::Delivered, latency);
        let aimed = LinearLoop { predicts: true, ..held };
        assert!(aimed.spectral_radius() < 1.0, "{latency}: {}", aimed.spectral_radius());
        assert!(held.spectral_radius() > 1.0);
    }
}

#[test]
fn the_held_loop_is_not_asymptotically_stable_at_k_one_even_without_latency() {
    let radius = |latency, k, policy| {
        held(mtj(Memory { k, ..PAPER }, None), 2.0, policy, latency).spectral_radius()
    };
    let is = |radius: f64, expected: f64| (radius - expected).abs() < 5e-5;
    for policy in [MemoryPolicy::Sent, MemoryPolicy::Applied, MemoryPolicy::Delivered] {
        assert!(is(radius(0.0, 1.0, policy), 1.0025), "{}", radius(0.0, 1.0, policy));
        assert!(is(radius(0.0, 0.99, policy), 0.9975));
    }
    assert!(is(radius(0.001, 0.99, MemoryPolicy::Sent), 1.0125));
    assert!(is(radius(0.001, 0.99, MemoryPolicy::Delivered), 0.9993));
}
