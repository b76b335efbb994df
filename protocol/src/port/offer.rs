//! The scenario that a plant offers to the other roles.

use std::time::{Duration, Instant};

use mtj_model::scenario::{Scenario, ScenarioError};

use crate::{
    admission::Rejection,
    bus::{Bus, BusError},
    codec::{self, Offer},
    member::Role,
    sample::{Header, VERSION},
    warn_once::WarnOnce,
};

/// A scenario with the run it belongs to.
#[derive(Clone, Debug, PartialEq)]
pub struct Offered {
    /// The plant's incarnation.
    pub run: u64,
    /// How often the scenario was changed in this run.
    pub revision: u32,
    /// The scenario with all changes.
    pub scenario: Scenario,
}

/// Why an offer cannot be used.
#[derive(Debug, thiserror::Error)]
enum OfferError {
    /// The plant has another protocol version.
    #[error("ignoring the plant's scenario: {}", Rejection::Version(*.0))]
    Version(u32),
    #[error("ignoring a scenario that could not be decoded")]
    Malformed,
    #[error("ignoring the plant's scenario: {0}")]
    Scenario(#[from] ScenarioError),
}

/// How long to wait before a scenario that was not there is fetched again.
const RETRY: Duration = Duration::from_millis(10);
/// How long to look for a plant before telling the user that there is none.
const PATIENCE: Duration = Duration::from_secs(2);
/// How often to look for a plant.
const POLL: Duration = Duration::from_millis(5);

/// Fetches the scenario whenever the plant's samples carry a newer run or revision.
#[derive(Debug, Default)]
pub(super) struct Follower {
    /// Run and revision.
    known: Option<(u64, u32)>,
    tried: Option<Instant>,
}

impl Follower {
    /// A follower without a scenario. It fetches once, because some buses deliver an offer only to
    /// processes that have asked before.
    pub(super) fn subscribe(bus: &impl Bus) -> Result<Self, BusError> {
        bus.fetch()?;
        Ok(Self::default())
    }

    /// A follower that has a scenario already.
    pub(super) fn with(offered: &Offered) -> Self {
        Self { known: Some((offered.run, offered.revision)), tried: None }
    }

    /// Returns the scenario of a sample of the plant's, if it is not known yet.
    pub(super) fn follow(
        &mut self,
        bus: &impl Bus,
        header: &Header,
    ) -> Result<Option<Offered>, BusError> {
        let is_known = self
            .known
            .is_some_and(|(run, revision)| header.run == run && header.revision <= revision);
        if is_known || self.tried.is_some_and(|tried| tried.elapsed() < RETRY) {
            return Ok(None);
        }
        match fetch(bus)? {
            Some(Ok(offered))
                if offered.run == header.run && offered.revision >= header.revision =>
            {
                *self = Self::with(&offered);
                Ok(Some(offered))
            }
            // The sample is a late one of another run, or the offer cannot be used.
            _ => {
                self.tried = Some(Instant::now());
                Ok(None)
            }
        }
    }
}

/// Waits for the scenario that a plant offers, for as long as `proceed` returns true; `None` when
/// it no longer does.
pub fn fetch_scenario(
    bus: &impl Bus,
    proceed: &dyn Fn() -> bool,
) -> Result<Option<Offered>, BusError> {
    let mut told = WarnOnce::new();
    let started = Instant::now();
    while proceed() {
        match fetch(bus)? {
            Some(Ok(offered)) => return Ok(Some(offered)),
            Some(Err(error)) if told.first("unusable") => tracing::warn!("{error}"),
            None if started.elapsed() > PATIENCE
                && told.count(&"unusable") == 0
                && told.first("waiting") =>
            {
                tracing::info!("{}", why_waiting(bus)?);
            }
            _ => {}
        }
        std::thread::sleep(POLL);
    }
    Ok(None)
}

/// What to tell the user of a role that waits for a plant.
fn why_waiting(bus: &impl Bus) -> Result<String, BusError> {
    let present = bus.attendance()?.present()?;
    if present.iter().any(|member| member.role == Role::Plant) {
        return Ok(
            "the plant of this session cannot be joined: its shared memory was removed, or it \
                   offers no scenario; start it anew"
                .to_owned(),
        );
    }
    let reason = bus.reason_for_silence().map_or(String::new(), |reason| format!("; {reason}"));
    Ok(format!("there is no plant in this session yet; waiting for one{reason}"))
}

/// Encodes an offer.
pub(super) fn encode(scenario: &Scenario, run: u64, revision: u32) -> Vec<u8> {
    codec::encode_offer(&Offer {
        version: VERSION,
        revision,
        run,
        name: scenario.name.clone(),
        text: scenario.text().to_owned(),
    })
}

/// Fetches and decodes what a plant offers now.
fn fetch(bus: &impl Bus) -> Result<Option<Result<Offered, OfferError>>, BusError> {
    Ok(bus.fetch()?.map(|bytes| decode(&bytes)))
}

fn decode(bytes: &[u8]) -> Result<Offered, OfferError> {
    let offer = codec::decode_offer(bytes);
    // Another version may have another layout of offers, too.
    let version = offer.as_ref().map(|offer| offer.version).or_else(|| codec::version_of(bytes));
    if let Some(other) = version.filter(|version| *version != VERSION) {
        return Err(OfferError::Version(other));
    }
    let offer = offer.ok_or(OfferError::Malformed)?;
    let scenario = Scenario::parse(&offer.name, &offer.text, &[])?;
    Ok(Offered { run: offer.run, revision: offer.revision, scenario })
}
