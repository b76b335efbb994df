//! A monitor inside a test: everything that was said in a session, and who is there.

use std::collections::{BTreeMap, HashMap};

use mtj_protocol::{
    bus::{Attendance, Bus},
    member::Role,
    port::{Message, MonitorPort},
    sample::{ErrorSample, StateSample, StatusSample, TorqueSample},
    transport::AnyBus,
};

use super::{Session, eventually};

/// Hears a session.
pub struct Observer {
    bus: AnyBus,
    port: MonitorPort,
    attendance: Box<dyn Attendance>,
    processes: HashMap<u64, u32>,
    pub states: Vec<StateSample>,
    pub torques: Vec<TorqueSample>,
    /// By run and sequence number.
    pub errors: BTreeMap<(u64, u64), ErrorSample>,
    pub status: StatusSample,
}

impl Observer {
    pub fn join(session: &Session) -> Self {
        let bus = session.join(Role::Monitor);
        Self {
            port: MonitorPort::open(&bus).unwrap(),
            attendance: bus.attendance().unwrap(),
            bus,
            processes: HashMap::new(),
            states: Vec::new(),
            torques: Vec::new(),
            errors: BTreeMap::new(),
            status: StatusSample::default(),
        }
    }

    /// Takes in what was said since the last time.
    pub fn listen(&mut self) {
        let Self { bus, port, processes, states, torques, errors, status, .. } = self;
        port.drain(bus, &mut |message| match message {
            Message::Presence(presence) => {
                processes.insert(presence.id, presence.process as u32);
            }
            Message::State(state) => states.push(state),
            Message::Torque(torque) => torques.push(torque),
            Message::Error(error) => {
                errors.insert((error.header.run, error.header.sequence), error);
            }
            Message::Status(sample) => *status = sample,
            _ => {}
        })
        .unwrap();
    }

    /// Listens until `found` has something.
    pub fn until<T>(&mut self, what: &str, mut found: impl FnMut(&mut Self) -> Option<T>) -> T {
        eventually(what, || {
            self.listen();
            found(self)
        })
    }

    /// Listens until so many more torques were heard.
    pub fn hear_torques(&mut self, count: usize) {
        let enough = self.torques.len() + count;
        self.until("torques", |observer| (observer.torques.len() >= enough).then_some(()));
    }

    /// The controllers that are there.
    pub fn controllers(&mut self) -> Vec<u64> {
        let present = self.attendance.present().unwrap();
        let present = present.iter().filter(|member| member.role == Role::Controller);
        present.map(|member| member.id).collect()
    }

    /// The process in charge, another than `gone`, once `standing_by` others are there too.
    pub fn leader(&mut self, gone: u32, standing_by: usize) -> u32 {
        self.until("a leader and others who stand by", |observer| {
            let leader = observer.torques.last()?.controller;
            let process = *observer.processes.get(&leader)?;
            let present = observer.controllers();
            (process != gone && present.len() > standing_by && present.contains(&leader))
                .then_some(process)
        })
    }
}
