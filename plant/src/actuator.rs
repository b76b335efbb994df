//! The actuator: holds the newest torque and its echo until the next command (zero-order hold).

use std::collections::VecDeque;

use mtj_model::{
    MAX_ECHO, MAX_JOINTS,
    scenario::{CourseSettings, OnTimeout, Scenario},
};
use mtj_protocol::sample::{Joints, TorqueSample};

use crate::{
    course::Course,
    durations::nanoseconds,
    engine::{Approach, Drive},
};

/// A torque with its echo, on its way to the arm or in effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command<const N: usize = MAX_JOINTS, const E: usize = MAX_ECHO> {
    /// Number of the sample that it answers.
    pub sequence: u64,
    /// When that sample was taken, ns.
    pub sampled_ns: u64,
    /// N m.
    pub torque: [f64; N],
    /// The part of it that balances gravity, N m.
    pub gravity: [f64; N],
    /// The law's echo: held with the torque, and scaled with it.
    pub echo: [f64; E],
    /// How many numbers the echo has.
    pub echo_count: u64,
}

impl Command {
    /// The command of a torque sample, of which this part balances gravity, N m.
    pub fn of(sample: &TorqueSample, gravity: Joints) -> Self {
        let TorqueSample { header, torque, echo, echo_count, .. } = *sample;
        let (sequence, sampled_ns) = (header.sequence, header.time_ns);
        Self { sequence, sampled_ns, torque, gravity, echo, echo_count }
    }
}

/// Holds the last command, of `N` joints and an echo of `E` numbers, and integrates the echo over
/// time.
#[derive(Clone, Debug)]
pub struct Actuator<const N: usize = MAX_JOINTS, const E: usize = MAX_ECHO> {
    limit: [f64; N],
    /// How fast the torque of a joint may change, N m/s.
    rate_limit: Option<[f64; N]>,
    period_ns: u64,
    /// When the newest command took effect, ns.
    applied_ns: u64,
    on_timeout: OnTimeout,
    /// Whether torques are at their commands at once, and exactly.
    is_perfect: bool,
    /// How torques get to their commands; `None` for at once.
    course: Option<CourseSettings>,
    /// N m; zeros for exact torques.
    resolution: [f64; N],
    drive: Drive<N>,
    /// The part of the drive's torque that balances gravity, N m.
    gravity: [f64; N],
    /// The echo of the torque that was commanded, scaled with it.
    echo: [f64; E],
    /// The echo in effect when it was commanded, from which it takes the same course as the torque.
    echo_from: [f64; E],
    /// The integral of the echo up to `integrated_ns`.
    impulse: [f64; E],
    integrated_ns: u64,
    /// The impulse at the last sampling instants, back to the one at which a memory step began.
    history: VecDeque<(u64, [f64; E])>,
    /// How many numbers the echo in effect has.
    echo_count: u64,
    newest: Option<u64>,
    latency_ns: u64,
    has_timed_out: bool,
}

