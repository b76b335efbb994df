//! The loops of all lanes, moved together.

use mtj_controller::{
    prediction::Ahead,
    responder::{Context, Measured, Responder, Response},
};
use mtj_model::{
    MAX_SIGNALS, MAX_STATE,
    arm::{
        Arm, Kinematics,
        planar::{Configuration, PlanarArm},
    },
    lanes::Lanes,
    law::State,
    lift::Lift,
    matrix::{self, padded},
    scenario::{CourseSettings, FrictionSettings},
    task::{Previous, Task},
};
use mtj_plant::{
    course::Course,
    dormand_prince::{DormandPrince, LaneApproach},
    engine::{Approach, Drive},
    sensor::Sensor,
};
use nalgebra::SVector;

use super::{
    Queue,
    lane::{Event, Lane, LawInputs},
};

/// A point of the tip in the lanes.
type Point<T, const N: usize, const M: usize> = <PlanarArm<T, N> as Kinematics<T, N, M>>::Point;

/// The steps between two checks of `proceed`.
const PATIENCE: u32 = 1024;

/// The loops, their arms and their controllers.
pub(crate) struct Batch<'a, 'b, T: Lanes, const N: usize, const M: usize, const E: usize> {
    queue: Queue<'a, 'b>,
    next: usize,
    loops: Vec<Place<'a, N, E>>,
    arms: DormandPrince<T, PlanarArm<T, N>, N>,
    responder: Responder<T, PlanarArm<T, N>, M>,
    previous: Previous<T, M>,
    state: State<T>,
    has_state: bool,
    /// Whether measurements differ from the truth.
    is_imperfect: bool,
    predicts: bool,
    predicts_by_model: bool,
    balances_gravity: bool,
    /// The torques that balance gravity, of the samples that are being answered, N m.
    gravity: SVector<T, N>,
}

/// A lane's place.
#[derive(Default)]
struct Place<'s, const N: usize, const E: usize> {
    lane: Option<Lane<'s, N, E>>,
    /// Whether it is at a sample that is not answered yet.
    is_waiting: bool,
    /// When that sample reaches its controller, ns.
    delivered_ns: Option<u64>,
}

impl<'a, 'b, T: Lanes, const N: usize, const M: usize, const E: usize> Batch<'a, 'b, T, N, M, E> {
    /// Computes everything in a queue.
    #[inline(always)]
    pub(crate) fn compute(queue: Queue<'a, 'b>) {
        let Some(some) = queue.numbers.first().map(|number| &queue.scenarios[*number]) else {
            return;
        };
        let mut batch = Self {
            next: 0,
            loops: (0..T::COUNT).map(|_| Place::default()).collect(),
            arms: DormandPrince::new(
                some.arm.build::<N>().lift::<T, M>(),
                some.arm.friction.as_ref().map(|friction| friction.build::<N>().lift::<T, M>()),
                some.actuator
                    .as_ref()
                    .and_then(|actuator| actuator.course.as_ref())
                    .map(|course| LaneApproach::new(matches!(course, CourseSettings::Ramp(_)))),
            ),
            responder: Responder::of(some).lift::<T, M>(),
            previous: Previous::none(),
            state: [T::zero(); _],
            has_state: some.law.law.description().has_state,
            is_imperfect: Sensor::is_imperfect(some),
            predicts: some.law.prediction.is_some(),
            predicts_by_model: some.law.predicts_by_model(),
            balances_gravity: some.law.balances_gravity(&some.arm),
            gravity: SVector::zeros(),
            queue,
        };
        batch.run();
    }

    #[inline(always)]
    fn run(&mut self) {
        let mut steps = 0;
        self.fill();
        loop {
            let active = self.loops.iter().filter(|place| place.lane.is_some()).count();
            let waiting = self.loops.iter().filter(|place| place.is_waiting).count();
            if active == 0 {
                return;
            }
            // An answer costs about half as much as a step, and all lanes pay for both. So lanes
            // with many steps to do delay the others little.
            if 2 * waiting >= active {
                if self.answer() {
                    self.fill();
                }
                continue;
            }
            self.arms.step();
            let mut has_ended = false;
            for lane in 0..T::COUNT {
                if !self.loops[lane].is_waiting && self.arms.remaining.get(lane) == 0.0 {
                    has_ended |= self.reach(lane);
                }
            }
            if has_ended {
                self.fill();
            }
            steps += 1;
            if steps % PATIENCE == 0 && !(self.queue.proceed)() {
                return;
            }
        }
    }

