//! An emulated network link: how long messages of one direction travel, and which are lost.
//!
//! A replay takes latencies and losses from a CSV file. Its format is
//! [`REPLAY_FORMAT`](mtj_model::scenario::REPLAY_FORMAT): a header that names a column `latency_s`,
//! `latency_ms`, `latency_us` or `latency_ns`, and then a latency, or `lost`, for each message.

use std::{path::Path, time::Duration};

use mtj_model::{
    scenario::{self, Dropout, Jitter, LinkSettings, Scenario},
    table::Table,
};
use rand_distr::{Distribution, Gamma, Normal};
use rand_pcg::Pcg64;

use crate::{error::LinkError, sensor::fraction};

/// A link that delays and loses what it carries.
///
/// It belongs to the plant's agenda, so that it works the same under both clocks and over any bus.
/// What overtakes something else on the way makes the other useless: the newest value wins at
/// either end.
#[derive(Clone, Debug)]
pub struct Link {
    latency_ns: u64,
    delay: Delay,
    dropout: Dropout,
    is_bad: bool,
    delays: Pcg64,
    losses: Pcg64,
}

#[derive(Clone, Debug)]
enum Delay {
    Constant,
    /// The mean and half the width, s.
    Uniform(f64, f64),
    /// In s.
    Normal(Normal<f64>),
    /// In s, mean included.
    Gamma(Gamma<f64>),
    /// In ns, the link's own not included; `None` for a message that is lost.
    Replay {
        latencies: Vec<Option<u64>>,
        next: usize,
    },
}

/// The longest latency, s, longer than any run: a distribution may have no bounds, the run's time
/// has.
const LONGEST: f64 = 1e9;

/// Both links of a loop.
#[derive(Debug)]
pub struct Links {
    /// Sensor to controller.
    pub state: Link,
    /// Controller to actuator.
    pub torque: Link,
}

impl Links {
    /// The links of a scenario; reads the files of replays.
    ///
    /// # Errors
    ///
    /// [`LinkError::TooOld`] if no command could be younger than the command timeout, or what a link
    /// says.
    pub fn new(scenario: &Scenario) -> Result<Self, LinkError> {
        let (settings, seed) = (&scenario.link, scenario.seed);
        let links = Self {
            state: Link::new(&settings.state, Direction::State, seed)?,
            torque: Link::new(&settings.torque, Direction::Torque, seed)?,
        };
        check(scenario, &links.state, &links.torque)?;
        Ok(links)
    }
}

/// The links that a change of a scenario replaces. One that is as before goes on with its random
/// numbers.
#[derive(Debug, Default)]
pub struct LinkChanges {
    pub(crate) state: Option<Link>,
    pub(crate) torque: Option<Link>,
}

impl LinkChanges {
    /// The links of `scenario` that differ from those of `before`; reads the files of replays.
    ///
    /// # Errors
    ///
    /// As of [`Links::new`].
    pub fn between(before: &Scenario, scenario: &Scenario) -> Result<Self, LinkError> {
        if before.link == scenario.link
            && before.safety.command_timeout == scenario.safety.command_timeout
        {
            return Ok(Self::default());
        }
        let Links { state, torque } = Links::new(scenario)?;
        Ok(Self {
            state: (scenario.link.state != before.link.state).then_some(state),
            torque: (scenario.link.torque != before.link.torque).then_some(torque),
        })
    }
}

/// Refuses replays that let no command be young enough. Other links were checked with the scenario.
fn check(scenario: &Scenario, state: &Link, torque: &Link) -> Result<(), LinkError> {
    let is_replay = |settings: &LinkSettings| matches!(settings.jitter, Jitter::Replay { .. });
    let links = &scenario.link;
    let Some(timeout) = scenario.safety.command_timeout else { return Ok(()) };
    if !is_replay(&links.state) && !is_replay(&links.torque) {
        return Ok(());
    }
    let [state, torque] =
        [(&links.state, state), (&links.torque, torque)].map(|(settings, link)| {
            match &link.delay {
                Delay::Replay { latencies, .. } => {
                    let replayed = latencies.iter().flatten().min().copied().unwrap_or_default();
                    Duration::from_nanos(link.latency_ns.saturating_add(replayed))
                }
                _ => settings.shortest(),
            }
        });
    scenario::too_old(timeout, state, torque)
        .map_or(Ok(()), |reason| Err(LinkError::TooOld { timeout, reason }))
}

/// Which of the two directions: each has random numbers of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Sensor to controller.
    State,
    /// Controller to actuator.
    Torque,
}

