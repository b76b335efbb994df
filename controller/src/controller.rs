//! One state sample in, one torque sample out.

use std::fmt;

use mtj_model::{
    MAX_SIGNALS, PLANE,
    arm::Posture,
    for_links,
    scenario::{Horizon, LawKind, LawSettings, Scenario},
    trajectory::Motion,
};
use mtj_protocol::sample::{ErrorSample, Name, StateSample, TorqueSample, padded, text};
use nalgebra::SVector;

use crate::{
    law::Factor,
    memory::Memory,
    prediction::{self, Tip},
    responder::{Law, Recollection, Responder, is_singular},
};

/// A law with its memory, ready to answer states.
///
/// The same object answers a direct call in a sweep, a thread, or a bus; it allocates nothing after
/// it was made and knows neither clocks nor transports.
pub struct Controller {
    law: Box<dyn Respond>,
    answer: Answer,
}

/// An answer, where it stays: it is lent to whoever sends it.
#[derive(Clone, Copy, Debug, Default)]
struct Answer {
    torque: TorqueSample,
    error: ErrorSample,
}

/// Why a state could not be answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LawError {
    /// mb needs J⁻¹, and J has none at this time (s).
    Singular(f64),
    /// The state has another number of joints than the scenario's arm.
    Joints {
        /// In the scenario.
        expected: usize,
        /// In the state.
        found: u32,
    },
}

impl fmt::Display for LawError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Singular(time) => write!(
                f,
                "law.kind = \"mb\" inverts the Jacobian, which is singular at t = {time} s; keep the \
                 path away from the rim of the workspace, or use tj or mtj, which need no inverse"
            ),
            Self::Joints { expected, found } => {
                write!(f, "the state sample has {found} joints, the scenario's arm {expected}")
            }
        }
    }
}

impl std::error::Error for LawError {}

impl Controller {
    /// The controller that a scenario describes.
    pub fn new(scenario: &Scenario) -> Self {
        let law = law(scenario, None, Tip::unknown());
        Self { law, answer: Answer::default() }
    }

    /// Goes on under a scenario that was changed while it runs, for the same arm: with what it remembers, so
    /// that a change of something else gives the arm no jerk.
    pub fn adopt(&mut self, scenario: &Scenario) {
        let (memory, previous) = self.law.remembered();
        let memory = memory.map(|memory| memory.adopt(&scenario.law.memory));
        self.law = law(scenario, memory, previous);
    }

    /// τ = J_Cᵀ Q̂ for a measured state, with Q̂ from the law. The desired motion is evaluated at the
    /// sample's own time stamp (plus the prediction horizon), never at the time of arrival. Who answers and how
    /// long that took is for whoever sends it to fill in.
    pub fn respond(&mut self, state: &StateSample) -> Result<&mut TorqueSample, LawError> {
        self.law.respond(state, &mut self.answer)?;
        Ok(&mut self.answer.torque)
    }

    /// Computes of the answer to the sample after `state` what does not depend on what will be measured: where the
    /// tip should be. To be called when the answer to `state` is on its way; if it is not, or if the next sample is
    /// of another instant than was to be expected, the answer is the same and takes a little longer.
    pub fn foresee(&mut self, state: &StateSample) {
        self.law.foresee(state);
    }

    /// Takes the place of another controller that answered `state` with `torque`, as if it had done so
    /// itself; a memory step that is longer than a sample period it knows from its next beginning on.
    pub fn take_over(
        &mut self,
        state: &StateSample,
        torque: &TorqueSample,
    ) -> Result<(), LawError> {
        self.respond(state)?;
        self.law.remember(torque);
        self.answer.torque = *torque;
        Ok(())
    }

    /// How the law saw the instant it answered last.
    pub fn error(&self) -> &ErrorSample {
        &self.answer.error
    }

    /// The answer to the last state once more, for a plant that did not get it.
    pub fn answer_again(&mut self, state: &StateSample) -> &mut TorqueSample {
        let torque = &mut self.answer.torque;
        (torque.state_sent_ns, torque.residence_ns) = (state.sent_ns, 0);
        torque
    }
}

trait Respond {
    fn respond(&mut self, state: &StateSample, answer: &mut Answer) -> Result<(), LawError>;
    /// Computes what is known of the answer to the next state.
    fn foresee(&mut self, state: &StateSample);
    /// Believes to have answered the last state so.
    fn remember(&mut self, torque: &TorqueSample);
    /// What is known from earlier samples.
    fn remembered(&self) -> (Option<Memory>, Tip<f64>);
}

fn law(scenario: &Scenario, memory: Option<Memory>, previous: Tip<f64>) -> Box<dyn Respond> {
    for_links!(scenario.arm.links.len(), N => {
        Box::new(ArmController::<N>::new(scenario, memory, previous))
    })
}

