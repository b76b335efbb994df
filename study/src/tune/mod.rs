//! The paper's systematic gain selection: gains, thresholds and memory from what is wanted.
//!
//! The ratio K_d/K_p is the error's time constant, eq. (17). The magnitude is the largest that the
//! sample period, the latency and the actuators allow: [`limits`] says what theory allows,
//! [`verify`] what a simulation of the arm does with it, and [`propose`] goes down from the first
//! until the second agrees.

pub mod limits;
pub mod print;
pub mod verify;

use mtj_model::scenario::{MemoryPolicy, Override, Scenario, duration};
use serde::Serialize;
use std::time::Duration;

use crate::failure::Failure;
use limits::Arm;
use verify::Verification;

/// The loop must stand this many times the latency.
pub const MARGIN: f64 = 1.5;
/// K_d is lowered by this factor from try to try.
const LOWER: f64 = 0.85;
/// How many values of K_d are simulated for a memory.
const TRIES: usize = 12;
/// e_max as multiples of the initial error, tried in turn.
const THRESHOLDS: [f64; 3] = [30.0, 10.0, 3.0];
/// ė_max/e_max, 1/s: the paper's.
const RATE_RATIO: f64 = 10.0;

/// What is wanted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Wanted {
    /// K_d/K_p, s.
    pub time_constant_s: f64,
    /// Per joint, N m.
    pub torque_limit_nm: Vec<f64>,
    /// Sample instant to application, s.
    pub latency_s: f64,
    /// Whether the latency is another than the scenario's own.
    #[serde(skip)]
    pub sets_latency: bool,
}

/// The memories in the order in which they are preferred: the simplest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    /// Whose task force.
    pub policy: MemoryPolicy,
    /// Whether the law aims a measured latency ahead.
    pub predicts: bool,
}

/// Every [`Memory`] that may be proposed.
pub const MEMORIES: [Memory; 3] = [
    Memory { policy: MemoryPolicy::Sent, predicts: false },
    Memory { policy: MemoryPolicy::Delivered, predicts: false },
    Memory { policy: MemoryPolicy::Delivered, predicts: true },
];

impl Memory {
    /// The policy's name in scenarios.
    pub fn policy_name(self) -> &'static str {
        match self.policy {
            MemoryPolicy::Sent => "sent",
            MemoryPolicy::Applied => "applied",
            MemoryPolicy::Delivered => "delivered",
        }
    }

    /// The name in print.
    pub fn name(self) -> &'static str {
        match (self.policy_name(), self.predicts) {
            ("delivered", true) => "delivered, with prediction",
            (name, _) => name,
        }
    }
}

/// The values to set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values {
    /// N/m.
    pub kp: f64,
    /// N s/m.
    pub kd: f64,
    /// e_max, m.
    pub error: f64,
    /// ė_max, m/s.
    pub error_rate: f64,
    /// Whose force is remembered, and whether the law aims ahead.
    pub memory: Memory,
}

/// A verified proposal.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// What to set.
    pub values: Values,
    /// What limits K_d.
    pub gain_reason: String,
    /// Why this memory.
    pub memory_reason: String,
    /// Why these thresholds.
    pub threshold_reason: String,
    /// What was tried and given up on the way.
    pub given_up: Vec<String>,
    /// The simulation with the latency.
    pub verified: Verification,
    /// The simulation with [`MARGIN`] times the latency.
    pub with_margin: Verification,
    /// The scenario before anything is set, with the same latency.
    pub as_it_stands: Verification,
}

/// The scenario in lockstep with a multiple of the wanted latency and without a torque limit, so that
/// what the law asks for is seen.
pub fn trial(
    scenario: &Scenario,
    wanted: &Wanted,
    multiple: f64,
    set: &[Override],
) -> Result<Scenario, Failure> {
    let text = |seconds: f64| duration::format(Duration::from_secs_f64(seconds));
    let link = &scenario.link;
    let (state, torque) = match wanted.sets_latency {
        true => (0.0, wanted.latency_s),
        false => (link.state.latency.as_secs_f64(), link.torque.latency.as_secs_f64()),
    };
    let mut all = vec![
        Override::text("timing.clock", "lockstep"),
        Override::value("safety.torque_limit", 1e9.into()),
        Override::text("link.state.latency", &text(multiple * state)),
        Override::text("link.torque.latency", &text(multiple * torque)),
    ];
    all.extend_from_slice(set);
    Ok(Scenario::parse(&scenario.name, scenario.text(), &all)?)
}

