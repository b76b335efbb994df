//! The messages to a page, as JSON.

use std::time::Duration;

use mtj_model::{
    gains::Gains,
    scenario::{FactorKind, Horizon, MemoryPolicy, Scenario, duration},
    trajectory::Trajectory,
};
use mtj_protocol::{
    port::Offered,
    sample::{ChangeSample, text_of},
};
use serde::{
    Serialize, Serializer,
    ser::{SerializeMap, SerializeSeq},
};
use serde_json::{Value, json};

use super::{
    Place,
    board::Board,
    history::{Bin, WIDTH_NS},
    series::NAMES,
};
use crate::overview::{Alarm, Overview, Party, Phase};

/// How many points draw the desired path.
const POINTS: usize = 400;
/// A role that says nothing at all for so long is silent, whatever the phase.
const SILENT: Duration = Duration::from_millis(2500);
/// Of a histogram: bins of equal width on a logarithmic axis, a decade.
const BINS_A_DECADE: i32 = 10;
/// Of a histogram: 1 µs to 1 s.
const DECADES: i32 = 6;

/// Which session this is.
pub fn hello(place: &Place, read_only: bool) -> String {
    json!({
        "kind": "hello",
        "session": place.session,
        "bus": place.bus,
        "version": env!("CARGO_PKG_VERSION"),
        "read_only": read_only,
    })
    .to_string()
}

/// What the plant offers.
pub fn scenario(offered: &Offered) -> String {
    let scenario = &offered.scenario;
    let limits = &scenario.safety.torque_limit;
    let is_limited = limits.iter().any(|limit| limit.is_finite());
    let links: Vec<f64> = scenario.arm.links.iter().map(|link| link.length).collect();
    json!({
        "kind": "scenario",
        "run": offered.run.to_string(),
        "revision": offered.revision,
        "name": scenario.name,
        "clock": scenario.timing.clock.name(),
        "joints": links.len(),
        "axes": mtj_model::PLANE,
        "links": links,
        "path": path(&scenario.trajectory),
        "torque_limit": is_limited.then_some(limits),
        "knobs": knobs(scenario),
    })
    .to_string()
}

/// The desired path over one period.
fn path(trajectory: &Trajectory<f64>) -> Vec<[f64; 2]> {
    let period = match trajectory {
        Trajectory::Circle(circle) | Trajectory::PerturbedCircle(circle, _) => {
            std::f64::consts::TAU / circle.angular_frequency.abs()
        }
        Trajectory::PointToPoint(line) => line.duration,
    };
    // A circle that stands still has no period.
    let period = if period.is_finite() { period } else { 0.0 };
    // To the micrometre: it is a line on a screen.
    let at = |i: usize| {
        let point = trajectory.at(period * i as f64 / (POINTS - 1) as f64).position;
        point.map(|x| (x * 1e6).round() / 1e6).into()
    };
    (0..POINTS).map(at).collect()
}

/// The knobs' positions, each as it would be set.
fn knobs(scenario: &Scenario) -> Value {
    let law = &scenario.law;
    json!({
        "law.kind": law.kind.name(),
        "law.kp": diagonal(&law.kp),
        "law.kd": diagonal(&law.kd),
        "law.factor.kind": match law.factor.kind {
            FactorKind::Switch => "switch",
            FactorKind::Exponential => "exponential",
            FactorKind::Diagonal => "diagonal",
        },
        "law.factor.error": law.factor.error.as_slice(),
        "law.factor.error_rate": law.factor.error_rate.as_slice(),
        "law.factor.ceiling": law.factor.ceiling,
        "law.memory.policy": match law.memory.policy {
            MemoryPolicy::Sent => "sent",
            MemoryPolicy::Applied => "applied",
            MemoryPolicy::Delivered => "delivered",
        },
        "law.memory.step": words(law.memory.step),
        "law.prediction.horizon": law.prediction.map(|horizon| match horizon {
            Horizon::Measured => "measured".to_owned(),
            Horizon::Fixed(horizon) => words(horizon),
        }),
        "timing.sample_period": words(scenario.timing.sample_period),
        "link.state.latency": words(scenario.link.state.latency),
        "link.torque.latency": words(scenario.link.torque.latency),
        "sensor.noise": scenario.noise,
    })
}

/// One number if all are the same; nothing if it takes a matrix to say it.
fn diagonal<const M: usize>(gains: &Gains<f64, M>) -> Value {
    match gains {
        Gains::Diagonal(diagonal) if diagonal.iter().all(|gain| *gain == diagonal[0]) => {
            json!(diagonal[0])
        }
        Gains::Diagonal(diagonal) => json!(diagonal.as_slice()),
        Gains::Full(_) => Value::Null,
    }
}

/// A duration without the blank before its unit.
fn words(length: Duration) -> String {
    if length.is_zero() { "0ms".to_owned() } else { duration::format(length).replace(' ', "") }
}

/// Bins, each of which spans the time of `span`.
pub fn bins(bins: &[Bin], span: u64) -> String {
    let bins =
        BinsMessage { kind: "bins", width: seconds(span), t: Starts(bins), series: Curves(bins) };
    // Fails only where a map's keys are no strings.
    serde_json::to_string(&bins).unwrap_or_default()
}

fn seconds(bins: u64) -> f64 {
    // Divided, not multiplied: that is the number nearest to the decimal fraction.
    bins as f64 / (1_000_000_000 / WIDTH_NS) as f64
}

