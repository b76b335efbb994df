//! The page on the wire protocol and the controller in Python agree with the samples and laws in
//! the code.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use mtj_model::law::{LAWS, Per, Signal};
use mtj_protocol::{
    codec::{self, LARGEST_SAMPLE},
    sample::{
        Axes, ChangeSample, Echo, ErrorSample, Field, FieldMut, Header, HostName, Joints, Name,
        PresenceSample, RequestSample, Sample, Signals, StateSample, StatusSample, Text,
        TorqueSample, VERSION,
    },
};

const PAGE: &str = include_str!("../../docs/wire.md");
const CONTROLLER: &str = include_str!("../../examples/controller.py");

type Layout = &'static [(&'static str, &'static str, usize)];

/// A topic's name, its sample's size and its sample's layout.
const SAMPLES: [(&str, usize, Layout); 7] = [
    (StateSample::TOPIC, size_of::<StateSample>(), StateSample::LAYOUT),
    (TorqueSample::TOPIC, size_of::<TorqueSample>(), TorqueSample::LAYOUT),
    (ErrorSample::TOPIC, size_of::<ErrorSample>(), ErrorSample::LAYOUT),
    (StatusSample::TOPIC, size_of::<StatusSample>(), StatusSample::LAYOUT),
    (RequestSample::TOPIC, size_of::<RequestSample>(), RequestSample::LAYOUT),
    (ChangeSample::TOPIC, size_of::<ChangeSample>(), ChangeSample::LAYOUT),
    (PresenceSample::TOPIC, size_of::<PresenceSample>(), PresenceSample::LAYOUT),
];

/// The element of a list type and the list's size in bytes; `None` for any other type.
fn list(name: &str) -> Option<(&'static str, usize)> {
    Some(match name {
        "Joints" => ("f64", size_of::<Joints>()),
        "Axes" => ("f64", size_of::<Axes>()),
        "Echo" => ("f64", size_of::<Echo>()),
        "Signals" => ("f64", size_of::<Signals>()),
        "Name" => ("u8", size_of::<Name>()),
        "HostName" => ("u8", size_of::<HostName>()),
        "Text" => ("u8", size_of::<Text>()),
        _ => return None,
    })
}

fn size(name: &str) -> usize {
    match name {
        "u32" => 4,
        "u64" => 8,
        "Header" => size_of::<Header>(),
        name => list(name).unwrap().1,
    }
}

/// The lines of the section whose title begins so, title included.
fn section(title: &str) -> Vec<&'static str> {
    let mut lines = PAGE.lines().skip_while(|line| !line.starts_with(&format!("## {title}")));
    let title = lines.next().unwrap_or_else(|| panic!("no section '{title}'"));
    [title].into_iter().chain(lines.take_while(|line| !line.starts_with("## "))).collect()
}

