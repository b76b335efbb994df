//! The check of a scenario as a whole: keys that are right one by one and cannot work together.

use std::time::Duration;

use nalgebra::SVector;

use super::{Gravity, LinkSettings, Scenario, duration, error::ScenarioError, section::Section};
use crate::{arm::Arm, for_joints, law::Equation, trajectory::Path};

/// How many points of a path are looked at.
const POINTS: u32 = 256;
/// How far a path may leave the workspace before that is no rounding, as a part of the reach.
const MARGIN: f64 = 1e-9;

/// Something that works, though perhaps not as its user expects.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Advice {
    /// The law does not balance gravity.
    #[error(
        "gravity pulls with {torque:.1} N m at joint {joint} and law.kind = \"{law}\" does not balance \
         it: the arm falls before it recovers, if it does; law.gravity = \"model\" balances it"
    )]
    Unbalanced {
        /// The law's name.
        law: &'static str,
        /// The joint with the largest torque, from 1.
        joint: usize,
        /// N m, in the initial configuration.
        torque: f64,
    },
    /// The torque limit cannot carry the arm.
    #[error(
        "gravity pulls with {torque:.1} N m at joint {joint}, more than safety.torque_limit allows \
         there ({limit} N m): the arm falls"
    )]
    Falls {
        /// The joint, from 1.
        joint: usize,
        /// N m, in the initial configuration.
        torque: f64,
        /// N m.
        limit: f64,
    },
}

impl Scenario {
    /// Refuses what cannot work.
    pub(super) fn check(&self, root: &Section<'_>) -> Result<(), ScenarioError> {
        let safety = root.section_or_empty("safety")?;
        if let Some(timeout) = self.safety.command_timeout {
            let [state, torque] = [&self.link.state, &self.link.torque].map(LinkSettings::shortest);
            if let Some(reason) = too_old(timeout, state, torque) {
                return Err(safety.refuse("command_timeout", reason));
            }
            let period = self.timing.sample_period;
            if timeout < period {
                let period = duration::format(period);
                let expected = format!(
                    "at least timing.sample_period, {period}, or the arm is in its safe state between \
                     any two commands"
                );
                return Err(safety.refuse("command_timeout", expected));
            }
        }
        if let Some((joint, key)) =
            self.safety.joint_limits.breach(&self.arm.position, &self.arm.velocity)
        {
            let name = key.rsplit('.').next().unwrap_or(key);
            let expected = format!(
                "a limit that the arm keeps at its start; joint {} is at {} rad and {} rad/s there",
                joint + 1,
                self.arm.position[joint],
                self.arm.velocity[joint]
            );
            return Err(safety.refuse(name, expected));
        }
        self.check_path(root)
    }

    /// Refuses a path that the tip cannot follow, wherever it is.
    fn check_path(&self, root: &Section<'_>) -> Result<(), ScenarioError> {
        let reach = self.arm.reach();
        let longest = self.arm.links.iter().map(|link| link.length).fold(0.0, f64::max);
        // An arm with fewer joints than axes comes as near to its path as it can.
        let is_full = self.arm.links.len() >= self.task.axes.len();
        let closest = if is_full { (2.0 * longest - reach).max(0.0) } else { 0.0 };
        let is_inside = |distance: f64| {
            distance <= reach * (1.0 + MARGIN) && distance >= closest * (1.0 - MARGIN)
        };
        // Most paths lie inside as a whole, and a study checks a million of them.
        let (least, most) = self.trajectory.path.distances();
        if is_inside(least) && is_inside(most) {
            return Ok(());
        }
        for point in 0..=POINTS {
            let time = self.duration.as_secs_f64() * f64::from(point) / f64::from(POINTS);
            let distance = self.trajectory.at::<2>(time).point.norm();
            if !is_inside(distance) {
                let expected = format!(
                    "a path that the arm can reach, {closest:.3} m to {reach:.3} m from its base; at t = \
                     {time:.2} s it is {distance:.3} m away"
                );
                let key = match self.trajectory.path {
                    Path::PointToPoint(_) => "to",
                    Path::Points(_) => "points",
                    _ => "radius",
                };
                return Err(root.section("trajectory")?.refuse(key, expected));
            }
        }
        Ok(())
    }

    /// What the user should know, though it is accepted.
    pub fn advice(&self) -> Vec<Advice> {
        let load = self.gravity_load();
        let largest = load
            .iter()
            .map(|torque| torque.abs())
            .enumerate()
            .max_by(|(_, one), (_, other)| one.total_cmp(other));
        let mut advice = Vec::new();
        if let Some((joint, torque)) = largest
            && torque > 0.0
            && self.law.gravity == Gravity::None
            && !self.law.law.balances_gravity()
        {
            let law = self.law.law.description().name;
            advice.push(Advice::Unbalanced { law, joint: joint + 1, torque });
        }
        let limits = self.safety.torque_limit.iter().flatten();
        for (joint, (torque, limit)) in load.iter().zip(limits).enumerate() {
            if torque.abs() > *limit {
                advice.push(Advice::Falls {
                    joint: joint + 1,
                    torque: torque.abs(),
                    limit: *limit,
                });
            }
        }
        advice
    }

    /// The torques that hold the arm against gravity in its initial configuration, N m.
    fn gravity_load(&self) -> Vec<f64> {
        for_joints!(self.arm.joints(), N => {
            let q = SVector::<f64, N>::from_fn(|i, _| self.arm.position[i]);
            self.arm.build::<N>().gravity(&q).as_slice().to_vec()
        })
    }
}

/// Why no command can be young enough to act: it is as old as both links make it; `None` if one can.
pub fn too_old(timeout: Duration, state: Duration, torque: Duration) -> Option<String> {
    let youngest = state + torque;
    (youngest > timeout).then(|| {
        format!(
            "at least {}: no command can be younger, for its state travels {} (link.state) and itself \
             {} (link.torque)",
            duration::format(youngest),
            duration::format(state),
            duration::format(torque)
        )
    })
}
