//! A run that is changed while it runs, through an exchange that requests it.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::{convert::Infallible, time::Instant};

use mtj_model::scenario::{MemoryPolicy, Override, Scenario, built_in};
use mtj_plant::{
    direct::Direct,
    plant::{self, Outcome, Watch},
};
use mtj_protocol::{
    bus::BusError,
    port::{Answer, Exchange},
    request::Request,
    sample::{ChangeSample, RequestSample, StateSample, StatusSample, TorqueSample, padded},
};

const RUN: u64 = 7;

/// Requests something as soon as so many states have been sent.
struct Requesting<E> {
    inner: E,
    requests: Vec<(u64, RequestSample)>,
    states: Vec<StateSample>,
    changes: Vec<ChangeSample>,
    phases: Vec<u64>,
    offered: Vec<(u32, Scenario)>,
}

impl<E: Exchange> Exchange for Requesting<E> {
    fn send(&mut self, state: &mut StateSample) -> Result<(), BusError> {
        self.states.push(*state);
        self.inner.send(state)
    }
    fn receive(&mut self, until: Instant) -> Result<Option<Answer>, BusError> {
        self.inner.receive(until)
    }
    fn torque(&self) -> &TorqueSample {
        self.inner.torque()
    }
    fn report(&mut self, status: &StatusSample) -> Result<(), BusError> {
        self.phases.push(status.phase);
        Ok(())
    }
    fn rejected(&self) -> u64 {
        self.inner.rejected()
    }
    fn request(&mut self) -> Result<Option<RequestSample>, BusError> {
        let is_due =
            self.requests.first().is_some_and(|(after, _)| self.states.len() as u64 > *after);
        Ok(is_due.then(|| self.requests.remove(0).1))
    }
    fn announce(&mut self, change: &ChangeSample) -> Result<(), BusError> {
        self.changes.push(*change);
        Ok(())
    }
    fn renew(&mut self, scenario: &Scenario, revision: u32) -> Result<(), BusError> {
        self.offered.push((revision, scenario.clone()));
        Ok(())
    }
}

struct Ran {
    outcome: Outcome,
    states: Vec<StateSample>,
    changes: Vec<ChangeSample>,
    phases: Vec<u64>,
    offered: Vec<(u32, Scenario)>,
}

fn run(
    sets: &[&str],
    requests: &[(u64, RequestSample)],
    respond: impl Fn(&StateSample) -> TorqueSample,
) -> Ran {
    let fixed = ["timing.clock=lockstep", "bus.kind=local", "duration=1s"];
    let sets: Vec<Override> = fixed.iter().chain(sets).map(|set| set.parse().unwrap()).collect();
    let scenario = Scenario::parse("here", built_in("sampled/mtj").unwrap(), &sets).unwrap();
    let mut exchange = Requesting {
        inner: Direct::new(RUN, |state: &StateSample| Ok::<_, Infallible>(respond(state))),
        requests: requests.to_vec(),
        states: Vec::new(),
        changes: Vec::new(),
        phases: Vec::new(),
        offered: Vec::new(),
    };
    let watch = Watch { trace: true, ..Watch::default() };
    let outcome = plant::run(&scenario, RUN, &mut exchange, watch, &|| true).unwrap();
    let Requesting { states, changes, phases, offered, .. } = exchange;
    Ran { outcome, states, changes, phases, offered }
}

fn request(number: u64, request: Request) -> RequestSample {
    request.to_sample(RUN, number)
}

fn set(number: u64, sets: &[&str]) -> RequestSample {
    request(number, Request::Set(sets.iter().map(|set| (*set).to_owned()).collect()))
}

fn limp(state: &StateSample) -> TorqueSample {
    TorqueSample { header: state.header.answer(), ..Default::default() }
}

fn stiff(state: &StateSample) -> TorqueSample {
    let torque: [f64; 2] =
        std::array::from_fn(|i| 10.0 * (1.0 - state.position[i]) - 4.0 * state.velocity[i]);
    TorqueSample { header: state.header.answer(), torque: padded(&torque), ..Default::default() }
}

#[test]
fn a_disturbance_gives_the_arm_its_angular_momentum() {
    // Nothing depends on q₁, so the momentum p₁ = ∂T/∂q̇₁ is the impulse about the first joint:
    // p₁ = M₁₁ q̇₁ + M₁₂ q̇₂, with the two links' inertia written out.
    let momentum = |q: &[f64; 7], v: &[f64; 7]| {
        let (m2, l1, c1, c2, i1, i2, m1) = (3.0, 1.0, 0.5, 0.5, 0.333, 0.30, 4.0);
        let cos = q[1].cos();
        let m11 = i1 + m1 * c1 * c1 + i2 + m2 * (l1 * l1 + c2 * c2 + 2.0 * l1 * c2 * cos);
        let m12 = i2 + m2 * (c2 * c2 + l1 * c2 * cos);
        m11 * v[0] + m12 * v[1]
    };
    let kick = Request::Kick { torque: vec![5.0, 0.7], milliseconds: 104.5 };
    let ran = run(&["arm.velocity=[0.0, 0.0]"], &[(20, request(1, kick))], limp);
    let begin = ran.changes[0].header.time_ns as f64 * 1e-9;
    assert!(begin > 0.1 && begin < 0.3, "{begin}");
    for row in &ran.outcome.trace {
        let impulse = 5.0 * (row.time - begin).clamp(0.0, 0.1045);
        let found = momentum(&row.position, &row.velocity);
        assert!((found - impulse).abs() < 1e-9, "t {}: {found}, {impulse}", row.time);
    }
    assert_eq!(ran.outcome.report.energy_j, Some(0.0), "no work of the actuator's");
}

