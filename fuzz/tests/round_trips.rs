//! Whatever is written is read back the same, over the whole range of each type.

use mtj_model::scenario::{Override, duration};
use mtj_protocol::{
    codec::{self, LARGEST_SAMPLE, Offer},
    member::{Member, Role},
    request::Request,
    sample::{
        ChangeSample, ErrorSample, Header, PresenceSample, RequestSample, Sample, StateSample,
        StatusSample, TorqueSample, text, text_of,
    },
};
use proptest::{
    array::{uniform6, uniform7, uniform14},
    collection::vec,
    num::f64::ANY,
    prelude::*,
};
use std::time::Duration;

prop_compose! {
    fn header()(
        (version, joints, axes, revision) in any::<(u32, u32, u32, u32)>(),
        (run, sequence, time_ns) in any::<(u64, u64, u64)>(),
    ) -> Header {
        Header { version, joints, axes, revision, run, sequence, time_ns }
    }
}

/// Bytes are compared, because not a number does not equal itself.
fn comes_back<S: Sample>(sample: &S) {
    let (mut first, mut second) = ([0; LARGEST_SAMPLE], [0; LARGEST_SAMPLE]);
    let bytes = codec::encode(sample, &mut first);
    assert_eq!(bytes.len(), size_of::<S>());
    let decoded = codec::decode::<S>(bytes).unwrap();
    assert_eq!(codec::encode(&decoded, &mut second), bytes);
    assert!(codec::decode::<S>(&bytes[1..]).is_none());
}

proptest! {
    #[test]
    fn a_state_comes_back(
        header in header(),
        counts in any::<[u64; 7]>(),
        (position, velocity) in (uniform7(ANY), uniform7(ANY)),
        (applied, delivered) in (uniform7(ANY), uniform7(ANY)),
    ) {
        let [sent_ns, latency_ns, round_trip_ns, residence_ns, leader, timed_out, echo_count] = counts;
        comes_back(&StateSample {
            header, sent_ns, latency_ns, round_trip_ns, residence_ns, leader, timed_out, echo_count, position,
            velocity, applied, delivered,
        });
    }

    #[test]
    fn a_torque_comes_back(
        header in header(),
        (state_sent_ns, residence_ns, controller, echo_count) in any::<(u64, u64, u64, u64)>(),
        (torque, echo) in (uniform7(ANY), uniform7(ANY)),
    ) {
        comes_back(&TorqueSample {
            header, state_sent_ns, residence_ns, controller, echo_count, torque, echo,
        });
    }

    #[test]
    fn an_error_comes_back(
        header in header(),
        law in any::<[[u8; 32]; 1]>(),
        (error, error_rate, signals) in (uniform6(ANY), uniform6(ANY), uniform14(ANY)),
    ) {
        comes_back(&ErrorSample { header, law, error, error_rate, signals });
    }

    #[test]
    fn a_status_comes_back(
        header in header(),
        counts in any::<[u64; 12]>(),
        (position, velocity, torque) in (uniform7(ANY), uniform7(ANY), uniform7(ANY)),
    ) {
        let [phase, sent, applied, lost, too_old, late, rejected, misses, stalls, longest, timeouts, takeovers] =
            counts;
        comes_back(&StatusSample {
            header, phase, sent, applied, lost, too_old, late, rejected, deadline_misses: misses,
            stalls, longest_stall_ns: longest, timeouts, takeovers, position, velocity, torque,
        });
    }

    #[test]
    fn a_request_and_the_change_it_makes_come_back(
        header in header(),
        (action, duration_ns, accepted) in any::<(u64, u64, bool)>(),
        torque in uniform7(ANY),
        words in "\\PC{0,200}",
    ) {
        let request = RequestSample { header, action, duration_ns, torque, text: text(&words) };
        comes_back(&request);
        assert!(words.starts_with(text_of(&request.text)));
        let outcome = if accepted { Ok(()) } else { Err(words.as_str()) };
        let change = ChangeSample::answer(header, &request, outcome);
        comes_back(&change);
        assert_eq!(change.outcome().is_ok(), accepted);
    }

    #[test]
    fn a_presence_comes_back(
        header in header(),
        (role, process, since_ns, id, precedence) in any::<(u64, u64, u64, u64, u64)>(),
        host in any::<[[u8; 32]; 2]>(),
    ) {
        comes_back(&PresenceSample { header, role, process, since_ns, id, precedence, host });
    }

    #[test]
    fn an_offer_comes_back(
        (version, revision, run) in any::<(u32, u32, u64)>(),
        (name, text) in ("\\PC{0,40}", "\\PC{0,2000}"),
    ) {
        let offer = Offer { version, revision, run, name, text };
        assert_eq!(codec::decode_offer(&codec::encode_offer(&offer)), Some(offer));
    }

    #[test]
    fn a_member_comes_back(
        role in 0..Role::ALL.len(),
        (id, precedence, since_ns) in (1..u64::MAX, any::<u32>(), any::<u64>()),
    ) {
        let member = Member { role: Role::ALL[role], id, precedence, since_ns };
        assert_eq!(member.to_string().parse(), Ok(member));
    }

    #[test]
    fn a_duration_comes_back_as_exactly_as_a_float_can_tell(nanoseconds in 0_u64..1_000_000_000_000_000_000) {
        let exact = Duration::from_nanos(nanoseconds);
        let told = Duration::from_nanos(nanoseconds as f64 as u64);
        assert_eq!(duration::parse(&duration::format(exact)), Some(told));
    }

    #[test]
    fn what_is_set_comes_back_from_how_it_is_written(path in "[a-z_.]{1,12}", value in "\\PC{0,40}") {
        let set = Override::text(&path, &value);
        assert_eq!(set.to_string().parse(), Ok(set));
    }

    #[test]
    fn a_kick_comes_back_to_the_nanosecond(torque in vec(-1e3_f64..1e3, 7), nanoseconds in 1_u64..60_000_000_000) {
        let kick = Request::Kick { torque, milliseconds: nanoseconds as f64 * 1e-6 };
        let request = kick.to_sample(1, 2);
        assert_eq!(request.duration_ns, nanoseconds);
        assert_eq!(Request::from_sample(&request).map(|kick| kick.to_sample(1, 2)), Ok(request));
    }
}
