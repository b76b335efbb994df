//! The messages to a page, as JSON.

use std::time::Duration;

use mtj_model::{
    law::{
        Description, LAWS, Parameter, Per, Signal,
        describe::{Default, Form},
    },
    scenario::{FRICTION, MEMORY, PREDICTION, Scenario, duration},
    scene::{Point, Scene},
    task,
};
use mtj_protocol::{
    port::Offered,
    sample::{ChangeSample, Phase, text_of},
};
use serde::{
    Serialize, Serializer,
    ser::{SerializeMap, SerializeSeq},
};
use serde_json::{Value, json};

use super::{
    SessionInfo,
    history::{Bin, WIDTH_NS},
    series::SeriesIndex,
    store::{Store, Update},
};
use crate::overview::{Alarm, Overview, RoleStatus};

/// A role without a message for this long is silent, whatever the phase.
const SILENT: Duration = Duration::from_millis(2500);
/// Histogram bins in a decade; they have equal width on a logarithmic axis.
const BINS_A_DECADE: i32 = 10;
/// Decades of a histogram, from 1 µs to 1 s.
const DECADES: i32 = 6;

/// The first message: the session and the laws.
pub(super) fn hello(index: &SessionInfo, read_only: bool, saves: bool) -> String {
    json!({
        "kind": "hello",
        "session": index.session,
        "bus": index.bus,
        "version": env!("CARGO_PKG_VERSION"),
        "read_only": read_only,
        "saves": saves,
        "laws": LAWS.iter().map(|law| described(law)).collect::<Vec<_>>(),
    })
    .to_string()
}

/// A law with its parameters and its signals.
fn described(law: &Description) -> Value {
    json!({
        "name": law.name,
        "title": law.title,
        "equation": law.equation,
        "parameters": parameters(law).map(parameter).collect::<Vec<_>>(),
        "signals": std::iter::once(&law.echo).chain(law.signals).map(signal).collect::<Vec<_>>(),
    })
}

/// All parameters of a law: its own, and those of memory and prediction.
fn parameters(law: &Description) -> impl Iterator<Item = &'static Parameter> {
    let memory = if law.has_memory { MEMORY } else { &[] };
    memory.iter().chain(PREDICTION).chain(law.parameters)
}

fn parameter(parameter: &Parameter) -> Value {
    let (form, words): (_, &[&str]) = match parameter.form {
        Form::Choice(words) => ("choice", words),
        Form::Number(_) => ("number", &[]),
        Form::List(_) | Form::JointList(_) => ("list", &[]),
        Form::Matrix => ("matrix", &[]),
        Form::MatrixOr(words) => ("matrix", words),
        Form::Flag => ("choice", &["false", "true"]),
        Form::Duration(_) => ("duration", &[]),
        Form::DurationOr(words) => ("duration", words),
        _ => ("text", &[]), // No law has a key of another form.
    };
    json!({
        "key": parameter.key,
        "label": parameter.label,
        "form": form,
        "words": words,
        "unit": parameter.unit,
        "default": match parameter.default {
            Default::Required | Default::Words(_) => Value::Null,
            Default::Value(value) => value.into(),
            Default::SameAs(key) => key.into(),
        },
        "help": parameter.help,
    })
}

fn signal(signal: &Signal) -> Value {
    json!({
        "key": signal.key,
        "symbol": signal.symbol,
        "title": signal.title,
        "unit": signal.unit,
        "per": match signal.per {
            Per::Axis => "axis",
            Per::Joint => "joint",
            Per::Arm => "arm",
        },
        "range": signal.range,
    })
}

fn axis(axis: &task::Axis) -> Value {
    json!({ "name": axis.name, "unit": axis.unit })
}

/// A scenario.
pub(super) fn scenario(offered: &Offered) -> String {
    let scenario = &offered.scenario;
    let limits = &scenario.safety.torque_limit;
    let scene = Scene::new(scenario);
    json!({
        "kind": "scenario",
        "run": offered.run.to_string(),
        "revision": offered.revision,
        "name": scenario.name,
        "clock": scenario.timing.clock.name(),
        "joints": scenario.arm.links.len(),
        "axes": scene.task().axes.iter().map(axis).collect::<Vec<_>>(),
        "reach": scene.reach(),
        "path": scene.path().iter().map(|point| to_the_micrometre(*point)).collect::<Vec<_>>(),
        "torque_limit": limits,
        "knobs": knobs(scenario),
    })
    .to_string()
}

/// Rounds a point of a line on the screen.
fn to_the_micrometre(point: Point) -> Point {
    point.map(|x| (x * 1e6).round() / 1e6)
}

