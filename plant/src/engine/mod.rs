//! What the torques move: an engine advances an arm's state in time.
//!
//! Everything else of a plant stands above it and is the same for all engines. To add one is to implement
//! [`Engine`] in a file beside this one and to name it in [`engine`].

mod runge_kutta;

use mtj_model::{MAX_JOINTS, for_links, scenario::Scenario};
use mtj_protocol::sample::Joints;

/// An arm whose state moves forward in time.
pub trait Engine {
    /// Integrates to `time_ns` under `drive`; does nothing if that is past.
    fn advance(&mut self, time_ns: u64, drive: &Drive);
    /// The true state.
    fn state(&self) -> State;
    /// From now on this torque acts beside the drive, N m; it is no part of the energy.
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
    /// τ = −damping q̇ within the joints' limits.
    Damping {
        /// N m s/rad.
        damping: f64,
        /// N m.
        limit: [f64; N],
    },
}

impl<const N: usize> Drive<N> {
    /// Torque on a joint that turns at `rate` rad/s, N m.
    #[inline(always)]
    pub fn torque(&self, joint: usize, rate: f64) -> f64 {
        match self {
            Self::Torque(torque) => torque[joint],
            Self::Damping { damping, limit } => {
                (-damping * rate).clamp(-limit[joint], limit[joint])
            }
        }
    }
}

/// The engine of a scenario, with its arm at the initial state.
pub fn engine(scenario: &Scenario) -> Box<dyn Engine> {
    let step_ns = scenario.timing.integration_step.as_nanos() as u64;
    let arm = &scenario.arm;
    for_links!(arm.links.len(), N => Box::new(runge_kutta::RungeKutta::<N>::new(arm, step_ns)))
}
