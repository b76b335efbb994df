//! The JSON schema of each topic, with units.

use mtj_model::{
    MAX_AXES, MAX_ECHO, MAX_JOINTS,
    law::{LAWS, Signal},
};
use mtj_protocol::sample::{
    ChangeSample, ErrorSample, Field, Header, PresenceSample, RequestSample, Sample, StateSample,
    StatusSample, TorqueSample,
};
use serde_json::{Map, Value, json};

use super::topic::Topic;

/// The JSON schema of a topic's messages.
pub fn schema(topic: Topic) -> Value {
    match topic {
        Topic::Scenario => object(
            "An experiment, in effect from this revision of the run on",
            Map::from_iter([
                ("name".to_owned(), string("")),
                ("run".to_owned(), integer("")),
                ("revision".to_owned(), integer("")),
                ("text".to_owned(), string("TOML")),
            ]),
        ),
        Topic::State => of_sample(
            "Plant to controller: the measured state",
            StateSample { echo_count: MAX_ECHO as u64, ..Default::default() },
        ),
        Topic::Torque => of_sample(
            "Controller to plant: the answer to a state",
            TorqueSample { echo_count: MAX_ECHO as u64, ..Default::default() },
        ),
        Topic::Error => of_error(),
        Topic::Status => {
            of_sample("The truth about the arm, and book-keeping", StatusSample::default())
        }
        Topic::Request => {
            of_sample("A request to change the running loop", RequestSample::default())
        }
        Topic::Change => of_sample("What became of a request", ChangeSample::default()),
        Topic::Presence => of_sample("Who takes part in the session", PresenceSample::default()),
    }
}

/// The unit of the field of this name; empty without a unit.
pub fn unit(field: &str) -> &'static str {
    match field {
        "position" => "rad",
        "velocity" => "rad/s",
        "torque" => "N m",
        name if is_echo(name) => echo_unit(),
        "error" => "m",
        "error_rate" => "m/s",
        name if name.ends_with("_ns") => "ns",
        name => {
            let signal = signals().find(|signal| signal.key == name);
            signal.map_or("", |signal| signal.unit)
        }
    }
}

/// Whether the field of this name holds echoes, whose unit is that of the law in effect.
pub fn is_echo(field: &str) -> bool {
    matches!(field, "applied" | "delivered" | "echo")
}

/// The unit of an echo, if it is the same for all laws.
fn echo_unit() -> &'static str {
    let unit = LAWS[0].echo.unit;
    if LAWS.iter().all(|law| law.echo.unit == unit) { unit } else { "as the law's echo" }
}

/// The unit of an echo for each law.
fn echo_units() -> String {
    let units: Vec<_> = LAWS.iter().map(|law| format!("{}: {}", law.name, law.echo.unit)).collect();
    format!("as the law's echo ({})", units.join(", "))
}

/// The signals of all laws.
fn signals() -> impl Iterator<Item = &'static Signal> {
    LAWS.iter().flat_map(|law| law.signals)
}

/// The schema of an error sample: the signals of a known law have their keys; those of an unknown
/// law are one list.
fn of_error() -> Value {
    let mut schema = of_sample("How the law saw the instant it answered", ErrorSample::default());
    for signal in signals() {
        let most = signal.per.count(MAX_JOINTS, MAX_AXES);
        schema["properties"][signal.key] = numbers(most, signal.unit);
    }
    if let Some(required) = schema["required"].as_array_mut() {
        required.retain(|name| name != "signals");
    }
    schema
}

/// The schema of a sample, with the lists of the largest arm.
fn of_sample<S: Sample>(description: &str, mut sample: S) -> Value {
    sample.header_mut().joints = MAX_JOINTS as u32;
    sample.header_mut().axes = MAX_AXES as u32;
    let mut properties = Map::new();
    properties.insert("header".to_owned(), of_header());
    sample.fields(&mut |name, field| {
        let unit = unit(name);
        let value = match field {
            Field::Count(_) => integer(unit),
            Field::Text(_) => string(unit),
            Field::Numbers(list) if matches!(name, "applied" | "delivered" | "echo") => {
                numbers(list.len(), &echo_units())
            }
            Field::Numbers(list) => numbers(list.len(), unit),
        };
        properties.insert(name.to_owned(), value);
    });
    object(description, properties)
}

fn of_header() -> Value {
    let mut properties = Map::new();
    Header::default().fields(&mut |name, _| {
        properties.insert(name.to_owned(), integer(unit(name)));
    });
    object("The sampling instant that is meant", properties)
}

fn object(description: &str, properties: Map<String, Value>) -> Value {
    let required: Vec<_> = properties.keys().cloned().collect();
    json!({
        "type": "object",
        "description": description,
        "properties": properties,
        "required": required,
        "additionalProperties": false,
    })
}

fn integer(unit: &str) -> Value {
    json!({ "type": "integer", "minimum": 0, "description": unit })
}

fn numbers(most: usize, unit: &str) -> Value {
    json!({
        "type": "array",
        "items": { "type": "number" },
        "maxItems": most,
        "description": unit,
    })
}

fn string(unit: &str) -> Value {
    json!({ "type": "string", "description": unit })
}
