//! Many runs at once, each in a lane of the processor's vectors.
//!
//! Arm, trajectory, laws and their formulas are those of the scalar path, on numbers with several
//! lanes; links, sensor, actuator, memory and measures are those of the scalar path themselves, one
//! in each lane. Only two things are done in another way: the arm is moved by
//! [`mtj_plant::dormand_prince`], whose steps follow from `timing.tolerance`, and there is no queue
//! of events, because a loop in lockstep knows at a sample when its command will arrive
//! (`lanes/lane.rs`).
//!
//! Lanes may differ in every number of a scenario, in seeds, links and memory policies. The
//! formulas that are evaluated must be the same: runs are grouped by their [`BatchShape`]. A run's
//! result does not depend on the runs beside it, nor on the width of the vectors.
//!
//! The scalar path computes the runs that lanes cannot: see [`shape`].

mod batch;
mod lane;

use mtj_model::{
    lanes::{Lanes, Width, Work},
    lift::{Lift, Shape},
    scenario::{ClockKind, CourseSettings, FrictionSettings, Scenario},
};
use mtj_plant::{report::Report, sensor::Sensor};

use super::row::Measured;
use crate::experiment;

/// The most links that an arm in a lane may have.
const MOST_LINKS: usize = 3;
/// Times up to here, in ns, are whole numbers in a double: fifty days.
const LONGEST_NS: u128 = 1 << 52;

/// The properties that runs in one batch share: the formulas that are evaluated, and their sizes.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BatchShape {
    links: usize,
    formulas: Shape,
}

/// The shape of a scenario; `None` where it is for the scalar path: in real time, with an
/// integration step that was asked for, with a command timeout, joint limits or a wall, and for arms
/// of more than three links.
pub fn shape(scenario: &Scenario) -> Option<BatchShape> {
    let timing = &scenario.timing;
    let links = scenario.arm.links.len();
    let in_lanes = timing.clock == ClockKind::Lockstep
        && timing.tolerance.is_some()
        && scenario.safety.command_timeout.is_none()
        && scenario.safety.joint_limits.is_empty()
        && scenario.wall.is_none()
        && links <= MOST_LINKS
        && scenario.duration.as_nanos() < LONGEST_NS;
    in_lanes.then(|| {
        let mut formulas = Shape::new();
        scenario.trajectory.shape(&mut formulas);
        formulas.push(u8::from(scenario.arm.armature.is_some()));
        let friction = scenario.arm.friction.as_ref().map(FrictionSettings::build::<1>);
        friction.shape(&mut formulas);
        let course = scenario.actuator.as_ref().and_then(|actuator| actuator.course.as_ref());
        formulas.push(match course {
            None => 0,
            Some(CourseSettings::Lag(_)) => 1,
            Some(CourseSettings::Ramp(_)) => 2,
        });
        scenario.law.law.shape(&mut formulas);
        let (law, arm) = (&scenario.law, &scenario.arm);
        let choices = [
            law.prediction.is_some(),
            law.predicts_by_model(),
            law.balances_gravity(arm),
            Sensor::is_imperfect(scenario),
        ];
        formulas.extend(choices.map(u8::from));
        BatchShape { links, formulas }
    })
}

/// Computes scenarios, side by side where that is possible. `on_result` takes each result, with the
/// number of its scenario, as it comes. Runs that are not finished when `proceed` returns false
/// have no result.
pub fn measure(
    scenarios: &[Scenario],
    proceed: &dyn Fn() -> bool,
    on_result: &mut dyn FnMut(usize, Measured),
) {
    measure_in(Width::widest(), scenarios, proceed, on_result);
}

/// The same in vectors of a given width.
pub fn measure_in(
    width: Width,
    scenarios: &[Scenario],
    proceed: &dyn Fn() -> bool,
    on_result: &mut dyn FnMut(usize, Measured),
) {
    let mut alone = Vec::new();
    let mut together = std::collections::BTreeMap::<BatchShape, Vec<usize>>::new();
    for (number, scenario) in scenarios.iter().enumerate() {
        match shape(scenario) {
            Some(shape) => together.entry(shape).or_default().push(number),
            None => alone.push(number),
        }
    }
    for (shape, numbers) in &together {
        let mut take = |number, result| match result {
            Some(report) => on_result(number, Ok(report)),
            None => alone.push(number),
        };
        let queue = Queue { scenarios, numbers, proceed, on_result: &mut take };
        match shape.links {
            1 => width.run(BatchWork::<1, 2, 2>(queue)),
            2 => width.run(BatchWork::<2, 2, 2>(queue)),
            _ => width.run(BatchWork::<3, 2, 3>(queue)),
        }
    }
    for number in alone {
        if let Some(measured) = reference(&scenarios[number], proceed) {
            on_result(number, measured);
        }
    }
}

/// One run on the scalar path, whatever its shape; `None` if it was interrupted.
pub fn reference(scenario: &Scenario, proceed: &dyn Fn() -> bool) -> Option<Measured> {
    match experiment::run_direct(scenario, false, proceed) {
        Ok(outcome) if outcome.interrupted => None,
        Ok(outcome) => Some(Ok(outcome.report)),
        Err(error) => Some(Err(error.into())),
    }
}

/// Runs of one shape that wait for lanes.
struct Queue<'a, 'b> {
    scenarios: &'a [Scenario],
    numbers: &'a [usize],
    proceed: &'b dyn Fn() -> bool,
    /// Takes the report of a lane, or `None` if the scalar path must say what went wrong.
    on_result: &'b mut dyn FnMut(usize, Option<Report>),
}

/// Runs of an arm with `N` links, a task with `M` axes, and an echo of up to `E` numbers: one for
/// each joint or axis.
struct BatchWork<'a, 'b, const N: usize, const M: usize, const E: usize>(Queue<'a, 'b>);

impl<const N: usize, const M: usize, const E: usize> Work for BatchWork<'_, '_, N, M, E> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lanes>(self) {
        batch::Batch::<T, N, M, E>::compute(self.0);
    }
}