impl Values {
    fn new(kd: f64, error: f64, memory: Memory, wanted: &Wanted) -> Self {
        let kp = kd / wanted.time_constant_s;
        Self { kp, kd, error, error_rate: RATE_RATIO * error, memory }
    }

    /// The same as settings of a scenario.
    pub fn overrides(&self, scenario: &Scenario) -> Vec<Override> {
        let mut set = vec![
            Override::text("law.kind", "mtj"),
            Override::value("law.kp", self.kp.into()),
            Override::value("law.kd", self.kd.into()),
            Override::text("law.factor.kind", "exponential"),
            Override::value("law.factor.error", self.error.into()),
            Override::value("law.factor.error_rate", self.error_rate.into()),
            Override::value("law.factor.ceiling", 1.0.into()),
            Override::text("law.memory.policy", self.memory.policy_name()),
        ];
        if self.memory.predicts {
            set.push(Override::text("law.prediction.horizon", "measured"));
        } else if scenario.law.prediction.is_some() {
            set.push(Override::text("law.prediction.horizon", "0 s")); // As good as none.
        }
        set
    }
}

/// A positive number rounded down to two significant digits.
fn round_down(x: f64) -> f64 {
    let unit = 10f64.powf(x.log10().floor() - 1.0);
    let digits = (x / unit + 1e-9).floor();
    // Divided by a whole number, so that 0.3 is printed as 0.3.
    if unit < 1.0 { digits / (1.0 / unit).round() } else { digits * unit.round() }
}

/// Finds the largest gains that satisfy all limits and stand the test.
pub fn propose(
    scenario: &Scenario,
    wanted: &Wanted,
    proceed: &dyn Fn() -> bool,
) -> Result<Proposal, Failure> {
    let arm = Arm::of(scenario, wanted, proceed)?;
    arm.check_motion(wanted)?;
    let as_it_stands = verify::run(&trial(scenario, wanted, 1.0, &[])?, proceed)?;
    let mut given_up = Vec::new();
    let mut last_problem = String::new();
    for memory in MEMORIES {
        let allowed = arm.gain_limit(wanted);
        // The simpler memories must do at the full gain; the last one may cost some of it.
        let is_last = memory.predicts;
        let bound = match arm.gain_for_memory(memory, wanted, allowed.kd, is_last) {
            Ok(bound) => bound,
            Err(reason) => {
                given_up.push(format!("{}: {reason}", memory.name()));
                last_problem = reason;
                continue;
            }
        };
        let mut gain_reason = bound.reason.unwrap_or(allowed.reason);
        let mut kd = bound.kd;
        for _ in 0..TRIES {
            let mut best: Option<(Values, Verification, Verification)> = None;
            let mut problem = None;
            for multiple in THRESHOLDS {
                let error = round_down(multiple * arm.initial_error);
                let values = Values::new(round_down(kd), error, memory, wanted);
                let set = values.overrides(scenario);
                let run = |latency| verify::run(&trial(scenario, wanted, latency, &set)?, proceed);
                let (verified, with_margin) = (run(1.0)?, run(MARGIN)?);
                if !proceed() {
                    return Err(Failure::from("stopped before a proposal was verified".to_owned()));
                }
                match verified.problem(wanted, 1.0).or_else(|| with_margin.problem(wanted, MARGIN))
                {
                    Some(why) => problem = problem.or(Some(why)),
                    None if best.as_ref().is_none_or(|(_, b, _)| verified.rms() < b.rms()) => {
                        best = Some((values, verified, with_margin));
                    }
                    None => {}
                }
            }
            if let Some((values, verified, with_margin)) = best {
                return Ok(Proposal {
                    memory_reason: arm.explain_memory(&values, wanted),
                    threshold_reason: arm.explain_thresholds(&values, wanted),
                    values,
                    gain_reason,
                    given_up,
                    verified,
                    with_margin,
                    as_it_stands,
                });
            }
            let why = problem.unwrap_or_default();
            gain_reason = format!("simulation: with K_d = {} {why}", round_down(kd));
            given_up.push(format!("{}, K_d = {}: {why}", memory.name(), round_down(kd)));
            last_problem = why;
            kd *= LOWER;
        }
    }
    Err(Failure::from(format!(
        "none of the gains tried with K_d/K_p = {} s satisfies all limits; in the way at the last: \
         {last_problem}",
        wanted.time_constant_s
    )))
}

#[cfg(test)]
mod tests;
