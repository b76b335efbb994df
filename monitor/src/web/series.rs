//! The numbers that are plotted, and which of them a message contributes.

use std::sync::Arc;

use mtj_model::{
    law::{LAWS, Signal},
    scenario::Scenario,
    scene::Scene,
};
use mtj_protocol::{
    port::Message,
    sample::{ErrorSample, Name, StateSample, StatusSample, TorqueSample, text},
};

use crate::overview::{period_deviation_ns, tells_of_another_torque};

/// Where the series of each quantity stand.
#[derive(Debug, Default)]
pub struct Table {
    names: Vec<String>,
    /// Desired − measured at the state's own time stamp, for each task axis.
    error: Vec<usize>,
    /// Its Euclidean norm.
    error_norm: usize,
    /// Norm of the error as the law used it.
    law_error_norm: usize,
    /// Joint torques as commanded, N m.
    torque: Vec<usize>,
    /// State sent to torque received, µs.
    round_trip: usize,
    /// The part of it spent in the controller, µs.
    residence: usize,
    /// Sample instant to application of the last applied command, ms.
    latency: usize,
    /// By how much a sample period differed from what it should be, µs.
    period_deviation: usize,
    /// Commands that never came, so far.
    lost: usize,
    /// Commands that came late, so far.
    late: usize,
    /// Torque samples that were not acceptable, so far.
    rejected: usize,
    /// Sampling instants missed, so far.
    misses: usize,
    /// The measured tip, m.
    tip: Vec<usize>,
    /// The true tip, m.
    true_tip: Vec<usize>,
    laws: Vec<LawSeries>,
}

/// The series of each number of a law's echo and signals, in the order of the wire.
#[derive(Debug)]
struct LawSeries {
    name: Name,
    echo: Vec<usize>,
    signals: Vec<usize>,
}

impl Table {
    fn new(scenario: &Scenario, scene: &Scene) -> Self {
        let (joints, axes) = (scenario.arm.links.len(), scene.task().axes.len());
        let mut names = Vec::new();
        let mut one = |name: &str| add(&mut names, name.to_owned());
        let mut table = Self {
            error_norm: one("error.norm"),
            law_error_norm: one("law_error.norm"),
            round_trip: one("round_trip"),
            residence: one("residence"),
            latency: one("latency"),
            period_deviation: one("period_deviation"),
            lost: one("lost"),
            late: one("late"),
            rejected: one("rejected"),
            misses: one("misses"),
            ..Self::default()
        };
        let mut list = |key: &str, count: usize| -> Vec<usize> {
            (0..count).map(|i| add(&mut names, format!("{key}.{i}"))).collect()
        };
        table.error = list("error", axes);
        table.torque = list("torque", joints);
        table.tip = list("tip", scene.dimensions());
        table.true_tip = list("true_tip", scene.dimensions());
        let mut signal = |signal: &Signal| list(signal.key, signal.per.count(joints, axes));
        table.laws.extend(LAWS.iter().map(|law| LawSeries {
            name: text(law.name),
            echo: signal(&law.echo),
            signals: law.signals.iter().flat_map(&mut signal).collect(),
        }));
        table.names = names;
        table
    }

    /// The names of all series.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The place of a series.
    #[cfg(test)]
    pub fn place(&self, name: &str) -> usize {
        self.names.iter().position(|known| known == name).unwrap()
    }

    fn law(&self, name: &Name) -> Option<&LawSeries> {
        self.laws.iter().find(|law| law.name == *name)
    }
}

/// The place of a name, at the end if it is new: laws share what they call the same.
fn add(names: &mut Vec<String>, name: String) -> usize {
    names.iter().position(|known| *known == name).unwrap_or_else(|| {
        names.push(name);
        names.len() - 1
    })
}

/// Reads numbers off messages.
#[derive(Default)]
pub struct Readings {
    scene: Option<Scene>,
    table: Arc<Table>,
    law: Name,
    before: Option<StateSample>,
}

impl Readings {
    /// From now on messages are about this scenario.
    pub fn follow(&mut self, scenario: &Scenario) {
        let scene = Scene::new(scenario);
        self.table = Arc::new(Table::new(scenario, &scene));
        self.scene = Some(scene);
        self.law = text(scenario.law.law.description().name);
    }

    /// The scene of the scenario, once that is known.
    pub fn scene(&self) -> Option<&Scene> {
        self.scene.as_ref()
    }

    /// The series, of which there are none before a scenario is known.
    pub fn table(&self) -> &Arc<Table> {
        &self.table
    }

    /// Hands over all numbers that a message holds, each with the place of its series.
    pub fn read(&mut self, message: &Message, put: &mut dyn FnMut(usize, f64)) {
        let Some(scene) = &self.scene else { return };
        match message {
            Message::State(state) => {
                read_state(&self.table, scene, self.before.as_ref(), state, put);
                self.before = Some(*state);
            }
            Message::Torque(torque) => read_torque(&self.table, &self.law, torque, put),
            Message::Error(error) => {
                self.law = error.law;
                read_error(&self.table, error, put);
            }
            Message::Status(status) => read_status(&self.table, scene, status, put),
            Message::Scenario(_)
            | Message::Request(_)
            | Message::Change(_)
            | Message::Presence(_) => {}
        }
    }
}

