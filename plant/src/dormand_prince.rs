//! An integrator of many arms at once, in lanes, whose steps follow from an error bound.
//!
//! The method is the fifth-order one of J. R. Dormand and P. J. Prince (*A family of embedded
//! Runge–Kutta formulae*, J. Comp. Appl. Math. 6, 1980), whose seven rates of change also give a
//! fourth-order result; the difference of the two is the estimated error of a step. Each lane has
//! its own time, its own steps and its own bound.
//!
//! The scalar reference is [`crate::engine`].

use mtj_model::{
    arm::{Arm, friction::Friction},
    lanes::Lanes,
};
use nalgebra::SVector;

/// The longest step, s: longer than any sample period that a loop is closed with.
const LONGEST: f64 = 0.1;
/// The shortest step, s; it is taken whatever its error.
const SHORTEST: f64 = 1e-5;
/// How much a step may grow from one to the next.
const GROWTH: f64 = 4.0;
/// How much of the step that the estimate allows is taken, so that the next one is seldom refused.
const CAUTION: f64 = 0.9;

/// An arm in each lane, integrated to where its next event is.
#[derive(Debug)]
pub struct DormandPrince<T: Lanes, A: Arm<T, N>, const N: usize> {
    /// The arms.
    pub arm: A,
    /// What resists their joints, if anything does.
    pub friction: Option<Friction<T, N>>,
    /// The most that the estimated error of a step may be: Σ over the joints of the errors of q in
    /// rad and of q̇ in rad/s.
    pub tolerance: T,
    /// q, rad.
    pub position: SVector<T, N>,
    /// q̇, rad/s.
    pub velocity: SVector<T, N>,
    /// ∫ Σ|τᵢ q̇ᵢ| dt, J.
    pub energy: T,
    /// τ, held, N m, or where it goes to.
    pub torque: SVector<T, N>,
    /// How it gets there; `None` where it is there at once.
    pub approach: Option<LaneApproach<T, N>>,
    /// How far the next event is, s.
    pub remaining: T,
    /// The step that the last estimate allows, s.
    pub step: T,
    configuration: A::Configuration,
}

impl<T: Lanes, A: Arm<T, N>, const N: usize> DormandPrince<T, A, N> {
    /// Arms that stand still at zero.
    #[inline(always)]
    pub fn new(
        arm: A,
        friction: Option<Friction<T, N>>,
        approach: Option<LaneApproach<T, N>>,
    ) -> Self {
        let zero = SVector::zeros();
        Self {
            arm,
            friction,
            tolerance: T::one(),
            position: zero,
            velocity: zero,
            energy: T::zero(),
            torque: zero,
            approach,
            remaining: T::zero(),
            step: T::constant(LONGEST),
            configuration: A::configuration(&zero, &zero),
        }
    }

    /// Puts the arm of a lane into a state from which a run begins; [`Self::settle`] must follow.
    pub fn place(&mut self, lane: usize, position: &[f64], velocity: &[f64], tolerance: f64) {
        for joint in 0..N {
            self.position[joint].set(lane, position[joint]);
            self.velocity[joint].set(lane, velocity[joint]);
            self.torque[joint].set(lane, 0.0);
        }
        if let Some(approach) = &mut self.approach {
            approach.set_out(lane, &[0.0; N], 1.0);
        }
        self.energy.set(lane, 0.0);
        self.remaining.set(lane, 0.0);
        self.step.set(lane, LONGEST);
        self.tolerance.set(lane, tolerance);
    }

    /// Recomputes the configurations after [`Self::place`].
    #[inline(always)]
    pub fn settle(&mut self) {
        self.configuration = A::configuration(&self.position, &self.velocity);
    }

    /// The configurations of the arms.
    #[inline(always)]
    pub fn configuration(&self) -> &A::Configuration {
        &self.configuration
    }

    /// τ so many seconds from now, N m.
    #[inline(always)]
    fn torque_after(&self, seconds: T) -> SVector<T, N> {
        match &self.approach {
            None => self.torque,
            Some(approach) => self.torque + (approach.from - self.torque) * approach.rest(seconds),
        }
    }

