//! Messages as JSON, and back; numbers keep every bit.

use std::{any::Any, fmt, io, marker::PhantomData, ops::Range, sync::Arc};

use mtj_model::scenario::Scenario;
use mtj_protocol::{
    admission,
    port::{Message, Offered},
    sample::{ErrorSample, Field, FieldMut, Header, Sample, VERSION, write_text},
};
use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor},
    ser::SerializeMap,
};

use super::{
    error::MessageError,
    topic::{Topic, fields, header},
};

/// Writes a message as one JSON object: the header with its fields, then the sample's own fields.
pub fn write(out: &mut impl io::Write, message: &Message) -> io::Result<()> {
    Ok(serde_json::to_writer(out, &MessageJson(message))?)
}

/// Reads a message that [`write()`] wrote.
pub fn read(topic: Topic, json: &[u8]) -> Result<Message, MessageError> {
    Ok(match topic {
        Topic::Scenario => Message::Scenario(Arc::new(read_scenario(json)?)),
        Topic::State => Message::State(read_sample(json)?),
        Topic::Torque => Message::Torque(read_sample(json)?),
        Topic::Error => Message::Error(read_sample(json)?),
        Topic::Status => Message::Status(read_sample(json)?),
        Topic::Request => Message::Request(read_sample(json)?),
        Topic::Change => Message::Change(read_sample(json)?),
        Topic::Presence => Message::Presence(read_sample(json)?),
    })
}

struct MessageJson<'a>(&'a Message);

impl Serialize for MessageJson<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        if let Some(header) = header(self.0) {
            map.serialize_entry("header", header)?;
        }
        let mut outcome = Ok(());
        fields(self.0, &mut |name, field| {
            if outcome.is_ok() {
                outcome = match field {
                    Field::Count(count) => map.serialize_entry(name, &count),
                    Field::Numbers(numbers) => map.serialize_entry(name, numbers),
                    Field::Text(words) => map.serialize_entry(name, words),
                };
            }
        });
        outcome?;
        map.end()
    }
}

fn read_scenario(json: &[u8]) -> Result<Offered, MessageError> {
    #[derive(Deserialize)]
    struct Record {
        name: String,
        run: u64,
        revision: u32,
        text: String,
    }
    let Record { name, run, revision, text } = serde_json::from_slice(json)?;
    let scenario = Scenario::parse(&name, &text, &[])?;
    Ok(Offered { run, revision, scenario })
}

fn read_sample<S: Sample>(json: &[u8]) -> Result<S, MessageError> {
    let error = match serde_json::from_slice(json) {
        Err(error) => error.into(),
        Ok(SampleJson(sample)) => match admission::check(&sample) {
            Ok(()) => return Ok(sample),
            Err(rejection) => MessageError::Sample(rejection),
        },
    };
    // A sample of another version has other fields; then its version is the reason.
    Err(other_version(json).map_or(error, MessageError::Version))
}

/// The protocol version of a sample, if it is not that of this program.
fn other_version(json: &[u8]) -> Option<u32> {
    #[derive(Deserialize)]
    struct OnlyHeader {
        header: Header,
    }
    let OnlyHeader { header } = serde_json::from_slice(json).ok()?;
    Some(header.version).filter(|version| *version != VERSION)
}

struct SampleJson<S>(S);

impl<'de, S: Sample> Deserialize<'de> for SampleJson<S> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Fields(PhantomData)).map(SampleJson)
    }
}

struct Fields<S>(PhantomData<S>);

