//! What each role hears of the others.

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

/// Samples that are unacceptable for one reason each.
pub fn faults<S: Sample>(
    good: impl Fn(u64) -> S,
    header_of: fn(&mut S) -> &mut Header,
    number_of: fn(&mut S) -> &mut f64,
) -> Vec<(&'static str, S)> {
    let with = |change: &dyn Fn(&mut S)| {
        let mut sample = good(1 << 40);
        change(&mut sample);
        sample
    };
    vec![
        ("foreign version", with(&|s| header_of(s).version = VERSION + 1)),
        ("no joints", with(&|s| header_of(s).joints = 0)),
        ("eight joints", with(&|s| header_of(s).joints = 8)),
        ("no axes", with(&|s| header_of(s).axes = 0)),
        ("seven axes", with(&|s| header_of(s).axes = 7)),
        ("foreign run", with(&|s| header_of(s).run = RUN + 1)),
        ("not a number", with(&|s| *number_of(s) = f64::NAN)),
        ("infinite", with(&|s| *number_of(s) = f64::NEG_INFINITY)),
        ("stale", with(&|s| *header_of(s) = header(0))),
    ]
}

pub fn the_plant_ignores_torques_that_are_not_acceptable<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    let mut stranger = met.other.writer::<TorqueSample>().unwrap();
    eventually("a good torque of a stranger", || {
        met.next += 1;
        stranger.write(&torque(met.next)).unwrap();
        met.plant.receive(glance()).unwrap()
    });
    while met.plant.receive(glance()).unwrap().is_some() {}
    met.next += 1;
    let faults = faults(torque, |s| &mut s.header, |s| &mut s.torque[6]);
    for (count, (name, bad)) in faults.into_iter().enumerate() {
        stranger.write(&bad).unwrap();
        eventually(name, || {
            match met.plant.receive(glance()).unwrap() {
                None => {}
                Some(Answer::NotFinite(sequence)) => {
                    assert_eq!((sequence, bad.torque[6].is_finite()), (1 << 40, false));
                }
                Some(Answer::Torque(found)) => panic!("{name} came through: {found:?}"),
            }
            (met.plant.rejected() == count as u64 + 1).then_some(())
        });
        met.exchange();
        // A duplicate of the newest acts only once.
        stranger.write(&torque(met.next - 1)).unwrap();
        assert_eq!(met.plant.receive(glance()).unwrap(), None, "a duplicate after {name}");
        met.exchange();
        assert_eq!(met.plant.rejected(), count as u64 + 1, "after {name}");
    }
}

pub fn the_controller_ignores_states_that_are_not_acceptable<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    met.exchange();
    let faults = faults(state, |s| &mut s.header, |s| &mut s.delivered[0]);
    for (count, (name, bad)) in faults.into_iter().enumerate() {
        met.plant.send(&bad).unwrap();
        eventually(name, || {
            match met.controller.receive(glance()).unwrap() {
                None => {}
                Some(Heard::OtherRun(run)) => assert_eq!((run, name), (RUN + 1, "foreign run")),
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
    met.plant.send(&repeated).unwrap();
    match met.controller.receive(soon()).unwrap() {
        Some(Heard::Again(found)) => assert_eq!(found, repeated),
        _ => panic!("a repeated state asks for the same answer again"),
    }
    assert_eq!(met.controller.rejected(), 0, "asking again is no fault");
    let mut restarted = state(0);
    restarted.header.run = RUN + 1;
    met.plant.send(&restarted).unwrap();
    match met.controller.receive(soon()).unwrap() {
        Some(Heard::OtherRun(run)) => assert_eq!(run, RUN + 1),
        _ => panic!("a state of another run says so"),
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
    met.controller.send(&foreign).unwrap();
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
    let kinds: [&[u8]; 6] = [b"", b"rubbish", &[0xff; 100_000], short, &long, &sample];
    for (count, rubbish) in kinds.iter().enumerate() {
        if !rig.put_rubbish("torque", rubbish) {
            return; // Shared memory is typed, and so is a process.
        }
        eventually("the plant's count", || {
            assert_eq!(met.plant.receive(glance()).unwrap(), None);
            (met.plant.rejected() == count as u64 + 1).then_some(())
        });
    }
    for rubbish in &kinds[..5] {
        assert!(rig.put_rubbish("state", rubbish));
    }
    eventually("the controller's count", || {
        assert!(met.controller.receive(glance()).unwrap().is_none());
        (met.controller.rejected() == 5).then_some(())
    });
    eventually("the monitor's count", || {
        monitor.drain(&met.other, &mut |_| {}).unwrap();
        (monitor.rejected() == 11).then_some(())
    });
    for _ in 0..20 {
        met.exchange();
    }
}