    /// Fills free lanes with the next runs.
    #[inline(never)]
    fn fill(&mut self) {
        for lane in 0..T::COUNT {
            while self.loops[lane].lane.is_none() {
                let Some(number) = self.queue.numbers.get(self.next).copied() else { break };
                self.next += 1;
                let scenario = &self.queue.scenarios[number];
                match Lane::new(number, scenario) {
                    Err(_) => (self.queue.on_result)(number, None),
                    Ok(new) => {
                        let arm = &scenario.arm;
                        let tolerance = scenario.timing.tolerance.unwrap_or(1.0);
                        self.arms.place(lane, &arm.position, &arm.velocity, tolerance);
                        arm.build::<N>().put::<T, M>(&mut self.arms.arm, lane);
                        let friction = arm.friction.as_ref().map(FrictionSettings::build::<N>);
                        friction.put::<T, M>(&mut self.arms.friction, lane);
                        Responder::of(scenario).put::<T, M>(&mut self.responder, lane);
                        self.previous.time.set(lane, f64::INFINITY);
                        put(&mut self.state, lane, &[0.0; MAX_STATE]);
                        self.loops[lane] =
                            Place { lane: Some(new), is_waiting: true, delivered_ns: None };
                    }
                }
            }
        }
        self.arms.settle();
    }

    /// Handles the event that a lane's arm has reached; returns whether it was the last.
    #[inline(always)]
    fn reach(&mut self, lane: usize) -> bool {
        let velocity = numbers(self.arms.velocity.as_slice(), lane);
        let place = &mut self.loops[lane];
        let Some(this) = &mut place.lane else { return false };
        this.observe(&velocity);
        loop {
            match this.event {
                Event::Sample => {
                    place.is_waiting = true;
                    return false;
                }
                Event::End => break,
                Event::Load => {
                    if let Some(load) = this.take_load() {
                        let arm = this.scenario.arm.carrying(load);
                        arm.build::<N>().put::<T, M>(&mut self.arms.arm, lane);
                    }
                }
                Event::Arrive => {
                    if let Some(drive) = this.arrive() {
                        act(&mut self.arms, lane, &drive);
                    }
                    if this.has_diverged() {
                        break;
                    }
                }
            }
            let span = this.look_ahead();
            if span > 0.0 {
                self.arms.remaining.set(lane, span);
                return false;
            }
        }
        self.end(lane);
        true
    }

    #[inline(never)]
    fn end(&mut self, lane: usize) {
        let energy = self.arms.energy.get(lane);
        let place = &mut self.loops[lane];
        place.is_waiting = false;
        if let Some(mut lane) = place.lane.take() {
            let report = lane.report(energy);
            (self.queue.on_result)(lane.number, Some(report));
        }
        self.arms.remaining.set(lane, 0.0);
    }

    /// Answers all samples that wait for it; returns whether a run has ended.
    #[inline(always)]
    fn answer(&mut self) -> bool {
        let samples = self.take_samples();
        let response = self.respond(&samples);
        let squared_error = self.squared_error(&samples, &response);
        let mut has_ended = false;
        for lane in 0..T::COUNT {
            if self.loops[lane].is_waiting {
                has_ended |= self.go_on(lane, squared_error.get(lane), &response);
            }
        }
        has_ended
    }

    #[inline(always)]
    fn take_samples(&mut self) -> Samples<T, N, E> {
        let (position, velocity) = (self.arms.position, self.arms.velocity);
        let (zero, nothing) = (T::zero(), [T::zero(); E]);
        let (time, horizon, recalled, is_heard) = (zero, zero, nothing, zero);
        let ahead = [position, velocity];
        let mut all = Samples { time, position, velocity, ahead, horizon, recalled, is_heard };
        for lane in 0..T::COUNT {
            let place = &mut self.loops[lane];
            let Some(this) = place.lane.as_mut().filter(|_| place.is_waiting) else { continue };
            all.time.set(lane, this.time_ns as f64 * 1e-9);
            if this.has_diverged() {
                continue;
            }
            let LawInputs { recalled, horizon, delivered_ns } = this.sample();
            if self.is_imperfect {
                let (q, q_dot) = this
                    .sense(numbers(position.as_slice(), lane), numbers(velocity.as_slice(), lane));
                put(all.position.as_mut_slice(), lane, &q);
                put(all.velocity.as_mut_slice(), lane, &q_dot);
            }
            if self.predicts_by_model {
                let [q, q_dot] =
                    [&all.position, &all.velocity].map(|all| numbers(all.as_slice(), lane));
                if let Some(ahead) = this.ahead(horizon, q, q_dot) {
                    put(all.ahead[0].as_mut_slice(), lane, ahead.position.as_slice());
                    put(all.ahead[1].as_mut_slice(), lane, ahead.velocity.as_slice());
                }
            }
            put(&mut all.recalled, lane, &recalled);
            all.horizon.set(lane, horizon);
            all.is_heard.set(lane, if delivered_ns.is_some() { 1.0 } else { 0.0 });
            place.delivered_ns = delivered_ns;
        }
        all
    }

