//! What each role hears of the others.

use std::{thread, time::Duration};

use mtj_protocol::{
    bus::Bus,
    port::{Answer, Exchange, Heard, Message, MonitorPort},
    sample::{ErrorSample, Header, Sample, StateSample, StatusSample, TorqueSample, VERSION},
};

use crate::rig::*;

pub fn the_loop_closes_through_the_ports<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    for _ in 0..300 {
        met.exchange();
    }
    assert_eq!((met.plant.rejected(), met.controller.rejected()), (0, 0));
}

/// What makes a sample unacceptable.
type Fault<S> = (&'static str, Box<dyn Fn(&mut S)>);

/// Everything that makes any sample unacceptable, one by one.
fn faults<S: Sample>(number_of: fn(&mut S) -> &mut f64) -> Vec<Fault<S>> {
    vec![
        ("foreign version", Box::new(|s| s.header_mut().version = VERSION + 1)),
        ("no joints", Box::new(|s| s.header_mut().joints = 0)),
        ("eight joints", Box::new(|s| s.header_mut().joints = 8)),
        ("no axes", Box::new(|s| s.header_mut().axes = 0)),
        ("seven axes", Box::new(|s| s.header_mut().axes = 7)),
        ("foreign run", Box::new(|s| s.header_mut().run = RUN + 1)),
        ("not a number", Box::new(move |s| *number_of(s) = f64::NAN)),
        ("infinite", Box::new(move |s| *number_of(s) = f64::NEG_INFINITY)),
        ("stale", Box::new(|s| *s.header_mut() = header(0))),
    ]
}

pub fn the_plant_ignores_torques_that_are_not_acceptable<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    let mut stranger = met.other.writer::<TorqueSample>().unwrap();
    eventually("a torque of a stranger that says it is the controller", || {
        let answer = met.answered_by(|asked| stranger.write(&torque(asked)).unwrap());
        assert_ne!(answer, Some(Answer::NotFinite));
        answer
    });
    while met.plant.receive(glance()).unwrap().is_some() {}
    let before = met.plant.rejected();
    let mut faults = faults::<TorqueSample>(|s| &mut s.torque[6]);
    faults.push(("not in charge", Box::new(|s| s.controller += 1)));
    faults.push((
        "not in charge nor finite",
        Box::new(|s| {
            s.controller += 1;
            s.torque[0] = f64::NAN;
        }),
    ));
    faults.push(("an echo of eight numbers", Box::new(|s| s.echo_count = 8)));
    faults.push(("unasked", Box::new(|s| s.header.sequence += 1)));
    for (count, (name, spoil)) in faults.into_iter().enumerate() {
        let mut first = true;
        eventually(name, || {
            let found = if std::mem::take(&mut first) {
                met.answered_by(|asked| {
                    let mut bad = torque(asked);
                    spoil(&mut bad);
                    stranger.write(&bad).unwrap();
                })
            } else {
                met.plant.receive(glance()).unwrap()
            };
            match found {
                None => {}
                Some(Answer::NotFinite) => {
                    assert_eq!(met.plant.torque().header.sequence, met.next - 1);
                    assert!(["not a number", "infinite"].contains(&name), "{name}");
                }
                Some(Answer::Torque) => panic!("{name} came through: {:?}", met.plant.torque()),
            }
            (met.plant.rejected() == before + 2 * count as u64 + 1).then_some(())
        });
        met.exchange();
        // A duplicate of the newest acts only once, and is counted too.
        stranger.write(&torque(met.next - 1)).unwrap();
        eventually("a duplicate", || {
            assert_eq!(met.plant.receive(glance()).unwrap(), None, "a duplicate after {name}");
            (met.plant.rejected() == before + 2 * count as u64 + 2).then_some(())
        });
        met.exchange();
    }
}

pub fn the_controller_ignores_states_that_are_not_acceptable<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    met.exchange();
    let mut faults = faults::<StateSample>(|s| &mut s.delivered[0]);
    faults.push(("an echo of eight numbers", Box::new(|s| s.echo_count = 8)));
    for (count, (name, spoil)) in faults.into_iter().enumerate() {
        let mut bad = state(1 << 40);
        spoil(&mut bad);
        met.plant.send(&mut bad).unwrap();
        eventually(name, || {
            match met.controller.receive(glance()).unwrap() {
                None => {}
                Some(Heard::OtherRun) => {
                    let run = met.controller.state().header.run;
                    assert_eq!((run, name), (RUN + 1, "foreign run"));
                }
                Some(_) => panic!("{name} came through"),
            }
            (met.controller.rejected() == count as u64 + 1).then_some(())
        });
        met.exchange();
    }
}