#[derive(Serialize)]
struct BinsMessage<'a> {
    kind: &'static str,
    width: f64,
    t: Starts<'a>,
    series: Curves<'a>,
}

struct Starts<'a>(&'a [Bin]);

impl Serialize for Starts<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(|bin| seconds(bin.place)))
    }
}

/// The series that have a sample in any of the bins.
struct Curves<'a>(&'a [Bin]);

impl Serialize for Curves<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (series, name) in NAMES.iter().enumerate() {
            if self.0.iter().any(|bin| !bin.ranges[series].is_empty()) {
                map.serialize_entry(name, &Curve { bins: self.0, series })?;
            }
        }
        map.end()
    }
}

struct Curve<'a> {
    bins: &'a [Bin],
    series: usize,
}

impl Serialize for Curve<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut both = serializer.serialize_seq(Some(2))?;
        for max in [false, true] {
            both.serialize_element(&Edge { curve: self, max })?;
        }
        both.end()
    }
}

/// The lower or the upper edge of a curve; what is not a number becomes null.
struct Edge<'a> {
    curve: &'a Curve<'a>,
    max: bool,
}

impl Serialize for Edge<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.curve.bins.iter().map(|bin| {
            let range = bin.ranges[self.curve.series];
            if self.max { range.max } else { range.min }
        }))
    }
}

/// A change, or one that was refused.
pub fn mark(change: &ChangeSample) -> String {
    json!({
        "kind": "mark",
        "time": change.header.time_ns as f64 * 1e-9,
        "words": change.words(),
        "accepted": change.outcome().is_ok(),
        "reason": change.outcome().err(),
    })
    .to_string()
}

/// How things are at this moment.
pub fn now(board: &Board, dashboards: usize, with_histogram: bool) -> String {
    let overview = &board.overview;
    let header = overview.header().unwrap_or_default();
    let joints = header.joints as usize;
    let (state, status) = (overview.state.as_ref(), overview.status.as_ref());
    let measured_at = state.map(|state| state.header.time_ns as f64 * 1e-9);
    let scenario = overview.scenario.as_ref();
    let law = overview.law().or(scenario.map(|offered| offered.scenario.law.kind));
    let alarm = overview.alarm();
    let mut now = json!({
        "kind": "now",
        "time": overview.time(),
        "phase": overview.phase().map(phase),
        "alarm": alarm.map(|alarm| json!({ "code": code(alarm), "sentence": alarm.sentence() })),
        "q": state.map(|state| &state.position[..joints]),
        "true_q": status.map(|status| &status.position[..joints]),
        "desired": measured_at.and_then(|time| board.readings.desired(time)),
        "law": law.map(|law| law.name()),
        "counts": status.map(|status| json!({
            "sent": status.sent,
            "applied": status.applied,
            "lost": status.lost,
            "late": status.late,
            "rejected": status.rejected,
            "misses": status.deadline_misses,
            "timeouts": status.timeouts,
            "takeovers": status.takeovers,
            "missed_here": overview.missed,
            "late_here": board.late(),
        })),
        "round_trip": overview.round_trips.spread(),
        "residence": overview.residence.spread(),
        "period_deviation": overview.period_deviation.spread(),
        "roles": [
            role("plant", overview.plant(), matches!(alarm, Some(Alarm::PlantSilent(_)))),
            role("controller", overview.controller(), matches!(alarm, Some(Alarm::ControllerSilent(_)))),
        ],
        "standing_by": overview.standing_by(),
        "dashboards": dashboards,
    });
    if with_histogram {
        now["histogram"] = histogram(overview);
    }
    now.to_string()
}

fn phase(phase: Phase) -> &'static str {
    match phase {
        Phase::Waiting => "waiting",
        Phase::Running => "running",
        Phase::Finished => "finished",
        Phase::Paused => "paused",
    }
}

fn code(alarm: Alarm) -> &'static str {
    match alarm {
        Alarm::NoPlant => "no_plant",
        Alarm::PlantSilent(_) => "plant_silent",
        Alarm::NoController => "no_controller",
        Alarm::ControllerSilent(_) => "controller_silent",
    }
}

fn role(name: &str, party: &Party, is_missed: bool) -> Value {
    let state = match party.silence() {
        None => "absent",
        Some(silence) if is_missed || silence > SILENT => "silent",
        Some(_) => "connected",
    };
    json!({
        "role": name,
        "state": state,
        "since_s": party.since.map(|since| since.elapsed().as_secs_f64()),
        "heard_s": party.silence().map(|silence| silence.as_secs_f64()),
        "host": party.presence.as_ref().map(|presence| text_of(&presence.host)),
        "process": party.presence.map(|presence| presence.process),
    })
}

fn histogram(overview: &Overview) -> Value {
    let edges_us: Vec<f64> = (0..=BINS_A_DECADE * DECADES)
        .map(|edge| 10_f64.powf(f64::from(edge) / f64::from(BINS_A_DECADE)))
        .collect();
    let edges_ns: Vec<u64> = edges_us.iter().map(|edge| (edge * 1e3).round() as u64).collect();
    json!({
        "edges_us": edges_us,
        "round_trip": overview.round_trips.counts(&edges_ns),
        "residence": overview.residence.counts(&edges_ns),
    })
}
