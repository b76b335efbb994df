//! The messages that cross a bridge, and those that do not.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use mtj_model::scenario::{Scenario, Wait, built_in};
use mtj_protocol::{
    bus::{Bus, Depth, Reader, STREAM_DEPTH},
    local::LocalBus,
    member::{Member, Role},
    port::{Bridge, Exchange, Message, MonitorPort, PlantPort, fetch_scenario},
    sample::{
        ChangeSample, Header, RequestSample, Sample, StateSample, StatusSample, TorqueSample,
        VERSION,
    },
};

const RUN: u64 = 7;

fn header(sequence: u64) -> Header {
    Header { version: VERSION, joints: 2, axes: 2, run: RUN, sequence, ..Header::default() }
}

fn state(sequence: u64) -> StateSample {
    StateSample { header: header(sequence), ..Default::default() }
}

fn plant_on(bus: &LocalBus) -> (PlantPort, Scenario) {
    let text = built_in("sampled/mtj").unwrap();
    let scenario = Scenario::parse("sampled/mtj", text, &[]).unwrap();
    (PlantPort::open(bus, &scenario, RUN).unwrap(), scenario)
}

fn stream<S: Sample>(bus: &LocalBus) -> Box<dyn Reader<S>> {
    bus.reader(Depth::Stream, Wait::Block).unwrap()
}

#[test]
fn samples_cross_with_their_scenario_before_them() {
    let (near, far) = (LocalBus::default(), LocalBus::default());
    let mut bridge = Bridge::open(&near, &far, false).unwrap();
    let mut monitor = MonitorPort::open(&far).unwrap();
    let (mut plant, scenario) = plant_on(&near);
    plant.send(&mut state(0)).unwrap();
    plant.announce(&ChangeSample { header: header(0), ..Default::default() }).unwrap();
    plant.report(&StatusSample { header: header(0), ..Default::default() }).unwrap();
    bridge.forward().unwrap();
    let mut messages = Vec::new();
    monitor.drain(&far, &mut |message| messages.push(message)).unwrap();
    let [Message::Scenario(offered), Message::State(_), Message::Status(_), rest @ ..] =
        &messages[..]
    else {
        panic!("{messages:?}");
    };
    assert_eq!((offered.run, &offered.scenario), (RUN, &scenario));
    assert!(matches!(rest, [Message::Change(_), Message::Presence(_)]), "{rest:?}");
    assert_eq!((bridge.traffic().forwarded, bridge.traffic().missed), (4, 0));

    let set = "law.kind=tj".parse().unwrap();
    plant.renew(&scenario.changed(&[set]).unwrap(), 1).unwrap();
    let mut changed = state(1);
    changed.header.revision = 1;
    plant.send(&mut changed).unwrap();
    bridge.forward().unwrap();
    let offered = fetch_scenario(&far, &|| true).unwrap().unwrap();
    assert_eq!((offered.revision, offered.scenario.law.law.description().name), (1, "tj"));
}

#[test]
fn requests_come_back_and_torques_do_not() {
    let (near, far) = (LocalBus::default(), LocalBus::default());
    let mut torques = stream::<TorqueSample>(&near);
    let mut requests = stream::<RequestSample>(&near);
    let request = RequestSample { header: header(5), ..Default::default() };
    let write = || {
        far.writer().unwrap().write(&request).unwrap();
        let torque = TorqueSample { header: header(5), ..Default::default() };
        far.writer().unwrap().write(&torque).unwrap();
        far.writer().unwrap().write(&state(5)).unwrap();
    };
    let mut bridge = Bridge::open(&near, &far, false).unwrap();
    write();
    bridge.forward().unwrap();
    assert_eq!(requests.take().unwrap(), Some(request));
    assert_eq!(torques.take().unwrap(), None, "no process on the far bus takes part in the loop");
    assert_eq!(bridge.traffic().returned, 1);

    let mut bridge = Bridge::open(&near, &far, true).unwrap();
    write();
    bridge.forward().unwrap();
    assert_eq!(requests.take().unwrap(), None, "a bridge that only reads returns no requests");
}

#[test]
fn states_that_the_bridge_misses_are_counted() {
    let (near, far) = (LocalBus::default(), LocalBus::default());
    let mut bridge = Bridge::open(&near, &far, false).unwrap();
    let mut beyond = stream::<StateSample>(&far);
    let mut states = near.writer().unwrap();
    states.write(&state(0)).unwrap();
    bridge.forward().unwrap();
    let overrun = STREAM_DEPTH as u64 + 10;
    for sequence in 1..=overrun {
        states.write(&state(sequence)).unwrap();
    }
    bridge.forward().unwrap();
    assert_eq!(bridge.traffic().missed, 10);
    // Another run counts from its beginning.
    let mut first = state(3);
    first.header.run = RUN + 1;
    states.write(&first).unwrap();
    bridge.forward().unwrap();
    assert_eq!(bridge.traffic().missed, 10);
    let arrived = std::iter::from_fn(|| beyond.take().unwrap()).count();
    assert_eq!(arrived, STREAM_DEPTH, "the newest that the far side holds");
}

#[test]
fn members_are_announced_on_the_far_bus_until_the_bridge_ends() {
    let (near, far) = (LocalBus::default(), LocalBus::default());
    let member = Member::new(Role::Controller, 3);
    let announcement = near.announce(&member).unwrap();
    let mut beyond = far.attendance().unwrap();
    let mut bridge = Bridge::open(&near, &far, false).unwrap();
    bridge.forward().unwrap();
    assert_eq!(beyond.present().unwrap(), [member]);
    drop(bridge);
    assert_eq!(beyond.present().unwrap(), []);
    drop(announcement);
}
