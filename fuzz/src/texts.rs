//! Texts that people and programs write.

use std::{str, time::Duration};

use mtj_controller::Controller;
use mtj_model::scenario::{Jitter, LinkSettings, Override, Scenario, duration};
use mtj_plant::{
    direct::Direct,
    error::PlantError,
    link::{Direction, Link},
    plant::{Watch, run},
};
use mtj_protocol::{
    bus::BusError,
    member::Member,
    request::Request,
    sample::{RequestSample, VERSION, text_of},
};
use mtj_study::sweep::plan::Plan;

use crate::session::with_file;

/// A scenario that is accepted prints and parses to itself, and can be run; so can one that is
/// changed. Lines behind the first zero byte are what is set in it.
pub fn scenario(data: &[u8]) {
    let Some((text, sets)) = with_sets(data) else { return };
    if let Ok(scenario) = Scenario::parse("fuzz", text, &sets) {
        check(&scenario);
    }
    if let Ok(scenario) = Scenario::parse("fuzz", text, &[])
        && let Ok(changed) = scenario.changed(&sets)
    {
        check(&changed);
        let timing = (scenario.timing.clock, scenario.timing.integration_step);
        assert_eq!((changed.timing.clock, changed.timing.integration_step), timing);
        assert_eq!((&changed.arm, changed.task), (&scenario.arm, scenario.task));
    }
}

fn with_sets(data: &[u8]) -> Option<(&str, Vec<Override>)> {
    let (text, sets) =
        str::from_utf8(data).ok()?.split_once('\0').unwrap_or((str::from_utf8(data).ok()?, ""));
    Some((text, sets.lines().filter_map(|line| line.parse().ok()).collect()))
}

fn check(scenario: &Scenario) {
    let again = Scenario::parse("fuzz", scenario.text(), &[]);
    assert_eq!(again.as_ref(), Ok(scenario), "{}", scenario.text());
    let replays = |link: &LinkSettings| matches!(link.jitter, Jitter::Replay { .. });
    if replays(&scenario.link.state) || replays(&scenario.link.torque) {
        return; // Files of this machine are no inputs of ours.
    }
    // Its links and its memory are made as large as it says, but only a moment is run.
    let moment = [
        ("duration", "10 ms"),
        ("timing.clock", "lockstep"),
        ("timing.sample_period", "1 ms"),
        ("timing.integration_step", "1 ms"),
    ];
    let moment = moment.map(|(key, value)| Override::text(key, value));
    if let Ok(short) = Scenario::parse("fuzz", scenario.text(), &moment) {
        run_briefly(&short);
    }
}

fn run_briefly(scenario: &Scenario) {
    let mut controller = Controller::new(scenario);
    let mut exchange = Direct::new(1, |state: &_| controller.respond(state).copied());
    let watch = Watch { trace: true, ..Watch::default() };
    match run(scenario, 1, &mut exchange, watch, &|| true) {
        Ok(outcome) => {
            assert!(outcome.trace.len() <= 10);
            for row in outcome.trace {
                for (torque, limit) in
                    row.torque.iter().zip(scenario.safety.torque_limit.iter().flatten())
                {
                    assert!(torque.abs() <= *limit, "{torque} N m is over the limit of {limit}");
                }
            }
        }
        Err(PlantError::Bus(BusError::Controller(_))) => {}
        Err(error) if error.is_bad_input() => {}
        Err(error) => panic!("{error}"),
    }
}

/// A study that is accepted has a bounded number of points, each of which can be named. Lines
/// behind the first zero byte are what is set in it.
pub fn study(data: &[u8]) {
    let Some((text, sets)) = with_sets(data) else { return };
    let Ok(plan) = Plan::parse("fuzz", text, &sets) else { return };
    assert!((1..=10_000_000).contains(&plan.len()));
    for point in [0, plan.len() / 2, plan.len() - 1] {
        assert_eq!(plan.positions(point).len(), plan.axes.len());
        assert!(plan.command(point).starts_with("mtj run --scenario"));
        let _ = plan.scenario(point);
    }
    assert!(plan.shown().contains(text.trim_end()));
}

/// What is read is written so that it is read the same. The first byte says what the rest is.
pub fn words(data: &[u8]) {
    let Some((kind, rest)) = data.split_first() else { return };
    let Ok(text) = str::from_utf8(rest) else { return };
    match kind % 4 {
        0 => {
            if let Some(read) = duration::parse(text) {
                assert_eq!(duration::parse(&duration::format(read)), Some(read), "{read:?}");
            }
        }
        1 => {
            if let Ok(member) = text.parse::<Member>() {
                assert_eq!(member.to_string().parse(), Ok(member));
            }
        }
        2 => {
            if let Ok(set) = text.parse::<Override>() {
                // Not a number is not equal to itself, so what is printed is compared.
                let again = set.to_string().parse::<Override>().map(|again| format!("{again:?}"));
                assert_eq!(again, Ok(format!("{set:?}")));
            }
        }
        _ => latencies(rest),
    }
}

/// Latencies as a link replays them, from a CSV file.
fn latencies(csv: &[u8]) {
    with_file(csv, |path| {
        let latency = Duration::from_millis(1);
        let jitter = Jitter::Replay { file: path.to_owned() };
        let settings = LinkSettings { latency, jitter, ..LinkSettings::default() };
        if let Ok(mut link) = Link::new(&settings, Direction::State, 1) {
            for _ in 0..10 {
                assert!(link.transit_ns() >= Some(1_000_000));
            }
        }
    });
}

/// A knob that a dashboard lets pass goes to the plant as a request, and the plant understands what
/// was meant.
pub fn knob(data: &[u8]) {
    let Ok(knob) = serde_json::from_slice::<Request>(data) else { return };
    if knob.check().is_err() {
        return;
    }
    let request: RequestSample = knob.to_sample(1, 2);
    assert_eq!((request.header.version, request.header.run), (VERSION, 1));
    if let Ok(understood) = Request::from_sample(&request) {
        let again = understood.to_sample(1, 2);
        assert!(text_of(&again.text).lines().eq(text_of(&request.text).lines()));
        assert_eq!(RequestSample { text: request.text, ..again }, request);
    } else {
        assert!(matches!(knob, Request::Set(_)), "{knob:?}");
    }
}
