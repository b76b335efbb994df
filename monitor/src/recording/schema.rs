//! What the JSON of a recording looks like, and in which units.

use mtj_model::{MAX_AXES, MAX_JOINTS};
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
                ("name".to_owned(), words("")),
                ("run".to_owned(), whole("")),
                ("revision".to_owned(), whole("")),
                ("text".to_owned(), words("TOML")),
            ]),
        ),
        Topic::State => of_sample::<StateSample>("Plant to controller: the measured state"),
        Topic::Torque => of_sample::<TorqueSample>("Controller to plant: the answer to a state"),
        Topic::Error => of_sample::<ErrorSample>("How the law saw the instant it answered"),
        Topic::Status => of_sample::<StatusSample>("The truth about the arm, and book-keeping"),
        Topic::Request => of_sample::<RequestSample>("A wish to turn a knob of the running loop"),
        Topic::Change => of_sample::<ChangeSample>("What became of a request"),
        Topic::Presence => of_sample::<PresenceSample>("Who takes part in the session"),
    }
}

/// The unit of a field, by its name; empty for what has none.
pub fn unit(field: &str) -> &'static str {
    match field {
        "position" => "rad",
        "velocity" => "rad/s",
        "torque" => "N m",
        "applied" | "delivered" | "force" | "memory" => "N",
        "error" => "m",
        "error_rate" => "m/s",
        name if name.ends_with("_ns") => "ns",
        _ => "",
    }
}

fn of_sample<S: Sample>(description: &str) -> Value {
    let mut longest = S::default();
    longest.header_mut().joints = MAX_JOINTS as u32;
    longest.header_mut().axes = MAX_AXES as u32;
    let mut properties = Map::new();
    properties.insert("header".to_owned(), of_header());
    longest.fields(&mut |name, field| {
        let unit = unit(name);
        let value = match field {
            Field::Count(_) => whole(unit),
            Field::Text(_) => words(unit),
            Field::Numbers(list) => json!({
                "type": "array",
                "items": { "type": "number" },
                "maxItems": list.len(),
                "description": unit,
            }),
        };
        properties.insert(name.to_owned(), value);
    });
    object(description, properties)
}

fn of_header() -> Value {
    let mut properties = Map::new();
    Header::default().fields(&mut |name, _| {
        properties.insert(name.to_owned(), whole(unit(name)));
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

fn whole(unit: &str) -> Value {
    json!({ "type": "integer", "minimum": 0, "description": unit })
}

fn words(form: &str) -> Value {
    json!({ "type": "string", "description": form })
}
