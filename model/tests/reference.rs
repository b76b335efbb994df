//! The reference of keys against what the reader knows.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::collections::BTreeSet;

use mtj_model::{
    law::describe::Default,
    scenario::{BUILT_IN, Override, Scenario, ScenarioError, reference, reference_page},
};
use toml::{Table, Value};

/// A scenario of each kind of table, as overrides of `sampled/mtj`.
const KINDS: [&[&str]; 11] = [
    &["arm.links[0].center=0.5", "task.kind=plane", "sensor.noise=0", "safety.damping=1"],
    &["law.kind=tj", "trajectory={kind='circle', radius=1, angular_frequency=1}"],
    &["law.kind=mb", "trajectory={kind='point-to-point', from=[1,1], to=[0,1], duration='1s'}"],
    &["law.kind=tdc", "law.mass=2", "link.state.jitter={kind='replay', file='here.csv'}"],
    &["trajectory={kind='file', points=[[0, 1, 1], [1, 0, 1]]}"],
    &["link.state.latency=1ms", "link.state.jitter={kind='uniform', spread='1ms'}"],
    &[
        "link.state.latency=1ms",
        "link.state.jitter={kind='gamma', deviation='1ms'}",
        "bus.kind=local",
    ],
    &[
        "trajectory.transition={begin=1.0, duration=1.0, shift=0.5, offset=[[0.1, 0], [0, 0], [0, 0]]}",
    ],
    &["arm.friction={}", "actuator={}", "encoder={}", "load=[{at='1s', mass=1.0}]"],
    &["wall={point=[0, -3], normal=[0, 1]}"],
    &["link.state.dropout={enter=0.1, leave=0.5}", "law.prediction.horizon=none", "law.model={}"],
];

fn load(sets: &[&str]) -> Result<Scenario, ScenarioError> {
    let sets: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
    Scenario::load("sampled/mtj", &sets)
}

/// The paths of all keys of the reference.
fn paths() -> BTreeSet<&'static str> {
    reference().iter().flat_map(|table| &table.keys).map(|parameter| parameter.key).collect()
}

/// A path as the reference writes it: any entry, either direction.
fn general(path: &str) -> String {
    let path = path.replace("link.state", "link.*").replace("link.torque", "link.*");
    (0..3).fold(path, |path, i| path.replace(&format!("[{i}]"), "[]"))
}

/// The paths of the tables and of the values of a TOML document.
fn walk(path: &str, value: &Value, tables: &mut BTreeSet<String>, keys: &mut BTreeSet<String>) {
    match value {
        Value::Table(table) => {
            tables.insert(path.to_owned());
            for (key, value) in table {
                let dot = if path.is_empty() { "" } else { "." };
                walk(&format!("{path}{dot}{key}"), value, tables, keys);
            }
        }
        Value::Array(list) if list.iter().all(Value::is_table) => {
            for (i, value) in list.iter().enumerate() {
                walk(&format!("{path}[{i}]"), value, tables, keys);
            }
        }
        _ => {
            keys.insert(general(path));
        }
    }
}

fn tables_and_keys(text: &str) -> (BTreeSet<String>, BTreeSet<String>) {
    let mut found = (BTreeSet::new(), BTreeSet::new());
    walk("", &text.parse::<Table>().unwrap().into(), &mut found.0, &mut found.1);
    found
}

#[test]
fn every_key_of_a_built_in_scenario_is_in_the_reference() {
    let paths = paths();
    for (name, text) in BUILT_IN {
        for key in tables_and_keys(text).1 {
            assert!(paths.contains(key.as_str()), "{name}: {key}");
        }
    }
}