    /// q̈ at joint velocities q̇ so many seconds from now, rad/s². `PLAIN`: without friction and under a
    /// held torque.
    #[inline(always)]
    fn acceleration<const PLAIN: bool>(
        &self,
        at: &A::Configuration,
        velocity: &SVector<T, N>,
        seconds: T,
    ) -> SVector<T, N> {
        if PLAIN {
            return self.arm.acceleration(at, &self.torque);
        }
        let torque = self.torque_after(seconds);
        match &self.friction {
            None => self.arm.acceleration(at, &torque),
            Some(friction) => self.arm.acceleration(at, &(torque + friction.torque(velocity))),
        }
    }

    /// The rate of change a step `h` along a mean rate, at this part of the step, and angles and
    /// configuration there.
    #[inline(always)]
    fn stage<const PLAIN: bool>(
        &self,
        h: T,
        part: f64,
        mean: Rate<T, N>,
    ) -> (Rate<T, N>, SVector<T, N>, A::Configuration) {
        let position = self.position + mean.velocity * h;
        let velocity = self.velocity + mean.acceleration * h;
        let at = A::configuration(&position, &velocity);
        let acceleration = self.acceleration::<PLAIN>(&at, &velocity, h * T::constant(part));
        (Rate { velocity, acceleration }, position, at)
    }

    /// Tries a step towards the next event in every lane that has not reached it. Where the
    /// estimated error is beyond the bound nothing moves, and the next step will be shorter.
    #[inline(always)]
    pub fn step(&mut self) {
        if self.friction.is_none() && self.approach.is_none() {
            self.step_as::<true>();
        } else {
            self.step_as::<false>();
        }
    }

    #[inline(always)]
    fn step_as<const PLAIN: bool>(&mut self) {
        let c = T::constant;
        let steps = (self.remaining / self.step).ceil();
        let steps = steps.where_below(T::one(), T::one(), steps);
        let h = self.remaining / steps;

        let acceleration =
            self.acceleration::<PLAIN>(&self.configuration, &self.velocity, T::zero());
        let start = Rate { velocity: self.velocity, acceleration };
        let k1 = &start;
        let (k2, ..) = &self.stage::<PLAIN>(h, 1.0 / 5.0, sum([(1.0 / 5.0, k1)]));
        let (k3, ..) =
            &self.stage::<PLAIN>(h, 3.0 / 10.0, sum([(3.0 / 40.0, k1), (9.0 / 40.0, k2)]));
        let (k4, ..) = &self.stage::<PLAIN>(
            h,
            4.0 / 5.0,
            sum([(44.0 / 45.0, k1), (-56.0 / 15.0, k2), (32.0 / 9.0, k3)]),
        );
        let (k5, ..) = &self.stage::<PLAIN>(
            h,
            8.0 / 9.0,
            sum([
                (19372.0 / 6561.0, k1),
                (-25360.0 / 2187.0, k2),
                (64448.0 / 6561.0, k3),
                (-212.0 / 729.0, k4),
            ]),
        );
        let (k6, ..) = &self.stage::<PLAIN>(
            h,
            1.0,
            sum([
                (9017.0 / 3168.0, k1),
                (-355.0 / 33.0, k2),
                (46732.0 / 5247.0, k3),
                (49.0 / 176.0, k4),
                (-5103.0 / 18656.0, k5),
            ]),
        );
        // The fifth-order result.
        let (k7, position, configuration) = &self.stage::<PLAIN>(
            h,
            1.0,
            sum([
                (35.0 / 384.0, k1),
                (500.0 / 1113.0, k3),
                (125.0 / 192.0, k4),
                (-2187.0 / 6784.0, k5),
                (11.0 / 84.0, k6),
            ]),
        );
        let velocity = &k7.velocity;
        // How far the fourth-order one is from it.
        let error = sum([
            (71.0 / 57600.0, k1),
            (-71.0 / 16695.0, k3),
            (71.0 / 1920.0, k4),
            (-17253.0 / 339_200.0, k5),
            (22.0 / 525.0, k6),
            (-1.0 / 40.0, k7),
        ]);
        let mut size = T::zero();
        for joint in 0..N {
            size += error.velocity[joint].abs() + error.acceleration[joint].abs();
        }
        size *= h;

        // A step that is so short, or none at all, is taken anyway.
        let bound = h.where_below(c(1.5 * SHORTEST), c(f64::INFINITY), self.tolerance);
        let accept = |new: T, old: T| bound.where_below(size, old, new);
        let mut work = T::zero();
        let ends = if PLAIN { None } else { self.torques_around(h) };
        for joint in 0..N {
            let way = path(
                h,
                position[joint] - self.position[joint],
                self.velocity[joint],
                velocity[joint],
            );
            work += match &ends {
                None => (self.torque[joint] * way).abs(),
                Some(torques) => {
                    let faster = velocity[joint] - self.velocity[joint];
                    done(torques.map(|torque| torque[joint]), way, faster * h)
                }
            };
            self.position[joint] = accept(position[joint], self.position[joint]);
            self.velocity[joint] = accept(velocity[joint], self.velocity[joint]);
        }
        self.configuration = A::combine(configuration, &self.configuration, accept);
        self.energy = accept(self.energy + work, self.energy);
        self.remaining = accept(self.remaining - h, self.remaining);
        if let Some(approach) = &mut self.approach {
            approach.elapsed = accept(approach.elapsed + h, approach.elapsed);
        }
        self.step = T::zero().where_below(h, self.next_step(h, size), self.step);
    }