/// The values of all knobs, each as it would be set.
fn knobs(scenario: &Scenario) -> Value {
    let mut knobs = json!({
        "law.kind": scenario.law.law.description().name,
        "timing.sample_period": words(scenario.timing.sample_period),
        "link.state.latency": words(scenario.link.state.latency),
        "link.torque.latency": words(scenario.link.torque.latency),
        "sensor.noise": scenario.noise,
    });
    let settings = scenario.settings();
    for parameter in FRICTION.iter().copied().chain(parameters(scenario.law.law.description())) {
        knobs[parameter.key] = json!(settings.get(parameter));
    }
    knobs
}

/// A duration without the space before its unit.
fn words(length: Duration) -> String {
    if length.is_zero() { "0ms".to_owned() } else { duration::format(length).replace(' ', "") }
}

/// The bins of an update.
pub(super) fn bins(Update { index, bins, span, .. }: &Update) -> String {
    let bins = BinsMessage {
        kind: "bins",
        width: seconds(*span),
        t: Starts(bins),
        series: Curves { index, bins },
    };
    // Fails only if a map's keys are not strings.
    serde_json::to_string(&bins).unwrap_or_default()
}

fn seconds(bins: u64) -> f64 {
    // A division, since it gives the number nearest to the decimal fraction.
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
        serializer.collect_seq(self.0.iter().map(|bin| seconds(bin.number)))
    }
}

/// The series that have a sample in at least one of the bins.
struct Curves<'a> {
    index: &'a SeriesIndex,
    bins: &'a [Bin],
}

impl Serialize for Curves<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (series, name) in self.index.names().iter().enumerate() {
            if self.bins.iter().any(|bin| !bin.ranges[series].is_empty()) {
                map.serialize_entry(name, &Curve { bins: self.bins, series })?;
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

/// The lower or the upper edge of a curve; NaN becomes null.
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

/// An accepted or refused change.
pub(super) fn change(change: &ChangeSample) -> String {
    json!({
        "kind": "mark",
        "time": change.header.time_ns as f64 * 1e-9,
        "words": change.words(),
        "accepted": change.outcome().is_ok(),
        "reason": change.outcome().err(),
    })
    .to_string()
}

/// The current state of the session.
pub(super) fn now(store: &Store, dashboards: usize, with_histogram: bool) -> String {
    let overview = &store.overview;
    let (state, status) = (overview.state.as_ref(), overview.status.as_ref());
    let scene = store.reader.scene();
    let alarm = overview.alarm();
    let mut now = json!({
        "kind": "now",
        "time": overview.time(),
        "phase": overview.phase().map(Phase::name),
        "joined": overview.joined().map(|joined| json!({
            "time": joined.time_ns as f64 * 1e-9,
            "words": joined.words(),
        })),
        "alarm": alarm.map(|alarm| json!({ "code": code(alarm), "sentence": alarm.sentence() })),
        "arm": scene.zip(state).map(|(scene, state)| scene.points(&state.position)),
        "true_arm": scene.zip(status).map(|(scene, status)| scene.points(&status.position)),
        "desired": scene.zip(state).map(|(scene, _)| scene.desired(overview.time())),
        "law": overview.law().map(|law| law.name),
        "counts": status.map(|status| json!({
            "sent": status.sent,
            "applied": status.applied,
            "lost": status.lost,
            "too_old": status.too_old,
            "late": status.late,
            "rejected": status.rejected,
            "misses": status.deadline_misses,
            "stalls": status.stalls,
            "timeouts": status.timeouts,
            "takeovers": status.takeovers,
            "missed_here": overview.missed,
            "late_here": store.late(),
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

fn code(alarm: Alarm) -> &'static str {
    match alarm {
        Alarm::NoPlant => "no_plant",
        Alarm::PlantSilent(_) => "plant_silent",
        Alarm::NoController => "no_controller",
        Alarm::ControllerSilent(_) => "controller_silent",
        Alarm::TwoPlants(..) => "two_plants",
        Alarm::Diverged(_) => "diverged",
        Alarm::Stopped => "stopped",
        Alarm::SafeState { .. } => "safe_state",
    }
}

fn role(name: &str, status: &RoleStatus, has_alarm: bool) -> Value {
    let state = match status.silence() {
        None => "absent",
        Some(silence) if has_alarm || silence > SILENT => "silent",
        Some(_) => "connected",
    };
    json!({
        "role": name,
        "state": state,
        "since_s": status.age().map(|age| age.as_secs_f64()),
        "heard_s": status.silence().map(|silence| silence.as_secs_f64()),
        "host": status.presence.as_ref().map(|presence| text_of(&presence.host)),
        "process": status.presence.map(|presence| presence.process),
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
