//! Round trips of a loop on this machine, compared with its bare transport and with the floor of
//! both: one cache line that two cores pass to each other.
//!
//! All are measured in turn, for several rounds, so that other load on the machine affects all
//! alike; only ratios within a round are compared.

pub(crate) mod bare;
mod floor;
mod own;
pub(crate) mod print;
pub(crate) mod rate;

use std::{net::TcpListener, time::Duration};

use mtj_model::scenario::{BusKind, Wait};
use mtj_plant::durations::{Durations, Percentiles};
use serde::Serialize;

use crate::{failure::Failure, options::realtime::LoopRealtime};

pub(crate) use bare::{ECHO, echo};
pub(crate) use rate::{Held, highest_rate};

/// Whether to go on.
pub(crate) type Proceed<'a> = &'a (dyn Fn() -> bool + Sync);

/// A way to close the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Way {
    /// The transport.
    pub bus: BusKind,
    /// How both ends wait.
    pub wait: Wait,
}

impl Way {
    /// The period of round trips; `None` if each begins as soon as the one before has ended.
    ///
    /// Ends that spin on shared memory do what is off the critical path, the stream for monitors,
    /// in the time that is left of a sample period, so they are measured with one. Ends that sleep,
    /// or whose transport has threads that do, are measured without, or the time that a core takes
    /// to wake up would outweigh all else.
    fn period(&self) -> Option<Duration> {
        (self.bus == BusKind::Iceoryx2 && self.wait == Wait::Spin).then_some(PERIOD)
    }
}

/// The period of what is measured with one.
const PERIOD: Duration = Duration::from_micros(50);

/// How much is measured.
#[derive(Clone, Debug)]
pub(crate) struct Effort {
    /// How often each is measured.
    pub rounds: usize,
    /// Round trips in each round.
    pub samples: u64,
    /// How the processes run.
    pub realtime: LoopRealtime,
}

/// All round trips of one kind.
#[derive(Default)]
pub(crate) struct Trips {
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

/// The measurement of one way.
pub(crate) struct Measurement {
    /// The way.
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
pub(crate) struct LatencyRow {
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

impl Measurement {
    /// As a row; `None` if nothing was measured.
    pub(crate) fn row(&self) -> Option<LatencyRow> {
        let Self { way, own, bare, floor } = self;
        let ratio = |to: &Trips| {
            let pairs = own.medians.iter().zip(&to.medians);
            median(&pairs.map(|(own, other)| own / other).collect::<Vec<_>>())
        };
        Some(LatencyRow {
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
pub(crate) fn measure(
    ways: &[Way],
    effort: &Effort,
    proceed: Proceed<'_>,
) -> Result<Vec<Measurement>, Failure> {
    let begin = |way: &Way| Measurement {
        way: *way,
        own: Trips::default(),
        bare: Trips::default(),
        floor: Trips::default(),
    };
    let mut measured: Vec<Measurement> = ways.iter().map(begin).collect();
    for _ in 0..effort.rounds {
        for Measurement { way, own, bare, floor } in &mut measured {
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

/// The median; NaN of no values.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => (sorted[n / 2 - 1] + sorted[n / 2]) / 2.0,
    }
}

/// A free endpoint on loopback.
fn free_endpoint() -> Result<String, Failure> {
    Ok(format!("tcp/{}", TcpListener::bind("127.0.0.1:0")?.local_addr()?))
}
