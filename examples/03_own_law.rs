//! A law of your own beside the built-in ones: a spring that never pulls harder than a bound, eq.
//! (7) with saturation, for an arm whose motors are weak.
//!
//! `cargo run --release --example 03_own_law`

use mtj::{
    Controller, Scenario, engine,
    model::{
        arm::Kinematics,
        law::{Command, Description, Equation, Per, Signal, Signals, Situation, State},
    },
    run, run_with,
};

/// Q̂ᵢ = F tanh(K_p eᵢ / F) + K_d ėᵢ.
#[derive(Clone, Copy)]
struct Saturated {
    /// K_p, N/m.
    kp: f64,
    /// K_d, N s/m.
    kd: f64,
    /// F, N.
    bound: f64,
}

const SATURATED: Description = Description {
    name: "saturated",
    title: "saturated spring",
    equation: "Q̂ = F tanh(K_p e / F) + K_d ė",
    parameters: &[],
    echo: Signal {
        key: "force",
        symbol: "Q̂",
        title: "Task force",
        unit: "N",
        per: Per::Axis,
        range: None,
    },
    has_memory: false,
    has_state: false,
    signals: &[],
};

impl Equation<f64, 2> for Saturated {
    fn command<A: Kinematics<f64, N, 2>, const N: usize>(
        &self,
        now: &Situation<'_, f64, A, N, 2>,
        _: &mut State<f64>,
        _: &mut Signals<f64>,
    ) -> Command<f64, N> {
        let spring = now.error.position.map(|e| self.bound * (self.kp * e / self.bound).tanh());
        Command::of_task_force(&now.jacobian(), &(spring + now.error.velocity * self.kd))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("{:<22}{:>14}{:>18}", "law", "rms error, mm", "peak torque, N m");
    let print = |name: &str, outcome: mtj::Outcome| {
        let error = outcome.report.rms_error_m.unwrap_or(f64::INFINITY) * 1e3;
        let torque = outcome.report.peak_torque_nm.iter().copied().fold(0.0, f64::max);
        println!("{name:<22}{error:>14.2}{torque:>18.1}");
    };
    for name in ["sampled/tj", "sampled/mtj"] {
        let scenario = Scenario::load(name, &["timing.clock=lockstep".parse()?])?;
        print(name, run(&scenario)?);
    }
    let scenario = Scenario::load("sampled/tj", &["timing.clock=lockstep".parse()?])?;
    for bound in [4.0, 1.0, 0.5] {
        let law = Saturated { kp: 60.0, kd: 120.0, bound };
        let controller = Controller::with_law(&scenario, &SATURATED, law)?;
        print(
            &format!("saturated, {bound} N"),
            run_with(&scenario, controller, engine(&scenario))?,
        );
    }
    Ok(())
}