impl<const N: usize, const E: usize> Actuator<N, E> {
    /// An actuator without torque and echo.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            limit: limits(scenario),
            rate_limit: rate_limits(scenario),
            period_ns: nanoseconds(scenario.timing.sample_period),
            applied_ns: 0,
            on_timeout: scenario.safety.on_timeout,
            is_perfect: scenario.actuator.is_none(),
            course: course(scenario),
            resolution: resolution(scenario),
            drive: Drive::Torque([0.0; _]),
            gravity: [0.0; _],
            echo: [0.0; _],
            echo_from: [0.0; _],
            impulse: [0.0; _],
            integrated_ns: 0,
            history: VecDeque::with_capacity(memory_samples(scenario)),
            echo_count: 0,
            newest: None,
            latency_ns: 0,
            has_timed_out: false,
        }
    }

    /// Takes limits, reaction to a timeout and memory step from a changed scenario. They act at
    /// `time_ns`, at joint velocities `velocity`, on the torque that is held and on a timeout that is
    /// in effect.
    pub fn reconfigure(&mut self, scenario: &Scenario, time_ns: u64, velocity: &[f64; N]) {
        self.integrate(time_ns);
        self.limit = limits(scenario);
        self.rate_limit = rate_limits(scenario);
        self.period_ns = nanoseconds(scenario.timing.sample_period);
        self.on_timeout = scenario.safety.on_timeout;
        self.is_perfect = scenario.actuator.is_none();
        self.course = course(scenario);
        self.resolution = resolution(scenario);
        if self.has_timed_out {
            // What a brake exerts now is what may be held from now on.
            let (torque, echo) = (self.torque(time_ns, velocity), self.applied(time_ns));
            (self.drive, self.echo) = (Drive::Torque(torque), echo);
            self.enter_safe_state(time_ns, velocity);
        }
        match self.drive {
            Drive::Torque(torque) => {
                let (torque, echo) = self.limited(&torque, &self.gravity, &self.echo);
                (self.drive, self.echo) = (Drive::Torque(torque), echo);
            }
            // The limits act at once, whatever the actuators can.
            Drive::Approach(approach) => {
                let now = self.torque(time_ns, velocity);
                let (from, echo_from) = self.limited(&now, &self.gravity, &self.applied(time_ns));
                let (to, echo) = self.limited(&approach.to, &self.gravity, &self.echo);
                self.set_out(from, echo_from, to, echo, time_ns);
            }
            Drive::Damping { .. } => {}
        }
        // Here, between two samples, rather than in the loop.
        self.history.reserve(memory_samples(scenario));
    }

    /// Puts a command into effect at `time_ns` and at joint velocities `velocity`, unless a newer one
    /// is in effect already.
    ///
    /// A torque over a joint's limit is scaled down with all others and with the echo: the
    /// direction at the tip stays, and what is echoed is what was in effect. One that changes by
    /// more than the rate limit allows since the command before, though for no longer than a sample
    /// period, goes a part of the way from what acts now, on all joints the same part, and so does
    /// the echo.
    #[inline(always)]
    pub fn apply(&mut self, command: &Command<N, E>, time_ns: u64, velocity: &[f64; N]) -> bool {
        let Command { sequence, sampled_ns, torque, gravity, echo, echo_count } = command;
        if self.newest.is_some_and(|newest| *sequence <= newest) {
            return false;
        }
        self.integrate(time_ns);
        let is_first = self.newest.replace(*sequence).is_none();
        self.latency_ns = time_ns.saturating_sub(*sampled_ns);
        let (mut torque, mut echo) = self.limited(torque, gravity, echo);
        if let Some(rates) = &self.rate_limit {
            let from = self.torque(time_ns, velocity);
            // What came before the first command changed nothing for a period at least.
            let since_ns =
                if is_first { u64::MAX } else { time_ns.saturating_sub(self.applied_ns) };
            let seconds = since_ns.min(self.period_ns) as f64 * 1e-9;
            let part = part_of_step(&from, &torque, rates, seconds);
            for (to, from) in torque.iter_mut().zip(&from) {
                *to = from + (*to - from) * part;
            }
            for (to, from) in echo.iter_mut().zip(&self.applied(time_ns)) {
                *to = from + (*to - from) * part;
            }
        }
        self.gravity = *gravity;
        if self.is_perfect {
            (self.drive, self.echo) = (Drive::Torque(torque), echo);
        } else {
            self.set_out_imperfectly(torque, echo, time_ns, velocity);
        }
        self.echo_count = *echo_count;
        self.applied_ns = time_ns;
        self.has_timed_out = false;
        true
    }

    /// Lets torque and echo set out from what they are now, rounded as the actuators do.
    #[inline(never)]
    fn set_out_imperfectly(
        &mut self,
        torque: [f64; N],
        echo: [f64; E],
        time_ns: u64,
        velocity: &[f64; N],
    ) {
        let mut to = torque;
        for (joint, torque) in to.iter_mut().enumerate() {
            *torque = self.rounded(joint, *torque);
        }
        let from = self.torque(time_ns, velocity);
        self.set_out(from, self.applied(time_ns), to, echo, time_ns);
    }

    /// Lets torque and echo take their course from one value to another, from `time_ns` on.
    #[inline(always)]
    fn set_out(
        &mut self,
        from: [f64; N],
        echo_from: [f64; E],
        to: [f64; N],
        echo: [f64; E],
        time_ns: u64,
    ) {
        self.drive = match &self.course {
            None => Drive::Torque(to),
            Some(course) => {
                let course = match course {
                    CourseSettings::Lag(constant) => Course::Lag(constant.as_secs_f64()),
                    CourseSettings::Ramp(rates) => {
                        let steps = from.iter().zip(&to).map(|(from, to)| (to - from).abs());
                        let times = steps.zip(rates).map(|(step, rate)| step / rate);
                        Course::Ramp(times.fold(0.0, f64::max))
                    }
                };
                Drive::Approach(Approach { from, to, since_ns: time_ns, course })
            }
        };
        (self.echo, self.echo_from) = (echo, echo_from);
    }

    /// The nearest torque that the actuator of a joint can exert within its limit, N m.
    #[inline(always)]
    fn rounded(&self, joint: usize, torque: f64) -> f64 {
        let step = self.resolution[joint];
        if step == 0.0 {
            return torque;
        }
        let nearest = (torque / step).round() * step;
        if nearest.abs() > self.limit[joint] { (torque / step).trunc() * step } else { nearest }
    }

    /// A torque and its echo within the limits. What balances gravity is not scaled, as long as it
    /// is within them itself.
    #[inline(always)]
    fn limited(
        &self,
        torque: &[f64; N],
        gravity: &[f64; N],
        echo: &[f64; E],
    ) -> ([f64; N], [f64; E]) {
        let fits = gravity.iter().zip(&self.limit).all(|(part, limit)| part.abs() < *limit);
        let kept = |joint: usize| if fits { gravity[joint] } else { 0.0 };
        let mut scale = 1.0;
        for (joint, (torque, limit)) in torque.iter().zip(&self.limit).enumerate() {
            let rest = torque - kept(joint);
            let room = limit - kept(joint) * rest.signum();
            scale = f64::min(scale, room / rest.abs());
        }
        let mut held = [0.0; N];
        for (joint, (held, torque)) in held.iter_mut().zip(torque).enumerate() {
            let (kept, limit) = (kept(joint), self.limit[joint]);
            let scaled = if kept == 0.0 { torque * scale } else { kept + (torque - kept) * scale };
            // What was rounded up is not over the limit either.
            *held = scaled.clamp(-limit, limit);
        }
        (held, echo.map(|echo| echo * scale))
    }

    /// Brakes the joints, whatever a timeout would do.
    pub fn brake(&mut self, time_ns: u64, damping: f64) {
        self.integrate(time_ns);
        self.has_timed_out = true;
        // Brakes act at once.
        self.drive = Drive::Damping { damping, limit: self.limit };
        self.echo = [0.0; _];
    }

    /// Ends the hold: no fresh command came within the timeout.
    pub fn time_out(&mut self, time_ns: u64, velocity: &[f64; N]) {
        self.integrate(time_ns);
        self.has_timed_out = true;
        self.enter_safe_state(time_ns, velocity);
    }

    fn enter_safe_state(&mut self, time_ns: u64, velocity: &[f64; N]) {
        let zero = [0.0; E];
        match self.on_timeout {
            OnTimeout::Hold => {}
            OnTimeout::Zero => {
                let (torque, echo) = (self.torque(time_ns, velocity), self.applied(time_ns));
                self.set_out(torque, echo, [0.0; N], zero, time_ns);
            }
            OnTimeout::Damp(damping) => {
                // Brakes act at once.
                self.drive = Drive::Damping { damping, limit: self.limit };
                self.echo = zero;
            }
        }
    }

    /// What acts on the joints: the held torque, or damping.
    pub fn drive(&self) -> &Drive<N> {
        &self.drive
    }

    /// The torque in effect at `time_ns` and at joint velocities `velocity`, N m.
    #[inline(always)]
    pub fn torque(&self, time_ns: u64, velocity: &[f64; N]) -> [f64; N] {
        let time = time_ns as f64 * 1e-9;
        let mut torque = [0.0; N];
        for (joint, torque) in torque.iter_mut().enumerate() {
            *torque = self.drive.torque(joint, velocity[joint], time);
        }
        torque
    }

    /// The torque that the last command asked for within the limits, N m; what a brake exerts at
    /// joint velocities `velocity`.
    #[inline(always)]
    pub fn commanded(&self, velocity: &[f64; N]) -> [f64; N] {
        match &self.drive {
            Drive::Approach(approach) => approach.to,
            _ => self.torque(0, velocity),
        }
    }

    /// The echo in effect at `time_ns`.
    #[inline(always)]
    pub fn applied(&self, time_ns: u64) -> [f64; E] {
        let Drive::Approach(approach) = &self.drive else { return self.echo };
        let rest = approach.rest(time_ns as f64 * 1e-9);
        std::array::from_fn(|i| self.echo[i] + (self.echo_from[i] - self.echo[i]) * rest)
    }

    /// The mean echo over the memory step that ends at `time_ns`, a sampling instant. Before the
    /// run the echo counts as zero. Just after a change of the sample period, a step may begin
    /// between two sampling instants; the impulse is then interpolated linearly.
    #[inline(always)]
    pub fn delivered(&mut self, time_ns: u64, step_ns: u64) -> [f64; E] {
        self.integrate(time_ns);
        self.history.push_back((time_ns, self.impulse));
        let start = time_ns.saturating_sub(step_ns);
        while self.history.get(1).is_some_and(|(at, _)| *at <= start) {
            self.history.pop_front();
        }
        let before = match (self.history.front(), self.history.get(1)) {
            (Some((at, impulse)), _) if *at == start => *impulse,
            (Some((from, first)), Some((to, second))) if *from < start => {
                let part = (start - from) as f64 / (to - from) as f64;
                std::array::from_fn(|i| first[i] + (second[i] - first[i]) * part)
            }
            _ => [0.0; _],
        };
        let seconds = step_ns as f64 * 1e-9;
        std::array::from_fn(|i| (self.impulse[i] - before[i]) / seconds)
    }

    /// How many numbers the echo in effect has.
    pub fn echo_count(&self) -> u64 {
        self.echo_count
    }

    /// Sample instant to application of the command in effect, ns; 0 before any.
    pub fn latency_ns(&self) -> u64 {
        self.latency_ns
    }

    /// Whether the timeout is in effect: no command has come since.
    pub fn has_timed_out(&self) -> bool {
        self.has_timed_out
    }

    #[inline(always)]
    fn integrate(&mut self, time_ns: u64) {
        let seconds = time_ns.saturating_sub(self.integrated_ns) as f64 * 1e-9;
        for (impulse, echo) in self.impulse.iter_mut().zip(&self.echo) {
            *impulse += echo * seconds;
        }
        if !self.is_perfect {
            self.integrate_approach(time_ns);
        }
        self.integrated_ns = time_ns;
    }

    /// Adds what the echo lacks on its way.
    #[inline(never)]
    fn integrate_approach(&mut self, time_ns: u64) {
        if let Drive::Approach(Approach { since_ns, course, .. }) = &self.drive
            && time_ns > self.integrated_ns
        {
            let integral =
                |at_ns: u64| course.integral(at_ns.saturating_sub(*since_ns) as f64 * 1e-9);
            let rest = integral(time_ns) - integral(self.integrated_ns);
            for (i, impulse) in self.impulse.iter_mut().enumerate() {
                *impulse += (self.echo_from[i] - self.echo[i]) * rest;
            }
        }
    }
}

