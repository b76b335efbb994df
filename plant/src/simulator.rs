//! The arm in motion: a fixed-step fourth-order Runge–Kutta integrator between events.

use mtj_model::{
    MAX_JOINTS,
    arm::{
        Arm, Kinematics,
        planar::{Configuration, PlanarArm},
    },
    for_links,
    scenario::{ArmSettings, Scenario},
};
use mtj_protocol::sample::{Joints, padded};
use nalgebra::SVector;

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

/// An arm whose state moves forward in time.
pub trait Simulator {
    /// Integrates to `time_ns` under `drive`, in equal steps no longer than the integration step.
    fn advance(&mut self, time_ns: u64, drive: &Drive);
    /// From now on this torque acts beside the drive, N m; it is no part of the energy.
    fn disturb(&mut self, torque: Joints);
    /// Simulated time, ns since the run began.
    fn time_ns(&self) -> u64;
    /// True joint angles, rad.
    fn position(&self) -> Joints;
    /// True joint velocities, rad/s.
    fn velocity(&self) -> Joints;
    /// ∫ Σ|τᵢ q̇ᵢ| dt so far, J.
    fn energy(&self) -> f64;
    /// True tip position and velocity, m and m/s.
    fn tip(&self) -> (SVector<f64, 2>, SVector<f64, 2>);
    /// Whether the state is still one of a robot: finite and no joint beyond [`RUNAWAY`].
    fn has_diverged(&self) -> bool;
}

/// A joint speed that no arm reaches, rad/s: beyond it a run has diverged.
pub const RUNAWAY: f64 = 1e4;

/// The simulator of a scenario's arm at its initial state.
pub fn simulator(scenario: &Scenario) -> Box<dyn Simulator> {
    let step_ns = scenario.timing.integration_step.as_nanos() as u64;
    let arm = &scenario.arm;
    for_links!(arm.links.len(), N => Box::new(RungeKutta::<N>::new(arm, step_ns)))
}

/// Everything that is integrated: q, q̇ and the work done.
#[derive(Clone, Copy, Debug, PartialEq)]
struct State<const N: usize> {
    position: SVector<f64, N>,
    velocity: SVector<f64, N>,
    energy: f64,
}

struct RungeKutta<const N: usize> {
    arm: PlanarArm<f64, N>,
    state: State<N>,
    disturbance: SVector<f64, N>,
    time_ns: u64,
    step_ns: u64,
}

impl<const N: usize> RungeKutta<N> {
    fn new(arm: &ArmSettings, step_ns: u64) -> Self {
        let state = State {
            position: SVector::from_fn(|i, _| arm.position[i]),
            velocity: SVector::from_fn(|i, _| arm.velocity[i]),
            energy: 0.0,
        };
        Self { arm: arm.build(), state, disturbance: SVector::zeros(), time_ns: 0, step_ns }
    }

    /// The state's rate of change.
    fn rate(&self, state: &State<N>, drive: &Drive) -> State<N> {
        let torque = SVector::from_fn(|i, _| drive.torque(i, state.velocity[i]));
        let all = torque + self.disturbance;
        State {
            position: state.velocity,
            velocity: self
                .arm
                .acceleration(&Configuration::new(&state.position, &state.velocity), &all),
            energy: torque.component_mul(&state.velocity).abs().sum(),
        }
    }

    fn step(&mut self, h: f64, drive: &Drive) {
        let start = self.state;
        let k1 = self.rate(&start, drive);
        let k2 = self.rate(&start.moved(&k1, h / 2.0), drive);
        let k3 = self.rate(&start.moved(&k2, h / 2.0), drive);
        let k4 = self.rate(&start.moved(&k3, h), drive);
        self.state =
            start.moved(&k1, h / 6.0).moved(&k2, h / 3.0).moved(&k3, h / 3.0).moved(&k4, h / 6.0);
    }
}

impl<const N: usize> State<N> {
    fn moved(&self, rate: &Self, h: f64) -> Self {
        Self {
            position: self.position + rate.position * h,
            velocity: self.velocity + rate.velocity * h,
            energy: self.energy + rate.energy * h,
        }
    }
}

impl<const N: usize> Simulator for RungeKutta<N> {
    fn advance(&mut self, time_ns: u64, drive: &Drive) {
        let span = time_ns.saturating_sub(self.time_ns);
        if span == 0 {
            return;
        }
        let steps = span.div_ceil(self.step_ns);
        let h = span as f64 * 1e-9 / steps as f64;
        for _ in 0..steps {
            self.step(h, drive);
        }
        self.time_ns = time_ns;
    }

    fn disturb(&mut self, torque: Joints) {
        self.disturbance = SVector::from_fn(|i, _| torque[i]);
    }

    fn time_ns(&self) -> u64 {
        self.time_ns
    }

    fn position(&self) -> Joints {
        padded::<MAX_JOINTS>(self.state.position.as_slice())
    }

    fn velocity(&self) -> Joints {
        padded::<MAX_JOINTS>(self.state.velocity.as_slice())
    }

    fn energy(&self) -> f64 {
        self.state.energy
    }

    fn tip(&self) -> (SVector<f64, 2>, SVector<f64, 2>) {
        let at = Configuration::new(&self.state.position, &self.state.velocity);
        (self.arm.tip(&at), self.arm.tip_velocity(&at))
    }

    fn has_diverged(&self) -> bool {
        // Written so that a NaN counts as diverged.
        let is_calm = |speed: &f64| speed.abs() < RUNAWAY;
        !self.state.velocity.iter().all(is_calm)
    }
}