fn read_state(
    table: &Table,
    scene: &Scene,
    before: Option<&StateSample>,
    state: &StateSample,
    put: &mut dyn FnMut(usize, f64),
) {
    // Stamps are zero before there was anything to time.
    let mut put_ns = |series: usize, ns: u64, unit: f64| {
        if ns > 0 {
            put(series, ns as f64 / unit);
        }
    };
    if before.is_none_or(|before| tells_of_another_torque(before, state)) {
        put_ns(table.round_trip, state.round_trip_ns, 1e3);
        put_ns(table.residence, state.residence_ns, 1e3);
    }
    put_ns(table.latency, state.latency_ns, 1e6);
    if let Some(deviation) = before.and_then(|before| period_deviation_ns(before, state)) {
        put(table.period_deviation, deviation as f64 / 1e3);
    }
    let error = scene.error(state.header.time_ns as f64 * 1e-9, &state.position);
    put_list(put, &table.error, &error);
    put(table.error_norm, norm(&error));
    put_list(put, &table.tip, &scene.tip(&state.position));
}

fn read_torque(table: &Table, law: &Name, torque: &TorqueSample, put: &mut dyn FnMut(usize, f64)) {
    put_list(put, &table.torque, &torque.torque);
    if let Some(law) = table.law(law) {
        put_list(put, &law.echo, &torque.echo[..torque.echo_count as usize]);
    }
}

fn read_error(table: &Table, error: &ErrorSample, put: &mut dyn FnMut(usize, f64)) {
    put(table.law_error_norm, norm(&error.error));
    if let Some(law) = table.law(&error.law) {
        put_list(put, &law.signals, &error.signals);
    }
}

fn read_status(
    table: &Table,
    scene: &Scene,
    status: &StatusSample,
    put: &mut dyn FnMut(usize, f64),
) {
    put(table.lost, status.lost as f64);
    put(table.late, status.late as f64);
    put(table.rejected, status.rejected as f64);
    put(table.misses, status.deadline_misses as f64);
    put_list(put, &table.true_tip, &scene.tip(&status.position));
}

/// As many values as there are series for them.
fn put_list(put: &mut dyn FnMut(usize, f64), series: &[usize], values: &[f64]) {
    series.iter().zip(values).for_each(|(series, value)| put(*series, *value));
}

/// Entries past the last axis are zero.
fn norm(vector: &[f64]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use mtj_protocol::sample::{Header, VERSION, padded};

    use super::*;

    fn readings(law: &str) -> Readings {
        let mut readings = Readings::default();
        readings.follow(&Scenario::load(law, &[]).unwrap());
        readings
    }

    #[test]
    fn the_series_are_those_of_the_arm_the_task_and_all_laws() {
        let readings = readings("sampled/tj");
        let names = readings.table().names();
        for name in ["error.1", "torque.1", "tip.1", "force.1", "factor.1", "memory.0"] {
            assert_eq!(names.iter().filter(|known| *known == name).count(), 1, "{name}");
        }
        assert!(!names.iter().any(|name| name == "torque.2" || name == "force.2"));
    }

    #[test]
    fn signals_are_told_apart_by_the_law_that_they_are_of() {
        let mut readings = readings("sampled/mtj");
        let header = Header { version: VERSION, joints: 2, axes: 2, ..Header::default() };
        let mut read = |message| {
            let mut found = Vec::new();
            let table = Arc::clone(readings.table());
            readings.read(&message, &mut |series, value| {
                found.push((table.names()[series].clone(), value));
            });
            found
        };
        let signals = padded(&[0.25, 0.5, 3.0, 4.0]);
        let error = |law| ErrorSample { header, law: text(law), signals, ..Default::default() };
        let found = read(Message::Error(error("mtj")));
        let expected =
            [("factor.0", 0.25), ("factor.1", 0.5), ("memory.0", 3.0), ("memory.1", 4.0)];
        assert_eq!(found[1..], expected.map(|(name, value)| (name.to_owned(), value)));
        for law in ["tj", "unheard-of"] {
            assert_eq!(read(Message::Error(error(law))).len(), 1, "{law} shows nothing of its own");
        }
        let torque = |echo_count| TorqueSample {
            header,
            echo_count,
            echo: padded(&[7.0, 8.0]),
            ..Default::default()
        };
        assert_eq!(read(Message::Torque(torque(2))).len(), 2, "an unknown law's echo is not shown");
        read(Message::Error(error("tj")));
        let found = read(Message::Torque(torque(2)));
        assert_eq!(found[2..], [("force.0".to_owned(), 7.0), ("force.1".to_owned(), 8.0)]);
    }
}
