//! Prediction: the tip, or the whole arm, at the instant that the torque takes effect.

use std::collections::VecDeque;

use mtj_model::{
    arm::Arm,
    scalar::Scalar,
    scenario::Horizon,
    task::{Task, Tip},
};
use mtj_protocol::sample::{Joints, padded};
use nalgebra::SVector;

/// The tip a horizon d from now, s: x̂ = x ⊕ (d v + ½ d² a) and v̂ = v + d a.
#[inline(always)]
pub fn ahead<T: Scalar, P: Task<T, M>, const M: usize>(
    tip: &Tip<T, P, M>,
    horizon: T,
    acceleration: &SVector<T, M>,
) -> Tip<T, P, M> {
    let half_square = T::constant(0.5) * horizon * horizon;
    Tip {
        time: tip.time + horizon,
        point: tip
            .point
            .integrate(&(tip.velocity * horizon))
            .integrate(&(acceleration * half_square)),
        velocity: tip.velocity + acceleration * horizon,
    }
}

/// How far ahead to aim, in s, when the plant has measured this latency in ns; `None` for not at
/// all.
pub fn horizon(wanted: Option<Horizon>, latency_ns: u64) -> Option<f64> {
    wanted.map(|horizon| match horizon {
        Horizon::Fixed(horizon) => horizon.as_secs_f64(),
        Horizon::Measured => latency_ns as f64 * 1e-9,
    })
}

/// An arm at a later instant than it was measured.
#[derive(Clone, Copy, Debug)]
pub struct Ahead<T, C, const N: usize> {
    /// q, rad.
    pub position: SVector<T, N>,
    /// q̇, rad/s.
    pub velocity: SVector<T, N>,
    /// The configuration there.
    pub at: C,
}

/// The most torques that count as on their way.
const MOST_ON_THEIR_WAY: usize = 1024;
/// Steps of integration while one torque is held: one step of 10 ms would be off by 1e-6 rad.
const STEPS: u32 = 4;

/// The torques that a controller has sent, the oldest first, which tell its model of the arm what the
/// arm will do until the next one takes effect.
///
/// It assumes that each takes effect a horizon after its sample, that none is lost, and that the plant
/// does not limit them. It allocates when it is made and never after.
#[derive(Clone, Debug)]
pub struct SentTorques {
    /// When the state was sampled, ns, and the answer, N m.
    sent: VecDeque<(u64, Joints)>,
}

impl Default for SentTorques {
    fn default() -> Self {
        Self { sent: VecDeque::with_capacity(MOST_ON_THEIR_WAY) }
    }
}

impl SentTorques {
    /// Adds the answer to a state sampled at `time_ns`.
    pub fn store(&mut self, time_ns: u64, torque: &[f64]) {
        if self.sent.len() == MOST_ON_THEIR_WAY {
            self.sent.pop_front();
        }
        self.sent.push_back((time_ns, padded(torque)));
    }

    /// Replaces the answer to the last state.
    pub fn replace(&mut self, torque: &Joints) {
        if let Some((_, last)) = self.sent.back_mut() {
            *last = *torque;
        }
    }

    /// Forgets all: the plant has dropped what was on its way.
    pub fn forget(&mut self) {
        self.sent.clear();
    }

    /// The arm a horizon, s, after it was measured at `time_ns`. Before the first torque takes effect
    /// there is none.
    pub fn ahead<A: Arm<f64, N>, const N: usize>(
        &self,
        arm: &A,
        time_ns: u64,
        horizon: f64,
        position: SVector<f64, N>,
        velocity: SVector<f64, N>,
    ) -> Ahead<f64, A::Configuration, N> {
        let horizon_ns = (horizon * 1e9).round() as u64;
        let arrival = |sent_ns: u64| sent_ns.saturating_add(horizon_ns);
        let has_arrived = |(sent_ns, _): &&(u64, Joints)| arrival(*sent_ns) <= time_ns;
        let on_their_way = self.sent.iter().rev().take_while(|sent| !has_arrived(sent)).count();
        let first = self.sent.len() - on_their_way;
        let mut torque = first.checked_sub(1).map_or([0.0; _], |last| self.sent[last].1);
        let (mut state, mut now_ns) = ((position, velocity), time_ns);
        for (sent_ns, next) in self.sent.range(first..) {
            let until_ns = arrival(*sent_ns);
            state = held(arm, state, &torque, until_ns - now_ns);
            (torque, now_ns) = (*next, until_ns);
        }
        let left_ns = arrival(time_ns).saturating_sub(now_ns);
        let (position, velocity) = held(arm, state, &torque, left_ns);
        Ahead { position, velocity, at: A::configuration(&position, &velocity) }
    }
}

/// q and q̇ after a torque was held for a time in ns, by the Runge–Kutta method of order four.
fn held<A: Arm<f64, N>, const N: usize>(
    arm: &A,
    (mut position, mut velocity): (SVector<f64, N>, SVector<f64, N>),
    torque: &Joints,
    span_ns: u64,
) -> (SVector<f64, N>, SVector<f64, N>) {
    if span_ns == 0 {
        return (position, velocity);
    }
    let torque = SVector::from_fn(|i, _| torque[i]);
    let acceleration = |q: &SVector<f64, N>, v: &SVector<f64, N>| {
        arm.acceleration(&A::configuration(q, v), &torque)
    };
    let h = span_ns as f64 * 1e-9 / f64::from(STEPS);
    for _ in 0..STEPS {
        let (v1, a1) = (velocity, acceleration(&position, &velocity));
        let v2 = velocity + a1 * (h / 2.0);
        let a2 = acceleration(&(position + v1 * (h / 2.0)), &v2);
        let v3 = velocity + a2 * (h / 2.0);
        let a3 = acceleration(&(position + v2 * (h / 2.0)), &v3);
        let v4 = velocity + a3 * h;
        let a4 = acceleration(&(position + v3 * h), &v4);
        position += (v1 + (v2 + v3) * 2.0 + v4) * (h / 6.0);
        velocity += (a1 + (a2 + a3) * 2.0 + a4) * (h / 6.0);
    }
    (position, velocity)
}
