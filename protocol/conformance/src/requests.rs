//! Requests to change a running loop.

use std::{sync::Arc, thread, time::Duration};

use mtj_protocol::{
    bus::{Bus, Writer},
    member::Role,
    port::{Exchange, Message, MonitorPort, Received, RequestPort},
    request::Request,
    sample::{ChangeSample, ErrorSample, RequestSample, StatusSample, VERSION, text_of},
};

use crate::{Fixture, session::*};

/// Waits for a request, and answers it as the plant.
fn carry_out(peers: &mut Peers<impl Bus>, outcome: Result<(), &str>) -> RequestSample {
    eventually("a request", || {
        let request = peers.plant.request().unwrap()?;
        let change = ChangeSample::answer(header(peers.next), &request, outcome);
        peers.plant.announce(&change).unwrap();
        Some(request)
    })
}

/// A request reaches the plant unharmed, and the operator gets the answer.
pub fn a_request_reaches_the_plant_and_its_answer_comes_back<F: Fixture>() {
    let fixture = F::new();
    let mut peers = Peers::connect(&fixture);
    let requests = [
        (Request::Set(vec!["law.kp=31".to_owned(), "law.kind=tj".to_owned()]), Ok(())),
        (Request::Pause, Ok(())),
        (Request::Kick { torque: vec![1.5, -2.0], milliseconds: 12.5 }, Err("not now")),
    ];
    for (sent, outcome) in requests {
        thread::scope(|scope| {
            let asking = scope.spawn(|| {
                let bus = fixture.join(Role::Controller);
                let mut port = RequestPort::open(&bus).unwrap();
                port.ask(RUN, &sent, deadline()).unwrap().expect("an answer")
            });
            let request = carry_out(&mut peers, outcome);
            // A bus may have lost the first answer; a repeated request gets it again.
            while !asking.is_finished() {
                answer_again(&mut peers, outcome);
            }
            let change = asking.join().unwrap();
            assert_eq!(change.request, request.header.sequence);
            assert_eq!(change.outcome(), outcome);
            let expected = match &sent {
                Request::Kick { .. } => {
                    let mut torque = vec![1.5, -2.0];
                    torque.resize(7, 0.0);
                    Request::Kick { torque, milliseconds: 12.5 }
                }
                other => other.clone(),
            };
            assert_eq!(Request::from_sample(&request), Ok(expected));
        });
    }
}

/// Answers once more if the operator repeats its request.
fn answer_again(peers: &mut Peers<impl Bus>, outcome: Result<(), &str>) {
    if let Some(request) = peers.plant.request().unwrap() {
        let change = ChangeSample::answer(header(peers.next), &request, outcome);
        peers.plant.announce(&change).unwrap();
    }
    thread::sleep(Duration::from_millis(1));
}

/// The plant returns only requests for its run and of its protocol version.
pub fn requests_for_another_run_or_of_another_version_are_ignored<F: Fixture>() {
    let mut peers = Peers::connect(&F::new());
    let mut requests: Box<dyn Writer<RequestSample>> = peers.other.writer().unwrap();
    let good = Request::Pause.to_sample(RUN, 9);
    let mut foreign = Request::Pause.to_sample(RUN + 1, 1);
    let mut strange = Request::Pause.to_sample(RUN, 2);
    strange.header.version = VERSION + 1;
    foreign.header.sequence = 3;
    let received = eventually("the good request", || {
        for request in [&foreign, &strange, &good] {
            requests.write(request).unwrap();
        }
        peers.plant.request().unwrap()
    });
    assert_eq!(received, good);
}

/// A controller and a monitor get a changed scenario with the first sample of its revision, and
/// once.
pub fn a_changed_scenario_arrives_before_its_samples<F: Fixture>() {
    let mut peers = Peers::connect(&F::new());
    let mut monitor = MonitorPort::open(&peers.other).unwrap();
    let mut revisions = Vec::new();
    for revision in 1..4 {
        let set = format!("law.kp={}", 30 + revision).parse().unwrap();
        let changed = scenario().changed(&[set]).unwrap();
        peers.plant.renew(&changed, revision).unwrap();
        let mut newest = state(peers.next);
        newest.header.revision = revision;
        // The controller fetches it with the first sample of its revision, not before.
        assert_eq!(peers.controller.newer_scenario(&peers.other).unwrap(), None);
        peers.plant.send(&mut newest).unwrap();
        eventually("that sample", || {
            let received = peers.controller.receive(glance()).unwrap();
            (received == Some(Received::New) && peers.controller.state().header == newest.header)
                .then_some(())
        });
        let fetched = eventually("the changed scenario", || {
            peers
                .plant
                .report(&StatusSample { header: newest.header, ..Default::default() })
                .unwrap();
            peers.controller.newer_scenario(&peers.other).unwrap()
        });
        assert_eq!((fetched.revision, &fetched.scenario), (revision, &changed));
        assert_eq!(peers.controller.newer_scenario(&peers.other).unwrap(), None);
        eventually("the monitor's scenario", || {
            newest.header.sequence += 1;
            peers.plant.send(&mut newest).unwrap();
            peers.next = newest.header.sequence + 1;
            monitor
                .drain(&peers.other, &mut |message| match message {
                    Message::Scenario(offered) => {
                        assert_eq!(Arc::unwrap_or_clone(offered).scenario, changed);
                        revisions.push(revision);
                    }
                    Message::State(state) if state.header.revision == revision => {
                        assert_eq!(revisions.last(), Some(&revision), "the scenario came first");
                    }
                    _ => {}
                })
                .unwrap();
            (revisions.last() == Some(&revision)).then_some(())
        });
    }
    assert_eq!(revisions, [1, 2, 3], "each once");
}

/// Plant and controller publish their process and machine.
pub fn every_role_publishes_its_presence<F: Fixture>() {
    let mut peers = Peers::connect(&F::new());
    let mut monitor = MonitorPort::open(&peers.other).unwrap();
    let mut here = [None, None];
    eventually("both roles", || {
        peers.exchange();
        peers
            .plant
            .report(&StatusSample { header: header(peers.next), ..Default::default() })
            .unwrap();
        let error = ErrorSample { header: header(peers.next), ..Default::default() };
        peers.controller.publish(&error).unwrap();
        peers.controller.flush().unwrap();
        monitor
            .drain(&peers.other, &mut |message| {
                if let Message::Presence(presence) = message {
                    here[presence.role as usize] = Some(presence);
                }
            })
            .unwrap();
        (here[0].is_some() && here[1].is_some()).then_some(())
    });
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
    for presence in here.into_iter().flatten() {
        assert_eq!(presence.process, u64::from(std::process::id()));
        assert_eq!(text_of(&presence.host), name.trim());
        assert_eq!(presence.header.run, RUN);
    }
}
