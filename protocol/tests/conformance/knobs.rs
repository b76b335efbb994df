//! How a running loop is changed.

use std::{sync::Arc, thread, time::Duration};

use mtj_protocol::{
    bus::{Bus, Writer},
    knob::Knob,
    member::Role,
    port::{Exchange, Heard, Message, MonitorPort, RequestPort},
    sample::{ChangeSample, ErrorSample, RequestSample, StatusSample, VERSION, text_of},
};

use crate::rig::*;

/// Lets the plant answer requests until one is carried out: the one that was hoped for.
fn carry_out(met: &mut Met, outcome: Result<(), &str>) -> RequestSample {
    eventually("a request", || {
        let request = met.plant.request().unwrap()?;
        let change = ChangeSample::answer(header(met.next), &request, outcome);
        met.plant.announce(&change).unwrap();
        Some(request)
    })
}

pub fn a_wish_comes_to_the_plant_and_its_answer_back<R: Rig>() {
    let rig = R::new();
    let mut met = close_the_loop(&rig);
    let requests = [
        (Knob::Set(vec!["law.kp=31".to_owned(), "law.kind=tj".to_owned()]), Ok(())),
        (Knob::Pause, Ok(())),
        (Knob::Kick { torque: vec![1.5, -2.0], milliseconds: 12.5 }, Err("not now")),
    ];
    for (knob, outcome) in requests {
        thread::scope(|scope| {
            let asking = scope.spawn(|| {
                let bus = rig.join(Role::Controller);
                let mut port = RequestPort::open(&bus).unwrap();
                port.turn(RUN, &knob, soon()).unwrap().expect("an answer")
            });
            let request = carry_out(&mut met, outcome);
            // A bus may have lost the first answer; a second request gets it again.
            while !asking.is_finished() {
                carry_on(&mut met, outcome);
            }
            let change = asking.join().unwrap();
            assert_eq!(change.request, request.header.sequence);
            assert_eq!(change.outcome(), outcome);
            let expected = match &knob {
                Knob::Kick { .. } => {
                    let mut torque = vec![1.5, -2.0];
                    torque.resize(7, 0.0);
                    Knob::Kick { torque, milliseconds: 12.5 }
                }
                other => other.clone(),
            };
            assert_eq!(Knob::of(&request), Ok(expected));
        });
    }
}

/// Answers once more if somebody asks once more.
fn carry_on(met: &mut Met, outcome: Result<(), &str>) {
    if let Some(request) = met.plant.request().unwrap() {
        let change = ChangeSample::answer(header(met.next), &request, outcome);
        met.plant.announce(&change).unwrap();
    }
    thread::sleep(Duration::from_millis(1));
}

pub fn a_wish_for_another_run_or_of_another_version_is_nobodys<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    let mut requests: Box<dyn Writer<RequestSample>> = met.other.writer().unwrap();
    let good = Knob::Pause.request(RUN, 9);
    let mut foreign = Knob::Pause.request(RUN + 1, 1);
    let mut strange = Knob::Pause.request(RUN, 2);
    strange.header.version = VERSION + 1;
    foreign.header.sequence = 3;
    let heard = eventually("the good one", || {
        for request in [&foreign, &strange, &good] {
            requests.write(request).unwrap();
        }
        met.plant.request().unwrap()
    });
    assert_eq!(heard, good);
}

pub fn a_changed_scenario_comes_before_the_samples_it_is_about<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    let mut monitor = MonitorPort::open(&met.other).unwrap();
    let mut revisions = Vec::new();
    for revision in 1..4 {
        let set = format!("law.kp={}", 30 + revision).parse().unwrap();
        let changed = scenario().changed(&[set]).unwrap();
        met.plant.renew(&changed, revision).unwrap();
        let mut newest = state(met.next);
        newest.header.revision = revision;
        // The controller fetches it when a sample tells of it, and only then.
        assert_eq!(met.controller.newer_scenario(&met.other).unwrap(), None);
        met.plant.send(&mut newest).unwrap();
        eventually("that sample", || {
            let heard = met.controller.receive(glance()).unwrap();
            (heard == Some(Heard::State) && met.controller.state().header == newest.header)
                .then_some(())
        });
        let fetched = eventually("the changed scenario", || {
            met.plant
                .report(&StatusSample { header: newest.header, ..Default::default() })
                .unwrap();
            met.controller.newer_scenario(&met.other).unwrap()
        });
        assert_eq!((fetched.revision, &fetched.scenario), (revision, &changed));
        assert_eq!(met.controller.newer_scenario(&met.other).unwrap(), None);
        eventually("the monitor's scenario", || {
            newest.header.sequence += 1;
            met.plant.send(&mut newest).unwrap();
            met.next = newest.header.sequence + 1;
            monitor
                .drain(&met.other, &mut |message| match message {
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

pub fn everybody_hears_who_takes_part<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    let mut monitor = MonitorPort::open(&met.other).unwrap();
    let mut here = [None, None];
    eventually("both roles", || {
        met.exchange();
        met.plant.report(&StatusSample { header: header(met.next), ..Default::default() }).unwrap();
        let error = ErrorSample { header: header(met.next), ..Default::default() };
        met.controller.publish(&error).unwrap();
        met.controller.tell().unwrap();
        monitor
            .drain(&met.other, &mut |message| {
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