impl<'de, S: Sample> Visitor<'de> for Fields<S> {
    type Value = S;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a {} sample", S::TOPIC)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<S, A::Error> {
        let mut sample = S::default();
        let mut found = 0;
        while let Some(name) = map.next_key::<&str>()? {
            found += 1;
            if name == "header" {
                *sample.header_mut() = map.next_value()?;
                continue;
            }
            match field_mut(&mut sample, name) {
                Some(FieldMut::Count(count)) => *count = map.next_value()?,
                Some(FieldMut::Numbers(numbers)) => map.next_value_seed(Fill(numbers))?,
                Some(FieldMut::Text(rows)) => write_text(rows, &map.next_value::<String>()?),
                None => return Err(A::Error::custom(format!("there is no field '{name}'"))),
            }
        }
        let mut expected = 1;
        sample.fields(&mut |_, _| expected += 1);
        if found == expected { Ok(sample) } else { Err(A::Error::custom("fields are missing")) }
    }
}

/// The field of this name; for an error sample whose law was read, this includes the law's signals.
fn field_mut<'a, S: Sample>(sample: &'a mut S, name: &str) -> Option<FieldMut<'a>> {
    let signal = (sample as &dyn Any).downcast_ref().and_then(|error| range_of_signal(error, name));
    match signal {
        None => sample.field_mut(name),
        Some(range) => match sample.field_mut("signals")? {
            FieldMut::Numbers(signals) => Some(FieldMut::Numbers(&mut signals[range])),
            FieldMut::Count(_) | FieldMut::Text(_) => None,
        },
    }
}

/// The range of a signal of the law within the list of all signals.
fn range_of_signal(error: &ErrorSample, name: &str) -> Option<Range<usize>> {
    let mut end = 0;
    error.signals().find_map(|(signal, numbers)| {
        let start = end;
        end += numbers.len();
        (signal.key == name).then_some(start..end)
    })
}

/// Overwrites the first entries of a list of zeros.
struct Fill<'a>(&'a mut [f64]);

