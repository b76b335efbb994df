//! What the port of each role accepts, and what it rejects.

use std::{thread, time::Duration};

use mtj_protocol::{
    bus::Bus,
    port::{Answer, Exchange, Message, MonitorPort, Received},
    sample::{ErrorSample, Header, Sample, StateSample, StatusSample, TorqueSample, VERSION},
};

use crate::{Fixture, session::*};

/// Three hundred samples make the round trip in order and unharmed.
pub fn the_loop_closes_through_the_ports<F: Fixture>() {
    let mut peers = Peers::connect(&F::new());
    for _ in 0..300 {
        peers.exchange();
    }
    assert_eq!((peers.plant.rejected(), peers.controller.rejected()), (0, 0));
}

/// A change that makes a sample unacceptable.
type Fault<S> = (&'static str, Box<dyn Fn(&mut S)>);

/// All changes that make a sample unacceptable, whatever its topic.
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

/// The plant rejects and counts torques that are not acceptable, from any sender.
pub fn the_plant_rejects_unacceptable_torques<F: Fixture>() {
    let mut peers = Peers::connect(&F::new());
    let mut stranger = peers.other.writer::<TorqueSample>().unwrap();
    eventually("a stranger's torque under the leader's number", || {
        let answer = peers.answered_by(|asked| stranger.write(&torque(asked)).unwrap());
        assert_ne!(answer, Some(Answer::NotFinite));
        answer
    });
    while peers.plant.receive(glance()).unwrap().is_some() {}
    let before = peers.plant.rejected();
    let mut faults = faults::<TorqueSample>(|s| &mut s.torque[6]);
    faults.push(("not the leader", Box::new(|s| s.controller += 1)));
    faults.push((
        "not the leader's and not finite",
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
                peers.answered_by(|asked| {
                    let mut bad = torque(asked);
                    spoil(&mut bad);
                    stranger.write(&bad).unwrap();
                })
            } else {
                peers.plant.receive(glance()).unwrap()
            };
            match found {
                None => {}
                Some(Answer::NotFinite) => {
                    assert_eq!(peers.plant.torque().header.sequence, peers.next - 1);
                    assert!(["not a number", "infinite"].contains(&name), "{name}");
                }
                Some(Answer::Torque) => panic!("{name} came through: {:?}", peers.plant.torque()),
            }
            (peers.plant.rejected() == before + 2 * count as u64 + 1).then_some(())
        });
        peers.exchange();
        // A duplicate of the newest acts only once, and is counted too.
        stranger.write(&torque(peers.next - 1)).unwrap();
        eventually("a duplicate", || {
            assert_eq!(peers.plant.receive(glance()).unwrap(), None, "a duplicate after {name}");
            (peers.plant.rejected() == before + 2 * count as u64 + 2).then_some(())
        });
        peers.exchange();
    }
}

/// The controller rejects and counts states that are not acceptable.
pub fn the_controller_rejects_unacceptable_states<F: Fixture>() {
    let mut peers = Peers::connect(&F::new());
    peers.exchange();
    let mut faults = faults::<StateSample>(|s| &mut s.delivered[0]);
    faults.push(("an echo of eight numbers", Box::new(|s| s.echo_count = 8)));
    for (count, (name, spoil)) in faults.into_iter().enumerate() {
        let mut bad = state(1 << 40);
        spoil(&mut bad);
        peers.plant.send(&mut bad).unwrap();
        eventually(name, || {
            match peers.controller.receive(glance()).unwrap() {
                None => {}
                Some(Received::OtherRun) => {
                    let run = peers.controller.state().header.run;
                    assert_eq!((run, name), (RUN + 1, "foreign run"));
                }
                Some(_) => panic!("{name} came through"),
            }
            (peers.controller.rejected() == count as u64 + 1).then_some(())
        });
        peers.exchange();
    }
}

/// A controller tells repeated states from new ones, and notices a restarted plant.
pub fn the_controller_repeats_its_answer_and_notices_another_run<F: Fixture>() {
    let mut peers = Peers::connect(&F::new());
    peers.exchange();
    let repeated = StateSample { sent_ns: 99, ..state(peers.next - 1) };
    peers.plant.send(&mut repeated.clone()).unwrap();
    let received = peers.controller.receive(deadline()).unwrap();
    assert_eq!(
        received,
        Some(Received::Repeated),
        "a repeated state asks for the same answer again"
    );
    assert_eq!(*peers.controller.state(), StateSample { leader: member().id, ..repeated });
    assert_eq!(peers.controller.rejected(), 0, "asking again is no fault");
    let mut restarted = state(0);
    restarted.header.run = RUN + 1;
    // Beside a living plant, states of another run do not count.
    thread::sleep(Duration::from_millis(25));
    peers.plant.send(&mut restarted).unwrap();
    let received = peers.controller.receive(deadline()).unwrap();
    assert_eq!(received, Some(Received::OtherRun), "a state of another run says so");
    assert_eq!(peers.controller.state().header.run, RUN + 1);
}

