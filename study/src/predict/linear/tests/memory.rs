//! The memory of eq. (16): how much leak it needs.

use super::*;

/// k at which a loop is just stable, less than one by this much.
fn critical_leak(of: Memory, mass: Option<f64>, held: &LinearLoop<1>) -> f64 {
    critical(0.0, 1.0, |leak| {
        let law = mtj(Memory { k: 1.0 - leak, ..of }, mass);
        LinearLoop { law, ..*held }.spectral_radius() < 1.0
    })
}

/// How far below one k must stay, if no mass helps, to second order in the phases at crossover, for
/// latencies of less than a period:
///
/// ```text
/// sent, applied   1 − k + M̄/m > K_p T_s/K_d + K_d d/m
/// delivered       1 − k + M̄/m > K_p (T_s + d)/K_d + K_d d²/(m (T_s + d))
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

/// Loops of several masses and periods, with both memories and latencies of a part of a period.
fn short_latencies() -> impl Iterator<Item = LinearLoop<1>> {
    [(1.05, 0.01), (2.0, 0.01), (4.4, 0.01), (1.05, 0.002), (2.0, 0.005)].into_iter().flat_map(
        |(mass, period)| {
            [MemoryPolicy::Sent, MemoryPolicy::Delivered].into_iter().flat_map(move |policy| {
                [0.0, 0.02, 0.05, 0.1, 0.15].map(|part| LinearLoop {
                    period,
                    ..held(mtj(PAPER, None), mass, policy, part * period)
                })
            })
        },
    )
}

#[test]
fn the_closed_forms_agree_with_the_matrices() {
    for held in short_latencies() {
        let (exact, short) = (critical_leak(PAPER, None, &held), least_leak(PAPER, &held));
        assert!((short / exact - 1.0).abs() < 0.15, "{held:?}: {short} for {exact}");
    }
}

#[test]
fn a_mass_does_what_a_leak_of_its_part_of_the_tips_mass_does() {
    for held in short_latencies() {
        let least = least_leak(PAPER, &held);
        let without_leak = critical(0.0, 0.5, |part| {
            let law = mtj(Memory { k: 1.0, ..PAPER }, Some(part * held.mass));
            LinearLoop { law, ..held }.spectral_radius() < 1.0
        });
        assert!((least / without_leak - 1.0).abs() < 0.1, "{held:?}: {least} for {without_leak}");
        let half = 0.5 * least;
        let with_half = half + critical_leak(PAPER, Some(half * held.mass), &held);
        assert!((least / with_half - 1.0).abs() < 0.15, "{held:?}: {least} for {with_half}");
    }
}

#[test]
fn without_latency_the_condition_on_k_is_exact_and_free_of_the_mass() {
    for mass in [0.9, 2.0, 10.0] {
        let held = held(mtj(PAPER, None), mass, MemoryPolicy::Sent, 0.0);
        let Memory { kp, kd, .. } = PAPER;
        let bound = (2.0 * kd - kp * held.period) / (2.0 * kd + kp * held.period);
        let exact = 1.0 - critical_leak(PAPER, None, &held);
        assert!((exact - bound).abs() < 1e-6, "{exact} for {bound}");
    }
}

#[test]
fn without_latency_the_gain_is_bounded_as_every_held_damping_is() {
    for (mass, k) in [(1.05, 0.9), (2.0, 0.99)] {
        let radius = |part: f64| {
            let kd = part * 2.0 * (1.0 + k) * mass / PERIOD;
            // So little stiffness that the other condition is met.
            let law = mtj(Memory { kp: 1e-3 * kd, kd, k }, None);
            held(law, mass, MemoryPolicy::Sent, 0.0).spectral_radius()
        };
        assert!(radius(0.99) < 1.0 && radius(1.01) > 1.0, "{} {}", radius(0.99), radius(1.01));
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
    for policy in POLICIES {
        assert!(is(radius(0.0, 1.0, policy), 1.0025), "{}", radius(0.0, 1.0, policy));
        assert!(is(radius(0.0, 0.99, policy), 0.9975));
    }
    assert!(is(radius(0.001, 0.99, MemoryPolicy::Sent), 1.0125));
    assert!(is(radius(0.001, 0.99, MemoryPolicy::Delivered), 0.9993));
}
