//! The part of each command's torque that balances gravity.
//!
//! A controller adds g(q) of its model at the measured configuration. The plant measured that
//! configuration and knows the model from the scenario, so it need not be told: a torque limit scales
//! the rest of the torque alone.

use mtj_model::{arm::Arm, for_joints, matrix::padded, scenario::Scenario};
use mtj_protocol::sample::Joints;
use nalgebra::SVector;

/// For how many samples the torque is kept; an answer to an older one is rejected.
const KEPT: usize = 4096;

/// g(q), N m, from joint positions, rad.
type Gravity = Box<dyn Fn(&Joints) -> Joints + Send>;

/// g(q) at the samples whose commands may be under way.
pub(crate) struct GravityTerms {
    /// `None` where the controller does not balance gravity, or no limit asks for it.
    gravity: Option<Gravity>,
    /// Each at its sample's number modulo their count; none before it is needed.
    kept: Vec<Joints>,
}

impl GravityTerms {
    /// For the commands of a scenario.
    pub(crate) fn new(scenario: &Scenario) -> Self {
        let (law, arm) = (&scenario.law, &scenario.arm);
        let is_needed = law.balances_gravity(arm) && scenario.safety.torque_limit.is_some();
        if !is_needed {
            return Self { gravity: None, kept: Vec::new() };
        }
        let model = arm.scaled(law.mass_scale);
        let gravity: Gravity = for_joints!(arm.joints(), N => {
            let model = model.build::<N>();
            Box::new(move |position: &Joints| {
                let q = SVector::<f64, N>::from_column_slice(&position[..N]);
                padded(model.gravity(&q).as_slice())
            })
        });
        Self { gravity: Some(gravity), kept: vec![[0.0; _]; KEPT] }
    }

    /// Notes the measured joint positions of a sample, rad.
    #[inline(always)]
    pub(crate) fn note(&mut self, sequence: u64, position: &Joints) {
        if let Some(gravity) = &self.gravity {
            self.kept[sequence as usize % KEPT] = gravity(position);
        }
    }

    /// The part of the torque that answers a sample, N m.
    #[inline(always)]
    pub(crate) fn of(&self, sequence: u64) -> Joints {
        match self.gravity {
            Some(_) => self.kept[sequence as usize % KEPT],
            None => [0.0; _],
        }
    }
}
