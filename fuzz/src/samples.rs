//! Bytes of a bus.

use mtj_protocol::{
    admission::{self, Admission, AdmissionFilter, Rejection},
    codec::{self, LARGEST_SAMPLE},
    sample::{
        ChangeSample, ErrorSample, Field, PresenceSample, RequestSample, Sample, StateSample,
        StatusSample, TorqueSample,
    },
};

use crate::scenario;

/// What decodes encodes to the same bytes, and what passes the filter is finite and within its
/// counts.
pub fn samples(data: &[u8]) {
    sample::<StateSample>(data);
    sample::<TorqueSample>(data);
    sample::<ErrorSample>(data);
    sample::<StatusSample>(data);
    sample::<RequestSample>(data);
    sample::<ChangeSample>(data);
    sample::<PresenceSample>(data);
    if let Some(offer) = codec::decode_offer(data) {
        assert_eq!(codec::encode_offer(&offer), data);
        scenario(offer.text.as_bytes());
    }
}

fn sample<S: Sample>(data: &[u8]) {
    let Some(sample) = codec::decode::<S>(data) else {
        assert_ne!(data.len(), size_of::<S>(), "all bytes of the right length are a sample");
        let other = codec::read::<S>(data).map(|sample| admission::check(&sample));
        assert!(matches!(other, None | Some(Err(Rejection::Version(_)))), "a header alone passes");
        return;
    };
    let mut buffer = [0; LARGEST_SAMPLE];
    assert_eq!(codec::encode(&sample, &mut buffer), data);
    let mut filter = AdmissionFilter::new(sample.header().run);
    let passes = filter.admit(&sample) == Admission::Fresh;
    sample.fields(&mut |_, field| match field {
        Field::Numbers(numbers) => {
            assert!(!passes || numbers.iter().all(|number| number.is_finite()));
        }
        Field::Text(words) => assert!(!words.contains('\0')),
        Field::Count(_) => {}
    });
    let again = filter.admit(&sample);
    assert!(if passes { again == Admission::Repeated } else { filter.rejected() == 2 });
}
