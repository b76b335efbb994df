//! The limits on K_d and latency by theory.

use mtj_model::{
    arm::{Kinematics, planar::Configuration},
    for_axes, for_joints,
    gains::Gains,
    law::{Law, factor::Factor, mass::Mass, mtj::ModifiedTransposeJacobian, tj::TransposeJacobian},
    scenario::{Override, Scenario},
    task::{Tip, TrackingError},
};
use nalgebra::{SMatrix, SVector};

use super::{
    Latency, LatencySource, Wanted,
    reason::{GainLimit, HELD_DAMPING, Problem, Rejected},
    trial,
    values::{Remedy, THRESHOLDS, Values, round_down},
    verify,
};
use crate::{
    error::StudyError,
    predict::{TRUST, linear::LinearLoop, path},
};

/// The least K_d that is tried, over the largest that is allowed.
const LEAST_GAIN: f64 = 1e-3;
/// Initial errors are taken to be no smaller than this, m.
const SMALLEST_ERROR: f64 = 0.01;

/// The properties of an arm and its motion on which the limits depend.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ArmProperties {
    /// The smallest and largest effective mass, kg.
    pub masses: path::Masses,
    /// T_s, s.
    pub period: f64,
    /// ‖e‖ at the start, m.
    pub initial_error: f64,
    /// |Jᵀ (ė + e/τ)| at the start: the first command's torque for K_d = 1.
    pub first_torque: Vec<f64>,
    /// Peak torque that the motion itself needs after the transient, N m.
    pub motion_torque: Vec<f64>,
    /// Whether the motion's torque is from the model-based law, and so no other law's fault.
    pub motion_is_exact: bool,
}

/// The largest K_d that theory allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bound {
    /// N s/m.
    pub kd: f64,
    /// The limit that it comes from.
    pub limit: GainLimit,
}

impl Bound {
    /// The limit on a K_d that was chosen below this bound.
    pub(crate) fn limit_of(&self, kd: f64) -> GainLimit {
        let most = round_down(self.kd);
        if kd < most { GainLimit::Search { most } } else { self.limit }
    }
}

/// The torque that the motion takes: peaks over the whole run and over its second half. By the
/// model-based law where the arm has one, else by the scenario's own; without latency.
pub fn motion(
    scenario: &Scenario,
    proceed: &dyn Fn() -> bool,
) -> Result<verify::Verification, StudyError> {
    let none = Wanted {
        time_constant_s: 1.0,
        torque_limit_nm: Vec::new(),
        latency: Latency::constant(0.0),
        latency_source: LatencySource::Given,
    };
    let mut set = Vec::new();
    if scenario.arm.links.len() == scenario.task.axes.len() {
        set.extend([
            Override::text("law.kind", "mb"),
            Override::value("law.kp", 25.0.into()),
            Override::value("law.kd", 10.0.into()),
        ]);
    }
    verify::run(&[trial(scenario, &none, 0.0, &set)?], proceed)
}

impl ArmProperties {
    /// The properties of a scenario's arm, for some requirements.
    pub(crate) fn of(
        scenario: &Scenario,
        wanted: &Wanted,
        proceed: &dyn Fn() -> bool,
    ) -> Result<Self, StudyError> {
        let still = trial(scenario, wanted, 0.0, &[])?;
        let masses = path::masses(&still, proceed)?;
        let motion = motion(scenario, proceed)?;
        let tau = wanted.time_constant_s;
        let (initial_error, first_torque) = for_joints!(scenario.arm.joints(), N => {
            for_axes!(scenario.task, M => start::<N, M>(scenario, tau))
        });
        Ok(Self {
            masses,
            period: scenario.timing.sample_period.as_secs_f64(),
            initial_error: initial_error.max(SMALLEST_ERROR),
            first_torque,
            motion_torque: motion.settled_torque_nm,
            motion_is_exact: scenario.arm.links.len() == scenario.task.axes.len(),
        })
    }

