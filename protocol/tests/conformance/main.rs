//! What every bus must do, written once and run over each of them.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a helper that cannot go on fails its test"
)]

mod charge;
mod knobs;
mod ports;
mod rig;
mod transport;

macro_rules! for_every_bus {
    ($($layer:ident::$property:ident;)*) => {
        mod local { $(#[test] fn $property() { crate::$layer::$property::<crate::rig::Local>(); })* }
        mod iceoryx2 { $(#[test] fn $property() { crate::$layer::$property::<crate::rig::Iceoryx2>(); })* }
        mod zenoh { $(#[test] fn $property() { crate::$layer::$property::<crate::rig::Zenoh>(); })* }
    };
}

for_every_bus! {
    transport::a_stream_keeps_order;
    transport::a_follower_gets_the_newest_once_and_the_stream_gets_all;
    transport::whoever_follows_hears_others_too;
    transport::a_reader_waits_as_long_as_it_is_told_and_no_longer_than_it_must;
    transport::topics_and_sessions_do_not_mix;
    transport::a_monitor_loses_nothing_at_a_kilohertz_beside_a_loop;
    transport::a_late_joiner_gets_the_scenario_and_an_early_one_gets_it_later;
    transport::a_scenario_is_on_offer_as_long_as_its_plant_lives;
    transport::a_role_waits_for_a_scenario_it_can_read;
    ports::the_loop_closes_through_the_ports;
    ports::the_plant_ignores_torques_that_are_not_acceptable;
    ports::the_controller_ignores_states_that_are_not_acceptable;
    ports::the_controller_is_asked_again_and_notices_another_run;
    ports::the_state_at_hand_is_the_one_that_was_heard;
    ports::a_monitor_hears_everything_acceptable;
    ports::rubbish_is_counted_and_the_loop_goes_on;
    knobs::a_wish_comes_to_the_plant_and_its_answer_back;
    knobs::a_wish_for_another_run_or_of_another_version_is_nobodys;
    knobs::a_changed_scenario_comes_before_the_samples_it_is_about;
    knobs::everybody_hears_who_takes_part;
    charge::two_controllers_never_alternate;
    charge::the_best_one_takes_over_when_the_lease_lapses;
    charge::a_leader_that_has_left_is_not_waited_for;
    charge::a_lone_controller_that_is_slower_than_its_lease_stays_in_charge;
    charge::whoever_answers_takes_charge_where_nobody_has_announced_himself;
}
