//! Samples and offers as bytes.
//!
//! Fixed-width little-endian, without names or tags: bincode in the one configuration that equals
//! the samples' memory layout. bincode has ended at 2.0.1; `wincode` reads the same bytes, and this
//! is the only file to change.

use bincode::config::{Configuration, Fixint, LittleEndian, NoLimit};
use serde::{Serialize, de::DeserializeOwned};

use crate::sample::Sample;

/// The most bytes a sample takes.
pub const LARGEST_SAMPLE: usize = 512;

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

/// A scenario as a plant offers it on the bus.
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
            delivered: [0.2; 6],
            ..Default::default()
        });
        check(TorqueSample { header, torque: [-1.5; 7], force: [2.5; 6], ..Default::default() });
        check(ErrorSample { header, error: [1e-9; 6], ..Default::default() });
        check(StatusSample { header, phase: 2, lost: u64::MAX, ..Default::default() });
        check(RequestSample { header, text: text("law.kp=31"), ..Default::default() });
        check(ChangeSample { header, request: 5, text: [[7; 32]; 12], ..Default::default() });
        check(PresenceSample { header, host: text("arm-7"), ..Default::default() });
    }

    #[test]
    fn the_wire_layout_is_the_documented_one() {
        let header = Header {
            version: 1,
            joints: 2,
            axes: 2,
            run: 0x0102,
            sequence: 3,
            time_ns: 4,
            ..Header::default()
        };
        let state = StateSample {
            header,
            sent_ns: 5,
            leader: 6,
            timed_out: 1,
            position: [1.5; 7],
            ..Default::default()
        };
        let mut buffer = [0; LARGEST_SAMPLE];
        let bytes = encode(&state, &mut buffer);
        assert_eq!(bytes[0..4], 1u32.to_le_bytes());
        assert_eq!(bytes[16..24], 0x0102u64.to_le_bytes());
        assert_eq!(bytes[32..40], 4u64.to_le_bytes());
        assert_eq!(bytes[40..48], 5u64.to_le_bytes());
        assert_eq!(bytes[72..80], 6u64.to_le_bytes());
        assert_eq!(bytes[80..88], 1u64.to_le_bytes());
        assert_eq!(bytes[88..96], 1.5f64.to_le_bytes());
        let page = include_str!("../../docs/wire.md");
        for (sample, size) in [
            ("state", size_of::<StateSample>()),
            ("torque", size_of::<TorqueSample>()),
            ("error", size_of::<ErrorSample>()),
            ("status", size_of::<StatusSample>()),
            ("request", size_of::<RequestSample>()),
            ("change", size_of::<ChangeSample>()),
            ("presence", size_of::<PresenceSample>()),
        ] {
            let title =
                page.lines().find(|line| line.starts_with(&format!("## {sample} "))).unwrap();
            assert!(title.ends_with(&format!(", {size} bytes")), "{title}");
        }
    }

    #[test]
    fn offers_come_back_and_rubbish_does_not() {
        let offer =
            Offer { version: 1, revision: 3, run: 2, name: "a".into(), text: "b = 1".into() };
        let bytes = encode_offer(&offer);
        assert_eq!(decode_offer(&bytes), Some(offer));
        assert_eq!(decode_offer(&bytes[..bytes.len() - 1]), None);
        assert_eq!(decode_offer(&[0xff; 40]), None);
    }
}