    /// Rejects a torque limit that the motion alone exceeds under every law.
    pub(crate) fn check_motion(&self, wanted: &Wanted) -> Result<(), StudyError> {
        if !self.motion_is_exact {
            return Ok(());
        }
        let pairs = self.motion_torque.iter().zip(&wanted.torque_limit_nm);
        for (joint, (needed, limit)) in (1..).zip(pairs) {
            if needed > limit {
                return Err(StudyError::TorqueLimit { joint, needed: *needed, limit: *limit });
            }
        }
        Ok(())
    }

    /// The largest K_d by held damping and by the first command's torque.
    pub(crate) fn gain_limit(&self, wanted: &Wanted) -> Bound {
        let least_mass = self.masses.least;
        let kd = HELD_DAMPING * least_mass / self.period;
        let mut bound = Bound { kd, limit: GainLimit::HeldDamping { least_mass } };
        let pairs = self.first_torque.iter().zip(&wanted.torque_limit_nm);
        for (joint, (unit, limit)) in (1..).zip(pairs) {
            if unit * bound.kd > *limit {
                let (kd, limit) = (limit / unit, *limit);
                bound = Bound { kd, limit: GainLimit::FirstTorque { joint, limit } };
            }
        }
        bound
    }

    /// The loop on one mass at the latency with its margin.
    fn linear(&self, kd: f64, mass: f64, k: f64, remedy: Remedy, wanted: &Wanted) -> LinearLoop<1> {
        let gain = |gain| Gains::Diagonal(SVector::repeat(gain));
        let tj = TransposeJacobian { kp: gain(kd / wanted.time_constant_s), kd: gain(kd) };
        let acceleration = remedy.mass.map(|mass| Mass::Constant(gain(mass)));
        let factor = Factor::constant(k);
        LinearLoop {
            law: Law::Mtj(ModifiedTransposeJacobian { tj, factor, acceleration }),
            mass,
            model_mass: mass,
            period: self.period,
            latency: wanted.latency.with_margin_s(),
            memory: remedy.policy,
            predicts: remedy.predicts,
        }
    }

    /// k at which the linear loop is judged: [`TRUST`], or with a short time constant what leaves
    /// twice the 1 − k = T_s/τ that the held loop needs even without latency.
    fn trust(&self, wanted: &Wanted) -> f64 {
        TRUST.min(1.0 - 2.0 * self.period / wanted.time_constant_s).max(0.0)
    }

    /// Whether the loop is stable without latency, at the latency and with its margin, on the least
    /// and the largest mass, with the k that an exponential reaches.
    pub(crate) fn stands(&self, kd: f64, remedy: Remedy, wanted: &Wanted) -> bool {
        [self.masses.least, self.masses.most].into_iter().all(|mass| {
            let far = self.linear(kd, mass, self.trust(wanted), remedy, wanted);
            [far.latency, wanted.latency.mean_s, 0.0]
                .into_iter()
                .all(|latency| LinearLoop { latency, ..far }.spectral_radius() < 1.0)
        })
    }

    /// The largest K_d, up to a bound, with which a remedy stands the latency; or why none does.
    pub(crate) fn gain_for_remedy(
        &self,
        remedy: Remedy,
        wanted: &Wanted,
        bound: Bound,
    ) -> Result<Bound, Rejected> {
        if self.stands(bound.kd, remedy, wanted) {
            return Ok(bound);
        }
        let mut kd = bound.kd;
        while kd > LEAST_GAIN * bound.kd {
            kd *= 0.97;
            if self.stands(kd, remedy, wanted) {
                let (latency, masses) = (wanted.latency.with_margin_s(), self.masses);
                return Ok(Bound { kd, limit: GainLimit::Latency { latency, masses } });
            }
        }
        let problem = Problem::Unstable {
            kd: bound.kd,
            factor: self.trust(wanted),
            largest: self.largest_latency(bound.kd, remedy, wanted),
            needed: wanted.latency.with_margin_s(),
        };
        Err(Rejected { remedy, kd: None, problem })
    }

