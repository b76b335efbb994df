//! Which of several controllers is in charge.

use std::time::{Duration, Instant};

use mtj_model::scenario::{Scenario, Wait};
use mtj_protocol::{
    bus::Bus,
    member::{Member, Role},
    port::{Answer, ControllerPort, Exchange, Heard, Offered, PlantPort},
    sample::TorqueSample,
    transport::AnyBus,
};

use crate::rig::*;

/// Long enough for any bus, short enough to wait for.
const LEASE: &str = "60 ms";

/// A plant, and controllers that join one after another.
struct Court<R> {
    rig: R,
    scenario: Scenario,
    plant: PlantPort,
    _bus: AnyBus,
    next: u64,
}

/// A controller that answers what it is asked, as long as it is told to.
struct Controller {
    port: ControllerPort,
    id: u64,
    _bus: AnyBus,
}

impl<R: Rig> Court<R> {
    fn new() -> Self {
        Self::of_lease(LEASE)
    }

    fn of_lease(lease: &str) -> Self {
        let rig = R::new();
        let set = format!("safety.lease={lease}").parse().unwrap();
        let scenario = scenario().changed(&[set]).unwrap();
        let bus = rig.join(Role::Plant);
        let plant = PlantPort::open(&bus, &scenario, RUN).unwrap();
        Self { rig, scenario, plant, _bus: bus, next: 0 }
    }

    fn join(&self, id: u64, precedence: u32, since_ns: u64) -> Controller {
        let bus = self.rig.join(Role::Controller);
        let member = Member { role: Role::Controller, id, precedence, since_ns };
        let offered = Offered { run: RUN, revision: 0, scenario: self.scenario.clone() };
        let port = ControllerPort::open(&bus, &member, &offered, Wait::Block).unwrap();
        Controller { port, id, _bus: bus }
    }

    /// Sends a state, lets all that are there answer it if they are in charge, and returns whose
    /// answer the plant took.
    fn ask(&mut self, controllers: &mut [&mut Controller]) -> Option<u64> {
        self.plant.send(&mut state(self.next)).unwrap();
        self.next += 1;
        for controller in controllers {
            while let Some(heard) = controller.port.receive(glance()).unwrap() {
                if heard == Heard::State && controller.port.is_in_charge() {
                    let sequence = controller.port.state().header.sequence;
                    controller.port.send(&mut torque(sequence)).unwrap();
                }
            }
        }
        match self.plant.receive(glance()).unwrap() {
            Some(Answer::Torque) => Some(self.plant.torque().controller),
            _ => None,
        }
    }

    /// Asks until somebody's answer is taken.
    fn leader(&mut self, controllers: &mut [&mut Controller]) -> u64 {
        eventually("an answer", || self.ask(controllers))
    }
}

pub fn two_controllers_never_alternate<R: Rig>() {
    let mut court = Court::<R>::new();
    let mut first = court.join(10, 0, 1);
    assert_eq!(court.leader(&mut [&mut first]), 10);
    // Neither a higher precedence nor an older one takes over from a controller that answers.
    let (mut better, mut older) = (court.join(11, 9, 2), court.join(12, 0, 0));
    for _ in 0..30 {
        assert_eq!(court.leader(&mut [&mut better, &mut first, &mut older]), 10);
    }
    assert_eq!((court.plant.takeovers(), court.plant.rejected()), (0, 0));
}

pub fn the_best_one_takes_over_when_the_lease_lapses<R: Rig>() {
    let mut court = Court::<R>::new();
    let mut first = court.join(10, 0, 1);
    assert_eq!(court.leader(&mut [&mut first]), 10);
    let (mut young, mut old, mut low) =
        (court.join(13, 1, 5), court.join(12, 1, 3), court.join(11, 0, 2));
    assert_eq!(court.leader(&mut [&mut first, &mut young, &mut old, &mut low]), 10);
    // The first one falls silent, but stays announced.
    let lapsed = Instant::now();
    assert_eq!(court.leader(&mut [&mut young, &mut old, &mut low]), old.id, "precedence, then age");
    assert!(lapsed.elapsed() >= Duration::from_millis(60), "a lease is a lease");
    drop(old);
    assert_eq!(court.leader(&mut [&mut young, &mut low]), young.id);
    drop(young);
    assert_eq!(court.leader(&mut [&mut low]), low.id, "rather than the silent one");
    assert_eq!(court.plant.takeovers(), 3);
    // The deposed one wakes up with an old answer: nothing to the plant.
    let rejected = court.plant.rejected();
    first.port.send(&mut torque(court.next - 1)).unwrap();
    eventually("its refusal", || {
        assert_eq!(court.plant.receive(glance()).unwrap(), None);
        (court.plant.rejected() > rejected).then_some(())
    });
    for _ in 0..10 {
        assert_eq!(court.leader(&mut [&mut first, &mut low]), low.id);
    }
}

pub fn a_leader_that_has_left_is_not_waited_for<R: Rig>() {
    // Longer than anybody waits here.
    let mut court = Court::<R>::of_lease("1 h");
    let mut first = court.join(10, 1, 1);
    assert_eq!(court.leader(&mut [&mut first]), 10);
    let mut second = court.join(11, 0, 2);
    assert_eq!(court.leader(&mut [&mut first, &mut second]), 10);
    drop(first);
    assert_eq!(court.leader(&mut [&mut second]), 11);
    assert_eq!(court.plant.takeovers(), 1);
}

pub fn a_lone_controller_that_is_slower_than_its_lease_stays_in_charge<R: Rig>() {
    let mut court = Court::<R>::new();
    let mut alone = court.join(10, 0, 1);
    assert_eq!(court.leader(&mut [&mut alone]), 10);
    let silence = Instant::now() + Duration::from_millis(150);
    while Instant::now() < silence {
        assert_eq!(court.ask(&mut []), None);
    }
    assert_eq!(court.leader(&mut [&mut alone]), 10);
    assert_eq!((court.plant.takeovers(), court.plant.rejected()), (0, 0));
}

pub fn whoever_answers_takes_charge_where_nobody_has_announced_himself<R: Rig>() {
    let mut court = Court::<R>::new();
    let bus = court.rig.join(Role::Controller);
    let mut stranger = bus.writer::<TorqueSample>().unwrap();
    let found = eventually("a stranger's torque", || {
        court.plant.send(&mut state(court.next)).unwrap();
        court.next += 1;
        stranger.write(&TorqueSample { controller: 77, ..torque(court.next - 1) }).unwrap();
        court.plant.receive(glance()).unwrap()
    });
    assert_eq!((found, court.plant.torque().controller), (Answer::Torque, 77));
    // An announced one waits until it fails.
    let mut announced = court.join(10, 0, 1);
    court.plant.send(&mut state(court.next)).unwrap();
    court.next += 1;
    stranger.write(&TorqueSample { controller: 77, ..torque(court.next - 1) }).unwrap();
    eventually("its next", || court.plant.receive(glance()).unwrap());
    assert!(court.plant.torque().header.sequence > 0);
    assert_eq!(court.leader(&mut [&mut announced]), 10);
}