#[test]
fn a_pause_does_not_change_the_run() {
    let through = run(&[], &[], stiff);
    let requests = [
        (20, request(1, Request::Pause)),
        (20, set(2, &["law.kp=31"])),
        (20, request(3, Request::Resume)),
    ];
    let paused = run(&[], &requests, stiff);
    assert_eq!(paused.outcome.trace, through.outcome.trace, "bit for bit");
    assert_eq!(paused.changes.len(), 3);
    assert!(paused.changes.iter().all(|change| change.outcome() == Ok(())));
    assert_eq!(paused.outcome.report.commands, through.outcome.report.commands);
    let again = run(&[], &[(20, request(1, Request::Resume))], stiff);
    assert_eq!(again.outcome.trace, through.outcome.trace, "nothing to resume");
}

#[test]
fn monitors_see_that_a_run_is_paused() {
    let mut requests = vec![(20, request(1, Request::Pause))];
    requests.extend((2..20).map(|number| (20, set(number, &["law.kp=31"]))));
    requests.push((20, request(20, Request::Resume)));
    let ran = run(&[], &requests, stiff);
    let mut phases = ran.phases.clone();
    phases.dedup();
    assert_eq!(phases, [1, 3, 1, 2]);
}

#[test]
fn a_reset_ends_the_run_and_keeps_the_changed_scenario() {
    let requests =
        [(10, set(1, &["law.memory.policy=delivered"])), (20, request(2, Request::Reset))];
    let ran = run(&[], &requests, stiff);
    let reset = ran.outcome.reset.expect("a scenario to begin again with");
    assert_eq!(reset.law.memory.policy, MemoryPolicy::Delivered);
    assert!(ran.outcome.trace.len() < 30);
    assert!(!ran.outcome.interrupted && !ran.outcome.report.diverged);
    assert!(run(&[], &[], stiff).outcome.reset.is_none());
}

#[test]
fn a_change_is_in_effect_from_the_sample_it_names_and_offered_before() {
    let requests =
        [(30, set(1, &["link.torque.latency=4ms"])), (60, set(2, &["timing.sample_period=5ms"]))];
    let ran = run(&[], &requests, stiff);
    let [first, second] = &ran.changes[..] else { panic!("two changes") };
    for state in &ran.states {
        let number = state.header.sequence;
        let revision = u32::from(number >= first.header.sequence)
            + u32::from(number >= second.header.sequence);
        assert_eq!(state.header.revision, revision, "sample {number}");
        // The first command that takes 4 ms answers that sample; the next state echoes it.
        let latency = if number > first.header.sequence { 4_000_000 } else { 0 };
        assert_eq!(state.latency_ns, latency, "sample {number}");
    }
    let times: Vec<_> = ran.states.iter().map(|state| state.header.time_ns / 1_000_000).collect();
    let change = second.header.sequence as usize;
    assert_eq!(times[change], second.header.time_ns / 1_000_000);
    assert_eq!((times[change] - times[change - 1], times[change + 1] - times[change]), (10, 5));
    let revisions: Vec<_> = ran.offered.iter().map(|(revision, _)| *revision).collect();
    assert_eq!(revisions, [1, 2]);
}

#[test]
fn a_changed_motion_leaves_the_one_before_without_a_jump_and_travels_with_the_scenario() {
    let line =
        "trajectory={kind='point-to-point', from=[0.5, 1.0], to=[1.0, 0.5], duration='200ms'}";
    let requests = [
        (30, set(1, &["trajectory.radius=0.8", "trajectory.blend=200ms"])),
        (45, set(2, &["law.kp=20"])),
        (50, set(3, &["trajectory.angular_frequency=3.0"])),
        (75, set(4, &[line])),
    ];
    // Samples so short that the motion cannot go far in one.
    let ran = run(&["timing.sample_period=2ms", "duration=400ms"], &requests, stiff);
    assert_eq!(ran.changes.len(), 4);
    let desired: Vec<[f64; 2]> =
        ran.outcome.trace.iter().map(|row| [row.desired[0], row.desired[1]]).collect();
    for (sample, points) in desired.windows(4).enumerate() {
        let third = |axis: usize| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| points[i][axis]);
            d - 3.0 * c + 3.0 * b - a
        };
        // Up to 4 km/s³ on the way; a jump of 1 mm would be one of 125 km/s³.
        let jerk = third(0).hypot(third(1)) / 0.002f64.powi(3);
        assert!(jerk < 2e4, "sample {sample}: {jerk} m/s³");
    }
    // What was offered is what the plant goes by: another process reads it from the text.
    let (revision, last) = ran.offered.last().unwrap();
    assert_eq!(*revision, 4);
    let read = Scenario::parse("there", last.text(), &[]).unwrap();
    assert_eq!(read.trajectory, last.trajectory);
    assert!(last.trajectory.transition.is_some());
    let end = desired.last().unwrap();
    let at = read.trajectory.at::<2>(ran.outcome.trace.last().unwrap().time).point;
    assert_eq!(*end, [at.x, at.y]);
    // A change of something else goes on with the motion; a run that begins anew has none to leave.
    let [_, (_, other), (_, third), _] = &ran.offered[..] else { panic!() };
    assert_eq!(other.trajectory, ran.offered[0].1.trajectory);
    assert_ne!(third.trajectory, other.trajectory);
    assert_eq!(last.anew().trajectory.transition, None);
}

