//! One state sample in, one torque sample out.

use std::fmt;

use mtj_model::{
    arm::{
        Arm,
        planar::{Configuration, PlanarArm},
    },
    for_axes, for_joints,
    law::{Description, Equation, State},
    lift::Lift,
    scenario::{Horizon, Scenario},
    task::Previous,
    trajectory::Motion,
};
use mtj_protocol::sample::{Axes, ErrorSample, StateSample, TorqueSample, padded, text};
use nalgebra::SVector;

use crate::{
    memory::Memory,
    prediction::{self, SentTorques},
    responder::{Context, Measured, Responder, Response},
};

/// A law with its memory, ready to answer states.
///
/// The same object answers a direct call in a sweep, a thread, or a bus; it allocates nothing after
/// it was made and knows neither clocks nor transports.
pub struct Controller {
    law: Box<dyn Respond>,
    /// Makes the law of a changed scenario, with what the one before knew.
    make: Box<Make>,
    answer: Answer,
}

type Make = dyn Fn(&Scenario, Option<History>) -> Box<dyn Respond>;

/// The answer to the last state. It stays here and is lent to the port that sends it.
#[derive(Clone, Copy, Debug)]
struct Answer {
    torque: TorqueSample,
    error: ErrorSample,
    /// Whether the law damped an inverse for it, near a singular posture.
    is_damped: bool,
}

/// Why a state could not be answered.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LawError {
    /// A law of one's own is written for another number of task axes than the scenario's task has.
    #[error("law '{law}' controls {expected} task axes, the scenario's task has {found}")]
    Axes {
        /// The law's name.
        law: &'static str,
        /// What the law is written for.
        expected: usize,
        /// In the scenario.
        found: usize,
    },
    /// The state has another number of joints than the scenario's arm.
    #[error("the state sample has {found} joints, the scenario's arm {expected}")]
    Joints {
        /// In the scenario.
        expected: usize,
        /// In the state.
        found: u32,
    },
}

impl fmt::Debug for Controller {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (law, answer) = (self.law.name(), &self.answer);
        f.debug_struct("Controller")
            .field("law", &law)
            .field("answer", answer)
            .finish_non_exhaustive()
    }
}

impl Controller {
    /// The controller that a scenario describes.
    pub fn new(scenario: &Scenario) -> Self {
        Self::made(scenario, Box::new(built_in))
    }

