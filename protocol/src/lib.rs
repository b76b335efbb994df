//! What the processes of a session say to each other.
//!
//! ```text
//! port      what each role may say and hear          PlantPort, ControllerPort, MonitorPort, RequestPort, Bridge
//! knob      what may be asked of a running loop      set, pause, resume, reset, kick
//! gate      what is acceptable                       version, run, order, finite numbers
//! transport the one that a scenario names            AnyBus: local, iceoryx2, zenoh, a file each
//! bus       moving samples: one trait                Bus, Writer, Reader, Offering; Shared, for many sessions
//! member    who takes part                           role, number, precedence
//! certificate  what a certificate says of itself
//! codec     samples as bytes                         bincode, fixed-width little-endian
//! sample    the samples                              repr(C), no pointers, no padding
//! ```
//!
//! Each layer knows only those below it.

pub mod bus;
pub mod certificate;
pub mod codec;
pub mod gate;
#[cfg(feature = "iceoryx2")]
pub mod iceoryx2;
pub mod knob;
pub mod local;
mod mailbox;
pub mod member;
pub mod port;
pub mod realtime;
pub mod sample;
pub mod shutdown;
pub mod transport;
#[cfg(feature = "zenoh")]
pub mod zenoh;
