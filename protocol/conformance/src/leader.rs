//! The election of a leader among several controllers.

use std::time::{Duration, Instant};

use mtj_model::scenario::{Scenario, Wait};
use mtj_protocol::{
    bus::Bus,
    member::{Member, Role},
    port::{Answer, ControllerPort, Exchange, Offered, PlantPort, Received},
    sample::TorqueSample,
};

use crate::{Fixture, session::*};

/// The lease: long enough for any bus, short enough to wait for.
const LEASE: &str = "60 ms";

/// A plant, and controllers that join one after another.
struct Election<F: Fixture> {
    fixture: F,
    scenario: Scenario,
    plant: PlantPort,
    _bus: F::Bus,
    next: u64,
}

/// A controller that answers while it leads.
struct Controller<B> {
    port: ControllerPort,
    id: u64,
    _bus: B,
}

impl<F: Fixture> Election<F> {
    fn new() -> Self {
        Self::of_lease(LEASE)
    }

    fn of_lease(lease: &str) -> Self {
        let fixture = F::new();
        let set = format!("safety.lease={lease}").parse().unwrap();
        let scenario = scenario().changed(&[set]).unwrap();
        let bus = fixture.join(Role::Plant);
        let plant = PlantPort::open(&bus, &scenario, RUN).unwrap();
        Self { fixture, scenario, plant, _bus: bus, next: 0 }
    }

    fn join(&self, id: u64, precedence: u32, since_ns: u64) -> Controller<F::Bus> {
        let bus = self.fixture.join(Role::Controller);
        let member = Member { role: Role::Controller, id, precedence, since_ns };
        let offered = Offered { run: RUN, revision: 0, scenario: self.scenario.clone() };
        let port = ControllerPort::open(&bus, &member, &offered, Wait::Block).unwrap();
        Controller { port, id, _bus: bus }
    }

    /// Sends a state, lets the leader answer it if it is among these controllers, and returns whose
    /// answer the plant admitted.
    fn ask(&mut self, controllers: &mut [&mut Controller<F::Bus>]) -> Option<u64> {
        self.plant.send(&mut state(self.next)).unwrap();
        self.next += 1;
        for controller in controllers {
            while let Some(received) = controller.port.receive(glance()).unwrap() {
                if received == Received::New && controller.port.is_leader() {
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

    /// Sends states until the plant admits an answer; returns its sender.
    fn leader(&mut self, controllers: &mut [&mut Controller<F::Bus>]) -> u64 {
        eventually("an answer", || self.ask(controllers))
    }
}

/// A controller that answers is not replaced, neither by a higher precedence nor by an older
/// controller.
pub fn two_controllers_never_alternate<F: Fixture>() {
    let mut election = Election::<F>::new();
    let mut first = election.join(10, 0, 1);
    assert_eq!(election.leader(&mut [&mut first]), 10);
    let (mut better, mut older) = (election.join(11, 9, 2), election.join(12, 0, 0));
    for _ in 0..30 {
        assert_eq!(election.leader(&mut [&mut better, &mut first, &mut older]), 10);
    }
    assert_eq!((election.plant.takeovers(), election.plant.rejected()), (0, 0));
}

/// A silent leader is replaced by the controller of the highest precedence, then of the greatest
/// age, and its late answers are rejected.
pub fn the_best_controller_takes_over_when_the_lease_lapses<F: Fixture>() {
    let mut election = Election::<F>::new();
    let mut first = election.join(10, 0, 1);
    assert_eq!(election.leader(&mut [&mut first]), 10);
    let (mut young, mut old, mut low) =
        (election.join(13, 1, 5), election.join(12, 1, 3), election.join(11, 0, 2));
    assert_eq!(election.leader(&mut [&mut first, &mut young, &mut old, &mut low]), 10);
    // The first controller falls silent, but remains announced.
    let lapsed = Instant::now();
    assert_eq!(
        election.leader(&mut [&mut young, &mut old, &mut low]),
        old.id,
        "precedence, then age"
    );
    assert!(lapsed.elapsed() >= Duration::from_millis(60), "not before the lease lapses");
    drop(old);
    assert_eq!(election.leader(&mut [&mut young, &mut low]), young.id);
    drop(young);
    assert_eq!(election.leader(&mut [&mut low]), low.id, "rather than the silent controller");
    assert_eq!(election.plant.takeovers(), 3);
    // The silent controller returns with an old answer, which the plant rejects.
    let rejected = election.plant.rejected();
    first.port.send(&mut torque(election.next - 1)).unwrap();
    eventually("its rejection", || {
        assert_eq!(election.plant.receive(glance()).unwrap(), None);
        (election.plant.rejected() > rejected).then_some(())
    });
    for _ in 0..10 {
        assert_eq!(election.leader(&mut [&mut first, &mut low]), low.id);
    }
}

/// A leader that the bus reports gone is replaced before its lease lapses.
pub fn a_leader_that_has_left_is_replaced_at_once<F: Fixture>() {
    // Longer than any deadline here.
    let mut election = Election::<F>::of_lease("1 h");
    let mut first = election.join(10, 1, 1);
    assert_eq!(election.leader(&mut [&mut first]), 10);
    let mut second = election.join(11, 0, 2);
    assert_eq!(election.leader(&mut [&mut first, &mut second]), 10);
    drop(first);
    assert_eq!(election.leader(&mut [&mut second]), 11);
    assert_eq!(election.plant.takeovers(), 1);
}

/// A controller that is slow but alone keeps its lead.
pub fn a_lone_controller_that_is_slower_than_its_lease_remains_the_leader<F: Fixture>() {
    let mut election = Election::<F>::new();
    let mut alone = election.join(10, 0, 1);
    assert_eq!(election.leader(&mut [&mut alone]), 10);
    let silence = Instant::now() + Duration::from_millis(150);
    while Instant::now() < silence {
        assert_eq!(election.ask(&mut []), None);
    }
    assert_eq!(election.leader(&mut [&mut alone]), 10);
    assert_eq!((election.plant.takeovers(), election.plant.rejected()), (0, 0));
}

/// A controller that only writes torques leads if no other has announced itself.
pub fn an_unannounced_controller_leads_by_answering<F: Fixture>() {
    let mut election = Election::<F>::new();
    let bus = election.fixture.join(Role::Controller);
    let mut stranger = bus.writer::<TorqueSample>().unwrap();
    let found = eventually("a stranger's torque", || {
        election.plant.send(&mut state(election.next)).unwrap();
        election.next += 1;
        stranger.write(&TorqueSample { controller: 77, ..torque(election.next - 1) }).unwrap();
        election.plant.receive(glance()).unwrap()
    });
    assert_eq!((found, election.plant.torque().controller), (Answer::Torque, 77));
    // An announced controller waits until the stranger falls silent.
    let mut announced = election.join(10, 0, 1);
    election.plant.send(&mut state(election.next)).unwrap();
    election.next += 1;
    stranger.write(&TorqueSample { controller: 77, ..torque(election.next - 1) }).unwrap();
    eventually("the stranger's next torque", || election.plant.receive(glance()).unwrap());
    assert!(election.plant.torque().header.sequence > 0);
    assert_eq!(election.leader(&mut [&mut announced]), 10);
}
