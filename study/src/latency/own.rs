//! Our loop: a plant in this process, its controller in another, in lockstep, so that a state goes out as
//! soon as the arm has moved.

use std::{
    process,
    sync::atomic::{AtomicU64, Ordering},
    thread,
};

use mtj_model::scenario::BusKind;
use mtj_plant::{durations::Durations, options::ScenarioOptions, plant::Outcome};
use mtj_protocol::options::BusOptions;

use super::{Effort, Proceed, Way, free_endpoint};
use crate::{command::Failure, session::Session};

/// The experiment: the paper's task under the law this is all about.
const SCENARIO: &str = "sampled/mtj";

/// All round trips of a run of so many samples; `None` if asked to stop.
pub fn measure(
    way: Way,
    effort: &Effort,
    proceed: Proceed<'_>,
) -> Result<Option<Durations>, Failure> {
    // At one integration step a sample the plant is back soonest.
    let timing = format!("duration={} ms", 10 * effort.samples);
    let set =
        [&timing, "timing.clock=lockstep", "timing.integration_step=10 ms"].map(str::to_owned);
    run(way, effort, set.to_vec(), proceed).map(|run| run.map(|outcome| outcome.round_trips))
}

/// Runs the experiment, changed by `set`, in two processes.
pub fn run(
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
            bus: Some(way.bus.name().to_owned()),
            session: Some(format!("latency-{}-{count}", process::id())),
            wait: Some(way.wait.name().to_owned()),
            listen: if way.bus == BusKind::Zenoh { Some(free_endpoint()?) } else { None },
            ..BusOptions::default()
        },
    };
    let in_two_processes = || match Session::open(options, effort.realtime.clone(), &proceed)? {
        Some(mut session) => session.run(&session.scenario().clone(), &proceed),
        None => Ok(None),
    };
    // On a thread of its own, so that pinning it pins nothing else.
    thread::scope(|scope| {
        let running = scope.spawn(in_two_processes);
        running.join().unwrap_or_else(|_| Err("the plant's thread panicked".to_owned().into()))
    })
}