impl Link {
    /// The link that the settings describe; reads the file of a replay.
    pub fn new(
        settings: &LinkSettings,
        direction: Direction,
        seed: u64,
    ) -> Result<Self, LinkError> {
        let (stream, direction) = match direction {
            Direction::State => (2, "state"),
            Direction::Torque => (4, "torque"),
        };
        let refuse = || LinkError::Jitter { direction };
        let mean = settings.latency.as_secs_f64();
        let delay = match &settings.jitter {
            Jitter::None => Delay::Constant,
            Jitter::Uniform { spread } => Delay::Uniform(mean, spread.as_secs_f64()),
            Jitter::Gamma { deviation } | Jitter::Normal { deviation } if deviation.is_zero() => {
                Delay::Constant
            }
            Jitter::Normal { deviation } => {
                Delay::Normal(Normal::new(mean, deviation.as_secs_f64()).map_err(|_| refuse())?)
            }
            Jitter::Gamma { deviation } => {
                let variance = deviation.as_secs_f64().powi(2);
                let (shape, scale) = (mean * mean / variance, variance / mean);
                Delay::Gamma(Gamma::new(shape, scale).map_err(|_| refuse())?)
            }
            Jitter::Replay { file } => Delay::Replay { latencies: read_latencies(file)?, next: 0 },
        };
        Ok(Self {
            latency_ns: settings.latency.as_nanos() as u64,
            delay,
            dropout: settings.dropout,
            is_bad: false,
            delays: Pcg64::new(u128::from(seed), stream),
            losses: Pcg64::new(u128::from(seed), stream + 1),
        })
    }

    /// The latency that the settings name, ns.
    #[inline(always)]
    pub fn latency_ns(&self) -> u64 {
        self.latency_ns
    }

    /// How long the next message travels, ns; `None` if it is lost.
    #[inline(always)]
    pub fn transit_ns(&mut self) -> Option<u64> {
        // Most links of a sweep neither vary nor lose, and each lane asks two at every sample.
        match (&self.delay, &self.dropout) {
            (Delay::Constant, Dropout::None) => Some(self.latency_ns),
            _ => self.draw(),
        }
    }

    /// Draws the latency and the loss of a message, ns. A lost message draws a latency, too, so
    /// that losses do not change the latencies of other messages.
    fn draw(&mut self) -> Option<u64> {
        let nanoseconds = |seconds: f64| (seconds.clamp(0.0, LONGEST) * 1e9).round() as u64;
        let latency_ns = match &mut self.delay {
            Delay::Constant => Some(self.latency_ns),
            Delay::Uniform(mean, spread) => {
                Some(nanoseconds(*mean + *spread * (2.0 * fraction(&mut self.delays) - 1.0)))
            }
            Delay::Normal(normal) => Some(nanoseconds(normal.sample(&mut self.delays))),
            Delay::Gamma(gamma) => Some(nanoseconds(gamma.sample(&mut self.delays))),
            Delay::Replay { latencies, next } => {
                let measured_ns = latencies[*next];
                *next = (*next + 1) % latencies.len();
                measured_ns.map(|measured_ns| self.latency_ns.saturating_add(measured_ns))
            }
        };
        let is_lost = self.loses();
        latency_ns.filter(|_| !is_lost)
    }

    fn loses(&mut self) -> bool {
        let probability = match self.dropout {
            Dropout::None => return false,
            Dropout::Independent(probability) => probability,
            Dropout::Burst { enter, leave, good, bad } => {
                let change = if self.is_bad { leave } else { enter };
                self.is_bad ^= fraction(&mut self.losses) < change;
                if self.is_bad { bad } else { good }
            }
        };
        fraction(&mut self.losses) < probability
    }
}

/// The word for a message that is lost.
const LOST: &str = "lost";

