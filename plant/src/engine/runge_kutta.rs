//! A fixed-step fourth-order Runge–Kutta integrator.

use mtj_model::{
    arm::{
        Arm, Kinematics,
        friction::Friction,
        planar::{Configuration, PlanarArm},
        wall::Wall,
    },
    scenario::{ArmSettings, FrictionSettings, Scenario},
};
use mtj_protocol::sample::{Joints, padded};
use nalgebra::{SMatrix, SVector, Vector2};

use super::{Drive, Engine, State};

/// Everything that is integrated: q, q̇ and the work done.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Integrated<const N: usize> {
    position: SVector<f64, N>,
    velocity: SVector<f64, N>,
    energy: f64,
}

/// Which part of the time in which friction stops a joint a step takes at most.
const HELD_BACK: f64 = 0.5;

/// The arm of a scenario, integrated in equal steps no longer than the integration step.
pub(super) struct RungeKutta<const N: usize> {
    /// Without a load.
    settings: ArmSettings,
    arm: PlanarArm<f64, N>,
    friction: Option<Friction<f64, N>>,
    wall: Option<Wall>,
    state: Integrated<N>,
    disturbance: SVector<f64, N>,
    time_ns: u64,
    step_ns: u64,
}

impl<const N: usize> RungeKutta<N> {
    /// The arm at its initial state.
    pub(super) fn new(scenario: &Scenario) -> Self {
        let arm = &scenario.arm;
        let state = Integrated {
            position: SVector::from_fn(|i, _| arm.position[i]),
            velocity: SVector::from_fn(|i, _| arm.velocity[i]),
            energy: 0.0,
        };
        let friction = arm.friction.as_ref().map(FrictionSettings::build);
        Self {
            settings: arm.clone(),
            arm: arm.build(),
            friction,
            wall: scenario.wall,
            state,
            disturbance: SVector::zeros(),
            time_ns: 0,
            step_ns: scenario.timing.integration_step.as_nanos() as u64,
        }
    }

    /// The state's rate of change.
    fn rate(&self, state: &Integrated<N>, drive: &Drive, time: f64) -> Integrated<N> {
        let torque = SVector::from_fn(|i, _| drive.torque(i, state.velocity[i], time));
        let at = Configuration::new(&state.position, &state.velocity);
        let mut all = torque + self.disturbance;
        if let Some(friction) = &self.friction {
            all += friction.torque(&state.velocity);
        }
        if let Some(wall) = &self.wall {
            all += self.contact(wall, &at);
        }
        Integrated {
            position: state.velocity,
            velocity: self.arm.acceleration(&at, &all),
            energy: torque.component_mul(&state.velocity).abs().sum(),
        }
    }

    /// The torques of a wall on the joints, N m.
    fn contact(&self, wall: &Wall, at: &Configuration<f64, N>) -> SVector<f64, N> {
        let tip: Vector2<f64> = self.arm.tip(at);
        if wall.depth(&tip) <= 0.0 {
            return SVector::zeros();
        }
        let jacobian: SMatrix<f64, 2, N> = self.arm.jacobian(at);
        jacobian.transpose() * wall.force(&tip, &self.arm.tip_velocity(at))
    }

    /// The longest step with which friction is integrated without swinging, s: a part of the time in
    /// which it stops a joint.
    fn longest_step(&self, friction: &Friction<f64, N>) -> f64 {
        let at = Configuration::new(&self.state.position, &self.state.velocity);
        let rest = self.arm.acceleration(&at, &SVector::zeros());
        let steepest = friction.steepest();
        let rates = (0..N).map(|joint| {
            let unit = SVector::from_fn(|i, _| if i == joint { 1.0 } else { 0.0 });
            steepest[joint] * (self.arm.acceleration(&at, &unit) - rest)[joint]
        });
        HELD_BACK / rates.sum::<f64>()
    }

    /// A step of `h` from `time` on, s.
    fn step(&mut self, time: f64, h: f64, drive: &Drive) {
        let start = self.state;
        let (middle, end) = (time + h / 2.0, time + h);
        let k1 = self.rate(&start, drive, time);
        let k2 = self.rate(&start.moved(&k1, h / 2.0), drive, middle);
        let k3 = self.rate(&start.moved(&k2, h / 2.0), drive, middle);
        let k4 = self.rate(&start.moved(&k3, h), drive, end);
        self.state =
            start.moved(&k1, h / 6.0).moved(&k2, h / 3.0).moved(&k3, h / 3.0).moved(&k4, h / 6.0);
    }
}

impl<const N: usize> Integrated<N> {
    fn moved(&self, rate: &Self, h: f64) -> Self {
        Self {
            position: self.position + rate.position * h,
            velocity: self.velocity + rate.velocity * h,
            energy: self.energy + rate.energy * h,
        }
    }
}

impl<const N: usize> Engine for RungeKutta<N> {
    fn advance(&mut self, time_ns: u64, drive: &Drive) {
        let span = time_ns.saturating_sub(self.time_ns);
        if span == 0 {
            return;
        }
        let seconds = span as f64 * 1e-9;
        let mut steps = span.div_ceil(self.step_ns);
        if let Some(friction) = &self.friction {
            steps = steps.max((seconds / self.longest_step(friction)).ceil() as u64);
        }
        let h = seconds / steps as f64;
        let time = self.time_ns as f64 * 1e-9;
        for step in 0..steps {
            self.step(time + step as f64 * h, h, drive);
        }
        self.time_ns = time_ns;
    }

    fn state(&self) -> State {
        State {
            time_ns: self.time_ns,
            position: padded(self.state.position.as_slice()),
            velocity: padded(self.state.velocity.as_slice()),
            energy: self.state.energy,
        }
    }

    fn carry(&mut self, load: f64) {
        self.arm = self.settings.carrying(load).build();
    }

    fn reconfigure(&mut self, scenario: &Scenario) {
        self.friction = scenario.arm.friction.as_ref().map(FrictionSettings::build);
    }

    fn disturb(&mut self, torque: Joints) {
        self.disturbance = SVector::from_fn(|i, _| torque[i]);
    }
}