#[test]
fn an_impossible_request_is_refused_and_changes_nothing() {
    let through = run(&[], &[], stiff);
    let requests = [
        (10, set(1, &["law.kp=-1"])),
        (11, set(2, &["arm.links[0].mass=1.0"])),
        (12, set(3, &["link.state.jitter={kind='replay', file='/nowhere'}"])),
        (13, RequestSample { action: 9, ..request(4, Request::Pause) }),
        (14, RequestSample { duration_ns: 0, action: 4, ..request(5, Request::Pause) }),
        (15, RequestSample { text: [[0xff; 32]; 12], ..set(6, &["law.kp=1"]) }),
    ];
    let ran = run(&[], &requests, stiff);
    assert_eq!(ran.outcome.trace, through.outcome.trace);
    for (change, words) in ran.changes.iter().zip([
        "law.kp = -1",
        "a running loop",
        "/nowhere",
        "no action 9",
        "a kick is",
        "nothing to set",
    ]) {
        let reason = change.outcome().unwrap_err();
        assert!(reason.contains(words), "{reason}");
    }
    assert_eq!(ran.changes.len(), requests.len());
    assert!(ran.states.iter().all(|state| state.header.revision == 0) && ran.offered.is_empty());
}

#[test]
fn a_repeated_request_is_answered_again_and_carried_out_once() {
    let kick = request(1, Request::Kick { torque: vec![5.0], milliseconds: 50.0 });
    let once = run(&[], &[(20, kick)], stiff);
    let twice = run(&[], &[(20, kick), (24, kick), (30, kick)], stiff);
    assert_eq!(twice.outcome.trace, once.outcome.trace);
    assert_eq!(twice.changes, vec![once.changes[0]; 3]);
}

#[test]
fn a_joint_beyond_its_limit_stops_the_arm_until_it_is_resumed() {
    // A constant torque turns the first joint beyond 0.2 rad.
    let push = |state: &StateSample| TorqueSample {
        header: state.header.answer(),
        torque: padded(&[8.0, 0.0]),
        ..Default::default()
    };
    let sets = ["arm.velocity=[0.0, 0.0]", "safety.position_max=[0.2, 3.0]", "safety.damping=50.0"];
    let ran = run(&sets, &[(80, request(1, Request::Resume))], push);
    let trace = &ran.outcome.trace;
    let stopped = trace.iter().position(|row| row.position[0] > 0.2).unwrap();
    let resumed = ran.changes[0].header.sequence as usize;
    assert!(stopped + 10 < resumed, "{stopped} {resumed}");
    for (sample, row) in trace.iter().enumerate() {
        let is_stopped = (stopped..resumed).contains(&sample);
        let expected = if is_stopped { -50.0 * row.velocity[0] } else { 8.0 };
        // The first command takes effect after the first sample, as does the first after a resume.
        if sample > 0 && sample != resumed {
            assert!((row.torque[0] - expected).abs() < 1e-9, "sample {sample}: {row:?}");
        }
        assert_eq!(ran.states[sample].timed_out == 1, (stopped..=resumed).contains(&sample));
    }
    assert!(ran.phases.contains(&5), "{:?}", ran.phases);
    let commands = ran.outcome.report.commands;
    assert_eq!(commands.too_old as usize, resumed - stopped, "{commands:?}");
    assert_eq!(commands.sent, commands.applied + commands.lost + commands.too_old);
}

#[test]
fn a_speed_beyond_its_limit_stops_the_arm_until_a_reset() {
    let push = |state: &StateSample| TorqueSample {
        header: state.header.answer(),
        torque: padded(&[20.0, 0.0]),
        ..Default::default()
    };
    let sets = ["arm.velocity=[0.0, 0.0]", "safety.speed_limit=2.0"];
    let ran = run(&sets, &[(90, request(1, Request::Reset))], push);
    assert!(ran.outcome.reset.is_some());
    let fastest = ran.outcome.trace.iter().map(|row| row.velocity[0].abs()).fold(0.0, f64::max);
    assert!(fastest < 2.5, "{fastest} rad/s");
}