    /// τ now, in the middle and at the end of the next `h` seconds, N m, where it is not held.
    #[inline(always)]
    fn torques_around(&self, h: T) -> Option<[SVector<T, N>; 3]> {
        self.approach.as_ref()?;
        Some([0.0, 0.5, 1.0].map(|part| self.torque_after(h * T::constant(part))))
    }

    /// The step whose error would be within the bound, from that of a step `h`: the error of the
    /// fourth-order result grows with h⁵. Of its fifth root r^⅕ we take r^¼ to shorten a step and
    /// r^³⁄₁₆ to lengthen it, which are near, on the safe side, and made of square roots. A step
    /// that an event cut short, and whose error says nothing against the longer one before it,
    /// leaves that as it is.
    #[inline(always)]
    fn next_step(&self, h: T, error: T) -> T {
        let c = T::constant;
        let ratio = self.tolerance / (error + c(f64::MIN_POSITIVE));
        let fourth = ratio.sqrt().sqrt();
        let eighth = fourth.sqrt();
        let factor = c(CAUTION) * ratio.where_below(T::one(), fourth, eighth * eighth.sqrt());
        let shortened = h * c(0.1).where_below(factor, factor, c(0.1));
        let most = h * c(GROWTH);
        let kept = most.where_below(self.step, self.step, most);
        let step = factor.where_below(c(GROWTH), shortened, kept);
        let step = step.where_below(c(LONGEST), step, c(LONGEST));
        c(SHORTEST).where_below(step, step, c(SHORTEST))
    }
}

/// How the torques of the lanes get to their commands; see [`crate::course::Course`].
#[derive(Clone, Copy, Debug)]
pub struct LaneApproach<T, const N: usize> {
    /// N m.
    from: SVector<T, N>,
    /// Since they set out, s.
    elapsed: T,
    /// The time constant of a lag, or how long a ramp takes, s.
    length: T,
    is_ramp: bool,
}

impl<T: Lanes, const N: usize> LaneApproach<T, N> {
    /// Torques at rest at zero, whose courses are ramps or lags.
    pub fn new(is_ramp: bool) -> Self {
        Self { from: SVector::zeros(), elapsed: T::zero(), length: T::one(), is_ramp }
    }

