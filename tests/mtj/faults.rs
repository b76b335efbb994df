//! Faults in any order: an episode draws them from a seed, and what docs/failures.md promises holds
//! at every sample of it.
//!
//! `MTJ_FAULTS_SECONDS` says for how long episodes follow each other over each bus, 20 unless set;
//! `MTJ_FAULTS_SEED` sets the first. An episode that breaks a promise is shortened, and printed with
//! its seed.

mod disk;
mod episode;
mod fault;
mod promises;

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    time::{Duration, Instant},
};

use self::{disk::Disk, episode::Episode, fault::Fault};
use crate::{
    machine,
    session::chance::{Chance, setting},
};

/// How many faults an episode has.
const FAULTS: usize = 24;

/// The faults of an episode.
fn drawn(seed: u64) -> Vec<Fault> {
    let mut chance = Chance(seed);
    (0..FAULTS).map(|_| Fault::draw(&mut chance)).collect()
}

/// Plays an episode; what promise it broke, if any.
fn play(bus: &str, disk: &Disk, faults: &[Fault]) -> Result<(), String> {
    catch_unwind(AssertUnwindSafe(|| {
        let mut episode = Episode::begin(bus, disk);
        for fault in faults {
            episode.apply(fault);
        }
        episode.end();
    }))
    .map_err(|panic| {
        let words = panic.downcast_ref::<String>().cloned();
        words.unwrap_or_else(|| (*panic.downcast_ref::<&str>().unwrap_or(&"?")).to_owned())
    })
}

/// A shorter episode that breaks a promise, too: without whatever part can be left out.
fn shortened(bus: &str, disk: &Disk, mut faults: Vec<Fault>) -> Vec<Fault> {
    let mut part = faults.len() / 2;
    let mut tries = 12;
    while part > 0 && tries > 0 {
        let mut begin = 0;
        while begin < faults.len() && tries > 0 {
            let end = (begin + part).min(faults.len());
            let without = [&faults[..begin], &faults[end..]].concat();
            tries -= 1;
            if play(bus, disk, &without).is_err() {
                faults = without;
            } else {
                begin = end;
            }
        }
        part /= 2;
    }
    faults
}

fn faults_break_no_promise_over(bus: &str) {
    let _place = machine::alone();
    let disk = Disk::mount();
    let end = Instant::now() + Duration::from_secs(setting("MTJ_FAULTS_SECONDS", 20));
    let first = setting("MTJ_FAULTS_SEED", 1);
    for seed in first.. {
        let faults = drawn(seed);
        if let Err(broken) = play(bus, &disk, &faults) {
            let short = shortened(bus, &disk, faults);
            panic!("MTJ_FAULTS_SEED={seed} over {bus}: {broken}\nshortened to {short:#?}");
        }
        if Instant::now() >= end {
            println!("{bus}: seeds {first} to {seed}");
            return;
        }
    }
}

#[test]
fn faults_in_any_order_break_no_promise_over_shared_memory() {
    faults_break_no_promise_over("iceoryx2");
}

#[test]
fn faults_in_any_order_break_no_promise_over_zenoh() {
    faults_break_no_promise_over("zenoh");
}
