//! A bridge: forwards the messages of one bus to another.
//!
//! The loop is on the *near* bus. The bridge forwards all samples of plant and controllers, their
//! announcements and the scenario to the *far* bus; requests come back. Torques never come back: no
//! process on the far bus takes part in the loop, and no process in the loop can notice the bridge.
//!
//! Samples cross unchanged and are checked by the port that reads them. Only samples of another
//! protocol version are dropped, because their layout is another.

use std::{
    any::Any,
    collections::HashMap,
    fmt,
    time::{Duration, Instant},
};

use mtj_model::scenario::Wait;

use super::{
    Rejections,
    offer::{Follower, encode},
};
use crate::{
    admission::Rejection,
    bus::{self, Attendance, Bus, BusError, Depth, Offering, Reader, Writer},
    member::{Member, Role},
    sample::{
        ChangeSample, ErrorSample, Header, PresenceSample, RequestSample, Sample, StateSample,
        StatusSample, TorqueSample, VERSION,
    },
};

/// How often to look which members are on the near bus.
const LOOK: Duration = Duration::from_millis(250);

/// A bridge from a near bus to a far one.
pub struct Bridge<'a, N, F> {
    near: &'a N,
    far: &'a F,
    states: Route<StateSample>,
    torques: Route<TorqueSample>,
    errors: Route<ErrorSample>,
    statuses: Route<StatusSample>,
    changes: Route<ChangeSample>,
    presences: Route<PresenceSample>,
    requests: Option<Route<RequestSample>>,
    scenario: ScenarioCopy,
    attendance: Box<dyn Attendance>,
    members: HashMap<Member, Box<dyn Any>>,
    look: Instant,
    newest: Option<Header>,
    /// Whether a plant has sent a state since the last look.
    is_alive: bool,
    missed: u64,
    rejections: Rejections,
}

impl<N, F> fmt::Debug for Bridge<'_, N, F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bridge").finish_non_exhaustive()
    }
}

/// Counts of the messages that a bridge has handled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Samples that crossed from the near bus to the far one.
    pub forwarded: u64,
    /// Requests that came back.
    pub returned: u64,
    /// States that were gone before the bridge came to take them.
    pub missed: u64,
    /// Messages that were no samples of this protocol version.
    pub malformed: u64,
}

impl<'a, N: Bus, F: Bus> Bridge<'a, N, F> {
    /// Joins both buses; with `read_only`, no request crosses.
    pub fn open(near: &'a N, far: &'a F, read_only: bool) -> Result<Self, BusError> {
        Ok(Self {
            states: Route::open(near, far)?,
            torques: Route::open(near, far)?,
            errors: Route::open(near, far)?,
            statuses: Route::open(near, far)?,
            changes: Route::open(near, far)?,
            presences: Route::open(near, far)?,
            requests: if read_only { None } else { Some(Route::open(far, near)?) },
            scenario: ScenarioCopy { follower: Follower::subscribe(near)?, offering: None },
            attendance: near.attendance()?,
            members: HashMap::new(),
            look: Instant::now(),
            newest: None,
            is_alive: false,
            missed: 0,
            rejections: Rejections::default(),
            near,
            far,
        })
    }

    /// Forwards all messages since the last call; call it a thousand times a second.
    pub fn forward(&mut self) -> Result<(), BusError> {
        if Instant::now() >= self.look {
            self.look = Instant::now() + LOOK;
            self.announce_members()?;
        }
        let Self { near, far, scenario, newest, is_alive, missed, rejections, .. } = self;
        self.states.forward(rejections, |header| {
            *is_alive = true;
            *missed += gap(newest.replace(*header), header);
            scenario.follow(*near, *far, header)
        })?;
        self.torques.forward(rejections, |_| Ok(()))?;
        self.errors.forward(rejections, |_| Ok(()))?;
        self.changes.forward(rejections, |_| Ok(()))?;
        self.statuses.forward(rejections, |header| scenario.follow(*near, *far, header))?;
        self.presences.forward(rejections, |_| Ok(()))?;
        self.requests.as_mut().map_or(Ok(()), |requests| requests.forward(rejections, |_| Ok(())))
    }