    #[inline(always)]
    fn respond(&mut self, samples: &Samples<T, N, E>) -> Response<T, Point<T, N, M>, N, M> {
        let at = if self.is_imperfect {
            Configuration::new(&samples.position, &samples.velocity)
        } else {
            *self.arms.configuration()
        };
        let echo = padded(&samples.recalled);
        let context = Context {
            previous: self.previous,
            horizon: if self.predicts { Some(samples.horizon) } else { None },
            echo: Some(&echo),
            precomputed: None,
        };
        let mut unseen = [T::zero(); MAX_SIGNALS];
        let [position, velocity] = samples.ahead;
        let ahead = if self.predicts_by_model {
            let at = Configuration::new(&position, &velocity);
            Some(Ahead { position, velocity, at })
        } else {
            None
        };
        let measured = Measured {
            time: samples.time,
            position: &samples.position,
            velocity: &samples.velocity,
            at: &at,
            ahead: ahead.as_ref(),
        };
        let before = self.has_state.then_some(self.state);
        let mut response =
            self.responder.respond(&measured, &context, &mut self.state, &mut unseen);
        if self.balances_gravity {
            self.gravity = self.responder.arm.gravity(&samples.position);
            response.command.torque += self.gravity;
        }
        let heard = |new: T, old: T| T::zero().where_below(samples.is_heard, new, old);
        self.previous.time = heard(response.tip.time, self.previous.time);
        if let Some(before) = before {
            for (new, old) in self.state.iter_mut().zip(before) {
                *new = heard(*new, old);
            }
        }
        for axis in 0..M {
            self.previous.velocity[axis] =
                heard(response.tip.velocity[axis], self.previous.velocity[axis]);
        }
        response
    }

    /// ‖e‖² of the true tracking error, m².
    #[inline(always)]
    fn squared_error(
        &self,
        samples: &Samples<T, N, E>,
        response: &Response<T, Point<T, N, M>, N, M>,
    ) -> T {
        // Without prediction the law has used the same instant.
        let desired = if self.predicts {
            Point::<T, N, M>::desired(&self.responder.trajectory, samples.time).point
        } else {
            response.desired.point
        };
        let tip = self.arms.arm.tip(self.arms.configuration());
        matrix::squared_norm(&Task::difference(&desired, &tip))
    }

    /// Continues a lane from a sample; returns whether it was its last.
    #[inline(always)]
    fn go_on(
        &mut self,
        lane: usize,
        squared_error: f64,
        response: &Response<T, Point<T, N, M>, N, M>,
    ) -> bool {
        let place = &mut self.loops[lane];
        place.is_waiting = false;
        let delivered_ns = place.delivered_ns.take();
        let Some(this) = &mut place.lane else { return false };
        this.note_error(squared_error);
        if this.has_diverged() {
            self.end(lane);
            return true;
        }
        if let Some(delivered_ns) = delivered_ns {
            let torque = numbers(response.command.torque.as_slice(), lane);
            let echo = numbers(&response.command.echo, lane);
            let gravity = numbers(self.gravity.as_slice(), lane);
            if let Some(drive) = this.command(delivered_ns, torque, gravity, echo) {
                act(&mut self.arms, lane, &drive);
            }
        }
        let span = this.look_ahead();
        if span > 0.0 {
            self.arms.remaining.set(lane, span);
            return false;
        }
        self.reach(lane)
    }
}

/// Lets a drive act on the joints of a lane's arm.
#[inline(always)]
fn act<T: Lanes, A: Arm<T, N>, const N: usize>(
    arms: &mut DormandPrince<T, A, N>,
    lane: usize,
    drive: &Drive<N>,
) {
    match drive {
        Drive::Torque(torque) => put(arms.torque.as_mut_slice(), lane, torque),
        Drive::Approach(Approach { from, to, course, .. }) => {
            put(arms.torque.as_mut_slice(), lane, to);
            if let Some(approach) = &mut arms.approach {
                let (Course::Lag(length) | Course::Ramp(length)) = *course;
                approach.set_out(lane, from, length);
            }
        }
        // There are no timeouts in the lanes.
        Drive::Damping { .. } => {}
    }
}

/// The inputs of the controllers; only the lanes that wait have valid ones.
struct Samples<T, const N: usize, const E: usize> {
    /// s.
    time: T,
    /// Measured, rad.
    position: SVector<T, N>,
    /// Measured, rad/s.
    velocity: SVector<T, N>,
    /// The same as the controller's model predicts them for the instant that the law aims at.
    ahead: [SVector<T, N>; 2],
    /// s.
    horizon: T,
    /// The remembered echo.
    recalled: [T; E],
    /// One where the sample reaches its controller, else zero.
    is_heard: T,
}

/// The numbers of one lane; zeros where there are none.
#[inline(always)]
fn numbers<T: Lanes, const N: usize>(all: &[T], lane: usize) -> [f64; N] {
    let mut numbers = [0.0; N];
    for (number, all) in numbers.iter_mut().zip(all.iter()) {
        *number = all.get(lane);
    }
    numbers
}

/// Puts numbers into one lane.
#[inline(always)]
fn put<T: Lanes>(all: &mut [T], lane: usize, numbers: &[f64]) {
    for (all, number) in all.iter_mut().zip(numbers) {
        all.set(lane, *number);
    }
}
