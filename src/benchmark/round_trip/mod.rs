//! What a loop's round trip costs on this machine, beside what its transport costs alone and beside the
//! floor under both: one cache line that two cores pass to each other.
//!
//! Everything is measured in turns, several rounds of it, so that whatever else the machine does meets all alike;
//! only ratios within a round are compared.

pub mod bare;
mod floor;
mod own;
pub mod print;
pub mod rate;

use std::{net::TcpListener, time::Duration};

use mtj_model::scenario::{BusKind, Wait};
use mtj_plant::durations::{Durations, Percentiles};
use serde::Serialize;

use crate::{failure::Failure, options::realtime::LoopRealtime};

pub use bare::echo;
pub use rate::{Held, highest_rate};

/// Whether to go on.
pub type Proceed<'a> = &'a (dyn Fn() -> bool + Sync);

/// A way to close the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Way {
    /// The transport.
    pub bus: BusKind,
    /// How both ends wait.
    pub wait: Wait,
}

impl Way {
    /// How often a round trip begins; as soon as the one before is over, if nothing is said.
    ///
    /// Ends that spin on shared memory do what is off the critical path, the stream for monitors, in the time
    /// that is left of a sample period, so they are measured with one. Ends that sleep, or whose transport has
    /// threads that do, are measured without, or the time that a core takes to wake up would outweigh all else.
    fn period(&self) -> Option<Duration> {
        (self.bus == BusKind::Iceoryx2 && self.wait == Wait::Spin).then_some(PERIOD)
    }
}

/// The period of what is measured with one.
const PERIOD: Duration = Duration::from_micros(50);

/// How much is measured.
#[derive(Clone, Debug)]
pub struct Effort {
    /// How often each is measured.
    pub rounds: usize,
    /// Round trips in each round.
    pub samples: u64,
    /// How the processes run.
    pub realtime: LoopRealtime,
}

/// All round trips of one kind.
#[derive(Default)]
pub struct Trips {
    /// Of all rounds together.
    pub all: Durations,
    /// Median of each round, µs.
    pub medians: Vec<f64>,
}

impl Trips {
    fn add(&mut self, round: &Durations) {
        self.medians.extend(round.percentiles().map(|percentiles| percentiles.p50));
        self.all.add(round);
    }
}

/// What was measured of one way.
pub struct Measured {
    /// Which.
    pub way: Way,
    /// Our loop: plant and controller in processes of their own.
    pub own: Trips,
    /// The transport alone, with the same samples.
    pub bare: Trips,
    /// The cache line, in the same rounds.
    pub floor: Trips,
}

/// One row for machines, µs.
#[derive(Debug, Serialize)]
pub struct Row {
    /// Transport.
    pub bus: &'static str,
    /// How both ends waited.
    pub wait: &'static str,
    /// How many round trips of the loop.
    pub samples: u64,
    /// Our loop, all rounds together.
    pub own: Percentiles,
    /// The bare transport, all rounds together.
    pub bare: Percentiles,
    /// The cache line, all rounds together.
    pub floor: Percentiles,
    /// The median of each round.
    pub own_p50_by_round: Vec<f64>,
    /// The same of the bare transport.
    pub bare_p50_by_round: Vec<f64>,
    /// The same of the cache line.
    pub floor_p50_by_round: Vec<f64>,
    /// Median over the rounds of own/bare, by medians.
    pub own_to_bare: f64,
    /// Median over the rounds of own/floor.
    pub own_to_floor: f64,
}

impl Measured {
    /// As a row; `None` if nothing was measured.
    pub fn row(&self) -> Option<Row> {
        let Self { way, own, bare, floor } = self;
        let ratio = |to: &Trips| {
            let pairs = own.medians.iter().zip(&to.medians);
            median(&pairs.map(|(own, other)| own / other).collect::<Vec<_>>())
        };
        Some(Row {
            bus: way.bus.name(),
            wait: way.wait.name(),
            samples: own.all.count(),
            own: own.all.percentiles()?,
            bare: bare.all.percentiles()?,
            floor: floor.all.percentiles()?,
            own_p50_by_round: own.medians.clone(),
            bare_p50_by_round: bare.medians.clone(),
            floor_p50_by_round: floor.medians.clone(),
            own_to_bare: ratio(bare),
            own_to_floor: ratio(floor),
        })
    }
}

/// Measures each way in turn, for as many rounds as were asked for; fewer, if asked to stop.
pub fn measure(
    ways: &[Way],
    effort: &Effort,
    proceed: Proceed<'_>,
) -> Result<Vec<Measured>, Failure> {
    let begin = |way: &Way| Measured {
        way: *way,
        own: Trips::default(),
        bare: Trips::default(),
        floor: Trips::default(),
    };
    let mut measured: Vec<Measured> = ways.iter().map(begin).collect();
    for _ in 0..effort.rounds {
        for Measured { way, own, bare, floor } in &mut measured {
            if !proceed() {
                return Ok(measured);
            }
            floor.add(&floor::measure(effort)?);
            bare.add(&bare::measure(*way, effort)?);
            let Some(round) = own::measure(*way, effort, proceed)? else { return Ok(measured) };
            own.add(&round);
        }
    }
    Ok(measured)
}

/// NaN of nothing.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => (sorted[n / 2 - 1] + sorted[n / 2]) / 2.0,
    }
}

/// An endpoint on loopback that nobody listens on.
fn free_endpoint() -> Result<String, Failure> {
    Ok(format!("tcp/{}", TcpListener::bind("127.0.0.1:0")?.local_addr()?))
}
