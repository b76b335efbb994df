//! The transport that a scenario names.

use std::any::Any;

use mtj_model::scenario::{BusKind, BusSettings, Wait};

use crate::{
    bus::{Attendance, Bus, BusError, Depth, Offering, Reader, Sessions, Shared, Writer},
    local::LocalBus,
    member::{Member, Role},
    sample::Sample,
};

#[cfg(feature = "iceoryx2")]
use crate::iceoryx2::Iceoryx2Bus;
#[cfg(feature = "zenoh")]
use crate::zenoh::ZenohBus;

/// Any of the transports, chosen at run time.
#[derive(Debug)]
pub enum AnyBus {
    /// In one process.
    Local(LocalBus),
    /// Shared memory.
    #[cfg(feature = "iceoryx2")]
    Iceoryx2(Iceoryx2Bus),
    /// Zenoh.
    #[cfg(feature = "zenoh")]
    Zenoh(ZenohBus),
}

impl AnyBus {
    /// Checks the settings, as far as that is possible without joining the bus.
    pub fn check(settings: &BusSettings) -> Result<(), BusError> {
        match settings.kind {
            #[cfg(feature = "zenoh")]
            BusKind::Zenoh => ZenohBus::check(settings),
            _ => Ok(()),
        }
    }

    /// Joins the bus that the settings name.
    ///
    /// On Zenoh every role but the plant tries to connect for as long as `proceed` returns true;
    /// `None` when it no longer does.
    pub fn open(
        settings: &BusSettings,
        role: Role,
        proceed: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, BusError> {
        match settings.kind {
            BusKind::Local => Err(BusError::LocalToProcess),
            #[cfg(feature = "iceoryx2")]
            BusKind::Iceoryx2 => Ok(Some(Self::Iceoryx2(Iceoryx2Bus::open(&settings.session)?))),
            #[cfg(feature = "zenoh")]
            BusKind::Zenoh => Ok(ZenohBus::open(settings, role, proceed)?.map(Self::Zenoh)),
            #[cfg(not(all(feature = "iceoryx2", feature = "zenoh")))]
            kind => {
                let _ = (role, proceed);
                Err(BusError::NotBuilt { transport: kind.name() })
            }
        }
    }

    /// Joins the far bus of a bridge, in the place of the plant. A writer may wait a moment rather
    /// than lose a sample, because no loop waits for it.
    pub fn open_for_bridge(
        settings: &BusSettings,
        proceed: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, BusError> {
        match settings.kind {
            #[cfg(feature = "zenoh")]
            BusKind::Zenoh => Ok(ZenohBus::open_for_bridge(settings, proceed)?.map(Self::Zenoh)),
            _ => Self::open(settings, Role::Plant, proceed),
        }
    }
}

macro_rules! on_any {
    ($self:ident, $bus:ident => $call:expr) => {
        match $self {
            Self::Local($bus) => $call,
            #[cfg(feature = "iceoryx2")]
            Self::Iceoryx2($bus) => $call,
            #[cfg(feature = "zenoh")]
            Self::Zenoh($bus) => $call,
        }
    };
}

impl Bus for AnyBus {
    fn writer<S: Sample>(&self) -> Result<Box<dyn Writer<S>>, BusError> {
        on_any!(self, bus => bus.writer())
    }
    fn reader<S: Sample>(&self, depth: Depth, wait: Wait) -> Result<Box<dyn Reader<S>>, BusError> {
        on_any!(self, bus => bus.reader(depth, wait))
    }
    fn offer(&self, bytes: Vec<u8>) -> Result<Box<dyn Offering>, BusError> {
        on_any!(self, bus => bus.offer(bytes))
    }
    fn fetch(&self) -> Result<Option<Vec<u8>>, BusError> {
        on_any!(self, bus => bus.fetch())
    }
    fn announce(&self, member: &Member) -> Result<Box<dyn Any>, BusError> {
        on_any!(self, bus => bus.announce(member))
    }
    fn attendance(&self) -> Result<Box<dyn Attendance>, BusError> {
        on_any!(self, bus => bus.attendance())
    }
    fn reason_for_silence(&self) -> Option<String> {
        on_any!(self, bus => bus.reason_for_silence())
    }
}

impl Shared for AnyBus {
    fn within(&self, session: &str) -> Result<Self, BusError> {
        let _ = session;
        match self {
            Self::Local(_) => Err(BusError::OneSession),
            #[cfg(feature = "iceoryx2")]
            Self::Iceoryx2(bus) => bus.within(session).map(Self::Iceoryx2),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(bus) => bus.within(session).map(Self::Zenoh),
        }
    }
    fn sessions(&self) -> Result<Box<dyn Sessions>, BusError> {
        match self {
            Self::Local(_) => Err(BusError::OneSession),
            #[cfg(feature = "iceoryx2")]
            Self::Iceoryx2(bus) => bus.sessions(),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(bus) => bus.sessions(),
        }
    }
}
