//! The scenario, as a plant offers it.

use std::time::{Duration, Instant};

use mtj_model::scenario::Scenario;

use crate::{
    bus::{Bus, BusError},
    codec::{self, Offer},
    gate::Fault,
    sample::{Header, VERSION},
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

/// How long to wait before asking for a scenario again that was not there.
const PATIENCE: Duration = Duration::from_millis(10);

/// Fetches the scenario whenever the plant's samples tell of another one.
#[derive(Default)]
pub(super) struct Follower {
    known: Option<(u64, u32)>,
    asked: Option<Instant>,
}

impl Follower {
    /// One that has no scenario yet, but is ready to get one: where an offer is sent to those who listen, it
    /// comes to those who have asked before.
    pub fn ready(bus: &impl Bus) -> Result<Self, BusError> {
        bus.fetch()?;
        Ok(Self::default())
    }

    /// One that has a scenario already.
    pub fn knowing(offered: &Offered) -> Self {
        Self { known: Some((offered.run, offered.revision)), asked: None }
    }

    /// The scenario that a sample of the plant's is about, if it is not known yet.
    pub fn follow(&mut self, bus: &impl Bus, header: &Header) -> Result<Option<Offered>, BusError> {
        let is_known = self
            .known
            .is_some_and(|(run, revision)| header.run == run && header.revision <= revision);
        if is_known || self.asked.is_some_and(|asked| asked.elapsed() < PATIENCE) {
            return Ok(None);
        }
        match fetch(bus)? {
            Some(Ok(offered))
                if offered.run == header.run && offered.revision >= header.revision =>
            {
                *self = Self::knowing(&offered);
                Ok(Some(offered))
            }
            // Another run's, which a straggler is about, or none that can be used.
            _ => {
                self.asked = Some(Instant::now());
                Ok(None)
            }
        }
    }
}

/// Fetches the scenario that a plant offers, waiting for one as long as `proceed` says so; `None`
/// when it no longer does.
pub fn fetch_scenario(
    bus: &impl Bus,
    proceed: &dyn Fn() -> bool,
) -> Result<Option<Offered>, BusError> {
    let mut has_complained = false;
    let started = Instant::now();
    let mut is_waiting = false;
    while proceed() {
        if !is_waiting && !has_complained && started.elapsed() > Duration::from_secs(2) {
            is_waiting = true;
            eprintln!("mtj: there is no plant in this session yet; waiting for one");
        }
        match fetch(bus)? {
            Some(Ok(found)) => return Ok(Some(found)),
            Some(Err(sentence)) if !has_complained => {
                eprintln!("mtj: {sentence}");
                has_complained = true;
            }
            _ => {}
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(None)
}

/// An offer as it travels.
pub(super) fn encode(scenario: &Scenario, run: u64, revision: u32) -> Vec<u8> {
    codec::encode_offer(&Offer {
        version: VERSION,
        revision,
        run,
        name: scenario.name.clone(),
        text: scenario.text().to_owned(),
    })
}

/// What a plant offers now; the reason, if that cannot be used.
fn fetch(bus: &impl Bus) -> Result<Option<Result<Offered, String>>, BusError> {
    Ok(bus.fetch()?.map(|bytes| accept(&bytes)))
}

fn accept(bytes: &[u8]) -> Result<Offered, String> {
    let offer = codec::decode_offer(bytes);
    // Another version may have laid out its offer in another way, too.
    let version = offer.as_ref().map(|offer| offer.version).or_else(|| codec::version_of(bytes));
    if let Some(other) = version.filter(|version| *version != VERSION) {
        let sentence = Fault::Version(other).sentence();
        return Err(format!("ignoring the plant's scenario: {sentence}"));
    }
    let offer = offer.ok_or("ignoring a scenario that could not be decoded")?;
    let scenario = Scenario::parse(&offer.name, &offer.text, &[])
        .map_err(|error| format!("ignoring the plant's scenario: {error}"))?;
    Ok(Offered { run: offer.run, revision: offer.revision, scenario })
}
