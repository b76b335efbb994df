//! Samples and offers as bytes.
//!
//! Fixed-width little-endian, without names or tags: bincode in the one configuration that equals
//! the samples' memory layout. bincode has ended at 2.0.1; `wincode` reads the same bytes, and this
//! is the only file to change.

use bincode::config::{Configuration, Fixint, LittleEndian, NoLimit};
use serde::{Serialize, de::DeserializeOwned};

use crate::sample::{Sample, VERSION};

/// The most bytes a sample takes.
pub const LARGEST_SAMPLE: usize = 512;

/// The highest version number that is believed; anything above is garbage.
const LAST_VERSION: u32 = 0xffff;

const FORMAT: Configuration<LittleEndian, Fixint, NoLimit> =
    bincode::config::standard().with_little_endian().with_fixed_int_encoding();

/// Writes a sample into a buffer and returns the part that was used. Allocates nothing.
pub fn encode<'a, S: Sample>(sample: &S, buffer: &'a mut [u8; LARGEST_SAMPLE]) -> &'a [u8] {
    // A sample always fits (a test holds every one against the buffer).
    let length = bincode::serde::encode_into_slice(sample, buffer, FORMAT).unwrap_or(0);
    &buffer[..length]
}

/// Reads a sample; `None` unless the bytes are exactly one.
pub fn decode<S: Sample>(bytes: &[u8]) -> Option<S> {
    exactly(bytes)
}

/// Reads a message of a sample's topic. If another protocol version wrote it, its layout is not
/// known and only the header is read; the admission filter then rejects it by its version.
pub fn read<S: Sample>(bytes: &[u8]) -> Option<S> {
    decode(bytes).or_else(|| {
        version_of(bytes).filter(|version| *version != VERSION)?;
        let (header, _) = bincode::serde::decode_from_slice(bytes, FORMAT).ok()?;
        let mut sample = S::default();
        *sample.header_mut() = header;
        Some(sample)
    })
}

/// The protocol version in a message's first four bytes; `None` if it cannot be one.
pub fn version_of(bytes: &[u8]) -> Option<u32> {
    let version = u32::from_le_bytes(*bytes.first_chunk()?);
    (1..=LAST_VERSION).contains(&version).then_some(version)
}

/// A scenario in the form in which a plant offers it on the bus.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, serde::Deserialize)]
pub struct Offer {
    /// [`crate::sample::VERSION`] of the plant.
    pub version: u32,
    /// How often it was changed in this run.
    pub revision: u32,
    /// The plant's incarnation.
    pub run: u64,
    /// Name of the scenario.
    pub name: String,
    /// The scenario in TOML.
    pub text: String,
}

/// Writes an offer.
pub fn encode_offer(offer: &Offer) -> Vec<u8> {
    bincode::serde::encode_to_vec(offer, FORMAT).unwrap_or_default()
}

/// Reads an offer; `None` unless the bytes are exactly one.
pub fn decode_offer(bytes: &[u8]) -> Option<Offer> {
    exactly(bytes)
}

fn exactly<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    let (value, used) =
        bincode::serde::decode_from_slice(bytes, FORMAT.with_limit::<65536>()).ok()?;
    (used == bytes.len()).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::{
        ChangeSample, ErrorSample, Header, PresenceSample, RequestSample, StateSample,
        StatusSample, TorqueSample, text,
    };

    fn check<S: Sample + PartialEq>(sample: S) {
        let mut buffer = [0; LARGEST_SAMPLE];
        let bytes = encode(&sample, &mut buffer).to_vec();
        assert_eq!(bytes.len(), size_of::<S>(), "no padding and no tags in {}", S::TOPIC);
        assert_eq!(decode::<S>(&bytes), Some(sample));
        assert_eq!(decode::<S>(&bytes[1..]), None, "too short");
        assert_eq!(decode::<S>(&[&bytes[..], &[0]].concat()), None, "too long");
    }

    #[test]
    fn every_sample_comes_back_as_it_went() {
        let header = Header {
            version: 1,
            joints: 2,
            axes: 2,
            run: 7,
            sequence: 8,
            time_ns: 9,
            ..Header::default()
        };
        check(StateSample {
            header,
            position: [0.1; 7],
            delivered: [0.2; 7],
            ..Default::default()
        });
        check(TorqueSample { header, torque: [-1.5; 7], echo: [2.5; 7], ..Default::default() });
        check(ErrorSample {
            header,
            law: text("mtj"),
            error: [1e-9; 6],
            signals: [0.5; 14],
            ..Default::default()
        });
        check(StatusSample { header, phase: 2, lost: u64::MAX, ..Default::default() });
        check(RequestSample { header, text: text("law.kp=31"), ..Default::default() });
        check(ChangeSample { header, request: 5, text: [[7; 32]; 12], ..Default::default() });
        check(PresenceSample { header, host: text("arm-7"), ..Default::default() });
    }

    #[test]
    fn a_message_of_another_version_is_read_as_its_header_alone() {
        let header = Header { version: VERSION - 1, run: 7, sequence: 8, ..Header::default() };
        let mut buffer = [0; LARGEST_SAMPLE];
        let bytes = encode(&StateSample { header, sent_ns: 9, ..Default::default() }, &mut buffer);
        let shorter = &bytes[..bytes.len() - 24];
        assert_eq!(read(shorter), Some(StateSample { header, ..Default::default() }));
        assert_eq!(read(bytes).map(|state: StateSample| state.sent_ns), Some(9));
        assert_eq!(read::<StateSample>(&bytes[..39]), None, "not even a header");
        for no_version in [0, VERSION, 0x6262_7572] {
            let bytes = [&no_version.to_le_bytes(), &shorter[4..]].concat();
            assert_eq!(read::<StateSample>(&bytes), None, "{no_version}");
        }
    }

    #[test]
    fn offers_come_back_and_garbage_does_not() {
        let offer =
            Offer { version: 1, revision: 3, run: 2, name: "a".into(), text: "b = 1".into() };
        let bytes = encode_offer(&offer);
        assert_eq!(decode_offer(&bytes), Some(offer));
        assert_eq!(decode_offer(&bytes[..bytes.len() - 1]), None);
        assert_eq!(decode_offer(&[0xff; 40]), None);
    }
}
