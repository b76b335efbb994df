//! Many runs at once, each in a lane of the processor's vectors.
//!
//! Arm, trajectory, laws and their formulas are those of the scalar path, on numbers with several lanes;
//! links, sensor, actuator, memory and measures are those of the scalar path themselves, one in each lane.
//! Only two things are done in another way: the arm is moved by [`mtj_plant::dormand_prince`], whose steps
//! follow from `timing.tolerance`, and there is no queue of events, because a loop in lockstep knows at a
//! sample when its command will arrive (`lanes/lane.rs`).
//!
//! Lanes may differ in every number of a scenario, in seeds, links and memory policies. What decides which
//! formula is evaluated must be the same: that is the [`Structure`], and runs are put together by it. A
//! run's result does not depend on what is computed beside it, nor on the width of the vectors.
//!
//! What lanes do not do is done by the scalar path: see [`structure`].

mod flock;
mod lane;
mod uniform;

use mtj_model::{
    PLANE,
    gains::Gains,
    lanes::{Lanes, Width, Work},
    scenario::{ClockKind, FactorKind, LawKind, Scenario},
    trajectory::Trajectory,
};
use mtj_plant::report::Report;

use super::results::Measured;
use crate::experiment;

/// The most links that an arm in a lane may have.
const MOST_LINKS: usize = 3;
/// Times up to here, in ns, are whole numbers in a double: fifty days.
const LONGEST_NS: u128 = 1 << 52;

/// What runs must have in common to be computed side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Structure {
    links: usize,
    trajectory: u8,
    law: u8,
    has_full_gains: [bool; 2],
    has_acceleration: bool,
    factor: u8,
    has_ceiling: bool,
    predicts: bool,
    has_noise: bool,
}

/// The structure of a scenario; `None` where it is for the scalar path: in real time, with an integration
/// step that was asked for, with a command timeout, and for arms of more than three links.
pub fn structure(scenario: &Scenario) -> Option<Structure> {
    let timing = &scenario.timing;
    let in_lanes = timing.clock == ClockKind::Lockstep
        && timing.tolerance.is_some()
        && scenario.safety.command_timeout.is_none()
        && scenario.arm.links.len() <= MOST_LINKS
        && scenario.duration.as_nanos() < LONGEST_NS;
    let law = &scenario.law;
    let is_full = |gains: &Gains<f64, PLANE>| matches!(gains, Gains::Full(_));
    let is_mtj = law.kind == LawKind::Mtj;
    in_lanes.then(|| Structure {
        links: scenario.arm.links.len(),
        trajectory: match scenario.trajectory {
            Trajectory::PerturbedCircle(..) => 0,
            Trajectory::Circle(_) => 1,
            Trajectory::PointToPoint(_) => 2,
        },
        law: match law.kind {
            LawKind::Tj => 0,
            LawKind::Mtj => 1,
            LawKind::Mb => 2,
        },
        has_full_gains: [is_full(&law.kp), is_full(&law.kd)],
        has_acceleration: is_mtj && law.acceleration,
        factor: match law.factor.kind {
            _ if !is_mtj => 0,
            FactorKind::Switch => 0,
            FactorKind::Exponential => 1,
            FactorKind::Diagonal => 2,
        },
        has_ceiling: is_mtj && law.factor.ceiling != 1.0,
        predicts: law.prediction.is_some(),
        has_noise: scenario.noise > 0.0,
    })
}

/// Computes scenarios, side by side where that is possible, and hands each result in as it comes, with
/// the number of its scenario. What is left when `proceed` says no is not handed in.
pub fn measure(
    scenarios: &[Scenario],
    proceed: &dyn Fn() -> bool,
    hand_in: &mut dyn FnMut(usize, Measured),
) {
    measure_in(Width::widest(), scenarios, proceed, hand_in);
}

/// The same in vectors of a given width.
pub fn measure_in(
    width: Width,
    scenarios: &[Scenario],
    proceed: &dyn Fn() -> bool,
    hand_in: &mut dyn FnMut(usize, Measured),
) {
    let mut alone = Vec::new();
    let mut together = std::collections::BTreeMap::<Structure, Vec<usize>>::new();
    for (number, scenario) in scenarios.iter().enumerate() {
        match structure(scenario) {
            Some(structure) => together.entry(structure).or_default().push(number),
            None => alone.push(number),
        }
    }
    for (structure, numbers) in &together {
        let mut take = |number, result| match result {
            Some(report) => hand_in(number, Ok(report)),
            None => alone.push(number),
        };
        let queue = Queue { scenarios, numbers, proceed, hand_in: &mut take };
        match structure.links {
            1 => width.run(Flight::<1>(queue)),
            2 => width.run(Flight::<2>(queue)),
            _ => width.run(Flight::<3>(queue)),
        }
    }
    for number in alone {
        if let Some(measured) = reference(&scenarios[number], proceed) {
            hand_in(number, measured);
        }
    }
}

/// One run on the scalar path, whatever its structure; `None` if it was interrupted.
pub fn reference(scenario: &Scenario, proceed: &dyn Fn() -> bool) -> Option<Measured> {
    match experiment::run_direct(scenario, false, proceed) {
        Ok(outcome) if outcome.interrupted => None,
        Ok(outcome) => Some(Ok(outcome.report)),
        Err(error) => Some(Err(error.to_string())),
    }
}

/// Runs of one structure that wait for lanes.
struct Queue<'a, 'b> {
    scenarios: &'a [Scenario],
    numbers: &'a [usize],
    proceed: &'b dyn Fn() -> bool,
    /// Takes what came of a lane, or nothing if something happened that the scalar path has the words for.
    hand_in: &'b mut dyn FnMut(usize, Option<Report>),
}

struct Flight<'a, 'b, const N: usize>(Queue<'a, 'b>);

impl<const N: usize> Work for Flight<'_, '_, N> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lanes>(self) {
        flock::Flock::<T, N>::fly(self.0);
    }
}
