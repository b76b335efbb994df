//! The effective masses along a path.

use mtj_model::{
    arm::{self, Arm, Kinematics, planar::Configuration},
    for_axes, for_joints,
    scenario::Scenario,
};
use nalgebra::{DMatrix, SMatrix, SVector};

use crate::{error::StudyError, experiment};

/// The smallest and the largest effective mass, kg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Masses {
    /// The smallest eigenvalue of Ĥ anywhere on the path: what a held damping force stops first.
    pub least: f64,
    /// The largest.
    pub most: f64,
}

/// The effective masses of a scenario's arm along its path, from the second half of a run of it.
///
/// Ĥ = (J H⁻¹ Jᵀ)⁻¹, so that it is there for redundant arms too.
pub(crate) fn masses(
    scenario: &Scenario,
    proceed: &dyn Fn() -> bool,
) -> Result<Masses, StudyError> {
    let run = experiment::run_direct(scenario, true, proceed)?;
    let rows = &run.trace[run.trace.len() / 2..];
    let mut masses = Masses { least: f64::INFINITY, most: 0.0 };
    for row in rows.iter().step_by((rows.len() / 500).max(1)) {
        let (least, most) = for_joints!(scenario.arm.joints(), N => {
            for_axes!(scenario.task, M => eigenvalues::<N, M>(scenario, &row.position))
        });
        masses.least = masses.least.min(least);
        masses.most = masses.most.max(most);
    }
    Ok(masses)
}

fn eigenvalues<const N: usize, const M: usize>(
    scenario: &Scenario,
    position: &[f64],
) -> (f64, f64) {
    let arm = scenario.arm.build::<N>();
    let q = SVector::from_fn(|i, _| position[i]);
    let at = Configuration::new(&q, &SVector::zeros());
    let jacobian: SMatrix<f64, M, N> = arm.jacobian(&at);
    let mobility = arm::mobility(&arm.inertia(&at), &jacobian);
    let mobility = DMatrix::from_fn(M, M, |i, j| mobility[(i, j)]).symmetric_eigenvalues();
    (1.0 / mobility.max(), 1.0 / mobility.min())
}