pub fn the_controller_is_asked_again_and_notices_another_run<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    met.exchange();
    let repeated = StateSample { sent_ns: 99, ..state(met.next - 1) };
    met.plant.send(&mut repeated.clone()).unwrap();
    let heard = met.controller.receive(soon()).unwrap();
    assert_eq!(heard, Some(Heard::Again), "a repeated state asks for the same answer again");
    assert_eq!(*met.controller.state(), StateSample { leader: member().id, ..repeated });
    assert_eq!(met.controller.rejected(), 0, "asking again is no fault");
    let mut restarted = state(0);
    restarted.header.run = RUN + 1;
    // As long as our own plant speaks, another run is somebody else's.
    thread::sleep(Duration::from_millis(25));
    met.plant.send(&mut restarted).unwrap();
    let heard = met.controller.receive(soon()).unwrap();
    assert_eq!(heard, Some(Heard::OtherRun), "a state of another run says so");
    assert_eq!(met.controller.state().header.run, RUN + 1);
}

pub fn the_state_at_hand_is_the_one_that_was_heard<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    met.exchange();
    for strangers in 1..4 {
        thread::sleep(Duration::from_millis(25));
        let ours = met.next;
        met.next += 1;
        met.plant.send(&mut state(ours)).unwrap();
        for stranger in 0..strangers {
            let mut foreign = state(stranger);
            foreign.header.run = RUN + 1;
            met.plant.send(&mut foreign).unwrap();
        }
        // On a bus that keeps only the newest, ours may be gone.
        let expected = match met.controller.receive(soon()).unwrap() {
            Some(Heard::State) => (RUN, ours),
            Some(Heard::OtherRun) => (RUN + 1, strangers - 1),
            heard => panic!("{heard:?}"),
        };
        let Header { run, sequence, .. } = met.controller.state().header;
        assert_eq!((run, sequence), expected);
        while met.controller.receive(glance()).unwrap().is_some() {}
        met.exchange();
    }
}

/// Makes a monitor that the loop's four topics reach.
pub fn monitor(met: &mut Met) -> MonitorPort {
    let mut monitor = MonitorPort::open(&met.other).unwrap();
    let mut reached = [false; 4];
    eventually("all four topics", || {
        met.exchange();
        let header = header(met.next);
        met.plant.report(&StatusSample { header, ..Default::default() }).unwrap();
        met.controller.publish(&ErrorSample { header, ..Default::default() }).unwrap();
        monitor
            .drain(&met.other, &mut |message| {
                let topic = match message {
                    Message::State(_) => 0,
                    Message::Torque(_) => 1,
                    Message::Error(_) => 2,
                    Message::Status(_) => 3,
                    _ => return,
                };
                reached[topic] = true;
            })
            .unwrap();
        (reached == [true; 4]).then_some(())
    });
    monitor
}

pub fn a_monitor_hears_everything_acceptable<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    let mut monitor = monitor(&mut met);
    let first = met.next;
    for _ in 0..100 {
        met.exchange();
    }
    let mut foreign = torque(met.next);
    foreign.header.version = VERSION + 1;
    met.controller.send(&mut foreign).unwrap();
    let (mut states, mut torques) = (Vec::new(), Vec::new());
    eventually("the refusal", || {
        monitor
            .drain(&met.other, &mut |message| match message {
                Message::State(state) => states.push(state.header.sequence),
                Message::Torque(torque) => torques.push(torque.header.sequence),
                _ => {}
            })
            .unwrap();
        (monitor.rejected() == 1 && states.last() == Some(&(met.next - 1))).then_some(())
    });
    let expected: Vec<_> = (first..met.next).collect();
    for mut heard in [states, torques] {
        heard.retain(|sequence| *sequence >= first);
        assert_eq!(heard, expected);
    }
}

pub fn rubbish_is_counted_and_the_loop_goes_on<R: Rig>() {
    let rig = R::new();
    let mut met = close_the_loop(&rig);
    let mut monitor = monitor(&mut met);
    let sample = [0; size_of::<TorqueSample>()];
    let (short, long) = (&sample[1..], [&sample[..], &[0]].concat());
    // Bytes of the right length are a sample, but one of version 0, which is nobody's.
    // Another version may have laid out its torque in another way.
    let other = [&(VERSION - 1).to_le_bytes()[..], &sample[20..]].concat();
    let kinds: [&[u8]; 7] = [b"", b"rubbish", &[0xff; 100_000], short, &long, &other, &sample];
    for (count, rubbish) in kinds.iter().enumerate() {
        if !rig.put_rubbish("torque", rubbish) {
            return; // Shared memory is typed, and so is a process.
        }
        eventually("the plant's count", || {
            assert_eq!(met.plant.receive(glance()).unwrap(), None);
            (met.plant.rejected() == count as u64 + 1).then_some(())
        });
    }
    for rubbish in &kinds[..6] {
        assert!(rig.put_rubbish("state", rubbish));
    }
    eventually("the controller's count", || {
        assert!(met.controller.receive(glance()).unwrap().is_none());
        (met.controller.rejected() == 6).then_some(())
    });
    eventually("the monitor's count", || {
        monitor.drain(&met.other, &mut |_| {}).unwrap();
        (monitor.rejected() == 13).then_some(())
    });
    for _ in 0..20 {
        met.exchange();
    }
}
