//! Our loop: a plant in this process, its controller in another. In real time, where round trips
//! begin at a given period; else in lockstep, so that a state goes out as soon as the arm has
//! moved.

use std::{
    process,
    sync::atomic::{AtomicU64, Ordering},
    thread,
    time::Duration,
};

use mtj_model::scenario::BusKind;
use mtj_options::{BusOptions, SessionOptions};
use mtj_plant::{durations::Durations, plant::Outcome};

use super::{Effort, Proceed, Way, free_endpoint};
use crate::{failure::Failure, options::scenario::ScenarioOptions, session::Session};

/// The experiment: the paper's task under the law this is all about.
const SCENARIO: &str = "sampled/mtj";
/// Its sample period where that says nothing about wall time.
const LOCKSTEP_PERIOD: Duration = Duration::from_millis(10);

/// All round trips of a run of so many samples; `None` if asked to stop.
pub(crate) fn measure(
    way: Way,
    effort: &Effort,
    proceed: Proceed<'_>,
) -> Result<Option<Durations>, Failure> {
    let (clock, period) = match way.period() {
        Some(period) => ("realtime", period.as_nanos()),
        None => ("lockstep", LOCKSTEP_PERIOD.as_nanos()),
    };
    let set = vec![
        format!("duration={} ns", period * u128::from(effort.samples)),
        format!("timing.clock={clock}"),
        format!("timing.sample_period={period} ns"),
        // With one integration step a sample the plant is back soonest.
        format!("timing.integration_step={period} ns"),
    ];
    run(way, effort, set, proceed).map(|run| run.map(|outcome| outcome.round_trips))
}

/// Runs the experiment, changed by `set`, in two processes.
pub(crate) fn run(
    way: Way,
    effort: &Effort,
    set: Vec<String>,
    proceed: Proceed<'_>,
) -> Result<Option<Outcome>, Failure> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let options = ScenarioOptions {
        scenario: SCENARIO.to_owned(),
        set,
        bus: BusOptions {
            session: SessionOptions {
                bus: Some(way.bus.name().to_owned()),
                session: Some(format!("latency-{}-{count}", process::id())),
                ..SessionOptions::default()
            },
            wait: Some(way.wait.name().to_owned()),
            listen: if way.bus == BusKind::Zenoh { Some(free_endpoint()?) } else { None },
            ..BusOptions::default()
        },
    };
    let in_two_processes = || match Session::open(options, effort.realtime.clone(), &proceed)? {
        Some(mut session) => Ok(session.run(&session.scenario().clone(), &proceed)?),
        None => Ok(None),
    };
    // On a thread of its own, so that pinning it pins nothing else.
    thread::scope(|scope| {
        let running = scope.spawn(in_two_processes);
        running.join().unwrap_or_else(|_| Err(Failure::other("the plant's thread panicked")))
    })
}
