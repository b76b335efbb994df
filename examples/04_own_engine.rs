//! An engine of your own: the built-in arm with viscous friction in its joints, which no law's
//! model knows.
//!
//! An engine that wraps another and adds something is the shortest way to a more difficult plant.
//!
//! `cargo run --release --example 04_own_engine`

use mtj::{
    Controller, Engine, Scenario, engine,
    plant::engine::{Drive, State},
    protocol::sample::Joints,
    run_with,
};

/// τ_f = −b q̇, applied as a disturbance that is held for a millisecond.
struct Friction {
    arm: Box<dyn Engine>,
    /// b, N m s/rad.
    viscous: f64,
    disturbance: Joints,
}

const STEP_NS: u64 = 1_000_000;

impl Engine for Friction {
    fn advance(&mut self, time_ns: u64, drive: &Drive) {
        while self.arm.state().time_ns < time_ns {
            let State { time_ns: now, velocity, .. } = self.arm.state();
            let torque = |joint: usize| self.disturbance[joint] - self.viscous * velocity[joint];
            self.arm.disturb(std::array::from_fn(torque));
            self.arm.advance(time_ns.min(now + STEP_NS), drive);
        }
    }

    fn state(&self) -> State {
        self.arm.state()
    }

    fn disturb(&mut self, torque: Joints) {
        self.disturbance = torque;
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    print!("{:<26}", "rms error, mm");
    const VISCOUS: [f64; 4] = [0.0, 0.5, 1.0, 2.0];
    VISCOUS.iter().for_each(|viscous| print!("{viscous:>10} N m s"));
    println!();
    for (name, scenario, set) in [
        ("tj", "sampled/tj", "law.kind=tj"),
        ("mtj, eq. (16)", "sampled/mtj", "law.kind=mtj"),
        ("mtj, eq. (11)", "sampled/mtj", "law.acceleration=true"),
        ("mb, the exact rigid model", "sampled/mb", "law.kind=mb"),
    ] {
        let scenario = Scenario::load(scenario, &["timing.clock=lockstep".parse()?, set.parse()?])?;
        print!("{name:<26}");
        for viscous in VISCOUS {
            let arm = engine(&scenario);
            let friction = Friction { arm, viscous, disturbance: Joints::default() };
            let outcome = run_with(&scenario, Controller::new(&scenario), Box::new(friction))?;
            let error = outcome.report.rms_error_m.unwrap_or(f64::INFINITY) * 1e3;
            print!("{error:>16.2}");
        }
        println!();
    }
    Ok(())
}
