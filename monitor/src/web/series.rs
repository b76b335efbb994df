//! The series that are plotted, and which numbers a message contributes to them.

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

use crate::overview::{period_deviation_ns, reports_new_torque};

/// The indices of the series of each quantity.
#[derive(Debug, Default)]
pub(super) struct SeriesIndex {
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
    /// Deviation of a sample period from the nominal one, µs.
    period_deviation: usize,
    /// Number of commands that never came.
    lost: usize,
    /// Number of commands that came late.
    late: usize,
    /// Number of torque samples that the plant rejected.
    rejected: usize,
    /// Number of deadline misses.
    misses: usize,
    /// The measured tip, m.
    tip: Vec<usize>,
    /// The true tip, m.
    true_tip: Vec<usize>,
    laws: Vec<LawSeries>,
}

/// The series of the numbers of a law's echo and signals, in the order of the wire.
#[derive(Debug)]
struct LawSeries {
    name: Name,
    echo: Vec<usize>,
    signals: Vec<usize>,
}

impl SeriesIndex {
    fn new(scenario: &Scenario, scene: &Scene) -> Self {
        let (joints, axes) = (scenario.arm.links.len(), scene.task().axes.len());
        let mut names = Vec::new();
        let mut one = |name: &str| add(&mut names, name.to_owned());
        let mut index = Self {
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
        index.error = list("error", axes);
        index.torque = list("torque", joints);
        index.tip = list("tip", scene.dimensions());
        index.true_tip = list("true_tip", scene.dimensions());
        let mut signal = |signal: &Signal| list(signal.key, signal.per.count(joints, axes));
        index.laws.extend(LAWS.iter().map(|law| LawSeries {
            name: text(law.name),
            echo: signal(&law.echo),
            signals: law.signals.iter().flat_map(&mut signal).collect(),
        }));
        index.names = names;
        index
    }

    /// The names of all series.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// The index of a series.
    #[cfg(test)]
    pub(super) fn position(&self, name: &str) -> usize {
        self.names.iter().position(|known| known == name).unwrap()
    }

    fn law(&self, name: &Name) -> Option<&LawSeries> {
        self.laws.iter().find(|law| law.name == *name)
    }
}

/// The index of a name, which is added if it is new: laws share series of the same name.
fn add(names: &mut Vec<String>, name: String) -> usize {
    names.iter().position(|known| *known == name).unwrap_or_else(|| {
        names.push(name);
        names.len() - 1
    })
}

/// Extracts the plotted numbers from messages.
#[derive(Default)]
pub(super) struct SeriesReader {
    scene: Option<Scene>,
    index: Arc<SeriesIndex>,
    law: Name,
    before: Option<StateSample>,
}

impl SeriesReader {
    /// Sets the scenario of the following messages.
    pub(super) fn set_scenario(&mut self, scenario: &Scenario) {
        let scene = Scene::new(scenario);
        self.index = Arc::new(SeriesIndex::new(scenario, &scene));
        self.scene = Some(scene);
        self.law = text(scenario.law.law.description().name);
    }

    /// The scene of the scenario; `None` before the first scenario.
    pub(super) fn scene(&self) -> Option<&Scene> {
        self.scene.as_ref()
    }

    /// The series; empty before the first scenario.
    pub(super) fn index(&self) -> &Arc<SeriesIndex> {
        &self.index
    }

    /// Passes all plotted numbers of a message to `put`, each with the index of its series.
    pub(super) fn read(&mut self, message: &Message, put: &mut dyn FnMut(usize, f64)) {
        let Some(scene) = &self.scene else { return };
        match message {
            Message::State(state) => {
                read_state(&self.index, scene, self.before.as_ref(), state, put);
                self.before = Some(*state);
            }
            Message::Torque(torque) => read_torque(&self.index, &self.law, torque, put),
            Message::Error(error) => {
                self.law = error.law;
                read_error(&self.index, error, put);
            }
            Message::Status(status) => read_status(&self.index, scene, status, put),
            Message::Scenario(_)
            | Message::Request(_)
            | Message::Change(_)
            | Message::Presence(_) => {}
        }
    }
}

fn read_state(
    index: &SeriesIndex,
    scene: &Scene,
    before: Option<&StateSample>,
    state: &StateSample,
    put: &mut dyn FnMut(usize, f64),
) {
    // Times are zero before the first torque.
    let mut put_ns = |series: usize, ns: u64, unit: f64| {
        if ns > 0 {
            put(series, ns as f64 / unit);
        }
    };
    if before.is_none_or(|before| reports_new_torque(before, state)) {
        put_ns(index.round_trip, state.round_trip_ns, 1e3);
        put_ns(index.residence, state.residence_ns, 1e3);
    }
    put_ns(index.latency, state.latency_ns, 1e6);
    if let Some(deviation) = before.and_then(|before| period_deviation_ns(before, state)) {
        put(index.period_deviation, deviation as f64 / 1e3);
    }
    let error = scene.error(state.header.time_ns as f64 * 1e-9, &state.position);
    put_list(put, &index.error, &error);
    put(index.error_norm, norm(&error));
    put_list(put, &index.tip, &scene.tip(&state.position));
}

fn read_torque(
    index: &SeriesIndex,
    law: &Name,
    torque: &TorqueSample,
    put: &mut dyn FnMut(usize, f64),
) {
    put_list(put, &index.torque, &torque.torque);
    if let Some(law) = index.law(law) {
        put_list(put, &law.echo, &torque.echo[..torque.echo_count as usize]);
    }
}

fn read_error(index: &SeriesIndex, error: &ErrorSample, put: &mut dyn FnMut(usize, f64)) {
    put(index.law_error_norm, norm(&error.error));
    if let Some(law) = index.law(&error.law) {
        put_list(put, &law.signals, &error.signals);
    }
}

fn read_status(
    index: &SeriesIndex,
    scene: &Scene,
    status: &StatusSample,
    put: &mut dyn FnMut(usize, f64),
) {
    put(index.lost, status.lost as f64);
    put(index.late, status.late as f64);
    put(index.rejected, status.rejected as f64);
    put(index.misses, status.deadline_misses as f64);
    put_list(put, &index.true_tip, &scene.tip(&status.position));
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

    fn reader(law: &str) -> SeriesReader {
        let mut reader = SeriesReader::default();
        reader.set_scenario(&Scenario::load(law, &[]).unwrap());
        reader
    }

    #[test]
    fn the_series_are_those_of_the_arm_the_task_and_all_laws() {
        let reader = reader("sampled/tj");
        let names = reader.index().names();
        for name in ["error.1", "torque.1", "tip.1", "force.1", "factor.1", "memory.0"] {
            assert_eq!(names.iter().filter(|known| *known == name).count(), 1, "{name}");
        }
        assert!(!names.iter().any(|name| name == "torque.2" || name == "force.2"));
    }

    #[test]
    fn signals_are_told_apart_by_the_law_that_they_are_of() {
        let mut reader = reader("sampled/mtj");
        let header = Header { version: VERSION, joints: 2, axes: 2, ..Header::default() };
        let mut read = |message| {
            let mut found = Vec::new();
            let index = Arc::clone(reader.index());
            reader.read(&message, &mut |series, value| {
                found.push((index.names()[series].clone(), value));
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