    /// The controller of a scenario with a law of one's own in place of the scenario's.
    ///
    /// `M` is the number of task axes that the law controls. Memory, prediction and the model's
    /// `mass_scale` are as the scenario's table `law` says; so are the law's name and echo in the
    /// traces and reports of a plant. [`mtj_model::law`] shows how to write a law.
    ///
    /// # Errors
    ///
    /// [`LawError::Axes`] if the scenario's task has another number of axes than `M`.
    ///
    /// # Examples
    ///
    /// A spring between tip and desired point; no damper:
    ///
    /// ```
    /// use mtj_controller::Controller;
    /// use mtj_model::{
    ///     arm::Kinematics,
    ///     law::{Command, Description, Equation, Per, Signal, Signals, Situation, State},
    ///     scenario::Scenario,
    /// };
    /// use mtj_protocol::sample::StateSample;
    ///
    /// /// Q̂ = stiffness · e; N/m.
    /// #[derive(Clone, Copy)]
    /// struct Spring {
    ///     stiffness: f64,
    /// }
    ///
    /// const SPRING: Description = Description {
    ///     name: "spring",
    ///     title: "spring",
    ///     equation: "Q̂ = k e",
    ///     parameters: &[],
    ///     echo: Signal {
    ///         key: "force",
    ///         symbol: "Q̂",
    ///         title: "Task force",
    ///         unit: "N",
    ///         per: Per::Axis,
    ///         range: None,
    ///     },
    ///     has_memory: false,
    ///     has_state: false,
    ///     signals: &[],
    /// };
    ///
    /// impl Equation<f64, 2> for Spring {
    ///     fn command<A: Kinematics<f64, N, 2>, const N: usize>(
    ///         &self,
    ///         now: &Situation<'_, f64, A, N, 2>,
    ///         _: &mut State<f64>,
    ///         _: &mut Signals<f64>,
    ///     ) -> Command<f64, N> {
    ///         let force = now.error.position * self.stiffness;
    ///         Command::of_task_force(&now.jacobian(), &force)
    ///     }
    /// }
    ///
    /// let scenario = Scenario::load("sampled/tj", &[])?;
    /// let mut controller = Controller::with_law(&scenario, &SPRING, Spring { stiffness: 100.0 })?;
    ///
    /// let mut state = StateSample::default();
    /// state.header.joints = 2;
    /// state.position[..2].copy_from_slice(&[0.3, 1.2]);
    /// let force = controller.respond(&state)?.echo;
    /// let error = controller.error().error;
    /// assert_eq!(force[..2], [100.0 * error[0], 100.0 * error[1]]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn with_law<L, const M: usize>(
        scenario: &Scenario,
        description: &'static Description,
        law: L,
    ) -> Result<Self, LawError>
    where
        L: Equation<f64, M> + 'static,
    {
        let found = scenario.task.axes.len();
        if found != M {
            return Err(LawError::Axes { law: description.name, expected: M, found });
        }
        let make = move |scenario: &Scenario, history| -> Box<dyn Respond> {
            for_joints!(scenario.arm.joints(), N => {
                let responder = Responder::with_law(scenario, law);
                Box::new(ArmController::<N, M, L>::new(responder, description, scenario, history))
            })
        };
        Ok(Self::made(scenario, Box::new(make)))
    }

    fn made(scenario: &Scenario, make: Box<Make>) -> Self {
        let law = make(scenario, None);
        let answer = Answer {
            torque: TorqueSample::default(),
            error: blank_error(law.name()),
            is_damped: false,
        };
        Self { law, make, answer }
    }

    /// Goes on with a changed scenario for the same arm. The memory stays, so that a change of
    /// another key gives the arm no jerk.
    pub fn reconfigure(&mut self, scenario: &Scenario) {
        self.law = (self.make)(scenario, Some(self.law.history()));
        self.answer.error = blank_error(self.law.name());
    }

    /// Answers a measured state with τ = Jᵀ Q̂, N m.
    ///
    /// The desired motion is evaluated at the sample's own time stamp plus the prediction horizon,
    /// never at the time of arrival. The port that sends the answer fills in which controller it is
    /// and its residence time.
    ///
    /// # Errors
    ///
    /// [`LawError::Joints`] for a state of another arm.
    pub fn respond(&mut self, state: &StateSample) -> Result<&mut TorqueSample, LawError> {
        self.law.respond(state, &mut self.answer)?;
        Ok(&mut self.answer.torque)
    }

    /// Precomputes the part of the next answer that does not depend on the next measurement: the
    /// desired motion. Call it when the answer to `state` is on its way. Without it, or if the next
    /// sample comes at another instant than expected, the answer is the same and takes a little
    /// longer.
    pub fn preprocess(&mut self, state: &StateSample) {
        self.law.preprocess(state);
    }

    /// Continues from another controller that answered `state` with `torque`. A memory step that is
    /// longer than a sample period is known from its next beginning on.
    pub fn resume_from(
        &mut self,
        state: &StateSample,
        torque: &TorqueSample,
    ) -> Result<(), LawError> {
        self.respond(state)?;
        self.law.replace_echo(torque);
        self.answer.torque = *torque;
        Ok(())
    }

    /// Whether the law damped an inverse for the last answer, because the arm is near a singular
    /// posture.
    pub fn is_damped(&self) -> bool {
        self.answer.is_damped
    }

    /// The tracking error and signals of the last answer, for displays.
    pub fn error(&self) -> &ErrorSample {
        &self.answer.error
    }

    /// The last answer again, for a plant that did not get it.
    pub fn answer_again(&mut self, state: &StateSample) -> &mut TorqueSample {
        let torque = &mut self.answer.torque;
        (torque.state_sent_ns, torque.residence_ns) = (state.sent_ns, 0);
        torque
    }
}

/// What [`Controller`] needs of a law, whatever its numbers of joints and axes.
trait Respond {
    /// The law's name.
    fn name(&self) -> &'static str;
    fn respond(&mut self, state: &StateSample, answer: &mut Answer) -> Result<(), LawError>;
    /// Precomputes what does not depend on the next measurement.
    fn preprocess(&mut self, state: &StateSample);
    /// Goes on as if this had been the answer to the last state.
    fn replace_echo(&mut self, torque: &TorqueSample);
    /// What is known from earlier samples.
    fn history(&self) -> History;
}

/// What a controller knows from earlier samples.
struct History {
    law: &'static str,
    state: State<f64>,
    memory: Option<Memory>,
    sent: Option<SentTorques>,
    /// When the last sample was taken, s.
    time: f64,
    /// The tip's velocity then.
    velocity: Axes,
}

/// The error sample before the first answer: the law's name, and zeros.
fn blank_error(law: &str) -> ErrorSample {
    ErrorSample { law: text(law), ..ErrorSample::default() }
}

/// The law that a scenario names.
fn built_in(scenario: &Scenario, history: Option<History>) -> Box<dyn Respond> {
    let description = scenario.law.law.description();
    for_joints!(scenario.arm.joints(), N => for_axes!(scenario.task, M => {
        let responder = Responder::of(scenario).lift::<f64, M>();
        Box::new(ArmController::<N, M, _>::new(responder, description, scenario, history))
    }))
}

/// A law for an arm of `N` links in a task of `M` axes.
struct ArmController<const N: usize, const M: usize, L> {
    responder: Responder<f64, PlanarArm<f64, N>, M, L>,
    name: &'static str,
    /// For a law that has one.
    memory: Option<Memory>,
    horizon: Option<Horizon>,
    /// For the model of the arm that says where it will be.
    sent: Option<SentTorques>,
    balances_gravity: bool,
    previous: Previous<f64, M>,
    state: State<f64>,
    sample_period_ns: u64,
    echo_count: u64,
    /// The desired motion at an instant to come, s.
    precomputed: Option<(f64, Motion<f64, SVector<f64, M>, M>)>,
}