/// The state that a controller answers is the one that its port reported, also among states of
/// other runs.
pub fn the_current_state_is_the_one_that_was_received<F: Fixture>() {
    let mut peers = Peers::connect(&F::new());
    peers.exchange();
    for strangers in 1..4 {
        thread::sleep(Duration::from_millis(25));
        let ours = peers.next;
        peers.next += 1;
        peers.plant.send(&mut state(ours)).unwrap();
        for stranger in 0..strangers {
            let mut foreign = state(stranger);
            foreign.header.run = RUN + 1;
            peers.plant.send(&mut foreign).unwrap();
        }
        // On a bus that keeps only the newest, ours may be gone.
        let expected = match peers.controller.receive(deadline()).unwrap() {
            Some(Received::New) => (RUN, ours),
            Some(Received::OtherRun) => (RUN + 1, strangers - 1),
            received => panic!("{received:?}"),
        };
        let Header { run, sequence, .. } = peers.controller.state().header;
        assert_eq!((run, sequence), expected);
        while peers.controller.receive(glance()).unwrap().is_some() {}
        peers.exchange();
    }
}

/// A monitor that the loop's four topics have reached.
fn monitor(peers: &mut Peers<impl Bus>) -> MonitorPort {
    let mut monitor = MonitorPort::open(&peers.other).unwrap();
    let mut reached = [false; 4];
    eventually("all four topics", || {
        peers.exchange();
        let header = header(peers.next);
        peers.plant.report(&StatusSample { header, ..Default::default() }).unwrap();
        peers.controller.publish(&ErrorSample { header, ..Default::default() }).unwrap();
        monitor
            .drain(&peers.other, &mut |message| {
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

/// A monitor receives the samples of all topics in order, and counts the others.
pub fn a_monitor_receives_every_acceptable_sample<F: Fixture>() {
    let mut peers = Peers::connect(&F::new());
    let mut monitor = monitor(&mut peers);
    let first = peers.next;
    for _ in 0..100 {
        peers.exchange();
    }
    let mut foreign = torque(peers.next);
    foreign.header.version = VERSION + 1;
    peers.controller.send(&mut foreign).unwrap();
    let (mut states, mut torques) = (Vec::new(), Vec::new());
    eventually("the rejection", || {
        monitor
            .drain(&peers.other, &mut |message| match message {
                Message::State(state) => states.push(state.header.sequence),
                Message::Torque(torque) => torques.push(torque.header.sequence),
                _ => {}
            })
            .unwrap();
        (monitor.rejected() == 1 && states.last() == Some(&(peers.next - 1))).then_some(())
    });
    let expected: Vec<_> = (first..peers.next).collect();
    for mut received in [states, torques] {
        received.retain(|sequence| *sequence >= first);
        assert_eq!(received, expected);
    }
}

/// Every reader counts bytes that are no sample, and goes on.
pub fn garbage_is_counted_and_the_loop_goes_on<F: Fixture>() {
    let fixture = F::new();
    let mut peers = Peers::connect(&fixture);
    let mut monitor = monitor(&mut peers);
    let sample = [0; size_of::<TorqueSample>()];
    let (short, long) = (&sample[1..], [&sample[..], &[0]].concat());
    // Bytes of the right length are a sample, but of version 0, which no program has.
    // Another version may have laid out its torque in another way.
    let other = [&(VERSION - 1).to_le_bytes()[..], &sample[20..]].concat();
    let kinds: [&[u8]; 7] = [b"", b"garbage", &[0xff; 100_000], short, &long, &other, &sample];
    for (count, garbage) in kinds.iter().enumerate() {
        if !fixture.put_garbage("torque", garbage) {
            return; // The transport is typed.
        }
        eventually("the plant's count", || {
            assert_eq!(peers.plant.receive(glance()).unwrap(), None);
            (peers.plant.rejected() == count as u64 + 1).then_some(())
        });
    }
    for garbage in &kinds[..6] {
        assert!(fixture.put_garbage("state", garbage));
    }
    eventually("the controller's count", || {
        assert!(peers.controller.receive(glance()).unwrap().is_none());
        (peers.controller.rejected() == 6).then_some(())
    });
    eventually("the monitor's count", || {
        monitor.drain(&peers.other, &mut |_| {}).unwrap();
        (monitor.rejected() == 13).then_some(())
    });
    for _ in 0..20 {
        peers.exchange();
    }
}