impl<'de> DeserializeSeed<'de> for Fill<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Fill<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "up to {} numbers", self.0.len())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let most = self.0.len();
        let mut entries = self.0.iter_mut();
        while let Some(number) = list.next_element()? {
            *entries
                .next()
                .ok_or_else(|| A::Error::invalid_length(most + 1, &"fewer numbers"))? = number;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]

    use mtj_protocol::sample::{
        ChangeSample, PresenceSample, StateSample, TorqueSample, padded, text,
    };

    use super::*;

    fn written_and_read(message: &Message) -> Message {
        let mut json = Vec::new();
        write(&mut json, message).unwrap();
        read(Topic::of(message), &json).unwrap()
    }

    fn header() -> Header {
        Header {
            version: VERSION,
            joints: 3,
            axes: 2,
            revision: 7,
            run: u64::MAX,
            sequence: u64::MAX - 1,
            time_ns: (1 << 53) + 1,
        }
    }

    #[test]
    fn numbers_come_back_to_the_last_bit() {
        // Bits from a congruential generator, so that exponents of all sizes occur.
        let mut bits: u64 = 1;
        let mut draw = || loop {
            bits = bits.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let number = f64::from_bits(bits);
            if number.is_finite() {
                return number;
            }
        };
        for _ in 0..20_000 {
            let torque = TorqueSample {
                header: header(),
                torque: padded(&[draw(), draw(), -0.0]),
                echo_count: 2,
                echo: padded(&[draw(), f64::MIN_POSITIVE / 3.0]),
                ..Default::default()
            };
            let Message::Torque(read) = written_and_read(&Message::Torque(torque)) else {
                panic!()
            };
            assert_eq!(read.header, torque.header);
            assert_eq!(read.torque.map(f64::to_bits), torque.torque.map(f64::to_bits));
            assert_eq!(read.echo.map(f64::to_bits), torque.echo.map(f64::to_bits));
        }
    }

    #[test]
    fn any_text_comes_back() {
        let words = "law.kind=\"tj\"\nτ\\\t„ö“ \u{1}";
        let change = ChangeSample { header: header(), text: text(words), ..Default::default() };
        assert_eq!(written_and_read(&Message::Change(change)), Message::Change(change));
        let presence = PresenceSample { header: header(), host: text("arm"), ..Default::default() };
        assert_eq!(written_and_read(&Message::Presence(presence)), Message::Presence(presence));
    }

    #[test]
    fn the_signals_of_any_law_come_back() {
        for (law, count, keys) in [
            ("tj", 0, "\"error_rate\":[0.0,0.0]}"),
            ("mtj", 4, "\"factor\":[0.5,1.5],\"memory\":[2.5,3.5]}"),
            ("unheard-of", 14, "\"signals\":[0.5,1.5,2.5,3.5,"),
        ] {
            let numbers: Vec<f64> = (0..count).map(|i| f64::from(i) + 0.5).collect();
            let error = ErrorSample {
                header: header(),
                law: text(law),
                signals: padded(&numbers),
                ..Default::default()
            };
            let mut json = Vec::new();
            write(&mut json, &Message::Error(error)).unwrap();
            let json = String::from_utf8(json).unwrap();
            assert!(json.contains(keys), "{json}");
            let read = read(Topic::Error, json.as_bytes()).unwrap();
            assert_eq!(read, Message::Error(error), "{law}");
        }
    }

    #[test]
    fn a_missing_signal_or_one_of_another_law_is_refused() {
        let error = ErrorSample { header: header(), law: text("mtj"), ..Default::default() };
        let mut json = Vec::new();
        write(&mut json, &Message::Error(error)).unwrap();
        let json = String::from_utf8(json).unwrap();
        for (from, to, words) in [
            (",\"memory\":[0.0,0.0]", "", "missing"),
            ("\"mtj\"", "\"tj\"", "no field 'factor'"),
            ("\"factor\":[0.0,0.0]", "\"factor\":[0.0,0.0,0.0]", "fewer numbers"),
        ] {
            let sentence =
                read(Topic::Error, json.replacen(from, to, 1).as_bytes()).unwrap_err().to_string();
            assert!(sentence.contains(words), "{from} → {to}: {sentence}");
        }
    }

    #[test]
    fn a_sample_of_another_protocol_version_is_refused_by_its_version() {
        let torque = "{\"header\":{\"version\":3,\"joints\":2,\"axes\":2,\"revision\":0,\"run\":1,\
                      \"sequence\":5,\"time_ns\":0},\"state_sent_ns\":0,\"residence_ns\":0,\
                      \"controller\":1,\"torque\":[1.0,2.0],\"force\":[3.0,4.0]}";
        let sentence = read(Topic::Torque, torque.as_bytes()).unwrap_err().to_string();
        let both = format!("it has protocol version 3, and this program reads version {VERSION}");
        assert_eq!(sentence, both);
        let json = br#"{"header":{"version":3}}"#;
        assert!(read(Topic::Error, json).is_err(), "a header without its fields is refused, too");
    }

    #[test]
    fn json_that_is_not_a_sample_is_refused_with_the_reason() {
        let mut json = Vec::new();
        let state = StateSample { header: header(), ..Default::default() };
        write(&mut json, &Message::State(state)).unwrap();
        let json = String::from_utf8(json).unwrap();
        for (from, to, words) in [
            ("\"sent_ns\":0,", "", "missing"),
            ("\"sent_ns\"", "\"sent\"", "no field 'sent'"),
            ("\"sent_ns\":0", "\"sent_ns\":-1", "-1"),
            ("[0.0,0.0,0.0]", "[1,2,3,4,5,6,7,8]", "8"),
            ("[0.0,0.0,0.0]", "[null]", "null"),
            ("\"joints\":3", "\"joints\":9", "not a sample"),
            ("\"version\":", "\"version\":9", "version"),
            ("}", "", "EOF"),
        ] {
            let broken = json.replacen(from, to, 1);
            assert_ne!(broken, json);
            let sentence = read(Topic::State, broken.as_bytes()).unwrap_err().to_string();
            assert!(sentence.contains(words), "{from} → {to}: {sentence}");
        }
        assert!(read(Topic::State, json.as_bytes()).is_ok());
    }
}
