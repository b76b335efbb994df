//! The sessions, samples and waits that the rules start from.

use std::{
    thread,
    time::{Duration, Instant},
};

use mtj_model::scenario::{Override, Scenario, Wait, built_in};
use mtj_protocol::{
    bus::{Reader, Writer, receive},
    member::{Member, Role},
    port::{Answer, ControllerPort, Exchange, Offered, PlantPort, Received},
    sample::{Header, StateSample, TorqueSample, VERSION},
};

use crate::Fixture;

/// A deadline for what must happen: nothing here takes this long unless it never comes.
pub(crate) fn deadline() -> Instant {
    Instant::now() + Duration::from_secs(20)
}

/// A short wait: long enough for what is there already, and repeated by a caller that expects
/// something.
pub(crate) fn glance() -> Instant {
    Instant::now() + Duration::from_millis(20)
}

/// Repeats an attempt until it has a result, for a bounded time.
pub(crate) fn eventually<T>(what: &str, mut attempt: impl FnMut() -> Option<T>) -> T {
    let end = deadline();
    loop {
        if let Some(found) = attempt() {
            return found;
        }
        assert!(Instant::now() < end, "{what} never happened");
        thread::sleep(Duration::from_millis(1));
    }
}

/// The controller of the [`Peers`].
pub(crate) fn member() -> Member {
    Member { role: Role::Controller, id: 5, precedence: 0, since_ns: 1 }
}

pub(crate) const RUN: u64 = 77;

pub(crate) fn header(sequence: u64) -> Header {
    let time_ns = sequence.wrapping_mul(1_000_000);
    Header {
        version: VERSION,
        joints: 2,
        axes: 2,
        run: RUN,
        sequence,
        time_ns,
        ..Header::default()
    }
}

pub(crate) fn state(sequence: u64) -> StateSample {
    StateSample { header: header(sequence), position: [0.25; 7], ..Default::default() }
}

pub(crate) fn torque(sequence: u64) -> TorqueSample {
    TorqueSample {
        header: header(sequence),
        controller: member().id,
        torque: [-1.5; 7],
        ..Default::default()
    }
}

pub(crate) fn scenario() -> Scenario {
    let set: Override = "law.kp=31".parse().unwrap();
    Scenario::parse("sampled/mtj", built_in("sampled/mtj").unwrap(), &[set]).unwrap()
}

/// The scenario as a plant offers it.
pub(crate) fn offered() -> Offered {
    Offered { run: RUN, revision: 0, scenario: scenario() }
}

/// Writes states until each reader has the newest, because a subscription takes a moment to reach
/// the writer. Returns the next unused sequence number.
pub(crate) fn connect(
    writer: &mut dyn Writer<StateSample>,
    readers: &mut [&mut dyn Reader<StateSample>],
) -> u64 {
    let end = deadline();
    for sequence in 0.. {
        assert!(Instant::now() < end, "writer and reader never connected");
        writer.write(&state(sequence)).unwrap();
        let patience = Instant::now() + Duration::from_millis(200);
        let all_have_it = readers.iter_mut().all(|reader| {
            while receive(&mut **reader, Wait::Block, patience).unwrap() {
                if reader.sample().header.sequence == sequence {
                    return true;
                }
            }
            false
        });
        if all_have_it {
            return sequence + 1;
        }
    }
    unreachable!("the numbers end later than the patience")
}

/// The connected ports of a plant and a controller, and a third process in the session.
pub(crate) struct Peers<B> {
    pub(crate) plant: PlantPort,
    pub(crate) controller: ControllerPort,
    pub(crate) other: B,
    /// The next unused sequence number.
    pub(crate) next: u64,
    _buses: [B; 2],
}

impl<B> Peers<B> {
    /// Joins a plant and a controller, and exchanges samples until both have an answer.
    pub(crate) fn connect(fixture: &impl Fixture<Bus = B>) -> Self
    where
        B: mtj_protocol::bus::Bus,
    {
        let buses = [fixture.join(Role::Plant), fixture.join(Role::Controller)];
        let mut plant = PlantPort::open(&buses[0], &scenario(), RUN).unwrap();
        let mut controller =
            ControllerPort::open(&buses[1], &member(), &offered(), Wait::Block).unwrap();
        let mut next = 0;
        eventually("a first round trip", || {
            plant.send(&mut state(next)).unwrap();
            next += 1;
            if controller.receive(glance()).unwrap() != Some(Received::New) {
                return None;
            }
            controller.send(&mut torque(controller.state().header.sequence)).unwrap();
            plant.receive(glance()).unwrap()
        });
        // What is still on its way.
        while controller.receive(glance()).unwrap().is_some() {}
        while plant.receive(glance()).unwrap().is_some() {}
        assert_eq!((plant.rejected(), controller.rejected()), (0, 0));
        Self { plant, controller, other: fixture.join(Role::Controller), next, _buses: buses }
    }

    /// Sends the next state, lets `answer` answer it, and returns what the plant received.
    pub(crate) fn answered_by(&mut self, answer: impl FnOnce(u64)) -> Option<Answer> {
        self.plant.send(&mut state(self.next)).unwrap();
        self.next += 1;
        while self.controller.receive(deadline()).unwrap() != Some(Received::New)
            || self.controller.state().header.sequence + 1 != self.next
        {}
        answer(self.next - 1);
        self.plant.receive(glance()).unwrap()
    }

    /// Exchanges one state and its torque, unharmed.
    pub(crate) fn exchange(&mut self) {
        let sequence = self.next;
        self.next += 1;
        self.plant.send(&mut state(sequence)).unwrap();
        let received = self.controller.receive(deadline()).unwrap();
        assert_eq!(received, Some(Received::New), "state {sequence}");
        let sent = StateSample { leader: member().id, ..state(sequence) };
        assert_eq!(*self.controller.state(), sent);
        self.controller.send(&mut torque(sequence)).unwrap();
        assert_eq!(self.plant.receive(deadline()).unwrap(), Some(Answer::Torque));
        assert_eq!(*self.plant.torque(), torque(sequence));
    }
}