#[test]
fn the_reader_knows_the_keys_of_the_reference_and_no_others_and_lists_each_once() {
    let paths = paths();
    let mut seen = BTreeSet::new();
    for sets in KINDS {
        for table in tables_and_keys(load(sets).unwrap().text()).0 {
            let dot = if table.is_empty() { "" } else { "." };
            let unknown = format!("{table}{dot}no_such_key=1");
            let error = load(&[sets, &[unknown.as_str()]].concat()).unwrap_err();
            let ScenarioError::UnknownKey { known, .. } = error else {
                panic!("{unknown}: {error}")
            };
            let known: Vec<_> = known.split(", ").collect();
            let once: BTreeSet<_> = known.iter().collect();
            assert_eq!(once.len(), known.len(), "{table}: {known:?}");
            for name in known {
                let path = general(&format!("{table}{dot}{name}"));
                let is_table = |key: &&str| {
                    key.strip_prefix(&path).is_some_and(|rest| rest.starts_with(['.', '[']))
                };
                assert!(paths.contains(path.as_str()) || paths.iter().any(is_table), "{path}");
                seen.insert(path);
            }
        }
    }
    let unknown: Vec<_> = paths.iter().filter(|path| !seen.contains(**path)).collect();
    assert_eq!(unknown, [&""; 0], "the reader knows none of these");
}

#[test]
fn a_declared_default_is_what_is_in_effect_without_the_key() {
    for sets in KINDS {
        let plain = load(sets).unwrap();
        let (tables, keys) = tables_and_keys(plain.text());
        let tables: BTreeSet<_> = tables.iter().map(|table| general(table)).collect();
        let law = plain.law.law.description();
        let others = |key: &str| {
            key.starts_with("law.") && !law.parameters.iter().any(|parameter| parameter.key == key)
        };
        for parameter in law.parameters.iter().chain(
            reference().iter().flat_map(|table| &table.keys).copied().filter(|p| !others(p.key)),
        ) {
            let Default::Value(value) = parameter.default else { continue };
            let table = parameter.key.rsplit_once('.').map_or("", |(table, _)| table);
            // Keys of a kind that this scenario is not of, and keys that are set.
            let is_optional = ["sensor", "safety", "bus", "law.factor", "law.model", "link.*"];
            let is_of_kind = tables.contains(table) || is_optional.contains(&table);
            let is_other = |kind: &str, key: &str| {
                let is_kind = plain.text().contains(&format!("kind = \"{kind}\""));
                table == "trajectory" && is_kind != (parameter.key == key)
            };
            let is_of_kind = is_of_kind
                && !(table == "trajectory" && plain.text().contains("point-to-point"))
                && !is_other("file", "trajectory.order");
            if !is_of_kind || keys.contains(parameter.key) {
                continue;
            }
            let set = format!("{}={value}", parameter.key.replace("link.*", "link.state"));
            let set = load(&[sets, &[set.as_str()]].concat()).unwrap();
            let of = |s: &Scenario| {
                (
                    (s.duration, s.seed, s.arm.clone(), s.trajectory, s.law.clone()),
                    (s.timing, s.link.clone(), s.noise, s.bus.clone(), s.safety.clone()),
                )
            };
            assert_eq!(of(&set), of(&plain), "{} = {value}", parameter.key);
        }
    }
}

#[test]
fn the_page_has_a_row_for_every_key_with_its_meaning() {
    let page = reference_page();
    for table in reference() {
        assert!(page.contains(&format!("\n## {}\n", table.title)), "{}", table.title);
        for parameter in table.keys {
            let begin = format!("| `{}` | ", parameter.key);
            let line = page.lines().find(|line| line.starts_with(&begin));
            let line = line.unwrap_or_else(|| panic!("{}", parameter.key));
            assert_eq!(line.matches(" |").count(), 5, "five cells: {line}");
            assert!(parameter.help.ends_with('.') && page.contains(parameter.help), "{line}");
        }
    }
}

#[test]
fn the_page_in_docs_is_the_reference() {
    // To write it: mtj scenario keys --markdown > docs/scenario.md
    assert_eq!(include_str!("../../docs/scenario.md"), reference_page());
}