/// A law for an arm of `N` links.
struct ArmController<const N: usize> {
    responder: Responder<f64, N>,
    /// What mtj remembers.
    memory: Option<Memory>,
    horizon: Option<Horizon>,
    previous: Tip<f64>,
    sample_period_ns: u64,
    /// Of the law.
    name: Name,
    /// When something is desired of the tip, s, and what.
    foreseen: Option<(f64, Motion<f64, PLANE>)>,
}

impl<const N: usize> ArmController<N> {
    fn new(scenario: &Scenario, memory: Option<Memory>, previous: Tip<f64>) -> Self {
        let settings = &scenario.law;
        let has_memory = settings.kind == LawKind::Mtj;
        Self {
            responder: Responder {
                arm: scenario.arm.scaled(settings.mass_scale).build(),
                trajectory: scenario.trajectory,
                law: law_of(settings),
            },
            memory: has_memory.then(|| memory.unwrap_or_else(|| Memory::new(&settings.memory))),
            horizon: settings.prediction,
            previous,
            sample_period_ns: scenario.timing.sample_period.as_nanos() as u64,
            name: text(settings.kind.name()),
            foreseen: None,
        }
    }

    fn forget(&mut self) {
        self.previous = Tip::unknown();
        if let Some(memory) = &mut self.memory {
            memory.forget();
        }
    }
}

impl<const N: usize> Respond for ArmController<N> {
    fn respond(&mut self, state: &StateSample, answered: &mut Answer) -> Result<(), LawError> {
        let header = state.header.answer();
        if header.joints as usize != N {
            return Err(LawError::Joints { expected: N, found: header.joints });
        }
        if state.timed_out != 0 {
            // The arm stands, or falls, as the plant's safety says: nothing that was before counts.
            self.forget();
        }
        let q = SVector::from_fn(|i, _| state.position[i]);
        let q_dot = SVector::from_fn(|i, _| state.velocity[i]);
        let time = seconds(header.time_ns);
        let recollection = Recollection {
            previous: self.previous,
            horizon: prediction::horizon(self.horizon, state.latency_ns),
            force: self.memory.as_ref().and_then(|memory| memory.recall(state)),
            foreseen: self.foreseen,
        };
        let answer = self.responder.respond(time, Posture::new(&q, &q_dot), &recollection);
        self.previous = answer.tip;
        if is_singular(answer.condition) {
            return Err(LawError::Singular(time));
        }
        if let Some(memory) = &mut self.memory {
            memory.store(state, &answer.remembered.force);
        }
        answered.torque = TorqueSample {
            header,
            state_sent_ns: state.sent_ns,
            residence_ns: 0,
            controller: 0,
            echo_count: PLANE as u64,
            torque: padded(answer.torque.as_slice()),
            echo: padded(answer.remembered.force.as_slice()),
        };
        let mut signals = [0.0; MAX_SIGNALS];
        if let Law::Mtj { .. } = self.responder.law {
            let (factor, memory) = (answer.remembered.factor.per_axis(), answer.remembered.memory);
            for (place, number) in signals.iter_mut().zip(factor.iter().chain(&memory)) {
                *place = *number;
            }
        }
        answered.error = ErrorSample {
            header,
            law: self.name,
            error: padded(answer.error.position.as_slice()),
            error_rate: padded(answer.error.velocity.as_slice()),
            signals,
        };
        Ok(())
    }

    fn foresee(&mut self, state: &StateSample) {
        let next = seconds(state.header.time_ns.saturating_add(self.sample_period_ns));
        let horizon = prediction::horizon(self.horizon, state.latency_ns);
        let aim = horizon.map_or(next, |horizon| next + horizon);
        self.foreseen = Some((aim, self.responder.trajectory.at(aim)));
    }

    fn remember(&mut self, torque: &TorqueSample) {
        if let Some(memory) = &mut self.memory {
            memory.replace(&SVector::from_fn(|i, _| torque.echo[i]));
        }
    }

    fn remembered(&self) -> (Option<Memory>, Tip<f64>) {
        (self.memory, self.previous)
    }
}

/// A sampling instant, s since the run began.
fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 * 1e-9
}

fn law_of(settings: &LawSettings) -> Law<f64> {
    let LawSettings { kind, kp, kd, factor, acceleration, .. } = settings;
    let of_error = Factor::new(factor.kind, factor.error, factor.error_rate);
    let ceiling = (factor.ceiling != 1.0).then_some(factor.ceiling);
    Law::new(*kind, *kp, *kd, of_error, ceiling, *acceleration)
}