    /// Lets the torque of a lane set out from where it is.
    pub fn set_out(&mut self, lane: usize, from: &[f64; N], length: f64) {
        for (all, from) in self.from.iter_mut().zip(from) {
            all.set(lane, *from);
        }
        self.elapsed.set(lane, 0.0);
        self.length.set(lane, length);
    }

    /// How much of the way is left so many seconds from now.
    #[inline(always)]
    fn rest(&self, seconds: T) -> T {
        let elapsed = self.elapsed + seconds;
        if self.is_ramp {
            elapsed.where_below(self.length, T::one() - elapsed / self.length, T::zero())
        } else {
            (-(elapsed / self.length)).exp()
        }
    }
}

/// A rate of change of the state.
struct Rate<T, const N: usize> {
    /// q̇, rad/s.
    velocity: SVector<T, N>,
    /// q̈, rad/s².
    acceleration: SVector<T, N>,
}

/// ∫|τ q̇| dt over a step of one joint, J, from the torque at its beginning, middle and end, the way that
/// it turned, and the change of its speed times the step: Simpson's rule for the mean of τ, and what a
/// torque and a speed that change together add. Where τ changes its sign, it is taken as a straight line
/// and the speed as constant.
#[inline(always)]
fn done<T: Lanes>([first, middle, last]: [T; 3], way: T, faster: T) -> T {
    let c = T::constant;
    let mean = (first + middle * c(4.0) + last) * c(1.0 / 6.0);
    let one_way = (mean * way + (last - first) * faster * c(1.0 / 12.0)).abs();
    let size = first.abs() + last.abs() + c(f64::MIN_POSITIVE);
    let turned = way * (first * first + last * last) / (size + size);
    (first * last).where_below(T::zero(), turned, one_way)
}

/// ∫|q̇| dt over a step of one joint, rad, from the angle Δq it turned and its speeds at both ends.
///
/// That is |Δq| where it turned one way. Where it turned back, the motion is taken as the cubic
/// through both ends: its speed is v₀ + b s + a s² with s from 0 to 1, and the turning point its
/// zero.
#[inline(always)]
fn path<T: Lanes>(h: T, turned: T, v0: T, v1: T) -> T {
    let c = T::constant;
    let one_way = turned.abs();
    // Turning points are rare, and a lane's result does not depend on those of other lanes.
    if !(v0 * v1).is_any_below(T::zero()) {
        return one_way;
    }
    let mean = turned / h;
    // Mirrored so that it sets out forwards.
    let forwards = |x: T| v0.where_below(T::zero(), -x, x);
    let (first, last, mean) = (forwards(v0), forwards(v1), forwards(mean));
    let b = c(6.0) * mean - c(4.0) * first - c(2.0) * last;
    let a = c(3.0) * (first + last) - c(6.0) * mean;
    let discriminant = b * b - c(4.0) * a * first;
    let s = (first + first) / (discriminant.sqrt() - b);
    let out = h * s * (first + s * (c(0.5) * b + s * (a * c(1.0 / 3.0))));
    let there_and_back = out + (out - forwards(turned)).abs();
    // Only where there is such a point.
    let turns_back = last.where_below(T::zero(), there_and_back, one_way);
    T::zero().where_below(first, turns_back, one_way)
}

/// Σ weightᵢ kᵢ
#[inline(always)]
fn sum<T: Lanes, const N: usize, const K: usize>(terms: [(f64, &Rate<T, N>); K]) -> Rate<T, N> {
    let zero = SVector::zeros();
    let mut sum = Rate { velocity: zero, acceleration: zero };
    for joint in 0..N {
        for (i, (weight, rate)) in terms.iter().enumerate() {
            let weight = T::constant(*weight);
            let (velocity, acceleration) =
                (rate.velocity[joint] * weight, rate.acceleration[joint] * weight);
            if i == 0 {
                (sum.velocity[joint], sum.acceleration[joint]) = (velocity, acceleration);
            } else {
                sum.velocity[joint] += velocity;
                sum.acceleration[joint] += acceleration;
            }
        }
    }
    sum
}
