//! A controller inside a test, which answers as the test wants.

use std::time::{Duration, Instant};

use mtj_controller::Controller;
use mtj_model::scenario::Wait;
use mtj_protocol::{
    member::{Member, Role},
    port::{ControllerPort, Received, fetch_scenario},
    sample::TorqueSample,
    transport::AnyBus,
};

use super::{LONG, Session};

/// Answers a plant.
pub struct OwnController {
    port: ControllerPort,
    controller: Controller,
    end: Instant,
    _bus: AnyBus,
}

impl OwnController {
    /// Waits for the plant of a session.
    pub fn join(session: &Session) -> Self {
        let bus = session.join(Role::Controller);
        let end = Instant::now() + LONG;
        let offered = fetch_scenario(&bus, &|| Instant::now() < end).unwrap().unwrap();
        let member = Member::new(Role::Controller, 0);
        let port = ControllerPort::open(&bus, &member, &offered, Wait::Block).unwrap();
        Self { port, controller: Controller::new(&offered.scenario), end, _bus: bus }
    }

    /// Answers the next state, if one comes soon. `change` may change the answer, or delay it.
    pub fn answer(&mut self, change: impl FnOnce(&mut TorqueSample)) {
        assert!(Instant::now() < self.end, "this controller is no longer needed");
        let Self { port, controller, .. } = self;
        let torque = match port.receive(Instant::now() + Duration::from_millis(50)).unwrap() {
            Some(Received::New) => controller.respond(port.state()).unwrap(),
            Some(Received::Repeated) => controller.answer_again(port.state()),
            _ => return,
        };
        change(torque);
        if port.is_leader() {
            port.send(torque).unwrap();
        }
        port.flush().unwrap();
    }
}