/// The rows of the section's table, each cut into its cells.
fn rows(lines: &[&'static str]) -> Vec<Vec<&'static str>> {
    let tables = lines.iter().filter_map(|line| line.strip_prefix('|')?.strip_suffix('|'));
    tables.skip(2).map(|row| row.split('|').map(str::trim).collect()).collect()
}

/// Offset, field and type as the page shows them.
fn documented(lines: &[&'static str]) -> Vec<[String; 3]> {
    rows(lines).iter().map(|row| [0, 1, 2].map(|i| row[i].to_owned())).collect()
}

fn defined(layout: Layout) -> Vec<[String; 3]> {
    let shown = |name: &str| match (name, list(name)) {
        ("Header", _) => String::new(),
        (_, Some(("f64", size))) => format!("f64 × {}", size / 8),
        (_, Some((element, size))) => format!("{element} × {size}"),
        (number, None) => number.to_owned(),
    };
    let row = |(field, name, offset): &(&str, &str, usize)| {
        [offset.to_string(), (*field).to_owned(), shown(name)]
    };
    layout.iter().map(row).collect()
}

#[test]
fn the_page_shows_each_sample_as_it_is_defined() {
    for (topic, size, layout) in SAMPLES {
        let lines = section(&format!("{topic} ("));
        assert!(lines[0].ends_with(&format!("), {size} bytes")), "{}", lines[0]);
        assert_eq!(documented(&lines), defined(layout), "{topic}");
    }
    let lines = section("Header ");
    assert!(lines[0].contains(&format!(" {} bytes ", size_of::<Header>())), "{}", lines[0]);
    assert_eq!(documented(&lines), defined(Header::LAYOUT));
    assert!(lines.iter().any(|line| line.ends_with(&format!("| protocol version, {VERSION} |"))));
    assert!(PAGE.starts_with(&format!("# Wire protocol, version {VERSION}\n")));
}

#[test]
fn the_page_lists_every_topic() {
    for (topic, ..) in SAMPLES {
        assert!(PAGE.contains(&format!("\n| {topic} | `mtj/<session>/{topic}` |")), "{topic}");
    }
}

/// Eight bytes that are no other field's value.
const MARK: [u8; 8] = [1, 2, 3, 4, 5, 6, 7, 8];

/// Sets the first and the last eight bytes of each field in turn, and looks for them on the wire.
fn each_field_lies_at_its_offset<S: Sample>(layout: Layout) {
    for (field, name, offset) in &layout[1..] {
        let mut sample = S::default();
        match sample.field_mut(field).unwrap() {
            FieldMut::Count(count) => *count = u64::from_le_bytes(MARK),
            FieldMut::Numbers(numbers) => {
                let last = numbers.len() - 1;
                (numbers[0], numbers[last]) = (f64::from_le_bytes(MARK), f64::from_le_bytes(MARK));
            }
            FieldMut::Text(rows) => {
                let bytes = rows.as_flattened_mut();
                let last = bytes.len() - 8;
                bytes[..8].copy_from_slice(&MARK);
                bytes[last..].copy_from_slice(&MARK);
            }
        }
        let mut buffer = [0; LARGEST_SAMPLE];
        let mut bytes = codec::encode(&sample, &mut buffer).to_vec();
        for place in [*offset, offset + size(name) - 8] {
            assert_eq!(bytes[place..place + 8], MARK, "{}: {field}", S::TOPIC);
        }
        bytes[*offset..offset + size(name)].fill(0);
        assert!(bytes.iter().all(|byte| *byte == 0), "{}: only {field} is set", S::TOPIC);
    }
}

#[test]
fn fields_lie_on_the_wire_where_they_lie_in_memory() {
    each_field_lies_at_its_offset::<StateSample>(StateSample::LAYOUT);
    each_field_lies_at_its_offset::<TorqueSample>(TorqueSample::LAYOUT);
    each_field_lies_at_its_offset::<ErrorSample>(ErrorSample::LAYOUT);
    each_field_lies_at_its_offset::<StatusSample>(StatusSample::LAYOUT);
    each_field_lies_at_its_offset::<RequestSample>(RequestSample::LAYOUT);
    each_field_lies_at_its_offset::<ChangeSample>(ChangeSample::LAYOUT);
    each_field_lies_at_its_offset::<PresenceSample>(PresenceSample::LAYOUT);
}

#[test]
fn the_header_lies_at_the_beginning_of_every_sample() {
    for (topic, size, layout) in SAMPLES {
        assert_eq!(layout[0], ("header", "Header", 0), "{topic}");
        assert!(size <= LARGEST_SAMPLE, "{topic}");
    }
    let header = Header {
        version: 1,
        joints: 2,
        axes: 3,
        revision: 4,
        run: 0x0102_0304_0506_0708,
        sequence: 6,
        time_ns: 7,
    };
    let mut buffer = [0; LARGEST_SAMPLE];
    let bytes = codec::encode(&StateSample { header, ..Default::default() }, &mut buffer);
    let mut layout = Header::LAYOUT.iter();
    header.fields(&mut |field, value| {
        let (name, kind, offset) = layout.next().unwrap();
        let Field::Count(count) = value else { panic!("{field} is no number") };
        assert_eq!(*name, field);
        assert_eq!(bytes[*offset..offset + size(kind)], count.to_le_bytes()[..size(kind)]);
    });
    assert_eq!(layout.next(), None);
}

/// A quantity as the table of laws shows it.
fn shown(signal: &Signal) -> String {
    let Signal { key, symbol, unit, per, .. } = signal;
    let separator = if unit.is_empty() { "" } else { ", " };
    let each = match per {
        Per::Axis => ", for each task axis",
        Per::Joint => ", for each joint",
        Per::Arm => "",
    };
    format!("`{key}`: {symbol}{separator}{unit}{each}")
}

#[test]
fn the_page_shows_each_law_with_its_signals_in_order() {
    let expected: Vec<_> = LAWS
        .iter()
        .map(|law| {
            let signals: Vec<_> = law.signals.iter().map(shown).collect();
            let signals = if signals.is_empty() { "none".to_owned() } else { signals.join("; ") };
            [law.name.to_owned(), law.equation.to_owned(), shown(&law.echo), signals]
        })
        .collect();
    let found: Vec<_> =
        rows(&section("Laws")).iter().map(|row| [0, 1, 2, 3].map(|i| row[i].to_owned())).collect();
    assert_eq!(found, expected);
}

#[test]
fn the_page_has_every_parameter_of_a_law_with_its_default() {
    let lines = section("What a controller needs").join("\n");
    for parameter in LAWS.iter().flat_map(|law| law.parameters) {
        let key = format!("`{}`", parameter.key);
        let line = lines.lines().find(|line| line.contains(&key));
        let line = line.unwrap_or_else(|| panic!("{key} is missing"));
        if let mtj_model::law::describe::Default::Value(value) = parameter.default {
            let value = value.trim_matches('"');
            assert!(line.contains(value), "{line} has another default than {value}");
        }
    }
}

/// A sample's fields as the Python controller writes them: each name with its format.
fn python(layout: Layout) -> String {
    let form = |name: &str| match (name, list(name)) {
        ("u32", _) => "I".to_owned(),
        ("u64", _) => "Q".to_owned(),
        (_, Some(("f64", size))) => format!("{}d", size / 8),
        (_, Some((_, size))) => format!("{size}s"),
        (name, None) => panic!("no format for {name}"),
    };
    let fields = layout.iter().filter(|(_, name, _)| *name != "Header");
    let fields: Vec<_> = fields.map(|(field, name, _)| format!("{field}:{}", form(name))).collect();
    fields.join(" ")
}

#[test]
fn the_controller_in_python_has_the_same_layouts() {
    let program: Vec<_> = CONTROLLER.split_whitespace().collect();
    let program = program.join(" ");
    for line in [
        format!(" VERSION = {VERSION} "),
        format!(" HEADER = \"{}\"", python(Header::LAYOUT)),
        format!(" STATE = Layout(HEADER + \"\"\" {}\"\"\")", python(StateSample::LAYOUT)),
        format!(" TORQUE = Layout(HEADER + \"\"\" {}\"\"\")", python(TorqueSample::LAYOUT)),
    ] {
        assert!(program.contains(&line), "examples/controller.py has no{line}");
    }
}