fn limits<const N: usize>(scenario: &Scenario) -> [f64; N] {
    let mut limit = [f64::INFINITY; _];
    for (limit, joint) in limit.iter_mut().zip(scenario.safety.torque_limit.iter().flatten()) {
        *limit = *joint;
    }
    limit
}

fn course(scenario: &Scenario) -> Option<CourseSettings> {
    scenario.actuator.as_ref()?.course.clone()
}

fn resolution<const N: usize>(scenario: &Scenario) -> [f64; N] {
    let steps = scenario.actuator.as_ref().map_or(&[][..], |actuator| &actuator.resolution);
    std::array::from_fn(|joint| steps.get(joint).copied().unwrap_or(0.0))
}

fn rate_limits<const N: usize>(scenario: &Scenario) -> Option<[f64; N]> {
    let rates = scenario.safety.torque_rate_limit.as_ref()?;
    Some(std::array::from_fn(|joint| rates.get(joint).copied().unwrap_or(f64::INFINITY)))
}

/// Which part of the way `from` one torque `to` another no joint's rate forbids in so many seconds.
fn part_of_step<const N: usize>(
    from: &[f64; N],
    to: &[f64; N],
    rates: &[f64; N],
    seconds: f64,
) -> f64 {
    let steps = from.iter().zip(to).map(|(from, to)| (to - from).abs());
    steps.zip(rates).fold(1.0, |part, (step, rate)| f64::min(part, rate * seconds / step))
}

/// How many sampling instants a memory step spans, with those at both ends and a new one.
fn memory_samples(scenario: &Scenario) -> usize {
    let step = scenario.law.memory.step.as_nanos();
    (step / scenario.timing.sample_period.as_nanos()) as usize + 3
}
