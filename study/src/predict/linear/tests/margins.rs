//! The table of margins in `docs/latency.md`: the largest latencies of one mass.

use super::*;

/// Law, memory, whether it predicts, and the largest latency for each of [`MASSES`], ms, from an
/// independent program.
fn table() -> Vec<(Law<f64, 1>, MemoryPolicy, bool, [f64; 5])> {
    let eq_16 = mtj(PAPER, None);
    let tdc = tdc(8.0, 4.0, 1.0);
    let eq_11 = mtj(Memory { k: 1.0, ..PAPER }, Some(1.0));
    let (sent, delivered) = (MemoryPolicy::Sent, MemoryPolicy::Delivered);
    vec![
        (eq_16, sent, false, [0.088, 0.125, 0.167, 0.251, 0.368]),
        (eq_16, delivered, false, [0.899, 1.08, 1.25, 1.533, 1.854]),
        (eq_16, delivered, true, [23.38, 35.39, 48.39, 75.34, 111.9]),
        (eq_11, sent, false, [5.526, 7.256, 8.781, 10.98, 12.53]),
        (eq_11, delivered, false, [22.29, 26.30, 27.84, 28.86, 29.00]),
        (tdc, sent, false, [10.74, 17.66, 24.90, 37.96, 55.61]),
        (tdc, delivered, false, [249.3, 202.6, 165.9, 120.6, 86.10]),
    ]
}

#[test]
fn one_mass_stands_the_latencies_of_the_table() {
    for (law, memory, predicts, row) in table() {
        for (mass, expected) in MASSES.into_iter().zip(row) {
            let held = LinearLoop { predicts, ..held(law, mass, memory, 0.0) };
            let found = held.largest_latency(0.3).map(|latency| latency * 1e3);
            let found = found.unwrap_or(f64::NAN);
            let within = (found / expected - 1.0).abs() < 5e-3;
            assert!(within, "{mass} kg, {held:?}: {found} ms, not {expected}");
        }
    }
}

#[test]
fn computed_torque_with_a_perfect_model_stands_255_ms_whatever_the_mass() {
    for mass in MASSES {
        // tdc with the right mass has the same eigenvalues, and a matrix small enough for them.
        let tdc = held::<1>(tdc(8.0, 4.0, mass), mass, MemoryPolicy::Delivered, 0.0);
        let found = tdc.largest_latency(0.3).map_or(f64::NAN, |latency| latency * 1e3);
        assert!((found / 255.3 - 1.0).abs() < 1e-3, "{mass} kg: {found} ms");
    }
    let radius = |latency| held(mb(8.0, 4.0), 2.0, MemoryPolicy::Sent, latency).spectral_radius();
    // The radius of large matrices is an estimate.
    assert!(radius(0.25) < 1.0 && radius(0.265) > 1.0, "{} {}", radius(0.25), radius(0.265));
}
