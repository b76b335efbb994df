//! The rules that the ports rely on, as tests for any [`Bus`].
//!
//! The three buses of mtj keep these rules. To hold a bus of your own against them, write a
//! [`Fixture`] that joins it, and let [`suite!`] make one test of each rule:
//!
//! ```
//! use std::any::Any;
//!
//! use mtj_conformance::Fixture;
//! use mtj_model::scenario::Wait;
//! use mtj_protocol::{
//!     bus::{Attendance, Bus, BusError, Depth, Offering, Reader, Writer},
//!     local::LocalBus,
//!     member::{Member, Role},
//!     sample::Sample,
//! };
//!
//! /// A bus of your own: here a middleware that changes nothing.
//! struct Own(LocalBus);
//!
//! impl Bus for Own {
//!     fn writer<S: Sample>(&self) -> Result<Box<dyn Writer<S>>, BusError> {
//!         self.0.writer()
//!     }
//!     fn reader<S: Sample>(
//!         &self,
//!         depth: Depth,
//!         wait: Wait,
//!     ) -> Result<Box<dyn Reader<S>>, BusError> {
//!         self.0.reader(depth, wait)
//!     }
//!     fn offer(&self, bytes: Vec<u8>) -> Result<Box<dyn Offering>, BusError> {
//!         self.0.offer(bytes)
//!     }
//!     fn fetch(&self) -> Result<Option<Vec<u8>>, BusError> {
//!         self.0.fetch()
//!     }
//!     fn announce(&self, member: &Member) -> Result<Box<dyn Any>, BusError> {
//!         self.0.announce(member)
//!     }
//!     fn attendance(&self) -> Result<Box<dyn Attendance>, BusError> {
//!         self.0.attendance()
//!     }
//! }
//!
//! /// Two processes of a session are two handles of one `LocalBus`.
//! struct OwnFixture(LocalBus);
//!
//! impl Fixture for OwnFixture {
//!     type Bus = Own;
//!
//!     fn new() -> Self {
//!         Self(LocalBus::default())
//!     }
//!     fn join(&self, _role: Role) -> Own {
//!         Own(self.0.clone())
//!     }
//! }
//!
//! // In a file of `tests/`: one test for each rule.
//! mtj_conformance::suite!(OwnFixture);
//!
//! // A rule is a function; it panics where the bus breaks it.
//! mtj_conformance::transport::a_stream_keeps_order::<OwnFixture>();
//! ```
//!
//! A bus that may lose samples of a burst sets [`Fixture::LOSSY`]. A bus on which other programs
//! can write bytes implements [`Fixture::put_garbage`].

#![warn(clippy::print_stderr, clippy::print_stdout)]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a rule that cannot go on fails its test"
)]

pub mod leader;
pub mod ports;
pub mod requests;
mod session;
pub mod transport;

use mtj_protocol::{bus::Bus, member::Role};

/// A session that the rules join.
pub trait Fixture: Sync {
    /// The bus to test.
    type Bus: Bus;
    /// Whether a burst of samples may have gaps, because a congested bus drops rather than queues.
    const LOSSY: bool = false;
    /// Makes a session that no other test uses.
    fn new() -> Self;
    /// Joins the session as one process does. The plant joins once, before all others.
    fn join(&self, role: Role) -> Self::Bus;
    /// Puts bytes that are no sample on a topic; returns false if the transport does not allow it.
    fn put_garbage(&self, _topic: &str, _bytes: &[u8]) -> bool {
        false
    }
}

/// Defines one `#[test]` for each rule, over the bus of a [`Fixture`].
#[macro_export]
macro_rules! suite {
    ($fixture:ty) => {
        $crate::tests! { $fixture:
            transport::a_stream_keeps_order;
            transport::a_follower_gets_the_newest_once_and_the_stream_gets_all;
            transport::a_follower_gets_the_samples_of_other_writers_too;
            transport::a_reader_returns_at_its_deadline_or_when_a_sample_comes;
            transport::topics_and_sessions_do_not_mix;
            transport::a_monitor_loses_nothing_at_a_kilohertz_beside_a_loop;
            transport::early_and_late_processes_get_the_scenario;
            transport::an_offer_ends_with_its_plant;
            transport::a_role_waits_for_a_scenario_that_it_can_read;
            ports::the_loop_closes_through_the_ports;
            ports::the_plant_rejects_unacceptable_torques;
            ports::the_controller_rejects_unacceptable_states;
            ports::the_controller_repeats_its_answer_and_notices_another_run;
            ports::the_current_state_is_the_one_that_was_received;
            ports::a_monitor_receives_every_acceptable_sample;
            ports::garbage_is_counted_and_the_loop_goes_on;
            requests::a_request_reaches_the_plant_and_its_answer_comes_back;
            requests::requests_for_another_run_or_of_another_version_are_ignored;
            requests::a_changed_scenario_arrives_before_its_samples;
            requests::every_role_publishes_its_presence;
            leader::two_controllers_never_alternate;
            leader::the_best_controller_takes_over_when_the_lease_lapses;
            leader::a_leader_that_has_left_is_replaced_at_once;
            leader::a_lone_controller_that_is_slower_than_its_lease_remains_the_leader;
            leader::an_unannounced_controller_leads_by_answering;
        }
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! tests {
    ($fixture:ty: $($module:ident::$rule:ident;)*) => {
        $(
            #[test]
            fn $rule() {
                $crate::$module::$rule::<$fixture>();
            }
        )*
    };
}
