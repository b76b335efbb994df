//! A bridge: what is said on one bus is heard on another.
//!
//! The loop is on the *near* bus. All that plant and controllers say there, who they are, and the scenario
//! cross over to the *far* bus; requests come back. Torques never do: nobody beyond a bridge
//! takes part in the loop, and nobody in the loop can tell whether there is a bridge.
//!
//! Samples cross as they are. Whether they are acceptable is judged where they are used. Only what another protocol
//! version wrote stays behind: it has another layout.

use std::{
    any::Any,
    collections::HashMap,
    time::{Duration, Instant},
};

use mtj_model::scenario::Wait;

use super::{
    Complaints,
    offer::{Follower, encode},
};
use crate::{
    bus::{self, Attendance, Bus, BusError, Depth, Offering, Reader, Writer},
    gate::Fault,
    member::{Member, Role},
    sample::{
        ChangeSample, ErrorSample, Header, PresenceSample, RequestSample, Sample, StateSample,
        StatusSample, TorqueSample, VERSION,
    },
};

/// How often to look who takes part on the near bus.
const LOOK: Duration = Duration::from_millis(250);

/// A bridge from a near bus to a far one.
pub struct Bridge<'a, N, F> {
    near: &'a N,
    far: &'a F,
    states: Lane<StateSample>,
    torques: Lane<TorqueSample>,
    errors: Lane<ErrorSample>,
    statuses: Lane<StatusSample>,
    changes: Lane<ChangeSample>,
    presences: Lane<PresenceSample>,
    requests: Option<Lane<RequestSample>>,
    scenario: Copied,
    attendance: Box<dyn Attendance>,
    members: HashMap<Member, Box<dyn Any>>,
    look: Instant,
    newest: Option<Header>,
    /// Whether a plant has said anything since the last look.
    is_alive: bool,
    missed: u64,
    complaints: Complaints,
}

/// What a bridge has done so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Samples that crossed from the near bus to the far one.
    pub over: u64,
    /// Requests that came back.
    pub back: u64,
    /// States that were gone before the bridge came to take them.
    pub missed: u64,
    /// Messages that were no samples of this protocol version.
    pub malformed: u64,
}

impl<'a, N: Bus, F: Bus> Bridge<'a, N, F> {
    /// Joins both; with `read_only`, no request crosses.
    pub fn open(near: &'a N, far: &'a F, read_only: bool) -> Result<Self, BusError> {
        Ok(Self {
            states: Lane::open(near, far)?,
            torques: Lane::open(near, far)?,
            errors: Lane::open(near, far)?,
            statuses: Lane::open(near, far)?,
            changes: Lane::open(near, far)?,
            presences: Lane::open(near, far)?,
            requests: if read_only { None } else { Some(Lane::open(far, near)?) },
            scenario: Copied { follower: Follower::ready(near)?, offering: None },
            attendance: near.attendance()?,
            members: HashMap::new(),
            look: Instant::now(),
            newest: None,
            is_alive: false,
            missed: 0,
            complaints: Complaints::default(),
            near,
            far,
        })
    }

    /// Carries over all that was said since the last call; to be called a thousand times a second.
    pub fn carry(&mut self) -> Result<(), BusError> {
        if Instant::now() >= self.look {
            self.look = Instant::now() + LOOK;
            self.introduce()?;
        }
        let Self { near, far, scenario, newest, is_alive, missed, complaints, .. } = self;
        self.states.carry(complaints, |header| {
            *is_alive = true;
            *missed += gap(newest.replace(*header), header);
            scenario.follow(*near, *far, header)
        })?;
        self.torques.carry(complaints, |_| Ok(()))?;
        self.errors.carry(complaints, |_| Ok(()))?;
        self.changes.carry(complaints, |_| Ok(()))?;
        self.statuses.carry(complaints, |header| scenario.follow(*near, *far, header))?;
        self.presences.carry(complaints, |_| Ok(()))?;
        self.requests.as_mut().map_or(Ok(()), |requests| requests.carry(complaints, |_| Ok(())))
    }

    /// Announces on the far bus who takes part on the near one.
    fn introduce(&mut self) -> Result<(), BusError> {
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

    /// Who takes part on the near bus, as the far one was told.
    pub fn members(&self) -> impl Iterator<Item = &Member> {
        self.members.keys()
    }

    /// What it has done so far.
    pub fn traffic(&self) -> Traffic {
        let (back, unreadable) =
            self.requests.as_ref().map_or((0, 0), |lane| (lane.carried, lane.malformed()));
        Traffic {
            over: self.states.carried
                + self.torques.carried
                + self.errors.carried
                + self.statuses.carried
                + self.changes.carried
                + self.presences.carried,
            back,
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

/// One topic, one way.
struct Lane<S> {
    from: Box<dyn Reader<S>>,
    to: Box<dyn Writer<S>>,
    carried: u64,
    /// Samples of another protocol version.
    foreign: u64,
}

impl<S: Sample> Lane<S> {
    fn open(from: &impl Bus, to: &impl Bus) -> Result<Self, BusError> {
        let from = from.reader(Depth::Stream, Wait::Block)?;
        Ok(Self { from, to: to.writer()?, carried: 0, foreign: 0 })
    }

    /// Carries over what has come, after `before` has seen to what must be there first.
    fn carry(
        &mut self,
        complaints: &mut Complaints,
        mut before: impl FnMut(&Header) -> Result<(), BusError>,
    ) -> Result<(), BusError> {
        // A writer that is faster than this reader must not hold up the other lanes.
        for _ in 0..bus::STREAM_DEPTH {
            let Some(sample) = self.from.take()? else { break };
            let version = sample.header().version;
            if version != VERSION {
                self.foreign += 1;
                complaints.once::<S>(Fault::Version(version));
                continue;
            }
            before(sample.header())?;
            self.to.write(&sample)?;
            self.carried += 1;
        }
        Ok(())
    }

    fn malformed(&self) -> u64 {
        self.foreign + self.from.malformed()
    }
}

/// The plant's scenario, offered on the far bus as it is on the near one.
struct Copied {
    follower: Follower,
    offering: Option<Box<dyn Offering>>,
}

impl Copied {
    /// Offers the scenario that a sample of the plant's is about, if it does not yet.
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

    /// There is no plant any more that could be meant.
    fn withdraw(&mut self) {
        *self = Self { follower: Follower::default(), offering: None };
    }
}
