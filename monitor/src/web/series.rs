//! The numbers that are plotted, and which of them a message contributes.

use mtj_model::{PLANE, for_links, trajectory::Trajectory};
use mtj_protocol::{
    port::{Message, Offered},
    sample::{Joints, StateSample},
};
use nalgebra::{SVector, Vector2};

use crate::overview::{period_deviation_ns, tells_of_another_torque};

/// Where the series of a quantity stand among [`NAMES`]: the first of them, if it has several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Series {
    /// Desired − measured tip at the state's own time stamp, m.
    Error = 0,
    /// Its Euclidean norm, m.
    ErrorNorm = 2,
    /// Norm of the error as the law used it, m.
    LawErrorNorm = 3,
    /// The regulating factor k.
    Factor = 4,
    /// Joint torques as commanded, N m.
    Torque = 6,
    /// The task force Q̂, N.
    Force = 13,
    /// What mtj added from its memory, h, N.
    Memory = 15,
    /// State sent to torque received, µs.
    RoundTrip = 17,
    /// The part of it spent in the controller, µs.
    Residence = 18,
    /// Sample instant to application of the last applied command, ms.
    Latency = 19,
    /// By how much a sample period differed from what it should be, µs.
    PeriodDeviation = 20,
    /// Commands that never came, so far.
    Lost = 21,
    /// Commands that came late, so far.
    Late = 22,
    /// Torque samples that were not acceptable, so far.
    Rejected = 23,
    /// Sampling instants missed, so far.
    Misses = 24,
    /// The measured tip, m.
    Tip = 25,
    /// The true tip, m.
    TrueTip = 27,
}

/// How many series there are.
pub const COUNT: usize = NAMES.len();

/// The names of all series, for an arm with as many joints as there can be.
pub const NAMES: [&str; 29] = [
    "error.0",
    "error.1",
    "error.norm",
    "law_error.norm",
    "factor.0",
    "factor.1",
    "torque.0",
    "torque.1",
    "torque.2",
    "torque.3",
    "torque.4",
    "torque.5",
    "torque.6",
    "force.0",
    "force.1",
    "memory.0",
    "memory.1",
    "round_trip",
    "residence",
    "latency",
    "period_deviation",
    "lost",
    "late",
    "rejected",
    "misses",
    "tip.0",
    "tip.1",
    "true_tip.0",
    "true_tip.1",
];

type Kinematics = Box<dyn Fn(&Joints) -> Vector2<f64> + Send>;

/// Reads numbers off messages.
#[derive(Default)]
pub struct Readings {
    geometry: Option<(Kinematics, Trajectory<f64>)>,
    before: Option<StateSample>,
}

impl Readings {
    /// From now on messages are about this scenario.
    pub fn follow(&mut self, offered: &Offered) {
        let arm = &offered.scenario.arm;
        let kinematics: Kinematics = for_links!(arm.links.len(), N => {
            let arm = arm.build::<N>();
            Box::new(move |position| {
                let q = SVector::from_fn(|i, _| position[i]);
                arm.pose(&q, &SVector::zeros()).tip()
            })
        });
        self.geometry = Some((kinematics, offered.scenario.trajectory));
    }

    /// Whether it is known what states are about.
    pub fn has_scenario(&self) -> bool {
        self.geometry.is_some()
    }

    /// Hands over all numbers that a message holds, each with the place of its series.
    pub fn read(&mut self, message: &Message, put: &mut dyn FnMut(usize, f64)) {
        match message {
            Message::State(state) => self.read_state(state, put),
            Message::Torque(torque) => {
                let joints = torque.header.joints as usize;
                put_all(put, Series::Torque, torque.torque.iter().take(joints));
                put_all(put, Series::Force, torque.force.iter().take(PLANE));
            }
            Message::Error(error) => {
                let axes = error.header.axes as usize;
                put(Series::LawErrorNorm as usize, norm(&error.error[..axes]));
                put_all(put, Series::Factor, error.factor.iter().take(PLANE));
                put_all(put, Series::Memory, error.memory.iter().take(PLANE));
            }
            Message::Status(status) => {
                put(Series::Lost as usize, status.lost as f64);
                put(Series::Late as usize, status.late as f64);
                put(Series::Rejected as usize, status.rejected as f64);
                put(Series::Misses as usize, status.deadline_misses as f64);
                if let Some((kinematics, _)) = &self.geometry {
                    put_all(put, Series::TrueTip, kinematics(&status.position).iter());
                }
            }
            Message::Scenario(_)
            | Message::Request(_)
            | Message::Change(_)
            | Message::Presence(_) => {}
        }
    }

    fn read_state(&mut self, state: &StateSample, put: &mut dyn FnMut(usize, f64)) {
        // Stamps are zero before there was anything to time.
        let mut put_ns = |series: Series, ns: u64, unit: f64| {
            if ns > 0 {
                put(series as usize, ns as f64 / unit);
            }
        };
        if self.before.as_ref().is_none_or(|before| tells_of_another_torque(before, state)) {
            put_ns(Series::RoundTrip, state.round_trip_ns, 1e3);
            put_ns(Series::Residence, state.residence_ns, 1e3);
        }
        put_ns(Series::Latency, state.latency_ns, 1e6);
        if let Some(deviation) =
            self.before.as_ref().and_then(|before| period_deviation_ns(before, state))
        {
            put(Series::PeriodDeviation as usize, deviation as f64 / 1e3);
        }
        self.before = Some(*state);
        if let Some((kinematics, desired)) = &self.geometry {
            let tip = kinematics(&state.position);
            let error = desired.at(state.header.time_ns as f64 * 1e-9).position - tip;
            put_all(put, Series::Tip, tip.iter());
            put_all(put, Series::Error, error.iter());
            put(Series::ErrorNorm as usize, error.norm());
        }
    }

    /// Where the desired path is at an instant, m.
    pub fn desired(&self, time: f64) -> Option<[f64; PLANE]> {
        self.geometry.as_ref().map(|(_, desired)| desired.at(time).position.into())
    }
}

fn put_all<'a>(
    put: &mut dyn FnMut(usize, f64),
    first: Series,
    values: impl Iterator<Item = &'a f64>,
) {
    for (axis, value) in values.enumerate() {
        put(first as usize + axis, *value);
    }
}

fn norm(vector: &[f64]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_series_stands_under_its_name() {
        for (series, name) in [
            (Series::Error, "error.0"),
            (Series::ErrorNorm, "error.norm"),
            (Series::LawErrorNorm, "law_error.norm"),
            (Series::Factor, "factor.0"),
            (Series::Torque, "torque.0"),
            (Series::Force, "force.0"),
            (Series::Memory, "memory.0"),
            (Series::RoundTrip, "round_trip"),
            (Series::Residence, "residence"),
            (Series::Latency, "latency"),
            (Series::PeriodDeviation, "period_deviation"),
            (Series::Lost, "lost"),
            (Series::Late, "late"),
            (Series::Rejected, "rejected"),
            (Series::Misses, "misses"),
            (Series::Tip, "tip.0"),
            (Series::TrueTip, "true_tip.0"),
        ] {
            assert_eq!(NAMES[series as usize], name);
        }
    }
}
