//! Engines: an engine integrates the arm between two events.
//!
//! Everything else of a plant stands above it and is the same for all engines. A program runs an
//! engine of its own with [`crate::plant::run_engine`]; an engine that scenarios can name is a file
//! beside this one and a line in [`engine`].
//!
//! # An engine of one's own
//!
//! Flywheels instead of an arm: I q̈ᵢ = τᵢ + τ_dᵢ, with the inertia I in kg m² and the disturbance
//! τ_d. Under a held torque the motion is a parabola, so no step is needed.
//!
//! ```
//! use mtj_model::scenario::Scenario;
//! use mtj_plant::{
//!     direct::Direct,
//!     engine::{Drive, Engine, State},
//!     plant::{self, Watch},
//! };
//! use mtj_protocol::sample::{Joints, StateSample, TorqueSample};
//!
//! struct Flywheels {
//!     inertia: f64,
//!     state: State,
//!     disturbance: Joints,
//! }
//!
//! impl Engine for Flywheels {
//!     fn advance(&mut self, time_ns: u64, drive: &Drive) {
//!         let State { time_ns: before, position, velocity, energy } = &mut self.state;
//!         let dt = time_ns.saturating_sub(*before) as f64 * 1e-9;
//!         let time = *before as f64 * 1e-9;
//!         for joint in 0..position.len() {
//!             let torque = drive.torque(joint, velocity[joint], time);
//!             let acceleration = (torque + self.disturbance[joint]) / self.inertia;
//!             let turned = (velocity[joint] + 0.5 * acceleration * dt) * dt;
//!             position[joint] += turned;
//!             velocity[joint] += acceleration * dt;
//!             *energy += (torque * turned).abs();
//!         }
//!         *before = time_ns.max(*before);
//!     }
//!
//!     fn state(&self) -> State {
//!         self.state
//!     }
//!
//!     fn disturb(&mut self, torque: Joints) {
//!         self.disturbance = torque;
//!     }
//! }
//!
//! let scenario = Scenario::load("sampled/tj", &["duration=1s".parse()?])?;
//! let state = State { time_ns: 0, position: [0.0; 7], velocity: [0.0; 7], energy: 0.0 };
//! let flywheels = Box::new(Flywheels { inertia: 2.0, state, disturbance: [0.0; 7] });
//!
//! // The controller, a function here: a torque of 3 N m on the first joint.
//! let mut exchange = Direct::new(1, |state: &StateSample| {
//!     let mut torque = TorqueSample { header: state.header.answer(), ..Default::default() };
//!     torque.torque[0] = 3.0;
//!     Ok::<_, std::convert::Infallible>(torque)
//! });
//! let watch = Watch { trace: true, ..Watch::default() };
//! let outcome = plant::run_engine(&scenario, 1, flywheels, &mut exchange, watch, &|| true)?;
//!
//! for row in &outcome.trace {
//!     assert!((row.velocity[0] - 1.5 * row.time).abs() < 1e-9);
//!     assert!((row.position[0] - 0.75 * row.time * row.time).abs() < 1e-9);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod runge_kutta;

use mtj_model::{MAX_JOINTS, for_joints, scenario::Scenario};
use mtj_protocol::sample::Joints;

use crate::course::Course;

/// Integrates an arm's state; times are ns since the run began.
pub trait Engine {
    /// Integrates to `time_ns` under `drive`; does nothing if that is past.
    fn advance(&mut self, time_ns: u64, drive: &Drive);
    /// The true state at the instant that was advanced to.
    fn state(&self) -> State;
    /// Carries a load of this mass at the tip from now on, kg, in place of the one before.
    fn carry(&mut self, _load: f64) {}
    /// Takes what may change in a running loop, like friction, from a changed scenario.
    fn reconfigure(&mut self, _: &Scenario) {}
    /// Adds a disturbance torque, N m, to the drive from now on; its work is no part of the energy.
    fn disturb(&mut self, torque: Joints);
}

/// The true state of an arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// ns since the run began.
    pub time_ns: u64,
    /// q, rad.
    pub position: Joints,
    /// q̇, rad/s.
    pub velocity: Joints,
    /// ∫ Σ|τᵢ q̇ᵢ| dt of the drive so far, J.
    pub energy: f64,
}

/// What acts on the joints between two events.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive<const N: usize = MAX_JOINTS> {
    /// A held torque, N m.
    Torque([f64; N]),
    /// A torque on its way to what was commanded.
    Approach(Approach<N>),
    /// τ = −damping q̇ within the joints' limits.
    Damping {
        /// N m s/rad.
        damping: f64,
        /// N m.
        limit: [f64; N],
    },
}

/// A torque on its way to what was commanded: `to` + (`from` − `to`) · rest of the course.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach<const N: usize> {
    /// N m.
    pub from: [f64; N],
    /// N m.
    pub to: [f64; N],
    /// When it set out, ns since the run began.
    pub since_ns: u64,
    /// How it gets there.
    pub course: Course,
}

impl<const N: usize> Approach<N> {
    /// How much of the way is left at `time`, s since the run began.
    #[inline(always)]
    pub fn rest(&self, time: f64) -> f64 {
        self.course.rest((time - self.since_ns as f64 * 1e-9).max(0.0))
    }
}

impl<const N: usize> Drive<N> {
    /// Torque at `time`, s since the run began, on a joint that turns at `rate` rad/s, N m.
    #[inline(always)]
    pub fn torque(&self, joint: usize, rate: f64, time: f64) -> f64 {
        match self {
            Self::Torque(torque) => torque[joint],
            Self::Approach(approach) => {
                let Approach { from, to, .. } = approach;
                to[joint] + (from[joint] - to[joint]) * approach.rest(time)
            }
            Self::Damping { damping, limit } => {
                (-damping * rate).clamp(-limit[joint], limit[joint])
            }
        }
    }
}

/// The engine of a scenario, with its arm at the initial state.
pub fn engine(scenario: &Scenario) -> Box<dyn Engine> {
    for_joints!(scenario.arm.joints(), N => Box::new(runge_kutta::RungeKutta::<N>::new(scenario)))
}
