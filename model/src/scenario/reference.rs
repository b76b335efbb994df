//! The reference of all keys, from the declarations that the reader reads by.

use std::fmt::Write;

use super::{
    DURATION, NOISE, SEED, TASK, actuator, arm, bus, encoder, friction,
    key::{Default, Parameter},
    law::{GRAVITY, MEMORY, PREDICTION},
    link, load, safety, timing, trajectory, wall,
};
use crate::law::{self, LAWS};

/// Keys that belong together: those of one table, or of one kind of it.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyTable {
    /// The table, and the kind that has these keys where only one has.
    pub title: String,
    /// What the table is about.
    pub note: String,
    /// The keys, in the order of reading.
    pub keys: Vec<&'static Parameter>,
}

/// All keys that a scenario may have, table by table.
pub fn reference() -> Vec<KeyTable> {
    let table = |title: &str, note: &str, keys: &[&'static Parameter]| KeyTable {
        title: title.to_owned(),
        note: note.to_owned(),
        keys: keys.to_vec(),
    };
    let mut common = vec![&law::KIND];
    common.extend(MEMORY.iter().chain(PREDICTION));
    common.push(&GRAVITY);
    let mut tables = vec![
        table("the run", "Keys outside of all tables.", &[&DURATION, &SEED]),
        table("task", "What of the tip is controlled.", &[&TASK]),
        table("arm", "The arm and its initial state.", arm::KEYS),
        table("arm.links", "One to seven entries, base first.", arm::LINK_KEYS),
        table(
            "arm.friction",
            "What resists the joints; absent unless one of its torques is given. No controller's model has it.",
            friction::FRICTION,
        ),
        table("trajectory", "The desired motion of the tip.", trajectory::KEYS),
        table("trajectory: circle, perturbed-circle", "", trajectory::CIRCLE_KEYS),
        table("trajectory.ripple: perturbed-circle", "", trajectory::RIPPLE_KEYS),
        table("trajectory: point-to-point", "", trajectory::POINT_TO_POINT_KEYS),
        table(
            "trajectory: file",
            "A motion through given points, continuous to the second derivative.",
            trajectory::FILE_KEYS,
        ),
        table(
            "trajectory.transition",
            "Written by a plant whose desired motion was changed while the loop ran.",
            trajectory::TRANSITION_KEYS,
        ),
        table("law", "The control law, and what every law has.", &common),
    ];
    tables.extend(LAWS.iter().map(|law| KeyTable {
        title: format!("law: {}", law.name),
        note: format!("{}: {}.", law.title, law.equation),
        keys: law.parameters.iter().collect(),
    }));
    tables.extend([
        table("timing", "When samples are taken.", timing::KEYS),
        table(
            "link.state, link.torque",
            "Emulated latency and loss, sensor to controller and controller to actuator; `*` is \
             `state` or `torque`.",
            link::KEYS,
        ),
        table("link.*.jitter", "", link::JITTER_KEYS),
        table("link.*.dropout: bursts", "A two-state Markov chain.", link::BURST_KEYS),
        table("sensor", "What the plant measures.", &[&NOISE]),
        table(
            "wall",
            "What the tip can touch; there is none unless the table is given.",
            wall::KEYS,
        ),
        table("load", "What the tip takes up and drops, an entry for each change.", load::KEYS),
        table(
            "actuator",
            "How torques follow their commands; perfect unless a key is given.",
            actuator::KEYS,
        ),
        table("encoder", "How joints are measured; perfect unless a key is given.", encoder::KEYS),
        table("safety", "What protects the arm.", safety::KEYS),
        table("bus", "How the processes find and wait for each other.", bus::KEYS),
    ]);
    tables
}

/// The reference as a Markdown page, one table of keys a section.
pub fn reference_page() -> String {
    let mut page = String::from(INTRODUCTION);
    for KeyTable { title, note, keys } in reference() {
        let _ = write!(page, "\n## {title}\n\n");
        if !note.is_empty() {
            let _ = write!(page, "{note}\n\n");
        }
        page.push_str("| key | value | unit | default | meaning |\n|---|---|---|---|---|\n");
        for key in keys {
            let default = match key.default {
                Default::Required => "required".to_owned(),
                Default::Value(value) => format!("`{value}`"),
                Default::SameAs(other) => format!("as `{other}`"),
                Default::Words(words) => words.to_owned(),
            };
            let (path, syntax, unit, help) = (key.key, key.syntax(), key.unit, key.help);
            let _ = writeln!(page, "| `{path}` | {syntax} | {unit} | {default} | {help} |");
        }
        if title == REPLAYING {
            let _ = write!(page, "\n{}", super::REPLAY_FORMAT);
        }
    }
    page
}

/// The table after which the page explains the file of a replay.
const REPLAYING: &str = "link.*.jitter";

const INTRODUCTION: &str = "\
# Keys of a scenario

A scenario is a TOML file. Any key can be set on the command line, `--set law.kp=40`; quotes may be
left out. A key that is not in these tables is refused.

- A **duration** is a string of a number and a unit, ns, us, ms, s, min, h or d: `\"10 ms\"`.
- A **matrix** is positive definite: one number for all task axes, a list for a diagonal, or a list
  of rows.
- A list entry has the path `arm.links[0].mass`.
";