impl<const N: usize, const M: usize, L> ArmController<N, M, L> {
    fn new(
        responder: Responder<f64, PlanarArm<f64, N>, M, L>,
        description: &Description,
        scenario: &Scenario,
        history: Option<History>,
    ) -> Self {
        let settings = &scenario.law;
        let mut state = [0.0; _];
        let (memory, sent, previous) = match history {
            None => (None, None, Previous::none()),
            Some(History { law, state: known, memory, sent, time, velocity }) => {
                // Another law has another state.
                if law == description.name {
                    state = known;
                }
                let velocity = SVector::from_fn(|i, _| velocity[i]);
                (memory, sent, Previous { time, velocity })
            }
        };
        let memory = memory.map_or_else(
            || Memory::new(&settings.memory),
            |memory| memory.reconfigure(&settings.memory),
        );
        Self {
            responder,
            name: description.name,
            memory: description.has_memory.then_some(memory),
            horizon: settings.prediction,
            sent: settings.predicts_by_model().then(|| sent.unwrap_or_default()),
            balances_gravity: settings.balances_gravity(&scenario.arm),
            previous,
            state,
            sample_period_ns: scenario.timing.sample_period.as_nanos() as u64,
            echo_count: description.echo.per.count(N, M) as u64,
            precomputed: None,
        }
    }

    fn forget(&mut self) {
        self.previous = Previous::none();
        self.state = [0.0; _];
        if let Some(memory) = &mut self.memory {
            memory.forget();
        }
        if let Some(sent) = &mut self.sent {
            sent.forget();
        }
    }
}

impl<const N: usize, const M: usize, L: Equation<f64, M>> Respond for ArmController<N, M, L> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn respond(&mut self, state: &StateSample, answered: &mut Answer) -> Result<(), LawError> {
        let header = state.header.answer();
        if header.joints as usize != N {
            return Err(LawError::Joints { expected: N, found: header.joints });
        }
        if state.timed_out != 0 {
            // The plant's safety moved the arm meanwhile: what was before the timeout does not
            // count.
            self.forget();
        }
        let q = SVector::from_fn(|i, _| state.position[i]);
        let q_dot = SVector::from_fn(|i, _| state.velocity[i]);
        let time = seconds(header.time_ns);
        let memory = self.memory.as_ref();
        let echo = memory.and_then(|memory| memory.recall(&state.applied, &state.delivered));
        let at = Configuration::new(&q, &q_dot);
        let context = Context {
            previous: self.previous,
            horizon: prediction::horizon(self.horizon, state.latency_ns),
            echo,
            precomputed: self.precomputed,
        };
        let ahead = self.sent.as_ref().zip(context.horizon).map(|(sent, horizon)| {
            sent.ahead(&self.responder.arm, header.time_ns, horizon, q, q_dot)
        });
        let ahead = ahead.as_ref();
        let measured = Measured { time, position: &q, velocity: &q_dot, at: &at, ahead };
        let shown = &mut answered.error;
        let Response { mut command, error, tip, .. } =
            self.responder.respond(&measured, &context, &mut self.state, &mut shown.signals);
        if self.balances_gravity {
            // At the measured posture, which the plant knows, also where a model predicts another.
            command.torque += self.responder.arm.gravity(&q);
        }
        if let Some(sent) = &mut self.sent {
            sent.store(header.time_ns, command.torque.as_slice());
        }
        self.previous = Previous { time, velocity: tip.velocity };
        answered.is_damped = command.damping > 0.0;
        if let Some(memory) = &mut self.memory {
            memory.store(header.time_ns, &command.echo);
        }
        answered.torque = TorqueSample {
            header,
            state_sent_ns: state.sent_ns,
            residence_ns: 0,
            controller: 0,
            echo_count: self.echo_count,
            torque: padded(command.torque.as_slice()),
            echo: command.echo,
        };
        shown.header = header;
        shown.error = padded(error.position.as_slice());
        shown.error_rate = padded(error.velocity.as_slice());
        Ok(())
    }

    fn preprocess(&mut self, state: &StateSample) {
        let next = seconds(state.header.time_ns.saturating_add(self.sample_period_ns));
        let horizon = prediction::horizon(self.horizon, state.latency_ns);
        let aim = horizon.map_or(next, |horizon| next + horizon);
        self.precomputed = Some((aim, self.responder.trajectory.at(aim)));
    }

    fn replace_echo(&mut self, torque: &TorqueSample) {
        if let Some(memory) = &mut self.memory {
            memory.replace(&torque.echo);
        }
        if let Some(sent) = &mut self.sent {
            sent.replace(&torque.torque);
        }
    }

    fn history(&self) -> History {
        let Previous { time, velocity } = self.previous;
        let (law, state) = (self.name, self.state);
        let (memory, sent) = (self.memory, self.sent.clone());
        History { law, state, memory, sent, time, velocity: padded(velocity.as_slice()) }
    }
}

/// A sampling instant, s since the run began.
fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 * 1e-9
}
