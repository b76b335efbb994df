//! Two versions of mtj at the same shared memory.

#![cfg(feature = "iceoryx2")]
#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use iceoryx2::prelude::ZeroCopySend;
use mtj_model::scenario::Wait;
use mtj_protocol::{
    bus::{Bus, BusError, Depth},
    iceoryx2::Iceoryx2Bus,
    sample::{Field, FieldMut, Header, Sample, StateSample},
};
use serde::{Deserialize, Serialize};

/// A state as another version lays it out.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, ZeroCopySend)]
#[repr(C)]
struct OtherState {
    header: Header,
    more: u64,
}

impl Sample for OtherState {
    const TOPIC: &'static str = StateSample::TOPIC;
    const ONE_WRITER: bool = true;
    const CLOSES_THE_LOOP: bool = true;

    fn header(&self) -> &Header {
        &self.header
    }
    fn is_finite(&self) -> bool {
        true
    }
    fn fields(&self, _show: &mut dyn FnMut(&'static str, Field<'_>)) {}
    fn header_mut(&mut self) -> &mut Header {
        &mut self.header
    }
    fn field_mut(&mut self, _name: &str) -> Option<FieldMut<'_>> {
        None
    }
}

#[test]
fn another_version_in_the_session_is_told_in_a_sentence() {
    let session = format!("versions-{}", std::process::id());
    let (bus, other) = (Iceoryx2Bus::open(&session).unwrap(), Iceoryx2Bus::open(&session).unwrap());
    let _writer = other.writer::<OtherState>().unwrap();
    let refused = [
        bus.reader::<StateSample>(Depth::Recent, Wait::Block).err(),
        bus.writer::<StateSample>().err(),
    ];
    for error in refused {
        let Some(BusError::Settings(sentence)) = error else { panic!("{error:?}") };
        assert!(sentence.contains(&session) && sentence.contains("another version"), "{sentence}");
        assert!(!sentence.contains("Incompatible"), "{sentence}");
    }
}
