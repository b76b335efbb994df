//! The scenario, as a plant offers it.

use std::time::{Duration, Instant};

use mtj_model::scenario::Scenario;

use crate::{
    bus::{Bus, BusError},
    codec,
    gate::Fault,
    sample::VERSION,
};

/// A scenario with the run it belongs to.
#[derive(Clone, Debug, PartialEq)]
pub struct Offered {
    /// The plant's incarnation.
    pub run: u64,
    /// How often the scenario was changed in this run.
    pub revision: u32,
    /// As it is by now.
    pub scenario: Scenario,
}

/// Fetches the scenario that a plant offers, waiting for one as long as `proceed` says so; `None`
/// when it no longer does.
pub fn fetch_scenario(
    bus: &impl Bus,
    proceed: &dyn Fn() -> bool,
) -> Result<Option<Offered>, BusError> {
    let mut complained = false;
    let started = Instant::now();
    let mut is_waiting = false;
    while proceed() {
        if !is_waiting && started.elapsed() > Duration::from_secs(2) {
            is_waiting = true;
            eprintln!("mtj: there is no plant in this session yet; waiting for one");
        }
        match fetch(bus)? {
            Some(Ok(found)) => return Ok(Some(found)),
            Some(Err(sentence)) if !complained => {
                eprintln!("mtj: {sentence}");
                complained = true;
            }
            _ => {}
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(None)
}

/// What a plant offers now; the reason, if that cannot be used.
pub(super) fn fetch(bus: &impl Bus) -> Result<Option<Result<Offered, String>>, BusError> {
    Ok(bus.fetch()?.map(|bytes| accept(&bytes)))
}

fn accept(bytes: &[u8]) -> Result<Offered, String> {
    let offer =
        codec::decode_offer(bytes).ok_or("ignoring a scenario that could not be decoded")?;
    if offer.version != VERSION {
        return Err(format!(
            "ignoring a scenario from a plant of another version; {}",
            Fault::Version.sentence()
        ));
    }
    let scenario = Scenario::parse(&offer.name, &offer.text, &[])
        .map_err(|error| format!("ignoring the plant's scenario: {error}"))?;
    Ok(Offered { run: offer.run, revision: offer.revision, scenario })
}