    /// The largest latency a remedy stands, over the masses.
    fn largest_latency(&self, kd: f64, remedy: Remedy, wanted: &Wanted) -> Option<f64> {
        let limits = [self.masses.least, self.masses.most].map(|mass| {
            let most = (10.0 * wanted.latency.with_margin_s()).max(0.05);
            self.linear(kd, mass, self.trust(wanted), remedy, wanted).largest_latency(most)
        });
        limits[0].zip(limits[1]).map(|(a, b)| a.min(b))
    }

    /// Why a memory was chosen, by its margin.
    pub(crate) fn explain_memory(&self, values: &Values, wanted: &Wanted) -> String {
        let stands = self
            .largest_latency(values.kd, values.remedy, wanted)
            .map_or("no latency".to_owned(), |latency| format!("{:.3} ms", latency * 1e3));
        let mass = match values.remedy.mass {
            None => String::new(),
            Some(mass) => format!(
                "; M̄ = {mass} kg lies above {:.2} kg, which K_p asks for, and below {:.2} kg, twice the least \
                 effective mass",
                self.masses.most * (self.period + wanted.latency.mean_s) / wanted.time_constant_s,
                2.0 * self.masses.least
            ),
        };
        format!(
            "the linear loop stands {stands}; {:.3} ms are needed{mass}",
            wanted.latency.with_margin_s() * 1e3
        )
    }

    /// 1 − k that the loop needs at the latency with its margin, on the worst mass.
    pub(crate) fn least_leak(&self, values: &Values, wanted: &Wanted) -> f64 {
        let is_stable = |leak: f64| {
            [self.masses.least, self.masses.most].into_iter().all(|mass| {
                self.linear(values.kd, mass, 1.0 - leak, values.remedy, wanted).spectral_radius()
                    < 1.0
            })
        };
        let (mut below, mut above) = (0.0, 1.0);
        if is_stable(below) {
            return 0.0;
        }
        for _ in 0..20 {
            let middle = 0.5 * (below + above);
            if is_stable(middle) { above = middle } else { below = middle }
        }
        above
    }

    /// Why these thresholds.
    pub(crate) fn explain_thresholds(
        &self,
        values: &Values,
        wanted: &Wanted,
        with_margin: &verify::Verification,
    ) -> String {
        let multiple = values.error / self.initial_error;
        let k = (-self.initial_error / values.error).exp();
        let leak = match self.least_leak(values, wanted) {
            0.0 => "the loop needs no 1 - k".to_owned(),
            leak => {
                let floor = leak * values.error;
                // Theory has the worst mass all the time.
                let comment = if floor > with_margin.worst() {
                    " on the worst mass; the simulated error is smaller, because the arm passes that \
                     mass only for a time"
                } else {
                    ""
                };
                format!(
                    "at {:.3} ms the loop needs 1 - k = {leak:.4}, an error floor of about {:.2} mm\
                     {comment}",
                    wanted.latency.with_margin_s() * 1e3,
                    floor * 1e3
                )
            }
        };
        let tried = THRESHOLDS.map(|multiple| multiple.to_string()).join(", ");
        format!(
            "{leak}; k > {k:.2} as soon as the error decays; least rms error of e_max = {tried} x \
             the initial error (here {multiple:.1})"
        )
    }
}

/// ‖e‖ and |Jᵀ (ė + e/τ)| at the start.
fn start<const N: usize, const M: usize>(scenario: &Scenario, tau: f64) -> (f64, Vec<f64>) {
    let arm = scenario.arm.build::<N>();
    let q = SVector::from_fn(|i, _| scenario.arm.position[i]);
    let q_dot = SVector::from_fn(|i, _| scenario.arm.velocity[i]);
    let at = Configuration::new(&q, &q_dot);
    let jacobian: SMatrix<f64, M, N> = arm.jacobian(&at);
    let tip = Tip { time: 0.0, point: arm.tip(&at), velocity: arm.tip_velocity(&at) };
    let error = TrackingError::between(&scenario.trajectory.at::<M>(0.0), &tip);
    let torque = jacobian.transpose() * (error.velocity + error.position / tau);
    (error.position.norm(), torque.iter().map(|t| t.abs()).collect())
}