    /// Announces the members of the near bus on the far one.
    fn announce_members(&mut self) -> Result<(), BusError> {
        let present = self.attendance.present()?;
        self.members.retain(|member, _| present.contains(member));
        for member in present {
            if !self.members.contains_key(&member) {
                self.members.insert(member, self.far.announce(&member)?);
            }
        }
        let is_alive = std::mem::take(&mut self.is_alive);
        if is_alive || self.members().any(|member| member.role == Role::Plant) {
            self.scenario.serve()
        } else {
            self.scenario.withdraw();
            Ok(())
        }
    }

    /// The members of the near bus that are announced on the far one.
    pub fn members(&self) -> impl Iterator<Item = &Member> {
        self.members.keys()
    }

    /// What it has forwarded so far.
    pub fn traffic(&self) -> Traffic {
        let (returned, unreadable) =
            self.requests.as_ref().map_or((0, 0), |route| (route.forwarded, route.malformed()));
        Traffic {
            forwarded: self.states.forwarded
                + self.torques.forwarded
                + self.errors.forwarded
                + self.statuses.forwarded
                + self.changes.forwarded
                + self.presences.forwarded,
            returned,
            missed: self.missed,
            malformed: unreadable
                + self.states.malformed()
                + self.torques.malformed()
                + self.errors.malformed()
                + self.statuses.malformed()
                + self.changes.malformed()
                + self.presences.malformed(),
        }
    }
}

/// How many states of a run came between two.
fn gap(before: Option<Header>, header: &Header) -> u64 {
    let same = before.filter(|before| before.run == header.run);
    same.map_or(0, |before| header.sequence.saturating_sub(before.sequence + 1))
}

/// One topic in one direction.
struct Route<S> {
    from: Box<dyn Reader<S>>,
    to: Box<dyn Writer<S>>,
    forwarded: u64,
    /// Samples of another protocol version.
    foreign: u64,
}

impl<S: Sample> Route<S> {
    fn open(from: &impl Bus, to: &impl Bus) -> Result<Self, BusError> {
        let from = from.reader(Depth::Stream, Wait::Block)?;
        Ok(Self { from, to: to.writer()?, forwarded: 0, foreign: 0 })
    }

    /// Forwards the samples that have come; `before` is called with the header of each.
    fn forward(
        &mut self,
        rejections: &mut Rejections,
        mut before: impl FnMut(&Header) -> Result<(), BusError>,
    ) -> Result<(), BusError> {
        // A writer that is faster than this reader must not hold up the other topics.
        for _ in 0..bus::STREAM_DEPTH {
            let Some(sample) = self.from.take()? else { break };
            let version = sample.header().version;
            if version != VERSION {
                self.foreign += 1;
                rejections.warn::<S>(Rejection::Version(version));
                continue;
            }
            before(sample.header())?;
            self.to.write(&sample)?;
            self.forwarded += 1;
        }
        Ok(())
    }

    fn malformed(&self) -> u64 {
        self.foreign + self.from.malformed()
    }
}

/// The plant's scenario, offered again on the far bus.
struct ScenarioCopy {
    follower: Follower,
    offering: Option<Box<dyn Offering>>,
}

impl ScenarioCopy {
    /// Offers the scenario of a sample of the plant's, if it is not on offer yet.
    fn follow(&mut self, near: &impl Bus, far: &impl Bus, header: &Header) -> Result<(), BusError> {
        let Some(offered) = self.follower.follow(near, header)? else { return Ok(()) };
        let bytes = encode(&offered.scenario, offered.run, offered.revision);
        match &mut self.offering {
            Some(offering) => offering.renew(bytes),
            None => {
                self.offering = Some(far.offer(bytes)?);
                Ok(())
            }
        }
    }

    fn serve(&mut self) -> Result<(), BusError> {
        self.offering.as_mut().map_or(Ok(()), |offering| offering.serve())
    }

    /// Withdraws the offer, because there is no plant any more.
    fn withdraw(&mut self) {
        *self = Self { follower: Follower::default(), offering: None };
    }
}