/// Reads the latencies of a replay, ns; `None` for a message that is lost.
fn read_latencies(file: &Path) -> Result<Vec<Option<u64>>, LinkError> {
    let named = || file.to_owned();
    let table =
        Table::read(file).map_err(|source| LinkError::Unreadable { file: named(), source })?;
    let units = [("latency_s", 1e9), ("latency_ms", 1e6), ("latency_us", 1e3), ("latency_ns", 1.0)];
    let (column, unit) = units
        .iter()
        .find_map(|(title, length)| Some((table.column(title)?, *length)))
        .ok_or_else(|| LinkError::NoColumn { file: named(), found: table.titles() })?;
    let latency = |(line, value): (u64, &str)| {
        if value == LOST {
            return Ok(None);
        }
        let nanoseconds = value.parse::<f64>().ok().map(|latency| latency * unit);
        let nanoseconds = nanoseconds.filter(|nanoseconds| (0.0..1e18).contains(nanoseconds));
        let refuse = || LinkError::Latency { file: named(), line, value: value.to_owned() };
        nanoseconds.map(|nanoseconds| Some(nanoseconds.round() as u64)).ok_or_else(refuse)
    };
    let latencies = table.cells(column).map(latency).collect::<Result<Vec<_>, _>>()?;
    if latencies.is_empty() {
        return Err(LinkError::Empty { file: named() });
    }
    Ok(latencies)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn link(jitter: Jitter, dropout: Dropout) -> Link {
        Link::new(&LinkSettings { latency: 5 * MS, jitter, dropout }, Direction::State, 7).unwrap()
    }

    /// Mean and standard deviation of many latencies, ms.
    fn moments(mut link: Link) -> (f64, f64) {
        let count = 100_000;
        let all: Vec<_> = (0..count).map(|_| link.transit_ns().unwrap() as f64 * 1e-6).collect();
        let mean = all.iter().sum::<f64>() / f64::from(count);
        let variance = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(count);
        (mean, variance.sqrt())
    }

    fn is_about((mean, deviation): (f64, f64), expected: (f64, f64)) -> bool {
        (mean - expected.0).abs() < 0.02 && (deviation - expected.1).abs() < 0.02
    }

    #[test]
    fn latencies_have_the_mean_and_the_deviation_that_were_asked_for() {
        let none = Dropout::None;
        assert_eq!(moments(link(Jitter::None, none)), (5.0, 0.0));
        let uniform = moments(link(Jitter::Uniform { spread: 3 * MS }, none));
        assert!(is_about(uniform, (5.0, 3f64.sqrt())), "{uniform:?}");
        let normal = moments(link(Jitter::Normal { deviation: MS }, none));
        assert!(is_about(normal, (5.0, 1.0)), "{normal:?}");
        let gamma = moments(link(Jitter::Gamma { deviation: 2 * MS }, none));
        assert!(is_about(gamma, (5.0, 2.0)), "{gamma:?}");
    }

    #[test]
    fn the_same_seed_gives_the_same_transits_and_the_directions_differ() {
        let settings = LinkSettings {
            latency: 5 * MS,
            jitter: Jitter::Gamma { deviation: MS },
            dropout: Dropout::Independent(0.2),
        };
        let transits = |direction, seed| -> Vec<_> {
            let mut link = Link::new(&settings, direction, seed).unwrap();
            (0..100).map(|_| link.transit_ns()).collect()
        };
        assert_eq!(transits(Direction::State, 1), transits(Direction::State, 1));
        assert_ne!(transits(Direction::State, 1), transits(Direction::State, 2));
        assert_ne!(transits(Direction::State, 1), transits(Direction::Torque, 1));
    }

    #[test]
    fn losses_do_not_change_the_latencies_of_what_arrives() {
        let jitter = Jitter::Normal { deviation: MS };
        let mut whole = link(jitter.clone(), Dropout::None);
        let mut lossy = link(jitter, Dropout::Independent(0.5));
        for _ in 0..100 {
            let all = whole.transit_ns();
            let some = lossy.transit_ns();
            assert!(some.is_none() || some == all);
        }
    }

    #[test]
    fn bursts_are_as_long_and_as_frequent_as_the_chain_says() {
        let burst = Dropout::Burst { enter: 0.02, leave: 0.25, good: 0.0, bad: 1.0 };
        let mut link = link(Jitter::None, burst);
        let lost: Vec<_> = (0..200_000).map(|_| link.transit_ns().is_none()).collect();
        let rate = lost.iter().filter(|lost| **lost).count() as f64 / lost.len() as f64;
        let bursts = lost.windows(2).filter(|pair| !pair[0] && pair[1]).count() as f64;
        let length = rate * lost.len() as f64 / bursts;
        assert!(
            (rate - 0.02 / 0.27).abs() < 0.003,
            "stationary probability of the bad state: {rate}"
        );
        assert!((length - 4.0).abs() < 0.15, "mean length of a burst 1/leave: {length}");
    }

    #[test]
    fn a_replay_loses_what_was_lost_and_skips_blank_lines_in_any_number_of_columns() {
        let file = std::env::temp_dir().join(format!("mtj-losses-{}.csv", std::process::id()));
        for text in
            ["latency_us\n\n1000\nlost\n \n0\n", "hop,latency_ms\n,\na,1\nb, lost\n , \nc,0\n"]
        {
            std::fs::write(&file, text).unwrap();
            let mut link = link(Jitter::Replay { file: file.clone() }, Dropout::None);
            let transits: Vec<_> = (0..4).map(|_| link.transit_ns()).collect();
            assert_eq!(transits, [Some(6_000_000), None, Some(5_000_000), Some(6_000_000)]);
        }
        std::fs::remove_file(&file).unwrap();
    }

    #[test]
    fn measured_latencies_are_replayed_in_their_order_and_round_again() {
        let file = std::env::temp_dir().join(format!("mtj-latencies-{}.csv", std::process::id()));
        std::fs::write(&file, "hop,latency_ms\na,1.5\nb,0\n\nc,20\n").unwrap();
        let mut link = link(Jitter::Replay { file: file.clone() }, Dropout::None);
        let transits: Vec<_> = (0..4).map(|_| link.transit_ns().unwrap() / 1000).collect();
        assert_eq!(transits, [6_500, 5_000, 25_000, 6_500]);
        for (text, complaint) in [
            ("latency\n1\n", "names no column"),
            ("a;latency_ms\n", "it names 'a;latency_ms'"),
            ("latency_s\n", "no latencies"),
            ("latency_s\n1\n-2\n", "line 3"),
            ("hop,latency_s\na,1\nb,\n", "line 3"),
        ] {
            std::fs::write(&file, text).unwrap();
            let error = read_latencies(&file).unwrap_err().to_string();
            assert!(error.contains(complaint), "{error}");
        }
        std::fs::remove_file(&file).unwrap();
        assert!(read_latencies(&file).unwrap_err().to_string().contains("cannot be read"));
    }
}
