//! From a configuration to a command: the part of a controller without memory.

use mtj_model::{
    MAX_AXES,
    arm::{Kinematics, planar::PlanarArm},
    law::{Command, Echo, Equation, Law, Signals, Situation, State},
    lift,
    scalar::Scalar,
    scenario::Scenario,
    task::{Previous, Task, Tip, TrackingError},
    trajectory::{Motion, Trajectory},
};

use nalgebra::SVector;

use crate::prediction::{self, Ahead};

/// What a controller knows of arm and task, and its law.
///
/// It is generic over the number, so that many loops can be answered at once, each in its lane, and
/// over the law `L`, so that a program can bring its own.
#[derive(Clone, Copy, Debug)]
pub struct Responder<T, A, const M: usize, L = Law<T, M>> {
    /// The arm's geometry, and its mass properties as far as the model knows them.
    pub arm: A,
    /// What the tip should do.
    pub trajectory: Trajectory<T>,
    /// What to do about it.
    pub law: L,
}

lift! { struct Responder<T, A, M> { arm, trajectory, law } }

/// An arm with `N` joints as it was measured.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a, T, C, const N: usize> {
    /// When, s.
    pub time: T,
    /// q, rad.
    pub position: &'a SVector<T, N>,
    /// q̇, rad/s.
    pub velocity: &'a SVector<T, N>,
    /// The configuration there.
    pub at: &'a C,
    /// The same at the instant that the law aims at, if a model of the arm has said it.
    pub ahead: Option<&'a Ahead<T, C, N>>,
}

/// What an answer needs besides the measured configuration.
#[derive(Clone, Copy, Debug)]
pub struct Context<'a, T, P, const M: usize> {
    /// The tip at the sample before.
    pub previous: Previous<T, M>,
    /// How far ahead to aim, s; `None` for not at all.
    pub horizon: Option<T>,
    /// The echo that the memory holds; `None` at the first sample.
    pub echo: Option<&'a Echo<T>>,
    /// The desired motion at an instant, s, for which it was computed before.
    pub precomputed: Option<(T, Motion<T, P, M>)>,
}

/// An answer, with the desired motion and the tracking error that it is based on.
#[derive(Clone, Copy, Debug)]
pub struct Response<T, P, const N: usize, const M: usize> {
    /// What the law answers.
    pub command: Command<T, N>,
    /// The desired motion at the instant that the law aims at.
    pub desired: Motion<T, P, M>,
    /// e and ė there.
    pub error: TrackingError<T, M>,
    /// The tip as measured, to be the previous one next time.
    pub tip: Tip<T, P, M>,
}

impl<const N: usize> Responder<f64, PlanarArm<f64, N>, MAX_AXES> {
    /// What a scenario's controller is made of.
    pub fn of(scenario: &Scenario) -> Self {
        Self::with_law(scenario, scenario.law.law)
    }
}

impl<const N: usize, const M: usize, L> Responder<f64, PlanarArm<f64, N>, M, L> {
    /// A scenario's arm and trajectory with another law.
    pub fn with_law(scenario: &Scenario, law: L) -> Self {
        Self {
            arm: scenario.arm.scaled(scenario.law.mass_scale).build(),
            trajectory: scenario.trajectory,
            law,
        }
    }
}

impl<T: Scalar, A, const M: usize, L: Equation<T, M>> Responder<T, A, M, L> {
    /// The law's answer to what was measured, and its signals. Brings the law's state up to it.
    #[inline(always)]
    pub fn respond<const N: usize>(
        &self,
        measured: &Measured<'_, T, A::Configuration, N>,
        context: &Context<'_, T, A::Point, M>,
        state: &mut State<T>,
        signals: &mut Signals<T>,
    ) -> Response<T, A::Point, N, M>
    where
        A: Kinematics<T, N, M>,
    {
        let Measured { time, position, velocity, at, ahead } = *measured;
        let tip = Tip { time, point: self.arm.tip(at), velocity: self.arm.tip_velocity(at) };
        let acceleration = tip.acceleration_since(&context.previous);
        let aim = match (context.horizon, ahead) {
            (None, _) => tip,
            (Some(horizon), None) => prediction::ahead(&tip, horizon, &acceleration),
            (Some(horizon), Some(Ahead { at, .. })) => Tip {
                time: time + horizon,
                point: self.arm.tip(at),
                velocity: self.arm.tip_velocity(at),
            },
        };
        let (position, velocity, at) = match ahead {
            None => (position, velocity, at),
            Some(ahead) => (&ahead.position, &ahead.velocity, &ahead.at),
        };
        let desired = match context.precomputed {
            Some((time, motion)) if time == aim.time => motion,
            _ => A::Point::desired(&self.trajectory, aim.time),
        };
        let error = TrackingError::between(&desired, &aim);
        let now = Situation {
            arm: &self.arm,
            position,
            velocity,
            at,
            desired: &desired,
            error: &error,
            acceleration: &acceleration,
            interval: tip.interval_since(&context.previous),
            memory: context.echo,
        };
        let command = self.law.command(&now, state, signals);
        Response { command, desired, error, tip }
    }
}
